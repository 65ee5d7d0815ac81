#!/usr/bin/env bash
# Fuzzes every reader of untrusted bytes with clang's libFuzzer under AddressSanitizer and
# UndefinedBehaviorSanitizer. `fuzz.sh [SECONDS [TARGET...]]`: 60 seconds each of model, bundle, sequence and state
# when nothing is said. Corpora grow in out/fuzz/corpus and are taken up again. An input that breaks something lies in
# out/fuzz/findings, and the script fails.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
shift || true
targets=${*:-model bundle sequence state}
if ! [[ $seconds =~ ^[1-9][0-9]*$ ]]; then
  echo "fuzz: found SECONDS '$seconds'; allowed: a whole number from 1" >&2
  exit 2
fi
folder=build-sanitize
scripts/build_sanitized.sh "$folder" fuzzers

mkdir -p out/fuzz/corpus out/fuzz/findings
"$folder/fuzz_write_seeds" out/fuzz/seeds >&2
failed=0
for target in $targets; do
  corpus=out/fuzz/corpus/$target
  result=out/fuzz/$target.log
  mkdir -p "$corpus"
  options=(-max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 -print_final_stats=1 -use_value_profile=1
    -artifact_prefix="out/fuzz/findings/$target-")
  case $target in
    model | state) options+=(-max_len=32768) ;;
    *) options+=(-max_len=65536 -dict=tests/fuzz/safetensors.dict) ;;
  esac
  found="nothing found"
  "$folder/fuzz_$target" "${options[@]}" "$corpus" "out/fuzz/seeds/$target" >"$result" 2>&1 || {
    found="a finding: see $result"
    failed=1
  }
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$result")
  coverage=$(grep -ao 'cov: [0-9]* ft: [0-9]*' "$result" | tail -1 || true)
  kept=$(find "$corpus" -type f | wc -l)
  echo "fuzz $target: ${runs:-0} runs in $seconds s, ${coverage:-no coverage}, $kept inputs kept, $found"
done
exit $failed
