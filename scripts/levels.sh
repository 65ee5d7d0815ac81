#!/usr/bin/env bash
# Measures each level of detail on the bundled skirt, cost beside error, and crowds in a budget, draws docs/levels.svg
# and rewrites the tables of docs/integrate.md. Fails where a crowd is over its budget by 5 % in more than one frame of
# a thousand, on a machine that holds the same work in all others. Times are of this machine: leave it alone while this
# runs. `levels.sh [build folder]`
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build}

[ -x "$build/scene_garment_test" ] || scripts/build.sh "$build" -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON
json="$build/levels.json"
rm -f "$json"
DCLOTH_LEVELS_JSON="$json" "$build/scene_garment_test" --gtest_brief=1 \
  --gtest_filter='*LevelsByErrorAndCost*skirt:*Crowds*skirt'
/usr/bin/python3 scripts/levels_document.py "$json" --garment skirt --picture docs/levels.svg --page docs/integrate.md
