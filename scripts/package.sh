#!/usr/bin/env bash
# Builds what a release page carries: `package.sh [--only PATTERN] [--test] [OUT]`; OUT is out/packages when not named.
#   models           the bundled garments as int8 .dcloth files
#   garments         an archive of their folders, with bundles, sequences and cards
#   linux-x86_64     an archive: command line, static library, headers, CMake package, dcloth.pc, models, an example
#   npm              the web package as a tarball; needs Emscripten, Node and npm
#   unity            the Unity package with a native plugin for Linux; scripts/package_unity.py takes more
# PATTERN chooses packages by name (grep -E). What a missing compiler leaves out is listed at the end; with --only it is an
# error. --test unpacks and uses all of them (scripts/test_packages.sh). SHA256SUMS covers every package in OUT.
# Times in archives are SOURCE_DATE_EPOCH, or that of the last commit.
set -euo pipefail
cd "$(dirname "$0")/.."

all=(models garments linux-x86_64 npm unity)
only= test=
while [ $# -gt 0 ]; do
  case $1 in
    --only) only=${2:?package: --only needs a pattern, linux for instance}; shift 2 ;;
    --test) test=1; shift ;;
    -*) echo "package: unknown option '$1'; allowed: --only PATTERN, --test" >&2; exit 2 ;;
    *) break ;;
  esac
done
[ $# -le 1 ] || { echo "package: unknown argument '$2'; allowed: [--only PATTERN] [--test] [OUT]" >&2; exit 2; }
out=${1:-out/packages}
mapfile -t chosen < <(printf '%s\n' "${all[@]}" | grep -E "${only:-.}" || true)
[ ${#chosen[@]} -gt 0 ] || { echo "package: no package is named '$only'; there are: ${all[*]}" >&2; exit 2; }

scripts/install_dependencies.sh build
version=$(scripts/package_files.py version)
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH
mkdir -p "$out"
out=$(realpath "$out")
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
host=linux-$(uname -m)

# quiet LOG COMMAND...: the log on failure alone.
quiet() {
  local log=$1
  shift
  mkdir -p "$(dirname "$log")"
  "$@" >"$log" 2>&1 || { cat "$log" >&2; return 1; }
}

# Why NAME cannot be built here; nothing where it can.
obstacle() {
  local name=$1 need
  local -A needs=([npm]="emcc web")
  if [ "$(uname -s)" != Linux ]; then echo "archives are built on Linux"; return; fi
  if [[ $name = linux-x86_64 || $name = unity ]] && [ "$host" != linux-x86_64 ]; then echo "this machine is $(uname -m)"; return; fi
  need=${needs[$name]:-}
  if [ -z "$need" ] || command -v "${need% *}" >/dev/null; then return; fi
  echo "there is no ${need% *}; scripts/install_dependencies.sh ${need#* } installs it"
}

# configure NAME OPTION...: a build folder of its own for each package.
configure() {
  local name=$1 folder=build-package-$1
  shift
  # The tools' own folder of models is this machine's.
  quiet "$folder/configure.log" cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDCLOTH_BUILD_TESTS=OFF \
    -DDCLOTH_BUILD_CLOTH_SOLVER=OFF -DDCLOTH_BUILD_MAPPED_FILE=OFF -DDCLOTH_WARNINGS_AS_ERRORS=ON -DDCLOTH_SOURCE_MODELS= \
    -DCMAKE_INSTALL_LIBDIR=lib "$@"
  echo "building $folder" >&2
}

# The command line that converts, of this machine's own package.
tool=
native_tool() {
  if [ -n "${DCLOTH_TOOL:-}" ]; then tool=$(realpath "$DCLOTH_TOOL"); return; fi
  build_linux
  tool=$PWD/build-package-$host/dcloth
}

# An int8 model of every garment, and a walk for each.
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
    quiet "$stage/convert.log" "$tool" convert "models/$garment/$garment.safetensors" --precision int8 -o "$models.part/$garment.dcloth"
    scripts/package_files.py sequence "models/$garment/sequences/walk_turn.safetensors" \
      "$models.part/sequences/$garment-walk_turn.safetensors"
  done
  mv "$models.part" "$models"
}

# licences FOLDER GROUP...: dcloth's own, and those of what the groups link, as Debian's packages state them.
licences() {
  local folder=$1 group package copyright name
  local -A groups=([engine]="libhwy-dev libflatbuffers-dev" [tools]="libcli11-dev nlohmann-json3-dev libeigen3-dev zlib1g-dev"
    [gnu]="libstdc++-12-dev libc6-dev" [emscripten]="emscripten")
  shift
  mkdir -p "$folder"
  for group in "$@"; do
    for package in ${groups[$group]}; do
      case $package in
        libstdc++-*) package=libstdc++-$(g++ -dumpversion | cut -d. -f1)-dev; name=gcc ;;
        libhwy-dev) name=highway ;;
        libc6-dev) name=glibc ;;
        zlib1g-dev) name=zlib ;;
        *) name=${package#lib}; name=${name%-dev}; name=${name%3} ;;
      esac
      copyright=/usr/share/doc/$package/copyright
      [ -f "$copyright" ] || { echo "package: found no $copyright; Debian's packages state the licences" >&2; return 1; }
      cp "$copyright" "$folder/$name.txt"
    done
  done
  # Debian's texts name the common licences by path.
  { grep -ohE '/usr/share/common-licenses/[A-Za-z0-9.-]*[A-Za-z0-9]' "$folder"/*.txt || true; } | sort -u |
    while IFS= read -r text; do
      [ ! -f "$text" ] || cp --dereference "$text" "$folder/$(basename "$text").licence.txt"
    done
  cp LICENSE "$folder/dcloth.txt"
}

# Command line and library for Linux. The program is one file that runs with any C library, as it shares nothing.
build_linux() {
  local folder=build-package-$host
  configure "$host" -DDCLOTH_IMPORT=OFF -DCMAKE_EXE_LINKER_FLAGS=-static \
    -DZLIB_LIBRARY="$(find /usr/lib -path "*$(uname -m)*" -name libz.a)"
  quiet "$folder/build.log" cmake --build "$folder" --target dcloth dcloth_cli
}

# page FOLDER PROCESSOR COMPILER: the archive's README.
page() {
  sed -e "s/@VERSION@/$version/; s/@PROCESSOR@/$2/; s/@COMPILER@/$3/" platforms/archive/linux.md >"$1/README.md"
  if grep -q '@[A-Z]*@' "$1/README.md"; then echo "package: $1/README.md has a place that nothing fills" >&2; return 1; fi
}

# fill FOLDER: what all archives hold.
fill() {
  convert_garments
  mkdir -p "$1/share/dcloth" "$1/examples"
  cp -r "$models"/. "$1/share/dcloth/"
  scripts/package_files.py examples "$1/examples"
  cp LICENSE "$1/"
}

# finish FOLDER ARCHIVE
finish() {
  scripts/package_files.py archive "$1" "$out/$2" "$SOURCE_DATE_EPOCH"
  made "$2"
}

# made FILE: says so, once it lies in OUT.
made() {
  printf 'package: %s: %d bytes\n' "$1" "$(stat -c %s "$out/$1")"
}

package_linux() {
  local folder=$stage/dcloth-$version-$host
  build_linux
  quiet "$stage/install.log" cmake --install "build-package-$host" --prefix "$folder"
  mkdir -p "$folder/bin"
  strip -o "$folder/bin/dcloth" "build-package-$host/dcloth"
  fill "$folder"
  licences "$folder/licenses" engine tools gnu
  page "$folder" "$(uname -m)" "$(g++ -dumpfullversion)"
  finish "$folder" "dcloth-$version-$host.tar.xz"
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
  local folder=$stage/dcloth-$version-garments garment
  convert_garments
  mkdir -p "$folder"
  for garment in models/*/; do
    garment=$(basename "$garment")
    git ls-files "models/$garment" | tar --create --files-from - | tar -C "$folder" --extract --strip-components 1
    cp "$models/$garment.dcloth" "$folder/$garment/"
  done
  cp LICENSE "$folder/"
  finish "$folder" "dcloth-$version-garments.tar.xz"
}

# The tarball as npm packs it, with times of npm's own.
package_npm() {
  local folder=build-web/site/dcloth
  native_tool
  DCLOTH_TOOL=$tool scripts/build_web.sh build-web
  rm -rf "$stage/npm"
  cp -r "$folder" "$stage/npm"
  licences "$stage/npm/licenses" engine emscripten
  quiet "$stage/npm.log" npm pack --prefix "$stage/npm" --pack-destination "$stage" "$stage/npm"
  mv "$stage/dcloth-$version.tgz" "$out/dcloth-$version-npm.tgz"
  made "dcloth-$version-npm.tgz"
}

# The engine's objects can be linked either way: the plugin is made of the static library.
package_unity() {
  local plugin=$stage/libdcloth.so
  build_linux
  g++ -shared -o "$plugin" -Wl,--whole-archive "build-package-$host/engine/libdcloth.a" -Wl,--no-whole-archive -lm \
    -nodefaultlibs -lc -lgcc -Wl,--no-undefined
  strip "$plugin"
  licences "$stage/unity" engine
  tail -n +1 "$stage"/unity/*.txt >"$stage/notices.md"
  quiet "$stage/unity.log" scripts/package_unity.py "$out/com.dcloth.unity-$version.tgz" "notices=$stage/notices.md" \
    "linux=$plugin"
  made "com.dcloth.unity-$version.tgz"
}

: >"$stage/left_out"
failed=()
for name in "${chosen[@]}"; do
  why=$(obstacle "$name")
  if [ -n "$why" ]; then
    echo "$name: $why" >>"$stage/left_out"
    continue
  fi
  case $name in linux-*) run=(package_linux) ;; *) run=("package_$name") ;; esac
  # A function that is asked for its status in the same breath would go on after errors.
  set +e
  (set -e; "${run[@]}")
  status=$?
  set -e
  [ $status -eq 0 ] || failed+=("$name")
done

cd "$out"
find . -maxdepth 1 -type f ! -name SHA256SUMS ! -name '*.part' -printf '%f\n' | LC_ALL=C sort | xargs -r -d '\n' sha256sum >SHA256SUMS
cd - >/dev/null
echo "package: $(wc -l <"$out/SHA256SUMS") files in $out, with SHA256SUMS"
sed 's/^/package: not built: /' "$stage/left_out"
[ ${#failed[@]} -eq 0 ] || { echo "package: failed: ${failed[*]}" >&2; exit 1; }
[ -z "$only" ] || [ ! -s "$stage/left_out" ] || exit 1
[ -z "$test" ] || scripts/test_packages.sh ${only:+--only "$only"} "$out"
