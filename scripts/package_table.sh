# The packages of a release, one a line. scripts/package.sh and scripts/test_packages.sh set `version` and source this.
# Columns: name; its file (* stands for any text); what builds it; what its test needs. The last two are PROGRAM:GROUP,
# joined by commas, or -: a program, and the group of scripts/install_dependencies.sh that brings it.
package_table() {
  local arm=aarch64-linux-gnu-g++:cross_aarch64 windows=x86_64-w64-mingw32-g++-posix:cross_windows
  local qemu=qemu-aarch64:cross_aarch64
  cat <<END
models          *-$version.dcloth                     -                                  -
garments        dcloth-$version-garments.tar.xz       -                                  -
linux-x86_64    dcloth-$version-linux-x86_64.tar.xz   -                                  pkg-config:test
linux-aarch64   dcloth-$version-linux-aarch64.tar.xz  $arm                               $qemu,$arm
windows-x86_64  dcloth-$version-windows-x86_64.zip    $windows                           wine:cross_windows,$windows
npm             dcloth-$version-npm.tgz               emcc:web,npm:npm                   npm:npm
unity           com.dcloth.unity-$version.tgz         $windows,clang:cross_android,$arm  mcs:unity,$qemu
python          dcloth-$version-*-linux_x86_64.whl    /usr/bin/python3-config:python     -
END
}

# package_row NAME COLUMN
package_row() {
  package_table | awk -v name="$1" -v column="$2" '$1 == name { print $column }'
}

# package_names [PATTERN]: in the table's order.
package_names() {
  package_table | awk '{ print $1 }' | grep -E -- "${1:-.}" || true
}

# package_needs NAME COLUMN: lines "PROGRAM GROUP" of what is not installed.
package_needs() {
  local needs need
  needs=$(package_row "$1" "$2")
  for need in ${needs//,/ }; do
    [ "$need" = - ] || command -v "${need%:*}" >/dev/null || echo "${need%:*} ${need#*:}"
  done
}

# package_obstacle NAME COLUMN: the first of these, as a sentence; nothing where nothing is missing.
package_obstacle() {
  local program group
  if read -r program group < <(package_needs "$1" "$2"); then
    echo "there is no $program; scripts/install_dependencies.sh $group installs it"
  fi
}
