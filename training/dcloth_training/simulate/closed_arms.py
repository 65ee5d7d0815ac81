"""Arms as closed surfaces of their own, for cloth that touches an arm and not the trunk.

Skin is one sheet: cut out of it, an arm is a tube that is open at the shoulder, and the underside of a sleeve slides
off that end into the chest. Here each arm begins with a half sphere about its shoulder joint, which turns with the upper
arm alone; from there on it has the skin's radius and, below the shoulder, the skin's own weights.
"""
import numpy as np
from scipy.spatial import cKDTree

from ..motion.skeleton import HIP_HEIGHT, INDEX, bind_matrices
from . import mannequin

AROUND = 20                    # vertices a ring
SPACING = 0.017                # m between rings
OWN_WEIGHTS = (0.25, 0.32)     # |x| between which the skin's weights take over from the upper arm's
NEIGHBOURS = 6                 # skin vertices a weight is averaged over


def _profile():
    """Rings from shoulder to fingertips: x, radius and the axis' y and z, each [r]; half spheres at both ends."""
    joint = bind_matrices()[INDEX["LeftArm"], :3, 3] - [0, HIP_HEIGHT, 0]
    limbs = [limb[1:] for limb in mannequin.LIMBS if limb[0] in ("LeftArm", "LeftForeArm", "LeftHand")]
    knots = np.array([(p[0], r) + tuple(p[1:]) for a, b, ra, rb in limbs for p, r in ((a, ra), (b, rb))])
    knots[0, 0] = joint[0]
    knots = knots[np.unique(knots[:, 0], return_index=True)[1]]
    x = np.linspace(knots[0, 0], knots[-1, 0], 1 + round((knots[-1, 0] - knots[0, 0]) / SPACING))
    radius, y, z = (np.interp(x, knots[:, 0], knots[:, k]) for k in (1, 2, 3))
    y[x < 0.25] = np.interp(x[x < 0.25], [joint[0], 0.25], [joint[1], np.interp(0.25, x, y)])
    turn = np.linspace(0.15, np.pi / 2, 6)[:-1]         # from near the pole; the pole itself is added as a fan's centre
    start, end = radius[0], radius[-1]
    x = np.concatenate([x[0] - start * np.cos(turn), x, x[-1] + end * np.cos(turn[::-1])])
    ends = [np.full(len(turn), a[i]) for a in (y, z) for i in (0, -1)]
    return (x, np.concatenate([start * np.sin(turn), radius, end * np.sin(turn[::-1])]),
            np.concatenate([ends[0], y, ends[1]]), np.concatenate([ends[2], z, ends[3]]))


def closed_arms(body):
    """(vertices [b, 3], faces [f, 3] outward, weights [b, J], sides [b]: +1 left, -1 right) in bind pose."""
    x, radius, y, z = _profile()
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.stack([np.repeat(x[:, None], AROUND, 1), y[:, None] + radius[:, None] * np.cos(angle),
                      z[:, None] + radius[:, None] * np.sin(angle)], -1)
    poles = np.array([rings[0].mean(0), rings[-1].mean(0)])
    left = np.concatenate([rings.reshape(-1, 3), poles]) + [0, HIP_HEIGHT, 0]
    index = np.arange(rings.shape[0] * AROUND).reshape(-1, AROUND)
    a, b = index, np.roll(index, -1, 1)
    faces = np.concatenate([
        np.stack([a[:-1], b[:-1], b[1:]], -1).reshape(-1, 3), np.stack([a[:-1], b[1:], a[1:]], -1).reshape(-1, 3),
        np.stack([np.full(AROUND, len(left) - 2), b[0], a[0]], -1),
        np.stack([np.full(AROUND, len(left) - 1), a[-1], b[-1]], -1)])
    on_left = np.flatnonzero(body.vertices[:, 0] > 0.15)
    distance, near = cKDTree(body.vertices[on_left]).query(left, NEIGHBOURS)
    share = 1 / (distance + 0.005)
    own = np.einsum("bk,bkj->bj", share / share.sum(1, keepdims=True), body.weights[on_left[near]])
    own[:, INDEX["Chest"]] = 0
    own /= own.sum(1, keepdims=True)
    take = np.clip((left[:, :1] - OWN_WEIGHTS[0]) / (OWN_WEIGHTS[1] - OWN_WEIGHTS[0]), 0, 1)
    weights = take * own + (1 - take) * np.eye(own.shape[1])[INDEX["LeftArm"]]
    other = weights.copy()
    for name in ("Arm", "ForeArm", "Hand"):
        pair = [INDEX["Left" + name], INDEX["Right" + name]]
        other[:, pair] = weights[:, pair[::-1]]
    return (np.concatenate([left, left * [-1, 1, 1]]),
            np.concatenate([faces, faces[:, [0, 2, 1]] + len(left)]).astype(np.int32),
            np.concatenate([weights, other]), np.repeat([1, -1], len(left)))
