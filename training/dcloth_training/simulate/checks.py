"""Is a simulated clip cloth? Stretch, penetration and speed, with limits."""
import dataclasses

import numpy as np
from scipy.spatial import cKDTree

from ..motion import skeleton
from . import cloth_job
from ..raster import vertex_normals

# Beyond these a clip is refused. Set from clips that were looked at, see README.md.
MAX_STRETCH_P99 = 1.6          # edge length over rest length, 99th percentile of a frame
MAX_SPEED = 40.0               # m/s, any vertex
MAX_PENETRATION = 0.12         # metres, any vertex
MAX_SUNKEN_SHARE = 0.02        # of all vertices in a frame, deeper than SUNKEN
SUNKEN = 0.010


def edges(faces):
    """Unique undirected edges [e, 2] of triangles [c, 3]."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def penetration(cloth, body_points, body_normals):
    """Depth [n] of cloth vertices behind the tangent plane of the nearest collider vertex, m.

    An estimate, good to about 1 mm (the sagitta of a limb between collider vertices).
    """
    distance, nearest = cKDTree(body_points).query(cloth, distance_upper_bound=0.15)
    found = np.isfinite(distance)
    depth = np.zeros(len(cloth))
    near = nearest[found]
    depth[found] = np.einsum("ij,ij->i", body_points[near] - cloth[found], body_normals[near])
    return np.maximum(depth, 0.0)


def _touching(garment, parts):
    """[(cloth vertex numbers, collider vertex numbers)]: free cloth and what it touches.

    Depth in a part that a vertex is not collided with means nothing: an armpit's cloth lies inside the trunk wherever
    the arm does.
    """
    free = ~garment.pinned
    if garment.touches is None:
        return [(np.flatnonzero(free), np.arange(len(parts)))]
    return [(np.flatnonzero(free & (garment.touches == mask)), np.flatnonzero(parts & mask))
            for mask in np.unique(garment.touches[free])]


def measure(result, body, garment, every=3):
    """Numbers of a simulated clip; all finite or the clip is broken."""
    pairs = edges(garment.faces)
    rest = np.linalg.norm(garment.vertices[pairs[:, 0]] - garment.vertices[pairs[:, 1]], axis=1)
    vertices, faces, weights, masks = cloth_job.collider(body, garment)
    frames = np.unique(np.r_[np.arange(0, len(result.cloth), every), len(result.cloth) - 1])
    posed = skeleton.skin(vertices, weights, skeleton.bind_matrices(), result.matrices[frames])
    touch = _touching(garment, masks)
    stretch_p99, stretch_max, depth_max, sunken = 0.0, 0.0, 0.0, 0.0
    for frame, points in zip(frames, posed):
        cloth = result.cloth[frame].astype(np.float64)
        ratio = np.linalg.norm(cloth[pairs[:, 0]] - cloth[pairs[:, 1]], axis=1) / rest
        normals = vertex_normals(points, faces)
        depth = np.concatenate([penetration(cloth[own], points[part], normals[part]) for own, part in touch])
        stretch_p99 = max(stretch_p99, float(np.percentile(ratio, 99)))
        stretch_max = max(stretch_max, float(ratio.max()))
        depth_max = max(depth_max, float(depth.max()))
        sunken = max(sunken, float((depth > SUNKEN).mean()))
    speed = np.linalg.norm(np.diff(result.cloth, axis=0), axis=-1) * skeleton.FPS
    return {"stretch_p99": round(stretch_p99, 3), "stretch_max": round(stretch_max, 3),
            "penetration_max_mm": round(1e3 * depth_max, 2), "sunken_share": round(sunken, 5),
            "speed_max": round(float(speed.max(initial=0)), 2),
            "speed_mean": round(float(speed.mean()) if speed.size else 0.0, 3),
            "settled_mm_per_frame": round(float(speed[0].mean() * 1e3 / skeleton.FPS)
                                          if len(speed) else 0.0, 3)}


def refuse(numbers):
    """Why a clip must not be used, or None."""
    limits = (("stretch_p99", MAX_STRETCH_P99), ("speed_max", MAX_SPEED),
              ("penetration_max_mm", 1e3 * MAX_PENETRATION), ("sunken_share", MAX_SUNKEN_SHARE))
    for name, limit in limits:
        if not numbers[name] <= limit:  # also catches NaN
            return f"{name} is {numbers[name]}, limit {limit:g}"
    return None


def drapes(result, body, garment):
    """(result, [P] bool): a file of drapes with the good ones alone. Each is a pose of its own, settled by itself:
    what one knee does to its cloth says nothing about the others. Speed means nothing between them."""
    def one(pose):
        part = slice(pose, pose + 1)
        return dataclasses.replace(result, cloth=result.cloth[part], matrices=result.matrices[part])

    good = np.array([refuse(measure(one(pose), body, garment)) is None for pose in range(len(result.cloth))], bool)
    return dataclasses.replace(result, cloth=result.cloth[good], matrices=result.matrices[good]), good
