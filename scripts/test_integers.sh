#!/usr/bin/env bash
# Clang's integer checks: `test_integers.sh [TEST...]` builds the tests of kernels, engine and attacks with
# -fsanitize=integer, which also stops where unsigned numbers wrap or a conversion loses bits, and runs them, or those
# named (ctest -R). Sums that wrap on purpose are listed in scripts/integers.ignore. Five minutes on two cores:
# scripts/test_long.sh runs it.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build-integers

scripts/install_dependencies.sh build test
log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder" >&2
{
  cmake -S . -B "$folder" -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=Debug \
    -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DDCLOTH_BUILD_TOOLS=OFF -DDCLOTH_BUILD_TESTS=ON \
    -DDCLOTH_SANITIZE=undefined,integer \
    -DCMAKE_CXX_FLAGS="-fsanitize-ignorelist=$PWD/scripts/integers.ignore" -DPython3_EXECUTABLE="$PWD/.venv/bin/python3"
  cmake --build "$folder" --target tests/unit/kernels/all tests/unit/engine/all tests/unit/fit/all \
    attack_without_converter
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ctest --test-dir "$folder" --output-on-failure --no-tests=error \
  -j "$(nproc)" -R "${*:-^(attack_|kernels_|engine_|fit_)}" -E "attack_bundled"
