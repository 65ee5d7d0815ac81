"""A small figure of prisms as binary glTF, and what a writer of glTF may make of it."""
import numpy as np
from scipy.spatial.transform import Rotation

import gltf_file

JOINTS = [("Hips", None, (0, .98, 0)), ("Spine", "Hips", (0, .1, 0)), ("Spine1", "Spine", (0, .12, 0)),
          ("Spine2", "Spine1", (0, .13, 0)), ("Neck", "Spine2", (0, .16, 0)), ("Head", "Neck", (0, .1, .02)),
          *((side + name, "Spine2" if name == "Shoulder" else "Hips" if name == "UpLeg" else side + above,
             (sign * x, y, z))
            for side, sign in (("Left", 1), ("Right", -1))
            for name, above, (x, y, z) in (
                ("Shoulder", "", (.06, .1, 0)), ("Arm", "Shoulder", (.11, 0, 0)), ("ForeArm", "Arm", (.27, 0, 0)),
                ("Hand", "ForeArm", (.25, 0, 0)), ("UpLeg", "", (.095, -.05, 0)), ("Leg", "UpLeg", (0, -.42, 0)),
                ("Foot", "Leg", (0, -.42, -.02)), ("ToeBase", "Foot", (0, -.07, .14))))]
NAMES = [name for name, _, _ in JOINTS]
IDENTITY = np.eye(3)


def places(rise=0):
    """Of the joints, in a T pose whose collar bones rise by so many degrees."""
    at = {}
    for name, above, offset in JOINTS:
        offset = np.array(offset, float)
        if name in ("LeftArm", "RightArm"):
            x, angle = offset[0], np.radians(rise)
            offset = np.array([x * np.cos(angle), abs(x) * np.sin(angle), 0])
        at[name] = offset + (at[above] if above else 0)
    return at


def body(at):
    """Vertices, triangles and each vertex' joint: prisms of 12 corners."""
    prisms = [(at["Hips"] + (0, -.12, 0), at["Spine"], .17, .115, "Hips"),
              (at["Spine"], at["Spine2"], .135, .1, "Spine1"), (at["Spine2"], at["Neck"], .15, .1, "Spine2"),
              (at["Neck"], at["Neck"] + (0, .12, 0), .05, .05, "Neck"),
              (at["Head"], at["Head"] + (0, .2, 0), .075, .09, "Head")]
    for side in ("Left", "Right"):
        prisms += [(at[side + "UpLeg"], at[side + "Leg"], .075, .075, side + "UpLeg"),
                   (at[side + "Leg"], at[side + "Foot"], .05, .05, side + "Leg"),
                   (at[side + "Foot"] + (0, 0, -.05), at[side + "ToeBase"] + (0, 0, .05), .04, .03, side + "Foot"),
                   (at[side + "Arm"], at[side + "ForeArm"], .045, .045, side + "Arm"),
                   (at[side + "ForeArm"], at[side + "Hand"], .035, .035, side + "ForeArm")]
    vertices, triangles, joints, rings, corners = [], [], [], 5, 12
    for start, end, width, depth, joint in prisms:
        way = (end - start) / np.linalg.norm(end - start)
        u = np.cross(way, (0, 0, 1) if abs(way[2]) < .9 else (0, 1, 0))
        u /= np.linalg.norm(u)
        first = len(vertices)
        for ring in range(rings):
            for angle in 2 * np.pi * np.arange(corners) / corners:
                vertices.append(start + (end - start) * ring / (rings - 1) + u * width * np.cos(angle)
                                + np.cross(way, u) * depth * np.sin(angle))
                joints.append(NAMES.index(joint))
        for ring in range(rings - 1):
            for k in range(corners):
                a, b = first + ring * corners + k, first + ring * corners + (k + 1) % corners
                triangles += [(a, b, b + corners), (a, b + corners, a + corners)]
    return np.array(vertices, "<f4"), np.array(triangles, "<u2"), np.array(joints)


class Figure:
    """The document and its buffer, to be changed before `glb`. `axes` are those of every joint in the world, `turn`
    turns the whole figure."""

    def __init__(self, name_of=lambda name: name, axes=IDENTITY, rise=0, turn=IDENTITY):
        self.binary = bytearray()
        self.document = {"asset": {"version": "2.0"}, "scene": 0, "accessors": [], "bufferViews": [], "nodes": []}
        at = places(rise)
        self.vertices, triangles, self.joint_of = body(at)
        at = {name: turn @ place for name, place in at.items()}
        self.vertices = (self.vertices @ turn.T).astype("<f4")
        world = {name: np.vstack([np.c_[axes, at[name]], [0, 0, 0, 1]]) for name in NAMES}
        turn = Rotation.from_matrix(axes).as_quat().tolist()
        for name, above, _ in JOINTS:
            local = np.linalg.inv(world[above]) @ world[name] if above else world[name]
            node = {"name": name_of(name), "translation": local[:3, 3].tolist(),
                    "rotation": [0, 0, 0, 1] if above else turn}
            children = [NAMES.index(child) for child, parent, _ in JOINTS if parent == name]
            self.document["nodes"].append(node | ({"children": children} if children else {}))
        self.inverse = np.stack([np.linalg.inv(world[name]) for name in NAMES])
        joints, weights = np.zeros((len(self.vertices), 4), "u1"), np.zeros((len(self.vertices), 4), "<f4")
        joints[:, 0], weights[:, 0] = self.joint_of, 1
        self.primitive = {"attributes": {"POSITION": self.add(self.vertices, "VEC3"),
                                         "JOINTS_0": self.add(joints, "VEC4"), "WEIGHTS_0": self.add(weights, "VEC4")},
                          "indices": self.add(triangles.reshape(-1, 1), "SCALAR")}
        self.mesh = {"name": "Figure", "primitives": [self.primitive]}
        self.skin = {"joints": list(range(len(NAMES)))}
        self.bind(self.inverse)
        self.document |= {"meshes": [self.mesh], "skins": [self.skin], "scenes": [{"nodes": [0, len(NAMES)]}]}
        self.document["nodes"].append({"name": "Figure", "mesh": 0, "skin": 0})

    def view(self, content, stride=None):
        self.binary += bytes(-len(self.binary) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(content),
                                             **({"byteStride": stride} if stride else {})})
        self.binary += content
        return len(self.document["bufferViews"]) - 1

    def add(self, values, kind, stride=None, **more):
        component = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}[values.dtype.str[1:]]
        self.document["accessors"].append({"bufferView": self.view(np.ascontiguousarray(values).tobytes(), stride),
                                           "componentType": component, "count": len(values), "type": kind, **more})
        return len(self.document["accessors"]) - 1

    def bind(self, inverse):
        matrices = np.asarray(inverse, "<f4").transpose(0, 2, 1).reshape(-1, 16)
        self.skin["inverseBindMatrices"] = self.add(matrices, "MAT4")

    def raise_leg(self, interpolation="LINEAR", kind="<f4", seconds=2.0):
        """The left thigh is lifted by 80 degrees in the middle of two seconds: three keys, flat tangents."""
        angle = np.radians([0, -80, 0])
        keys = np.c_[np.sin(angle / 2), np.zeros((3, 2)), np.cos(angle / 2)]
        if interpolation == "CUBICSPLINE":
            keys = np.stack([0 * keys, keys, 0 * keys], 1).reshape(-1, 4)
        most = {"<f4": 1, "<i2": 32767, "i1": 127}[kind]
        values = (keys if most == 1 else np.round(keys * most)).astype(kind)
        times = self.add(np.array([[0], [seconds / 2], [seconds]], "<f4"), "SCALAR")
        output = self.add(values, "VEC4", normalized=most != 1)
        self.document["animations"] = [{
            "name": "Raise", "samplers": [{"input": times, "output": output, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": NAMES.index("LeftUpLeg"), "path": "rotation"}}]}]
        return self

    def glb(self):
        self.document["buffers"] = [{"byteLength": len(self.binary)}]
        return gltf_file.glb(self.document, bytes(self.binary))
