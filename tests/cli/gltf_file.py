"""Binary glTF in pieces, so that a test can break one."""
import json
import struct

import numpy as np


def glb(document, binary=b""):
    text = json.dumps(document).encode() if isinstance(document, dict) else document
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text
    parts += struct.pack("<II", len(binary), 0x004E4942) + binary if binary else b""
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def animation(times, positions, nodes=None):
    """One bone with given key times and translations: the document and its buffer."""
    binary = np.array(times, "<f4").tobytes() + np.array(positions, "<f4").tobytes()
    count = len(times)
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes or [{"name": "Hips"}],
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 4 * count},
                        {"buffer": 0, "byteOffset": 4 * count, "byteLength": 12 * count}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "SCALAR", "min": [0],
                       "max": [1]},
                      {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"}],
        "animations": [{"samplers": [{"input": 0, "output": 1}], "name": "go",
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]}
    return document, binary


def animated(times, positions, nodes=None):
    return glb(*animation(times, positions, nodes))


def skin(pose=0.0, weights=(1, 0)):
    """A triangle on two bones, as the document and its buffer. Above them is a root that turns Z up to Y up and
    centimetres to metres; `pose` turns the lower one at rest.
    `weights`: of each vertex, to its own bone and to the other one."""
    points = np.array([[0, 0, 100], [10, 0, 50], [-10, 0, 50]], "<f4")      # the mesh's own space
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[:, 2, 3] = [100, 50]
    parts = [points.tobytes(), np.array([0, 1, 2], "<u2").tobytes() + bytes(2),
             np.array([[0, 1, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]], "u1").tobytes(),
             np.array([[*weights, 0, 0]] * 3, "<f4").tobytes(),
             np.linalg.inv(bind).transpose(0, 2, 1).astype("<f4").tobytes()]
    views, at = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(part)})
        at += len(part)
    kinds = [(5126, 3, "VEC3"), (5123, 3, "SCALAR"), (5121, 3, "VEC4"), (5126, 3, "VEC4"), (5126, 2, "MAT4")]
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "buffers": [{"byteLength": at}],
        "bufferViews": views,
        "accessors": [{"bufferView": i, "componentType": c, "count": n, "type": t}
                      for i, (c, n, t) in enumerate(kinds)],
        "nodes": [{"name": "Root", "rotation": [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)], "scale": [0.01] * 3,
                   "children": [1, 3]},
                  {"name": "Hips", "translation": [0, 0, 100], "children": [2]},
                  {"name": "Leg", "translation": [0, 0, -50], "rotation": [np.sin(pose / 2), 0, 0, np.cos(pose / 2)]},
                  {"name": "Skin", "mesh": 0, "skin": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}, "indices": 1}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}]}
    return document, b"".join(parts)


def skinned(pose=0.0, weights=(1, 0)):
    return glb(*skin(pose, weights))
