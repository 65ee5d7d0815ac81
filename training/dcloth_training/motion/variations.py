"""Seeded variations of a clip: what the same person might have done on another take.

A network learns a garment only where it has seen motion, and recorded clips are few. A variation
plays faster or slower, moves wider or narrower, holds itself a little differently and walks a
curve. Nothing is mirrored here: mirror images come for free when training. Feet may slide.

All ingredients are C1 in time, so that joint speeds stay within the factors stated at the top.
"""
import numpy as np

from . import gait, rotations, timing
from .skeleton import FPS, INDEX, SPINE, Motion

RATE = (0.8, 1.25)            # playback speed, constant part
RATE_WAVER = 0.08             # slow change of playback speed on top, of its value
AMPLITUDE = (0.8, 1.2)        # of a joint's rotation about its mean over the clip
JOINT_SPREAD = 0.05           # joints differ that much from the clip's own amplitude
SCALED_BELOW = 2.0            # rad: a joint that leaves its mean farther keeps its rotation
OFFSET_HERTZ = (0.08, 0.6)
TURN_RATE = 1.0               # rad/s added to the heading, constant part and waver together
WIDEST = 0.5                  # share of a rotation that even a strong variation keeps
OVERLAP_FRAMES = 15           # two clips fade into each other: half a second

# Largest offset in degrees of the joints whose carriage varies. People differ most in how far they lean
# (X of the hips) and in how far thighs are turned about the bone (Y), scripts in neither. Knees bend
# one way only.
_THIGH = {"X": 5.0, "Y": 8.0, "Z": 4.0}
_BACK = {"X": 4.0 / 3, "Y": 4.0 / 3, "Z": 4.0 / 3}       # each of the spine's three
OFFSETS = {"Hips": {"X": 8.0, "Y": 4.0, "Z": 4.0}, **dict.fromkeys(SPINE, _BACK),
           "LeftUpLeg": _THIGH, "RightUpLeg": _THIGH, "LeftLeg": {"X": 4.0}, "RightLeg": {"X": 4.0}}
# Arms vary by themselves: what is drawn for hips and legs, and so every skirt, stays as it was.
ARM_OFFSETS = {"LeftArm": {"X": 8.0, "Y": 8.0, "Z": 8.0}, "RightArm": {"X": 8.0, "Y": 8.0, "Z": 8.0}}
# Degrees by which a leaning take tilts the pelvis forward (back where negative) and to a side, on top of
# 8 degrees of waver, and how much of that the upper body and the legs make up for.
LEAN_FORWARD, LEAN_ASIDE, LEAN_WAVER = (-15.0, 40.0), (-12.0, 12.0), 8.0
UPRIGHT = {"Spine": (0.0, 1.0), "LeftUpLeg": (0.5, 1.0), "RightUpLeg": (0.5, 1.0)}
# A lifted leg: seconds of rise and fall, of holding it there, and until the next one; degrees of the thigh to the front
# and out to its side, or, one time in six, to the back; and of the knee.
LIFT_SECONDS, LIFT_HOLD, LIFT_PAUSE = (0.25, 0.9), (0.0, 1.0), (0.2, 1.2)
LIFT_FORWARD, LIFT_ASIDE, LIFT_BACK, LIFT_KNEE = (35.0, 110.0), (-5.0, 45.0), (20.0, 55.0), (0.0, 110.0)
LIFTS_BACK = 1 / 6
_LEGS = tuple(name for name in INDEX if name.endswith("Leg"))


def _both_sides(*endings):
    return tuple([index for name, index in INDEX.items() if name.startswith(side) and name.endswith(endings)]
                 for side in ("Left", "Right"))


_LEG_SIDES, _ARM_SIDES = _both_sides("Leg", "Foot", "ToeBase"), _both_sides("Shoulder", "Arm", "Hand")


def band_limited(frames, generator, low=OFFSET_HERTZ[0], high=OFFSET_HERTZ[1], waves=3):
    """A smooth random curve [frames] in -1..1: a sum of `waves` sines of low..high Hz."""
    share = generator.dirichlet(np.ones(waves))
    hertz = generator.uniform(low, high, waves)
    phase = generator.uniform(0, 2 * np.pi, waves)
    return np.sin(2 * np.pi * np.outer(np.arange(frames) / FPS, hertz) + phase) @ share


def split_heading(hips):
    """Hips' rotations [T, 3, 3] -> unwrapped heading [T] rad and what is left of the rotation."""
    heading = np.unwrap(rotations.heading_of(hips))
    return heading, rotations.about_axis("Y", -heading) @ hips


def warp_time(motion, generator, strength=1.0):
    """Play faster or slower, by a constant and a slowly changing factor."""
    rate = np.exp(min(strength, 1.5) * generator.uniform(*np.log(RATE)))
    longest = int(np.ceil(len(motion) / (rate * (1 - RATE_WAVER)))) + 2
    speed = rate * (1 + RATE_WAVER * band_limited(longest, generator, 0.05, 0.3))
    times = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return timing.sample(motion, times[times <= len(motion) - 1])


def _rescale(local, factor):
    """Rotations [T, 3, 3] with their deviation from the mean scaled by `factor`."""
    quaternions = rotations.continuous_quaternions(local)
    _, axes = np.linalg.eigh(quaternions.T @ quaternions)
    mean = rotations.matrix_from_quaternion(axes[:, -1])      # chordal mean
    deviation = rotations.continuous_quaternions(mean.T @ local)
    if deviation[0, 0] < 0:
        deviation = -deviation
    vectors = rotations.vectors_from_quaternions(deviation)
    if np.linalg.norm(vectors, axis=-1).max() > SCALED_BELOW:
        return local
    return mean @ rotations.matrix_from_vector(factor * vectors)


def scale_amplitude(motion, generator, strength=1.0):
    """Wider or narrower movement; wider steps also carry the hips farther over the ground."""
    factor = generator.uniform(AMPLITUDE[0] + JOINT_SPREAD, AMPLITUDE[1] - JOINT_SPREAD)
    local = motion.local.copy()
    heading, tilt = split_heading(local[:, 0])
    own = factor + generator.uniform(-JOINT_SPREAD, JOINT_SPREAD, local.shape[1])
    own = np.clip(1 + strength * (own - 1), WIDEST, 2 - WIDEST)
    local[:, 0] = rotations.about_axis("Y", heading) @ _rescale(tilt, own[0])
    for joint in range(1, local.shape[1]):
        local[:, joint] = _rescale(local[:, joint], own[joint])
    steps = own[[INDEX[name] for name in _LEGS]].mean()
    root = motion.root[0] + (motion.root - motion.root[0]) * np.array([steps, 1.0, steps])
    return Motion(root, local)


def offset_joints(motion, generator, strength=1.0, offsets=None):
    """Another carriage: slowly changing offsets of a few degrees, by default on hips, spine and legs (OFFSETS)."""
    local = motion.local.copy()
    frames = len(motion)
    heading, tilt = split_heading(local[:, 0])
    local[:, 0] = tilt
    for name, axes in (offsets or OFFSETS).items():
        joint = INDEX[name]
        for axis, degrees in axes.items():
            largest = strength * np.radians(degrees)
            angle = generator.uniform(0.3, 1.0) * largest * band_limited(frames, generator)
            if len(axes) == 1:                     # a knee only bends more, it is not broken
                angle = 0.5 * (largest + angle)
            local[:, joint] = local[:, joint] @ rotations.about_axis(axis, angle)
    local[:, 0] = rotations.about_axis("Y", heading) @ local[:, 0]
    return Motion(motion.root, local)


def lean(motion, generator):
    """The pelvis tilted as a whole, above legs that go on much as they did: a sprinter's, a dancer's.

    Joint offsets tilt hips and thighs together and by a few degrees. Of 172,000 frames of training one in a hundred
    had hips 25 degrees forward; fast recorded motion holds them there for whole clips.
    """
    local, frames = motion.local.copy(), len(motion)
    heading, tilt = split_heading(local[:, 0])
    forward, aside = (np.radians(generator.uniform(*bounds) + LEAN_WAVER * band_limited(frames, generator))
                      for bounds in (LEAN_FORWARD, LEAN_ASIDE))

    def leaned(share):
        return rotations.about_axis("X", share * forward) @ rotations.about_axis("Z", share * aside)

    for name, bounds in UPRIGHT.items():
        share, joint = generator.uniform(*bounds), INDEX[name]
        # World rotation leaned(1 - share) tilt local, below hips that are leaned(1) tilt.
        local[:, joint] = np.swapaxes(leaned(1) @ tilt, -1, -2) @ leaned(1 - share) @ tilt @ local[:, joint]
    local[:, 0] = rotations.about_axis("Y", heading) @ leaned(1) @ tilt
    return Motion(motion.root, local)


def _towards(local, target, share):
    """Rotations [T, ..., 3, 3] that go the share [T] of the way to others, or to one."""
    between = rotations.continuous_quaternions(np.swapaxes(local, -1, -2) @ target)
    between = between * np.where(between[:1, ..., :1] < 0, -1.0, 1.0)
    vectors = rotations.vectors_from_quaternions(between)
    return local @ rotations.matrix_from_vector(share.reshape((-1,) + (1,) * (vectors.ndim - 1)) * vectors)


def lift_legs(motion, generator):
    """Now and then a leg is lifted, fast or slowly, and held: a kick's, a climber's, a dancer's.

    What hips and the other leg do goes on. Of 34,000 frames of training one in 28 had a thigh lifted by more than 60
    degrees; dances and kicks hold it there, and a network that has not seen that leaves the cloth inside the thigh.
    """
    local, between = motion.local.copy(), generator.uniform
    now, end = between(*LIFT_PAUSE), len(motion) / FPS
    while now < end:
        side, sign = (("Left", 1.0), ("Right", -1.0))[generator.integers(2)]
        forward, aside, knee = between(*LIFT_FORWARD), between(*LIFT_ASIDE), between(*LIFT_KNEE)
        if between() < LIFTS_BACK:
            forward, aside = -between(*LIFT_BACK), 0.5 * aside
        rise, hold, fall = between(*LIFT_SECONDS), between(*LIFT_HOLD), between(*LIFT_SECONDS)
        time = np.arange(len(motion)) / FPS - now
        share = gait.smooth_step(time / rise) * (1 - gait.smooth_step((time - rise - hold) / fall))
        thigh = rotations.about_axis("X", np.radians(-forward)) @ rotations.about_axis("Z", np.radians(sign * aside))
        for joint, target in ((INDEX[side + "UpLeg"], thigh),
                              (INDEX[side + "Leg"], rotations.about_axis("X", np.radians(knee)))):
            local[:, joint] = _towards(local[:, joint], target, share)
        now += rise + hold + fall + between(*LIFT_PAUSE)
    return Motion(motion.root, local)


def curve_path(motion, generator, strength=1.0):
    """Turn the heading as the clip goes on; the path over the ground curves with it."""
    rate = strength * TURN_RATE * (0.5 * generator.uniform(-1, 1)
                        + 0.5 * band_limited(len(motion), generator, 0.05, 0.3))
    yaw = np.concatenate([[0.0], np.cumsum(rate[1:])]) / FPS
    local = motion.local.copy()
    local[:, 0] = rotations.about_axis("Y", yaw) @ local[:, 0]
    steps = np.diff(motion.root, axis=0)
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    turned = np.einsum("tij,tj->ti", rotations.about_axis("Y", middle), steps)
    root = motion.root[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(turned, 0)])
    return Motion(root, local)


def vary(motion, seed, strength=1.0):
    """A plausible other take of `motion` [T frames] -> Motion of 0.74 T to 1.36 T frames.

    `strength` 1 is another take of the same person, 3 another person altogether (24 degrees
    of lean): recorded clips differ that much from each other. The same seed gives the same take,
    bit for bit. Cost: about a millisecond a frame.
    """
    generator = np.random.default_rng([0x7661, seed])
    for change in (warp_time, scale_amplitude, offset_joints, curve_path):
        motion = change(motion, generator, strength)
    return offset_joints(motion, np.random.default_rng([0x6172, seed]), strength, ARM_OFFSETS)


def _in_own_frame(motion):
    """Heading [T], its steps [T-1], and the root's steps [T-1, 3] as seen by the walker."""
    heading, _ = split_heading(motion.local[:, 0])
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = np.einsum("tji,tj->ti", rotations.about_axis("Y", middle), np.diff(motion.root, axis=0))
    return heading, np.diff(heading), steps


def join(first, second, overlap=OVERLAP_FRAMES):
    """`second` fades in while `first` still plays its last `overlap` frames.

    timing.append holds the pose but not the speed: a run that is followed by a kick would stop
    dead within one frame. Here speeds fade too: that of the root over the ground, of the heading
    and, through the rotations, of every joint.
    """
    overlap = min(overlap, len(first) - 1, len(second) - 1)
    start = len(first) - overlap
    smooth = np.arange(overlap + 1) / overlap
    smooth = smooth * smooth * (3 - 2 * smooth)

    def both(a, b, fade):
        fade = fade[:len(a) - start].reshape((-1,) + (1,) * (a.ndim - 1))
        mixed = (1 - fade) * a[start:] + fade * b[:len(fade)]
        return np.concatenate([a[:start], mixed, b[len(fade):]])

    heading, turns_a, steps_a = _in_own_frame(first)
    _, turns_b, steps_b = _in_own_frame(second)
    turns = both(turns_a, turns_b, smooth[1:])
    heading = heading[0] + np.concatenate([[0.0], np.cumsum(turns)])
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = np.einsum("tij,tj->ti", rotations.about_axis("Y", middle),
                      both(steps_a, steps_b, smooth[1:]))
    root = first.root[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, 0)])
    root[:, 1] = both(first.root[:, 1], second.root[:, 1], smooth)  # height itself, or it drifts

    local_a, local_b = first.local.copy(), second.local.copy()
    local_a[:, 0], local_b[:, 0] = split_heading(first.local[:, 0])[1], split_heading(
        second.local[:, 0])[1]
    mixed = _towards(local_a[start:], local_b[:overlap], smooth[:-1])
    local = np.concatenate([local_a[:start], mixed, local_b[overlap:]])
    local[:, 0] = rotations.about_axis("Y", heading) @ local[:, 0]
    return Motion(root, local)


def _with_limbs_of(motion, left, right, sides):
    frames = min(len(motion), len(left), len(right))
    local = motion.local[:frames].copy()
    for source, joints in zip((left, right), sides):
        local[:, joints] = source.local[:frames][:, joints]
    return Motion(motion.root[:frames], local)


def with_legs_of(motion, left, right):
    """`motion` with the left leg of one clip and the right leg of another, frame by frame.

    Recordings tie what the hips do to what the legs do, and the legs to each other; cloth obeys
    their joints alone. Lengths: the shortest of the three. Nobody walks like that.
    """
    return _with_limbs_of(motion, left, right, _LEG_SIDES)


def with_arms_of(motion, other):
    """`motion` with both arms of `other`, frame by frame; as long as the shorter one."""
    return _with_limbs_of(motion, other, other, _ARM_SIDES)
