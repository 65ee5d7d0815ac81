"""A tiny character and garment with made-up but learnable motion, shared by the tests."""
import json

import numpy as np
import pytest

from dcloth_training import safetensors_io, sequence, train

NAMES = ["Hips", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg"]
MIRROR = [0, 2, 1, 4, 3]


def rotation(axis, angle):
    """Rodrigues' formula, the tests' own."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def rigid(turn, move):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = turn, move
    return out


def bind_pose():
    at = np.array([[0, 1, 0], [.1, .95, 0], [-.1, .95, 0], [.1, .5, 0], [-.1, .5, 0]], float)
    return np.stack([rigid(np.eye(3), p) for p in at])


def tube(radius, rings, columns, top, bottom):
    """Vertices, faces and mirror permutation of an open tube; column 0 faces +Z."""
    angle = 2 * np.pi * np.arange(columns) / columns
    heights = np.linspace(top, bottom, rings)
    vertices = np.array([[radius * np.sin(a), y, radius * np.cos(a)] for y in heights
                         for a in angle])
    vertices[np.abs(vertices) < 1e-12] = 0
    faces, mirror = [], []
    for r in range(rings):
        for c in range(columns):
            mirror.append(r * columns + (-c) % columns)
            if r + 1 < rings:
                a, b = r * columns + c, r * columns + (c + 1) % columns
                faces += [[a, a + columns, b], [b, a + columns, b + columns]]
    return vertices, np.array(faces, np.int32), np.array(mirror, np.int32)


def poses(frames, generator):
    """A walk-like motion: turning, moving hips and two swinging legs [T, 5, 4, 4]."""
    bind, phase = bind_pose(), generator.uniform(0, 6)
    turn = generator.uniform(-1.5, 1.5)
    out = np.zeros((frames, 5, 4, 4))
    for t in range(frames):
        s = np.sin(phase + 0.25 * t)
        hips = rigid(rotation([0, 1, 0], turn * t / 30) @ rotation([1, 0, 0], 0.1 * s),
                     [0.02 * t, 1 + 0.02 * s, 0.01 * t])
        local = [rigid(rotation([1, 0, 0], a * s), np.zeros(3)) for a in (0.5, -0.5, 0.3, -0.3)]
        out[t, 0] = hips
        for j, (parent, leg) in enumerate(zip((0, 0, 1, 2), local), 1):
            offset = bind[j, :3, 3] - bind[parent, :3, 3]
            out[t, j] = out[t, parent] @ rigid(np.eye(3), offset) @ leg
    return out


def hang(matrices, template):
    """A made-up cloth: follows the hips, trails the legs with memory."""
    out, lag = np.zeros((len(matrices), len(template), 3)), 0.0
    for t, pose in enumerate(matrices):
        relative = pose @ np.linalg.inv(bind_pose())
        swing = relative[1, 1, 2] - relative[2, 1, 2]
        lag += 0.3 * (swing - lag)
        moved = template + np.outer(1 - template[:, 1], [0.05 * lag, 0, 0.1 * lag])
        out[t] = moved @ relative[0, :3, :3].T + relative[0, :3, 3]
    return out


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """Folder with character, three dynamic clips and one static file."""
    folder, generator = tmp_path_factory.mktemp("tiny"), np.random.default_rng(3)
    (folder / "dynamic").mkdir()
    (folder / "static").mkdir()
    body, body_faces, _ = tube(0.12, 6, 8, 1.1, 0.2)
    cloth, faces, mirror = tube(0.2, 6, 10, 1.0, 0.5)
    distance = np.linalg.norm(body[:, None] - bind_pose()[None, :, :3, 3], axis=-1)
    weights = np.exp(-12 * distance)
    weights /= weights.sum(1, keepdims=True)
    safetensors_io.write(folder / "character.safetensors", {
        "joint_bind": bind_pose().astype(np.float32), "body_vertices": body.astype(np.float32),
        "body_faces": body_faces, "body_weights": weights.astype(np.float32),
        "body_collider": np.ones(len(body), np.uint8), "cloth_template": cloth.astype(np.float32),
        "cloth_faces": faces, "mirror": mirror, "pinned": np.zeros(len(cloth), np.uint8)},
        {"joint_names": json.dumps(NAMES)})
    for name, kind, frames in (("a/one", "dynamic", 40), ("a/two", "dynamic", 44),
                               ("a/held", "dynamic", 36), ("drapes-00", "static", 10)):
        matrices = poses(frames, generator).astype(np.float32)
        truth = hang(matrices.astype(np.float64), cloth)
        sequence.write(folder / kind / f"{name.replace('/', '-')}.safetensors",
                       sequence.Sequence(matrices, truth, NAMES, 30.0, name, kind))
    return folder


SMALL = ["--validation", "a/held", "--static-epochs", "10", "--influences", "3",
         "--skeleton-epochs", "20", "--skeleton-size", "16", "--skeleton-rank", "8", "--window", "16", "--noise",
         "0.02",
         "--mesh-epochs", "2", "--mesh-windows", "16", "--mesh-patches", "12", "--mesh-size", "4", "--mesh-hidden",
         "16", "--head-rank", "8", "--head-epochs", "10", "--chunk", "8", "--threads", "1", "--static-width", "16"]


def train_tiny(data, out, *more):
    return train.run(train.arguments(["--data", str(data), "--out", str(out), *SMALL, *more]))


@pytest.fixture(scope="session")
def trained(tiny, tmp_path_factory):
    """(what train.run returns, its folder) of the tiny garment."""
    out = tmp_path_factory.mktemp("trained")
    return train_tiny(tiny, out, "--held-out", "a/unseen,a/later"), out
