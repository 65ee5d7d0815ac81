"""Heading frame, features, mirror images and standardising, against independent loops."""
import numpy as np
import pytest
import torch

from conftest import MIRROR, bind_pose, poses, rigid, rotation
from dcloth_training import features

JOINTS = [0, 1, 2, 3, 4]
RATE = 30.0


def by_hand(matrices, bind):
    """Features of every tick, written as scalars from NETWORK.md's text."""
    rows, last, before = [], 0.0, None
    for pose in matrices:
        relative = [pose[j] @ np.linalg.inv(bind[j]) for j in range(len(bind))]
        x, z = relative[0][0, 0], relative[0][2, 0]
        if (x * x + z * z) ** 0.5 >= 0.2:
            last = np.arctan2(-z, x)
        heading = rotation([0, 1, 0], last)
        assert np.allclose(heading[:, 0], [np.cos(last), 0, -np.sin(last)])
        row = [v for j in JOINTS for v in (heading.T @ relative[j][:3, :3]).ravel()]
        here = pose[0, :3, 3]
        if before is None:
            row += [0, 0, 0, 0]
        else:
            turn = last - before[1]
            while turn > np.pi:
                turn -= 2 * np.pi
            while turn < -np.pi:
                turn += 2 * np.pi
            row += [*(heading.T @ (here - before[0]) * RATE), turn * RATE]
        before = (here.copy(), last)
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("seed", range(4))
def test_features_match_the_written_definition(seed):
    generator = np.random.default_rng(seed)
    matrices, bind = poses(50, generator), bind_pose()
    spin = np.stack([rigid(rotation([0, 1, 0], 0.4 * t), np.zeros(3)) for t in range(50)])
    matrices = spin[:, None] @ matrices     # crosses the +-180 degree seam of the yaw
    got = features.raw(matrices, bind, 0, JOINTS, RATE)
    # Products of matrices with entries below 4 and 30 times a difference: 1e3 roundings at most.
    assert np.abs(got - by_hand(matrices, bind)).max() < 1e3 * 30 * np.finfo(float).eps


def test_features_ignore_where_the_character_stands_and_faces():
    matrices = poses(30, np.random.default_rng(1))
    moved = rigid(rotation([0, 1, 0], 2.0), [5, 0.3, -2]) @ matrices
    a, b = (features.raw(m, bind_pose(), 0, JOINTS, RATE) for m in (matrices, moved))
    assert np.allclose(a, b, atol=1e-10)


def test_without_root_motion_there_are_nine_numbers_a_joint():
    got = features.raw(poses(3, np.random.default_rng(1)), bind_pose(), 0, [0, 3], RATE, False)
    assert got.shape == (3, 18)


def test_heading_survives_a_somersault():
    tumble = np.stack([rigid(rotation([1, 0, 0], a), [0, 1, 0]) for a in np.linspace(0, 7, 60)])
    facing = rigid(rotation([0, 1, 0], 0.7), np.zeros(3)) @ tumble
    _, _, yaw = features.heading_frames(facing[:, None], np.eye(4)[None], 0)
    assert np.allclose(yaw, 0.7)


def test_short_projection_keeps_the_last_heading_and_reset_means_identity():
    def roll(angle):    # about the facing axis: the left axis leaves the ground
        return rotation([0, 1, 0], 0.5) @ rotation([0, 0, 1], angle)
    limit = np.arccos(0.2)
    left = np.stack([roll(a)[:, 0] for a in (0.0, limit - 1e-6, limit + 1e-6, np.pi / 2)])
    left[2] = rotation([0, 1, 0], 1.0) @ left[2]
    assert np.allclose(features.headings(left), [0.5] * 4)
    assert np.allclose(features.headings(left[2:]), [0.0, 0.0])
    beyond = features.headings(np.stack([rotation([0, 1, 0], 1.0) @ left[1]]))
    assert np.allclose(beyond, [1.5])


def test_mirrored_motion_gives_mirrored_features():
    matrices, bind = poses(40, np.random.default_rng(5)), bind_pose()
    mirrored = features.mirror_pose(matrices, MIRROR)
    plain = features.raw(matrices, bind, 0, JOINTS, RATE)
    other = features.raw(mirrored, bind, 0, JOINTS, RATE)
    flip = np.diag([-1.0, 1, 1])
    expected = plain[:, :45].reshape(-1, 5, 3, 3)[:, MIRROR]
    assert np.allclose(other[:, :45], (flip @ expected @ flip).reshape(-1, 45), atol=1e-12)
    assert np.allclose(other[:, 45:], plain[:, 45:] * [-1, 1, 1, -1], atol=1e-10)
    assert np.allclose(features.mirror_pose(mirrored, MIRROR), matrices)


def test_standardise_clamps_to_the_widened_training_range():
    rows = np.array([[0.0, 5.0], [2.0, 5.0]])
    standard = features.fit_standard(rows)
    assert np.allclose(standard["low"], [-1.2, 0]) and np.allclose(standard["high"], [1.2, 0])
    layer = features.Standardise(**standard)
    got = layer(torch.tensor([[1.0, 5.0], [9.0, 6.0], [-9.0, 4.0], [2.1, 5.0]]).double())
    assert np.allclose(got, [[0, 0], [1.2, 0], [-1.2, 0], [1.1, 0]])


def test_a_vessel_adds_its_velocity_in_the_heading_frame():
    generator = np.random.default_rng(7)
    matrices, bind = poses(40, generator), bind_pose()
    spin = np.stack([rigid(rotation([0, 1, 0], 0.3 * t), np.array([0.02 * t, 0, 0.01 * t * t]))
                     for t in range(40)])
    matrices = spin[:, None] @ matrices
    world = np.array([2.0, -0.3, 1.0])                       # m/s
    aboard = matrices.copy()
    aboard[:, :, :3, 3] += world * np.arange(40)[:, None, None] / RATE
    rotation0 = features.heading_frames(matrices, bind, 0)[0][0]
    plain = features.raw(matrices, bind, 0, JOINTS, RATE)
    got = features.carried(plain, rotation0.T @ world, RATE)
    assert np.abs(got - features.raw(aboard, bind, 0, JOINTS, RATE)).max() < 1e-9
    assert np.abs(got - plain)[1:, -4:-1].max() > 1
