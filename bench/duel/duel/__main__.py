"""Plays the duel of one garment and writes its page; run.sh builds what this needs.

    python3 -m duel GARMENT --build BUILD --work DIR --page FILE [--data DATA] [--rounds N] [--frames N] [--clips N]
                    [--jolt VERSION] [--bundle FILE] [--quick]

DATA: ground truth, as `dcloth_training.card --data` takes it; of it the reported clips play. Without it the bundled
test sequences do. Cases and models are kept in DIR, results in DIR/GARMENT.json.
"""
import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dcloth_training import dataset, metrics, safetensors_io
from pages import machine
from pages.steps import Steps

from . import contest, page

ROOT = Path(__file__).resolve().parents[3]
EVENT_BUDGET = 0.5      # ms: whose events are shown
SLOW_HZ = 24
QUICK_FRAMES = 40


def arguments(argv):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("garment", choices=("skirt", "robe"))
    parser.add_argument("--build", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--bundle", type=Path, help="default: models/GARMENT/GARMENT.safetensors")
    parser.add_argument("--data", help="folder of ground truth")
    parser.add_argument("--jolt", default="", help="its version, where dcloth_duel has it")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--frames", type=int, help="of each clip, at most")
    parser.add_argument("--clips", type=int, help="at most, from all over the list")
    parser.add_argument("--quick", action="store_true", help="few contestants, clips and frames: does it run at all")
    options = parser.parse_args(argv)
    options.bundle = options.bundle or ROOT / "models" / options.garment / f"{options.garment}.safetensors"
    if options.quick:
        options.rounds, options.frames, options.clips = 1, QUICK_FRAMES, 1
    return options


def played(options, bundle, mesh):
    """The clips."""
    if options.data:
        paths = [Path(dataset.path_of(options.data, name)) for name in dataset.REPORTED]
        paths = [path for path in paths if path.exists()]
        if not paths:
            raise ValueError(f"{options.data}/dynamic: none of the reported clips {', '.join(dataset.REPORTED)}")
    else:
        paths = sorted((ROOT / "models" / options.garment / "sequences").glob("*.safetensors"))
    every = -(-len(paths) // (options.clips or len(paths)))
    return [contest.Clip(path, bundle, mesh, options.frames) for path in paths[::every]]


def made(steps, options):
    """({size: case}, {precision: model}) in the work folder: cases once, they only follow from the garment."""
    from . import garment
    cases, models = {}, {}
    for size in contest.SIZES[:1] if options.quick else contest.SIZES:
        cases[size] = options.work / f"{options.garment}-{size}.safetensors"
        if not cases[size].exists():
            print(f"cutting the {options.garment} of {size} vertices", file=sys.stderr, flush=True)
            garment.write(cases[size], options.garment, size, options.bundle)
    for precision in ("int8",) if options.quick else ("int8", "fp32"):
        models[precision] = options.work / f"{options.garment}-{precision}.dcloth"
        steps.run(f"convert to {precision}", options.build / "dcloth", "convert", options.bundle, "-o",
                  models[precision], "--precision", precision)
    return cases, models


def play_all(steps, options, clips, entries, folder):
    """A row a contestant: times and E_d over all clips."""
    rows, errors = {one.name: [] for one in entries}, {one.name: [] for one in entries}
    for clip in clips:
        print(f"{time.monotonic() - steps.started:5.0f} s  {clip.name}", file=sys.stderr, flush=True)
        said = contest.play(options.build / "dcloth_duel", clip, [one.play() for one in entries], folder,
                            options.rounds)
        for name, row in said.items():
            rows[name].append(row)
            errors[name].append(clip.error_mm(folder, name))
    out = []
    for one in entries:
        last = rows[one.name][-1]
        method = "contact" if dict(one.settings).get("contact") else one.method
        out.append({"name": one.name, "method": method, "error_mm": sum(errors[one.name]) / len(clips),
                    "errors_mm": errors[one.name], "wall_ms": contest.frames_ms(rows[one.name], "wall_ns"),
                    "thread_ms": contest.frames_ms(rows[one.name], "thread_ns"),
                    **{key: last[key] for key in ("instance_bytes", "shared_bytes", "isa")}})
    return out


def measure_all(options, clips, entries, folder):
    """{name: measures over the clips} of some contestants."""
    referee, found = contest.referee_of(options.bundle), {one.name: [] for one in entries}
    for clip in clips:
        contest.play(options.build / "dcloth_duel", clip, [one.play() for one in entries], folder)
        for name, rows in found.items():
            rows.append(clip.measures(folder, name, referee))
    return {name: metrics.over_clips(rows) for name, rows in found.items()}


def events(options, clip, entries, folder):
    """{name: what teleport, hitch and 24 Hz do}, on one clip."""
    program, plain, other = options.build / "dcloth_duel", Path(folder) / "plain", Path(folder) / "event"
    plain.mkdir(), other.mkdir()
    plays, out = [one.play() for one in entries], {}
    contest.play(program, clip, plays, plain)
    for one in entries:
        out[one.name] = {"error_mm": clip.error_mm(plain, one.name)}
    for event in ("teleport", "unsaid", "hitch"):
        said = contest.play(program, clip, plays, other, options.rounds, event=event)
        for one in entries:
            found = clip.after(other, plain, one.name)
            out[one.name][event] = {**found, "worst_ms": contest.hitch_ms(said[one.name], clip)}
    said = contest.play(program, clip, plays, other, options.rounds, hz=SLOW_HZ)
    for one in entries:
        out[one.name]["slow_mm"] = clip.error_mm(other, one.name)
        out[one.name]["slow_ms"] = contest.frames_ms([said[one.name]], "thread_ns")
    return out


def run(options):
    bundle, steps, started = safetensors_io.read(options.bundle), Steps(), time.gmtime()
    clips = played(options, bundle, contest.mesh_of(bundle))
    cases, models = made(steps, options)
    entries = contest.entries(options.garment, cases, models, bool(options.jolt), options.quick)
    by_name = {one.name: one for one in entries}
    results = {"garment": options.garment, "hz": contest.HZ, "rounds": options.rounds, "quick": options.quick,
               "vertices": len(bundle[0]["template.positions"]), "jolt": options.jolt or "not built here",
               "truth": truth_text(options, clips), "clips": [clip.name for clip in clips],
               "tuned": contest.all_tuned(options.garment),
               "date": time.strftime("%Y-%m-%d", started)}
    case = safetensors_io.read(next(iter(cases.values())))[0]
    results["capsules"], results["body_faces"] = len(case["capsules"]), len(case["body.faces"])
    with tempfile.TemporaryDirectory(dir=options.work) as folder:
        results["rows"] = play_all(steps, options, clips, entries, folder)
        measures = measure_all(options, clips, [by_name[name] for name in sorted(page.chosen(results))], folder)
        for row in results["rows"]:
            if row["name"] in measures:
                row["measures"] = measures[row["name"]]
        shown = [by_name[row["name"]] for row in page.at_event(results, EVENT_BUDGET)]
        results["events"] = {"clip": clips[-1].name, "budget": EVENT_BUDGET,
                             "rows": events(options, clips[-1], shown, folder)}
    results["run"] = steps.summary()
    results["machine"] = machine_of(options, results["rows"][0]["isa"])
    results["version"] = version(options)
    return results


def truth_text(options, clips):
    what = f"{len(clips)} reported clips" if options.data else f"{len(clips)} bundled sequences, no reported clips"
    frames = sum(len(clip.item.truth) for clip in clips)
    first = f", of each the first {options.frames}" if options.frames else ""
    return f"{what} ({', '.join(clip.name for clip in clips)}), {frames:,} frames at their own rate{first}"


def machine_of(options, isa):
    return {"cpu": machine.cpu_name(), "core": max(os.sched_getaffinity(0)), "cores": os.cpu_count(),
            "system": platform.platform(), "compiler": machine.compiler(options.build),
            "python": sys.version.split()[0], "isa": isa}


def version(options):
    said = subprocess.run([options.build / "dcloth", "--version"], capture_output=True, text=True, check=True).stdout
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=False).stdout.strip()
    return f"{said.strip()} ({commit})" if commit else said.strip()


def main(argv=None):
    options = arguments(argv)
    options.work.mkdir(parents=True, exist_ok=True)
    try:
        results = run(options)
    except (OSError, ValueError) as error:
        print(f"duel: {error}", file=sys.stderr)
        return 2
    (options.work / f"{options.garment}.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    options.page.parent.mkdir(parents=True, exist_ok=True)
    options.page.write_text(page.markdown(results), encoding="utf-8")
    print(page.verdicts(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
