"""One simulation: motion in, cloth vertices out."""
import time
from dataclasses import dataclass

import numpy as np

from ..motion import skeleton
from . import settings, solver

# Parts of the body that cloth touches one by one: crossing legs must not swallow what is between. A garment may
# say which of its vertices touch which parts (garment.Garment.touches): bit p is PARTS[p].
PARTS = (("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "LeftShoulder", "RightShoulder"),
         ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"), ("RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"),
         ("LeftArm", "LeftForeArm", "LeftHand"), ("RightArm", "RightForeArm", "RightHand"))
OVERLAP = 2      # rings of vertices


class SimulationError(RuntimeError):
    """The solver failed, or what it returned is not cloth."""


@dataclass
class Result:
    cloth: np.ndarray       # [T, n, 3] m, the recorded frames
    matrices: np.ndarray    # [T, J, 4, 4] world matrices of those frames
    seconds: float          # solver wall time


def pin_paths(garment, matrices):
    """Where the garment's pinned vertices go: rigidly with the joints they follow. [T, p, 3]"""
    points = garment.vertices[garment.pinned]
    weights = np.eye(len(skeleton.NAMES))[garment.pin_joints[garment.pinned]]
    return skeleton.skin(points, weights, skeleton.bind_matrices(), matrices)


def body_parts(weights, faces):
    """Bit masks [b] of the parts in PARTS each body vertex belongs to, grown over their borders.

    A cloth vertex does not touch a part's outermost vertices (it would be pushed off a plane that
    ends there), so parts overlap by OVERLAP rings.
    """
    nearest = np.argmax(weights, axis=1)
    masks = np.zeros(len(weights), np.uint32)
    for bit, part in enumerate(PARTS):
        inside = np.isin(nearest, [skeleton.INDEX[name] for name in part])
        for _ in range(OVERLAP):
            inside[faces[inside[faces].any(1)]] = True
        masks |= np.where(inside, 1 << bit, 0).astype(np.uint32)
    return masks


def collided(body, garment):
    """Which vertices [b] of a figure.Figure `garment` collides with; bool."""
    bare = [skeleton.INDEX[name] for name in garment.not_colliding]
    return body.weights[:, bare].sum(1) < 0.5


def collider_mesh(body, garment):
    """The collided part of the body: vertex numbers [k] and faces [g, 3] into them."""
    there = collided(body, garment)
    renumber = np.cumsum(there, dtype=np.int32) - 1
    return np.flatnonzero(there), renumber[body.faces[there[body.faces].all(1)]]


def skin_parts(body, garment):
    """Bit masks [b] of the parts each vertex of the whole skin belongs to; 0 where nothing collides with it."""
    keep, faces = collider_mesh(body, garment)
    masks = np.zeros(len(body.vertices), np.uint32)
    masks[keep] = body_parts(body.weights[keep], faces)
    return masks


def collider(body, garment):
    """What `garment` touches of `body` in bind pose: vertices [b, 3], faces [f, 3], weights [b, J], part masks [b]."""
    keep, faces = collider_mesh(body, garment)
    weights = body.weights[keep]
    return body.vertices[keep], faces, weights, body_parts(weights, faces)


def simulate(motion, body, garment, record, chosen=None):
    """Simulate `garment` on `body` through `motion` and return the frames in `record` (0-based)."""
    began = time.monotonic()
    matrices = skeleton.joint_matrices(motion)
    vertices, faces, weights, masks = collider(body, garment)
    posed = skeleton.skin(vertices, weights, skeleton.bind_matrices(), matrices)
    start = matrices[0, 0] @ np.linalg.inv(skeleton.bind_matrices()[0])
    rest = garment.vertices @ start[:3, :3].T + start[:3, 3]
    chosen = dict(chosen or settings.GROUND_TRUTH)
    chosen["tether"] *= garment.slack
    cloth = solver.run(rest, garment.faces, np.flatnonzero(garment.pinned),
                       pin_paths(garment, matrices), faces, posed, masks,
                       matrices[:, 0], chosen, garment.yoke, garment.touches)
    if len(cloth) < len(motion):
        raise SimulationError(f"the cloth came apart at frame {len(cloth)} of {len(motion)}")
    return Result(cloth[record], matrices[record], time.monotonic() - began)
