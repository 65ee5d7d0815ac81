# Prints how many tests passed and failed, "N M", from the output of a runner: the sums of our own runners' closing
# lines, or else of ctest's, or else of pytest's, node's, GoogleTest's and test_platforms.sh's.
/^[a-z_]+: [0-9]+ passed, [0-9]+ failed$/ { runners = 1; runner_passed += $2; runner_failed += $4 }
/^[0-9]+% tests passed, [0-9]+ tests failed out of [0-9]+/ { ctest = 1; ctest_passed += $NF - $4; ctest_failed += $4 }
/[0-9]+ (passed|failed).* in [0-9.]+s/ {
  for (i = 2; i <= NF; ++i) {
    if ($i ~ /^passed/) passed += $(i - 1)
    if ($i ~ /^failed/) failed += $(i - 1)
  }
}
/: [0-9]+ cases passed, [0-9]+ failed/ { passed += $2; failed += $5 }
/^(#|ℹ) pass [0-9]+$/ { passed += $3 }
/^(#|ℹ) fail [0-9]+$/ { failed += $3 }
/^\[  PASSED  \] [0-9]+ test/ { passed += $4 }
/^\[  FAILED  \] [0-9]+ test/ { failed += $4 }
END {
  if (runners) print runner_passed + 0, runner_failed + 0
  else if (ctest) print ctest_passed + 0, ctest_failed + 0
  else print passed + 0, failed + 0
}
