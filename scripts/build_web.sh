#!/usr/bin/env bash
# Builds the engine for the web: `build_web.sh [FOLDER]`, build-web when none is named.
#   FOLDER/site          a page to put on any web server: characters in the bundled skirt, sliders, figures
#   FOLDER/site/dcloth   the npm package: API, types, dcloth.wasm (SIMD) and dcloth-scalar.wasm
# DCLOTH_TOOL names a built `dcloth` that converts the skirt; without it, it is built.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-build-web}
web=platforms/web

scripts/install_dependencies.sh build web
command -v npm >/dev/null || scripts/install_dependencies.sh npm
scripts/cross_headers.sh "$folder/root"
include=$(realpath "$folder")/root/usr/include
# Emscripten brings its own launcher of its own compiler.
unset CMAKE_C_COMPILER_LAUNCHER CMAKE_CXX_COMPILER_LAUNCHER
for variant in simd scalar; do
  simd=ON
  [ "$variant" = simd ] || simd=OFF
  echo "building $folder/$variant" >&2
  {
    emcmake cmake -S . -B "$folder/$variant" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_WARNINGS_AS_ERRORS=ON \
      -DDCLOTH_WASM_SIMD=$simd -DDCLOTH_BUILD_TOOLS=OFF -DDCLOTH_BUILD_TESTS=OFF -DDCLOTH_BUILD_MAPPED_FILE=OFF \
      -DDCLOTH_HIGHWAY_INCLUDE_DIR="$include" -DDCLOTH_FLATBUFFERS_INCLUDE_DIR="$include" \
      -DPython3_EXECUTABLE=/usr/bin/python3
    ninja -C "$folder/$variant" dcloth_web
  } >"$folder/$variant.log" 2>&1 || { cat "$folder/$variant.log" >&2; exit 1; }
done

tool=${DCLOTH_TOOL:-}
if [ -z "$tool" ]; then
  tool=build/dcloth
  echo "building $tool" >&2
  fresh=(-G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=OFF)
  [ ! -f build/CMakeCache.txt ] || fresh=()
  { cmake -S . -B build "${fresh[@]}" && ninja -C build dcloth_cli; } >"$folder/native.log" 2>&1 ||
    { cat "$folder/native.log" >&2; exit 1; }
fi

# three.js and TypeScript at the versions of the lock file; no package runs code of its own here.
mkdir -p "$folder/npm"
cp $web/package.json $web/package-lock.json "$folder/npm/"
if ! cmp -s $web/package-lock.json "$folder/npm/installed.json"; then
  npm ci --prefix "$folder/npm" --ignore-scripts --no-audit --no-fund >"$folder/npm.log" 2>&1 ||
    { cat "$folder/npm.log" >&2; exit 1; }
  cp $web/package-lock.json "$folder/npm/installed.json"
fi
modules=$folder/npm/node_modules

site=$folder/site
rm -rf "$site"
mkdir -p "$site"/{page,dcloth,garment} "$site"/three/{build,examples/jsm/controls,examples/jsm/environments}
cp $web/page/index.html "$site/"
cp $web/page/*.js $web/page/*.css "$site/page/"
cp $web/api/*.js $web/three/three.{js,d.ts} $web/package.json $web/README.md $web/page.png LICENSE "$site/dcloth/"
"$modules/.bin/tsc" --project $web/tsconfig.json --outDir "$site/dcloth"
cp "$folder/simd/dcloth_web.wasm" "$site/dcloth/dcloth.wasm"
cp "$folder/scalar/dcloth_web.wasm" "$site/dcloth/dcloth-scalar.wasm"
cp "$modules"/three/build/three.{core,module}.js "$site/three/build/"
cp "$modules/three/LICENSE" "$site/three/"
cp "$modules/three/examples/jsm/controls/OrbitControls.js" "$site/three/examples/jsm/controls/"
cp "$modules/three/examples/jsm/environments/RoomEnvironment.js" "$site/three/examples/jsm/environments/"
"$tool" convert models/skirt/skirt.safetensors -o "$site/garment/skirt.dcloth" --precision int8 >"$folder/convert.txt"
python3 $web/extract_character.py models/skirt/skirt.safetensors "$site/garment/character.safetensors"
cp models/skirt/sequences/{walk_turn,run_stop}.safetensors "$site/garment/"
echo "$site: serve it, for instance: python3 -m http.server --directory $site" >&2
