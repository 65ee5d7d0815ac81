#!/usr/bin/env bash
# Tests the Rust crates: `test_rust.sh [STEP...]`, all steps when none is named.
#   crate     dcloth: declarations against engine/abi.json, the bundled skirt against `dcloth run`, the documentation's
#             examples
#   plugin    bevy_dcloth in an app without renderer, against `dcloth run`
#   pictures  bevy_dcloth's example on the figure of training, drawn by Mesa in software (out/rust/pictures)
# crate also runs clippy; for the plugin it would build Bevy once more. DCLOTH_TOOL names the `dcloth` to compare with
# (build/dcloth by default). Rust 1.95 or later must be there: Debian 12's is older. Bevy takes 2 GB and, on one core,
# ten minutes to build. Not part of scripts/test.sh: cargo fetches other crates.
set -euo pipefail
cd "$(dirname "$0")/.."
steps=("$@")
[ $# -gt 0 ] || steps=(crate plugin pictures)
command -v cargo >/dev/null || { echo "test_rust: found no cargo; install Rust 1.95 or later" >&2; exit 2; }

scripts/install_dependencies.sh build rust
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
  rust test "$@" >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
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
      tests -p dcloth -- --nocapture
      DOCS_RS=1 RUSTDOCFLAGS="-D warnings" quiet rust doc -p dcloth --no-deps
      ;;
    plugin)
      echo "testing bevy_dcloth" >&2
      quiet cargo fmt --check --manifest-path platforms/rust/bevy_dcloth/Cargo.toml
      tests -p bevy_dcloth -- --nocapture
      ;;
    pictures)
      echo "drawing with bevy_dcloth" >&2
      rm -rf "$folder/pictures"
      quiet rust build -p bevy_dcloth --examples
      quiet scripts/figure_glb.py models/skirt/skirt.safetensors "$play" "$folder/figure.glb"
      # Software always, on machines with a GPU too. Mesa asks for a runtime folder that it does not use.
      VK_ICD_FILENAMES=$(echo /usr/share/vulkan/icd.d/lvp_icd.*.json) XDG_RUNTIME_DIR=$folder quiet \
        "$CARGO_TARGET_DIR/debug/examples/pictures" "$folder/skirt.dcloth" "$folder/figure.glb" "$folder/pictures" \
        --fit bones --frames 156 --every 39 --record
      quiet "$tool" run "$folder/skirt.dcloth" "$folder/pictures/poses.safetensors" \
        -o "$folder/pictures/run.safetensors" --outside-body
      tests -p bevy_dcloth --test pictures -- --ignored --nocapture
      ;;
    *) echo "test_rust: unknown step '$name'; allowed: crate, plugin, pictures" >&2; exit 2 ;;
  esac
done
