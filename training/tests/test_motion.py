"""Motion: BVH reader, forward kinematics, timing and the procedural clips."""
import numpy as np
import pytest

from dcloth_training.motion import bvh, gait, procedural, retarget, rotations, skeleton, timing


def bvh_text(frames=2, joint="Hips", channels="6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
             values="1 2 3 90 0 0 10 20 30"):
    rows = "\n".join([values] * frames)
    return (f"HIERARCHY\nROOT {joint}\n{{\n OFFSET 0 0 0\n CHANNELS {channels}\n JOINT Tip\n {{\n"
            f"  OFFSET 0 1 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {{\n"
            f"   OFFSET 0 1 0\n  }}\n }}\n}}\nMOTION\nFrames: {frames}\nFrame Time: 0.033333\n{rows}\n")


def write(tmp_path, text):
    path = tmp_path / "clip.bvh"
    path.write_text(text)
    return str(path)


def random_motion(frames, seed=0):
    generator = np.random.default_rng(seed)
    shape = (frames, len(skeleton.NAMES))
    local = np.stack([rotations.about_axis(a, generator.normal(0, 0.6, shape)) for a in "XYZ"])
    return skeleton.Motion(generator.normal(0, 1, (frames, 3)), local[0] @ local[1] @ local[2])


def test_bvh_reads_root_and_channel_order(tmp_path):
    clip = bvh.read(write(tmp_path, bvh_text()))
    assert clip.names == ["Hips", "Tip"] and list(clip.parents) == [-1, 0]
    assert np.allclose(clip.root, [[1, 2, 3]] * 2)
    # R = Rz(90): the x axis goes to y.
    assert np.allclose(clip.local[0, 0] @ [1, 0, 0], [0, 1, 0])
    c, s = np.cos(np.radians([10, 20, 30])), np.sin(np.radians([10, 20, 30]))
    z = np.array([[c[0], -s[0], 0], [s[0], c[0], 0], [0, 0, 1]])
    x = np.array([[1, 0, 0], [0, c[1], -s[1]], [0, s[1], c[1]]])
    y = np.array([[c[2], 0, s[2]], [0, 1, 0], [-s[2], 0, c[2]]])
    assert np.allclose(clip.local[1, 1], z @ x @ y)


HOSTILE = {
    "empty": "",
    "no motion": bvh_text().split("MOTION")[0],
    "no hierarchy": "MOTION\nFrames: 1\nFrame Time: 0.03\n1\n",
    "unclosed": bvh_text().replace("}\n}\nMOTION", "MOTION"),
    "two roots": bvh_text().replace("MOTION", "ROOT Other { }\nMOTION"),
    "joint twice": bvh_text().replace("JOINT Tip", "JOINT Hips"),
    "unknown channel": bvh_text(channels="1 Wrotation"),
    "repeated channel": bvh_text(channels="2 Xrotation Xrotation"),
    "seven channels": bvh_text(channels="7 Xrotation"),
    "offset not a number": bvh_text().replace("OFFSET 0 1 0", "OFFSET 0 x 0"),
    "offset nan": bvh_text().replace("OFFSET 0 1 0", "OFFSET 0 nan 0"),
    "too few values": bvh_text(values="1 2 3"),
    "value nan": bvh_text(values="nan 2 3 90 0 0 10 20 30"),
    "value text": bvh_text(values="a 2 3 90 0 0 10 20 30"),
    "no frames": bvh_text(frames=0),
    "huge frame count": bvh_text().replace("Frames: 2", "Frames: 999999999999"),
    "negative frame count": bvh_text().replace("Frames: 2", "Frames: -2"),
    "zero frame time": bvh_text().replace("0.033333", "0"),
    "deep": "HIERARCHY\n" + "".join(
        f"{'ROOT' if i == 0 else 'JOINT'} j{i} {{ OFFSET 0 0 0 CHANNELS 0\n" for i in range(5000)) + "MOTION\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_bvh_refuses(tmp_path, name):
    path = write(tmp_path, HOSTILE[name])
    with pytest.raises(bvh.BvhError) as caught:
        bvh.read(path)
    assert "clip.bvh" in str(caught.value)


def test_bvh_refuses_every_truncation_of_the_hierarchy(tmp_path):
    text = bvh_text()
    end, refused = text.index("MOTION"), 0
    for cut in range(0, end - 2, 3):
        with pytest.raises(bvh.BvhError):
            bvh.read(write(tmp_path, text[:cut] + text[end:]))
        refused += 1
    assert refused > 50


def test_read_motion_refuses_another_skeleton(tmp_path):
    with pytest.raises(bvh.BvhError, match="joints"):
        bvh.read_motion(write(tmp_path, bvh_text()))


def test_forward_kinematics_against_a_chain_of_4x4_products():
    motion = random_motion(3)
    matrices = skeleton.joint_matrices(motion)
    for frame in range(3):
        for j in range(len(skeleton.NAMES)):
            expected, at = np.eye(4), j
            while at >= 0:
                step = np.eye(4)
                step[:3, :3] = motion.local[frame, at]
                step[:3, 3] = motion.root[frame] if at == 0 else skeleton.OFFSETS[at]
                expected, at = step @ expected, skeleton.PARENTS[at]
            assert np.allclose(matrices[frame, j], expected, atol=1e-12)


def test_skinning_with_bind_pose_is_the_identity_and_follows_rigid_motion():
    generator = np.random.default_rng(1)
    points = generator.normal(size=(20, 3))
    weights = generator.random((20, len(skeleton.NAMES)))
    weights /= weights.sum(1, keepdims=True)
    bind = skeleton.bind_matrices()
    assert np.allclose(skeleton.skin(points, weights, bind, bind[None])[0], points)
    moved = bind.copy()
    moved[:, :3, 3] += [1, 2, 3]
    assert np.allclose(skeleton.skin(points, weights, bind, moved[None])[0], points + [1, 2, 3])


def test_slerp_and_quaternions():
    motion = random_motion(40, seed=2)
    first, second = motion.local[:20], motion.local[20:]
    assert np.allclose(rotations.matrix_from_quaternion(rotations.quaternion_from_matrix(first)), first)
    half = rotations.slerp(first, second, np.full(first.shape[:2], 0.5))
    whole = rotations.angle_between(first, second)
    assert np.allclose(rotations.angle_between(first, half), whole / 2, atol=1e-6)
    assert np.allclose(rotations.slerp(first, second, np.ones(first.shape[:2])), second)


def test_angles_have_the_same_bits_wherever_they_lie_in_memory():
    rng = np.random.default_rng(3)
    points = rng.standard_normal((5216, 3))
    first = rotations.arctan2(points[:, 0], points[:, 2])
    kept = []
    for _ in range(100):
        kept.append([np.zeros(rng.integers(1, 4000)) for _ in range(5)])
        moved = points.copy()
        assert np.array_equal(rotations.arctan2(moved[:, 0], moved[:, 2]), first)


def test_mirror_is_an_involution_and_reflects_joint_positions():
    motion = random_motion(4, seed=3)
    back = timing.mirror(timing.mirror(motion))
    assert np.allclose(back.local, motion.local) and np.allclose(back.root, motion.root)
    here = skeleton.joint_matrices(motion)[..., :3, 3]
    there = skeleton.joint_matrices(timing.mirror(motion))[..., :3, 3]
    assert np.allclose(there, here[:, skeleton.MIRROR] * [-1, 1, 1])


def test_ease_in_starts_from_standstill_and_ends_at_full_speed():
    root = np.zeros((60, 3))
    root[:, 2] = np.arange(60)
    eased = timing.ease_in(skeleton.Motion(root, random_motion(60).local), 12)
    speed = np.diff(eased.root[:, 2])
    assert speed[0] < 0.02 and np.allclose(speed[12:-1], 1.0)
    assert np.abs(np.diff(speed)).max() < 0.14 and len(eased) == 66


def test_loop_accumulates_root_motion_without_a_jump():
    walk = procedural.clip("walk_slow_fast")[:40]
    looped = timing.loop(walk, 100)
    assert len(looped) >= 100
    step = np.linalg.norm(np.diff(looped.root, axis=0), axis=1)
    assert step.max() < 1.6 * np.linalg.norm(np.diff(walk.root, axis=0), axis=1).max()
    turned = rotations.angle_between(looped.local[1:], looped.local[:-1])
    assert turned.max() < 2.0 * rotations.angle_between(walk.local[1:], walk.local[:-1]).max() + 0.2


def test_approach_ends_in_the_first_pose():
    motion = procedural.clip("jog_turns")[30:60]
    lead = timing.approach(motion, 10, 5)
    assert len(lead) == 16
    assert np.allclose(lead.local[-1], motion.local[0]) and np.allclose(lead.root[-1], motion.root[0])
    assert np.allclose(lead.local[0, 1:], np.eye(3))


@pytest.mark.parametrize("name", procedural.SCRIPTS)
def test_procedural_clip_is_smooth_and_stays_above_ground(name):
    motion = procedural.clip(name)
    assert 90 <= len(motion) <= 150
    spin = rotations.angle_between(motion.local[1:], motion.local[:-1]) * skeleton.FPS
    places = skeleton.joint_matrices(motion)[..., :3, 3]
    speed = np.diff(places, axis=0) * skeleton.FPS
    acceleration = np.linalg.norm(np.diff(speed, axis=0) * skeleton.FPS, axis=-1)
    assert np.isfinite(places).all()
    assert spin.max() < 25 and np.linalg.norm(speed, axis=-1).max() < 10 and acceleration.max() < 200
    assert retarget.lowest(motion).min() > -0.02


def test_procedural_clips_are_reproducible_and_seeds_differ():
    first, again = procedural.clip("walk_weave"), procedural.clip("walk_weave")
    other = procedural.clip("walk_weave", seed=99)
    assert np.array_equal(first.local, again.local)
    assert np.abs(first.root - other.root).max() > 0.01
    assert not set(procedural.HELD_OUT) & set(procedural.TRAINING)


def test_standing_feet_do_not_slide():
    still = {name: np.full(30, rest) for name, rest in gait.PARAMETERS.items()}
    places = skeleton.joint_matrices(gait.pose(still))[..., :3, 3]
    assert np.abs(places - places[:1]).max() < 1e-9
