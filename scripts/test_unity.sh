#!/usr/bin/env bash
# Compiles the Unity package's C# under Mono and runs it against the engine: `test_unity.sh`, or `test_unity.sh --only
# PATTERN` for the tests whose names match (grep -E), "binding|core" for instance. What only Unity's editor can show
# is listed in platforms/unity/README.md.
set -euo pipefail
cd "$(dirname "$0")/.."

pattern=^unity_
if [ "${1:-}" = --only ]; then
  pattern="^unity_.*(${2:?test_unity: --only needs a pattern, core for instance})"
  shift 2
fi
[ $# -eq 0 ] || { echo "test_unity: unknown argument '$1'; allowed: --only PATTERN" >&2; exit 2; }

folder=build
scripts/install_dependencies.sh build test unity
log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder: the Unity package's tests" >&2
{
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON \
    -DDCLOTH_WARNINGS_AS_ERRORS=ON -DPython3_EXECUTABLE="$PWD/.venv/bin/python3"
  ninja -C "$folder" dcloth_unity_tests
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
ctest --test-dir "$folder" --no-tests=error --output-on-failure -R "$pattern"
