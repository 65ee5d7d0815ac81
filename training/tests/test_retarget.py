"""Recorded clips on the figure: what must carry over, feet on the ground, arms outside of the body."""
import numpy as np
import pytest
from scipy.spatial import cKDTree

from dcloth_training import figure, raster
from dcloth_training.motion import clearance, procedural, retarget, rotations, skeleton
from dcloth_training.motion.skeleton import INDEX


def recorded(frames=20, seed=0, spread=0.5):
    """A made-up recording of 15 joints: smooth random rotations."""
    generator = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / 30
    angles = spread * np.sin(t * generator.uniform(1, 4, 45) + generator.uniform(0, 6, 45)).reshape(frames, 15, 3)
    local = rotations.matrix_from_vector(angles)
    root = np.array([0, 0.88, 0]) + np.concatenate([0.3 * t, 0 * t, 0.7 * t], 1)
    return root, local


def world(local, names, parents):
    """World rotation of each joint {name: [T, 3, 3]}."""
    out = []
    for j, parent in enumerate(parents):
        out.append(local[:, j] if parent < 0 else out[parent] @ local[:, j])
    return dict(zip(names, out))


SOURCE_PARENTS = [-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 0, 12, 13]


def test_every_recorded_joint_keeps_its_rotation_in_the_world():
    root, local = recorded()
    motion = retarget.onto_figure(root, local)
    before = world(local, retarget.NAMES, SOURCE_PARENTS)
    after = world(motion.local, skeleton.NAMES, skeleton.PARENTS)
    for name, there in (("Hips", "Hips"), ("Chest", "Spine2"), ("Neck", "Head"), ("LeftArm", "LeftArm"),
                        ("RightHand", "RightHand"), ("LeftLeg", "LeftLeg"), ("RightFoot", "RightFoot")):
        assert np.abs(before[name] - after[there]).max() < 1e-9, name
    # The back bends evenly, the shoulder takes a part of the arm's way alone.
    assert np.abs(motion.local[:, INDEX["Spine"]] - motion.local[:, INDEX["Spine2"]]).max() < 1e-12
    assert rotations.angle_between(motion.local[:, INDEX["LeftShoulder"]], np.eye(3)).max() < 0.7


def test_rest_is_rest_and_stands_on_the_ground():
    motion = retarget.onto_figure(np.array([[0.0, 0.881416, 0]]), np.tile(np.eye(3), (1, 15, 1, 1)))
    assert np.abs(motion.local - np.eye(3)).max() < 1e-12
    assert abs(motion.root[0, 1] - skeleton.HIP_HEIGHT) < 0.003 and abs(retarget.lowest(motion)[0]) < 1e-9


def test_a_step_is_as_many_legs_long_as_it_was():
    root, local = recorded()
    motion = retarget.onto_figure(root, np.tile(np.eye(3), (len(root), 15, 1, 1)))
    legs = (skeleton.THIGH_LENGTH + skeleton.SHIN_LENGTH) / (0.421546 + 0.409870)
    assert np.allclose(motion.root[-1, [0, 2]] - motion.root[0, [0, 2]], legs * (root[-1] - root[0])[[0, 2]])


def test_a_clip_that_sinks_or_floats_is_put_on_the_ground():
    for lift in (-0.1, 0.3):
        motion = procedural.clip("walk_start_stop")
        motion = retarget.on_floor(skeleton.Motion(motion.root + [0, lift, 0], motion.local))
        height = retarget.lowest(motion)
        assert -0.02 < height.min() and np.percentile(height, 5) < 0.001


def test_a_raised_arm_lifts_the_shoulder_and_sides_are_mirror_images():
    angles = np.linspace(-1.4, 1.4, 9)
    left, right = (retarget.shoulder(rotations.about_axis("Z", sign * angles), sign) for sign in (1, -1))
    lifted = np.arctan2(left[:, 1, 0], left[:, 0, 0])
    assert (np.diff(lifted) > 0).all() and 0.3 < lifted[-1] < 0.5 and -0.3 < lifted[0] < -0.1
    flip = np.diag([-1.0, 1.0, 1.0])
    assert np.allclose(flip @ left @ flip, right)


def test_toes_stay_flat_while_the_heel_lifts():
    pitch = np.linspace(-0.5, 0.5, 5)
    toes = retarget.toes(rotations.about_axis("X", pitch))
    back = -np.arctan2(toes[:, 2, 1], toes[:, 2, 2])
    assert np.allclose(back[:3], 0) and (np.diff(back[2:]) > 0.1).all() and back[-1] < 0.5


def deepest_in_trunk(motion, every=5):
    """How deep an arm (from its middle on) lies under the skin of trunk and thighs, metres, a frame [k]."""
    body, bind = figure.load(), skeleton.bind_matrices()
    nearest = np.argmax(body.weights, 1)
    trunk = np.isin(nearest, [INDEX[n] for n in ("Hips", "Spine", "Spine1", "Spine2", "LeftUpLeg", "RightUpLeg")])
    arm = np.isin(nearest, [INDEX[s + n] for s in ("Left", "Right") for n in ("Arm", "ForeArm", "Hand")])
    arm &= np.abs(body.vertices[:, 0]) > 0.29
    out = []
    for points in skeleton.skin(body.vertices, body.weights, bind, skeleton.joint_matrices(motion)[::every]):
        normals = raster.vertex_normals(points, body.faces)[trunk]
        distance, at = cKDTree(points[trunk]).query(points[arm], distance_upper_bound=0.12)
        near = np.isfinite(distance)
        out.append(((points[trunk][at[near]] - points[arm][near]) * normals[at[near]]).sum(1).max(initial=0))
    return np.array(out)


def hanging(angle, frames=30):
    """Arms that swing down to the side, `angle` radians below level, and stay."""
    motion = skeleton.rest_motion(frames)
    way = np.clip(np.arange(frames) / 15, 0, 1)
    for side, sign in (("Left", -1), ("Right", 1)):
        motion.local[:, INDEX[side + "Arm"]] = rotations.about_axis("Z", sign * angle * way)
    return motion


@pytest.mark.parametrize("angle", [1.57, 1.65])
def test_an_arm_that_would_hang_inside_the_body_hangs_beside_it(angle):
    motion = hanging(angle)
    cleared = clearance.clear(motion)
    assert deepest_in_trunk(motion).max() > 0.02 and deepest_in_trunk(cleared).max() < 0.008
    turned = rotations.angle_between(motion.local, cleared.local)
    arms = [INDEX["LeftArm"], INDEX["RightArm"]]
    assert turned[:, arms].max() < 0.7 and np.delete(turned, arms, 1).max() < 1e-6
    assert (np.abs(np.diff(turned[:, arms], axis=0)) < 0.1).all()          # smoothly
    product = cleared.local @ np.swapaxes(cleared.local, -1, -2)
    assert np.abs(product - np.eye(3)).max() < 1e-9


def test_arms_that_are_clear_are_left_alone():
    motion = hanging(0.9)
    assert np.abs(clearance.clear(motion).local - motion.local).max() < 1e-9


def test_clearing_is_the_same_on_both_sides():
    cleared = clearance.clear(hanging(1.6)).local
    flip = np.diag([-1.0, 1.0, 1.0])
    assert np.abs(flip @ cleared[:, INDEX["LeftArm"]] @ flip - cleared[:, INDEX["RightArm"]]).max() < 0.05


def crossed_legs(motion, every=5):
    """How deep one leg lies inside the other below the middle of the thigh, metres, a frame [k]."""
    body, bind = figure.load(), skeleton.bind_matrices()
    nearest = np.argmax(body.weights, 1)
    left, right = (np.isin(nearest, [INDEX[side + n] for n in ("UpLeg", "Leg")]) for side in ("Left", "Right"))
    low, out = body.vertices[:, 1] < 0.72, []
    for points in skeleton.skin(body.vertices, body.weights, bind, skeleton.joint_matrices(motion)[::every]):
        normals = raster.vertex_normals(points, body.faces)[right]
        distance, at = cKDTree(points[right]).query(points[left & low], distance_upper_bound=0.12)
        near = np.isfinite(distance)
        out.append(((points[right][at[near]] - points[left & low][near]) * normals[at[near]]).sum(1).max(initial=0))
    return np.array(out)


def test_legs_that_would_cross_stand_beside_each_other():
    motion = skeleton.rest_motion(30)
    way = np.clip(np.arange(30) / 15, 0, 1)
    for side, sign in (("Left", -1), ("Right", 1)):
        motion.local[:, INDEX[side + "UpLeg"]] = rotations.about_axis("Z", sign * 0.14 * way)
    cleared = clearance.clear(motion)
    assert crossed_legs(motion).max() > 0.02 and crossed_legs(cleared).max() < 0.006
    turned = rotations.angle_between(motion.local, cleared.local)
    thighs = [INDEX["LeftUpLeg"], INDEX["RightUpLeg"]]
    assert turned[:, thighs].max() < 0.2 and np.delete(turned, thighs, 1).max() < 1e-6
    assert np.abs(turned[:, thighs[0]] - turned[:, thighs[1]]).max() < 0.02


def test_standing_and_walking_legs_are_left_alone():
    for motion in (skeleton.rest_motion(4), procedural.clip("walk_start_stop")):
        legs = [INDEX[side + "UpLeg"] for side in ("Left", "Right")]
        assert rotations.angle_between(clearance.clear(motion).local, motion.local)[:, legs].max() < 0.02


def flexion(motion):
    """Degrees [T, 2] between each thigh's and shin's direction."""
    at = skeleton.joint_matrices(motion)[:, :, :3, 3]
    found = []
    for side in ("Left", "Right"):
        hip, knee, foot = (at[:, skeleton.INDEX[side + name]] for name in ("UpLeg", "Leg", "Foot"))
        found.append(np.degrees(np.arccos(np.clip(((knee - hip) * (foot - knee)).sum(1) / np.linalg.norm(
            knee - hip, axis=1) / np.linalg.norm(foot - knee, axis=1), -1, 1))))
    return np.stack(found, 1)


def test_a_knee_bends_no_further_than_a_persons():
    motion = skeleton.rest_motion(40)
    bend = np.radians(np.linspace(0, 178, 40))
    motion.local[:, skeleton.INDEX["LeftLeg"]] = rotations.about_axis("X", bend)
    assert flexion(motion)[-1, 0] > 177
    cleared = clearance.clear(motion)
    wanted = np.minimum(np.degrees(bend), np.degrees(clearance.KNEE))
    assert np.abs(flexion(cleared)[:, 0] - wanted).max() < 0.5
    below = bend < clearance.KNEE - 1e-3
    leg = skeleton.INDEX["LeftLeg"]
    assert (cleared.local[below][:, leg] == motion.local[below][:, leg]).all()
