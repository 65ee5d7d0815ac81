"""Variations of clips, joining them, and random procedural clips: seeded, smooth, still a person."""
import numpy as np
import pytest

from dcloth_training.motion import (gait, procedural, random_script, retarget, rotations, skeleton, timing,
                                    variations)
from dcloth_training.motion.skeleton import FPS

CLIPS = ("walk_weave", "spin_left", "kicks", "run_turn_walk", "jumps")
FASTEST = variations.RATE[1] * (1 + variations.RATE_WAVER)
# A sum of sines whose shares add up to one is at most as steep as its fastest sine.
OFFSET_RATE = {joint: sum(np.radians(degrees) for degrees in axes.values())
               * 2 * np.pi * variations.OFFSET_HERTZ[1] for joint, axes in variations.OFFSETS.items()}


def angular_speed(local):
    """Rotations [T, ..., 3, 3] -> rad/s [T - 1, ...]."""
    return rotations.angle_between(local[1:], local[:-1]) * FPS


def assert_rotations(motion):
    product = motion.local @ np.swapaxes(motion.local, -1, -2)
    assert np.abs(product - np.eye(3)).max() < 1e-12
    assert np.linalg.det(motion.local).min() > 0 and np.isfinite(motion.root).all()


@pytest.mark.parametrize("name", CLIPS)
def test_a_variation_is_reproducible_valid_and_another_take(name):
    motion = procedural.clip(name)
    first, again, other = (variations.vary(motion, seed) for seed in (3, 3, 4))
    assert np.array_equal(first.local, again.local) and np.array_equal(first.root, again.root)
    shared = min(len(first), len(other))
    assert np.abs(first.local[:shared] - other.local[:shared]).max() > 0.05
    assert len(motion) / FASTEST - 2 < len(first) < len(motion) / (0.8 * 0.92) + 2
    assert_rotations(first)
    mirrored = timing.mirror(first)
    assert_rotations(mirrored)
    assert np.allclose(timing.mirror(mirrored).local, first.local, atol=1e-14)


@pytest.mark.parametrize("name", CLIPS)
@pytest.mark.parametrize("seed", range(6))
def test_joint_speeds_of_a_variation_stay_within_the_stated_factors(name, seed):
    """Playback, amplitude and offset each multiply or add at most what their constants say."""
    motion = procedural.clip(name)
    varied = variations.vary(motion, seed)
    before, after = angular_speed(motion.local).max(0), angular_speed(varied.local).max(0)
    # Scaling a rotation vector by s >= 1 raises its angular speed by at most s; one by s < 1, of
    # angles below 2 rad, by at most 1.
    bound = FASTEST * variations.AMPLITUDE[1] * before
    for joint, rate in OFFSET_RATE.items():
        bound[skeleton.INDEX[joint]] += rate
    heading, tilt = variations.split_heading(motion.local[:, 0])
    bound[0] = (FASTEST * (np.abs(np.diff(heading)).max() * FPS
                           + variations.AMPLITUDE[1] * angular_speed(tilt).max())
                + OFFSET_RATE["Hips"] + variations.TURN_RATE)
    assert (after <= bound + 1e-6).all()
    # Over the ground: playback and step length; the curve turns steps but never stretches them.
    step = np.linalg.norm(np.diff(motion.root, axis=0), axis=1).max()
    assert np.linalg.norm(np.diff(varied.root, axis=0), axis=1).max() <= (
        FASTEST * variations.AMPLITUDE[1] * step + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_warped_time_adds_no_jerk(seed):
    """Second differences of a resampled curve are sums of the original's, plus a rate change."""
    motion = procedural.clip("run_turn_walk")
    warped = variations.warp_time(motion, np.random.default_rng(seed))
    speed = np.linalg.norm(np.diff(motion.root, axis=0), axis=1).max()
    bend = np.linalg.norm(np.diff(motion.root, n=2, axis=0), axis=1).max()
    # Resampled linearly at step r <= FASTEST: each kink counts by max(0, r - distance), at most
    # r + 2 (r - 1) of them. The rate itself wavers with at most 0.3 Hz.
    share = FASTEST + 2 * (FASTEST - 1)
    waver = variations.RATE[1] * variations.RATE_WAVER * 2 * np.pi * 0.3 / FPS
    found = np.linalg.norm(np.diff(warped.root, n=2, axis=0), axis=1).max()
    assert found <= share * bend + waver * speed


def test_knees_are_never_bent_forward():
    motion = procedural.clip("walk_start_stop")
    knees = [skeleton.INDEX["LeftLeg"], skeleton.INDEX["RightLeg"]]
    for seed in range(10):
        moved = variations.offset_joints(motion, np.random.default_rng(seed))
        change = np.swapaxes(motion.local, -1, -2) @ moved.local
        added = np.arctan2(change[:, knees, 2, 1], change[:, knees, 1, 1])
        assert added.min() >= -1e-9 and 0 < added.max() <= np.radians(variations.OFFSETS["LeftLeg"]["X"])


def test_a_joint_that_swings_far_keeps_its_rotation_and_others_scale():
    angle = np.linspace(-1, 1, 50)
    narrow = rotations.about_axis("X", angle)
    scaled = variations._rescale(narrow, 1.2)
    assert np.allclose(scaled, rotations.about_axis("X", 1.2 * angle), atol=1e-9)
    wide = rotations.about_axis("X", 3 * angle)
    assert np.array_equal(variations._rescale(wide, 1.2), wide)


def test_curved_path_keeps_pose_speed_and_height():
    motion = procedural.clip("run_fast")
    curved = variations.curve_path(motion, np.random.default_rng(2))
    assert np.array_equal(curved.local[:, 1:], motion.local[:, 1:])
    assert np.allclose(curved.root[:, 1], motion.root[:, 1])
    assert np.allclose(np.linalg.norm(np.diff(curved.root, axis=0), axis=1),
                       np.linalg.norm(np.diff(motion.root, axis=0), axis=1))
    turned = np.diff(np.unwrap(rotations.heading_of(curved.local[:, 0])
                               - rotations.heading_of(motion.local[:, 0]))) * FPS
    assert 0.01 < np.abs(turned).max() <= variations.TURN_RATE + 1e-9


def straight_walk(speed, turn=0.0, frames=60, arm=0.0):
    heading = turn * np.arange(frames) / FPS
    motion = skeleton.rest_motion(frames)
    motion.local[:, 0] = rotations.about_axis("Y", heading)
    motion.local[:, skeleton.INDEX["LeftArm"]] = rotations.about_axis("Z", arm)
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = speed / FPS * np.stack([np.sin(middle), 0 * middle, np.cos(middle)], -1)
    motion.root[1:] += np.cumsum(steps, 0)
    return motion


def test_join_fades_speed_heading_and_pose():
    first, second = straight_walk(1.0, 0.5, arm=-1.0), straight_walk(4.0, -2.0, arm=1.2)
    overlap = variations.OVERLAP_FRAMES
    joined = variations.join(first, timing.turn(second, 2.0))
    assert len(joined) == len(first) + len(second) - overlap
    assert np.allclose(joined.root[:45], first.root[:45])
    assert np.allclose(joined.local[:45], first.local[:45])
    speed = np.linalg.norm(np.diff(joined.root, axis=0), axis=1) * FPS
    assert np.allclose(speed[:44], 1.0) and np.allclose(speed[61:], 4.0)
    steepest = 1.5 / overlap                      # of a smooth step over `overlap` frames
    assert np.abs(np.diff(speed)).max() <= 3.0 * steepest + 1e-9
    heading = np.unwrap(rotations.heading_of(joined.local[:, 0]))
    rate = np.diff(heading) * FPS
    assert np.allclose(rate[:44], 0.5) and np.allclose(rate[61:], -2.0)
    assert np.abs(np.diff(rate)).max() <= 2.5 * steepest + 1e-9
    # It walks where it looks, before, during and after.
    ahead = np.stack([np.sin(heading), np.cos(heading)], -1)
    path = np.diff(joined.root[:, [0, 2]], axis=0)
    path /= np.linalg.norm(path, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", path, ahead[1:]) > np.cos(2.0 / FPS)).all()
    arm = angular_speed(joined.local[:, skeleton.INDEX["LeftArm"]])
    assert np.isclose(arm.sum() / FPS, 2.2, atol=1e-6) and arm.max() <= 2.2 * FPS * steepest + 1e-9
    assert_rotations(joined)


@pytest.mark.parametrize("seed", range(12))
def test_random_clip_moves_like_a_person(seed):
    motion = procedural.clip(f"random_{seed}")
    assert len(motion) == procedural.RANDOM_FRAMES
    assert_rotations(motion)
    places = skeleton.joint_matrices(motion)[..., :3, 3]
    speed = np.diff(places, axis=0) * FPS
    acceleration = np.linalg.norm(np.diff(speed, axis=0) * FPS, axis=-1)
    # Limits from recorded people: the knee of a sprinter turns with 20-25 rad/s, the foot of a
    # recorded sideways run reaches 9 m/s and 250 m/s^2.
    assert angular_speed(motion.local).max() < 25
    assert np.linalg.norm(speed, axis=-1).max() < 11 and acceleration.max() < 250     # toes swing fastest
    assert retarget.lowest(motion).min() > -0.02 and places[:, 0, 1].max() < skeleton.HIP_HEIGHT + 0.3


def test_random_clips_are_reproducible_differ_and_use_every_segment():
    first, again = procedural.clip("random_7"), procedural.clip("random_7")
    assert np.array_equal(first.local, again.local) and np.array_equal(first.root, again.root)
    assert np.abs(first.root - procedural.clip("random_8").root).max() > 0.1
    assert len(procedural.clip("random_7", 90)) == 90
    scripts = [random_script.script(seed) for seed in range(40)]
    kinds = {kind for _, events, _ in scripts for kind, _, _ in events}
    assert kinds == {"jump", "kick_left", "kick_right"}
    for name in gait.PARAMETERS:
        values = {keys[name] for _, _, script in scripts for _, keys in script}
        assert len(values) > 3, name
    for bad in ("random_", "random_x", "random_-1", "walk"):
        with pytest.raises(ValueError, match="no procedural clip"):
            procedural.clip(bad)


def test_random_script_never_changes_a_parameter_faster_than_allowed():
    for seed in range(20):
        _, _, keys = random_script.script(seed)
        for (t0, a), (t1, b) in zip(keys, keys[1:]):
            for name, limit in random_script.CHANGE.items():
                assert 1.5 * abs(b[name] - a[name]) <= limit * (t1 - t0) + 1e-9


def test_legs_come_from_the_clips_they_are_taken_of():
    body, left, right = (procedural.clip(name) for name in ("walk_weave", "kicks", "run_fast"))
    mixed = variations.with_legs_of(body, left, right)
    frames = min(map(len, (body, left, right)))
    assert len(mixed) == frames and np.array_equal(mixed.root, body.root[:frames])
    for name, joint in skeleton.INDEX.items():
        leg = name.endswith(("Leg", "Foot", "ToeBase"))
        source = (left if name.startswith("Left") else right) if leg else body
        assert np.array_equal(mixed.local[:, joint], source.local[:frames, joint]), name


def test_leaning_tilts_the_pelvis_and_spares_the_legs():
    motion = procedural.clip("run_turn_walk")
    leaned = [variations.lean(motion, np.random.default_rng(seed)) for seed in range(40)]
    again = variations.lean(motion, np.random.default_rng(3))
    assert np.array_equal(again.local, leaned[3].local)

    def pitch(m):
        up = variations.split_heading(m.local[:, 0])[1][..., 1]
        return np.degrees(np.arctan2(up[:, 2], up[:, 1]))

    means = [np.mean(pitch(m) - pitch(motion)) for m in leaned]
    assert min(means) < -5 and max(means) > 30
    thigh = skeleton.INDEX["LeftUpLeg"]
    for m, mean in zip(leaned, means):
        assert_rotations(m)
        turned = rotations.angle_between(m.local[:, 0] @ m.local[:, thigh], motion.local[:, 0] @ motion.local[:, thigh])
        tilted = rotations.angle_between(m.local[:, 0], motion.local[:, 0])
        assert (turned <= 0.5 * tilted + 0.03).all()    # a thigh keeps half of its place at least
        extra = np.radians(2 * variations.LEAN_WAVER) * 2 * np.pi * variations.OFFSET_HERTZ[1]
        assert np.abs(angular_speed(m.local[:, 0]) - angular_speed(motion.local[:, 0])).max() < extra


def test_lifted_legs_go_up_to_where_dancers_hold_them_and_no_faster_than_a_kick():
    motion = procedural.clip("walk_weave")
    lifted = [variations.lift_legs(motion, np.random.default_rng(seed)) for seed in range(40)]
    assert np.array_equal(variations.lift_legs(motion, np.random.default_rng(3)).local, lifted[3].local)
    legs = [skeleton.INDEX[side + name] for side in ("Left", "Right") for name in ("UpLeg", "Leg")]
    others = [joint for joint in skeleton.INDEX.values() if joint not in legs]

    def angles(m):
        """Of each thigh from hanging straight down from the hips, degrees [T, 2]."""
        return np.degrees(np.arccos(np.clip(m.local[:, [legs[0], legs[2]], 1, 1], -1, 1)))

    highest = np.array([angles(m).max() for m in lifted])
    assert angles(motion).max() < 55 < 90 < highest.max() < 130 and (highest > 60).mean() > 0.7
    for m in lifted:
        assert_rotations(m)
        assert np.array_equal(m.root, motion.root) and np.array_equal(m.local[:, others], motion.local[:, others])
        assert np.array_equal(m.local[0], motion.local[0])
        assert angular_speed(m.local).max() < 25
        assert (angles(m) > 60).all(1).sum() == 0       # one leg at a time: the other one stands
