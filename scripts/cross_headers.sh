#!/usr/bin/env bash
# Gathers what a cross build reads from this machine: headers of its packages, below one folder: `cross_headers.sh
# FOLDER [aarch64|windows]`. They are the same on every processor and system. Where a platform is named, zlib for it
# goes beside them; the command line links it, the library does not. FOLDER then goes to cmake as CMAKE_FIND_ROOT_PATH.
set -euo pipefail
. "$(dirname "$0")/debian_files.sh"
[ $# -ge 1 ] && [[ ${2:-aarch64} =~ ^(aarch64|windows)$ ]] ||
  { echo "cross_headers: allowed: FOLDER [aarch64|windows]" >&2; exit 2; }
folder=$1 platform=${2:-}
packages=(libhwy-dev libflatbuffers-dev nlohmann-json3-dev libtinygltf-dev libcli11-dev libeigen3-dev)

mkdir -p "$folder/usr/lib"
dpkg -L "${packages[@]}" | grep -E '^/usr/(include|share/(cmake|eigen3))/' | sort -u |
  while IFS= read -r path; do
    if [ -f "$path" ]; then printf '%s\n' "${path#/}"; fi
  done | tar -C / --create --file - --dereference --files-from - | tar -C "$folder" --extract --file -
for header in hwy/highway.h flatbuffers/flatbuffers.h nlohmann/json.hpp tiny_gltf.h CLI/CLI.hpp eigen3/Eigen/Core; do
  [ -f "$folder/usr/include/$header" ] ||
    { echo "cross_headers: none of ${packages[*]} holds $header; scripts/install_dependencies.sh build" >&2; exit 1; }
done

# Debian has no package of zlib for cross builds; its own package for Arm is unpacked.
zlib_aarch64() {
  debian_files "$1" download zlib1g-dev:arm64
  (cd "$1" && dpkg-deb -x zlib1g-dev_*_arm64.deb .)
}

from=$folder/zlib
case $platform in
  "") exit 0 ;;
  aarch64) [ -f "$from/usr/include/zlib.h" ] || zlib_aarch64 "$from" ;;
  windows) from=/usr/x86_64-w64-mingw32 ;;
esac
find "$from" -path '*/include/z*' \( -name zlib.h -o -name zconf.h \) -exec cp {} "$folder/usr/include/" \;
find "$from" -name libz.a -exec cp {} "$folder/usr/lib/" \;
[ -f "$folder/usr/include/zlib.h" ] && [ -f "$folder/usr/lib/libz.a" ] ||
  { echo "cross_headers: no zlib in $from; scripts/install_dependencies.sh cross_$platform" >&2; exit 1; }
