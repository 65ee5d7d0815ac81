"""A whole small garment: a cone skirt of 504 vertices on a capsule body, untrained weights of sensible size, and
motion.

The truth is the skirt, plainly skinned, with a swing that lags behind the hips: wrong as cloth, right as test data.
"""
import json

import numpy as np

import safetensors_file

JOINTS = ["hips", "spine", "thigh_l", "shin_l", "thigh_r", "shin_r", "head"]
PARENTS = [-1, 0, 0, 2, 0, 4, 1]
OFFSETS = np.array([[0, 1.0, 0], [0, 0.25, 0], [0.1, -0.05, 0], [0, -0.42, 0], [-0.1, -0.05, 0], [0, -0.42, 0],
                    [0, 0.35, 0]])
BONES = ["hips", "thigh_l", "shin_l", "thigh_r", "shin_r"]
FEATURES = ["hips", "thigh_l", "shin_l", "thigh_r", "shin_r"]
RINGS, COLUMNS = 18, 28
VERTICES = RINGS * COLUMNS
K_SKELETON, K_MESH, HIDDEN = 12, 10, 24


def rotation(axis, angle):
    axis = np.asarray(axis, float)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def tube(radii, heights, center, columns):
    angle = 2 * np.pi * np.arange(columns) / columns
    rings = [np.stack([center[0] + r * np.sin(angle), np.full(columns, y), center[1] + r * np.cos(angle)], -1)
             for r, y in zip(radii, heights)]
    faces = []
    for ring in range(len(radii) - 1):
        for c in range(columns):
            a, b = ring * columns + c, ring * columns + (c + 1) % columns
            faces += [[a, a + columns, b], [b, a + columns, b + columns]]
    return np.concatenate(rings), np.array(faces)


def bind():
    matrices = np.tile(np.eye(4), (len(JOINTS), 1, 1))
    for j, parent in enumerate(PARENTS):
        matrices[j, :3, 3] = OFFSETS[j] + (matrices[parent, :3, 3] if parent >= 0 else 0)
    return matrices


def motion(frames, fps, speed=1.0):
    """Walks in place-ish with swinging legs: [frames, J, 4, 4]."""
    out = np.zeros((frames, len(JOINTS), 4, 4))
    for f in range(frames):
        t = speed * f / fps
        local = [np.eye(4) for _ in JOINTS]
        for j in range(len(JOINTS)):
            local[j][:3, 3] = OFFSETS[j]
        local[0][:3, 3] += [0.2 * np.sin(1.1 * t), 0.02 * np.cos(12 * t), 0.5 * t]
        local[0][:3, :3] = rotation([0, 1, 0], 0.4 * np.sin(0.9 * t))
        for leg, sign in ((2, 1), (4, -1)):
            swing = 0.5 * sign * np.sin(6 * t)
            local[leg][:3, :3] = rotation([1, 0, 0], -swing)
            local[leg + 1][:3, :3] = rotation([1, 0, 0], 0.3 + 0.3 * sign * np.sin(6 * t + 1))
        for j, parent in enumerate(PARENTS):
            out[f, j] = local[j] if parent < 0 else out[f, parent] @ local[j]
    return out


def skirt():
    way = np.linspace(0, 1, RINGS)
    points, faces = tube(0.17 + 0.2 * way, 1.08 - 0.5 * way, (0, 0), COLUMNS)
    pleats = 1 + 0.1 * np.repeat(way ** 2,
                                 COLUMNS) * np.cos(7 * 2 * np.pi * np.tile(np.arange(COLUMNS), RINGS) / COLUMNS)
    points[:, 0] *= pleats
    points[:, 2] *= pleats
    return points, faces


def body():
    heights = np.linspace(1.75, 0.9, 14)
    torso = tube(np.interp(heights, [0.9, 1.0, 1.3, 1.5, 1.58, 1.75], [0.15, 0.16, 0.13, 0.17, 0.08, 0.09]), heights,
                 (0, 0), 20)
    parts = [torso] + [tube(np.linspace(0.09, 0.05, 14), np.linspace(0.95, 0.08, 14), (x, 0), 14) for x in (0.1, -0.1)]
    points, faces, at = [], [], 0
    for p, f in parts:
        points.append(p)
        faces.append(f + at)
        at += len(p)
    return np.concatenate(points), np.concatenate(faces)


def joint_weights(points, names):
    """Smooth weights by distance to a joint's segment midpoint; rows sum to 1."""
    anchors = {"hips": [0, 1.0, 0], "spine": [0, 1.35, 0], "head": [0, 1.65, 0], "thigh_l": [0.12, 0.74, 0],
               "shin_l": [0.12, 0.35, 0], "thigh_r": [-0.12, 0.74, 0], "shin_r": [-0.12, 0.35, 0]}
    distance = np.stack([np.linalg.norm(points - anchors[n], axis=1) for n in names], 1)
    weights = 1 / (distance ** 4 + 1e-4)
    return weights / weights.sum(1, keepdims=True)


def skin(points, weights, names, poses):
    inverse = np.linalg.inv(bind())
    indices = [JOINTS.index(n) for n in names]
    matrices = np.einsum("fjab,jbc->fjac", poses[:, indices], inverse[indices])
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], 1)
    return np.einsum("nj,fjab,nb->fna", weights, matrices[:, :, :3], homogeneous)


def bundle_tensors(width=8):
    random = np.random.default_rng(1)
    points, faces = skirt()
    skin_points, skin_faces = body()
    d, m, n = 9 * len(FEATURES) + 4, len(BONES), VERTICES
    nearest = skin_points[np.argmin(((points[:, None] - skin_points[None]) ** 2).sum(-1), 1)]

    def dense(rows, columns, gain=1.0):
        return gain * random.standard_normal((rows, columns)) / np.sqrt(columns)

    hem = np.clip((1.08 - points[:, 1]) / 0.5, 0, 1)

    def basis(count, millimetres):
        angle = np.arctan2(points[:, 0], points[:, 2])
        waves = np.stack([np.cos((i // 2 + 1) * angle + (i % 2) * np.pi / 2) for i in range(count)])
        return millimetres * 1e-3 * (waves * hem)[:, :, None] * random.standard_normal((count, 1, 3))

    t = {"template.positions": points, "template.faces": faces, "character.bind": bind(),
         "body.positions": skin_points, "body.faces": skin_faces,
         "body.joint_weights": joint_weights(skin_points, JOINTS),
         "nearest.points": nearest, "nearest.joint_weights": joint_weights(nearest, JOINTS),
         "features.mean": np.zeros(d), "features.deviation": np.ones(d), "features.low": np.full(d, -4.0),
         "features.high": np.full(d, 4.0),
         "static.mlp.0.weight": dense(HIDDEN, d), "static.mlp.0.bias": np.zeros(HIDDEN),
         "static.mlp.2.weight": dense(3 * m, HIDDEN, 2e-3), "static.mlp.2.bias": np.zeros(3 * m),
         "static.initial_weights": joint_weights(points, BONES),
         "static.residual_weights": 1e-3 * random.standard_normal((2, n, m)),
         "skeleton.gru.weight_ih": dense(3 * K_SKELETON, d),
         "skeleton.gru.weight_hh": dense(3 * K_SKELETON, K_SKELETON),
         "skeleton.gru.bias_ih": np.zeros(3 * K_SKELETON), "skeleton.gru.bias_hh": np.zeros(3 * K_SKELETON),
         "skeleton.basis": basis(K_SKELETON, 12), "mesh.input_mean": np.array([0, -0.3, 0]),
         "mesh.input_deviation": np.array([0.15, 0.3, 0.15]),
         "mesh.embed.weight": dense(1, width), "mesh.embed.bias": np.zeros(1),
         "mesh.mlp.0.weight": dense(HIDDEN, n), "mesh.mlp.0.bias": np.zeros(HIDDEN),
         "mesh.mlp.2.weight": dense(K_MESH, HIDDEN), "mesh.mlp.2.bias": np.zeros(K_MESH),
         "mesh.basis": basis(K_MESH, 4)}
    for layer in range(2):
        inputs = 3 if layer == 0 else width
        t[f"mesh.layers.{layer}.w_p"] = dense(inputs, width)
        for name in ("w_z", "w_r", "w", "u_z", "u_r", "u", "w_o"):
            t[f"mesh.layers.{layer}.{name}"] = dense(width, width)
        for name in ("b", "b_o", "norm.bias"):
            t[f"mesh.layers.{layer}.{name}"] = np.zeros(width)
        t[f"mesh.layers.{layer}.norm.weight"] = np.ones(width)
        t[f"mesh.layers.{layer}.prelu"] = np.array([0.25])
    return {k: v.astype(np.int32 if k.endswith("faces") else np.float32) for k, v in t.items()}


def patch_tensors(patches=4, points=3, width=16, layers=2, sources=4):
    """A patch stage in place of the other two: patches of columns, points of rings, on the hips."""
    random = np.random.default_rng(2)
    template, _ = skirt()
    ring, column = np.divmod(np.arange(VERTICES), COLUMNS)
    groups = column * patches // COLUMNS * points + ring * points // RINGS
    means = np.stack([template[groups == g].mean(0) for g in range(patches * points)]).reshape(patches, points, 3)
    out = means.mean(1) * [1, 0, 1]
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    up = np.tile([0.0, 1, 0], (patches, 1))
    parts = np.zeros((patches, points, 4, 4))
    parts[:, :, 0, :3], parts[:, :, 0, 3] = means, 1
    inputs = 19 * points + 33

    def dense(rows, columns):
        return random.standard_normal((rows, columns)) / np.sqrt(columns)

    t = {"joints": np.zeros(patches), "axes": np.stack([out, up, np.cross(out, up)], -1), "centres": means.mean(1),
         "point_joints": np.zeros((patches, points, 4)), "point_parts": parts,
         "capsule_joints": np.array([JOINTS.index(j) for j in ("thigh_l", "shin_l", "thigh_r", "shin_r")]),
         "capsules": np.array([[x, y, 0, x, y - 0.4, 0, 0.08, 0.05] for x in (0.1, -0.1) for y in (0.95, 0.53)]),
         "limbs": np.tile([[0, 1], [2, 3]], (patches, 1, 1)),
         "near": np.tile(np.roll(np.arange(patches), 1), (layers, 1, 1)),
         "enter.weight": dense(width, inputs), "enter.bias": np.zeros(width),
         "gates.weight_ih": dense(3 * width, width), "gates.weight_hh": dense(3 * width, width),
         "gates.bias": np.zeros(3 * width),
         "out.weight": 0.1 * dense(3 * points, width + inputs), "out.bias": np.zeros(3 * points),
         "keep": np.full(points, 0.8), "map.groups": groups,
         "map.sources": np.stack([(g + np.arange(sources)) % (patches * points) for g in range(patches * points)]),
         "map.weights": np.eye(3) / sources + 0.05 * random.standard_normal((VERTICES, sources, 3, 3)),
         "map.offsets": np.zeros((VERTICES, 3))}
    for layer in range(layers):
        t[f"mix.{layer}.weight"], t[f"mix.{layer}.bias"] = dense(width, 2 * width), np.zeros(width)
    integers = ("joints", "point_joints", "capsule_joints", "limbs", "near", "map.groups", "map.sources")
    return {f"patch.{k}": v.astype(np.int32 if k in integers else np.float32) for k, v in t.items()}


def write_bundle(path, drop=(), changes=None, width=8):
    tensors = {k: v for k, v in bundle_tensors(width).items() if not any(k.startswith(p) for p in drop)}
    tensors.update(changes or {})
    safetensors_file.write(path, tensors, {
        "format": "dcloth-bundle", "format_version": "1", "garment": "cone skirt", "tick_rate": "30",
        "joint_names": json.dumps(JOINTS), "parents": json.dumps(PARENTS), "hips": "hips",
        "feature_joints": json.dumps(FEATURES), "root_motion": "true",
        "bones": json.dumps(BONES), "training": "{}"})


def lagging_truth(poses):
    points, _ = skirt()
    weights = joint_weights(points, BONES)
    posed = skin(points, weights, BONES, poses)
    hem = np.clip((1.08 - points[:, 1]) / 0.5, 0, 1)[None, :, None]
    late = np.concatenate([np.repeat(poses[:1], 2, 0), poses[:-2]]) if len(poses) > 2 else poses
    return posed + hem ** 2 * 0.6 * (late[:, None, 0, :3, 3] - poses[:, None, 0, :3, 3])


def write_sequence(path, poses, fps=30, truth=True, names=JOINTS, changes=None):
    tensors = {"joint_matrices": poses.astype(np.float32)}
    if truth:
        tensors["truth"] = lagging_truth(poses).astype(np.float32)
    tensors.update(changes or {})
    safetensors_file.write(path, tensors, {"joint_names": json.dumps(list(names)), "fps": f"{fps:g}"})
