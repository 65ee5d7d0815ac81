"""The skirt's rest shape: a pleated A-line of 71 rings x 112 columns, waist pinned to the hips.

Fourteen pleats of eight columns are modelled into the rest shape and grow towards the hem. A
plain cone may fold at any angle, so two nearly equal simulations drift apart; pleats pin the
folds and keep the ground truth repeatable (see README.md, predictability floor).
The mesh is exactly mirror symmetric in the plane x = 0: vertices, triangles and pleats.
"""
from dataclasses import dataclass

import numpy as np

from ..motion.skeleton import HIP_HEIGHT, INDEX, LOWER_BODY

# Arms and head never hold up a skirt, and arms that brush it tangle it. A garment with sleeves says otherwise.
NOT_COLLIDING = tuple(name for name in INDEX if "Shoulder" in name or "Arm" in name or "Hand" in name
                      or name in ("Neck", "Head"))
RINGS = 71
PLEATS = 14
COLUMNS = PLEATS * 8
PINNED_RINGS = 6              # a waistband of 4 cm
YOKE = 0.25                   # m that never rise above the waistband: softer or shorter, a flip stays
LENGTH = 0.58                 # metres down the side, waist to hem: ends at the knee
WAIST_ABOVE_HIPS = 0.115      # metres
WAIST_HALF_WIDTH = 0.158      # x, metres: the waist plus collision shell
WAIST_HALF_DEPTH = 0.126      # z
HIP_HALF_WIDTH = 0.215        # reached HIP_AT of the way down
HIP_HALF_DEPTH = 0.190
HIP_AT = 0.24
HEM_RADIUS = 0.385            # round at the hem
PLEAT_DEPTH = 0.16            # of the radius at the hem; grows with the square of the way down


@dataclass
class Garment:
    """vertices [n, 3] m, faces [c, 3] outward, mirror [n] permutation, pinned [n] bool.

    pin_joints [n]: the joint each pinned vertex follows, -1 where free; the hips unless given.
    not_colliding: joints whose part of the body this garment is not collided with
    (cloth_job.collided says which vertices are left). yoke: see cloth_solver.h. touches [n]: bit masks of the parts of the body
    (cloth_job.PARTS) a vertex is collided with, None: all of them. slack: factor on the setting `tether`, above 1
    where cloth spans pins that move apart: a taut tether on either side leaves all the stretch to the edges between.
    felt: joints whose rotations move the garment: the network's features, and what static poses are told apart by.
    """
    vertices: np.ndarray
    faces: np.ndarray
    mirror: np.ndarray
    pinned: np.ndarray
    pin_joints: np.ndarray = None
    not_colliding: tuple = NOT_COLLIDING
    yoke: float = 0.0
    touches: np.ndarray = None
    slack: float = 1.0
    felt: tuple = LOWER_BODY

    def __post_init__(self):
        if self.pin_joints is None:
            self.pin_joints = np.where(self.pinned, INDEX["Hips"], -1)


def _half_axes(way):
    """Half width and depth of the unpleated profile at `way` in 0..1 from waist to hem."""
    over_hips = np.clip(way / HIP_AT, 0.0, 1.0)
    over_hips = np.sin(over_hips * np.pi / 2)          # leaves the waist steeply, as hips do
    below = np.clip((way - HIP_AT) / (1 - HIP_AT), 0.0, 1.0)
    width = WAIST_HALF_WIDTH + (HIP_HALF_WIDTH - WAIST_HALF_WIDTH) * over_hips
    depth = WAIST_HALF_DEPTH + (HIP_HALF_DEPTH - WAIST_HALF_DEPTH) * over_hips
    return (width + (HEM_RADIUS - HIP_HALF_WIDTH) * below,
            depth + (HEM_RADIUS - HIP_HALF_DEPTH) * below)


def skirt(radius_scale=1.0):
    """Build the skirt in bind pose. `radius_scale` perturbs it for the predictability floor."""
    way = np.linspace(0.0, 1.0, RINGS)[:, None]
    half = COLUMNS // 2
    angle = 2 * np.pi * np.arange(half + 1)[None, :] / COLUMNS  # 0 = front, growing to the left
    width, depth = _half_axes(way)
    pleat = 1 + PLEAT_DEPTH * way ** 2 * np.cos(PLEATS * angle)
    x = radius_scale * width * pleat * np.sin(angle)
    z = radius_scale * depth * pleat * np.cos(angle)
    x[:, 0] = x[:, half] = 0.0
    y = np.broadcast_to(HIP_HEIGHT + WAIST_ABOVE_HIPS - LENGTH * way, x.shape)
    left = np.stack([x, y, z], -1)
    grid = np.zeros((RINGS, COLUMNS, 3))
    grid[:, :half + 1] = left
    grid[:, half + 1:] = left[:, half - 1:0:-1] * np.array([-1.0, 1.0, 1.0])

    index = np.arange(RINGS * COLUMNS, dtype=np.int32).reshape(RINGS, COLUMNS)
    mirror = index[:, (-np.arange(COLUMNS)) % COLUMNS].reshape(-1)
    faces = []
    for ring in range(RINGS - 1):
        for column in range(half):  # left half; the right half is its reflection
            a, b = index[ring, column], index[ring, column + 1]
            d, c = index[ring + 1, column], index[ring + 1, column + 1]
            pair = [(a, d, c), (a, c, b)] if (ring + column) % 2 else [(a, d, b), (b, d, c)]
            faces += pair
            faces += [(mirror[p], mirror[r], mirror[q]) for p, q, r in pair]
    pinned = np.zeros((RINGS, COLUMNS), dtype=bool)
    pinned[:PINNED_RINGS] = True
    return Garment(grid.reshape(-1, 3), np.array(faces, dtype=np.int32), mirror, pinned.reshape(-1), yoke=YOKE)
