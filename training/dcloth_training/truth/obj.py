"""Wavefront OBJ: one mesh a file, vertices in file order, and numbered sequences of such files."""
import glob
import os
import re

import numpy as np

from .cache import Cache
from .errors import refuse

MAX_BYTES = 1 << 30
MAX_FRAMES = 100_000


def read_mesh(path):
    """(positions [n, 3] float64, polygons [tuple of indices]). Several objects in a file are one mesh."""
    if os.path.getsize(path) > MAX_BYTES:
        refuse(path, f"{os.path.getsize(path)} bytes", f"{MAX_BYTES} at most")
    points, polygons = [], []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            words = line.split()
            if not words or words[0] not in ("v", "f"):
                continue
            try:
                if words[0] == "v":
                    points.append([float(x) for x in words[1:4]])
                    if len(points[-1]) != 3:
                        raise ValueError
                else:
                    corners = [int(word.split("/")[0]) for word in words[1:]]
                    corners = [c - 1 if c > 0 else len(points) + c for c in corners]
                    if len(corners) < 3 or len(set(corners)) != len(corners) or min(corners) < 0:
                        raise ValueError
                    polygons.append(tuple(corners))
            except ValueError:
                refuse(f"{path}:{number}", f"'{line.strip()[:60]}'",
                       "v x y z, or f with three corners or more, none twice", "export the mesh again")
    if not points or not polygons:
        refuse(path, f"{len(points)} vertices and {len(polygons)} faces", "a mesh with faces",
               "export the garment with its faces")
    most = max(map(max, polygons))
    if most >= len(points):
        refuse(path, f"a face with vertex {most + 1}", f"1 to {len(points)}", "export the mesh again")
    return np.array(points), polygons


def _number(path):
    digits = re.findall(r"\d+", os.path.basename(path))
    return int(digits[-1]) if digits else None


def read_sequence(pattern):
    """Files that a pattern such as cloth_*.obj names, in the order of the last number in their names."""
    paths = glob.glob(pattern)
    if not paths or len(paths) > MAX_FRAMES:
        refuse(pattern, f"{len(paths)} files", f"1 to {MAX_FRAMES}", "name a sequence such as cloth_*.obj")
    numbers = [_number(path) for path in paths]
    if None in numbers or len(set(numbers)) != len(numbers):
        refuse(pattern, "names without a frame number, or a number twice", "one number a file, such as cloth_0001.obj")
    frames = sorted(numbers)
    paths = [path for _, path in sorted(zip(numbers, paths))]
    gaps = [a + 1 for a, b in zip(frames, frames[1:]) if b != a + 1]
    if gaps:
        refuse(pattern, f"no file of frame {gaps[0]}", f"every frame from {frames[0]} to {frames[-1]}",
               "export every frame", gaps[0])
    first, polygons = read_mesh(paths[0])
    positions = np.empty((len(paths), *first.shape), np.float32)
    for at, path in enumerate(paths):
        points, faces = read_mesh(path)
        if points.shape != first.shape or faces != polygons:
            refuse(path, f"{len(points)} vertices, {len(faces)} faces" if points.shape != first.shape or
                   len(faces) != len(polygons) else "faces of other vertices",
                   f"the {len(first)} vertices and {len(polygons)} faces of {paths[0]}, in its order",
                   "export with vertex order kept and without triangulation or merging", frames[at])
        positions[at] = points
    return Cache(pattern, positions, polygons=polygons, frames=frames)
