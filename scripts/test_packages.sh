#!/usr/bin/env bash
# Uses each package of a release as somebody who has nothing else: `test_packages.sh [--only PATTERN] [FOLDER]`; FOLDER
# is what scripts/package.sh wrote, out/packages when not named. PATTERN chooses packages by name (grep -E), as in
# scripts/package_table.sh. npm and unity play the models of FOLDER, python the garments, and linux-aarch64 and
# windows-x86_64 are compared with linux-x86_64.
# Each is unpacked in an empty folder and used with a bare environment: what its README says is typed, a host in C is
# built against it by CMake and by pkg-config, models are played, Unity's C# under Mono. Arm's programs run under
# qemu-user, those of Windows under Wine. A package that is not in FOLDER, or whose tools are not installed, is listed
# as not tested.
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
. scripts/package_table.sh
work=$(mktemp -d)
export WINEPREFIX=$work/wine WINEDEBUG=-all
trap '[ ! -d "$WINEPREFIX" ] || wineserver -k || true; rm -rf "$work"' EXIT
mkdir "$work/home"
# How far vertices may be from those of linux-x86_64: twenty times less than a player could see.
allowed_mm=0.01
arm=(qemu-aarch64 -L /usr/aarch64-linux-gnu)

# bare COMMAND...: with none of this shell's settings but the paths of programs and what npm, pip and Wine are told.
bare() {
  local -a kept=("PATH=$PATH" "HOME=$work/home" LC_ALL=C.UTF-8) name
  for name in "${!npm_config_@}" "${!NPM_CONFIG_@}" "${!PIP_@}" "${!WINE@}"; do
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

# file NAME: the path of a package in FOLDER.
file() {
  local -a found
  mapfile -t found < <(find "$folder" -maxdepth 1 -name "$(package_row "$1" 2)")
  [ ${#found[@]} -eq 1 ] || fail "found ${#found[@]} of $(package_row "$1" 2) in $folder; scripts/package.sh --only $1"
  printf '%s\n' "${found[0]}"
}

# unpack NAME: its archive, into an empty folder; prints where the files are.
unpack() {
  local into=$work/$1 packed
  packed=$(file "$1")
  if [ ! -d "$into" ]; then
    mkdir "$into"
    case $packed in
      *.zip) python3 -m zipfile --extract "$packed" "$into" ;;
      *) tar -C "$into" -xf "$packed" ;;
    esac
  fi
  local -a found=("$into"/*)
  [ ${#found[@]} -eq 1 ] || fail "$packed: ${#found[@]} folders at the top, expected 1"
  [ -f "${found[0]}/LICENSE" ] || fail "$packed: no LICENSE"
  printf '%s\n' "${found[0]}"
}

# The blocks of a page in one language, one after the other: blocks PAGE LANGUAGE.
blocks() {
  awk -v fence='```'"$2" '$0 == "```" { on = 0 } on { print } $0 == fence { on = 1 }' "$1"
}

# play FOLDER COMMAND...: inspects and runs every garment in share/dcloth by the command. What it draws is compared with
# linux-x86_64.
play() {
  local here=$1 garment name walk said count=0 other
  shift
  other=$(unpack linux-x86_64)
  cd "$here"
  for garment in share/dcloth/*.dcloth; do
    name=$(basename "$garment" .dcloth)
    walk=share/dcloth/sequences/$name-walk_turn.safetensors
    said=$(bare "$@" inspect "$garment" --json)
    holds "inspect $name" '"vertices": ?[1-9]' "$said"
    said=$(bare "$@" run "$garment" "$walk" -o "$name.safetensors" 2>&1)
    holds "run $name" '[1-9][0-9]+ frames' "$said"
    if [ "$other" != "$here" ]; then
      bare "$other/bin/dcloth" run "$other/$garment" "$walk" -o there.safetensors >/dev/null 2>&1
      said=$("$root/scripts/package_files.py" apart "$name.safetensors" there.safetensors "$allowed_mm")
      echo "$name: $said of linux-x86_64"
    fi
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

test_models() {
  local garment
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    [ "$(dd if="$folder/$garment-$version.dcloth" bs=4 skip=1 count=1 status=none)" = DCLO ] ||
      fail "$garment: no model"
  done
}

test_garments() {
  local here garment
  here=$(unpack garments)
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    for file in README.md "$garment.safetensors" "$garment.dcloth" sequences/walk_turn.safetensors; do
      [ -s "$here/$garment/$file" ] || fail "$garment/$file is missing"
    done
    [ ! -f "$folder/$garment-$version.dcloth" ] ||
      cmp "$here/$garment/$garment.dcloth" "$folder/$garment-$version.dcloth"
  done
}

# no_paths FILE...: of the building machine.
no_paths() {
  if strings -a "$@" | grep -F "$root"; then fail "a path of the building machine is left in $*"; fi
}

# What the README of an archive for Linux says, typed: typed_linux FOLDER SCRIPT.
typed_linux() {
  local here=$1 said page
  [ "$(grep -c . "$2")" -ge 9 ] || fail "README.md: hardly any command"
  said=$(cd "$here" && bare bash -euo pipefail "$2" 2>&1) || fail "README.md: $said"
  holds "the host by CMake and by pkg-config" "(skirt on [a-z0-9]+: [0-9]+ vertices.*){2}" "$(tr '\n' ' ' <<<"$said")"
  holds "dress" "skirt drawn at 1\.00[0-9]* times.*skin at most 0\.0 mm out of it" "$(tr '\n' ' ' <<<"$said")"
  for page in skirt hero; do
    [ "$(stat -c %s "$here/$page.html")" -gt 100000 ] || fail "$page.html is too small"
  done
  rm -rf "$here/game"
}

# Then evaluate, which wants a bundle.
test_linux_x86_64() {
  local here said garment
  here=$(unpack linux-x86_64)
  said=$(ldd "$here/bin/dcloth" 2>&1 || true)
  holds "ldd bin/dcloth" "not a dynamic executable|statically linked" "$said"
  no_paths "$here/bin/dcloth" "$here/lib/libdcloth.a" "$here/lib/libdcloth_fit.a"
  licences_are_there "$here/licenses" dcloth highway flatbuffers cli11 nlohmann-json tinygltf eigen assimp zlib gcc glibc
  blocks "$here/README.md" sh >"$work/typed.sh"
  typed_linux "$here" "$work/typed.sh"
  play "$here" "$here/bin/dcloth"
  cd "$here"
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    "$root/scripts/package_files.py" clip "$root/models/$garment/sequences/walk_turn.safetensors" \
      "$work/clip.safetensors" 20
    said=$(bare bin/dcloth evaluate "$root/models/$garment/$garment.safetensors" "$work/clip.safetensors" \
      --precision int8 --json 2>/dev/null)
    holds "evaluate $garment" '"truth"' "$said"
  done
}

# The same README. An emulator stands before programs, CMake is told of the compiler; times are of no use here. The
# walks are cut to a second, as a frame takes a third of one.
test_linux_aarch64() {
  local here said told walk
  here=$(unpack linux-aarch64)
  said=$(aarch64-linux-gnu-readelf -h -l "$here/bin/dcloth")
  holds "bin/dcloth" "Machine: +AArch64" "$said"
  if grep INTERP <<<"$said"; then fail "bin/dcloth: needs a loader, expected a static program"; fi
  no_paths "$here/bin/dcloth" "$here/lib/libdcloth.a" "$here/lib/libdcloth_fit.a"
  licences_are_there "$here/licenses" dcloth highway flatbuffers cli11 nlohmann-json tinygltf eigen assimp zlib gcc glibc
  for walk in "$here"/share/dcloth/sequences/*; do
    scripts/package_files.py clip "$walk" "$walk.part" 30
    mv "$walk.part" "$walk"
  done
  told="-DCMAKE_TOOLCHAIN_FILE=$root/platforms/cmake/aarch64_linux.cmake -DCMAKE_FIND_ROOT_PATH=\"\$PWD\""
  blocks "$here/README.md" sh | sed -E -e '/ profile /d' -e "s#^(bin/dcloth|game/game|./game.out) #${arm[*]} &#" \
    -e "s#^cc #aarch64-linux-gnu-gcc #" -e "s#^cmake -S.*#& $told#" >"$work/typed.sh"
  typed_linux "$here" "$work/typed.sh"
  play "$here" "${arm[@]}" bin/dcloth
}

# needs_only FILE DLL...: the system's own libraries that a DLL or program for Windows names.
needs_only() {
  local named expected
  named=$(x86_64-w64-mingw32-objdump -p "$1" | sed -n 's/.*DLL Name: //p' | LC_ALL=C sort | tr '\n' ' ')
  expected=$(printf '%s.dll ' "${@:2}")
  [ "$named" = "$expected" ] || fail "$1: needs $named, expected $expected"
}

# The README's lines, typed at Windows' own prompt; those of CMake here, with a compiler for Windows.
test_windows_x86_64() {
  local here said page
  here=$(unpack windows-x86_64)
  needs_only "$here/bin/dcloth.dll" KERNEL32 msvcrt
  needs_only "$here/bin/dcloth_fit.dll" KERNEL32 dcloth msvcrt
  needs_only "$here/bin/dcloth.exe" ADVAPI32 KERNEL32 SHELL32 msvcrt
  no_paths "$here"/bin/* "$here/lib/libdcloth.dll.a"
  licences_are_there "$here/licenses" dcloth highway flatbuffers cli11 nlohmann-json tinygltf eigen assimp zlib gcc mingw-w64
  bare wine wineboot --init >/dev/null 2>&1 </dev/null
  blocks "$here/README.md" bat | sed 's/$/\r\nif errorlevel 1 exit \/b 1\r/' >"$work/typed.txt"
  [ "$(grep -c . "$work/typed.txt")" -ge 16 ] || fail "README.md: hardly any command"
  { echo "@echo off"; sed '/^cmake/,$d' "$work/typed.txt"; } >"$here/before.bat"
  { echo "@echo off"; sed '1,/^cmake --build/d' "$work/typed.txt"; } >"$here/after.bat"
  cd "$here"
  said=$(bare wine cmd /c before.bat 2>&1) || fail "README.md: $said"
  holds "dress" "skirt drawn at 1\.00[0-9]* times.*skin at most 0\.0 mm out of it" "$(tr '\r\n' ' ' <<<"$said")"
  for page in skirt hero; do
    [ "$(stat -c %s "$page.html")" -gt 100000 ] || fail "$page.html is too small"
  done
  said=$({ bare cmake -S examples -B game -DCMAKE_PREFIX_PATH="$PWD" -DCMAKE_FIND_ROOT_PATH="$PWD" \
    -DCMAKE_TOOLCHAIN_FILE="$root/platforms/cmake/x86_64_windows.cmake" && bare cmake --build game; } 2>&1) ||
    fail "cmake: $said"
  said=$(bare wine cmd /c after.bat 2>&1) || fail "README.md: $said"
  holds "the host" "skirt on [a-z0-9]+: [0-9]+ vertices" "$said"
  rm -rf game
  play "$here" wine bin/dcloth.exe
}

# A project that installs the tarball, plays a garment here and in a worker, and finds types.
test_npm() {
  local here=$work/npm said garment
  mkdir "$here"
  cd "$here"
  echo '{ "type": "module" }' >package.json
  bare npm install --no-audit --no-fund --ignore-scripts "$(file npm)" >npm.log 2>&1 || fail "npm: $(cat npm.log)"
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
  const sound = apart === 0 && moved > 1 && cloth.positions.every(Number.isFinite);
  if (!sound) throw new Error(`${file}: ${apart} ${moved}`);
  console.log(`played ${model.name}: ${model.vertexCount} vertices, ${engine.version} ${engine.instructionSet}`);
}
worker.terminate();
END
  local -a models=("$folder"/*-"$version".dcloth)
  [ -f "${models[0]}" ] || fail "no models in $folder; scripts/package.sh --only models makes them"
  said=$(bare node play.js "${models[@]}" 2>&1) || fail "node: $said"
  [ "$(grep -c "^played .*[1-9][0-9]* vertices, $version wasm$" <<<"$said")" -eq ${#models[@]} ] ||
    fail "node: $said"
}

# The package as the package manager reads it, and its C# with its own plugin on this system.
test_unity() {
  local here=$work/unity said plugins=$work/unity/package/Plugins
  python3 tests/unity/check_package.py "$(file unity)" "$version" LICENSE
  mkdir "$here"
  tar -C "$here" -xf "$(file unity)"
  for said in "Apache License" mingw-w64; do
    grep -q "$said" "$here/package/Third Party Notices.md" || fail "unity: the notices do not name $said"
  done
  no_paths "$plugins"/*/*dcloth.*
  needs_only "$plugins/windows/dcloth.dll" KERNEL32 msvcrt
  android_plugin "$plugins/android"
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
                    for (int i = 0; i < 16 * player.Bones.Length; ++i)
                        player.JointMatrices[i] = i % 16 % 5 == 0 ? 1 : 0;
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
  said=$(LD_LIBRARY_PATH=$plugins/linux mono "$here/play.exe" "${models[@]}") || fail "mono: $said"
  [ "$(grep -c '^played .*: [1-9][0-9]* vertices$' <<<"$said")" -eq ${#models[@]} ] || fail "mono: $said"
}

# What Android's loader and system ask for, as far as a file shows it; then the host in C plays models by it on Arm
# Linux, whose libraries stand in for Android's.
android_plugin() {
  local here=$work/android said library=$1/libdcloth.so name
  mkdir "$here"
  said=$(aarch64-linux-gnu-readelf -W -h -d -l -V "$library")
  holds "$library" "Machine: +AArch64" "$said"
  holds "$library" "SONAME.*\[libdcloth.so\]" "$said"
  [ "$(grep -oP 'NEEDED.*\[\K[^]]*' <<<"$said" | sort | tr '\n' ' ')" = "libc.so libm.so " ] || fail "$library: $said"
  if grep -E "LOAD .* 0x[0-9a-f]{1,3}$|TEXTREL|Version needs|OS/ABI: +UNIX - (GNU|Linux)" <<<"$said"; then
    fail "$library: the lines above"
  fi
  [ "$(grep -cE '  LOAD .* 0x4000$' <<<"$said")" -ge 2 ] || fail "$library: its parts are not aligned to 16 KB: $said"
  said=$(aarch64-linux-gnu-objdump -d "$library")
  [ "$(wc -l <<<"$said")" -gt 10000 ] || fail "$library: hardly any code"
  if grep -m 3 -E '\b[wx]18\b' <<<"$said"; then fail "$library: uses x18, which is the system's"; fi
  scripts/package_files.py examples "$here"
  for name in c m; do ln -s "/usr/aarch64-linux-gnu/lib/lib$name.so.6" "$here/lib$name.so"; done
  aarch64-linux-gnu-gcc -std=c99 -Iengine/include "$here/game.c" -o "$here/game" -L "$1" -ldcloth \
    -Wl,--allow-shlib-undefined
  for name in "$folder"/*-"$version".dcloth; do
    said=$("${arm[@]}" -E "LD_LIBRARY_PATH=$1:$here" "$here/game" "$name")
    holds "Android's plugin" "on neon: [1-9][0-9]* vertices" "$said"
  done
}

# pip in an empty environment; then the command, and the package on both garments.
test_python() {
  local here=$work/python said garment garments
  garments=$(unpack garments)
  mkdir "$here"
  cd "$here"
  "${DCLOTH_PYTHON:-/usr/bin/python3}" -m venv venv
  bare venv/bin/pip --disable-pip-version-check install --quiet "$(file python)" >pip.log 2>&1 ||
    fail "pip: $(cat pip.log)"
  said=$(bare venv/bin/dcloth --version)
  holds "dcloth --version" "$version" "$said"
  "$root/scripts/figure_glb.py" "$root"/models/skirt/{skirt,sequences/walk_turn}.safetensors figure.glb
  said=$(bare venv/bin/dcloth dress figure.glb --garment skirt -o hero.html 2>&1) || fail "dcloth dress: $said"
  holds "dcloth dress" "hero.html: 1 clip" "$said"
  licences_are_there venv/lib/python3*/site-packages/dcloth-"$version".dist-info/licenses \
    dcloth highway flatbuffers cli11 nlohmann-json tinygltf eigen assimp zlib gcc glibc nanobind robin-map
  no_paths venv/lib/python3*/site-packages/dcloth/{_engine*.so,bin/dcloth}
  said=$(readelf -W -d -V venv/lib/python3*/site-packages/dcloth/_engine*.so)
  if grep NEEDED <<<"$said" | grep -vE '\[lib[cm]\.so\.6\]|ld-linux'; then fail "the module needs these libraries"; fi
  echo "the module needs $(grep -o 'GLIBC_[0-9.]*' <<<"$said" | sort -uV | tail -n 1)"
  cat >play.py <<'END'
import json
import struct
import subprocess
import sys
from pathlib import Path

import dcloth
import numpy as np


def tensor(path, name):
    data = path.read_bytes()
    size = struct.unpack_from("<Q", data)[0]
    header = json.loads(data[8:8 + size])
    begin, end = header[name]["data_offsets"]
    found = np.frombuffer(data[8 + size + begin:8 + size + end], np.float32).reshape(header[name]["shape"])
    return found, header.get("__metadata__", {})


assert Path(dcloth.__file__).is_relative_to(sys.prefix)
for name in sys.argv[2:]:
    folder, file = Path(sys.argv[1], name), dcloth.garments()[name]
    walk, bundle = folder / "sequences/walk_turn.safetensors", folder / f"{name}.safetensors"
    model = dcloth.Model(file)
    cloth = dcloth.Cloth(model)
    poses, metadata = tensor(walk, "joint_matrices")
    cloth.bind_joints(json.loads(metadata["joint_names"]))
    played = [cloth.update(pose, 1 / float(metadata["fps"]))[0].copy() for pose in poses]
    subprocess.run([Path(sys.prefix, "bin/dcloth"), "run", file, walk, "-o", "run.safetensors"], check=True,
                   capture_output=True)
    drawn, _ = tensor(Path("run.safetensors"), "positions")
    off = 1000 * np.linalg.norm(np.array(played, np.float64) - drawn, axis=-1).max()
    dcloth.convert(bundle, "own.dcloth", precision="int8")
    measured = dcloth.evaluate(bundle, [f"{name}-clip.safetensors"], precision=["int8"])["variants"]
    truth = [variant["truth"]["position_mm"]["mean"] for variant in measured if "int8" in variant["name"]]
    print(f"played {name}: {len(played)} frames of {model.vertex_count} vertices, at most {off:.6f} mm from dcloth "
          f"run, {truth[0]:.1f} mm from the truth")
    assert len(played) > 100 and off <= 0.01 and 0 < truth[0] < 100
    assert Path("own.dcloth").read_bytes() == file.read_bytes()
END
  local -a names=()
  for garment in "$root"/models/*/; do
    garment=$(basename "$garment")
    names+=("$garment")
    "$root/scripts/package_files.py" clip "$garments/$garment/sequences/walk_turn.safetensors" \
      "$garment-clip.safetensors" 20
  done
  bare venv/bin/python play.py "$garments" "${names[@]}"
}

# The sums are always looked at.
passed=0 failed=()
for name in sums $(package_names "$only"); do
  why=
  if [ "$name" != sums ]; then
    why=$(package_obstacle "$name" 4)
    [ -n "$(find "$folder" -maxdepth 1 -name "$(package_row "$name" 2)")" ] ||
      why="there is no $(package_row "$name" 2) in $folder"
  fi
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
[ $((passed + ${#failed[@]})) -gt 1 ] || { echo "test_packages: nothing in $folder was tested" >&2; exit 1; }
echo "test_packages: $passed passed, ${#failed[@]} failed"
[ ${#failed[@]} -eq 0 ]
