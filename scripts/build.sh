#!/usr/bin/env bash
# Configures and builds one tree: `build.sh FOLDER [cmake options]`. Quiet while all is well; the whole log on failure.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
shift

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "building $folder" >&2
{ cmake -S . -B "$folder" -G Ninja "$@" && cmake --build "$folder"; } >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
