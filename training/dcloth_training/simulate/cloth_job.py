"""One simulation: motion in, cloth vertices out."""
import dataclasses
import time
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .. import metrics, raster
from ..motion import skeleton
from . import body as parts
from . import crossings, settings, solver

PIN_NEIGHBOURS = 4
ROUNDED = 0.006         # m
PUT_ON_FRAMES, HANG_FRAMES = 45, 120     # slowly, without layers; then as in a simulation
PUT_ON = {"max_speed": 1.5, "layer_thickness": 0.0}


class SimulationError(RuntimeError):
    """The solver failed, or what it returned is not cloth."""


@dataclass
class Result:
    cloth: np.ndarray       # [T, n, 3] m, the recorded frames
    matrices: np.ndarray    # [T, J, 4, 4] world matrices of those frames
    seconds: float          # solver wall time
    wind: np.ndarray = None  # [T, 3] m/s of those frames; None: calm


def rest_lengths(garment):
    """Lengths [e] m without strain of metrics.edges_of(garment.faces), in the pattern; sewn edges: the mean of both."""
    edges = metrics.edges_of(garment.faces)
    number = {tuple(edge): k for k, edge in enumerate(edges.tolist())}
    total, count = np.zeros(len(edges)), np.zeros(len(edges))
    for k in range(3):
        ends = np.sort(garment.faces[:, [k, (k + 1) % 3]], axis=1)
        at = np.array([number[tuple(pair)] for pair in ends.tolist()])
        length = np.linalg.norm(garment.cloth.pattern[:, k] - garment.cloth.pattern[:, (k + 1) % 3], axis=1)
        np.add.at(total, at, length)
        np.add.at(count, at, 1)
    return total / count


def pin_weights(garment, figure):
    """Skin weights [p, J] of the pinned vertices: those of the skin beside them."""
    distance, nearest = cKDTree(figure.vertices).query(garment.vertices[garment.pinned], PIN_NEIGHBOURS)
    share = 1 / np.maximum(distance, 1e-4)
    weights = np.einsum("pk,pkj->pj", share, figure.weights[nearest])
    return weights / weights.sum(1, keepdims=True)


def collider(figure, garment):
    """What `garment` touches of `figure` in bind pose: vertices [b, 3], faces [f, 3], weights [b, J], part masks
    [b]."""
    faces, part = parts.cut_parts(figure)
    masks = np.zeros(len(figure.vertices), np.uint32)
    for number in range(len(parts.PARTS)):
        masks[np.unique(faces[part == number])] |= np.uint32(1 << number)
    masks &= np.bitwise_or.reduce(garment.touches)
    return figure.vertices, figure.faces, figure.weights, masks


def _rounded(figure):
    """The figure's vertices with feet and hands a little larger: cloth is held at its own vertices, and toes and
    fingers are thin enough to come through between them."""
    thin = figure.weights[:, parts.thin_joints(figure)].sum(1)
    normals = raster.vertex_normals(figure.vertices, figure.faces)
    return figure.vertices + ROUNDED * thin[:, None] * normals


def _run(motion, figure, garment, chosen, start, wind):
    matrices, bind = parts.joint_matrices(figure, motion), parts.bind_matrices(figure)
    faces, part = parts.cut_parts(figure)
    posed = skeleton.skin(_rounded(figure), figure.weights, bind, matrices)
    pins = np.flatnonzero(garment.pinned)
    path = skeleton.skin(garment.vertices[pins], pin_weights(garment, figure), bind, matrices)
    cloth = solver.run(start, garment.cloth, pins, path, solver.Body(faces, part, posed), matrices[:, 0, :3, 3], chosen,
                       wind, garment.touches)
    if len(cloth) < len(motion):
        raise SimulationError(f"the cloth came apart at frame {len(cloth)} of {len(motion)}")
    return cloth, matrices


def simulate(motion, figure, garment, record, chosen=None, wind=None):
    """Simulate `garment` on `figure` through `motion` and return the frames in `record` (0-based).

    The first frame is the T-pose, in any place and heading; chosen: settings, those of the garment's fabric when None;
    wind [T, 3] m/s in the world, None: calm.
    """
    began = time.monotonic()
    matrices = parts.joint_matrices(figure, motion[:1])[0]
    placed = matrices[0] @ np.linalg.inv(parts.bind_matrices(figure)[0])
    start = garment.vertices @ placed[:3, :3].T + placed[:3, 3]
    chosen = settings.of(garment.fabric, **garment.settings) if chosen is None else chosen
    cloth, matrices = _run(motion, figure, garment, chosen, start, wind)
    return Result(cloth[record], matrices[record], time.monotonic() - began, None if wind is None else wind[record])


def hung(garment, figure):
    """The garment as it hangs on the figure in bind pose, made symmetric where it has a mirror image.

    -> (Garment, m that it moves in the last frame, m by which it hung lopsided)."""
    chosen = settings.of(garment.fabric, **garment.settings)
    carefully = dict(PUT_ON)
    if not len(crossings.within(garment.vertices, garment.faces)):    # layers that start apart stay apart
        carefully["layer_thickness"] = chosen["layer_thickness"]
    slowly, _ = _run(parts.rest(figure, PUT_ON_FRAMES), figure, garment, {**chosen, **carefully}, garment.vertices,
                     None)
    worn = slowly[-1].astype(np.float64)
    cloth, _ = _run(parts.rest(figure, HANG_FRAMES), figure, garment, chosen, worn, None)
    drape = cloth[-1].astype(np.float64)
    reflected = drape if garment.mirror is None else drape[garment.mirror] * [-1, 1, 1]
    vertices = np.where(garment.pinned[:, None], garment.vertices, 0.5 * (drape + reflected))
    return (dataclasses.replace(garment, vertices=vertices),
            float(np.linalg.norm(cloth[-1] - cloth[-2], axis=1).mean()),
            float(np.linalg.norm(drape - reflected, axis=1).mean()))
