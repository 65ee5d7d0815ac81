#!/usr/bin/env bash
# What takes too long for every change, some four hours on two cores: rollouts of 20,000 ticks, the fabric tests of
# both garments, training by several workers, 2,000 frames of pictures with their pinned hashes, here, on 64-bit Arm and
# in WebAssembly, all tests in C++ under sanitizers and on 64-bit Arm, tests that start threads under ThreadSanitizer,
# clang's integer checks, a 32-bit build, five minutes of fuzzing each target, the Python wheel, the Rust crate, the
# packages of a release. `test_long.sh [STEP...]`: rollouts, training, pictures, sanitized, threads, integers, 32bit,
# fuzz, aarch64, web, python, rust, packages; all when none is named. Before a release; after a change of training,
# kernels or format.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/steps.sh
steps=("$@")
[ $# -gt 0 ] || steps=(rollouts training pictures sanitized threads integers 32bit fuzz aarch64 web python rust packages)

scripts/install_dependencies.sh build test import
step build scripts/build.sh build -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON -DDCLOTH_WARNINGS_AS_ERRORS=ON \
  -DPython3_EXECUTABLE="$PWD/.venv/bin/python3" || { closing_line; exit 1; }
export DCLOTH_TOOL=build/dcloth
for name in "${steps[@]}"; do
  case $name in
    rollouts) step rollouts scripts/stability.sh || true ;;
    training)
      scripts/install_dependencies.sh train
      step training .venv/bin/python3 -m pytest -q -p no:cacheprovider -m long training/tests || true
      ;;
    pictures)
      DCLOTH_PICTURE_FRAMES=2000 \
        step pictures ctest --test-dir build --output-on-failure --no-tests=error -R '^picture$' || true
      ;;
    sanitized)
      step build_sanitized scripts/build_sanitized.sh build-sanitize &&
        { step sanitized ctest --test-dir build-sanitize --output-on-failure --no-tests=error -j "$(nproc)" || true; }
      ;;
    threads) step threads scripts/test_threads.sh || true ;;
    integers) step integers scripts/test_integers.sh || true ;;
    32bit) step 32bit scripts/test_32bit.sh || true ;;
    fuzz) step fuzz scripts/fuzz.sh 300 || true ;;
    aarch64) step aarch64 scripts/test_platforms.sh aarch64 || true ;;
    web) DCLOTH_PICTURE_FRAMES=2000 step web scripts/test_web.sh || true ;;
    python) step python scripts/test_python.sh || true ;;
    rust) step rust scripts/test_rust.sh || true ;;
    packages) step packages scripts/package.sh --install --only . --test || true ;;
    *)
      echo "test_long: unknown step '$name'; allowed: rollouts, training, pictures, sanitized, threads," \
        "integers, 32bit, fuzz, aarch64, web, python, rust, packages" >&2
      exit 2
      ;;
  esac
done
closing_line
