#!/usr/bin/env bash
# Builds the C++ tests for other platforms and runs them under emulators:
# `test_platforms.sh [--only PATTERN] [aarch64] [windows]`, both platforms when none is named.
# aarch64: 64-bit Arm Linux under qemu-user. windows: x86-64 by mingw-w64 under Wine, with the command line.
# PATTERN chooses test executables by name (grep -E), "kernels_|engine_" for instance; no others are built. Two steps
# have names of their own: "picture", tests/picture: on Windows the pinned hashes of the reproducible mode, on AArch64
# fewer frames (DCLOTH_PICTURE_FRAMES, 20) against this machine's program; "command_line", on Windows alone: tests/cli
# with dcloth.exe, and its models and vertices against the native ones. Both want DCLOTH_TOOL, a native `dcloth`, and
# the picture on AArch64 `dcloth_picture` where that build has it; without DCLOTH_TOOL they are built. Continuous
# integration runs kernels, engine and pictures on AArch64. What ran and what was left out is printed last; what is
# known of each platform: platforms/README.md.
set -euo pipefail
cd "$(dirname "$0")/.."

# Thousands of ticks of the bundled garments: hours where every instruction is emulated, which Wine does not. What a
# processor's own ways with tiny, large and uneven numbers might change is played there.
declare -A left_out=([aarch64]="stability|scene")
garment_tests=(stability_test scene_frames_test scene_garment_test)
garment_cases="StatisticsTest.*:*.SubnormalMatrices/skirt_int8:*.SubnormalStates/skirt_int8"
garment_cases=${DCLOTH_GARMENT_CASES:-$garment_cases:*.SaturatedStates/skirt_int8:*/skirt_uneven}

only=
if [ "${1:-}" = --only ]; then
  only=${2:?test_platforms: --only needs a pattern, kernels_ for instance}
  shift 2
fi
platforms=("$@")
[ $# -gt 0 ] || platforms=(aarch64 windows)
for platform in "${platforms[@]}"; do
  case $platform in
    aarch64 | windows) ;;
    *) echo "test_platforms: unknown platform '$platform'; allowed: aarch64, windows" >&2; exit 2 ;;
  esac
done

# Sums of GoogleTest's closing lines, "[  PASSED  ] 7 tests.", and ctest's own count.
report() {
  local platform=$1 log=$2 status=$3
  awk -v platform="$platform" -v left_out="${left_out[$platform]:-}" -v only="$only" -v status="$status" '
    match($0, /\[  PASSED  \] [0-9]+/) { split(substr($0, RSTART, RLENGTH), part, " "); passed += part[4] }
    match($0, /\[  FAILED  \] [0-9]+ test/) { split(substr($0, RSTART, RLENGTH), part, " "); failed += part[4] }
    / tests passed, [0-9]+ tests failed out of / { entries = $NF; entries_failed = $4 }
    END {
      if (passed == 0) { print platform ": no case was run"; exit 1 }
      printf "%s: %d cases passed, %d failed, in %d entries of ctest", platform, passed, failed, entries
      if (entries_failed != 0) printf ", %d of which failed", entries_failed
      if (only != "") printf ", only those named %s", only
      printf "; left out:%s tests in Python that are not named here\n",
        left_out == "" ? "" : " of labels " left_out " what is not named here,"
      exit status != 0
    }' "$log"
}

# Names the native tool; builds it, and further targets that are named, if need be.
native_tool() {
  local log=$1/native.log
  shift
  if [ -z "${DCLOTH_TOOL:-}" ]; then
    scripts/install_dependencies.sh test
    { { [ -f build/CMakeCache.txt ] || cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release; } &&
      ninja -C build dcloth_cli "$@"; } >"$log" 2>&1 || { cat "$log" >&2; return 1; }
  fi
  realpath "${DCLOTH_TOOL:-build/dcloth}"
}

# The command line as its users see it, then its models and vertices against the native ones'. Not here: files of
# artists (no assimp), what the file system does to a process (interrupted), pages in a browser, and emptied caches,
# which depend on the machine alone and take minutes where they are large.
test_command_line() {
  local folder=$1 log=$1/command_line.log launcher=$PWD/$1/dcloth-wine tool status=0
  tool=$(native_tool "$folder") || return 1
  printf '#!/bin/sh\nexec wine "%s" "$@"\n' "$PWD/$folder/dcloth.exe" >"$launcher"
  chmod +x "$launcher"
  # Wine's services would hold the tests' pipes open; a server that stays starts them once, with nobody's.
  wineserver -w
  wineserver -p60
  LC_ALL=C.UTF-8 wine wineboot >/dev/null 2>&1 </dev/null
  # In that character set Wine takes file names for UTF-8.
  LC_ALL=C.UTF-8 DCLOTH_BIN=$launcher DCLOTH_NATIVE=$tool .venv/bin/python3 -m pytest -q -rsP -p no:cacheprovider \
    -k "not cold and not projection" \
    tests/cli/test_{names,usage,convert_inspect,run,hostile,overwriting,evaluate,profile,as_native}.py \
    >"$log" 2>&1 || status=1
  wineserver -k || true
  [ $status -eq 0 ] || { cat "$log" >&2; return 1; }
  grep -oE "^(skirt|robe) .* from native" "$log" | sed 's/^/windows: the command line: /' >>"$summary"
  echo "windows: the command line: $(tail -n 1 "$log")" >>"$summary"
}

# The bundled models as the platform's program draws them: against the hashes that are pinned for all, or against this
# machine's program where a frame takes a third of a second.
test_picture() {
  local platform=$1 folder=$2 log=$2/picture.log tool program
  local -a native=()
  case $platform in
    windows)
      tool=$(native_tool "$folder") || return 1
      program="wine $PWD/$folder/dcloth_picture.exe"
      ;;
    aarch64)
      tool=$(native_tool "$folder" dcloth_picture) || return 1
      program="qemu-aarch64 -L /usr/aarch64-linux-gnu $PWD/$folder/dcloth_picture"
      native=(DCLOTH_PICTURE="$(dirname "$tool")/dcloth_picture" DCLOTH_PICTURE_FRAMES="${DCLOTH_PICTURE_FRAMES:-20}")
      ;;
  esac
  env DCLOTH_BIN="$tool" DCLOTH_PICTURE_OTHERS="$platform=$program" "${native[@]}" \
    /usr/bin/python3 -m pytest -q -rP -p no:cacheprovider tests/picture >"$log" 2>&1 || { cat "$log" >&2; return 1; }
  echo "$platform: the pictures: $(tail -n 1 "$log")" >>"$summary"
}

# Cases of the bundled garments' own tests under the emulator, one executable beside the other, with models that the
# native tool has converted.
test_garments() {
  local folder=$1 tool garment program cases log status=0
  tool=$(native_tool "$folder") || return 1
  mkdir -p "$folder/models"
  for garment in models/*/; do
    garment=$(basename "$garment")
    "$tool" convert "models/$garment/$garment.safetensors" --precision int8 \
      -o "$folder/models/$garment.int8.dcloth" >/dev/null || return 1
  done
  local -A running=()
  for program in "${garment_tests[@]}"; do
    grep -qE "${only:-.}" <<<"$program" || continue
    local -a command=(qemu-aarch64 -L /usr/aarch64-linux-gnu "$folder/$program" --gtest_filter="$garment_cases")
    cases=$("${command[@]}" --gtest_list_tests) || return 1
    grep -q '^  ' <<<"$cases" || continue
    DCLOTH_GARMENT_MODELS=$folder/models "${command[@]}" >"$folder/$program.log" 2>&1 &
    running[$program]=$!
  done
  for program in "${!running[@]}"; do
    log=$folder/$program.log
    wait "${running[$program]}" || { grep -E 'Failure$|FAILED' "$log" >&2 || tail -n 40 "$log" >&2; status=1; }
    cases=$(grep -oE '\[  (PASSED|FAILED)  \] [0-9]+ test' "$log" | tr '\n' ' ')
    echo "aarch64: $program: ${cases}of $garment_cases" >>"$summary"
  done
  [ ${#running[@]} -gt 0 ] || { echo "test_platforms: no garment's test is named '$garment_cases'" >&2; return 1; }
  return $status
}

summary=$(mktemp)
trap 'rm -f "$summary"' EXIT
failed=0
for platform in "${platforms[@]}"; do
  targets=()
  scripts/install_dependencies.sh build "cross_$platform"
  folder=build-$platform
  # The command line, which links zlib, is built for Windows alone.
  preset=aarch64-linux linked=()
  if [ "$platform" = windows ]; then preset=x86_64-windows linked=(windows); fi
  scripts/cross_headers.sh "$folder/root" "${linked[@]}"
  if [ -z "$only" ]; then
    scripts/build.sh "$folder" --preset "$preset"
  else
    cmake --preset "$preset" >"$folder/configure.log" 2>&1 || { cat "$folder/configure.log" >&2; exit 1; }
    mapfile -t targets < <(ninja -C "$folder" -t targets all | grep -oE '^([a-z0-9_]+_test|dcloth_picture):' | tr -d : |
      grep -v '^cmake_' | grep -E "$only")
    [[ $platform != windows || ! command_line =~ $only ]] || targets+=(dcloth_cli)
    [ ${#targets[@]} -gt 0 ] || { echo "test_platforms: no test executable is named '$only'" >&2; exit 2; }
    echo "building $folder: ${targets[*]}" >&2
    ninja -C "$folder" "${targets[@]}" >"$folder/build.log" 2>&1 || { cat "$folder/build.log" >&2; exit 1; }
  fi

  log=$folder/ctest.log status=0
  export WINEPREFIX=$PWD/$folder/wine WINEDEBUG=-all
  [ "$platform" = aarch64 ] || wine wineboot --init >/dev/null 2>&1
  [[ $platform != windows || ! command_line =~ ${only:-.} ]] || test_command_line "$folder" || failed=1
  picture=
  if [[ dcloth_picture =~ ${only:-.} ]]; then  # one process, beside those of ctest
    test_picture "$platform" "$folder" &
    picture=$!
  fi
  if [ "$platform" = aarch64 ] && printf '%s\n' "${garment_tests[@]}" | grep -qE "${only:-.}"; then
    test_garments "$folder" || failed=1
    mapfile -t targets < <(printf '%s\n' "${targets[@]}" | grep -vxF "$(printf '%s\n' "${garment_tests[@]}")")
  fi
  if [ -n "$only" ] && [[ ! " ${targets[*]}" =~ _test ]]; then
    [ -z "$picture" ] || wait "$picture" || failed=1
    continue
  fi
  ctest --test-dir "$folder" --no-tests=error ${left_out[$platform]:+-LE "${left_out[$platform]}"} -j "$(nproc)" -V \
    ${only:+-R "$only"} >"$log" 2>&1 || status=$?
  [ "$status" -eq 0 ] || { grep -E 'Failure$|FAILED|\*\*\*|^Errors' "$log" >&2 || tail -n 40 "$log" >&2; failed=1; }
  [ -z "$picture" ] || wait "$picture" || failed=1
  report "$platform" "$log" "$status" >>"$summary" || failed=1
done
cat "$summary"
read -r -a counts <<<"$(awk -f scripts/count_tests.awk "$summary")"
[ "$failed" -eq 0 ] || [ "${counts[1]}" -gt 0 ] || counts[1]=1
echo "test_platforms: ${counts[0]} passed, ${counts[1]} failed"
exit $failed
