#!/usr/bin/env bash
# Fuzzes every reader of untrusted bytes with clang's libFuzzer under AddressSanitizer and
# UndefinedBehaviorSanitizer. `fuzz.sh [SECONDS [TARGET...]]`: 60 seconds each of model, bundle, sequence, state, gltf
# and, where assimp is installed (install_dependencies.sh import), scene when nothing is said, as many at a time as
# there are cores. They start from what earlier fuzzing left in tests/fuzz/kept; corpora grow in out/fuzz/corpus and are
# taken up again (tests/fuzz/keep.py packs what they reach). An input that breaks something lies in out/fuzz/findings,
# and the script fails.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
shift || true
targets=${*:-}
if ! [[ $seconds =~ ^[1-9][0-9]*$ ]]; then
  echo "fuzz: found SECONDS '$seconds'; allowed: a whole number from 1" >&2
  exit 2
fi
folder=build-fuzz
DCLOTH_FUZZERS=ON scripts/build_sanitized.sh "$folder" fuzzers

mkdir -p out/fuzz/corpus out/fuzz/findings
rm -rf out/fuzz/seeds
"$folder/fuzz_write_seeds" out/fuzz/seeds >&2
[ -n "$targets" ] || targets=$(ls out/fuzz/seeds)  # a folder for each target that could be built

# Runs one target and says what came of it in a line; fails on a finding.
fuzz() {
  local target=$1 corpus=out/fuzz/corpus/$1 result=out/fuzz/$1.log found="nothing found" status=0
  local options=(-max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 -print_final_stats=1 -use_value_profile=1
    -artifact_prefix="out/fuzz/findings/$target-")
  case $target in
    model | state) options+=(-max_len=32768) ;;
    gltf) options+=(-max_len=16384 -dict=tests/fuzz/gltf.dict) ;;
    scene) options+=(-max_len=4096) ;;
    *) options+=(-max_len=65536 -dict=tests/fuzz/safetensors.dict) ;;
  esac
  mkdir -p "$corpus"
  "$folder/fuzz_$target" "${options[@]}" "$corpus" "out/fuzz/seeds/$target" >"$result" 2>&1 || {
    found="a finding: see $result"
    status=1
  }
  local runs coverage kept
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$result")
  coverage=$(grep -ao 'cov: [0-9]* ft: [0-9]*' "$result" | tail -1 || true)
  kept=$(find "$corpus" -type f | wc -l)
  echo "fuzz $target: ${runs:-0} runs in $seconds s, ${coverage:-no coverage}, $kept inputs kept, $found"
  return $status
}

# As many at a time as there are cores.
failed=0 running=0
for target in $targets; do
  if [ "$running" -ge "$(nproc)" ]; then
    wait -n || failed=1
    running=$((running - 1))
  fi
  fuzz "$target" &
  running=$((running + 1))
done
for ((; running > 0; running--)); do wait -n || failed=1; done
exit $failed
