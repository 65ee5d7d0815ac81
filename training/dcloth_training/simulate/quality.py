"""Quality report of the ground truth: numbers a clip, and pictures of every one of them.

    python3 -m dcloth_training.simulate.quality --data DATA -o REPORT [--floor floor.json]

Writes REPORT/report.json, REPORT/report.md and REPORT/sheet-NN.png, a row a clip: five frames evenly
spaced, then the one in which the cloth is stretched most. Stretch and speed are measured here again,
on every frame of the files as they are; penetration, seconds and settings are the manifest's. A file
whose hash is not the one in the manifest, or that is not in it, is reported and ends with status 1.
"""
import argparse
import hashlib
import json
import os
import sys

import numpy as np

from .. import safetensors_io, sequence
from ..motion import skeleton
from . import checks, clips, quality_text, render

PICTURES = 6
PICTURE_SIZE = 170
ROWS_A_SHEET = 24
DPI = 128                     # a power of two: pixels over DPI and back is exact


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
    """{clip: {"mean_mm", "end_mm", "entered_mm", "alive_mm"}} of floor.py's JSON; {} without a file."""
    if not path:
        return {}
    with open(path) as file:
        rows = json.load(file)["clips"]
    keys = ("mean_mm", "end_mm", "entered_mm", "alive_mm")
    return {row["clip"]: {f"floor_{key}" if key != "alive_mm" else key: row.get(key)
                          for key in keys} for row in rows}


def stretch(cloth, pairs, rest):
    """Edge length over rest length -> (99th percentile, largest) of each frame [T], [T]."""
    p99, largest = np.empty(len(cloth)), np.empty(len(cloth))
    for t, points in enumerate(cloth):
        ratio = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) / rest
        p99[t], largest[t] = np.percentile(ratio, 99), ratio.max()
    return p99, largest


def group(name):
    """held_out, random, variation or training."""
    if name in clips.HELD_OUT:
        return "held_out"
    if "~" in name:
        return "variation"
    return "random" if name.startswith("procedural/random_") else "training"


def _digest(path):
    """SHA-256 of a file, in pieces: a clip is 30 MB."""
    total = hashlib.sha256()
    with open(path, "rb") as file:
        for piece in iter(lambda: file.read(1 << 20), b""):
            total.update(piece)
    return total.hexdigest()


def measure(path, character, manifest, floors):
    """One file -> its row of the report, and the frames to picture."""
    data = sequence.read(path)
    if data.truth is None:
        raise ValueError(f"{path}: no tensor 'truth': not a file of ground truth")
    rest = character.get("cloth_rest", character["cloth_template"])
    if data.truth.shape[1] != len(rest):
        raise ValueError(f"{path}: {data.truth.shape[1]} cloth vertices, the character beside it has "
                         f"{len(rest)}: --data mixes two garments")
    pairs = checks.edges(character["cloth_faces"])
    length = np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=1)
    p99, largest = stretch(data.truth, pairs, length)
    speed = np.linalg.norm(np.diff(data.truth, axis=0), axis=-1) * skeleton.FPS
    entry, digest = manifest.get(data.clip, {}), _digest(path)
    row = {"clip": data.clip, "group": group(data.clip), "regime": entry.get("root"),
           "frames": len(data.truth), "seed": clips.seed(data.clip),
           "stretch_p99": round(float(p99.max()), 3), "stretch_max": round(float(largest.max()), 3),
           "stretch_max_frame": int(largest.argmax()),
           "penetration_max_mm": entry.get("penetration_max_mm"),
           "sunken_share": entry.get("sunken_share"),
           "speed_max": round(float(speed.max(initial=0)), 2),
           "speed_mean": round(float(speed.mean()) if speed.size else 0.0, 3),
           "seconds_per_frame": entry.get("seconds_per_frame"), "sha256": digest,
           **floors.get(data.clip, {})}
    if "sha256" not in entry:
        row["fault"] = "not in the manifest"
    elif entry["sha256"] != digest:
        row["fault"] = "the file is not the one the manifest describes"
    else:
        row["fault"] = checks.refuse(row)
    even = np.linspace(0, len(data.truth) - 1, PICTURES - 1).astype(int)
    return row, data, [*even, row["stretch_max_frame"]]


class Sheets:
    """Collects picture rows and writes a labelled PNG each ROWS_A_SHEET of them."""

    def __init__(self, folder, character):
        self.folder, self.character, self.written = folder, character, []
        self.rows, self.labels = [], []

    def add(self, row, data, frames):
        self.rows.append(render.contact_sheet(self.character, data.joint_matrices, data.truth, frames,
                                              PICTURES, PICTURE_SIZE))
        known = [f"stretch {row['stretch_max']:.2f}", f"speed {row['speed_max']:.1f} m/s"]
        if row["penetration_max_mm"] is not None:
            known.append(f"penetration {row['penetration_max_mm']:.1f} mm")
        if row.get("floor_mean_mm") is not None:
            known.append(f"floor {row['floor_mean_mm']:.1f} mm")
        self.labels.append(f"{row['clip']}  [{row['group']}]   " + ", ".join(known)
                           + f"   frames {', '.join(str(int(f)) for f in frames)}")
        if len(self.rows) == ROWS_A_SHEET:
            self.flush()

    def flush(self):
        if not self.rows:
            return
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib.figure import Figure
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        image = np.clip(np.concatenate(self.rows, 0), 0, 1)
        tall, wide = image.shape[:2]
        figure = Figure((wide / DPI, tall / DPI), dpi=DPI)
        FigureCanvasAgg(figure)
        figure.figimage(image, origin="upper")
        for number, label in enumerate(self.labels):
            figure.text(4 / wide, 1 - (number * PICTURE_SIZE + 3) / tall, label, fontsize=5,
                        va="top", family="monospace")
        name = f"sheet-{len(self.written) + 1:02d}.png"
        figure.savefig(os.path.join(self.folder, name), dpi=DPI)
        self.written.append(name)
        self.rows, self.labels = [], []


def report(options):
    """The whole report as a dict; pictures are written on the way."""
    character, _ = safetensors_io.read(os.path.join(options.data, "character.safetensors"))
    manifest = read_manifest(os.path.join(options.data, "manifest.jsonl"))
    floors = read_floor(options.floor)
    folder = os.path.join(options.data, "dynamic")
    order = {name: i for i, name in enumerate(
        clips.HELD_OUT + clips.training() + clips.RANDOM + clips.VARIATIONS)}
    paths = {clips.file_stem(name): i for name, i in order.items()}
    stems = sorted((name[:-len(".safetensors")] for name in os.listdir(folder)
                    if name.endswith(".safetensors")), key=lambda s: (paths.get(s, len(paths)), s))
    if not stems:
        raise ValueError(f"{folder}: no .safetensors file; make ground truth with simulate.run first")
    os.makedirs(options.out, exist_ok=True)
    sheets, rows = Sheets(options.out, character), []
    for number, stem in enumerate(stems, 1):
        row, data, frames = measure(os.path.join(folder, stem + ".safetensors"), character,
                                    manifest, floors)
        rows.append(row)
        if not options.no_pictures:
            sheets.add(row, data, frames)
        if sys.stderr.isatty():
            print(f"\r{number}/{len(stems)} {row['clip']:50.50}", end="", file=sys.stderr)
    sheets.flush()
    there = {row["clip"] for row in rows}
    return {"data": os.path.basename(os.path.abspath(options.data)),
            "cloth_vertices": len(character["cloth_template"]),
            "cloth_faces": len(character["cloth_faces"]), "clips": rows,
            "drapes": sum(entry.get("frames", 0) for entry in manifest.values()
                          if entry.get("kind") == "static" and "refused" not in entry),
            "refused": {name: entry["refused"] for name, entry in manifest.items()
                        if "refused" in entry and name not in there},
            "missing": [name for name in order if name not in there and name not in manifest],
            "left_out": [list(pair) for pair in clips.LEFT_OUT], "sheets": sheets.written}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", required=True, help="ground truth made by run.py")
    parser.add_argument("-o", "--out", required=True, help="folder of the report")
    parser.add_argument("--floor", help="JSON of floor.py; default: floor.json in --data if there")
    parser.add_argument("--no-pictures", action="store_true")
    options = parser.parse_args(arguments)
    beside = os.path.join(options.data, "floor.json")
    options.floor = options.floor or (beside if os.path.exists(beside) else None)
    try:
        found = report(options)
    except (OSError, ValueError, safetensors_io.SafetensorsError) as error:
        print(f"quality: {error}", file=sys.stderr)
        return 2
    quality_text.write(found, options.out)
    faults = [row for row in found["clips"] if row["fault"]]
    for row in faults:
        print(f"{row['clip']}: {row['fault']}")
    print(f"{len(found['clips'])} clips, {sum(r['frames'] for r in found['clips'])} frames, "
          f"{len(faults)} with a fault, {len(found['refused'])} refused: "
          f"{os.path.join(options.out, 'report.md')}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
