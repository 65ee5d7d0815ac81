#!/usr/bin/env bash
# `build_sanitized.sh FOLDER [TARGET...]`: builds tests, or the targets named, with clang under AddressSanitizer and
# UndefinedBehaviorSanitizer, with red zones between the pieces of lent memory. In the environment
# DCLOTH_SANITIZE=thread: under ThreadSanitizer instead; DCLOTH_FUZZERS=ON: libraries get the counters that libFuzzer
# steers by, and there are fuzzers (scripts/fuzz.sh).
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
shift
sanitizers=${DCLOTH_SANITIZE:-address,undefined} fuzzers=${DCLOTH_FUZZERS:-OFF}
command -v clang++ >/dev/null || {
  echo "build_sanitized: found no clang++; run scripts/install_dependencies.sh build test" >&2
  exit 2
}
# CMake forgets options where a tree changes its compiler.
if [ -f "$folder/CMakeCache.txt" ] && ! grep -q '^CMAKE_CXX_COMPILER:.*clang++$' "$folder/CMakeCache.txt"; then
  rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"
fi

red_zones=OFF
[[ $sanitizers != *address* ]] || red_zones=ON

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder" >&2
{
  cmake -S . -B "$folder" -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
    -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DDCLOTH_BUILD_TOOLS=OFF -DDCLOTH_BUILD_TESTS=ON \
    -DDCLOTH_BUILD_FUZZERS=$fuzzers -DDCLOTH_SANITIZE="$sanitizers" -DDCLOTH_ARENA_RED_ZONES=$red_zones \
    -DPython3_EXECUTABLE=/usr/bin/python3
  cmake --build "$folder" --target "${@:-all}"
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
