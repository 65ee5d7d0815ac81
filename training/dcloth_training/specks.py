"""Frames in which skin, or lining, shows through a drawn garment.

    python3 -m dcloth_training.specks SEQUENCE=RUN ... --bundle BUNDLE [--every 3] [--lining] [--json]

RUN: what `dcloth run MODEL SEQUENCE -o RUN.safetensors --outside-body` wrote. BUNDLE: the garment's triangles, the body
and what of it each vertex touches.

Cloth that crosses the body in the crook of an arm or under a hem is a fault that nobody sees. So two things are
counted: frames in which triangles cross, and those in which the line where they cross is seen from one of eight sides,
a pixel of such skin beside a pixel of the cloth that it crosses. 50 ms a frame, 0.5 s where triangles cross. With
--lining also those in which cloth crosses cloth, and the inner side of one is seen beside the outer side of the other:
layers at one height show in shards. Another 0.5 s a frame.
"""
import argparse
import json
import sys

import numpy as np

from . import command, evaluate, raster, safetensors_io, sequence
from .motion import skeleton
from .simulate import crossings

SIDES = 8           # around the character, level with it
PIXEL = 0.0025      # metres
WORST = 5           # frames named for each clip
COUNTED = ("frames", "crossing", "seen", "lining")


def seen(cloth, cloth_faces, body, body_faces, pairs):
    """Pixels, from the side with most of them, where skin and the cloth that crosses it meet in plain sight.

    cloth [n, 3] and body [b, 3] in metres; pairs [k, 2]: cloth triangle, body triangle that intersect.
    """
    count = len(body_faces)
    return _most_met(cloth, cloth_faces, body, body_faces, np.stack([pairs[:, 1], pairs[:, 0] + count], -1),
                     lambda skin, weave, outside: (skin < count) & (weave >= count))


def lining_seen(cloth, cloth_faces, body, body_faces, pairs):
    """The same of the inner side of cloth and the outer side of the cloth that crosses it.

    pairs [k, 2]: cloth triangles that intersect, the lower index first.
    """
    return _most_met(cloth, cloth_faces, body, body_faces, pairs + len(body_faces),
                     lambda one, other, outside: outside[one] != outside[other])


def _most_met(cloth, cloth_faces, body, body_faces, pairs, counts):
    """Neighbouring pixels, from the side with most of them, of two faces that are one of `pairs`, the lower first.

    Faces are the body's, then the cloth's. counts(lower, higher, outside) -> bool [k], which of them are asked for;
    outside [faces]: whose outer side is seen.
    """
    vertices = np.concatenate([body, cloth])
    faces = np.concatenate([np.asarray(body_faces, np.int64), np.asarray(cloth_faces, np.int64) + len(body)])
    crossing = set((pairs[:, 0] * len(faces) + pairs[:, 1]).tolist())
    crossed = np.zeros(len(faces), bool)
    crossed[pairs] = True
    span = np.linalg.norm(cloth.max(0) - cloth.min(0)) + 2 * PIXEL
    size, most = int(np.ceil(span / PIXEL)), 0
    for side in range(SIDES):
        view = (vertices - (cloth.max(0) + cloth.min(0)) / 2) @ raster.about("Y", 2 * np.pi * side / SIDES).T
        points = np.stack([size / 2 + view[:, 0] / PIXEL, size / 2 - view[:, 1] / PIXEL, view[:, 2]], -1)
        face, row, column, _, _ = raster.covered(points, faces, size)
        image = np.full((size, size), -1)
        image[row, column] = np.where(crossed[face], face, -1)
        a, b, c = (points[faces[:, k], :2] for k in range(3))
        (bx, by), (cx, cy) = (b - a).T, (c - a).T
        outside = bx * cy - by * cx < 0     # rows count downwards
        found = 0
        for one, other in ((image[:, 1:], image[:, :-1]), (image[1:], image[:-1])):
            lower, higher = np.minimum(one, other), np.maximum(one, other)
            at = np.flatnonzero((lower >= 0) & (lower != higher))
            lower, higher = lower.ravel()[at], higher.ravel()[at]
            asked = counts(lower, higher, outside)
            keys = lower[asked].astype(np.int64) * len(faces) + higher[asked]
            found += sum(key in crossing for key in keys.tolist())
        most = max(most, found)
    return most


def frames_of(pair, referee, every, lining=False):
    """{"clip", "frames", "crossing", "seen", "worst": [[frame, pixels]]} of "SEQUENCE=RUN".

    lining: also "lining", the frames in which it shows, and "worst_lining".
    """
    source, _, result = pair.partition("=")
    item, found = sequence.read(source, truth=False), safetensors_io.read(result)[0]
    shape = (len(item.joint_matrices), referee.body.cloth_count, 3)
    if "positions" not in found or found["positions"].shape != shape:
        raise ValueError(f"{pair}: expected positions {list(shape)} of the same frames and of the bundle's garment; "
                         f"{result} has {list(found['positions'].shape) if 'positions' in found else 'none'}")
    numbers, crossing, linings = range(0, len(item.joint_matrices), every), [], []
    for frame in numbers:
        cloth = found["positions"][frame].astype(np.float64)
        body = skeleton.skin(*referee.bind, item.joint_matrices[frame:frame + 1].astype(np.float64))[0]
        pairs = referee.body.contact(cloth, body)[1]
        if len(pairs):
            crossing.append([frame, seen(cloth, referee.faces, body, referee.body_faces, pairs)])
        own = crossings.within(cloth, referee.faces) if lining else []
        if len(own):
            linings.append([frame, lining_seen(cloth, referee.faces, body, referee.body_faces, own)])
    worst, worst_lining = (sorted((row for row in rows if row[1]), key=lambda row: -row[1])
                           for rows in (crossing, linings))
    found = {"clip": item.clip, "frames": len(numbers), "crossing": len(crossing), "seen": len(worst),
             "worst": worst[:WORST]}
    return {**found, "lining": len(worst_lining), "worst_lining": worst_lining[:WORST]} if lining else found


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="+", metavar="SEQUENCE=RUN")
    parser.add_argument("--bundle", required=True, help="training bundle of the garment, with its body")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="look at every Nth frame")
    parser.add_argument("--lining", action="store_true", help="count frames in which lining shows, too")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser.parse_args(argv)


def told(name, row):
    return f"{name:<36} " + "  ".join(f"{key} {row[key]:5d}" for key in COUNTED if key in row)


def listed(worst):
    return ", ".join(f"{frame}: {pixels} px" for frame, pixels in worst)


def look(options):
    if options.every < 1:
        raise ValueError(f"--every {options.every}: expected 1 or more")
    referee = evaluate.Referee(options.bundle)
    rows = []
    for pair in options.clips:
        rows.append(frames_of(pair, referee, options.every, options.lining))
        if not options.json:
            row = rows[-1]
            print(told(row["clip"], row) + "  " + listed(row["worst"])
                  + ("; lining " + listed(row["worst_lining"]) if row.get("worst_lining") else ""), flush=True)
    total = {key: sum(row[key] for row in rows) for key in COUNTED if key in rows[0]}
    if options.json:
        print(json.dumps({"clips": rows, **total}))
    else:
        print(told("all", total))


def main(argv=None):
    options = arguments(argv)
    return command.ended("specks", lambda: look(options))


if __name__ == "__main__":
    sys.exit(main())
