#!/usr/bin/env bash
# Builds the Python wheel, installs it into an empty environment, and tests it there from an empty folder:
# `test_python.sh`, or `test_python.sh -k EXPRESSION` for some tests (pytest's -k). DCLOTH_TOOL names a `dcloth` to
# compare with; without it the wheel's own command plays the C++ host. DCLOTH_PYTHON names an interpreter other than
# Debian's. Wheel and Panda3D's pictures: out/python. Not part of scripts/test.sh: it builds engine and tools once more,
# and nanobind, numpy and Panda3D come from PyPI.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in
  "" | -k) ;;
  *) echo "test_python: unknown argument '$1'; allowed: -k EXPRESSION" >&2; exit 2 ;;
esac

scripts/install_dependencies.sh build python
python=${DCLOTH_PYTHON:-/usr/bin/python3}
folder=$PWD/out/python
rm -rf "$folder/wheel" "$folder/venv" "$folder/pictures"
mkdir -p "$folder/wheel" "$folder/pictures"
log=$(mktemp)
empty=$(mktemp -d)
trap 'rm -rf "$log" "$empty"' EXIT
"$python" -m venv "$folder/venv"
echo "building $folder/wheel" >&2
{
  "$folder/venv/bin/pip" --disable-pip-version-check wheel --no-deps -w "$folder/wheel" \
    --config-settings="build-dir=$PWD/build-python" --config-settings=cmake.define.DCLOTH_WARNINGS_AS_ERRORS=ON \
    platforms/python
  "$folder/venv/bin/pip" --disable-pip-version-check install "$folder"/wheel/dcloth-*.whl pytest safetensors panda3d
} >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
if [ -n "${DCLOTH_TOOL:-}" ]; then DCLOTH_TOOL=$(realpath "$DCLOTH_TOOL"); export DCLOTH_TOOL; fi
tests=$PWD/platforms/python/tests
cd "$empty"
DCLOTH_PYTHON_PICTURES=$folder/pictures "$folder/venv/bin/python" -m pytest -q -rP -p no:cacheprovider "$@" "$tests"
