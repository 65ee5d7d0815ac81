# Sourced by the test runners. `step NAME COMMAND...` runs a command, shows and keeps its output
# (out/test/RUNNER-NAME.log) and counts its tests; a step that fails does not end the runner. `closing_line` prints
# "RUNNER: N passed, N failed" and fails where anything did. Any C++ build then uses ccache where it is installed; it is
# never required.
runner=$(basename "$0" .sh)
passed=0 failed=0
mkdir -p out/test

step() {
  local name=$1 log start=$SECONDS status=0 counts
  shift
  log=out/test/$runner-$name.log
  printf '== %s: %s\n' "$runner" "$name"
  "$@" 2>&1 | tee "$log" || status=$?
  read -r -a counts <<<"$(awk -f scripts/count_tests.awk "$log")"
  # A command that fails without a test that failed (a build, a crash) counts as one.
  [ "$status" -eq 0 ] || [ "${counts[1]}" -gt 0 ] || counts[1]=1
  passed=$((passed + counts[0])) failed=$((failed + counts[1]))
  printf '== %s: %s: %d passed, %d failed, %d s\n' "$runner" "$name" "${counts[0]}" "${counts[1]}" $((SECONDS - start))
  return "$status"
}

closing_line() {
  printf '%s: %d passed, %d failed\n' "$runner" "$passed" "$failed"
  [ "$failed" -eq 0 ]
}

# Clones in other folders share what it holds.
if command -v ccache >/dev/null && [ -z "${CMAKE_CXX_COMPILER_LAUNCHER:-}" ]; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
  export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1
fi
