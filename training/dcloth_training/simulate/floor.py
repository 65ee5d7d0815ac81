"""Predictability floor: what two nearly equal simulations disagree on, no network can learn.

    python3 -m dcloth_training.simulate.floor CLIP... --motion CLIPS [--frames 75] [--out FILE]

Each clip is simulated twice, the second time with the garment's radius scaled by 0.05 %; printed
is the mean vertex distance over the clip and at its end. It bounds any held-out error from below.
"""
import argparse
import concurrent.futures
import json
import os

import numpy as np

from .. import sequence
from . import clips, cloth_job, garment, mannequin, run, settings

RADIUS_SCALE = 1.0005


def floor(name, options, body, chosen):
    """-> {"clip", "frames", "mean_mm", "end_mm", "per_frame_mm"}."""
    motion = run.prepare(name, options)[:options.frames]
    joined, frames = run.with_lead(motion)

    def cloth(scale):
        finished = os.path.join(options.data or "", "dynamic",
                                clips.file_stem(name) + ".safetensors")
        if scale == 1.0 and options.data and os.path.exists(finished):
            return sequence.read(finished).truth[:len(frames)]  # the solver repeats itself exactly
        return cloth_job.simulate(joined, body, garment.skirt(scale), frames, chosen).cloth

    with concurrent.futures.ThreadPoolExecutor(min(options.workers, 2)) as pool:
        pair = list(pool.map(cloth, (1.0, RADIUS_SCALE)))
    distance = 1e3 * np.linalg.norm(pair[0] - pair[1], axis=-1).mean(1)
    return {"clip": name, "frames": len(frames), "root": options.root,
            "mean_mm": round(float(distance.mean()), 2), "end_mm": round(float(distance[-1]), 2),
            "per_frame_mm": [round(float(d), 2) for d in distance]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="+")
    parser.add_argument("--motion")
    parser.add_argument("--frames", type=int, default=75)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--root", choices=("free", "fixed"), default="free")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE",
                        help="change one solver setting, e.g. --set quality=20")
    parser.add_argument("--data", help="ground truth made with the same settings: saves the "
                        "first of the two simulations where the clip is there")
    parser.add_argument("--out", help="write the numbers as JSON")
    options = parser.parse_args()
    chosen = settings.with_changes(**{name: json.loads(value) for name, value in
                                      (pair.split("=", 1) for pair in options.set)})
    body, rows = mannequin.mannequin(), []
    for name in options.clips:
        rows.append(floor(name, options, body, chosen))
        print(f"{name}: {rows[-1]['mean_mm']} mm over {rows[-1]['frames']} frames, "
              f"{rows[-1]['end_mm']} mm at the end", flush=True)
    if options.out:
        with open(options.out, "w") as file:
            json.dump({"radius_scale": RADIUS_SCALE, "settings": chosen, "clips": rows}, file,
                      indent=1)


if __name__ == "__main__":
    main()
