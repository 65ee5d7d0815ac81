"""Legs that are turned about their own axes: what another skeleton says of the same motion.

Recordings differ by 10-40 degrees in how far thigh and shin joints are turned about the bone, since
capture systems and retargeting choose it freely; scripted motion does not turn them at all. A leg
is round, so cloth hangs the same: poses may be turned while the truth stays. Without this a network
takes a skeleton's habit for motion (recorded clips it never saw: 3-6 times the error of scripted).
"""
import numpy as np

SLOW_SHARE = 0.5        # of the turn that changes over the clip
SLOW_HERTZ = (0.1, 0.8)
OWN_SHARE = 0.2         # a joint's own turn beside what it shares with the one above


def _about(axis, angle):
    """Rotations [T, 3, 3] about a unit axis by angle [T] rad (Rodrigues)."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return (np.eye(3) + np.sin(angle)[:, None, None] * k
            + (1 - np.cos(angle))[:, None, None] * (k @ k))


def _curve(frames, rate, generator):
    """A turn [frames] of deviation 1: a constant and a slow wave."""
    hertz, phase = generator.uniform(*SLOW_HERTZ), generator.uniform(0, 2 * np.pi)
    wave = np.sin(2 * np.pi * hertz * np.arange(frames) / rate + phase)
    return (1 - SLOW_SHARE) * generator.standard_normal() + SLOW_SHARE * 1.4 * wave \
        * generator.standard_normal()


def twist(matrices, bind, chains, deviation, rate, generator):
    """Joint matrices [T, J, 4, 4] with every joint of each chain turned about its bone.

    chains: lists of (joint, child), from the body outwards; the bone runs from a joint to its
    child in the bind pose [J, 4, 4]. deviation: rad, of the turn a chain shares. Positions of
    joints stay.
    """
    out = np.array(matrices, np.float64)
    inverse = np.linalg.inv(bind)
    for chain in chains:
        shared = _curve(len(out), rate, generator)
        for joint, child in chain:
            axis = bind[child, :3, 3] - bind[joint, :3, 3]
            axis = axis / np.linalg.norm(axis)
            angle = deviation * (shared + OWN_SHARE * _curve(len(out), rate, generator))
            turn = np.tile(np.eye(4), (len(out), 1, 1))
            turn[:, :3, :3] = _about(axis, angle)
            pivot = bind[joint, :3, 3]
            turn[:, :3, 3] = pivot - turn[:, :3, :3] @ pivot
            out[:, joint] = out[:, joint] @ inverse[joint] @ turn @ bind[joint]
    return out


def chains(feature_joints, parents, hips):
    """The limbs among the feature joints: [(joint, child), ...] from the hips' children outwards.

    Joints without exactly one child have no bone to turn about.
    """
    children = {j: [c for c, p in enumerate(parents) if p == j] for j in range(len(parents))}
    wanted = set(feature_joints) - {hips}
    out = []
    for first in sorted(j for j in wanted if parents[j] not in wanted):
        chain, joint = [], first
        while joint in wanted and len(children[joint]) == 1:
            chain.append((joint, children[joint][0]))
            joint = children[joint][0]
        if chain:
            out.append(chain)
    return out
