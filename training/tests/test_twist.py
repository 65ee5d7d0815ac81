"""Limbs turned about their bones: joints stay, legs stay, only their frames turn."""
import numpy as np

from dcloth_training import twist
from dcloth_training.motion import procedural, skeleton

BIND = skeleton.bind_matrices()
LEGS = [skeleton.INDEX[n] for n in ("Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg")]


def turned(deviation, seed=3):
    matrices = skeleton.joint_matrices(procedural.clip("walk_swagger")[:60])
    limbs = twist.chains(LEGS, skeleton.PARENTS.tolist(), 0)
    return matrices, twist.twist(matrices, BIND, limbs, deviation, 30.0, np.random.default_rng(seed))


def test_chains_are_thigh_and_shin_of_each_side():
    names = [[tuple(skeleton.NAMES[j] for j in pair) for pair in chain]
             for chain in twist.chains(LEGS, skeleton.PARENTS.tolist(), 0)]
    assert sorted(names) == [[("LeftUpLeg", "LeftLeg"), ("LeftLeg", "LeftFoot")],
                             [("RightUpLeg", "RightLeg"), ("RightLeg", "RightFoot")]]


def test_bones_and_joints_stay_where_they_are():
    matrices, out = turned(0.5)
    assert np.allclose(out[:, :, :3, 3], matrices[:, :, :3, 3], atol=1e-12)
    others = [j for j in range(len(BIND)) if j not in LEGS[1:]]
    assert np.array_equal(out[:, others], matrices[:, others])
    inverse = np.linalg.inv(BIND)
    for joint, child in ((LEGS[1], LEGS[2]), (LEGS[3], LEGS[4])):
        axis = BIND[child, :3, 3] - BIND[joint, :3, 3]
        along = [(m[:, joint] @ inverse[joint])[:, :3, :3] @ axis for m in (matrices, out)]
        assert np.allclose(*along, atol=1e-12)
    assert np.allclose(out[..., :3, :3] @ np.swapaxes(out[..., :3, :3], -1, -2), np.eye(3), atol=1e-9)


def test_turn_is_smooth_seeded_and_of_the_size_asked_for():
    matrices, first = turned(np.radians(25))
    assert np.array_equal(first, turned(np.radians(25))[1])
    assert np.allclose(matrices, turned(0.0)[1], atol=1e-12)
    angles = []
    for seed in range(200):
        _, out = turned(np.radians(25), seed)
        change = np.swapaxes(matrices[:, LEGS[1], :3, :3], -1, -2) @ out[:, LEGS[1], :3, :3]
        angles.append(np.arccos(np.clip((np.trace(change, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    angles = np.array(angles)
    # Constant and wave: 25 sqrt(0.5^2 + 0.5^2) = 18 degrees rms; 200 seeds give it to about a tenth.
    assert 14 < np.degrees(np.sqrt((angles ** 2).mean())) < 22
    # The wave's fastest turn: 2 pi 0.8 / 30 of its amplitude a frame.
    assert np.degrees(np.abs(np.diff(angles, axis=1)).max()) < 25 * 0.7 * 4 * 2 * np.pi * 0.8 / 30 * 1.3
