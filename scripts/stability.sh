#!/usr/bin/env bash
# Runs the stability tests of every garment in models/ and rewrites models/STABILITY.md from their figures. The
# document is written even where a bound is missed, and then says so; the exit code is that of the tests.
# `stability.sh [build folder]`
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build}

[ -x "$build/stability_test" ] || scripts/build.sh "$build" -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON
code=0
DCLOTH_STABILITY_TICKS=20000 DCLOTH_STABILITY_JSON="$build/stability.json" \
  "$build/stability_test" --gtest_brief=1 || code=$?
python3 scripts/stability_document.py "$build/stability.json" -o models/STABILITY.md
exit "$code"
