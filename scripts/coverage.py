#!/usr/bin/env python3
"""Prints which share of the lines of engine, fit and kernels the tests have run, file by file.

    coverage.py BUILD [--least PERCENT] [--missing]

BUILD was configured with DCLOTH_COVERAGE and has run its tests (scripts/coverage.sh does both). A line counts as run
where any of its instances ran: vector kernels are compiled once for each instruction set. --missing names the lines
that did not. Exit code 1 where one of them is below PERCENT (95), or where nothing was found to look at.
"""
import argparse
import collections
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
ROOMS = ("engine", "fit", "kernels")


def counts_of(build):
    """Of each source file of ROOMS: line number to how often it ran."""
    found = collections.defaultdict(collections.Counter)
    notes = sorted(build.rglob("*.gcno"))
    for note in notes:  # a note without data beside it counts as never run
        data = note.with_suffix(".gcda")
        done = subprocess.run(["gcov", "--json-format", "--stdout", data if data.exists() else note], cwd=build,
                              capture_output=True, text=True, check=True)
        for line in done.stdout.splitlines():
            report = json.loads(line)
            for file in report["files"]:
                path = (pathlib.Path(report["current_working_directory"]) / file["file"]).resolve()
                if not path.is_relative_to(ROOT) or path.is_relative_to(build):
                    continue
                name = path.relative_to(ROOT)
                if name.parts[0] in ROOMS:
                    for entry in file["lines"]:
                        found[str(name)][entry["line_number"]] += entry["count"]
    print(f"{len(notes)} objects, {len(found)} source files")
    return found


def ranges(numbers):
    text, numbers = [], sorted(numbers)
    while numbers:
        last = 0
        while last + 1 < len(numbers) and numbers[last + 1] == numbers[0] + last + 1:
            last += 1
        text.append(str(numbers[0]) + (f"-{numbers[last]}" if last else ""))
        numbers = numbers[last + 1:]
    return ", ".join(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--least", type=float, default=95)
    parser.add_argument("--missing", action="store_true")
    options = parser.parse_args()
    run, all_lines = collections.Counter(), collections.Counter()
    for name, lines in sorted(counts_of(options.build).items()):
        missed = [number for number, count in lines.items() if count == 0]
        room = name.split("/")[0]
        run[room] += len(lines) - len(missed)
        all_lines[room] += len(lines)
        print(f"{100 * (1 - len(missed) / len(lines)):6.1f} % of {len(lines):4} {name}" +
              (f": {ranges(missed)}" if options.missing and missed else ""))
    good = True
    for room in ROOMS:
        share = 100 * run[room] / all_lines[room] if all_lines[room] else 0
        good = good and share >= options.least
        print(f"{room}: {run[room]} of {all_lines[room]} lines, {share:.1f} %; at least {options.least:g} % asked for")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
