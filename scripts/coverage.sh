#!/usr/bin/env bash
# Builds engine and kernels with counters (g++, no optimisation), runs the tests of both and prints how many lines of
# each file they ran; fails below 95 %. `coverage.sh --missing` names the lines, too. Not part of scripts/test.sh: it is
# a build of its own. Left out: attack_stack, whose bound is that of an optimised build, and what needs the converter.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build-coverage

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder" >&2
{
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_FLAGS_DEBUG="-O1" -DCMAKE_CXX_FLAGS_DEBUG="-O1" \
    -DDCLOTH_BUILD_TOOLS=OFF -DDCLOTH_BUILD_TESTS=ON -DDCLOTH_COVERAGE=ON -DPython3_EXECUTABLE=/usr/bin/python3
  ninja -C "$folder" coverage_tests
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }

find "$folder" -name '*.gcda' -delete
ctest --test-dir "$folder" --output-on-failure --no-tests=error -j "$(nproc)" -L '^(kernels|engine|fit|attack|abi)$' \
  -E 'attack_stack|attack_bundled_model|fuzz_replay|consumer|abi_symbols|abi_manifest' >"$log" ||
  { cat "$log" >&2; exit 1; }
tail -n 4 "$log" >&2
scripts/coverage.py "$folder" "$@"
