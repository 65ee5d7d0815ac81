"""Compares and times dcloth and its peers; run.sh builds what this needs.

    python3 -m peers --library libdcloth_peers.so --dcloth dcloth --build BUILD --work DIR [--page RESULTS.md]
        [--json results.json] [--preset paper] [--core C] [--ticks 200] [--seconds 75] [--trained BUNDLE SEQUENCE]
"""
import argparse
import json
import os
import shutil
import sys
import time

from pages import machine

from . import contestants, measure, page
from .engine_peer import EnginePeer, Library


STARTED = time.monotonic()


def say(text):
    print(f"{time.monotonic() - STARTED:5.0f} s  {text}", file=sys.stderr, flush=True)


def progress(what):
    last = [0.0]

    def step(done, samples):
        if sys.stderr.isatty() and time.monotonic() - last[0] > 1:
            last[0] = time.monotonic()
            print(f"\r{what}: {done} of {samples} ticks each ", end="" if done < samples else "\n", file=sys.stderr)
    return step


def arguments(argv):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("library", "dcloth", "build", "work"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--frames", type=int, default=24,
                        help="of the preset's sequence; all compared, timed round and round")
    parser.add_argument("--trained", nargs=2, metavar=("BUNDLE", "SEQUENCE"),
                        help="a trained garment, in a section of its own")
    parser.add_argument("--core", type=int)
    parser.add_argument("--ticks", type=int, default=200, help="timed ticks a contestant, warm and cold each")
    parser.add_argument("--seconds", type=float, default=75, help="at most, warm and cold each")
    parser.add_argument("--page")
    parser.add_argument("--json")
    return parser.parse_args(argv)


def empty_folder(*parts):
    folder = os.path.join(*parts)
    shutil.rmtree(folder, ignore_errors=True)    # models of an older converter or generator are no result
    os.makedirs(folder)
    return folder


def garment(options, library, bundle, sequence, models, folder):
    """Compares and times everyone on one garment."""
    from .case import Case
    say("the float64 reference")
    case = Case(bundle, sequence)
    say("converting models")
    everyone = contestants.engines(library, options.dcloth, bundle, sequence, folder, models)
    others, absent = contestants.peers(case, folder, say)
    everyone.update(others)

    displacement_mm = case.displacement_mm()
    rows = {}
    for name, contestant in list(everyone.items()):
        error = measure.compare(contestant, case)
        why = measure.refusal(error, contestant.precision, displacement_mm)
        say(f"{name}: {error['mean']:.4f} mm mean, {error['max']:.4f} max" + (f"; left out: {why}" if why else ""))
        if why:
            absent[name] = why
            del everyone[name]
            continue
        rows[name] = {"version": contestant.version, "precision": contestant.precision, "note": contestant.note,
                      "engine": isinstance(contestant, EnginePeer), "weight_bytes": contestant.weight_bytes,
                      "instance_bytes": getattr(contestant, "instance_bytes", None),
                      "basis_rows": getattr(contestant, "basis_rows", len(case.weights.basis)), "error_mm": error,
                      "tried": contestant.tried}
    for name, evict in (("warm", None), ("cold", library.evict)):
        timed = measure.interleaved(everyone, case.frames, evict, options.ticks, options.seconds, progress(name))
        for row, values in timed.items():
            rows[row][name] = values
    return case, {"frames": case.frames, "garment": case.sizes(), "displacement_mm": displacement_mm,
                  "multiply_adds": case.weights.multiply_adds(), "rows": rows, "absent": absent}


def run(options):
    """Everything -> the results, as written to --json."""
    started, library = time.time(), Library(options.library)
    core = machine.pin(options.core)
    from dcloth_training import synthetic
    say("limits of the core")
    neighbours, before = machine.Neighbours(), machine.limits(library)
    say(f"making a garment of preset '{options.preset}'")
    folder = empty_folder(options.work, options.preset)
    made = synthetic.write(folder, synthetic.PRESETS[options.preset], options.frames)
    case, results = garment(options, library, *made, contestants.SEEDED, folder)
    # a shared machine's memory is not equally fast all the time
    limits = machine.higher(before, machine.limits(library))
    peak = max(limits["fma_gmacs"].values(), default=float("inf"))
    results["floor_ms"] = {p: measure.floor_ms(case.weights, bits, limits["read_gbps"], peak)
                           for p, bits in (("fp32", 32), ("fp16", 16), ("int8", 8))}
    results["preset"] = options.preset
    results["limits"] = limits
    if options.trained:
        say(f"a trained garment: {options.trained[0]}")
        _, trained = garment(options, library, *options.trained, contestants.TRAINED,
                             empty_folder(options.work, "trained"))
        results["trained"] = trained | {"bundle": options.trained[0], "sequence": options.trained[1]}
    return results | {"date": time.strftime("%Y-%m-%d", time.gmtime(started)), "seconds": time.time() - started,
                      "machine": machine.describe(library, core, options.build),
                      "others_used_cores": neighbours.share()}


def main(argv=None):
    options = arguments(argv)
    results = run(options)
    for path, text in ((options.json, json.dumps(results, indent=1) + "\n"), (options.page, page.markdown(results))):
        if path:
            with open(f"{path}.tmp", "w", encoding="utf-8") as file:
                file.write(text)
            os.replace(f"{path}.tmp", path)
    print(page.terminal(results))
    missing = contestants.BASELINE not in results["rows"]
    if missing:
        say(f"{contestants.BASELINE} did not run: {results['absent'].get(contestants.BASELINE)}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
