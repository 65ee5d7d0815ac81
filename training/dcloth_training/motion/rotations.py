"""Rotations as 3x3 matrices, unit quaternions (w, x, y, z) and axis angles; all batched.

Every function takes leading batch dimensions `...`; angles are radians.
"""
import numpy as np

_AXES = {"X": 0, "Y": 1, "Z": 2}


def arctan2(y, x):
    """numpy's, to the same bits every time. On processors with AVX-512 numpy 1.24 computes a strided view's last bit by
    one of two routines, depending on where its result happens to lie in memory."""
    return np.arctan2(np.array(y, order="C"), np.array(x, order="C"))


def about_axis(axis, angle):
    """Rotation about a coordinate axis. axis 'X' | 'Y' | 'Z', angle [...] -> [..., 3, 3]."""
    i = _AXES[axis]
    j, k = (i + 1) % 3, (i + 2) % 3
    angle = np.asarray(angle, dtype=np.float64)
    out = np.zeros(angle.shape + (3, 3))
    out[..., i, i] = 1.0
    out[..., j, j] = out[..., k, k] = np.cos(angle)
    out[..., k, j] = np.sin(angle)
    out[..., j, k] = -np.sin(angle)
    return out


def quaternion_from_matrix(matrix):
    """[..., 3, 3] -> [..., 4]; stable for every angle (largest of four candidate pivots)."""
    m = np.asarray(matrix, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    candidates = np.stack([
        np.stack([1 + xx + yy + zz, m[..., 2, 1] - m[..., 1, 2],
                  m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1),
        np.stack([m[..., 2, 1] - m[..., 1, 2], 1 + xx - yy - zz,
                  m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0]], -1),
        np.stack([m[..., 0, 2] - m[..., 2, 0], m[..., 0, 1] + m[..., 1, 0],
                  1 - xx + yy - zz, m[..., 1, 2] + m[..., 2, 1]], -1),
        np.stack([m[..., 1, 0] - m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0],
                  m[..., 1, 2] + m[..., 2, 1], 1 - xx - yy + zz], -1)], -2)
    diagonal = np.stack([candidates[..., i, i] for i in range(4)], -1)
    pick = np.argmax(diagonal, -1)
    q = np.take_along_axis(candidates, pick[..., None, None], -2)[..., 0, :]
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def matrix_from_quaternion(quaternion):
    """[..., 4] -> [..., 3, 3]; the quaternion is normalised first."""
    q = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
        np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
        np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1)], -2)


def slerp(first, second, amount):
    """Shortest-arc interpolation of matrices [..., 3, 3]; amount [...] in 0..1."""
    a, b = quaternion_from_matrix(first), quaternion_from_matrix(second)
    amount = np.asarray(amount, dtype=np.float64)[..., None]
    dot = np.sum(a * b, -1, keepdims=True)
    b = np.where(dot < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6  # below this the arc is a straight line to rounding
    safe = np.where(near, 1.0, sine)
    wa = np.where(near, 1 - amount, np.sin((1 - amount) * angle) / safe)
    wb = np.where(near, amount, np.sin(amount * angle) / safe)
    return matrix_from_quaternion(wa * a + wb * b)


def angle_between(first, second):
    """Geodesic angle between matrices [..., 3, 3] -> [...] radians."""
    trace = np.einsum("...ij,...ij->...", first, second)
    return np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))


def heading_of(rotation):
    """Yaw of the hips' left axis projected on the ground; rotation [..., 3, 3] -> [...] rad.

    The left axis stays horizontal in a somersault, the forward axis does not.
    """
    left = rotation[..., :, 0]
    return arctan2(-left[..., 2], left[..., 0])


def continuous_quaternions(matrix):
    """[T, ..., 3, 3] -> [T, ..., 4] whose sign never flips from frame to frame."""
    q = quaternion_from_matrix(matrix)
    flips = np.where(np.sum(q[1:] * q[:-1], -1, keepdims=True) < 0, -1.0, 1.0)
    return q * np.concatenate([np.ones_like(q[:1, ..., :1]), np.cumprod(flips, 0)])


def vectors_from_quaternions(quaternion):
    """Unit quaternions [..., 4] -> rotation vectors [..., 3], angles 0..2 pi (sign is kept)."""
    length = np.linalg.norm(quaternion[..., 1:], axis=-1, keepdims=True)
    angle = 2 * arctan2(length, quaternion[..., :1])
    # Below 1e-9 the angle over the sine is 2 to rounding (angle near 0).
    return quaternion[..., 1:] * np.where(length > 1e-9, angle / np.maximum(length, 1e-9), 2.0)


def matrix_from_vector(vector):
    """Rotation vectors [..., 3] -> [..., 3, 3] (Rodrigues' formula by way of quaternions)."""
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    return matrix_from_quaternion(
        np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], -1))
