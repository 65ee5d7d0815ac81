#!/usr/bin/env bash
# Uses each package of a release as somebody who has nothing else: `test_packages.sh [--only PATTERN] [FOLDER]`; FOLDER
# is what scripts/package.sh wrote, out/packages when not named. PATTERN chooses packages by name (grep -E): sums,
# garments, linux-x86_64, npm, unity. The last two play the models of FOLDER. Each is unpacked in an empty folder and
# used with a bare environment: what its README says is typed, a host in C is built against it by CMake and by
# pkg-config, models are played, Unity's C# under Mono. A package that is not in FOLDER, or whose tools are not
# installed, is listed as not tested.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
only=.
if [ "${1:-}" = --only ]; then
  only=${2:?test_packages: --only needs a pattern, linux for instance}
  shift 2
fi
[ $# -le 1 ] || { echo "test_packages: unknown argument '$2'; allowed: [--only PATTERN] [FOLDER]" >&2; exit 2; }
folder=$(realpath "${1:-out/packages}")
version=$(scripts/package_files.py version)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/home"

# bare COMMAND...: with none of this shell's settings but the paths of programs and npm's own.
bare() {
  local -a kept=("PATH=$PATH" "HOME=$work/home" LC_ALL=C.UTF-8) name
  for name in "${!npm_config_@}" "${!NPM_CONFIG_@}"; do
    [ -z "${!name:-}" ] || kept+=("$name=${!name}")
  done
  env -i "${kept[@]}" "$@"
}

fail() {
  echo "test_packages: $*" >&2
  exit 1
}

# holds WHERE PATTERN TEXT
holds() {
  grep -qE -- "$2" <<<"$3" || fail "$1: expected $2, found: ${3:-nothing}"
}

# unpack NAME ARCHIVE: into an empty folder; prints where the files are.
unpack() {
  local into=$work/$1
  mkdir "$into"
  tar -C "$into" -xf "$folder/$2"
  local -a found=("$into"/*)
  [ ${#found[@]} -eq 1 ] || fail "$2: ${#found[@]} folders at the top, expected 1"
  [ -f "${found[0]}/LICENSE" ] || fail "$2: no LICENSE"
  printf '%s\n' "${found[0]}"
}

# The blocks of a page in one language, one after the other: blocks PAGE LANGUAGE.
blocks() {
  awk -v fence='```'"$2" '$0 == "```" { on = 0 } on { print } $0 == fence { on = 1 }' "$1"
}

# play FOLDER COMMAND...: inspects and runs every garment in share/dcloth by the command.
play() {
  local here=$1 garment name said count=0
  shift
  cd "$here"
  for garment in share/dcloth/*.dcloth; do
    name=$(basename "$garment" .dcloth)
    said=$(bare "$@" inspect "$garment" --json)
    holds "inspect $name" '"vertices": ?[1-9]' "$said"
    said=$(bare "$@" run "$garment" "share/dcloth/sequences/$name-walk_turn.safetensors" -o "$name.safetensors" 2>&1)
    holds "run $name" '[1-9][0-9]+ frames' "$said"
    count=$((count + 1))
  done
  [ $count -ge 2 ] || fail "$here: $count garments, expected 2 or more"
}

licences_are_there() {
  local name
  for name in "${@:2}"; do
    [ -s "$1/$name.txt" ] || fail "$1: no licence of $name"
  done
}

test_sums() {
  cd "$folder"
  [ "$(wc -l <SHA256SUMS)" -gt 0 ] || fail "SHA256SUMS is empty"
  sha256sum --check --quiet SHA256SUMS
}

test_garments() {
  local here garment
  here=$(unpack garments "dcloth-$version-garments.tar.xz")
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    for file in README.md "$garment.safetensors" "$garment.dcloth" sequences/walk_turn.safetensors; do
      [ -s "$here/$garment/$file" ] || fail "$garment/$file is missing"
    done
    [ ! -f "$folder/$garment-$version.dcloth" ] || cmp "$here/$garment/$garment.dcloth" "$folder/$garment-$version.dcloth"
  done
}

# What the README says, typed; then evaluate, which wants a bundle.
test_linux_x86_64() {
  local here said garment
  here=$(unpack linux-x86_64 "dcloth-$version-linux-x86_64.tar.xz")
  said=$(ldd "$here/bin/dcloth" 2>&1 || true)
  holds "ldd bin/dcloth" "not a dynamic executable|statically linked" "$said"
  if strings -a "$here/bin/dcloth" "$here/lib/libdcloth.a" | grep -F "$root"; then fail "a path of the building machine is left"; fi
  licences_are_there "$here/licenses" dcloth highway flatbuffers cli11 nlohmann-json eigen zlib gcc glibc
  blocks "$here/README.md" sh >"$work/typed.sh"
  [ "$(grep -c . "$work/typed.sh")" -gt 8 ] || fail "README.md: hardly any command"
  said=$(cd "$here" && bare bash -euo pipefail "$work/typed.sh" 2>&1) || fail "README.md: $said"
  holds "the host by CMake and by pkg-config" "(skirt on [a-z0-9]+: [0-9]+ vertices.*){2}" "$(tr '\n' ' ' <<<"$said")"
  [ "$(stat -c %s "$here/skirt.html")" -gt 100000 ] || fail "skirt.html is too small"
  rm -rf "$here/game"
  play "$here" "$here/bin/dcloth"
  cd "$here"
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    "$root/scripts/package_files.py" clip "$root/models/$garment/sequences/walk_turn.safetensors" "$work/clip.safetensors" 20
    said=$(bare bin/dcloth evaluate "$root/models/$garment/$garment.safetensors" "$work/clip.safetensors" --precision int8 --json 2>/dev/null)
    holds "evaluate $garment" '"truth"' "$said"
  done
}

# A project that installs the tarball, plays a garment here and in a worker, and finds types.
test_npm() {
  local here=$work/npm said garment
  mkdir "$here"
  cd "$here"
  echo '{ "type": "module" }' >package.json
  bare npm install --no-audit --no-fund --ignore-scripts "$folder/dcloth-$version-npm.tgz" >npm.log 2>&1 || fail "npm: $(cat npm.log)"
  licences_are_there node_modules/dcloth/licenses dcloth highway flatbuffers emscripten
  for garment in index worker three engine; do
    [ -s "node_modules/dcloth/$garment.d.ts" ] || fail "no types of $garment"
  done
  cat >play.js <<'END'
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { Worker } from "node:worker_threads";
import { loadEngine } from "dcloth";
import { startWorker } from "dcloth/worker";

const path = (name) => fileURLToPath(import.meta.resolve(name));
const simd = readFileSync(path("dcloth/dcloth.wasm"));
const engine = await loadEngine({ simd });
const worker = await startWorker({ worker: new Worker(path("dcloth/worker_node.js")), simd });
for (const file of process.argv.slice(2)) {
  const model = engine.openModel(readFileSync(file), file), there = await worker.openModel(readFileSync(file), file);
  const cloth = model.createCloth({ jointNames: model.jointNames });
  const other = await there.createCloth({ jointNames: model.jointNames });
  let apart = 0, moved = 0;
  for (let frame = 0; frame < 30; ++frame) {
    const before = cloth.positions.slice();
    for (const one of [cloth, other]) {
      one.pose.set(model.bindMatrices);
      for (let j = 12; j < one.pose.length; j += 16) one.pose[j] += 0.02 * frame;
      await one.update(1 / 30);
    }
    cloth.positions.forEach((x, i) => { apart = Math.max(apart, Math.abs(x - other.positions[i])); });
    moved = cloth.positions.reduce((sum, x, i) => sum + Math.abs(x - before[i]), 0);
  }
  if (!(apart === 0 && moved > 1 && cloth.positions.every(Number.isFinite))) throw new Error(`${file}: ${apart} ${moved}`);
  console.log(`played ${model.name}: ${model.vertexCount} vertices, ${engine.version} ${engine.instructionSet}`);
}
worker.terminate();
END
  local -a models=("$folder"/*-"$version".dcloth)
  [ -f "${models[0]}" ] || fail "no models in $folder; scripts/package.sh --only models makes them"
  said=$(bare node play.js "${models[@]}" 2>&1) || fail "node: $said"
  [ "$(grep -c "^played .*[1-9][0-9]* vertices, $version wasm$" <<<"$said")" -eq ${#models[@]} ] || fail "node: $said"
}

# The package as the package manager reads it, and its C# with its own plugin on this system.
test_unity() {
  local here=$work/unity said model
  python3 tests/unity/check_package.py "$folder/com.dcloth.unity-$version.tgz" "$version" LICENSE
  mkdir "$here"
  tar -C "$here" -xf "$folder/com.dcloth.unity-$version.tgz"
  grep -q "Apache License" "$here/package/Third Party Notices.md" || fail "unity: the notices hold no licence"
  if ! command -v mcs >/dev/null; then echo "unity: C# was not run: no Mono"; return; fi
  cat >"$here/play.cs" <<'END'
using System;
using System.IO;
using DCloth;

internal static unsafe class Play
{
    private static int Main(string[] files)
    {
        foreach (string file in files)
        {
            byte[] bytes = File.ReadAllBytes(file);
            using (ClothModel model = ClothModel.Open(bytes, file))
            using (var player = new ClothPlayer(model, ClothSpace.Model, model.JointNames))
            {
                for (int frame = 0; frame < 30; ++frame)
                {
                    for (int i = 0; i < 16 * player.Bones.Length; ++i) player.JointMatrices[i] = i % 16 % 5 == 0 ? 1 : 0;
                    for (int j = 0; j < player.Bones.Length; ++j) player.JointMatrices[16 * j + 13] = 0.02f * frame;
                    if (player.Advance(1 / 30f) != ClothStatus.Ok) return 1;
                }
                Console.WriteLine("played {0}: {1} vertices", model.Name, player.VertexCount);
            }
        }
        return files.Length == 0 ? 1 : 0;
    }
}
END
  mcs -unsafe -langversion:7.2 -out:"$here/play.exe" "$here/play.cs" "$here"/package/Core/*.cs
  local -a models=("$folder"/*-"$version".dcloth)
  said=$(LD_LIBRARY_PATH=$here/package/Plugins/linux mono "$here/play.exe" "${models[@]}") || fail "mono: $said"
  [ "$(grep -c '^played .*: [1-9][0-9]* vertices$' <<<"$said")" -eq ${#models[@]} ] || fail "mono: $said"
  model=$(find "$here/package/Plugins" -name '*.so' -o -name '*.dll' | wc -l)
  echo "unity: $model plugins"
}

# obstacle NAME: why it cannot be tested; nothing where it can.
obstacle() {
  local -A files=([sums]=SHA256SUMS [garments]=dcloth-$version-garments.tar.xz [npm]=dcloth-$version-npm.tgz
    [linux-x86_64]=dcloth-$version-linux-x86_64.tar.xz
    [unity]=com.dcloth.unity-$version.tgz)
  local -A programs=([npm]=npm)
  [ -n "$(find "$folder" -maxdepth 1 -name "${files[$1]}")" ] || { echo "there is no ${files[$1]} in $folder"; return; }
  [ -z "${programs[$1]:-}" ] || command -v "${programs[$1]}" >/dev/null || echo "there is no ${programs[$1]}"
}

passed=0 failed=()
for name in sums garments linux-x86_64 npm unity; do
  grep -qE "$only" <<<"$name" || continue
  why=$(obstacle "$name")
  if [ -n "$why" ]; then
    echo "test_packages: not tested: $name: $why"
    continue
  fi
  echo "== $name"
  start=$SECONDS
  set +e
  (set -e; "test_${name//-/_}")
  status=$?
  set -e
  echo "== $name: $([ $status -eq 0 ] && echo passed || echo failed), $((SECONDS - start)) s"
  if [ $status -eq 0 ]; then passed=$((passed + 1)); else failed+=("$name"); fi
done
[ ${#failed[@]} -eq 0 ] || echo "test_packages: failed: ${failed[*]}" >&2
[ $((passed + ${#failed[@]})) -gt 0 ] || { echo "test_packages: nothing in $folder was tested" >&2; exit 1; }
echo "test_packages: $passed passed, ${#failed[@]} failed"
[ ${#failed[@]} -eq 0 ]
