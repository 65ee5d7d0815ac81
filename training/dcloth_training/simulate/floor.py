"""Predictability floor: what two nearly equal simulations disagree on, no network can learn.

    python3 -m dcloth_training.simulate.floor --data DATA --motion CLIPS [CLIP...] [--out FILE]

Each clip is simulated again twice: with the garment cut 0.05 % larger, and entered half a
second later from its pose there, held (another history of the same motion). Printed is the mean
vertex distance to the ground truth in DATA over the frames that count (metrics.WARM_UP): no network
can be expected to do better. Beside it stands motion, the mean distance of the cloth from its mean
shape in the hips' frame, and the floor's share of it.
"""
import argparse
import concurrent.futures
import functools
import json
import os
import sys

import numpy as np

from .. import command, dataset, metrics, sequence
from ..motion import skeleton
from . import clips, cloth_job, garment, run

SCALE = 1.0005
ENTER_FRAME = 15        # the second history begins here,
FORGET_FRAMES = 30      # and has this long to forget it


def _apart(first, second):
    return 1e3 * np.linalg.norm(first - second, axis=-1).mean(1)


def shares(mean_mm, entered_mm, alive_mm):
    """{"relative", "relative_entered"}: the floors over motion; None where there is no motion or no floor."""
    known = alive_mm > 0
    return {"relative": round(mean_mm / alive_mm, 4) if known else None,
            "relative_entered": round(entered_mm / alive_mm, 4) if known and entered_mm is not None else None}


def floor(name, options, body, worn):
    """One clip -> {"clip", "frames", "mean_mm", "end_mm", "entered_mm", "alive_mm", "relative", "relative_entered",
    "per_frame_mm"}; relative: over motion.

    What was entered late is None for clips that end before the second history is forgotten.
    """
    motion = run.prepare(name, options)
    path = os.path.join(options.data, "dynamic", clips.file_stem(name) + ".safetensors")
    data = sequence.read(path)
    joined, frames = run.with_lead(motion)
    wind = run.with_lead_wind(name, motion)
    perturbed = cloth_job.simulate(joined, body, garment.perturbed(worn, SCALE), frames, wind=wind)
    distance = _apart(data.truth, perturbed.cloth)
    entered, first = None, ENTER_FRAME + FORGET_FRAMES
    if len(motion) > first + skeleton.FPS / 2:
        late, frames = run.with_lead(motion[ENTER_FRAME:])
        wind = None if wind is None else np.concatenate([wind[:len(late) - len(motion) + ENTER_FRAME],
                                                         wind[len(wind) - len(motion) + ENTER_FRAME:]])
        cloth = cloth_job.simulate(late, body, worn, frames[FORGET_FRAMES:], wind=wind).cloth
        entered = round(float(_apart(data.truth[first:], cloth).mean()), 2)
    counted = metrics.counted(len(distance))
    mean = float(distance[counted:].mean())
    alive = metrics.alive_mm(data.truth[counted:], data.joint_matrices[counted:, 0])
    return {"clip": name, "frames": len(data.truth), "root": options.root,
            "mean_mm": round(mean, 2), "end_mm": round(float(distance[-1]), 2),
            "entered_mm": entered, "alive_mm": round(alive, 1), **shares(mean, entered, alive),
            "per_frame_mm": [round(float(d), 2) for d in distance]}


def percent(share):
    return "-" if share is None else f"{100 * share:.1f} %"


def overall(source, rows):
    """One line about several clips: quotients are of sums."""
    late = [row for row in rows if row["entered_mm"] is not None]
    mean, alive = (float(np.mean([row[key] for row in rows])) for key in ("mean_mm", "alive_mm"))
    text = f"{len(rows)} {source} clips: floor {mean:.2f} mm, motion {alive:.1f} mm"
    text += f", floor / motion {percent(mean / alive)}" if alive else ""
    if late:
        entered, moving = (float(np.mean([row[key] for row in late])) for key in ("entered_mm", "alive_mm"))
        text += f"; entered late {entered:.2f} mm" + (f", {percent(entered / moving)}" if moving else "")
    return text


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="*", help="default: the clips of development and validation")
    parser.add_argument("--data", required=True, help="ground truth made by run.py")
    parser.add_argument("--motion")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--garment", choices=garment.GARMENTS, default="skirt")
    parser.add_argument("--root", choices=("free", "fixed"), default="free")
    parser.add_argument("--out", help="write the numbers as JSON")
    return parser.parse_args(argv)


def measure(options):
    rows = []
    names = options.clips or clips.DEVELOPMENT + clips.VALIDATION
    for name in names:
        run.prepare(name, options)      # one that cannot be read is refused before the first is simulated
    body, worn = run.put_on(options.data, options.garment)
    with concurrent.futures.ProcessPoolExecutor(options.workers) as pool:
        for row in pool.map(functools.partial(floor, options=options, body=body, worn=worn), names):
            rows.append(row)
            print(f"{row['clip']}: {row['mean_mm']} mm over {row['frames']} frames, "
                  f"{row['end_mm']} at the end, entered late {row['entered_mm']}, "
                  f"motion {row['alive_mm']} mm, floor / motion {percent(row['relative'])}", flush=True)
            if options.out:
                with open(options.out, "w") as file:
                    json.dump({"scale": SCALE,
                               "clips": rows}, file, indent=1)
    for source in ("recorded", "scripted"):     # never averaged together
        own = [row for row in rows if dataset.source(row["clip"]) == source]
        if own:
            print(overall(source, own))


def main(argv=None):
    options = arguments(argv)
    return command.ended("floor", lambda: measure(options))


if __name__ == "__main__":
    sys.exit(main())
