#!/usr/bin/env bash
# Gathers what a cross build reads from this machine: headers of its packages, below one folder: `cross_headers.sh
# FOLDER`. The folder then goes to cmake as CMAKE_FIND_ROOT_PATH. All of it is the same on every processor and system.
set -euo pipefail
folder=$1
packages=(libhwy-dev libflatbuffers-dev nlohmann-json3-dev libcli11-dev libeigen3-dev)

mkdir -p "$folder"
dpkg -L "${packages[@]}" | grep -E '^/usr/(include|share/(cmake|eigen3))/' | sort -u |
  while IFS= read -r path; do
    if [ -f "$path" ]; then printf '%s\n' "${path#/}"; fi
  done | tar -C / --create --file - --dereference --files-from - | tar -C "$folder" --extract --file -
for header in hwy/highway.h flatbuffers/flatbuffers.h nlohmann/json.hpp CLI/CLI.hpp eigen3/Eigen/Core; do
  [ -f "$folder/usr/include/$header" ] ||
    { echo "cross_headers: none of ${packages[*]} holds $header; scripts/install_dependencies.sh build" >&2; exit 1; }
done
