#!/usr/bin/env bash
# Tests the Rust crate: its declarations against engine/abi.json, the bundled skirt against `dcloth run`, the examples in its
# documentation, clippy and rustfmt. `test_rust.sh [STEP...]`: crate; all when none is named. DCLOTH_TOOL names the
# `dcloth` to compare with (build/dcloth by default). Rust 1.95 or later must be there: Debian 12's is older.
# Not part of scripts/test.sh: cargo fetches other crates.
set -euo pipefail
cd "$(dirname "$0")/.."
steps=("$@")
[ $# -gt 0 ] || steps=(crate)
command -v cargo >/dev/null || { echo "test_rust: found no cargo; install Rust 1.95 or later" >&2; exit 2; }

scripts/install_dependencies.sh build
tool=${DCLOTH_TOOL:-build/dcloth}
[ -x "$tool" ] || scripts/build.sh build
folder=$PWD/out/rust
mkdir -p "$folder"
export DCLOTH_RUST_DATA=$folder CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/build-rust} CARGO_INCREMENTAL=0
log=$(mktemp)
trap 'rm -f "$log"' EXIT

quiet() { "$@" >"$log" 2>&1 || { cat "$log" >&2; exit 1; }; }
rust() { cargo "$1" --locked --manifest-path platforms/rust/Cargo.toml "${@:2}"; }
# Says how many tests ran, and fails when none did.
tests() {
  rust test "$@" -- --nocapture >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
  grep -E "[0-9] mm\b" "$log" || true
  awk '/^test result: ok/ { passed += $4 } END { print passed + 0 " tests passed"; exit passed == 0 }' "$log"
}

play=models/skirt/sequences/walk_turn.safetensors
quiet "$tool" convert models/skirt/skirt.safetensors -o "$folder/skirt.dcloth" --precision int8
quiet "$tool" run "$folder/skirt.dcloth" "$play" -o "$folder/run.safetensors"
quiet "$tool" run "$folder/skirt.dcloth" "$play" -o "$folder/run_outside.safetensors" --outside-body

for name in "${steps[@]}"; do
  case $name in
    crate)
      echo "testing dcloth for Rust" >&2
      quiet cargo fmt --check --manifest-path platforms/rust/dcloth/Cargo.toml
      quiet rust clippy -p dcloth --all-targets -- -D warnings
      tests -p dcloth
      DOCS_RS=1 RUSTDOCFLAGS="-D warnings" quiet rust doc -p dcloth --no-deps
      ;;
    *) echo "test_rust: unknown step '$name'; allowed: crate" >&2; exit 2 ;;
  esac
done
