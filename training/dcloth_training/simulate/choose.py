"""Which clips to simulate next: those whose motion adds most to what is there, farthest first.

    python3 -m dcloth_training.simulate.choose --motion CLIPS 'cmu_db/*' 'snu/*' --frames 50000
        [--garment skirt|robe] [--there mocap/walk,mocap/run] [--index CLIPS/index.tsv]

Prints a line a piece of a take: its name for run.py's --clips, its frames, and what it adds: the mean over its frames
of the distance to the nearest history of a piece that is there, or chosen before it, or its mirror image. A history is
a third of a second of the hips' and legs' rotations (all that the garment feels) and of the hips' way, heading taken
out. With --index (a table with columns file and kind) each kind gets as many frames as there are, in turn.
"""
import argparse
import csv
import fnmatch
import glob
import os
import sys

import numpy as np

from .. import command
from ..motion import bvh, rotations, skeleton
from . import clips, garment

STEPS, STRIDE = 3, 5        # a history: this frame, 5 and 10 frames before it
LOOKED_AT_EVERY = 5         # frames: neighbours are alike
RADIANS_A_METRE = 2.0       # of the hips' way
MOST = 1.0                  # rad: what is farther adds no more, or the oddest takes would come first
LYING, LOW = 0.5, 0.5       # cosine of the hips' tilt; share of their height when standing


def histories(motion, felt):
    """[t, d] of every LOOKED_AT_EVERY-th frame: root mean squares of differences are radians a joint."""
    heading = rotations.about_axis("Y", -rotations.heading_of(motion.local[:, 0]))
    local = motion.local[:, [skeleton.INDEX[joint] for joint in felt]].copy()
    local[:, 0] = heading @ motion.local[:, 0]
    now = np.arange(0, len(motion), LOOKED_AT_EVERY)
    before = [np.maximum(now - STRIDE * step, 0) for step in range(STEPS)]
    turns = np.concatenate([local[at].reshape(len(now), -1) for at in before], 1) / np.sqrt(2 * STEPS * len(felt))
    ways = [np.einsum("tij,tj->ti", heading[now], motion.root[at] - motion.root[now]) for at in before[1:]]
    return np.concatenate([turns, RADIANS_A_METRE / np.sqrt(len(ways)) * np.concatenate(ways, 1)], 1).astype(np.float32)


def mirrored(motion):
    """The motion reflected in the plane x = 0."""
    reflection = np.diag([-1.0, 1.0, 1.0])
    return skeleton.Motion(motion.root * [-1, 1, 1], reflection @ motion.local[:, skeleton.MIRROR] @ reflection)


def upright(motion):
    """Whether the hips stay upright and off the ground: there is no floor in the scene, and cloth has to hang."""
    return motion.local[:, 0, 1, 1].min() > LYING and motion.root[:, 1].min() > LOW * skeleton.HIP_HEIGHT


def distances(asked, known):
    """[t] from each of `asked` [t, d] to the nearest of `known` [k, d]."""
    squares = (asked * asked).sum(1)[:, None] + (known * known).sum(1) - 2 * asked @ known.T
    return np.sqrt(np.maximum(squares.min(1), 0))


def farthest_first(pieces, known=None, kinds=None, frames=np.inf):
    """Yields (name, adds) of pieces {name: (histories, those of the mirror image, frames)} until `frames` are chosen.

    known [k, d]: histories that are there; None: the piece nearest to the mean of all comes first. kinds {name: kind}:
    the kind with the fewest frames so far is next, while it has pieces."""
    kinds = kinds or {}
    if known is None:
        known = np.concatenate([own for own, _, _ in pieces.values()]).mean(0, keepdims=True)
        away = {name: distances(own, known) for name, (own, _, _) in pieces.items()}
        adds, first = dict.fromkeys(pieces, MOST), min(pieces, key=lambda name: away[name].mean())
        away = {name: np.full(len(own), MOST) for name, (own, _, _) in pieces.items()}
    else:
        away = {name: np.minimum(distances(own, known), MOST) for name, (own, _, _) in pieces.items()}
        adds, first = {name: float(own.mean()) for name, own in away.items()}, None
    taken, left = dict.fromkeys((kinds.get(name) for name in pieces), 0), set(pieces)
    chosen, looked_at = [], dict.fromkeys(pieces, 0)      # histories; how many of them a piece was compared with
    while left and sum(taken.values()) < frames:
        fewest = min((kinds.get(name) for name in left), key=lambda kind: (taken[kind], str(kind)))
        while True:     # what a piece adds only shrinks: one that leads with today's number is the farthest
            name = first or max((n for n in left if kinds.get(n) == fewest), key=lambda n: (adds[n], n))
            if first or looked_at[name] == len(chosen):
                break
            away[name] = np.minimum(away[name], distances(pieces[name][0], np.concatenate(chosen[looked_at[name]:])))
            adds[name], looked_at[name] = float(away[name].mean()), len(chosen)
        first = None
        yield name, adds[name]
        left.remove(name)
        chosen.append(np.concatenate(pieces[name][:2]))
        taken[kinds.get(name)] += pieces[name][2]


def kinds_of(path):
    """{group/stem: kind} of an index: tab-separated, with a head that names the columns file and kind."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file, delimiter="\t")
        if not {"file", "kind"} <= set(rows.fieldnames or ()):
            raise ValueError(f"{path}: found columns {', '.join(rows.fieldnames or ())}; file and kind are needed")
        return {row["file"].rpartition(".")[0]: row["kind"] for row in rows}


def takes(folder, patterns):
    """{group/stem: (first, last frame)} of the BVH files below `folder` that match one of `patterns`, by name."""
    files = sorted(glob.glob(os.path.join(folder, "*", "*.bvh")))
    names = ["/".join(path[:-len(".bvh")].split(os.sep)[-2:]) for path in files]
    names = [name for name in names if any(fnmatch.fnmatch(name, pattern) for pattern in patterns)]
    if not names:
        raise ValueError(f"{folder}: no */*.bvh matches {' or '.join(patterns)}")
    used = [name for name in names if clips.why_left_out(name) is None]
    return {name: clips.TAKES.get(name) or (0, len(bvh.read_motion(os.path.join(folder, name + ".bvh"))))
            for name in used}


def choose(options):
    felt = garment.FELT[options.garment]
    kinds = kinds_of(options.index) if options.index else {}
    known = None
    if options.there:
        there = [clips.take(name, options.motion) for name in options.there.split(",")]
        known = np.concatenate([histories(m, felt) for motion in there for m in (motion, mirrored(motion))])
    pieces, lying = {}, 0
    for name in clips.pieces(takes(options.motion, options.patterns)):
        motion = clips.take(name, options.motion)
        if not upright(motion):
            lying += 1
            continue
        pieces[name] = histories(motion, felt), histories(mirrored(motion), felt), len(motion)
    print(f"{len(pieces)} pieces, {sum(count for _, _, count in pieces.values())} frames; {lying} more lie, crawl or "
          "bend over", file=sys.stderr)
    by_piece = {name: kinds.get(name.partition("@")[0], "") for name in pieces}
    for name, adds in farthest_first(pieces, known, by_piece, options.frames):
        print(f"{name}\t{pieces[name][2]}\t{adds:.3f}" + (f"\t{by_piece[name]}" if kinds else ""), flush=True)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("patterns", nargs="+", help="of takes, such as 'snu/*'")
    parser.add_argument("--motion", required=True, help="folder of BVH folders")
    parser.add_argument("--frames", type=int, default=150000, help="to choose, mirror images not counted")
    parser.add_argument("--garment", choices=garment.GARMENTS, default="skirt")
    parser.add_argument("--there", help="clips that are there already, such as those simulated before")
    parser.add_argument("--index", help="table of takes with columns file and kind")
    options = parser.parse_args(argv)
    return command.ended("choose", lambda: choose(options))


if __name__ == "__main__":
    sys.exit(main())
