"""Predictability floor: what two nearly equal simulations disagree on, no network can learn.

    python3 -m dcloth_training.simulate.floor --data DATA --motion CLIPS [CLIP...] [--out FILE]

Each clip is simulated again twice: with the garment's radius scaled by 0.05 %, and entered half a
second later from its pose there, held (another history of the same motion). Printed is the mean
vertex distance to the ground truth in DATA; it bounds any held-out error from below. Beside it
stands how alive the cloth is: its mean distance from its mean shape in the hips' frame.
"""
import argparse
import concurrent.futures
import json
import os
import sys

import numpy as np

from .. import command, sequence
from ..motion import skeleton
from . import clips, cloth_job, mannequin, run, settings

RADIUS_SCALE = 1.0005
ENTER_FRAME = 15        # the second history begins here,
FORGET_FRAMES = 30      # and has this long to forget it


def alive(matrices, cloth):
    """Mean distance in mm of cloth [T, n, 3] from its mean shape in the hips' frame."""
    hips = matrices[:, 0]
    local = np.einsum("tji,tnj->tni", hips[:, :3, :3], cloth - hips[:, None, :3, 3])
    return 1e3 * float(np.linalg.norm(local - local.mean(0), axis=-1).mean())


def _apart(first, second):
    return 1e3 * np.linalg.norm(first - second, axis=-1).mean(1)


def floor(name, options, chosen):
    """One clip -> {"clip", "frames", "mean_mm", "end_mm", "entered_mm", "alive_mm", "per_frame_mm"}.

    `entered_mm` is None for clips that end before the second history is forgotten.
    """
    motion, make = run.prepare(name, options), run.GARMENTS[options.garment]
    body = mannequin.mannequin(make().not_colliding)
    path = os.path.join(options.data, "dynamic", clips.file_stem(name) + ".safetensors")
    data = sequence.read(path)
    joined, frames = run.with_lead(motion)
    perturbed = cloth_job.simulate(joined, body, make(RADIUS_SCALE), frames, chosen)
    distance = _apart(data.truth, perturbed.cloth)
    entered, first = None, ENTER_FRAME + FORGET_FRAMES
    if len(motion) > first + skeleton.FPS / 2:
        late, frames = run.with_lead(motion[ENTER_FRAME:])
        cloth = cloth_job.simulate(late, body, make(), frames[FORGET_FRAMES:], chosen).cloth
        entered = round(float(_apart(data.truth[first:], cloth).mean()), 2)
    return {"clip": name, "frames": len(data.truth), "root": options.root,
            "mean_mm": round(float(distance.mean()), 2), "end_mm": round(float(distance[-1]), 2),
            "entered_mm": entered, "alive_mm": round(alive(data.joint_matrices, data.truth), 1),
            "per_frame_mm": [round(float(d), 2) for d in distance]}


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="*", help="default: every held-out and training clip")
    parser.add_argument("--data", required=True, help="ground truth made by run.py")
    parser.add_argument("--motion")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--garment", choices=run.GARMENTS, default="skirt")
    parser.add_argument("--root", choices=("free", "fixed"), default="free")
    parser.add_argument("--out", help="write the numbers as JSON")
    return parser.parse_args(argv)


def measure(options):
    rows = []
    names = options.clips or clips.HELD_OUT + clips.training()
    for name in names:
        run.prepare(name, options)      # one that cannot be read is refused before the first is simulated
    with concurrent.futures.ThreadPoolExecutor(options.workers) as pool:
        for row in pool.map(lambda name: floor(name, options, settings.GROUND_TRUTH), names):
            rows.append(row)
            print(f"{row['clip']}: {row['mean_mm']} mm over {row['frames']} frames, "
                  f"{row['end_mm']} at the end, entered late {row['entered_mm']}, "
                  f"alive {row['alive_mm']} mm", flush=True)
            if options.out:
                with open(options.out, "w") as file:
                    json.dump({"radius_scale": RADIUS_SCALE, "settings": settings.GROUND_TRUTH,
                               "clips": rows}, file, indent=1)
    mean = {key: np.mean([r[key] for r in rows if r[key] is not None])
            for key in ("mean_mm", "entered_mm", "alive_mm")}
    print(f"mean of {len(rows)} clips: floor {mean['mean_mm']:.2f} mm, entered late "
          f"{mean['entered_mm']:.2f} mm, alive {mean['alive_mm']:.1f} mm")


def main(argv=None):
    options = arguments(argv)
    return command.ended("floor", lambda: measure(options))


if __name__ == "__main__":
    sys.exit(main())
