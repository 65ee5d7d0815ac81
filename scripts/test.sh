#!/usr/bin/env bash
# Installs what the tests need, builds with g++ and warnings as errors, runs every test, then the unit tests again, built
# with clang, under AddressSanitizer and UndefinedBehaviorSanitizer, those that start threads under ThreadSanitizer, then the
# fuzzers for a minute each. Where Blender is not installed (apt-get install blender, half a gigabyte), tests/cli/test_blender.py
# is skipped: point caches are not opened in it then.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_dependencies.sh build test unity import
scripts/build.sh build -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON -DDCLOTH_WARNINGS_AS_ERRORS=ON \
  -DPython3_EXECUTABLE="$PWD/.venv/bin/python"
scripts/build_sanitized.sh build-sanitize

# No job runs beside another where times are measured; the rest shares the cores.
ctest --test-dir build --output-on-failure --no-tests=error -j "$(nproc)"
ctest --test-dir build-sanitize --output-on-failure --no-tests=error -j "$(nproc)"
scripts/test_threads.sh
# Every reader of untrusted bytes, coverage-guided, for a minute each; `scripts/fuzz.sh SECONDS` goes on from there.
scripts/fuzz.sh 60
