"""Synthetic garments of any size for the scaling curves: a skirt on a capsule body with random weights of sensible
scale.

Untrained weights cost what trained ones cost: no kernel looks at values.
"""
import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "cli"))
import safetensors_file
import small_garment as small


@dataclass(frozen=True)
class Size:
    """The bundled skirt's kind, unless changed."""
    vertices: int = 8000
    width: int = 8       # F
    layers: int = 3      # L
    rank: int = 192      # k_S + k_M, half each
    hidden: int = 96     # of the vertex perceptron

    def changed(self, axis, value):
        return replace(self, **{axis: value})


def skirt(vertices):
    """A grid of rings twice as long around as down; vertices that do not fill a ring are left out: [n, 3], faces."""
    columns = max(8, int(np.sqrt(2 * vertices)))
    rings = vertices // columns
    way = np.linspace(0, 1, rings)
    points, faces = small.tube(0.17 + 0.2 * way, 1.08 - 0.5 * way, (0, 0), columns)
    return points, faces


def nearest(points, targets, chunk=2048):
    found = [((points[i:i + chunk, None] - targets[None]) ** 2).sum(-1).argmin(1) for i in range(0, len(points), chunk)]
    return targets[np.concatenate(found)]


def tensors(size, seed=1):
    random = np.random.default_rng(seed)
    points, faces = skirt(size.vertices)
    body_points, body_faces = small.body()
    n, k = len(points), size.rank // 2
    d, m = 9 * len(small.FEATURES) + 4, len(small.BONES)
    on_body = nearest(points, body_points)

    def dense(rows, columns, gain=1.0):
        return (gain / np.sqrt(columns) * random.standard_normal((rows, columns), dtype=np.float32))

    hem = np.clip((1.08 - points[:, 1]) / 0.5, 0, 1)[None, :, None].astype(np.float32)
    t = {"template.positions": points, "template.faces": faces, "character.bind": small.bind(),
         "body.positions": body_points, "body.faces": body_faces,
         "body.joint_weights": small.joint_weights(body_points, small.JOINTS),
         "nearest.points": on_body, "nearest.joint_weights": small.joint_weights(on_body, small.JOINTS),
         "features.mean": np.zeros(d), "features.deviation": np.ones(d), "features.low": np.full(d, -4.0),
         "features.high": np.full(d, 4.0),
         "static.mlp.0.weight": dense(64, d), "static.mlp.0.bias": np.zeros(64),
         "static.mlp.2.weight": dense(3 * m, 64, 2e-3), "static.mlp.2.bias": np.zeros(3 * m),
         "static.initial_weights": small.joint_weights(points, small.BONES),
         "static.residual_weights": np.zeros((1, n, m)),
         "skeleton.gru.weight_ih": dense(3 * k, d), "skeleton.gru.weight_hh": dense(3 * k, k),
         "skeleton.gru.bias_ih": np.zeros(3 * k), "skeleton.gru.bias_hh": np.zeros(3 * k),
         "skeleton.basis": 2e-3 * hem * random.standard_normal((k, n, 3), dtype=np.float32),
         "mesh.input_mean": np.array([0, -0.3, 0]), "mesh.input_deviation": np.array([0.15, 0.3, 0.15]),
         "mesh.embed.weight": dense(1, size.width), "mesh.embed.bias": np.zeros(1),
         "mesh.mlp.0.weight": dense(size.hidden, n), "mesh.mlp.0.bias": np.zeros(size.hidden),
         "mesh.mlp.2.weight": dense(k, size.hidden), "mesh.mlp.2.bias": np.zeros(k),
         "mesh.basis": 1e-3 * hem * random.standard_normal((k, n, 3), dtype=np.float32)}
    for layer in range(size.layers):
        prefix, inputs = f"mesh.layers.{layer}.", 3 if layer == 0 else size.width
        t[prefix + "w_p"] = dense(inputs, size.width)
        for name in ("w_z", "w_r", "w", "u_z", "u_r", "u", "w_o"):
            t[prefix + name] = dense(size.width, size.width)
        for name in ("b", "b_o", "norm.bias"):
            t[prefix + name] = np.zeros(size.width)
        t[prefix + "norm.weight"] = np.ones(size.width)
        t[prefix + "prelu"] = np.array([0.25])
    return {name: value.astype(np.int32 if name.endswith("faces") else np.float32) for name, value in t.items()}


def write_bundle(path, size):
    safetensors_file.write(path, tensors(size), {
        "format": "dcloth-bundle", "format_version": "1", "garment": "synthetic skirt", "tick_rate": "30",
        "joint_names": json.dumps(small.JOINTS), "hips": "hips", "feature_joints": json.dumps(small.FEATURES),
        "root_motion": "true", "bones": json.dumps(small.BONES), "training": "{}"})


def write_motion(path, frames=25):
    small.write_sequence(path, small.motion(frames, 30), truth=False)
