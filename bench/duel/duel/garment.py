"""A garment as its rivals get it: cut again from the same pattern with fewer vertices, hung, bound to the drawn mesh.

A case is one safetensors file that dcloth_duel reads (case.h). `proxy.*` is the simulated cloth: the same panels,
seams, pleats, hems and pinned vertices as the truth's, triangles as large as `count` vertices allow. `capsules` are
tapered capsules fitted to the figure's skin; `body.*` is the skin with fewer triangles, for the training solver;
`chains.*` are spring bones, and how the garment's vertices hang on them and on joints. `draw.*` bind the garment's
vertices to the proxy.
"""
import dataclasses
import json

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from dcloth_training import figure as figures, metrics, safetensors_io
from dcloth_training.figure import decimate
from dcloth_training.motion import skeleton
from dcloth_training.simulate import body as parts, cloth_job, garment as garments, settings

TRUNK_CAPSULES = 3      # of a joint of the trunk, side by side; limbs have one
ABOVE = 0.03            # m over the garment's upper edge: skin further up is not touched
BODY_SPACING = 0.045    # m between vertices of the reduced skin
NEAR_FACES = 24         # triangles of the proxy that a drawn vertex looks at
SPRING_SHARES = ((8, 3), (16, 4), (24, 6))    # chains around the garment, bones in each


def cut(name, count, figure):
    """The garment with about `count` vertices (10 %), as it hangs in bind pose."""
    spacing, worn = None, garments.GARMENTS[name](figure)
    for _ in range(8):
        spacing = (spacing or 0.0104) * np.sqrt(len(worn.vertices) / count)
        worn = garments.GARMENTS[name](figure, made={}, spacing=spacing)
        if abs(len(worn.vertices) / count - 1) < 0.1:
            break
    # As of a user's own garment: coarse triangles clear the body too.
    thickness = max(settings.SOLVER["thickness"], min(0.3 * spacing, 0.008))
    worn = dataclasses.replace(worn, settings={**worn.settings, "thickness": thickness})
    return cloth_job.hung(worn, figure)[0]


def _normals(vertices, faces):
    return metrics.vertex_normals(vertices[None], faces)[0]


def _barycentric(points, corners):
    """Weights [.., 3] of the points' projections onto the planes of triangles [.., 3, 3], held near the triangle."""
    a, b, c = (corners[..., k, :] for k in range(3))
    u, v, w = b - a, c - a, points - a
    uu, uv, vv, wu, wv = ((x * y).sum(-1) for x, y in ((u, u), (u, v), (v, v), (w, u), (w, v)))
    det = np.maximum(uu * vv - uv * uv, 1e-18)
    one, two = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
    weights = np.clip(np.stack([1 - one - two, one, two], -1), -0.25, 1.25)
    return weights / weights.sum(-1, keepdims=True)


def bind(drawn, vertices, faces):
    """Drawn vertices [n, 3] on the proxy: corners [n, 3], weights [n, 3], offset [n] m along the mixed normals."""
    normals, nearest = _normals(vertices, faces), cKDTree(vertices[faces].mean(1)).query(drawn, NEAR_FACES)[1]
    corners, normal = vertices[faces[nearest]], normals[faces[nearest]]
    offset = np.zeros(nearest.shape)
    for _ in range(6):     # triangles raised by the offset, then the offset above where the vertex projects
        weights = _barycentric(drawn[:, None], corners + offset[..., None, None] * normal)
        base, up = ((weights[..., None] * of).sum(-2) for of in (corners, normal))
        offset = ((drawn[:, None] - base) * up).sum(-1) / np.maximum((up * up).sum(-1), 1e-9)
    miss = np.linalg.norm(base + offset[..., None] * up - drawn[:, None], axis=-1) + 0.3 * np.abs(offset)
    best = miss.argmin(1), np.arange(len(drawn))
    return faces[nearest[best[::-1]]], weights[best[::-1]], offset[best[::-1]]


def _distance(points, capsule):
    """Signed distance in m of points [n, 3] to a tapered capsule [8]: end, end, radius, radius."""
    a, b = capsule[:3], capsule[3:6]
    t = np.clip(((points - a) @ (b - a)) / max((b - a) @ (b - a), 1e-12), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - (capsule[6] + t * (capsule[7] - capsule[6]))


def capsules(figure, worn):
    """Tapered capsules [k, 8] in bind pose and their joints [k]: least squares over the skin that the garment may
    touch."""
    touched = np.bitwise_or.reduce(worn.touches)
    part, nearest = parts.owners(figure), figure.weights.argmax(1)
    found, joints = [], []
    for joint in range(len(figure.names)):
        skin = figure.vertices[(nearest == joint) & (figure.vertices[:, 1] < worn.vertices[:, 1].max() + ABOVE)]
        if not touched >> part[joint] & 1 or len(skin) < 20:
            continue
        middle, spread = skin.mean(0), np.ptp(skin, axis=0)
        if part[joint]:
            along = np.eye(3)[spread.argmax()] * 0.4 * spread.max()
            start = [np.r_[middle - along, middle + along, np.full(2, 0.5 * np.sort(spread)[1])]]
        else:
            start = []
            for k in range(TRUNK_CAPSULES):
                side = middle + [(k / (TRUNK_CAPSULES - 1) - 0.5) * 0.5 * spread[0], 0, 0]
                start.append(np.r_[side - [0, 0.25 * spread[1], 0], side + [0, 0.25 * spread[1], 0],
                                   np.full(2, 0.35 * spread[2])])

        def misses(flat, skin=skin):
            return np.min([_distance(skin, capsule) for capsule in flat.reshape(-1, 8)], axis=0)
        fit = least_squares(misses, np.concatenate(start), loss="soft_l1", f_scale=0.01, max_nfev=60)
        found += list(fit.x.reshape(-1, 8))
        joints += [joint] * len(start)
    found = np.array(found)
    found[:, 6:] = np.maximum(found[:, 6:], 0.01)
    return found, np.array(joints, np.int32)


def reduced_body(figure, worn):
    """The skin that the garment may touch, with fewer triangles: positions [b, 3], faces [f, 3], part [f], weights."""
    count = len(figure.vertices)
    kept, faces = decimate.collapse(figure.vertices, figure.faces, np.full(count, BODY_SPACING), np.full(count, 0.01),
                                    np.zeros(count, bool), np.zeros(count, int), 600, strictly=False)
    number = np.full(count, -1)
    number[kept] = np.arange(len(kept))
    small = dataclasses.replace(figure, vertices=cloth_job._rounded(figure)[kept], faces=number[faces].astype(np.int32),
                                weights=figure.weights[kept])
    faces, part = parts.cut_parts(small)
    touched = np.bitwise_or.reduce(worn.touches)
    near = (touched >> part.astype(np.uint32) & 1).astype(bool)
    near &= small.vertices[faces][..., 1].min(1) < worn.vertices[:, 1].max() + ABOVE
    used, faces = np.unique(faces[near], return_inverse=True)
    return small.vertices[used], faces.reshape(-1, 3), part[near], small.weights[used]


def chains(worn, plain, hips, count, bones):
    """Spring bones that hang around the garment from its pinned edge, and the garment's skin weights.

    plain [n, J]: skin weights of what does not hang. -> joints [count, bones + 1, 3] in bind pose; bone [n, 4] and
    weight [n, 4] of each vertex: joints first, then chain by chain."""
    points, band = worn.vertices, worn.vertices[worn.pinned]
    low, centre, joints = band[:, 1].min(), band.mean(0) * [1, 0, 1], plain.shape[1]
    hangs = points[:, 1] < low
    away, y = points - centre, points[:, 1]
    angle = np.arctan2(away[:, 0], away[:, 2]) / (2 * np.pi) * count % count
    radius, floor = np.hypot(away[:, 0], away[:, 2]), y[hangs].min()
    level = np.linspace(low, floor, bones + 1)
    chain = np.zeros((count, bones + 1, 3))
    for k in range(count):
        beside = np.abs((angle - k + count / 2) % count - count / 2) < 0.5
        turn = 2 * np.pi * k / count
        for i, height in enumerate(level):
            ring = beside & hangs & (np.abs(y - height) < 0.6 * (low - floor) / bones)
            r = radius[ring].mean() if ring.any() else np.hypot(*(chain[k, i - 1] - centre)[[0, 2]])
            chain[k, i] = centre + [r * np.sin(turn), height, r * np.cos(turn)]
    bone, weight = np.argsort(-plain, axis=1)[:, :4], np.sort(plain, axis=1)[:, :-5:-1].copy()
    left, down = np.floor(angle).astype(int) % count, (low - y) / (low - floor) * bones - 0.5
    upper = np.clip(np.floor(down).astype(int), -1, bones - 1)
    lower, beside, below = np.minimum(upper + 1, bones - 1), angle - np.floor(angle), np.clip(down - upper, 0, 1)
    for c, (at, row) in enumerate(((left, upper), (left, lower), ((left + 1) % count, upper),
                                   ((left + 1) % count, lower))):
        own = np.where(row < 0, hips, joints + at * bones + row)
        share = (beside if c > 1 else 1 - beside) * (below if c % 2 else 1 - below)
        bone[hangs, c], weight[hangs, c] = own[hangs], share[hangs]
    return chain, bone, weight / weight.sum(1, keepdims=True)


def write(path, name, count, bundle):
    """The case of `count` vertices. bundle: the training bundle, whose template is the drawn mesh."""
    tensors, metadata = safetensors_io.read(bundle)
    figure, drawn, faces = figures.load(), tensors["template.positions"].astype(np.float64), tensors["template.faces"]
    worn, whole = cut(name, count, figure), garments.GARMENTS[name](figure)
    whole = dataclasses.replace(whole, vertices=drawn)
    corners, weights, offset = bind(drawn, worn.vertices, worn.faces)
    shapes, joints = capsules(figure, whole)
    skin, skin_faces, part, skin_weights = reduced_body(figure, whole)
    plain = np.zeros((len(drawn), len(figure.names)))
    named = [figure.names.index(bone) for bone in json.loads(metadata["bones"])]
    plain[:, named] = tensors["static.initial_weights"]
    chosen = settings.of(worn.fabric, **worn.settings)
    out = {
        "bind": skeleton.bind_matrices(), "draw.rest": drawn, "draw.faces": faces, "draw.corners": corners,
        "draw.weights": weights, "draw.offset": offset, "draw.nearest": cKDTree(drawn).query(worn.vertices)[1],
        "proxy.positions": worn.vertices, "proxy.faces": worn.faces, "proxy.pattern": worn.cloth.pattern,
        "proxy.edges": metrics.edges_of(worn.faces), "proxy.rest_length": cloth_job.rest_lengths(worn),
        "proxy.mass_scale": worn.cloth.mass_scale, "proxy.bend_scale": worn.cloth.bend_scale,
        "proxy.crease": worn.cloth.crease, "proxy.touches": worn.touches.astype(np.int32),
        "proxy.pins": np.flatnonzero(worn.pinned), "proxy.pin_weights": cloth_job.pin_weights(worn, figure),
        "capsules": shapes, "capsule_joints": joints, "body.positions": skin, "body.faces": skin_faces,
        "body.part": part, "body.weights": skin_weights,
        "solver.settings": np.array([chosen[name] for name, _ in _solver_fields()]),
    }
    for chain_count, bones in SPRING_SHARES:
        key = f"chains.{chain_count}x{bones}"
        out[key], out[key + ".bone"], out[key + ".weight"] = chains(whole, plain, figure.names.index("Hips"),
                                                                    chain_count, bones)
    out = {key: np.ascontiguousarray(value, np.int32 if value.dtype.kind in "iu" else np.float32)
           for key, value in out.items()}
    safetensors_io.write(path, out, {"joint_names": json.dumps(list(figure.names)), "garment": name,
                                     "vertices": str(len(worn.vertices))})


def _solver_fields():
    from dcloth_training.simulate import solver
    return solver.Settings._fields_
