#!/usr/bin/env python3
"""Changes one operator or number of a source at a time and asks whether its tests notice.

    mutate.py BUILD [--files PATTERN] [--sample N] [--seed S] [--results FILE]

BUILD is a Ninja build of this tree with all tests built. A mutant is compiled by the build's own command into a folder
of its own and linked before the libraries, so neither tree nor build changes. What passes all tests is compiled again
with each index into an array checked, as the sanitized tests of scripts/test.sh have it: a step past an array on the
stack may change nothing in a release build. Verdicts are added to FILE (out/mutation/results.jsonl), and a mutant that
has one is not tried again: stop and go on at will. At the end the survivors are listed; explained.json says why no
test can tell some of them apart, reason by reason; any other makes the exit code 1.
"""
import argparse
import collections
import hashlib
import json
import pathlib
import random
import re
import shlex
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent
HANG = 10  # a test that takes so many times as long, and as many seconds more, hangs
CHECKED = ("-fsanitize=bounds,object-size", "-fsanitize-undefined-trap-on-error",  # a trap needs no sanitizer's library
           "-D_GLIBCXX_ASSERTIONS", "-UNDEBUG")  # indices of vectors and spans; of Eigen's matrices

# Source to the tests that own it.
KERNELS = {family: [f"kernels_{family}_test", "kernels_reproducible_test"]
           for family in ("activation", "gru", "gsgru", "nearest", "normals", "output", "skinning")}
KERNELS["nearest"].append("kernels_nearest_cases_test")
KERNELS["gsgru"].append("kernels_gsgru_i8_test")
KERNELS["matvec"] = [f"kernels_{kind}_test"
                     for kind in ("matmul_i8", "matvec_float", "matvec_i8", "quantize",
                                  "reproducible")]
VERIFIER = ["attack_ladder_test", "attack_every_tensor_test", "attack_odd_files_test", "engine_diagnostic_test",
            "engine_format_test", "engine_scan_test"]
STATE = ["attack_state_test", "engine_state_test", "engine_state_check_test", "engine_hot_swap_test"]
# Headers that hold arithmetic. What the others hold, sizes and bounds, the tests take from them too.
ARITHMETIC = re.compile(r"(-inl|_scalar|_accumulate|/coarse_tanh|/half|/quantize|/scalar_math)\.h$")
# A test that looks at all of a header, and is compiled with the mutant itself.
DIRECT = {"kernels/half.h": [("tests/unit/kernels/half_test.cc", ["kernels_half_test"])]}
# Sources of the converter that have not just the test of their name; every other one has.
WHOLE = ["converter_convert_test", "converter_attempts_test", "converter_convert_rank_test"]
BUNDLE = ["converter_bundle_test", "converter_bundle_fault_test"]
CONVERTER = {"assemble": ["converter_assemble_test", *WHOLE], "attempts": WHOLE,
             "body_surface": ["converter_body_surface_test", "converter_body_surface_cloud_test"],
             "bundle": BUNDLE, "bundle_metadata": BUNDLE, "convert": WHOLE, "model_maker": WHOLE, "stages": WHOLE,
             "file": ["converter_file_test", "converter_file_fault_test"],
             "calibrate": ["converter_rank_test", "converter_convert_rank_test"],
             "reduce": ["converter_reduce_test", "converter_rank_test"],
             "safetensors_header": ["converter_safetensors_test"],
             "tensor_reader": [*BUNDLE, "converter_sequence_test"]}


def included(path, seen):
    """Adds to `seen` the headers of kernels/ that a file includes, through others and its own header too."""
    own = str(pathlib.Path(path).with_suffix(".h"))
    for name in re.findall(r'#include "([^"]+\.h)"', (ROOT / path).read_text()):
        if name not in seen and (name.startswith("kernels/") or name == own):
            seen.add(name)
            included(name, seen)
    return seen


def owners():
    """{file: [(source to compile, its tests)]}. A header of the kernels has all sources that include it."""
    found = {}
    for family, tests in KERNELS.items():
        for path in sorted((ROOT / "kernels" / family).glob("*.cc")):
            found[str(path.relative_to(ROOT))] = [(str(path.relative_to(ROOT)), tests)]
    for path in sorted((ROOT / "engine/format").glob("*.cc")):
        found[str(path.relative_to(ROOT))] = [(str(path.relative_to(ROOT)), VERIFIER)]
    for name in ("state", "state_check"):
        found[f"engine/src/state/{name}.cc"] = [(f"engine/src/state/{name}.cc", STATE)]
    for path in sorted((ROOT / "converter").glob("*.cc")):
        file = str(path.relative_to(ROOT))
        found[file] = [(file, CONVERTER.get(path.stem, [f"converter_{path.stem}_test"]))]
    sources = [home for homes in found.values() for home in homes]
    for path in sorted((ROOT / "kernels").rglob("*.h")):
        header = str(path.relative_to(ROOT))
        homes = [home for home in sources if header in included(home[0], set())]
        if homes and ARITHMETIC.search(header):
            homes.sort(key=lambda home: not home[0].startswith(str(pathlib.Path(header).parent)))
            found[header] = DIRECT.get(header, []) + homes
    return found


# What is looked for in a line and what it becomes.
OPERATORS = [(r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "), (r" == ", " != "),
             (r" != ", " == "),
             (r" && ", " || "), (r" \|\| ", " && "), (r" \+ ", " - "), (r" - ", " + "), (r" \* ", " + "),
             (r" / ", " * "),
             (r" \+= ", " -= "), (r"\btrue\b", "false"), (r"\bfalse\b", "true"), (r"(?<![\w.])0(?![\w.])", "1"),
             (r"(?<![\w.])1(?![\w.])", "2"), (r"\bAdd\(", "Sub("), (r"\bMin\(", "Max("), (r"\bMax\(", "Min("),
             (r"\bLt\(", "Le("), (r"\bGe\(", "Gt(")]

Mutant = collections.namedtuple("Mutant", "file number before after nth")  # nth of the same lines of a file


def code_of(line):
    """The part before a comment; empty where nothing can be changed."""
    bare = line.split("//")[0]
    if bare.lstrip().startswith(("#", "*", "/*", "static_assert", "template", "namespace", "using")) or '"' in bare:
        return ""
    return bare


def mutants_of(file):
    same = collections.Counter()
    for number, line in enumerate((ROOT / file).read_text().split("\n")):
        code = code_of(line)
        for pattern, becomes in OPERATORS:
            for match in re.finditer(pattern, code):
                after = line[:match.start()] + becomes + line[match.end():]
                yield Mutant(file, number, line, after, same[line, after])
                same[line, after] += 1


def key_of(mutant):
    """The same as long as file and line stay what they are, wherever the line stands; lines that repeat are counted."""
    parts = [mutant.file, mutant.before, mutant.after] + [str(mutant.nth)] * (mutant.nth > 0)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


class Build:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder).resolve()
        self.compiles = {}
        for entry in json.loads(self.ninja("-t", "compdb")):
            self.compiles.setdefault(str(pathlib.Path(entry["file"]).resolve()), entry["command"])

    def ninja(self, *arguments):
        return subprocess.run(["ninja", *arguments], cwd=self.folder, check=True, capture_output=True, text=True).stdout

    def compile(self, source, file, text, folder, more=()):
        """The object of `source` where `file`, itself or a header of it, is `text`; None where the compiler refuses."""
        words = shlex.split(self.compiles[str(ROOT / source)])
        words = [w for w in words if not w.endswith("ccache") and w != "-Werror"]
        changed, target = folder / file, folder / "mutant.o"
        changed.parent.mkdir(parents=True, exist_ok=True)
        changed.write_text(text)
        words[words.index("-o") + 1] = str(target)
        if source == file:
            words[words.index("-c") + 1] = str(changed)
        for flag in ("-MD", "-MF", "-MT"):
            if flag in words:
                at = words.index(flag)
                del words[at:at + (1 if flag == "-MD" else 2)]
        # The folder first: what includes a header, or itself once per instruction set, finds the mutant.
        done = subprocess.run([words[0], f"-I{folder}", *words[1:], *more], cwd=self.folder, capture_output=True)
        return target if done.returncode == 0 else None

    def link(self, test, source, mutant, folder):
        """`test` with the object `mutant` before the libraries, for that of `source` where it is the test's own."""
        command = self.ninja("-t", "commands", "-s", test).strip().split("\n")[-1]
        words = shlex.split(command.replace(": && ", "", 1).split(" && ")[0])
        at = words.index("-o")
        words[at + 1] = str(folder / test)
        words.insert(at, str(mutant))
        words = [word for word in words if not word.endswith(f"/{pathlib.Path(source).name}.o")]
        subprocess.run(words, cwd=self.folder, check=True, capture_output=True)
        return folder / test


def notices(executable, limit_s=None):
    try:
        done = subprocess.run([str(executable), "--gtest_brief=1"], capture_output=True, timeout=limit_s)
        return done.returncode != 0
    except subprocess.TimeoutExpired:
        return True  # a hang is noticed


def try_mutant(build, mutant, homes):
    """`homes`: [(source, {test: seconds it may take})]."""
    lines = (ROOT / mutant.file).read_text().split("\n")
    lines[mutant.number] = mutant.after
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for more in ((), CHECKED):
            for source, limits in homes:
                mutated = build.compile(source, mutant.file, "\n".join(lines), folder, more)
                if mutated is None:
                    return "does not compile"
                for test, limit_s in limits.items():
                    if notices(build.link(test, source, mutated, folder), limit_s):
                        return "killed with indices checked" if more else "killed"
    return "survived"


def limits_of(build, source, tests):
    """{test: seconds it may take}. The unchanged source passes: else every mutant would be killed by nothing."""
    limits = {}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for more in ((), CHECKED):
            same = build.compile(source, source, (ROOT / source).read_text(), folder, more)
            assert same is not None, source
            for test in tests:
                executable, start = build.link(test, source, same, folder), time.monotonic()
                assert not notices(executable), f"{test} fails without a mutant"
                limits[test] = HANG * (1 + time.monotonic() - start)
    return dict(sorted(limits.items(), key=lambda item: item[1]))  # most mutants die in the quickest


def run(options):
    build = Build(options.build)
    results = pathlib.Path(options.results)
    results.parent.mkdir(parents=True, exist_ok=True)
    known = {}
    if results.exists():
        known = {(entry := json.loads(line))["key"]: entry for line in results.read_text().splitlines()}
    explained = {key for keys in json.loads((HERE / "explained.json").read_text()).values() for key in keys}
    tried = collections.Counter()
    survivors = []
    timed = {}
    for file, homes in owners().items():
        if not re.search(options.files, file):
            continue
        every = list(mutants_of(file))
        chosen = random.Random(options.seed).sample(every, min(options.sample, len(every)))
        if any(key_of(mutant) not in known for mutant in chosen):
            for source, tests in homes:
                if source not in timed:
                    timed[source] = limits_of(build, source, tests)
        for mutant in chosen:
            key = key_of(mutant)
            if key not in known:
                verdict = try_mutant(build, mutant, [(source, timed[source]) for source, _ in homes])
                known[key] = {"key": key, "file": file, "line": mutant.number + 1, "before": mutant.before.strip(),
                              "after": mutant.after.strip(), "verdict": verdict}
                with results.open("a") as out:
                    out.write(json.dumps(known[key]) + "\n")
                print(f"{file}:{mutant.number + 1}: {known[key]['verdict']}: {mutant.after.strip()}", flush=True)
            tried[known[key]["verdict"]] += 1
            if known[key]["verdict"] == "survived":
                survivors.append(known[key])
    left = [entry for entry in survivors if entry["key"] not in explained]
    for entry in left:
        print(f"survivor {entry['key']} {entry['file']}:{entry['line']}\n  - {entry['before']}\n  + {entry['after']}")
    print(f"{sum(tried.values())} mutants: " + ", ".join(f"{count} {verdict}" for verdict, count in tried.items()) +
          f"; {len(survivors) - len(left)} survivors explained, {len(left)} not")
    return 1 if left or not tried else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--files", default="", help="a regular expression that source paths have to match")
    parser.add_argument("--sample", type=int, default=10, help="mutants of each source, drawn at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--results", default=str(ROOT / "out/mutation/results.jsonl"))
    return run(parser.parse_args())


if __name__ == "__main__":
    sys.exit(main())
