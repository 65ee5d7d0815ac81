#!/usr/bin/env bash
# Compiles the GDExtension with godot-cpp, whose sources GODOT_CPP_DIR names (version 10), into build-godot, and plays
# the skirt with it in a host that speaks Godot's C interface (tests/godot/host.cc). DCLOTH_TOOL names the `dcloth` that
# converts the model (build/dcloth by default). Some minutes on two cores. Not part of scripts/test.sh: godot-cpp is no
# package of Debian. The node itself is tested by `ctest -L godot`.
set -euo pipefail
cd "$(dirname "$0")/.."
[ -f "${GODOT_CPP_DIR:-}/binding_generator.py" ] ||
  { echo "test_godot: GODOT_CPP_DIR is '${GODOT_CPP_DIR:-}'; it must name the sources of godot-cpp" >&2; exit 2; }
scripts/install_dependencies.sh build

tool=${DCLOTH_TOOL:-build/dcloth}
[ -x "$tool" ] || scripts/build.sh build
failed() { echo "test_godot: $1" >&2; exit 1; }
log=$(mktemp)
trap 'rm -f "$log"' EXIT
{ cmake -S platforms/godot -B build-godot -G Ninja -DGODOT_CPP_DIR="$GODOT_CPP_DIR" && cmake --build build-godot; } \
  >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
! grep -E "platforms/(godot|garment)/.*warning:" "$log" || failed "the extension compiles with warnings"

addon=build-godot/addons/dcloth
library=$(ls $addon/libdcloth.*.so)
entry=$(sed -n 's/^entry_symbol = "\(.*\)"/\1/p' $addon/dcloth.gdextension)
grep -q "\"$(basename "$library")\"" $addon/dcloth.gdextension || failed "dcloth.gdextension does not name $library"
symbols=$(nm -D --defined-only "$library" | awk '$3 ~ /dcloth|godot/ { print $3 }')
[ "$symbols" = "$entry" ] ||
  failed "it exports '$symbols'; allowed: '$entry' alone, for other extensions may hold dcloth too"
g++ -std=c++20 -Wall -Wextra -Werror -Iengine/include -Ibuild-godot/godot-cpp/gen/include tests/godot/host.cc \
  build-godot/dcloth/engine/libdcloth.a -o build-godot/host -ldl
"$tool" convert models/skirt/skirt.safetensors -o build-godot/skirt.dcloth --precision fp32 >/dev/null
build-godot/host "$library" "$entry" build-godot/skirt.dcloth
echo "$library: $(stat -c %s "$library") bytes"
echo "test_godot: 2 passed, 0 failed"
