#!/usr/bin/env bash
# Builds assimp for a package's command line: `package_assimp.sh FOLDER NAME [CMAKE OPTION]...`. Out of Debian's source
# package, with the readers of glTF, FBX and BVH alone, static: Debian's own library is shared, and there is none for
# Windows. FOLDER/source and FOLDER/licences serve every NAME; FOLDER/NAME/installed goes to cmake.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/debian_files.sh
[ $# -ge 2 ] || { echo "package_assimp: allowed: FOLDER NAME [CMAKE OPTION]..." >&2; exit 2; }
folder=$1 into=$1/$2
shift 2

# Debian leaves out what its other packages hold: three of them are headers that these readers include, and zlib.
if [ ! -d "$folder/source" ]; then
  rm -rf "$folder/files" "$folder/unpacked"
  debian_files "$folder/files" source assimp
  debian_files "$folder/files" download libutfcpp-dev libstb-dev libminizip-dev
  mkdir -p "$folder/unpacked" "$folder/licences"
  tar -C "$folder/unpacked" --strip-components 1 -xf "$folder"/files/assimp_*.orig.tar.xz
  tar -C "$folder/unpacked" -xf "$folder"/files/assimp_*.debian.tar.xz
  for package in "$folder"/files/*.deb; do dpkg-deb -x "$package" "$folder/unpacked/debian/headers"; done
  # Debian's patches of what is built here: none but where a header lies.
  patch -s -d "$folder/unpacked" -p1 <"$folder/unpacked/debian/patches/use-system-utf8cpp.patch"
  mkdir "$folder/unpacked/contrib/stb"
  cp "$folder/unpacked/debian/headers/usr/include/stb/stb_image.h" "$folder/unpacked/contrib/stb/"
  cp "$folder/unpacked/debian/copyright" "$folder/licences/assimp.txt"
  for package in utfcpp stb minizip; do
    cp "$folder/unpacked/debian/headers/usr/share/doc/lib$package-dev/copyright" "$folder/licences/$package.txt"
  done
  rm -rf "$folder/files"
  mv "$folder/unpacked" "$folder/source"
fi

headers=$PWD/$folder/source/debian/headers/usr/include
# Archives of zip files are no reader's here, so nothing links minizip.
cmake -S "$folder/source" -B "$into" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_SHARED_LIBS=OFF \
  -DASSIMP_BUILD_TESTS=OFF -DASSIMP_BUILD_ASSIMP_TOOLS=OFF -DASSIMP_NO_EXPORT=ON -DASSIMP_IGNORE_GIT_HASH=ON \
  -DASSIMP_WARNINGS_AS_ERRORS=OFF -DASSIMP_BUILD_ALL_IMPORTERS_BY_DEFAULT=OFF -DASSIMP_BUILD_GLTF_IMPORTER=ON \
  -DASSIMP_BUILD_FBX_IMPORTER=ON -DASSIMP_BUILD_BVH_IMPORTER=ON -DASSIMP_BUILD_ZLIB=OFF -DASSIMP_BUILD_MINIZIP=ON \
  -DUNZIP_FOUND=ON -DUNZIP_INCLUDE_DIRS="$headers/minizip" -DASSIMP_BUILD_DRACO=OFF \
  -DCMAKE_CXX_FLAGS="-I$headers/utf8cpp -ffile-prefix-map=$PWD/=" -DCMAKE_INSTALL_PREFIX="$PWD/$into/installed" "$@"
cmake --build "$into"
cmake --install "$into" >/dev/null
