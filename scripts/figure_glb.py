#!/usr/bin/env python3
"""The figure of a training bundle as a glTF file that moves: skin, skeleton, and a sequence as its animation.

Usage: figure_glb.py BUNDLE.safetensors SEQUENCE.safetensors OUT.glb
"""
import array
import json
import math
import struct
import sys
from pathlib import Path

from package_files import read

U16, U32, F32 = 5123, 5125, 5126


def tensor(file, name, kind, width):
    """Rows of `width` numbers."""
    header, data = file
    begin, end = header[name]["data_offsets"]
    values = array.array(kind, data[begin:end])
    return [values[i:i + width].tolist() for i in range(0, len(values), width)]


def inverse(m):
    """Of a rigid transform: 16 numbers by rows."""
    rows = [[m[0], m[4], m[8]], [m[1], m[5], m[9]], [m[2], m[6], m[10]]]
    return [x for row in rows for x in (*row, -sum(r * t for r, t in zip(row, (m[3], m[7], m[11]), strict=True)))] + [
        0.0, 0.0, 0.0, 1.0]


def product(a, b):
    return [sum(a[4 * i + k] * b[4 * k + j] for k in range(4)) for i in range(4) for j in range(4)]


def quaternion(m):
    """(x, y, z, w) of the rotation of a rigid transform, from its largest component."""
    trace = m[0] + m[5] + m[10]
    squares = [1 + 2 * m[0] - trace, 1 + 2 * m[5] - trace, 1 + 2 * m[10] - trace, 1 + trace]  # four times x*x and so on
    largest = squares.index(max(squares))
    sums = {(0, 1): m[1] + m[4], (0, 2): m[2] + m[8], (1, 2): m[6] + m[9],
            (0, 3): m[9] - m[6], (1, 3): m[2] - m[8], (2, 3): m[4] - m[1]}
    q = [squares[i] if i == largest else sums[min(i, largest), max(i, largest)] for i in range(4)]
    return unit(q)


def unit(v):
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]


def column_major(m):
    return [m[4 * j + i] for i in range(4) for j in range(4)]


class Buffer:
    """The binary part of the file, and what lies where in it."""

    def __init__(self):
        self.bytes, self.views, self.accessors = bytearray(), [], []

    def add(self, kind, component, rows):
        code = {U16: "H", U32: "I", F32: "f"}[component]
        start = len(self.bytes)
        self.bytes += array.array(code, [x for row in rows for x in row]).tobytes()
        self.views.append({"buffer": 0, "byteOffset": start, "byteLength": len(self.bytes) - start})
        self.accessors.append({"bufferView": len(self.views) - 1, "componentType": component, "count": len(rows),
                               "type": kind})
        return len(self.accessors) - 1

    def floats(self, kind, rows):
        rows = [array.array("f", row).tolist() for row in rows]  # bounds of what is written
        index = self.add(kind, F32, rows)
        self.accessors[index] |= {"min": [min(c) for c in zip(*rows, strict=True)],
                                  "max": [max(c) for c in zip(*rows, strict=True)]}
        return index


def skin(bundle, joint_count, buffer):
    """The figure's surface as a primitive, with the four largest weights of each point."""
    positions = tensor(bundle, "body.positions", "f", 3)
    faces = tensor(bundle, "body.faces", "i", 3)
    normals = [[0.0] * 3 for _ in positions]
    for face in faces:
        a, b, c = (positions[corner] for corner in face)
        u, v = [y - x for x, y in zip(a, b, strict=True)], [y - x for x, y in zip(a, c, strict=True)]
        cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        for corner in face:
            normals[corner] = [n + x for n, x in zip(normals[corner], cross, strict=True)]
    joints, weights = [], []
    for row in tensor(bundle, "body.joint_weights", "f", joint_count):
        order = sorted(range(joint_count), key=lambda joint: -row[joint])[:4]
        total = sum(row[joint] for joint in order)
        joints.append(order)
        weights.append([row[joint] / total for joint in order])
    # The bundle has colours as a screen shows them, glTF has them linear.
    colours = [[value ** 2.2 for value in row] for row in tensor(bundle, "body.colours", "f", 3)]
    return {"attributes": {"POSITION": buffer.floats("VEC3", positions),
                           "NORMAL": buffer.floats("VEC3", [unit(n) if any(n) else [0, 1, 0] for n in normals]),
                           "COLOR_0": buffer.floats("VEC3", colours),
                           "JOINTS_0": buffer.add("VEC4", U16, joints),
                           "WEIGHTS_0": buffer.floats("VEC4", weights)},
            "indices": buffer.add("SCALAR", U32, [[corner] for face in faces for corner in face]), "material": 0}


def figure(bundle, sequence):
    """-> document, binary part."""
    about, clip = bundle[0]["__metadata__"], sequence[0]["__metadata__"]
    names, parents = json.loads(about["joint_names"]), json.loads(about["parents"])
    if json.loads(clip["joint_names"]) != names:
        sys.exit("figure_glb: the sequence moves other joints than those of the bundle; give one of its own")
    count = len(names)
    binds = tensor(bundle, "character.bind", "f", 16)
    poses = tensor(sequence, "joint_matrices", "f", 16)
    frames = [poses[i:i + count] for i in range(0, len(poses), count)]

    def local(world, joint):
        return world[joint] if parents[joint] < 0 else product(inverse(world[parents[joint]]), world[joint])

    def place(m):
        return [m[3], m[7], m[11]]

    buffer = Buffer()
    mesh = skin(bundle, count, buffer)
    inverses = buffer.floats("MAT4", [column_major(inverse(bind)) for bind in binds])
    times = buffer.floats("SCALAR", [[frame / float(clip["fps"])] for frame in range(len(frames))])
    nodes, samplers, channels = [], [], []
    for joint, name in enumerate(names):
        bind = local(binds, joint)
        nodes.append({"name": name, "rotation": quaternion(bind), "translation": place(bind)})
        children = [child for child in range(count) if parents[child] == joint]
        if children:
            nodes[-1]["children"] = children
        keys = [local(frame, joint) for frame in frames]
        rotations = [quaternion(key) for key in keys]
        for before, after in zip(rotations, rotations[1:], strict=False):
            if sum(a * b for a, b in zip(before, after, strict=True)) < 0:
                after[:] = [-x for x in after]
        for path, kind, values in (("rotation", "VEC4", rotations), ("translation", "VEC3", [place(k) for k in keys])):
            channels.append({"sampler": len(samplers), "target": {"node": joint, "path": path}})
            samplers.append({"input": times, "output": buffer.floats(kind, values), "interpolation": "LINEAR"})
    nodes.append({"name": "Body", "mesh": 0, "skin": 0})
    nodes.append({"name": "Figure", "children": [j for j in range(count) if parents[j] < 0] + [count]})
    return {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [count + 1]}], "nodes": nodes,
            "buffers": [{"byteLength": len(buffer.bytes)}], "bufferViews": buffer.views,
            "accessors": buffer.accessors, "meshes": [{"primitives": [mesh]}],
            "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.8}}],
            "skins": [{"joints": list(range(count)), "inverseBindMatrices": inverses}],
            "animations": [{"name": clip["clip"], "samplers": samplers, "channels": channels}]}, bytes(buffer.bytes)


def main(bundle, sequence, out):
    document, binary = figure(read(bundle), read(sequence))
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(binary), len(text), 0x4E4F534A)
    Path(out).write_bytes(head + text + struct.pack("<II", len(binary), 0x004E4942) + binary)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
