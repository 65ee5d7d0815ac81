"""Arms kept out of the trunk and the thighs, legs out of each other, calves out of their thighs.

Recorded people have other hips than the figure, so an arm that hangs at their side may lie inside of hers; and takes
joined from several people put one person's arms beside another's waist. Here each arm is turned about its shoulder by
the smallest angle that clears it, smoothly over time, and both legs about their hips where they cross.
"""
import functools

import numpy as np
from scipy import ndimage

from .. import figure
from . import rotations
from .skeleton import INDEX, Motion, joint_matrices

GAP = 0.006                    # metres between skin and skin: room for a sleeve
SMOOTH_FRAMES = 2.5            # width of the average over time
ROUNDS, STEPS = 8, 2           # of smoothing, and of pushing out between them
ENOUGH = 0.003                 # metres deep into the gap: not worth another round
LARGEST = 1.0                  # rad: an arm is turned by no more
HEIGHT_STEP, ANGLES = 0.02, 36
# Joint whose part of the skin is kept clear of, and up to what height in T-pose.
_TRUNK = (("Hips", 1.06), ("Spine", 1.12), ("Spine1", 1.22), ("Spine2", 1.33))
# Where an arm is measured: joint, next joint, shares of the way between them (the hand ends near its fingertips).
_ARM = (("Arm", "ForeArm", (0.4, 0.55, 0.7, 0.86)), ("ForeArm", "Hand", (0.0, 0.25, 0.5, 0.75, 1.0)),
        ("Hand", None, (0.3, 0.65, 1.0)))
_HAND_LENGTH = 0.15
# The same of a leg, below where the thighs touch anyhow.
_LEG = (("UpLeg", "Leg", (0.33, 0.45, 0.6, 0.75, 0.9)), ("Leg", "Foot", (0.05, 0.2, 0.4, 0.6, 0.8, 1.0)))
LEG_GAP, LEG_LARGEST = 0.006, 0.35
# A knee bends no further than an adult's (Roaas and Andersson, 1982: 141 degrees on average). Drawn characters fold
# theirs up to 178, calf inside thigh; cloth behind such a knee is caught in the skin and torn.
KNEE = np.radians(140.0)


def _surface_points(skin):
    """Vertices, middles of edges and of triangles [m, 3], and the joint each belongs to most [m]."""
    corners, weights = skin.vertices[skin.faces], skin.weights[skin.faces]
    points = [skin.vertices, corners.mean(1)] + [0.5 * (corners[:, i] + corners[:, (i + 1) % 3]) for i in range(3)]
    owners = [skin.weights, weights.mean(1)] + [0.5 * (weights[:, i] + weights[:, (i + 1) % 3]) for i in range(3)]
    return np.concatenate(points), np.concatenate([np.argmax(w, 1) for w in owners])


class _Tube:
    """Part of the skin about a vertical axis through a joint in T-pose: its radius by height and angle."""

    def __init__(self, joint, points, low, high):
        self.joint, self.low = joint, low
        rows = int(np.ceil((high - low) / HEIGHT_STEP))
        d = points - figure.load().joints[joint]
        row = np.clip(((points[:, 1] - low) / HEIGHT_STEP).astype(int), 0, rows - 1)
        column = np.round(rotations.arctan2(d[:, 0], d[:, 2]) / (2 * np.pi) * ANGLES).astype(int) % ANGLES
        self.radius = np.zeros((rows, ANGLES))
        np.maximum.at(self.radius, (row, column), np.hypot(d[:, 0], d[:, 2]))
        self.low_offset = low - figure.load().joints[joint, 1]

    def depth(self, matrices, points):
        """How deep points [T, k, 3] lie inside [T, k] (negative outside, -1 beyond the tube's ends), and the way out
        [T, k, 3]."""
        turn = matrices[:, self.joint, :3, :3]
        d = (points - matrices[:, self.joint, None, :3, 3]) @ turn
        row = (d[..., 1] - self.low_offset) / HEIGHT_STEP - 0.5
        column = rotations.arctan2(d[..., 0], d[..., 2]) / (2 * np.pi) * ANGLES
        radius = ndimage.map_coordinates(np.pad(self.radius, ((0, 0), (0, 1)), mode="wrap"),
                                         [np.clip(row, 0, len(self.radius) - 1), column % ANGLES], order=1)
        across = np.hypot(d[..., 0], d[..., 2])
        out = np.stack([d[..., 0], 0 * across, d[..., 2]], -1) / np.maximum(across, 1e-6)[..., None]
        there = (row > -0.5) & (row < len(self.radius) - 0.5) & (radius > 0)
        return np.where(there, radius - across, -1.0), out @ np.swapaxes(turn, 1, 2)


@functools.lru_cache(maxsize=1)
def _body():
    """The tubes of trunk and thighs, and for each side the arm's measuring points: joint, offset and radius."""
    skin = figure.load()
    points, owner = _surface_points(skin)
    tubes, low = [], points[owner == INDEX["Hips"], 1].min()
    trunk = np.isin(owner, [INDEX[name] for name, _ in _TRUNK])
    for name, high in _TRUNK:
        here = trunk & (points[:, 1] >= low) & (points[:, 1] < high)
        tubes.append(_Tube(INDEX[name], points[here], low, high))
        low = high
    for name in ("LeftUpLeg", "RightUpLeg"):
        here = points[owner == INDEX[name]]
        tubes.append(_Tube(INDEX[name], here, here[:, 1].min(), here[:, 1].max()))
    arms = {}
    for side, sign in (("Left", 1), ("Right", -1)):
        samples = []
        for joint, end, shares in _ARM:
            first = skin.joints[INDEX[side + joint]]
            way = skin.joints[INDEX[side + end]] - first if end else np.array([sign * _HAND_LENGTH, 0, 0])
            for share in shares:
                at = first + share * way
                ring = np.abs(points[:, 0] - at[0]) < 0.012
                around = np.hypot(*(points[ring] - at)[:, 1:].T)
                samples.append((INDEX[side + joint], at - first, np.percentile(around, 60)))
        arms[side] = samples
    return tubes, arms


@functools.lru_cache(maxsize=1)
def _legs():
    """The left leg's measuring points (joint, offset, radius towards the other leg) and the right leg's tubes."""
    skin = figure.load()
    points, owner = _surface_points(skin)
    samples = []
    for joint, end, shares in _LEG:
        first, last = skin.joints[INDEX["Left" + joint]], skin.joints[INDEX["Left" + end]]
        for share in shares:
            at = first + share * (last - first)
            ring = (np.abs(points[:, 1] - at[1]) < 0.012) & (points[:, 0] > 0)
            samples.append((INDEX["Left" + joint], at - first, at[0] - points[ring, 0].min()))
    tubes = []
    for name in ("RightUpLeg", "RightLeg"):
        here = points[owner == INDEX[name]]
        tubes.append(_Tube(INDEX[name], here, here[:, 1].min(), here[:, 1].max()))
    return samples, tubes


def _deepest(points, radius, tubes, matrices, gap=GAP):
    """How far [T] the point that is deepest of all must go, which [T], and the way out [T, 3]."""
    worst, where, way = np.full(len(points), -1.0), np.zeros(len(points), int), np.zeros((len(points), 3))
    rows = np.arange(len(points))
    for tube in tubes:
        depth, out = tube.depth(matrices, points)
        depth = np.where(depth > -1, depth + radius + gap, -1.0)
        k = np.argmax(depth, 1)
        deeper = depth[rows, k] > worst
        worst[deeper], where[deeper], way[deeper] = depth[rows, k][deeper], k[deeper], out[rows, k][deeper]
    return worst, where, way


def _smoothed(turned, largest):
    turned = ndimage.gaussian_filter1d(turned, SMOOTH_FRAMES, axis=0, mode="nearest")
    length = np.linalg.norm(turned, axis=-1, keepdims=True)
    return turned * np.minimum(1, largest / np.maximum(length, 1e-9))


def clear(motion):
    """`motion` with arms outside of trunk and thighs, legs outside of each other, and knees that bend by KNEE at most
    -> Motion; the same where they were.

    Forearms and hands keep their bend, and so do knees below that. A quick crossing may leave a centimetre inside.
    Cost: 0.05 ms a frame, 0.5 ms a frame in which a limb is turned.
    """
    return _clear_arms(_clear_legs(_unfold_knees(motion)))


def _unfold_knees(motion):
    local = motion.local
    for side in ("Left", "Right"):
        joint, foot = INDEX[side + "Leg"], INDEX[side + "Foot"]
        shin = figure.load().joints[foot] - figure.load().joints[joint]
        shin = shin / np.linalg.norm(shin)
        bent = local[:, joint] @ shin
        angle = np.arccos(np.clip(bent @ shin, -1, 1))
        axis = np.cross(bent, shin)
        axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
        back = rotations.matrix_from_vector(np.maximum(angle - KNEE, 0)[:, None] * axis)
        if (angle > KNEE).any():
            local = local.copy()
            local[:, joint] = np.where((angle > KNEE)[:, None, None], back @ local[:, joint], local[:, joint])
    return Motion(motion.root, local)


def _clear_legs(motion):
    """Both thighs turned about their hips by half of what parts the legs."""
    samples, tubes = _legs()
    matrices = joint_matrices(motion)
    thighs = [INDEX["LeftUpLeg"], INDEX["RightUpLeg"]]
    hips = [matrices[:, thigh, :3, 3] for thigh in thighs]
    radius = np.array([r for *_, r in samples])
    points = np.stack([matrices[:, j, :3, 3] + matrices[:, j, :3, :3] @ offset for j, offset, _ in samples], 1)
    right = [INDEX["RightUpLeg"], INDEX["RightLeg"]]

    def deepest(frames, turned):
        left_turn, right_turn = (rotations.matrix_from_vector(t[frames]) for t in turned)
        now = hips[0][frames, None] + (points[frames] - hips[0][frames, None]) @ np.swapaxes(left_turn, 1, 2)
        other = matrices[frames]
        for joint in right:
            other[:, joint, :3, :3] = right_turn @ other[:, joint, :3, :3]
            from_hip = other[:, joint, :3, 3] - hips[1][frames]
            other[:, joint, :3, 3] = hips[1][frames] + (right_turn @ from_hip[..., None])[..., 0]
        return (now, *_deepest(now, radius, tubes, other, LEG_GAP))

    turned = np.zeros((2, len(motion), 3))
    _, depth, _, _ = deepest(np.arange(len(motion)), turned)
    near = np.flatnonzero(ndimage.maximum_filter1d(depth, 2 * int(4 * SMOOTH_FRAMES) + 1, mode="nearest") > ENOUGH)
    rows = np.arange(len(near))
    for step in range(ROUNDS * STEPS if len(near) else 0):
        now, depth, where, way = deepest(near, turned)
        if depth.max() < ENOUGH and step % STEPS == 0:
            break
        for side, sign in ((0, 1), (1, -1)):
            lever = np.cross(now[rows, where] - hips[side][near], sign * way)
            turned[side, near] += (0.5 * np.maximum(depth, 0) / np.maximum((lever ** 2).sum(1), 0.01))[:, None] * lever
        if step % STEPS == STEPS - 1:
            turned = np.stack([_smoothed(t, LEG_LARGEST) for t in turned])
    local = motion.local.copy()
    above = matrices[:, 0, :3, :3]
    for thigh, turn in zip(thighs, turned):
        if turn.any():
            local[:, thigh] = np.swapaxes(above, 1, 2) @ rotations.matrix_from_vector(turn) @ above @ local[:, thigh]
    return Motion(motion.root, local)


def _clear_arms(motion):
    tubes, arms = _body()
    matrices = joint_matrices(motion)
    local = motion.local.copy()
    for side, samples in arms.items():
        joint = INDEX[side + "Arm"]
        start = matrices[:, joint, :3, 3]
        points = np.stack([matrices[:, j, :3, 3] + matrices[:, j, :3, :3] @ offset for j, offset, _ in samples], 1)
        points -= start[:, None]
        radius = np.array([r for *_, r in samples])
        depth, _, _ = _deepest(points + start[:, None], radius, tubes, matrices)
        reach = int(4 * SMOOTH_FRAMES)
        near = np.flatnonzero(ndimage.maximum_filter1d(depth, 2 * reach + 1, mode="nearest") > ENOUGH)
        turned = np.zeros((len(motion), 3))
        rows = np.arange(len(near))
        for step in range(ROUNDS * STEPS if len(near) else 0):
            now = points[near] @ np.swapaxes(rotations.matrix_from_vector(turned[near]), 1, 2)
            depth, where, way = _deepest(now + start[near, None], radius, tubes, matrices[near])
            if depth.max() < ENOUGH and step % STEPS == 0:
                break
            lever = np.cross(now[rows, where], way)
            turned[near] += (np.maximum(depth, 0) / np.maximum((lever ** 2).sum(1), 0.01))[:, None] * lever
            if step % STEPS == STEPS - 1:
                turned = _smoothed(turned, LARGEST)
        above = matrices[:, INDEX[side + "Shoulder"], :3, :3]
        local[:, joint] = np.swapaxes(above, 1, 2) @ rotations.matrix_from_vector(turned) @ above @ local[:, joint]
    return Motion(motion.root, local)
