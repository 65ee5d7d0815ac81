#!/usr/bin/env bash
# Style and common faults, of the whole tree in about a minute: `lint.sh [--fix] [format] [tidy] [python]`, all three
# when none is named. format: clang-format on C and C++; tidy: clang-tidy on C++ files that differ from DCLOTH_LINT_BASE
# (a commit; origin/main or main when unset) and on a sample, in the tree build/ or DCLOTH_LINT_BUILD; python: ruff.
# --fix lets clang-format and ruff change files. Versions are pinned: other ones would format otherwise.
set -euo pipefail
cd "$(dirname "$0")/.."
fix=
if [ "${1:-}" = --fix ]; then fix=1; shift; fi
steps=("$@")
[ $# -gt 0 ] || steps=(format tidy python)
scripts/install_dependencies.sh lint
failed=()

lint_format() {
  local -a files
  # Public headers and the solver of training are aligned by hand.
  mapfile -t files < <(git ls-files '*.c' '*.cc' '*.cpp' '*.h' | grep -vE '^((engine|fit)/include|training|tests/abi/kept)/')
  [ ${#files[@]} -gt 100 ] ||
    { echo "lint: found ${#files[@]} files to format; is this the repository?" >&2; return 1; }
  if [ -n "$fix" ]; then clang-format -i "${files[@]}"; return; fi
  printf '%s\0' "${files[@]}" | xargs -0 -n 40 -P "$(nproc)" clang-format --dry-run --Werror --ferror-limit=1 ||
    { echo "lint: scripts/lint.sh --fix format mends these" >&2; return 1; }
  echo "lint: clang-format: ${#files[@]} files"
}

lint_tidy() {
  local build=${DCLOTH_LINT_BUILD:-build} base=${DCLOTH_LINT_BASE:-} most=12 sample=4
  local -a files
  if [ ! -f "$build/compile_commands.json" ]; then
    echo "lint: found no $build/compile_commands.json; run scripts/build.sh $build -DDCLOTH_BUILD_TESTS=ON" >&2
    return 1
  fi
  if [ -z "$base" ]; then
    for base in origin/main main HEAD; do git rev-parse -q --verify "$base^{commit}" >/dev/null && break; done
  fi
  # What changed comes first. Vector sources are compiled once a target by macros that clang-tidy does not follow.
  mapfile -t files < <({
    git diff --name-only --diff-filter=d "$base" -- engine fit kernels converter tools
    git ls-files engine/src engine/format fit kernels | grep '\.cc$' | grep -v '_vector\.cc$' | awk 'NR % 12 == 0' |
      head -n "$sample"
  } | grep '\.cc$' | grep -v '_vector\.cc$' | awk '!seen[$0]++' | while IFS= read -r file; do
    if grep -qF "/$file\"" "$build/compile_commands.json"; then printf '%s\n' "$file"; fi
  done | head -n "$most")
  [ ${#files[@]} -gt 0 ] || { echo "lint: clang-tidy found nothing to look at" >&2; return 1; }
  printf '%s\0' "${files[@]}" |
    xargs -0 -n 1 -P "$(nproc)" clang-tidy -p "$build" --quiet --warnings-as-errors='*' \
      --extra-arg=-Wno-unknown-warning-option 2>/dev/null || return 1
  echo "lint: clang-tidy: ${#files[@]} files (at most $most: those that differ from $base, then a sample)"
}

lint_python() {
  .venv/bin/ruff check --quiet ${fix:+--fix} . || return 1
  echo "lint: ruff: $(git ls-files '*.py' | wc -l) files"
}

for step in "${steps[@]}"; do
  case $step in
    format | tidy | python) "lint_$step" || failed+=("$step") ;;
    *) echo "lint: unknown step '$step'; allowed: format, tidy, python" >&2; exit 2 ;;
  esac
done
[ ${#failed[@]} -eq 0 ] || { echo "lint: failed: ${failed[*]}" >&2; exit 1; }
