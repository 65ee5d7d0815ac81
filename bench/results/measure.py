"""The bundled garments through the command line: speed against error, then every kernel, warm, cold and contended."""
import json
import os
import shutil
import statistics
import struct
import subprocess
from pathlib import Path

# Garment -> what of the grid precision x rank x stages is tried: the rank that the basis needs and these.
GRIDS = {"skirt": ["--rank", 72, "--rank", 36], "robe": ["--rank", 72]}
QUICK_GRIDS = {"skirt": ["--precision", "int8", "--rank", 72]}
PRECISIONS = ("fp32", "fp16", "int8")
# Whole passes of the sequence.
FRAMES = {"warm": 600, "cold": 140, "contended": 140}
FLAGS = {"warm": [], "cold": ["--cold"], "contended": ["--cold", "--contend"]}
OPENINGS = 25


def layer_products(bundle):
    """Multiply-adds of the graph layers' matrices in one tick, W^p folded into the gates: n (3 w F + 4 F^2) a layer."""
    with open(bundle, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
    vertices, total, layer = header["template.positions"]["shape"][0], 0, 0
    while f"mesh.layers.{layer}.w_p" in header:
        inputs, width = header[f"mesh.layers.{layer}.w_p"]["shape"]
        total += vertices * (3 * inputs * width + 4 * width * width)
        layer += 1
    return total


def stripped_bytes(library, folder):
    """The shared library as it ships, without symbols."""
    path = Path(folder) / "libdcloth_stripped.so"
    shutil.copyfile(os.path.realpath(library), path)
    subprocess.run(["strip", "--strip-all", str(path)], check=True)
    return path.stat().st_size


def garment(name, grid, steps, root, dcloth, library, folder, frames):
    home = Path(root) / "models" / name
    bundle = home / f"{name}.safetensors"
    walk, stop = (home / "sequences" / f"{clip}.safetensors" for clip in ("walk_turn", "run_stop"))
    said = {"products": layer_products(bundle), "profiles": {}, "motion": walk.stem, "calibration": stop.stem}
    said["evaluate"] = steps.json(f"{name}: speed against error", dcloth, "evaluate", bundle, walk, "--pareto",
                                  "--calibrate", stop, *grid, "--json")
    for precision in PRECISIONS:
        model = Path(folder) / f"{name}-{precision}.dcloth"
        steps.run(f"{name} {precision}: convert", dcloth, "convert", bundle, "-o", model, "--precision", precision)
        said["profiles"][precision] = {}
        contended = precision == "int8" and (os.cpu_count() or 1) > 1
        for heat in ("warm", "cold", "contended") if contended else ("warm", "cold"):
            project = ["--project"] if (precision, heat) == ("int8", "cold") else []
            said["profiles"][precision][heat] = steps.json(
                f"{name} {precision}: {heat}", dcloth, "profile", model, walk, "--fps", 30, "--frames", frames[heat],
                "--json", *FLAGS[heat], *project)
    said["open_ms"] = {heat: statistics.median(library.open_milliseconds(model, heat == "cold", OPENINGS))
                       for heat in ("warm", "cold")}
    return said


def run(steps, root, dcloth, shared, library, folder, quick=False):
    """All garments -> what the page writes."""
    frames = dict.fromkeys(FRAMES, 1) if quick else FRAMES
    return {"library_bytes": stripped_bytes(shared, folder),
            "garments": {name: garment(name, grid, steps, root, dcloth, library, folder, frames)
                         for name, grid in (QUICK_GRIDS if quick else GRIDS).items()}}
