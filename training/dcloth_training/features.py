"""From joint matrices to the network's input: heading frame, pose features, root motion.

The formulas of engine/format/NETWORK.md, section Pose, in float64. One function call is one
sequence that begins with a reset.
"""
import numpy as np
import torch

SHORTEST_PROJECTION = 0.2
WIDENING = 0.1
SMALLEST_DEVIATION = 1e-3
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


def root_motion(rotation, origin, yaw, rate):
    """Hips' velocity in the heading frame (m/s) and yaw rate (rad/s): [T, 4], first row zero."""
    out = np.zeros((len(yaw), 4))
    velocity = (origin[1:] - origin[:-1]) * rate
    out[1:, :3] = np.einsum("tji,tj->ti", rotation[1:], velocity)
    turn = yaw[1:] - yaw[:-1]
    out[1:, 3] = (turn - 2 * np.pi * np.round(turn / (2 * np.pi))) * rate
    return out


def carried(x, velocity, rate):
    """Features [T, d] with root motion of the same ticks on a vessel that moves at `velocity` [3], m/s.

    In the simulation air travels with the hips, so cloth feels their acceleration but not their
    velocity: the truth, as seen from the hips, is the same. `velocity` is in the first tick's heading
    frame. The first tick keeps its root motion; a caller whose state goes on from before adds to it.
    """
    out = np.array(x)
    yaw = np.cumsum(out[1:, -1], dtype=np.float64) / rate
    out[1:, -4:-1] += np.einsum("tji,j->ti", about_y(yaw), np.asarray(velocity, np.float64))
    return out


def raw(matrices, bind, hips, joints, rate, with_root_motion=True):
    """Features before standardising: [T, 9 len(joints) (+ 4)]."""
    rotation, origin, yaw = heading_frames(matrices, bind, hips)
    linear = relative(matrices, bind)[:, joints, :3, :3]
    turned = np.einsum("tji,tkjl->tkil", rotation, linear)
    parts = [turned.reshape(len(turned), -1)]
    if with_root_motion:
        parts.append(root_motion(rotation, origin, yaw, rate))
    return np.concatenate(parts, 1)


def mirror_pose(matrices, joint_mirror):
    """The pose reflected in the plane x = 0: joints swap sides, S G S."""
    return REFLECTION @ np.asarray(matrices, np.float64)[:, joint_mirror] @ REFLECTION


def mirror_cloth(positions, vertex_mirror):
    """Cloth reflected in the plane x = 0: [T, n, 3]."""
    out = positions[:, vertex_mirror].copy()
    out[..., 0] *= -1
    return out


def fit_standard(rows):
    """{mean, deviation, low, high} of training features [N, d]; the range widened by 10 %."""
    mean, deviation = rows.mean(0), np.maximum(rows.std(0), SMALLEST_DEVIATION)
    scaled = (rows - mean) / deviation
    low, high = scaled.min(0), scaled.max(0)
    margin = WIDENING * (high - low)
    return {"mean": mean, "deviation": deviation, "low": low - margin, "high": high + margin}


class Standardise(torch.nn.Module):
    """(x - mean) / deviation, clamped to [low, high]."""

    def __init__(self, mean, deviation, low, high):
        super().__init__()
        for name, value in (("mean", mean), ("deviation", deviation), ("low", low),
                            ("high", high)):
            self.register_buffer(name, torch.as_tensor(np.asarray(value)))

    def forward(self, x):
        return torch.maximum(torch.minimum((x - self.mean) / self.deviation, self.high), self.low)
