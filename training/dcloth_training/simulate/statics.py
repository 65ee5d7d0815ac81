"""Quasi-static drapes for the static stage: which poses, and how the garment gets there.

Half of the poses are picked from the training clips by farthest-point selection over the rotations that the garment
feels (garment.Garment.felt, heading taken out), so that few drapes cover many motions; the others as often as they
occur. They are visited along a short path, each approached slowly and held until the cloth rests.
"""
import numpy as np

from ..motion import rotations
from ..motion.skeleton import HIP_HEIGHT, INDEX, Motion

POSES_A_FILE = 20
MOVE_FRAMES = 8
HOLD_FRAMES = 20
SEED = 1


def without_root(motion):
    """Heading and translation removed: hips above the origin at bind height, facing +Z."""
    local = motion.local.copy()
    back = rotations.about_axis("Y", -rotations.heading_of(local[:, 0]))
    local[:, 0] = back @ local[:, 0]
    root = np.zeros((len(motion), 3))
    root[:, 1] = HIP_HEIGHT
    return Motion(root, local)


def _features(motion, felt):
    joints = [INDEX[joint] if isinstance(joint, str) else joint for joint in felt]
    return motion.local[:, joints].reshape(len(motion), -1)


def select(motions, count, felt):
    """`count` poses of all frames, half of them by farthest-point selection -> Motion of `count` frames.

    felt: joints whose rotations tell poses apart, names of the figure's or numbers."""
    pool = [without_root(m) for m in motions]
    pool = Motion(np.concatenate([m.root for m in pool]), np.concatenate([m.local for m in pool]))
    features = _features(pool, felt)
    chosen = [int(np.argmin(np.linalg.norm(features - features.mean(0), axis=1)))]
    nearest = np.linalg.norm(features - features[chosen[0]], axis=1)
    while len(chosen) < min(-(-count // 2), len(features)):
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(features - features[chosen[-1]], axis=1))
    left = np.setdiff1d(np.arange(len(features)), chosen)
    others = np.random.default_rng(SEED).permutation(left)[:count - len(chosen)]
    return pool[np.r_[chosen, others]]


def order(poses, felt):
    """Visit nearest neighbours in turn, so that each approach is short."""
    features = _features(poses, felt)
    left, path = set(range(1, len(poses))), [0]
    while left:
        here = features[path[-1]]
        path.append(min(left, key=lambda i: np.linalg.norm(features[i] - here)))
        left.remove(path[-1])
    return poses[path]


def tour(poses):
    """Motion that visits every pose, and the frame numbers at which each one rests."""
    roots, locals_, rests = [poses.root[:1]], [poses.local[:1]], []
    u = np.linspace(0, 1, MOVE_FRAMES + 1)[1:]
    u = np.concatenate([u * u * (3 - 2 * u), np.ones(HOLD_FRAMES)])
    at = 0
    for i in range(1, len(poses)):
        shape = (len(u),) + poses.local.shape[1:]
        locals_.append(rotations.slerp(np.broadcast_to(poses.local[i - 1], shape),
                                       np.broadcast_to(poses.local[i], shape),
                                       np.broadcast_to(u[:, None], shape[:2])))
        roots.append(np.repeat(poses.root[i:i + 1], len(u), 0))
        rests.append(at)
        at += len(u)
    return Motion(np.concatenate(roots), np.concatenate(locals_)), np.array(rests + [at])
