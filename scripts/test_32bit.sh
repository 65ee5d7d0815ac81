#!/usr/bin/env bash
# 32-bit x86: `test_32bit.sh [TEST...]` builds the tests of kernels, engine, ABI and attacks with g++ -m32 under
# UndefinedBehaviorSanitizer and runs them, or those named (ctest -R). Sizes and addresses have 32 bits there, as in
# WebAssembly and on small Arm devices: what wraps shows. Five minutes on two cores: scripts/test_long.sh
# runs it.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build-32bit

scripts/install_dependencies.sh build test cross_i386
# Debian's g++-multilib would bring the 64-bit kernel headers into sight and takes the cross compilers away; so they are
# named here. SSE2 counts as on every processor of today: x87 keeps more bits than a float has.
flags="-m32 -msse2 -mfpmath=sse -idirafter /usr/include/x86_64-linux-gnu"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder" >&2
{
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_FLAGS="$flags" -DCMAKE_CXX_FLAGS="$flags" \
    -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DDCLOTH_SANITIZE=undefined -DDCLOTH_BUILD_TOOLS=OFF -DDCLOTH_BUILD_TESTS=ON \
    -DDCLOTH_GOOGLETEST_SOURCE=/usr/src/googletest -DPython3_EXECUTABLE="$PWD/.venv/bin/python3"
  cmake --build "$folder" --target tests/unit/kernels/all tests/unit/engine/all tests/unit/fit/all tests/abi/all \
    attack_without_converter
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }

# Costs a byte are those of 64-bit builds without sanitizers.
UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ctest --test-dir "$folder" --output-on-failure --no-tests=error \
  -j "$(nproc)" -R "${*:-^(abi_|attack_|kernels_|engine_|fit_)}" -E "abi_symbols|attack_bundled"
