"""Arms as closed surfaces of their own, for cloth that touches an arm and not the trunk.

Skin is one sheet: cut out of it, an arm is a tube that is open at the shoulder, and the underside of a sleeve slides
off that end into the chest; and a sharp elbow squeezes the sleeve between upper arm and forearm until it jumps
through one of them. Here upper arm and forearm (with the hand) are two closed surfaces that meet in a sphere about
the elbow, so that each half of a sleeve touches its own half of the arm.
"""
import numpy as np

from ..motion.skeleton import HIP_HEIGHT, INDEX, bind_matrices
from . import mannequin

AROUND = 20                    # vertices a ring
SPACING = 0.017                # m between rings
CAP_RINGS = 5                  # of a half sphere, without its pole
HAND_WEIGHTS = (0.69, 0.75)    # |x| between which the hand's weight rises from 0 to 1
# (joints whose limbs make the surface, where it begins, where it ends: joint, or None for the limb's own end)
HALVES = ((("LeftArm",), "LeftArm", "LeftForeArm"), (("LeftForeArm", "LeftHand"), "LeftForeArm", None))


def _profile(limbs, first, last):
    """Rings between two x, half spheres about both ends: x, radius and the axis' y and z, each [r]."""
    limbs = [limb[1:] for limb in mannequin.LIMBS if limb[0] in limbs]
    knots = np.array([(p[0], r) + tuple(p[1:]) for a, b, ra, rb in limbs for p, r in ((a, ra), (b, rb))])
    knots = knots[np.argsort(knots[:, 0], kind="stable")]
    last = knots[-1, 0] if last is None else last
    x = np.linspace(first, last, 1 + round((last - first) / SPACING))
    radius, y, z = (np.interp(x, knots[:, 0], knots[:, k]) for k in (1, 2, 3))
    turn = np.linspace(0.15, np.pi / 2, CAP_RINGS + 1)[:-1]  # from near the pole; the pole itself is a fan's centre
    start, end = radius[0], radius[-1]
    x = np.concatenate([first - start * np.cos(turn), x, last + end * np.cos(turn[::-1])])
    ends = [np.full(CAP_RINGS, a[i]) for a in (y, z) for i in (0, -1)]
    return (x, np.concatenate([start * np.sin(turn), radius, end * np.sin(turn[::-1])]),
            np.concatenate([ends[0], y, ends[1]]), np.concatenate([ends[2], z, ends[3]]))


def _surface(x, radius, y, z):
    """The closed surface round those rings: vertices [b, 3], faces [f, 3] outward."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.stack([np.repeat(x[:, None], AROUND, 1), y[:, None] + radius[:, None] * np.cos(angle),
                      z[:, None] + radius[:, None] * np.sin(angle)], -1)
    poles = np.array([rings[0].mean(0), rings[-1].mean(0)])
    poles[:, 0] += [-radius[CAP_RINGS] * (1 - np.cos(0.15)), radius[-CAP_RINGS - 1] * (1 - np.cos(0.15))]
    vertices = np.concatenate([rings.reshape(-1, 3), poles])
    index = np.arange(rings.shape[0] * AROUND).reshape(-1, AROUND)
    a, b = index, np.roll(index, -1, 1)
    faces = np.concatenate([
        np.stack([a[:-1], b[:-1], b[1:]], -1).reshape(-1, 3), np.stack([a[:-1], b[1:], a[1:]], -1).reshape(-1, 3),
        np.stack([np.full(AROUND, len(vertices) - 2), b[0], a[0]], -1),
        np.stack([np.full(AROUND, len(vertices) - 1), a[-1], b[-1]], -1)])
    return vertices, faces


def closed_arms():
    """[(joint, vertices [b, 3], faces [f, 3] outward, weights [b, J])] in bind pose: upper arm and forearm, left, right.

    Each turns rigidly with the joint it is named after, the hand with its own.
    """
    out, bind = [], bind_matrices()[:, :3, 3]
    for limbs, start, stop in HALVES:
        vertices, faces = _surface(*_profile(limbs, bind[INDEX[start], 0], stop and bind[INDEX[stop], 0]))
        hand = np.clip((vertices[:, 0] - HAND_WEIGHTS[0]) / (HAND_WEIGHTS[1] - HAND_WEIGHTS[0]), 0, 1)
        vertices = vertices + [0, HIP_HEIGHT, 0]
        for side, sign in (("Left", 1), ("Right", -1)):
            joint = start.replace("Left", side)
            weights = np.zeros((len(vertices), len(bind)))
            weights[:, INDEX[joint]] = 1 - hand
            weights[:, INDEX[side + "Hand"]] += hand
            out.append((joint, vertices * [sign, 1, 1], (faces if sign > 0 else faces[:, [0, 2, 1]]).astype(np.int32),
                        weights))
    return out
