#!/usr/bin/env bash
# Builds what a release page carries: `package.sh [--only PATTERN] [--install] [--test] [OUT]`; OUT is out/packages when
# not named.
#   models           the bundled garments as int8 .dcloth files
#   garments         an archive of their folders, with bundles, sequences and cards
#   linux-x86_64     an archive: command line, static library, headers, CMake package, dcloth.pc, models, an example
#   linux-aarch64    the same for 64-bit Arm
#   windows-x86_64   the same, with a DLL and its import library
#   npm              the web package as a tarball
#   unity            the Unity package with native plugins for Linux, Windows and Android
#   python           a wheel for Debian's Python, with models; DCLOTH_PYTHON names another
# PATTERN chooses packages by name (grep -E). What a missing compiler leaves out is listed at the end; with --only it is
# an error. --install installs what the chosen packages and their tests need. --test unpacks and uses all of them
# (scripts/test_packages.sh). SHA256SUMS covers every package in OUT. Times in archives are SOURCE_DATE_EPOCH, or that
# of the last commit.
set -euo pipefail
cd "$(dirname "$0")/.."

only= test='' install=''
while [ $# -gt 0 ]; do
  case $1 in
    --only) only=${2:?package: --only needs a pattern, linux for instance}; shift 2 ;;
    --install) install=1; shift ;;
    --test) test=1; shift ;;
    -*) echo "package: unknown option '$1'; allowed: --only PATTERN, --install, --test" >&2; exit 2 ;;
    *) break ;;
  esac
done
[ $# -le 1 ] ||
  { echo "package: unknown argument '$2'; allowed: [--only PATTERN] [--install] [--test] [OUT]" >&2; exit 2; }
out=${1:-out/packages}
[ "$(uname -sm)" = "Linux x86_64" ] ||
  { echo "package: this is $(uname -sm); packages are built on Linux x86_64" >&2; exit 2; }
version=$(scripts/package_files.py version)
. scripts/package_table.sh
mapfile -t chosen < <(package_names "$only")
[ ${#chosen[@]} -gt 0 ] ||
  { echo "package: no package is named '$only'; there are: $(package_names | tr '\n' ' ')" >&2; exit 2; }

scripts/install_dependencies.sh build
if [ -n "$install" ]; then
  for name in "${chosen[@]}"; do
    for column in 3 ${test:+4}; do
      # Asked again for each: npm comes with some packages of nodejs.
      package_needs "$name" "$column" | while read -r program group; do
        command -v "$program" >/dev/null || scripts/install_dependencies.sh "$group"
      done
    done
  done
fi
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH
mkdir -p "$out"
out=$(realpath "$out")
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT

# quiet LOG COMMAND...: the log on failure alone.
quiet() {
  local log=$1
  shift
  mkdir -p "$(dirname "$log")"
  "$@" >"$log" 2>&1 || { cat "$log" >&2; return 1; }
}

# Programs for Linux are one file that runs with any C library, as it shares nothing.
static=(-DCMAKE_EXE_LINKER_FLAGS=-static)
here=("${static[@]}" -DZLIB_LIBRARY="$(find /usr/lib -path '*x86_64*' -name libz.a)")

# cross TOOLCHAIN [PLATFORM]: options for a compiler of another system; where PLATFORM is named, with a command line.
cross() {
  scripts/cross_headers.sh "$folder/root" ${2:+"$2"}
  options=(-DCMAKE_TOOLCHAIN_FILE="$PWD/platforms/cmake/$1.cmake" -DCMAKE_FIND_ROOT_PATH="$PWD/$folder/root")
  [ -n "${2:-}" ] || options+=(-DBUILD_SHARED_LIBS=ON -DDCLOTH_BUILD_TOOLS=OFF)
}

# build NAME: a build folder of its own for each; `folder` afterwards.
build() {
  local -a options targets=(dcloth_fit)
  folder=build-package-$1
  case $1 in
    linux-x86_64) options=("${here[@]}") ;;
    linux-aarch64) cross aarch64_linux aarch64; options+=("${static[@]}") ;;
    windows-x86_64) cross x86_64_windows windows ;;
    windows-x86_64-library) cross x86_64_windows; targets+=(dcloth_unity_plugin) ;;
    android-arm64-library) cross android_clang; targets+=(dcloth_unity_plugin); options+=("-DCMAKE_SHARED_LINKER_FLAGS=$(android_linker "$folder")") ;;
  esac
  [[ $1 = *-library ]] || targets+=(dcloth_cli)
  echo "building $folder" >&2
  if [[ $1 != *-library ]]; then
    quiet "$folder/assimp.log" scripts/package_assimp.sh build-package-assimp "$1" "${options[@]}"
    options+=(-Dassimp_DIR="$(find "$PWD/build-package-assimp/$1/installed" -name assimpConfig.cmake -printf %h)")
  fi
  # The tools' own folder of models is this machine's.
  quiet "$folder/configure.log" cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=OFF \
    -DDCLOTH_BUILD_CLOTH_SOLVER=OFF -DDCLOTH_BUILD_MAPPED_FILE=OFF -DDCLOTH_WARNINGS_AS_ERRORS=ON \
    -DDCLOTH_SOURCE_MODELS= -DCMAKE_INSTALL_LIBDIR=lib "${options[@]}"
  quiet "$folder/build.log" cmake --build "$folder" --target "${targets[@]}"
}

# android_linker FOLDER: Debian's linker, and libc.so and libm.so with the names that the library may call. FlatBuffers'
# header reads Android's version from a header of the NDK; clang has defined it.
android_linker() {
  local folder=$PWD/$1/android name symbol
  local -A names=([c]="memcpy memmove memset memcmp memchr strncmp strlen" [m]="sqrt sqrtf atan2")
  mkdir -p "$folder" "$1/root/usr/include/android"
  echo "static_assert(__ANDROID_API__ == 24);" >"$1/root/usr/include/android/api-level.h"
  for name in c m; do
    for symbol in ${names[$name]}; do printf '.globl %s\n.type %s, %%function\n%s:\n' "$symbol"{,,}; done \
      >"$folder/$name.s"
    aarch64-linux-gnu-gcc -shared -nostdlib -Wl,-soname,"lib$name.so" -o "$folder/lib$name.so" "$folder/$name.s"
  done
  # Pages of 16 KB, which devices may have.
  echo "--ld-path=$(command -v aarch64-linux-gnu-ld) -nostdlib -L$folder -lc -lm -Wl,--no-undefined" \
    "-Wl,-z,max-page-size=16384 -Wl,--hash-style=both"
}

# The command line that converts: of this machine's own package, unless DCLOTH_TOOL names one.
tool=
native_tool() {
  if [ -n "${DCLOTH_TOOL:-}" ]; then tool=$(realpath "$DCLOTH_TOOL"); return; fi
  build linux-x86_64
  tool=$PWD/$folder/dcloth
}

# An int8 model of every garment and a walk for each, and the figure that walks.
models=$stage/models
convert_garments() {
  local garment
  [ ! -d "$models" ] || return 0
  native_tool
  rm -rf "$models.part"
  mkdir -p "$models.part/sequences"
  for garment in models/*/; do
    garment=$(basename "$garment")
    echo "converting models/$garment" >&2
    quiet "$stage/convert.log" "$tool" convert "models/$garment/$garment.safetensors" --precision int8 \
      -o "$models.part/$garment.dcloth"
    scripts/package_files.py sequence "models/$garment/sequences/walk_turn.safetensors" \
      "$models.part/sequences/$garment-walk_turn.safetensors"
  done
  scripts/figure_glb.py models/skirt/{skirt,sequences/walk_turn}.safetensors "$models.part/figure.glb"
  mv "$models.part" "$models"
}

# licences FOLDER GROUP...: dcloth's own, and those of what the groups link, as Debian's packages state them.
licences() {
  local folder=$1 group entry copyright
  local gcc
  gcc=$(g++ -dumpversion | cut -d. -f1)
  local -A groups=([engine]="highway=libhwy-dev flatbuffers=libflatbuffers-dev"
    [tools]="cli11=libcli11-dev nlohmann-json=nlohmann-json3-dev tinygltf=libtinygltf-dev eigen=libeigen3-dev
      zlib=zlib1g-dev"
    [linux]="gcc=libstdc++-$gcc-dev glibc=libc6-dev"
    [windows]="gcc=gcc-mingw-w64-base mingw-w64=mingw-w64-x86-64-dev"
    [emscripten]="emscripten=emscripten")
  shift
  mkdir -p "$folder"
  for group in "$@"; do
    for entry in ${groups[$group]}; do
      copyright=/usr/share/doc/${entry#*=}/copyright
      [ -f "$copyright" ] ||
        { echo "package: found no $copyright; Debian's packages state the licences" >&2; return 1; }
      cp "$copyright" "$folder/${entry%%=*}.txt"
    done
  done
  # Debian's texts name the common licences by path.
  { grep -ohE '/usr/share/common-licenses/[A-Za-z0-9.-]*[A-Za-z0-9]' "$folder"/*.txt || true; } | sort -u |
    while IFS= read -r text; do
      [ ! -f "$text" ] || cp --dereference "$text" "$folder/$(basename "$text").licence.txt"
    done
  cp LICENSE "$folder/dcloth.txt"
}

# finish NAME [FOLDER]: the archive of that name.
finish() {
  local file
  file=$(package_row "$1" 2)
  [ $# -eq 1 ] || scripts/package_files.py archive "$2" "$out/$file" "$SOURCE_DATE_EPOCH"
  made "$file"
}

# made FILE: says so, once it lies in OUT.
made() {
  printf 'package: %s: %d bytes\n' "$1" "$(stat -c %s "$out/$1")"
}

# archive NAME: the folder of an archive, command line and library of a platform with all that belongs to them; `into`
# afterwards.
archive() {
  local name=$1 program=dcloth triple=${1#*-}-linux-gnu library=$1 system=linux gcc
  into=$stage/dcloth-$version-$1
  [ ! -d "$into" ] || return 0
  if [[ $name = windows-* ]]; then
    program=dcloth.exe triple=x86_64-w64-mingw32 library=$name-library system=windows
    build "$library"
  fi
  build "$name"
  quiet "$stage/install.log" cmake --install "build-package-$library" --prefix "$into.part"
  mkdir -p "$into.part/bin"
  "$triple-strip" -o "$into.part/bin/$program" "build-package-$name/$program"
  [ $system = linux ] || "$triple-strip" "$into.part/bin/dcloth.dll" "$into.part/bin/dcloth_fit.dll"
  convert_garments
  mkdir -p "$into.part/share" "$into.part/examples"
  cp -r "$models" "$into.part/share/dcloth"
  scripts/package_files.py examples "$into.part/examples"
  cp LICENSE "$into.part/"
  cp -r build-package-assimp/licences "$into.part/licenses"
  licences "$into.part/licenses" engine tools $system
  gcc=$("$triple-gcc" -dumpfullversion | sed 's/-win32$//')
  sed -e "s/@VERSION@/$version/; s/@PROCESSOR@/${name#*-}/; s/@COMPILER@/$gcc/" "platforms/archive/$system.md" \
    >"$into.part/README.md"
  if grep '@[A-Z]*@' "$into.part/README.md" >&2; then echo "package: nothing fills these places" >&2; return 1; fi
  mv "$into.part" "$into"
}

package_archive() {
  local into
  archive "$1"
  finish "$1" "$into"
}

package_models() {
  local garment
  convert_garments
  for garment in models/*/; do
    garment=$(basename "$garment")
    cp "$models/$garment.dcloth" "$out/$garment-$version.dcloth"
    made "$garment-$version.dcloth"
  done
}

# The folders as they are in the repository, each with its int8 model.
package_garments() {
  local into=$stage/dcloth-$version-garments garment
  convert_garments
  mkdir -p "$into"
  for garment in models/*/; do
    garment=$(basename "$garment")
    git ls-files "models/$garment" | tar --create --files-from - | tar -C "$into" --extract --strip-components 1
    cp "$models/$garment.dcloth" "$into/$garment/"
  done
  cp LICENSE "$into/"
  finish garments "$into"
}

# The tarball as npm packs it, with times of npm's own.
package_npm() {
  native_tool
  DCLOTH_TOOL=$tool scripts/build_web.sh build-web
  rm -rf "$stage/npm"
  cp -r build-web/site/dcloth "$stage/npm"
  licences "$stage/npm/licenses" engine emscripten
  quiet "$stage/npm.log" npm pack --prefix "$stage/npm" --pack-destination "$stage" "$stage/npm"
  mv "$stage/dcloth-$version.tgz" "$out/$(package_row npm 2)"
  finish npm
}

# The engine's objects can be linked either way: the plugin for Linux is made of the static library.
package_unity() {
  local plugins=$stage/plugins
  mkdir "$plugins"
  build linux-x86_64
  g++ -shared -o "$plugins/linux.so" -Wl,--whole-archive "$folder/engine/libdcloth.a" "$folder/fit/libdcloth_fit.a" \
    -Wl,--no-whole-archive -lm -nodefaultlibs -lc -lgcc -Wl,--no-undefined
  strip "$plugins/linux.so"
  build windows-x86_64-library
  x86_64-w64-mingw32-strip -o "$plugins/windows.dll" "$folder/fit/unity/dcloth.dll"
  build android-arm64-library
  aarch64-linux-gnu-strip -o "$plugins/android.so" "$folder/fit/unity/libdcloth.so"
  licences "$stage/unity" engine windows
  tail -n +1 "$stage"/unity/*.txt >"$stage/notices.md"
  quiet "$stage/unity.log" scripts/package_unity.py "$out/$(package_row unity 2)" "notices=$stage/notices.md" \
    "linux=$plugins/linux.so" "windows=$plugins/windows.dll" "android=$plugins/android.so"
  finish unity
}

# The wheel takes everything but its module from the archive for Linux. pip brings the partners of CMake that it needs.
package_python() {
  local into
  archive linux-x86_64
  echo "building build-package-python" >&2
  "${DCLOTH_PYTHON:-/usr/bin/python3}" -m venv "$stage/venv"
  rm -rf build-package-python
  quiet "$stage/wheel.log" "$stage/venv/bin/pip" --disable-pip-version-check wheel --no-deps -w "$stage/wheel" \
    --config-settings="build-dir=$PWD/build-package-python" --config-settings=build.targets=_engine \
    --config-settings=cmake.define.DCLOTH_WARNINGS_AS_ERRORS=ON \
    --config-settings=cmake.define.DCLOTH_PYTHON_RELEASE="$into" \
    --config-settings=cmake.define.CMAKE_MODULE_LINKER_FLAGS="-static-libstdc++ -static-libgcc -Wl,--exclude-libs,ALL" \
    platforms/python
  mv "$stage/wheel"/*.whl "$out/"
  made "$(basename "$out"/$(package_row python 2))"
}

: >"$stage/left_out"
failed=()
for name in "${chosen[@]}"; do
  why=$(package_obstacle "$name" 3)
  if [ -n "$why" ]; then
    echo "$name: $why" >>"$stage/left_out"
    continue
  fi
  case $name in *-*) run=(package_archive "$name") ;; *) run=("package_$name") ;; esac
  # A function that is asked for its status in the same breath would go on after errors.
  set +e
  (set -e; "${run[@]}")
  status=$?
  set -e
  [ $status -eq 0 ] || failed+=("$name")
done

cd "$out"
find . -maxdepth 1 -type f ! -name SHA256SUMS ! -name '*.part' -printf '%f\n' | LC_ALL=C sort |
  xargs -r -d '\n' sha256sum >SHA256SUMS
cd - >/dev/null
echo "package: $(wc -l <"$out/SHA256SUMS") files in $out, with SHA256SUMS"
sed 's/^/package: not built: /' "$stage/left_out"
[ ${#failed[@]} -eq 0 ] || { echo "package: failed: ${failed[*]}" >&2; exit 1; }
[ -z "$only" ] || [ ! -s "$stage/left_out" ] || exit 1
[ -z "$test" ] || scripts/test_packages.sh ${only:+--only "$only"} "$out"
