"""From MakeHuman's base mesh to a T-pose: shape parameters, joints, skin weights, and the cavities closed."""
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from .makehuman import MIRRORED, NAMES, PARENTS

INDEX = {name: i for i, name in enumerate(NAMES)}
_FLIP = np.array([-1.0, 1.0, 1.0])
WEIGHT_STEPS = 2               # diffusion of the rig's weights over the cage, half a step each
MAX_INFLUENCES = 4
SHOULDER_RAISE = 8.0           # degrees that a level arm takes of the shoulder joint


@dataclass(frozen=True)
class Shape:
    """Parameters of a body. height_m; weight and muscle from -1 (least) over 0 (average) to 1 (most); proportions 0 to
    1 (ideal); abduction: degrees that the legs stand apart in the T-pose, more where the thighs are wide."""
    height_m: float = 1.68
    weight: float = 0.0
    muscle: float = 0.0
    proportions: float = 0.5
    abduction: float = 0.0


SHAPES = {"average": Shape(), "slim": Shape(weight=-0.6, muscle=-0.2),
          "heavy": Shape(weight=0.75, muscle=-0.2, abduction=4.0)}


def _blend(shape):
    """{(muscle word, weight word): share} of the corners that a shape lies between."""
    def share(value, low, high):
        return {f"average{low}": 1 - abs(value),
                (f"max{low}" if value > 0 else f"min{low}"): abs(value)} if high else {}
    muscles, weights = share(shape.muscle, "muscle", True), share(shape.weight, "weight", True)
    return {(m, w): a * b for m, a in muscles.items() for w, b in weights.items() if a * b > 0}


def positions(source, shape):
    """The shaped base mesh [m, 3] metres, in MakeHuman's A-pose."""
    targets = {f"macrodetails/{people}-female-young": 1 / 3 for people in ("african", "asian", "caucasian")}
    for (muscle, weight), part in _blend(shape).items():
        targets[f"macrodetails/universal-female-young-{muscle}-{weight}"] = part
        targets[f"macrodetails/proportions/female-young-{muscle}-{weight}-idealproportions"] = part * shape.proportions
    plain = source.positions(targets)
    taller = sum(part * source.target(f"macrodetails/height/female-young-{muscle}-{weight}-maxheight")
                 for (muscle, weight), part in _blend(shape).items())

    def height(points):
        return np.ptp(points[:source.count, 1])

    return plain + taller * (shape.height_m - height(plain)) / (height(plain + taller) - height(plain))


def _onto(start, end):
    """The shortest rotation that turns vector `start` to `end`."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis = np.cross(a, b)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + k + k @ k / (1 + a @ b)


def _about(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]] if axis == "X" else [[c, -s, 0], [s, c, 0], [0, 0, 1]])


def t_pose(source, points, weights, abduction):
    """-> skin [n, 3] and joints [J, 3] in T-pose: arms level along x with palms down, legs straight, soles on y = 0."""
    at = np.array([source.joint(name, points) for name in NAMES])
    at = 0.5 * (at + at[MIRRORED] * _FLIP)
    finger = {name: source.joint(f"LeftHand{name}1", points) for name in ("Index", "Middle", "Pinky")}

    def bone(first, second):
        return at[INDEX[second]] - at[INDEX[first]]

    turn = np.tile(np.eye(3), (len(NAMES), 1, 1))
    side = np.array([1.0, 0.0, 0.0])
    shoulder = _about("Z", np.radians(SHOULDER_RAISE))
    upper = _onto(shoulder @ bone("LeftArm", "LeftForeArm"), side) @ shoulder
    fore = _onto(upper @ bone("LeftForeArm", "LeftHand"), side) @ upper
    hand = _onto(fore @ (finger["Middle"] - at[INDEX["LeftHand"]]), side) @ fore
    across = hand @ (finger["Index"] - finger["Pinky"])
    roll = np.arctan2(across[1], across[2])             # palms down: the index finger in front
    for name, rotation in (("Shoulder", shoulder), ("Arm", _about("X", 0.2 * roll) @ upper),
                           ("ForeArm", _about("X", 0.5 * roll) @ fore), ("Hand", _about("X", roll) @ hand)):
        turn[INDEX["Left" + name]] = rotation
    down = np.array([np.sin(np.radians(abduction)), -np.cos(np.radians(abduction)), 0.0])
    turn[INDEX["LeftUpLeg"]] = _onto(bone("LeftUpLeg", "LeftLeg"), down)
    turn[INDEX["LeftLeg"]] = _onto(bone("LeftLeg", "LeftFoot"), down)
    for j, name in enumerate(NAMES):
        if name.startswith("Left"):
            turn[MIRRORED[j]] = np.diag(_FLIP) @ turn[j] @ np.diag(_FLIP)
    moved = at.copy()
    for j, parent in enumerate(PARENTS):
        if parent >= 0:
            moved[j] = moved[parent] + turn[parent] @ (at[j] - at[parent])
    skin = np.einsum("nj,njk->nk", weights,
                     np.einsum("jab,njb->nja", turn, points[:source.count, None] - at) + moved)
    skin = 0.5 * (skin + skin[source.mirror] * _FLIP)
    origin = np.array([0.0, skin[:, 1].min(), moved[0, 2]])
    return skin - origin, moved - origin


def neighbours(faces, count):
    """Adjacency [n, n] of a mesh' edges, ones."""
    a, b = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    graph = sparse.coo_matrix((np.ones(len(a)), (a, b)), (count, count)).tocsr()
    return ((graph + graph.T) > 0).astype(float)


def mean_of_neighbours(graph):
    return sparse.diags(1.0 / np.asarray(graph.sum(1)).ravel()) @ graph


def few_influences(weights):
    """At most MAX_INFLUENCES joints a vertex; rows sum to 1."""
    least = np.sort(weights, axis=1)[:, -MAX_INFLUENCES][:, None]
    weights = np.where((weights >= least) & (weights > 0.004), weights, 0.0)
    return weights / weights.sum(1, keepdims=True)


def filled(points, inner, graph, smooth=False):
    """`points` with those in `inner` (bool) spread over the opening that they close.

    Like a soap film (harmonic), or `smooth`: bent like a thin plate that goes on as its surroundings do (biharmonic).
    """
    laplace = (sparse.diags(np.asarray(graph.sum(1)).ravel()) - graph).tocsr()
    if smooth:
        laplace = (laplace @ laplace).tocsr()
    rows = laplace[np.flatnonzero(inner)]
    out = points.copy()
    out[inner] = linalg.spsolve(rows[:, np.flatnonzero(inner)].tocsc(),
                                -rows[:, np.flatnonzero(~inner)] @ points[~inner])
    return out


def subdivision(faces, count):
    """Catmull and Clark's rule for a closed mesh of quads: matrix [m, n] and the quads of the finer mesh [4 q, 4]."""
    quads = len(faces)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    edges, of_side = np.unique(edges, axis=0, return_inverse=True)
    of_side = of_side.reshape(quads, 4)
    rows = np.repeat(np.arange(quads), 4)
    middle = sparse.coo_matrix((np.full(4 * quads, 0.25), (rows, faces.reshape(-1))), (quads, count)).tocsr()
    beside = sparse.coo_matrix((np.ones(4 * quads), (of_side.reshape(-1), rows)), (len(edges), quads)).tocsr()
    ends = sparse.coo_matrix((np.ones(2 * len(edges)), (np.repeat(np.arange(len(edges)), 2), edges.reshape(-1))),
                             (len(edges), count)).tocsr()
    on_edge = 0.25 * (ends + beside @ middle)
    valence = np.asarray(ends.sum(0)).ravel()
    at = sparse.coo_matrix((np.ones(4 * quads), (faces.reshape(-1), rows)), (count, quads)).tocsr()
    own = sparse.diags(1.0 / valence ** 2) @ (at @ middle + ends.T @ ends) + sparse.diags((valence - 3) / valence)
    whole = sparse.vstack([own, middle, on_edge]).tocsr()
    face, edge = count + np.arange(quads), count + quads + of_side
    finer = np.stack([np.stack([faces[:, i], edge[:, i], face, edge[:, i - 1]], 1) for i in range(4)], 1)
    return whole, finer.reshape(-1, 4)
