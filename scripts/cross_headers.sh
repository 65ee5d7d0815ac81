#!/usr/bin/env bash
# Gathers what a cross build reads from this machine: headers of its packages, below one folder: `cross_headers.sh
# FOLDER [aarch64|windows]`. They are the same on every processor and system. Where a platform is named, zlib for it
# goes beside them; the command line links it, the library does not. FOLDER then goes to cmake as CMAKE_FIND_ROOT_PATH.
set -euo pipefail
[ $# -ge 1 ] && [[ ${2:-aarch64} =~ ^(aarch64|windows)$ ]] ||
  { echo "cross_headers: allowed: FOLDER [aarch64|windows]" >&2; exit 2; }
folder=$1 platform=${2:-}
packages=(libhwy-dev libflatbuffers-dev nlohmann-json3-dev libcli11-dev libeigen3-dev)

mkdir -p "$folder/usr/lib"
dpkg -L "${packages[@]}" | grep -E '^/usr/(include|share/(cmake|eigen3))/' | sort -u |
  while IFS= read -r path; do
    if [ -f "$path" ]; then printf '%s\n' "${path#/}"; fi
  done | tar -C / --create --file - --dereference --files-from - | tar -C "$folder" --extract --file -
for header in hwy/highway.h flatbuffers/flatbuffers.h nlohmann/json.hpp CLI/CLI.hpp eigen3/Eigen/Core; do
  [ -f "$folder/usr/include/$header" ] ||
    { echo "cross_headers: none of ${packages[*]} holds $header; scripts/install_dependencies.sh build" >&2; exit 1; }
done

# Debian has no package of zlib for cross builds. Its own package for Arm is unpacked here, by lists that this system's
# package manager does not see.
zlib_aarch64() {
  local lists unpacked=$1
  lists=$(mktemp -d)
  local -a apt=(apt-get -qq -o APT::Architectures::=amd64 -o APT::Architectures::=arm64 -o APT::Sandbox::User=
    -o Dir::State::lists="$lists" -o Dir::Cache="$lists" -o Acquire::Languages=none -o Debug::NoLocking=1)
  mkdir -p "$lists"/{partial,archives/partial} "$unpacked"
  { "${apt[@]}" update && cd "$unpacked" && "${apt[@]}" download zlib1g-dev:arm64; } >"$lists/log" 2>&1 ||
    { cat "$lists/log" >&2; return 1; }
  rm -rf "$lists"
  dpkg-deb -x zlib1g-dev_*_arm64.deb .
}

from=$folder/zlib
case $platform in
  "") exit 0 ;;
  aarch64) [ -f "$from/usr/include/zlib.h" ] || (zlib_aarch64 "$from") ;;
  windows) from=/usr/x86_64-w64-mingw32 ;;
esac
find "$from" -path '*/include/z*' \( -name zlib.h -o -name zconf.h \) -exec cp {} "$folder/usr/include/" \;
find "$from" -name libz.a -exec cp {} "$folder/usr/lib/" \;
[ -f "$folder/usr/include/zlib.h" ] && [ -f "$folder/usr/lib/libz.a" ] ||
  { echo "cross_headers: no zlib in $from; scripts/install_dependencies.sh cross_$platform" >&2; exit 1; }
