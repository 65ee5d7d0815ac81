#!/usr/bin/env bash
# Builds the tests that start threads with clang under ThreadSanitizer, in build-threads/, and runs them: two models and
# many instances on many threads at once, the choice of an instruction set, many characters.
set -euo pipefail
cd "$(dirname "$0")/.."
tests=(attack_threads_test attack_isa_race_test)
DCLOTH_SANITIZE=thread scripts/build_sanitized.sh build-threads "${tests[@]}"
failed=0
for test in "${tests[@]}"; do
  "build-threads/$test" --gtest_brief=1 || failed=$((failed + 1))
done
echo "test_threads: $((${#tests[@]} - failed)) passed, $failed failed"
[ "$failed" -eq 0 ]
