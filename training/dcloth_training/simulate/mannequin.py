"""The mannequin: a body mesh with skin weights, grown from a few capsules.

The capsules' distance fields are blended smoothly and meshed with surface nets, then every
vertex is pulled onto the surface. Skin weights start as "nearest limb" and are diffused along
the mesh, so they never leak through the gap between the legs. Needs numpy and scipy only.
"""
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..motion.skeleton import HIP_HEIGHT, INDEX, NAMES

CELL = 0.0265                 # grid spacing in metres: about 3,400 vertices
LIMB_SHARPNESS = 0.008        # metres: scale of the blend of limbs with each other and the trunk
TRUNK_SHARPNESS = 0.016       # metres: softer, or the trunk's capsules show as rings
TRUNK = ("Hips", "Chest")
WEIGHT_STEPS = 14             # diffusion steps of the skin weights
MAX_INFLUENCES = 4

# joint, from, to (metres, hips at the origin, left side only), radius at both ends.
LIMBS = (
    ("Hips", (-0.058, 0.005, 0.0), (0.058, 0.005, 0.0), 0.117, 0.117),
    ("Hips", (-0.062, -0.045, -0.035), (0.062, -0.045, -0.035), 0.088, 0.088),
    ("Hips", (-0.045, 0.125, 0.004), (0.045, 0.125, 0.004), 0.092, 0.092),
    ("Chest", (-0.052, 0.235, 0.006), (0.052, 0.235, 0.006), 0.098, 0.098),
    ("Chest", (-0.075, 0.345, 0.004), (0.075, 0.345, 0.004), 0.104, 0.104),
    ("Chest", (-0.135, 0.455, -0.022), (0.135, 0.455, -0.022), 0.062, 0.062),
    ("Neck", (0.0, 0.460, -0.020), (0.0, 0.560, -0.004), 0.056, 0.050),
    ("Neck", (0.0, 0.612, 0.022), (0.0, 0.690, 0.002), 0.074, 0.098),
    ("LeftUpLeg", (0.094, -0.020, -0.004), (0.090, -0.160, 0.000), 0.088, 0.076),
    ("LeftUpLeg", (0.090, -0.160, 0.000), (0.085, -0.4215, 0.004), 0.076, 0.056),
    ("LeftLeg", (0.085, -0.4215, 0.004), (0.085, -0.540, -0.014), 0.056, 0.055),
    ("LeftLeg", (0.085, -0.540, -0.014), (0.085, -0.815, -0.008), 0.055, 0.037),
    ("LeftFoot", (0.085, -0.838, -0.028), (0.085, -0.850, 0.050), 0.040, 0.037),
    ("LeftFoot", (0.085, -0.850, 0.050), (0.090, -0.855, 0.125), 0.040, 0.031),
    ("LeftArm", (0.170, 0.474, -0.024), (0.458, 0.4796, -0.024), 0.057, 0.042),
    ("LeftForeArm", (0.458, 0.4796, -0.024), (0.717, 0.4796, -0.024), 0.043, 0.029),
    ("LeftHand", (0.725, 0.4796, -0.022), (0.820, 0.4760, -0.018), 0.033, 0.027),
)
# Arms and head never hold up a skirt, and arms that brush it tangle it: not collided with. A garment
# with sleeves says otherwise (garment.Garment.not_colliding).
NOT_COLLIDING = tuple(n for n in NAMES if "Arm" in n or "Hand" in n or n == "Neck")


@dataclass
class Mannequin:
    """vertices [b, 3] m, faces [f, 3] outward, weights [b, J] rows sum to 1, collider [b] bool."""
    vertices: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    collider: np.ndarray


def _all_limbs():
    for joint, a, b, ra, rb in LIMBS:
        yield joint, np.array(a), np.array(b), ra, rb
        if joint.startswith("Left"):
            flip = np.array([-1.0, 1.0, 1.0])
            yield joint.replace("Left", "Right"), flip * a, flip * b, ra, rb


def _limb_distance(points, a, b, ra, rb):
    """Signed distance to a capsule whose radius runs linearly from ra to rb (close to exact)."""
    along = b - a
    t = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - a - t[:, None] * along, axis=1) - (ra + (rb - ra) * t)


def distances(points):
    """Distance of points [n, 3] (bind space, hips at the origin) to each joint's limbs [n, J]."""
    out = np.full((len(points), len(NAMES)), np.inf)
    for joint, a, b, ra, rb in _all_limbs():
        column = INDEX[joint]
        out[:, column] = np.minimum(out[:, column], _limb_distance(points, a, b, ra, rb))
    return out


def surface_distance(points):
    """Smooth union of all limbs (exponential blend), soles cut flat on the ground. [n]

    Left and right limbs each blend with the trunk but not with each other: blended thighs would
    grow a web between them that no cloth can enter.
    """
    def blended(wanted, sharpness):
        total = np.zeros(len(points))
        for joint, a, b, ra, rb in _all_limbs():
            if wanted(joint):
                distance = _limb_distance(points, a, b, ra, rb)
                total += np.exp(-np.clip(distance, -0.3, 0.6) / sharpness)
        return -sharpness * np.log(np.maximum(total, 1e-300))

    trunk = blended(lambda joint: joint in TRUNK, TRUNK_SHARPNESS)
    sides = [np.exp(-np.stack([trunk, blended(
        lambda joint, other=other: joint not in TRUNK and not joint.startswith(other),
        LIMB_SHARPNESS)]) / LIMB_SHARPNESS).sum(0) for other in ("Left", "Right")]
    return np.maximum(-LIMB_SHARPNESS * np.log(np.maximum(sides[0], sides[1])),
                      -(points[:, 1] + HIP_HEIGHT))


def _gradient(points, step=1e-4):
    columns = []
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = step
        columns.append(surface_distance(points + shift) - surface_distance(points - shift))
    g = np.stack(columns, -1)
    return g / np.maximum(np.linalg.norm(g, axis=1, keepdims=True), 1e-12)


def _surface_nets():
    """One vertex a cell the surface crosses, one quad a grid edge it crosses."""
    half = np.array([0.90, 0.0, 0.22])
    xs = (np.arange(-int(half[0] / CELL) - 1, int(half[0] / CELL) + 1) + 0.5) * CELL
    ys = np.arange(-HIP_HEIGHT - 1.5 * CELL, 0.84, CELL)
    zs = np.arange(-0.20, 0.24, CELL)
    shape = (len(xs), len(ys), len(zs))
    corners = np.stack(np.meshgrid(xs, ys, zs, indexing="ij"), -1).reshape(-1, 3)
    field = surface_distance(corners).reshape(shape)
    inside = field < 0
    low = [slice(None, -1)] * 3
    number = sum(inside[tuple(slice(d, -1 + d or None) for d in corner)].astype(int)
                 for corner in np.ndindex(2, 2, 2))
    cells = (number > 0) & (number < 8)
    index = np.full(cells.shape, -1)
    index[cells] = np.arange(cells.sum())
    centres = np.argwhere(cells)
    vertices = np.stack([xs[centres[:, 0]], ys[centres[:, 1]], zs[centres[:, 2]]], -1) + CELL / 2
    quads = []
    for axis in range(3):
        here, there = list(low), list(low)
        here = [slice(None)] * 3
        there = [slice(None)] * 3
        here[axis], there[axis] = slice(None, -1), slice(1, None)
        a, b = inside[tuple(here)], inside[tuple(there)]
        for outward, crossing in ((True, a & ~b), (False, ~a & b)):
            for edge in np.argwhere(crossing):
                u, v = np.zeros(3, int), np.zeros(3, int)
                u[(axis + 1) % 3], v[(axis + 2) % 3] = 1, 1
                quad = [index[tuple(edge - u - v)], index[tuple(edge - v)],
                        index[tuple(edge)], index[tuple(edge - u)]]
                quads.append(quad if outward else quad[::-1])
    return vertices, np.array(quads)


def _neighbour_mean(quads, count):
    """Row-stochastic matrix [b, b] that averages each vertex over its quad-edge neighbours."""
    a, b = quads.reshape(-1), np.roll(quads, -1, axis=1).reshape(-1)
    ones = np.ones(len(a))
    graph = sparse.coo_matrix((ones, (a, b)), (count, count)).tocsr()
    graph = ((graph + graph.T) > 0).astype(np.float64)
    return sparse.diags(1.0 / np.asarray(graph.sum(1)).ravel()) @ graph


def mannequin(not_colliding=NOT_COLLIDING):
    """Build the mannequin in bind pose; `not_colliding` joints are left out of the collider."""
    vertices, quads = _surface_nets()
    mean = _neighbour_mean(quads, len(vertices))
    for _ in range(6):  # alternate even spacing and exact position
        vertices = 0.5 * vertices + 0.5 * (mean @ vertices)
        for _ in range(3):
            vertices = vertices - surface_distance(vertices)[:, None] * _gradient(vertices)

    weights = np.zeros((len(vertices), len(NAMES)))
    weights[np.arange(len(vertices)), np.argmin(distances(vertices), 1)] = 1.0
    for _ in range(WEIGHT_STEPS):
        weights = 0.5 * weights + 0.5 * (mean @ weights)
    smallest_kept = np.sort(weights, axis=1)[:, -MAX_INFLUENCES][:, None]
    weights = np.where((weights >= smallest_kept) & (weights > 0.01), weights, 0.0)
    weights /= weights.sum(1, keepdims=True)

    bare = weights[:, [INDEX[n] for n in not_colliding]].sum(1)
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)
    vertices = vertices + np.array([0.0, HIP_HEIGHT, 0.0])
    return Mannequin(vertices, faces, weights, bare < 0.5)


def collider_mesh(body):
    """The collided part of the body: vertex numbers [k] and faces [g, 3] into them."""
    keep = np.flatnonzero(body.collider)
    renumber = np.full(len(body.vertices), -1, dtype=np.int32)
    renumber[keep] = np.arange(len(keep))
    return keep, renumber[body.faces[body.collider[body.faces].all(1)]]
