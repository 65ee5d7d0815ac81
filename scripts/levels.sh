#!/usr/bin/env bash
# Measures each level of detail on the bundled skirt, cost beside error, and crowds in a budget, draws docs/levels.svg
# and rewrites the tables of docs/integrate.md. Fails where a crowd is over its budget by 5 % in more than one frame of
# a thousand. Times are of this machine: leave it alone while this runs. `levels.sh [build folder]`
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build}

[ -x "$build/scene_garment_test" ] || scripts/build.sh "$build" -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=ON
json=$build/levels.json crowds=$build/crowds.json model=$build/levels.dcloth
rm -f "$json" "$crowds"
DCLOTH_LEVELS_JSON="$json" "$build/scene_garment_test" --gtest_brief=1 --gtest_filter='*LevelsByErrorAndCost*skirt'
"$build/dcloth" convert models/skirt/skirt.safetensors -o "$model" --precision int8 >/dev/null
for crowd in "16 2" "16 2 --contact" "20 2" "50 2" "50 4"; do
  read -r count budget more <<<"$crowd"
  # It ends with 1 where a frame missed the budget; late ones are judged below.
  # shellcheck disable=SC2086
  "$build/dcloth" profile "$model" models/skirt/sequences/walk_turn.safetensors --characters "$count" \
    --budget-ms "$budget" --frames 3000 --json ${more:-} >>"$crowds" || [ $? -eq 1 ]
done
/usr/bin/python3 scripts/levels_document.py "$json" "$crowds" --garment skirt --picture docs/levels.svg \
  --page docs/integrate.md
