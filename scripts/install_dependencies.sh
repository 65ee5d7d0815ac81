#!/usr/bin/env bash
# Installs the Debian packages a build needs. `install_dependencies.sh [build] [test] [train] [cross_aarch64]
# [cross_android] [cross_i386] [cross_windows] [unity] [web] [npm] [import] [bench] [python] [rust] [lint]`; "build"
# when nothing is said. "test" and "train" also install training/requirements.txt from PyPI into .venv, a virtual
# environment that sees Debian's Python packages too; "lint" ruff.
set -euo pipefail

gcc_version=$(g++ -dumpversion 2>/dev/null || echo 12)
declare -A groups=(
  [build]="ca-certificates g++ cmake ninja-build libhwy-dev libflatbuffers-dev flatbuffers-compiler nlohmann-json3-dev
           libtinygltf-dev libeigen3-dev libcli11-dev zlib1g-dev python3"
  [test]="libgtest-dev python3-numpy python3-scipy python3-matplotlib python3-torch libopenblas0-pthread python3-pytest
          chromium binutils clang libclang-rt-dev pkg-config python3-distributed"
  [cross_aarch64]="g++-aarch64-linux-gnu qemu-user googletest"
  [cross_android]="clang g++-aarch64-linux-gnu"  # without the NDK: the library alone
  [cross_i386]="libc6-dev-i386 lib32gcc-${gcc_version}-dev lib32stdc++-${gcc_version}-dev googletest"
  [cross_windows]="g++-mingw-w64-x86-64-posix libz-mingw-w64-dev wine wine64 googletest"
  [unity]="mono-mcs mono-runtime libmono-system-core4.0-cil libmono-2.0-dev libmonosgen-2.0-dev"
  [web]="emscripten binaryen nodejs"
  [npm]="npm"  # where nodejs comes without it
  [import]="libassimp-dev"
  [bench]="libbenchmark-dev libxnnpack-dev libpthreadpool-dev python3-venv python3-numpy python3-scipy python3-torch
           libopenblas0-pthread"
  [python]="python3-dev python3-venv"
  [rust]="mesa-vulkan-drivers libvulkan1"  # Rust itself is newer than Debian's
  [lint]="clang-format clang-tidy python3-venv ca-certificates"
  [train]="g++ cmake ninja-build python3-numpy python3-scipy python3-matplotlib python3-torch libopenblas0-pthread
           python3-venv"
)
packages=()
for group in "${@:-build}"; do
  [ -n "${groups[$group]:-}" ] ||
    { echo "install_dependencies: unknown group '$group'; allowed: ${!groups[*]}" >&2; exit 2; }
  read -r -d '' -a names <<<"${groups[$group]}" || true
  packages+=("${names[@]}")
done

missing=()
for name in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${Status}' "$name" 2>/dev/null || true)
  [ "$status" = "install ok installed" ] || missing+=("$name")
done
if [ ${#missing[@]} -gt 0 ]; then
  command -v apt-get >/dev/null ||
    { echo "install_dependencies: apt-get not found; install by hand: ${missing[*]}" >&2; exit 1; }
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null ||
      { echo "install_dependencies: root or sudo is needed to install: ${missing[*]}" >&2; exit 1; }
    as_root=(sudo)
  fi
  echo "installing: ${missing[*]}" >&2
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

# No dependencies: pip would replace Debian's numpy by one that Debian's torch cannot use.
cd "$(dirname "$0")/.."
install_wheels() {
  [ -x .venv/bin/pip ] || /usr/bin/python3 -m venv --system-site-packages .venv
  .venv/bin/pip install --quiet --disable-pip-version-check --no-deps "$@"
}
case " $* " in *" test "* | *" train "*) install_wheels -r training/requirements.txt ;; esac
case " $* " in *" lint "*) install_wheels ruff==0.17.6 ;; esac
