#!/usr/bin/env bash
# Measures the bundled garments and how cost grows with a garment's size, and writes bench/results/RESULTS.md and
# bench/scaling/SCALING.md with their pictures, in one command:
#   bench/results/run.sh [--quick]
# Builds the tool and the benches in build/ and the shared library, for its size, in build/shared/; then measures, under
# ten minutes on an idle machine of two cores. Figures also in out/results/results.json. --quick takes few points and
# frames of one garment and writes to out/results/quick/: does it run at all.
set -euo pipefail
cd "$(dirname "$0")/../.."

scripts/install_dependencies.sh build bench
log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building" >&2
{ cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TOOLS=ON -DDCLOTH_BUILD_BENCH=ON &&
  cmake --build build --target dcloth_cli dcloth_peers bench_characters &&
  cmake -S . -B build/shared -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_SHARED_LIBS=ON -DDCLOTH_BUILD_TOOLS=OFF \
    -DDCLOTH_BUILD_TESTS=OFF &&
  cmake --build build/shared --target dcloth; } >"$log" 2>&1 || { cat "$log" >&2; exit 1; }

out=out/results pages=bench
for argument in "$@"; do
  [ "$argument" != --quick ] || { out=out/results/quick pages=out/results/quick; }
done
PYTHONPATH=bench:bench/peers /usr/bin/python3 -m results --build build --shared build/shared/engine/libdcloth.so \
  --work $out --pages $pages "$@"
