#!/usr/bin/env bash
# From a fresh clone to a moving garment. Installs what is missing, builds, converts the bundled skirt to fp32, fp16 and
# int8, runs motion it never saw through each on one thread, prints one table, and writes
#   out/demo/skirt-{fp32,fp16,int8}.dcloth   the models
#   out/demo/evaluate.json                   the table's numbers
#   out/demo/report.html                     table, plots and the garment in 3D; open it in any browser
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_dependencies.sh build
scripts/build.sh build -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=OFF

bundle=models/skirt/skirt.safetensors
mkdir -p out/demo
for precision in fp32 fp16 int8; do
  build/dcloth convert "$bundle" -o "out/demo/skirt-$precision.dcloth" --precision "$precision" \
    >"out/demo/convert-$precision.txt"
done

# One run measures: its JSON, the table on stderr and the report are the same numbers.
build/dcloth evaluate "$bundle" models/skirt/sequences/*.safetensors \
  --json --html out/demo/report.html >out/demo/evaluate.json.part
mv out/demo/evaluate.json.part out/demo/evaluate.json
echo "open out/demo/report.html in a browser to see it move"
