#!/usr/bin/env bash
# Tests what a change can break: installs what is needed, builds with g++ and warnings as errors, checks style, runs
# every test but the long ones, then the tests of all code that meets untrusted bytes once more, built with clang, under
# AddressSanitizer and UndefinedBehaviorSanitizer. `test.sh --quick` builds build/ and runs its unit tests alone: two
# minutes where little has changed. The rest (long rollouts, 2,000 frames of pictures, threads, fuzzing):
# scripts/test_long.sh. Where Blender is not installed (apt-get install blender, half a gigabyte), point caches are not
# opened in it.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/steps.sh
quick=
case "${1:-}" in
  "") ;;
  --quick) quick=1 ;;
  *) echo "test: unknown argument '$1'; allowed: --quick" >&2; exit 2 ;;
esac

options=(-DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON -DDCLOTH_WARNINGS_AS_ERRORS=ON
  -DPython3_EXECUTABLE="$PWD/.venv/bin/python3")
if [ -n "$quick" ]; then
  scripts/install_dependencies.sh build test
  step build scripts/build.sh build "${options[@]}" || { closing_line; exit 1; }
  step unit ctest --test-dir build --output-on-failure --no-tests=error -j "$(nproc)" \
    -L "kernels|engine|readers|converter|tools|platforms" || true
  closing_line
  exit
fi

scripts/install_dependencies.sh build test unity import lint
step build scripts/build.sh build "${options[@]}" || { closing_line; exit 1; }
step lint scripts/lint.sh || true
# No job runs beside another where times are measured; the rest shares the cores.
step release ctest --test-dir build --output-on-failure --no-tests=error -j "$(nproc)" || true
# The bundled garments' own attacks, a minute, run without sanitizers above and with them in scripts/test_long.sh.
step build_sanitized scripts/build_sanitized.sh build-sanitize untrusted_tests &&
  { step sanitized ctest --test-dir build-sanitize --output-on-failure --no-tests=error -j "$(nproc)" \
    -L "kernels|engine|readers|platforms|attack" -E attack_bundled_model || true; }
closing_line
