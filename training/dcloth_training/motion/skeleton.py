"""The figure's skeleton: 22 joints with Mixamo's names and hierarchy, T-pose at rest, world-aligned joint frames.

Motion is a root position plus one local rotation a joint and frame; forward kinematics turns
it into the world matrices G_j a host would hand to the engine.
"""
from dataclasses import dataclass

import numpy as np

from .. import figure

FPS = 30.0

_FIGURE = figure.load()
NAMES = _FIGURE.names
PARENTS = _FIGURE.parents
# From the parent in the T-pose, metres; +Y up, +Z front, +X left. The hips are the origin of all.
OFFSETS = np.where(PARENTS[:, None] >= 0, _FIGURE.joints - _FIGURE.joints[PARENTS], 0.0)
INDEX = {name: i for i, name in enumerate(NAMES)}
SPINE = ("Spine", "Spine1", "Spine2")
# What moves a garment that hangs from the waist, and one with sleeves.
LOWER_BODY = ("Hips", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg")
WHOLE_BODY = (*LOWER_BODY, "Spine2", "LeftArm", "RightArm", "LeftForeArm", "RightForeArm")
THIGH_LENGTH = -OFFSETS[INDEX["LeftLeg"], 1]
SHIN_LENGTH = -OFFSETS[INDEX["LeftFoot"], 1]
HIP_HEIGHT = _FIGURE.joints[0, 1]
ANKLE_HEIGHT = _FIGURE.joints[INDEX["LeftFoot"], 1]
# The joint that takes a joint's place under reflection in the plane x = 0.
MIRROR = np.array([INDEX[n.replace("Left", "\0").replace("Right", "Left").replace("\0", "Right")]
                   for n in NAMES], dtype=np.int32)


@dataclass
class Motion:
    """root [T, 3] world position of the hips, local [T, J, 3, 3] rotations, at 30 frames/s."""
    root: np.ndarray
    local: np.ndarray

    def __len__(self):
        return len(self.root)

    def __getitem__(self, frames):
        return Motion(self.root[frames], self.local[frames])


def rest_motion(frames=1):
    """The T-pose, standing on the ground."""
    root = np.zeros((frames, 3))
    root[:, 1] = HIP_HEIGHT
    return Motion(root, np.tile(np.eye(3), (frames, len(NAMES), 1, 1)))


def joint_matrices(motion):
    """Forward kinematics: Motion -> world matrices [T, J, 4, 4], column vectors."""
    frames = len(motion)
    out = np.zeros((frames, len(NAMES), 4, 4))
    out[..., 3, 3] = 1.0
    for j, parent in enumerate(PARENTS):
        if parent < 0:
            out[:, j, :3, :3] = motion.local[:, j]
            out[:, j, :3, 3] = motion.root
        else:
            up = out[:, parent]
            out[:, j, :3, :3] = up[:, :3, :3] @ motion.local[:, j]
            out[:, j, :3, 3] = up[:, :3, 3] + up[:, :3, :3] @ OFFSETS[j]
    return out


def bind_matrices():
    """Bind (rest) matrices B_j [J, 4, 4]: the T-pose at the world origin."""
    return joint_matrices(rest_motion())[0]


def skin(points, weights, bind, matrices):
    """Linear blend skinning: points [n, 3], weights [n, J], matrices [T, J, 4, 4] -> [T, n, 3]."""
    relative = matrices @ np.linalg.inv(bind)
    used = np.flatnonzero(weights.any(0))
    out = np.zeros((len(matrices), len(points), 3))
    for j in used:
        posed = points @ relative[:, j, :3, :3].transpose(0, 2, 1) + relative[:, None, j, :3, 3]
        out += weights[None, :, j, None] * posed
    return out
