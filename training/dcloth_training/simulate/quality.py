"""Quality report of the ground truth: figures and pictures of every clip, as a page.

    python3 -m dcloth_training.simulate.quality --data DATA -o REPORT [--floor floor.json] [--every N] [--pictures N]

Writes REPORT/index.html (open it in a browser), report.json, report.md, and REPORT/clips/<clip>.png: frames evenly
spaced, then those in which the cloth is stretched most, folded most and fastest, and those in which it crosses the
body and itself most. All of it is measured on the files as they are, crossings and depth exactly; seconds and settings
are the manifest's. What is not cloth is marked: frames that cross the body, that are tangled or torn. All clips are
measured before any is drawn, and those whose figures stand out are drawn first. Stopped and started again it goes on:
a file measured and drawn is not read again until it changes. A file whose hash is not the one in the manifest, or that
is not in it, is reported and ends with status 1.
"""
import argparse
import concurrent.futures
import json
import os
import sys

import numpy as np

from .. import dataset, safetensors_io
from . import checks, clips, quality_clip, quality_page, quality_text


def read_manifest(path):
    """{clip: its last line}. A clip simulated again has several lines; the file is the last one's."""
    out = {}
    with open(path) as file:
        for number, line in enumerate(file, 1):
            try:
                entry = json.loads(line)
                out[entry["clip"]] = entry
            except (ValueError, KeyError, TypeError) as error:
                raise ValueError(f"{path}:{number}: not a JSON object with 'clip': {error}") from None
    return out


def read_floor(path):
    """{clip: {"floor_mean_mm", "floor_end_mm", "floor_entered_mm", "floor_relative"}} of floor.py."""
    if not path:
        return {}
    with open(path) as file:
        rows = json.load(file)["clips"]
    return {row["clip"]: {f"floor_{key}": row.get(key)
                          for key in ("mean_mm", "end_mm", "entered_mm", "relative")} for row in rows}


def group(name):
    """"drapes", or what a clip is for and where its motion is from: "training_recorded", "reported_recorded" ..."""
    return "drapes" if name.startswith("drapes-") else f"{dataset.role(name)}_{dataset.source(name)}"


def row_of(measured, manifest, floors):
    """What a file measures, with what the manifest and the floor know of its clip."""
    name = measured["clip"]
    entry = manifest.get(name, {})
    row = {"clip": name, "group": group(name), "regime": entry.get("root"), "seed": clips.seed(name), **measured,
           "seconds_per_frame": entry.get("seconds_per_frame"), **floors.get(name, {})}
    if "sha256" not in entry:
        row["fault"] = "not in the manifest"
    elif entry["sha256"] != measured["sha256"]:
        row["fault"] = "the file is not the one the manifest describes"
    else:
        for key in ("stretch_p99", "stretch_max", "penetration_max_mm"):      # of frames that were not measured here
            row[key] = max(row[key], entry.get(key, row[key]))
        for key in ("speed_max", "speed_mean"):
            row[key] = entry.get(key) if row[key] is None else row[key]
        row["fault"] = checks.refuse({**row, "speed_max": row["speed_max"] or 0.0})
    return row


def standing_out(rows):
    """Indices of rows, the most remarkable first: by the best rank that a row has in any of its figures."""
    best = np.full(len(rows), len(rows))
    for key in ("torn_share", "through_share", "crossed_share", "body_crossings_max", "cloth_crossings_max",
                "penetration_max_mm", "stretch_max", "stretch_p99", "folded_max", "speed_max"):
        values = np.array([row[key] or 0.0 for row in rows])
        rank = np.empty(len(rows), int)
        rank[np.argsort(-values, kind="stable")] = np.arange(len(rows))
        best = np.minimum(best, np.where(values > 0, rank, len(rows)))
    faults = np.array([row["fault"] is None for row in rows])
    return np.lexsort((best, faults)).tolist()


def sources(data):
    """Paths of every file of ground truth in the order of the report, drapes last; and clips not simulated yet."""
    order = {name: i for i, name in enumerate(
        clips.DEVELOPMENT + clips.VALIDATION + clips.training() + clips.RANDOM + clips.VARIATIONS + clips.WIDE
        + clips.MIXED + clips.LEANING)}
    places = {clips.file_stem(name): i for name, i in order.items()}
    out = []
    for kind in ("dynamic", "static"):
        folder = os.path.join(data, kind)
        stems = [name[:-len(".safetensors")] for name in os.listdir(folder)
                 if name.endswith(".safetensors")] if kind == "dynamic" or os.path.isdir(folder) else []
        if not stems and kind == "dynamic":
            raise ValueError(f"{folder}: no .safetensors file; make ground truth with simulate.run first")
        out += [os.path.join(folder, stem + ".safetensors")
                for stem in sorted(stems, key=lambda s: (places.get(s, len(places)), s))]
    return out, list(order)


def each(work, items, options, what):
    """work(item) of every item in order, options.workers at a time; progress on a terminal."""
    with concurrent.futures.ProcessPoolExecutor(options.workers) as pool:
        for number, found in enumerate(pool.map(work, items) if options.workers > 1 else map(work, items), 1):
            if sys.stderr.isatty():
                print(f"\r{what} {number}/{len(items)}", end="", file=sys.stderr)
            yield found


def report(options):
    """The whole report as a dict; pictures are written on the way."""
    manifest = read_manifest(os.path.join(options.data, "manifest.jsonl"))
    floors = read_floor(options.floor)
    paths, known = sources(options.data)
    os.makedirs(os.path.join(options.out, "clips"), exist_ok=True)
    work = quality_clip.Work(os.path.join(options.data, "character.safetensors"), os.path.join(options.out, "clips"),
                             options.every)
    rows = [row_of(measured, manifest, floors) for measured in each(work, paths, options, "measured")]
    for _ in each(work.draw, [paths[i] for i in standing_out(rows)[:options.pictures]], options, "drawn"):
        pass
    for row, path in zip(rows, paths):
        row["picture"] = f"clips/{os.path.basename(work.stem(path))}.png" if work.drawn(path) else None
    there = {row["clip"] for row in rows}
    character, _ = safetensors_io.read(work.character_path)
    return {"data": os.path.basename(os.path.abspath(options.data)),
            "cloth_vertices": len(character["cloth_template"]),
            "cloth_faces": len(character["cloth_faces"]), "clips": rows,
            "drapes": sum(row["frames"] for row in rows if row["group"] == "drapes"),
            "refused": {name: entry["refused"] for name, entry in manifest.items()
                        if "refused" in entry and name not in there},
            "missing": [name for name in known if name not in there and name not in manifest],
            "left_out": [list(pair) for pair in clips.LEFT_OUT]}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", required=True, help="ground truth made by run.py")
    parser.add_argument("-o", "--out", required=True, help="folder of the report")
    parser.add_argument("--floor", help="JSON of floor.py; default: floor.json in --data if there")
    parser.add_argument("--every", type=int, default=1,
                        help="measure every so many frames; above 1 speeds are the manifest's")
    parser.add_argument("--pictures", type=int,
                        help="draw so many clips at most, those whose figures stand out; 0: none")
    parser.add_argument("--workers", type=int, default=1, help="clips at a time")
    options = parser.parse_args(arguments)
    if options.every < 1 or options.workers < 1 or (options.pictures or 0) < 0:
        parser.error("--every and --workers are at least 1, --pictures at least 0")
    beside = os.path.join(options.data, "floor.json")
    options.floor = options.floor or (beside if os.path.exists(beside) else None)
    try:
        found = report(options)
    except (OSError, ValueError, safetensors_io.SafetensorsError) as error:
        print(f"quality: {error}", file=sys.stderr)
        return 2
    quality_text.write(options.out, {"report.json": json.dumps(found, indent=1),
                                     "report.md": quality_text.markdown(found),
                                     "index.html": quality_page.page(found)})
    faults = [row for row in found["clips"] if row["fault"]]
    for row in faults:
        print(f"{row['clip']}: {row['fault']}")
    print(f"{len(found['clips'])} files, {sum(r['frames'] for r in found['clips'])} frames, "
          f"{len(faults)} with a fault, {len(found['refused'])} refused: "
          f"{os.path.join(options.out, 'index.html')}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
