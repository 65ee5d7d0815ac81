#!/usr/bin/env bash
# Plays dcloth against what games simulate cloth with, at equal budgets, and writes bench/duel/SKIRT.md, in one command:
#   bench/duel/run.sh [skirt|robe] [--data DATA] [--quick] [--rounds N] [--frames N] [--clips N]
# DATA is ground truth of the garment (training/dcloth_training/simulate), whose reported clips play. Without it the
# bundled test sequences do. Fetches Jolt's source with cargo (Rust 1.95 or later; without it the others play) into
# out/duel, builds in build/duel, and keeps cases and figures in out/duel. One to two hours with all clips of DATA, ten
# minutes without DATA. `bench/duel/run.sh tune GARMENT --data DATA` chooses the rivals' settings again.
set -euo pipefail
cd "$(dirname "$0")/../.."

scripts/install_dependencies.sh build bench train
tune= garment=skirt
if [ "${1:-}" = tune ]; then tune=1; shift; fi
case "${1:-}" in skirt | robe) garment=$1; shift ;; esac
build=build/duel work=out/duel jolt_version=0.3.1
mkdir -p $work

# The crate carries Jolt's C++ source. cargo keeps it in its registry; nothing of it is committed.
jolt=()
if command -v cargo >/dev/null && cargo info "joltc-sys@$jolt_version" >$work/cargo.log 2>&1; then
  crates=${CARGO_HOME:-$HOME/.cargo}/registry/src
  source=$(find "$crates" -maxdepth 2 -type d -name "joltc-sys-$jolt_version*" -print -quit)
  [ -z "$source" ] || jolt=("${source##*/}" "$source/JoltC/JoltPhysics/Build")
fi
[ ${#jolt[@]} -gt 0 ] || echo "no Jolt: cargo did not fetch joltc-sys $jolt_version; the others play" >&2

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building" >&2
{ cmake -S . -B $build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TOOLS=ON -DDCLOTH_BUILD_BENCH=ON \
    -DDCLOTH_DUEL_JOLT="${jolt[1]:-}" &&
  cmake --build $build --target dcloth_cli dcloth_duel dcloth_cloth_solver; } >"$log" 2>&1 ||
  { cat "$log" >&2; exit 1; }

python=.venv/bin/python3
export PYTHONPATH=bench:bench/duel:training OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
DCLOTH_CLOTH_SOLVER=$PWD/$build/training/cloth_solver/libdcloth_cloth_solver.so
export DCLOTH_CLOTH_SOLVER
if [ -n "$tune" ]; then
  exec $python -m duel.tune --program $build/dcloth_duel --garment "$garment" --cases $work "$@"
fi
page=bench/duel/${garment^^}.md
for argument in "$@"; do
  [ "$argument" != --quick ] || page=$work/quick/${garment^^}.md
done
$python -m duel "$garment" --build $build --work $work --page "$page" --jolt "${jolt[0]:-}" "$@"
