"""The figure: a woman of natural proportions that wears the garments; one mesh to draw, to collide and to push out.

Made by bake.py from MakeHuman's base mesh (CC0); README.md says how.
"""
import functools
import json
import os
from dataclasses import dataclass

import numpy as np

from .. import safetensors_io

FILE = os.path.join(os.path.dirname(__file__), "figure.safetensors")


@dataclass(frozen=True)
class Figure:
    """A closed surface in T-pose, symmetric in x. Metres; +Y up, faces +Z, left is +X, soles on y = 0.

    vertices [b, 3], faces [f, 3] counter-clockwise from outside, weights [b, J] (rows sum to 1, at most 4 joints each),
    mirror [b] (the vertex on the other side), regions [b] and face_regions [f] (numbers in `region_names`),
    palette [r, 3] (colour of each region, sRGB 0 to 1), names [J], parents [J] (-1: the root), joints [J, 3] bind
    positions. Joints are aligned with the world: their bind rotations are the identity.
    """
    vertices: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    mirror: np.ndarray
    regions: np.ndarray
    face_regions: np.ndarray
    region_names: tuple
    palette: np.ndarray
    names: tuple
    parents: np.ndarray
    joints: np.ndarray

    @property
    def colours(self):
        """One colour a vertex [b, 3]. A face of faces_by_colour has that of its last corner."""
        return self.palette[self.regions]

    @property
    def faces_by_colour(self):
        """`faces`, each turned so that its last corner lies in the face's own region."""
        own = self.regions[self.faces] == self.face_regions[:, None]
        last = 2 - np.argmax(own[:, ::-1], 1)
        return np.take_along_axis(self.faces, (last[:, None] + [1, 2, 3]) % 3, 1)

    def drawing(self):
        """The mesh with a vertex of its own for each region it borders on, so that regions have sharp edges.

        -> vertex of the figure [d] that each drawn one lies at, faces [f, 3] into those, colours [d, 3].
        """
        key = self.faces.astype(np.int64) * len(self.palette) + self.face_regions[:, None]
        unique, faces = np.unique(key, return_inverse=True)
        return unique // len(self.palette), faces.reshape(-1, 3).astype(np.int32), \
            self.palette[unique % len(self.palette)]


@functools.lru_cache(maxsize=None)
def load(shape="average"):
    """The figure "average", "slim" or "heavy" -> Figure, its arrays not writable. All have the same triangles, weights
    and joint names. Cost: 10 ms once, then nothing."""
    tensors, metadata = safetensors_io.read(FILE)
    shapes = sorted(name.partition("_")[2] for name in tensors if name.startswith("vertices_"))
    if shape not in shapes:
        raise ValueError(f"figure '{shape}', allowed: {', '.join(shapes)}")
    names = tuple(json.loads(metadata["joint_names"]))
    weights = np.zeros((len(tensors["weights"]), len(names)))
    np.put_along_axis(weights, tensors["weight_joints"].astype(np.int64), tensors["weights"].astype(np.float64), 1)
    weights /= weights.sum(1, keepdims=True)
    figure = Figure(
        tensors["vertices_" + shape].astype(np.float64), tensors["faces"].astype(np.int32), weights,
        tensors["mirror"].astype(np.int32), tensors["regions"], tensors["face_regions"],
        tuple(json.loads(metadata["regions"])), np.array(json.loads(metadata["palette"])), names,
        np.array(json.loads(metadata["parents"]), np.int32), tensors["joints_" + shape].astype(np.float64))
    for array in vars(figure).values():
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    return figure
