#!/usr/bin/env bash
# Builds assimp for a package's command line: `package_assimp.sh FOLDER NAME [CMAKE OPTION]...`. Out of Debian's source
# package, with the readers of FBX and BVH alone, static: Debian's own library is shared, and there is none for
# Windows. FOLDER/source and FOLDER/licences serve every NAME; FOLDER/NAME/installed goes to cmake.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/debian_files.sh
[ $# -ge 2 ] || { echo "package_assimp: allowed: FOLDER NAME [CMAKE OPTION]..." >&2; exit 2; }
folder=$1 into=$1/$2
shift 2

# Debian leaves out what its other packages hold: zlib, and headers that go where assimp has its own copies.
if [ ! -d "$folder/source" ]; then
  rm -rf "$folder/files" "$folder/unpacked"
  debian_files "$folder/files" source assimp
  debian_files "$folder/files" download libutfcpp-dev libstb-dev libminizip-dev
  mkdir -p "$folder/licences"
  # Python's: tar wants xz beside it.
  for archive in "$folder"/files/*.tar.xz; do python3 -m tarfile -e "$archive" "$folder/files"; done
  mv "$folder"/files/assimp-*/ "$folder/unpacked"
  for package in "$folder"/files/*.deb; do dpkg-deb -x "$package" "$folder/files"; done
  headers=$folder/files/usr/include contrib=$folder/unpacked/contrib
  mkdir -p "$contrib"/{utf8cpp,stb,minizip}
  cp -r "$headers/utf8cpp" "$contrib/utf8cpp/source"
  cp "$headers/stb/stb_image.h" "$contrib/stb/"
  cp "$headers"/minizip/*.h "$contrib/minizip/"
  cp "$folder/files/debian/copyright" "$folder/licences/assimp.txt"
  for package in utfcpp stb minizip; do
    cp "$folder/files/usr/share/doc/lib$package-dev/copyright" "$folder/licences/$package.txt"
  done
  rm -rf "$folder/files"
  mv "$folder/unpacked" "$folder/source"
fi

# Archives of zip files are no reader's here, so nothing links minizip.
cmake -S "$folder/source" -B "$into" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_SHARED_LIBS=OFF \
  -DASSIMP_BUILD_TESTS=OFF -DASSIMP_BUILD_ASSIMP_TOOLS=OFF -DASSIMP_NO_EXPORT=ON -DASSIMP_IGNORE_GIT_HASH=ON \
  -DASSIMP_WARNINGS_AS_ERRORS=OFF -DASSIMP_BUILD_ALL_IMPORTERS_BY_DEFAULT=OFF \
  -DASSIMP_BUILD_FBX_IMPORTER=ON -DASSIMP_BUILD_BVH_IMPORTER=ON -DASSIMP_BUILD_ZLIB=OFF -DASSIMP_BUILD_MINIZIP=ON \
  -DUNZIP_FOUND=ON -DUNZIP_INCLUDE_DIRS="$PWD/$folder/source/contrib/minizip" -DASSIMP_BUILD_DRACO=OFF \
  -DCMAKE_CXX_FLAGS="-ffile-prefix-map=$PWD/=" -DCMAKE_INSTALL_PREFIX="$PWD/$into/installed" "$@"
cmake --build "$into"
cmake --install "$into" >/dev/null
