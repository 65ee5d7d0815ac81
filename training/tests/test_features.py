"""Heading frame, features, mirror images and standardising, against independent loops."""
import numpy as np
import pytest
import torch

from conftest import MIRROR, bind_pose, poses, rigid, rotation
from dcloth_training import features

JOINTS = [0, 1, 2, 3, 4]
RATE = 30.0


def by_hand(matrices, bind, wind=None):
    """Features of every tick, written as scalars from NETWORK.md's text; with `wind` root motion "air"."""
    rows, last, before, places = [], 0.0, None, []
    for pose in matrices:
        relative = [pose[j] @ np.linalg.inv(bind[j]) for j in range(len(bind))]
        x, z = relative[0][0, 0], relative[0][2, 0]
        if (x * x + z * z) ** 0.5 >= 0.2:
            last = np.arctan2(-z, x)
        heading = rotation([0, 1, 0], last)
        assert np.allclose(heading[:, 0], [np.cos(last), 0, -np.sin(last)])
        row = [v for j in JOINTS for v in (heading.T @ relative[j][:3, :3]).ravel()]
        here = pose[0, :3, 3]
        velocity, turn = np.zeros(3), 0.0
        if before is not None:
            turn = last - before[1]
            while turn > np.pi:
                turn -= 2 * np.pi
            while turn < -np.pi:
                turn += 2 * np.pi
            velocity = (here - before[0]) * RATE
        places.append(here)
        if wind is None:
            row += [*(heading.T @ velocity), turn * RATE]
        else:
            row += [*(heading.T @ (wind[len(rows)] - velocity)), turn * RATE]
            change = places[-1] - 2 * places[-2] + places[-3] if len(places) > 2 else np.zeros(3)
            row += [*(heading.T @ change * RATE * RATE)]
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


@pytest.mark.parametrize("seed", range(3))
def test_air_features_match_the_written_definition(seed):
    generator = np.random.default_rng(seed)
    matrices, bind = poses(50, generator), bind_pose()
    spin = np.stack([rigid(rotation([0, 1, 0], 0.4 * t), [0.002 * t * t, 0, 0]) for t in range(50)])
    matrices = spin[:, None] @ matrices
    wind = generator.normal(0, 4, (50, 3))
    got = features.raw(matrices, bind, 0, JOINTS, RATE, "air", wind)
    assert got.shape == (50, 45 + 7)
    # As above, with 900 times a second difference.
    assert np.abs(got - by_hand(matrices, bind, wind)).max() < 1e3 * 900 * np.finfo(float).eps
    assert np.abs(got[2:, -3:]).max() > 1 and np.abs(got[:, -7:-4] - wind).max() > 1
    # Velocities and the yaw rate are those of the older kind where no wind blows.
    calm = features.raw(matrices, bind, 0, JOINTS, RATE, "air")
    hips = features.raw(matrices, bind, 0, JOINTS, RATE, "hips")
    assert np.allclose(calm[:, :-3] * ([1] * 45 + [-1, -1, -1, 1]), hips, atol=1e-12)


def test_air_of_the_first_ticks():
    matrices = poses(4, np.random.default_rng(2))
    wind = np.tile([3.0, -1.0, 2.0], (4, 1))
    got = features.raw(matrices, bind_pose(), 0, JOINTS, RATE, "air", wind)[:, -7:]
    turned = features.heading_frames(matrices, bind_pose(), 0)[0][0].T @ wind[0]
    assert np.allclose(got[0], [*turned, 0, 0, 0, 0])
    assert np.all(got[1, 4:] == 0) and np.abs(got[1, :4] - got[0, :4]).max() > 0.1
    assert np.abs(got[2, 4:]).max() > 1e-3
    still = np.repeat(matrices[:1], 4, 0)
    assert np.all(features.raw(still, bind_pose(), 0, JOINTS, RATE, "air")[:, -7:] == 0)


def test_running_through_air_is_standing_in_wind():
    matrices = poses(40, np.random.default_rng(8))
    velocity = np.array([1.5, 0.0, -4.0])
    running = matrices.copy()
    running[:, :, :3, 3] += velocity * np.arange(40)[:, None, None] / RATE
    through = features.raw(running, bind_pose(), 0, JOINTS, RATE, "air")
    against = features.raw(matrices, bind_pose(), 0, JOINTS, RATE, "air", np.tile(-velocity, (40, 1)))
    assert np.allclose(through[1:], against[1:], atol=1e-9)


def test_a_window_begins_as_after_a_reset():
    matrices, wind = poses(30, np.random.default_rng(9)), np.random.default_rng(9).normal(0, 4, (30, 3))
    for root in ("hips", "air", "none"):
        whole = features.raw(matrices, bind_pose(), 0, JOINTS, RATE, root, wind)
        later = features.raw(matrices[11:], bind_pose(), 0, JOINTS, RATE, root, wind[11:])
        heading = features.heading_frames(matrices, bind_pose(), 0)[0]
        assert np.allclose(features.begin(whole[11:].copy(), heading[11].T @ wind[11]), later, atol=1e-9)
        rest = features.at_rest(whole.copy())
        assert np.all(rest[:, :45] == whole[:, :45]) and np.all(rest[:, 45:] == 0)


def test_root_motion_of_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="'hip', allowed are none, hips, air"):
        features.raw(poses(3, np.random.default_rng(1)), bind_pose(), 0, [0], RATE, "hip")


def test_features_ignore_where_the_character_stands_and_faces():
    matrices = poses(30, np.random.default_rng(1))
    moved = rigid(rotation([0, 1, 0], 2.0), [5, 0.3, -2]) @ matrices
    a, b = (features.raw(m, bind_pose(), 0, JOINTS, RATE) for m in (matrices, moved))
    assert np.allclose(a, b, atol=1e-10)


def test_without_root_motion_there_are_nine_numbers_a_joint():
    got = features.raw(poses(3, np.random.default_rng(1)), bind_pose(), 0, [0, 3], RATE, "none")
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
    wind = np.random.default_rng(6).normal(0, 4, (40, 3))
    air = features.raw(matrices, bind, 0, JOINTS, RATE, "air", wind)[:, 45:]
    image = features.raw(mirrored, bind, 0, JOINTS, RATE, "air", features.mirror_wind(wind))[:, 45:]
    assert np.allclose(image, air * [-1, 1, 1, -1, -1, 1, 1], atol=1e-9)


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
