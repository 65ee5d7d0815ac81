"""Recorded clips, which have 15 joints, brought onto the figure's 22.

Both skeletons stand in T-pose at rest with world-aligned frames, so rotations carry over. What differs:
the hips' path is scaled to the figure's legs; the chest's rotation is shared by Spine, Spine1 and Spine2, the neck's by
Neck and Head; a share of a raised arm goes into the shoulder; toes stay on the ground when a heel lifts.
"""
import numpy as np

from .. import figure
from . import rotations, skeleton
from .skeleton import ANKLE_HEIGHT, INDEX, NAMES as FIGURE_NAMES, OFFSETS as FIGURE_OFFSETS, SHIN_LENGTH, SPINE, \
    THIGH_LENGTH, Motion

# name, offset from the parent in the T-pose (metres), of the skeleton that recorded clips come with.
_JOINTS = (
    ("Hips", (0.0, 0.0, 0.0)), ("Chest", (0.0, 0.236151, 0.0)), ("Neck", (0.0, 0.223894, 0.0)),
    ("RightArm", (-0.183110, 0.243536, -0.024050)), ("RightForeArm", (-0.274788, 0.0, 0.0)),
    ("RightHand", (-0.258947, 0.0, 0.0)), ("LeftArm", (0.183110, 0.243536, -0.024050)),
    ("LeftForeArm", (0.274788, 0.0, 0.0)), ("LeftHand", (0.258947, 0.0, 0.0)),
    ("RightUpLeg", (-0.084887, 0.0, 0.0)), ("RightLeg", (0.0, -0.421546, 0.0)), ("RightFoot", (0.0, -0.409870, 0.0)),
    ("LeftUpLeg", (0.084887, 0.0, 0.0)), ("LeftLeg", (0.0, -0.421546, 0.0)), ("LeftFoot", (0.0, -0.409870, 0.0)))
NAMES = tuple(name for name, _ in _JOINTS)
OFFSETS = np.array([offset for _, offset in _JOINTS])
_LEG, _ANKLE = 0.421546 + 0.409870, 0.05
# A level arm is at rest; a hanging one lowers the shoulder, a raised one lifts it, one held forward brings it along.
SHOULDER_DOWN, SHOULDER_UP, SHOULDER_FORWARD = 0.14, 0.28, 0.20     # of the arm's angle
TOES = 0.7                     # of a foot's pitch that the toes make up for
TOES_MOST = np.radians(40)
SOLE = 0.008                   # metres: what is lower in T-pose is sole
LOW_PERCENT, SINK = 5, 0.015   # of a clip's frames; metres


def split(rotation, count):
    """The rotation [T, 3, 3] that makes `rotation` when it is applied `count` times."""
    vector = rotations.vectors_from_quaternions(_shortest(rotations.quaternion_from_matrix(rotation)))
    return rotations.matrix_from_vector(vector / count)


def _shortest(quaternion):
    return quaternion * np.where(quaternion[..., :1] < 0, -1.0, 1.0)


def shoulder(arm, sign):
    """Rotation [T, 3, 3] of the shoulder that goes with a rotation [T, 3, 3] of the arm in the chest's frame.

    sign: 1 left, -1 right. It depends on the bone's direction alone.
    """
    direction = sign * arm[:, :, 0]
    up = np.arcsin(np.clip(direction[:, 1], -1, 1))
    up = np.where(up > 0, SHOULDER_UP, SHOULDER_DOWN) * up
    forward = SHOULDER_FORWARD * np.arcsin(np.clip(direction[:, 2], -1, 1))
    return rotations.about_axis("Z", sign * up) @ rotations.about_axis("Y", -sign * forward)


def toes(foot):
    """Local rotation [T, 3, 3] of the toes below a foot whose world rotation is `foot`: flat on the ground where they
    can."""
    down = np.arcsin(np.clip(-foot[:, 1, 2], -1, 1))        # how far the foot's front points down
    return rotations.about_axis("X", -np.clip(TOES * down, 0, TOES_MOST))


def onto_figure(root, local):
    """root [T, 3], local [T, 15, 3, 3] of a recorded clip -> Motion of the figure. Cost: 5 microseconds a frame."""
    at = {name: i for i, name in enumerate(NAMES)}
    out = np.tile(np.eye(3), (len(root), len(FIGURE_NAMES), 1, 1))

    def put(name, rotation):
        out[:, INDEX[name]] = rotation

    for name in ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot", "LeftForeArm",
                 "LeftHand", "RightForeArm", "RightHand"):
        put(name, local[:, at[name]])
    bend = split(local[:, at["Chest"]], len(SPINE))
    for name in SPINE:
        put(name, bend)
    for name in ("Neck", "Head"):
        put(name, split(local[:, at["Neck"]], 2))
    for side, sign in (("Left", 1), ("Right", -1)):
        arm = local[:, at[side + "Arm"]]
        raised = shoulder(arm, sign)
        put(side + "Shoulder", raised)
        put(side + "Arm", np.swapaxes(raised, -1, -2) @ arm)
        foot = local[:, at["Hips"]]
        for joint in ("UpLeg", "Leg", "Foot"):
            foot = foot @ local[:, at[side + joint]]
        put(side + "ToeBase", toes(foot))
    # The middle between the thighs' joints keeps its height over the ankles, in legs.
    scale = (THIGH_LENGTH + SHIN_LENGTH) / _LEG
    middle = scale * (root - [0, _ANKLE, 0]) + [0, ANKLE_HEIGHT, 0]
    own = 0.5 * (FIGURE_OFFSETS[INDEX["LeftUpLeg"]] + FIGURE_OFFSETS[INDEX["RightUpLeg"]])
    return on_floor(Motion(middle - local[:, 0] @ own, out))


def lowest(motion):
    """Height [T] of the figure's lowest sole point."""
    skin = figure.load()
    matrices, out = skeleton.joint_matrices(motion), np.full(len(motion), np.inf)
    for name in ("LeftFoot", "LeftToeBase", "RightFoot", "RightToeBase"):
        joint = INDEX[name]
        sole = skin.vertices[(skin.weights[:, joint] > 0.5) & (skin.vertices[:, 1] < SOLE)] - skin.joints[joint]
        height = matrices[:, joint, 1, :3] @ sole.T + matrices[:, joint, 1, 3:]
        out = np.minimum(out, height.min(1))
    return out


def on_floor(motion):
    """The clip raised or lowered as a whole: soles at height 0 where they are low, nowhere deeper than SINK."""
    height = lowest(motion)
    level = min(np.percentile(height, LOW_PERCENT), height.min() + SINK)
    return Motion(motion.root - [0, level, 0], motion.local)
