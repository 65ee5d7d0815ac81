#!/usr/bin/env bash
# Builds the web package and page and tests them: `test_web.sh`, or `test_web.sh --only PATTERN` for the tests whose
# files match (grep -E): module, api, worker, types, output (against the native command line, in Node), page (in
# Chromium), and picture, the hashes of the reproducible mode with SIMD and scalar, in Node (tests/picture), or
# simd_picture, those of SIMD alone in a fifth of the time.
# DCLOTH_TOOL names a built `dcloth`; without it, it is built. Pictures of the page: build-web/pictures.
# Not part of scripts/test.sh: two more builds of the engine, and three.js and TypeScript come from npm. Continuous
# integration (.ci/run) runs all but page and the scalar pictures.
set -euo pipefail
cd "$(dirname "$0")/.."

pattern=.
if [ "${1:-}" = --only ]; then
  pattern=${2:?test_web: --only needs a pattern, module for instance}
  shift 2
fi
[ $# -eq 0 ] || { echo "test_web: unknown argument '$1'; allowed: --only PATTERN" >&2; exit 2; }

folder=build-web
scripts/install_dependencies.sh build web
{ command -v chromium && /usr/bin/python3 -c "import numpy, pytest"; } >/dev/null 2>&1 ||
  scripts/install_dependencies.sh test
python3 platforms/web/generate_abi.py engine/abi.json --js platforms/web/api/abi.js --check
scripts/build_web.sh "$folder"

# What the native engine draws, for the same model file.
export DCLOTH_WEB_SITE=$PWD/$folder/site DCLOTH_WEB_NATIVE=$PWD/$folder/native DCLOTH_WEB_PICTURES=$PWD/$folder/pictures
mkdir -p "$DCLOTH_WEB_NATIVE" "$DCLOTH_WEB_PICTURES"
for sequence in models/skirt/sequences/*.safetensors; do
  "${DCLOTH_TOOL:-build/dcloth}" run "$DCLOTH_WEB_SITE/garment/skirt.dcloth" "$sequence" \
    -o "$DCLOTH_WEB_NATIVE/$(basename "$sequence")"
done

picture=tests/picture/test_same_picture.py
mapfile -t tests < <(printf '%s\n' tests/web/*_test.js | grep -E "tests/web/.*($pattern).*_test")
declare -A labels=([simd]=wasm [scalar]=wasm-scalar)
modules=()
if [[ picture =~ $pattern ]]; then modules=(simd scalar); elif [[ simd_picture =~ $pattern ]]; then modules=(simd); fi
[ ${#modules[@]} -eq 0 ] || tests+=("$picture")
[ ${#tests[@]} -gt 0 ] || { echo "test_web: no test's file matches '$pattern'" >&2; exit 2; }
failed=()
for test in "${tests[@]}"; do
  echo "== $test"
  if [ "$test" != "$picture" ]; then
    node --expose-gc --test-reporter spec "$test" || failed+=("$test")
    continue
  fi
  others=
  for module in "${modules[@]}"; do
    ninja -C "$folder/$module" dcloth_picture >"$folder/picture.log" 2>&1 || { cat "$folder/picture.log" >&2; exit 1; }
    others+="${labels[$module]}=node $PWD/$folder/$module/dcloth_picture.js"$'\n'
  done
  DCLOTH_BIN=$(realpath "${DCLOTH_TOOL:-build/dcloth}") DCLOTH_PICTURE_OTHERS=$others \
    /usr/bin/python3 -m pytest -q -rP -p no:cacheprovider "$picture" || failed+=("$test")
done
[ ${#failed[@]} -eq 0 ] || echo "test_web: failed: ${failed[*]}" >&2
echo "test_web: $((${#tests[@]} - ${#failed[@]})) passed, ${#failed[@]} failed"  # files of tests
[ ${#failed[@]} -eq 0 ]
