"""From joint matrices to the network's input: heading frame, pose features, root motion.

The formulas of engine/format/NETWORK.md, section Pose, in float64. One function call is one
sequence that begins with a reset.
"""
import numpy as np
import torch

SHORTEST_PROJECTION = 0.2
WIDENING = 0.1
SMALLEST_DEVIATION = 1e-3
# Kinds of root motion, and how many numbers each puts behind the joints' nine.
ROOT_NUMBERS = {"none": 0, "hips": 4, "air": 7}
REFLECTION = np.diag([-1.0, 1.0, 1.0, 1.0])


def relative(matrices, bind):
    """G_j B_j^-1 for every tick and joint: [T, J, 4, 4]."""
    return np.asarray(matrices, np.float64) @ np.linalg.inv(np.asarray(bind, np.float64))


def headings(left):
    """Yaw a [T] from the hips' left axis [T, 3]; a short ground projection keeps the one before."""
    yaw, last = np.zeros(len(left)), 0.0
    for t, (x, _, z) in enumerate(left):
        if np.hypot(x, z) >= SHORTEST_PROJECTION:
            last = np.arctan2(-z, x)
        yaw[t] = last
    return yaw


def about_y(yaw):
    """Rotation whose X axis is (cos a, 0, -sin a): [T, 3, 3]."""
    out = np.zeros((len(yaw), 3, 3))
    out[:, 0, 0] = out[:, 2, 2] = np.cos(yaw)
    out[:, 0, 2], out[:, 2, 0], out[:, 1, 1] = np.sin(yaw), -np.sin(yaw), 1.0
    return out


def heading_frames(matrices, bind, hips):
    """(rotation [T, 3, 3], origin [T, 3], yaw [T]) of the heading frame H."""
    matrices = np.asarray(matrices, np.float64)
    left = relative(matrices[:, hips], np.asarray(bind)[hips])[:, :3, 0]
    yaw = headings(left)
    return about_y(yaw), matrices[:, hips, :3, 3], yaw


def in_heading(rotation, vectors):
    """World vectors [T, 3] in the heading frame of their tick."""
    return np.einsum("tji,tj->ti", rotation, vectors)


def root_motion(rotation, origin, yaw, rate):
    """Hips' velocity in the heading frame (m/s) and yaw rate (rad/s): [T, 4], first row zero."""
    out = np.zeros((len(yaw), 4))
    velocity = (origin[1:] - origin[:-1]) * rate
    out[1:, :3] = in_heading(rotation[1:], velocity)
    turn = yaw[1:] - yaw[:-1]
    out[1:, 3] = (turn - 2 * np.pi * np.round(turn / (2 * np.pi))) * rate
    return out


def calm(frames):
    """No wind: [T, 3]."""
    return np.zeros((frames, 3))


def air_motion(rotation, origin, yaw, rate, wind=None):
    """Root motion of the kind "air": [T, 7], in this order.

    Velocity of the air relative to the hips in the heading frame (3, m/s; `wind` [T, 3] m/s in the world, less the
    hips' own velocity), yaw rate (1, rad/s), acceleration of the hips in the heading frame (3, m/s^2: the second
    backward difference of their world positions). The first tick's hips stand still; the first two ticks'
    acceleration is zero.
    """
    of_hips = root_motion(rotation, origin, yaw, rate)
    wind = calm(len(yaw)) if wind is None else np.asarray(wind, np.float64)
    out = np.zeros((len(yaw), ROOT_NUMBERS["air"]))
    out[:, :3] = in_heading(rotation, wind) - of_hips[:, :3]
    out[:, 3] = of_hips[:, 3]
    out[2:, 4:] = in_heading(rotation[2:], (origin[2:] - 2 * origin[1:-1] + origin[:-2]) * rate ** 2)
    return out


def begin(x, wind=None):
    """Gives features x [T, d] of a clip's middle the root motion that they have after a reset, in place.

    wind [3]: of the first tick, in its heading frame; read by the kind "air" alone.
    """
    numbers = x.shape[1] % 9
    if numbers:
        x[0, -numbers:] = 0
    if numbers == ROOT_NUMBERS["air"]:
        x[0, -7:-4] = wind
        x[1:2, -3:] = 0
    return x


def at_rest(x):
    """Sets the root motion of features x [N, d] to that of hips at rest in calm air, in place."""
    numbers = x.shape[1] % 9
    if numbers:
        x[:, -numbers:] = 0
    return x


def carried(x, velocity, rate):
    """Features [T, d] with root motion of the same ticks on a vessel that moves at `velocity` [3], m/s.

    In the simulation air travels with the hips, so cloth feels their acceleration but not their
    velocity: the truth, as seen from the hips, is the same. `velocity` is in the first tick's heading
    frame. The first tick keeps its root motion; a caller whose state goes on from before adds to it.
    Only for root motion of the kind "hips": the kind "air" tells the velocity of the air itself.
    """
    out = np.array(x)
    yaw = np.cumsum(out[1:, -1], dtype=np.float64) / rate
    out[1:, -4:-1] += np.einsum("tji,j->ti", about_y(yaw), np.asarray(velocity, np.float64))
    return out


def raw(matrices, bind, hips, joints, rate, root="hips", wind=None):
    """Features before standardising: [T, 9 len(joints) + ROOT_NUMBERS[root]].

    wind [T, 3], m/s in the world: read by the kind "air" alone; None is calm.
    """
    rotation, origin, yaw = heading_frames(matrices, bind, hips)
    linear = relative(matrices, bind)[:, joints, :3, :3]
    turned = np.einsum("tji,tkjl->tkil", rotation, linear)
    parts = [turned.reshape(len(turned), -1)]
    if root == "hips":
        parts.append(root_motion(rotation, origin, yaw, rate))
    elif root == "air":
        parts.append(air_motion(rotation, origin, yaw, rate, wind))
    elif root != "none":
        raise ValueError(f"root motion {root!r}, allowed are {', '.join(ROOT_NUMBERS)}")
    return np.concatenate(parts, 1)


def mirror_pose(matrices, joint_mirror):
    """The pose reflected in the plane x = 0: joints swap sides, S G S."""
    return REFLECTION @ np.asarray(matrices, np.float64)[:, joint_mirror] @ REFLECTION


def mirror_wind(wind):
    """World vectors [T, 3] reflected in the plane x = 0; None stays None."""
    return None if wind is None else np.asarray(wind, np.float64) * [-1, 1, 1]


def mirror_cloth(positions, vertex_mirror):
    """Cloth reflected in the plane x = 0: [T, n, 3]."""
    out = positions[:, vertex_mirror].copy()
    out[..., 0] *= -1
    return out


def _range_of(scaled):
    """{low, high} of standardised features [N, d], widened by 10 %."""
    low, high = scaled.min(0), scaled.max(0)
    margin = WIDENING * (high - low)
    return {"low": low - margin, "high": high + margin}


def fit_standard(rows):
    """{mean, deviation, low, high} of training features [N, d]."""
    mean, deviation = rows.mean(0), np.maximum(rows.std(0), SMALLEST_DEVIATION)
    return {"mean": mean, "deviation": deviation, **_range_of((rows - mean) / deviation)}


def widened(standard, rows):
    """`standard` for features [N, d] beside those that it is of: mean and deviation stay, the range is that of both."""
    more = _range_of((rows - standard["mean"]) / standard["deviation"])
    return {**standard, "low": np.minimum(standard["low"], more["low"]),
            "high": np.maximum(standard["high"], more["high"])}


class Standardise(torch.nn.Module):
    """(x - mean) / deviation, clamped to [low, high]."""

    def __init__(self, mean, deviation, low, high):
        super().__init__()
        for name, value in (("mean", mean), ("deviation", deviation), ("low", low),
                            ("high", high)):
            self.register_buffer(name, torch.as_tensor(np.asarray(value)))

    def forward(self, x):
        return torch.maximum(torch.minimum((x - self.mean) / self.deviation, self.high), self.low)
