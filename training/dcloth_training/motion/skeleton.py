"""The project's humanoid: 15 joints, T-pose at rest, world-aligned joint frames.

Motion is a root position plus one local rotation a joint and frame; forward kinematics turns
it into the world matrices G_j a host would hand to the engine.
"""
from dataclasses import dataclass

import numpy as np

FPS = 30.0

# name, parent, offset from the parent in the T-pose (metres; +Y up, +Z front, +X left).
_JOINTS = (
    ("Hips", -1, (0.0, 0.0, 0.0)),
    ("Chest", 0, (0.0, 0.236151, 0.0)),
    ("Neck", 1, (0.0, 0.223894, 0.0)),
    ("RightArm", 1, (-0.183110, 0.243536, -0.024050)),
    ("RightForeArm", 3, (-0.274788, 0.0, 0.0)),
    ("RightHand", 4, (-0.258947, 0.0, 0.0)),
    ("LeftArm", 1, (0.183110, 0.243536, -0.024050)),
    ("LeftForeArm", 6, (0.274788, 0.0, 0.0)),
    ("LeftHand", 7, (0.258947, 0.0, 0.0)),
    ("RightUpLeg", 0, (-0.084887, 0.0, 0.0)),
    ("RightLeg", 9, (0.0, -0.421546, 0.0)),
    ("RightFoot", 10, (0.0, -0.409870, 0.0)),
    ("LeftUpLeg", 0, (0.084887, 0.0, 0.0)),
    ("LeftLeg", 12, (0.0, -0.421546, 0.0)),
    ("LeftFoot", 13, (0.0, -0.409870, 0.0)),
)
NAMES = tuple(j[0] for j in _JOINTS)
PARENTS = np.array([j[1] for j in _JOINTS], dtype=np.int32)
OFFSETS = np.array([j[2] for j in _JOINTS], dtype=np.float64)
INDEX = {name: i for i, name in enumerate(NAMES)}
# What moves a garment that hangs from the waist, and one with sleeves.
LOWER_BODY = ("Hips", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg")
WHOLE_BODY = (*LOWER_BODY, "Chest", "LeftArm", "RightArm", "LeftForeArm", "RightForeArm")
THIGH_LENGTH = 0.421546
SHIN_LENGTH = 0.409870
ANKLE_HEIGHT = 0.05
HIP_HEIGHT = THIGH_LENGTH + SHIN_LENGTH + ANKLE_HEIGHT
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
