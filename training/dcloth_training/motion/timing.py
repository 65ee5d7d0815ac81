"""Timing of clips: resample, start from standstill, loop, mirror, blend from a pose."""
import numpy as np

from . import rotations
from .skeleton import INDEX, MIRROR, Motion, joint_matrices

T_POSE_DEGREES = 40.0          # an arm that is farther from level has left the T-pose


def sample(motion, times):
    """Motion at fractional frame numbers `times` [k], clamped to the clip."""
    times = np.clip(np.asarray(times, dtype=np.float64), 0, len(motion) - 1)
    low = np.minimum(times.astype(int), max(len(motion) - 2, 0))
    high = np.minimum(low + 1, len(motion) - 1)
    part = times - low
    root = motion.root[low] + part[:, None] * (motion.root[high] - motion.root[low])
    amount = np.broadcast_to(part[:, None], motion.local[low].shape[:2])
    return Motion(root, rotations.slerp(motion.local[low], motion.local[high], amount))


def ease_in(motion, frames=12):
    """Start from standstill: playback speed rises smoothly from 0 to 1 over `frames` frames.

    A clip that starts in full run would hit the settled cloth with an infinite acceleration.
    Lengthens the clip by frames / 2.
    """
    t = np.arange(len(motion) + frames // 2)
    u = np.minimum(t / frames, 1.0)
    warped = frames * (u ** 3 - u ** 4 / 2) + np.maximum(t - frames, 0)  # speed = smoothstep
    return sample(motion, warped[warped <= len(motion) - 1])


def turn(motion, angle, pivot=(0.0, 0.0)):
    """Rotate the whole motion about +Y by `angle` rad around ground point `pivot` (x, z)."""
    spin = rotations.about_axis("Y", angle)
    centre = np.array([pivot[0], 0.0, pivot[1]])
    local = motion.local.copy()
    local[:, 0] = spin @ local[:, 0]
    return Motion((motion.root - centre) @ spin.T + centre, local)


def to_origin(motion):
    """Move the first frame's hips above the origin, facing +Z; height is kept."""
    start = motion.root[0] * np.array([1.0, 0.0, 1.0])
    moved = Motion(motion.root - start, motion.local)
    return turn(moved, -rotations.heading_of(motion.local[0, 0]))


def append(first, second, blend=8):
    """`second` continues where `first` ends, in place and heading, with no jump in pose.

    The mismatch at the seam is carried into `second` and faded out over `blend` frames.
    """
    heading = rotations.heading_of(first.local[-1, 0])
    second = turn(to_origin(second), heading)
    gap = first.root[-1] - second.root[0]
    fade = np.clip(1 - np.arange(len(second)) / blend, 0, 1)
    fade = fade * fade * (3 - 2 * fade)
    root = second.root + np.where([True, False, True], gap, fade[:, None] * gap)
    correction = first.local[-1] @ second.local[0].transpose(0, 2, 1)
    identity = np.broadcast_to(np.eye(3), (len(second),) + correction.shape)
    amount = np.broadcast_to(fade[:, None], identity.shape[:2])
    faded = rotations.slerp(identity, np.broadcast_to(correction, identity.shape), amount)
    local = faded @ second.local
    return Motion(np.concatenate([first.root, root[1:]]), np.concatenate([first.local, local[1:]]))


def loop(motion, frames):
    """Repeat a cyclic clip until it has at least `frames` frames; root motion accumulates."""
    out = motion
    while len(out) < frames:
        out = append(out, motion)
    return out


def mirror(motion):
    """Reflect in the plane x = 0: left and right swap."""
    flip = np.array([-1.0, 1.0, 1.0])
    return Motion(motion.root * flip, flip[:, None] * motion.local[:, MIRROR] * flip)


def approach(motion, reach, hold):
    """Frames that lead a garment into a clip: T-pose -> first pose (`reach`), held (`hold`).

    Place and heading are the first frame's throughout, so only limbs and tilt move.
    """
    first = motion[:1]
    heading = rotations.about_axis("Y", rotations.heading_of(first.local[0, 0]))
    start = np.tile(np.eye(3), first.local.shape[1:2] + (1, 1))
    start[0] = heading
    u = np.concatenate([np.linspace(0, 1, reach + 1), np.ones(hold)])
    u = u * u * (3 - 2 * u)
    count = len(u)
    local = rotations.slerp(np.broadcast_to(start, (count,) + start.shape),
                            np.broadcast_to(first.local[0], (count,) + start.shape),
                            np.broadcast_to(u[:, None], (count, len(start))))
    return Motion(np.repeat(first.root, count, 0), local)


def between_t_poses(motion):
    """(first, last) frame of what is between the T-pose that a take begins in and the one that it ends in, last
    exclusive.

    In a T-pose both upper arms and both forearms point to the sides, seen from the hips, within T_POSE_DEGREES.
    """
    turn = joint_matrices(motion)[:, :, :3, :3]
    along = [(turn[:, INDEX[side + joint], :, 0] * turn[:, 0, :, 0]).sum(1)
             for side in ("Left", "Right") for joint in ("Arm", "ForeArm")]
    left = np.flatnonzero(np.min(along, 0) <= np.cos(np.radians(T_POSE_DEGREES)))
    return (int(left[0]), int(left[-1]) + 1) if len(left) else (0, 0)
