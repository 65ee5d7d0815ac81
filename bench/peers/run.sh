#!/usr/bin/env bash
# Times dcloth beside general inference runtimes on a paper-size network and on the bundled skirt, and writes
# RESULTS.md, in one command:
#   bench/peers/run.sh [--core C] [--ticks N] [--seconds S]
# Builds the tool and the bench in build/, installs the peers in out/peers/venv (pip; never the system's Python), then
# compares and times; under eight minutes on an idle machine of two cores. Figures also in out/peers/results.json.
set -euo pipefail
cd "$(dirname "$0")/../.."

scripts/install_dependencies.sh build bench
log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building" >&2
{ cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TOOLS=ON -DDCLOTH_BUILD_BENCH=ON &&
  cmake --build build --target dcloth_cli dcloth_peers; } >"$log" 2>&1 || { cat "$log" >&2; exit 1; }

# Each by itself: one that does not install is left out and named in the page. numpy stays the one that Debian's PyTorch
# was built with.
venv=out/peers/venv
[ -x $venv/bin/pip ] || /usr/bin/python3 -m venv --system-site-packages $venv
numpy=$(/usr/bin/python3 -c 'import numpy; print(numpy.__version__)')
for packages in safetensors "onnx onnxruntime" openvino ai-edge-litert ncnn; do
  read -r -a names <<<"$packages"
  $venv/bin/pip install --quiet --disable-pip-version-check "numpy==$numpy" "${names[@]}" >"$log" 2>&1 ||
    { echo "not installed: $packages" >&2; tail -n 3 "$log" >&2; }
done

export PYTHONPATH=bench:bench/peers:training OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 OMP_WAIT_POLICY=passive
$venv/bin/python -m peers --library build/libdcloth_peers.so --dcloth build/dcloth --build build --work out/peers \
  --trained models/skirt/skirt.safetensors models/skirt/sequences/walk_turn.safetensors \
  --json out/peers/results.json --page bench/peers/RESULTS.md "$@"
