"""Flat panels, as a tailor cuts them: outlines turned into triangles, panels sewn into one mesh.

A panel's triangles have no common direction (points spread evenly, then relaxed), so that no lattice prints through the
cloth. Warp runs along +y of the panel.
"""
import functools
import os
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from .. import geometry, safetensors_io

RELAXATIONS = 80
DIGITS = 9              # of an outline in metres: processors' sines and products differ below
KEPT = os.path.join(os.path.dirname(__file__), "panels.safetensors")
KEPT_WITHIN = 1e-7      # m: float32


@dataclass
class Sewn:
    """vertices are what panels' points became: faces [c, 3] vertex numbers, pattern [c, 3, 2] m their corners in the
    flat panel, panel [c] which panel each face was cut from, vertex [panels][points] the vertex of each panel point."""
    count: int
    faces: np.ndarray
    pattern: np.ndarray
    panel: np.ndarray
    vertex: list


def sample(points, spacing, closed=False):
    """Points along a polyline [k, 2] about `spacing` apart, its ends kept (m). Without the last one if `closed`."""
    points = np.asarray(points, float)
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    count = max(1, round(length[-1] / spacing))
    at = np.linspace(0, length[-1], count + 1)
    out = np.stack([np.interp(at, length, points[:, k]) for k in (0, 1)], -1)
    return out[:-1] if closed else out


def inside(points, outline):
    """[n] bool: points in the polygon outline [k, 2] (even-odd rule)."""
    x, y = points[:, 0:1], points[:, 1:2]
    a, b = outline, np.roll(outline, -1, 0)
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    slope = (b[:, 0] - a[:, 0]) / np.where(b[:, 1] == a[:, 1], 1, b[:, 1] - a[:, 1])
    return (crosses & (x < slope * (y - a[:, 1]) + a[:, 0])).sum(1) % 2 == 1


def _fixed(outline, lines):
    return np.round(np.concatenate([np.asarray(line, float) for line in (outline, *lines)]), DIGITS)


@functools.lru_cache(maxsize=None)
def _kept():
    """{name: (points [p, 2] m, faces [c, 3], number of fixed points)} of the file KEPT."""
    tensors, fixed = safetensors_io.read(KEPT)
    return {name: (tensors[name + ".points"].astype(np.float64), tensors[name + ".faces"].astype(np.int32), int(count))
            for name, count in fixed.items()}


def keep(panels, path=KEPT):
    """Write {name: (points [p, 2], faces [c, 3], number of fixed points)} for cut()."""
    tensors = {}
    for name, (points, faces, _) in panels.items():
        tensors[name + ".points"], tensors[name + ".faces"] = points.astype(np.float32), faces.astype(np.uint16)
    safetensors_io.write(path, tensors, {name: str(fixed) for name, (_, _, fixed) in panels.items()})


def cut(name, outline, spacing, lines=(), seed=0, made=None):
    """triangulate(), but for a panel that is kept under `name`, has this outline and these lines: that one.

    Which triangles relaxed random points get depends on the last bit of the outline and on the version of scipy. A
    garment that is trained on must not change. made: a dict that gets the panel, anew, under its name (keep())."""
    if made is not None:
        made[name] = (*triangulate(outline, spacing, lines, seed), len(_fixed(outline, lines)))
        return made[name][:2]
    fixed = _fixed(outline, lines)
    points, faces, count = _kept().get(name, (None, None, 0))
    if count == len(fixed) and np.abs(points[:count] - fixed).max() < KEPT_WITHIN:
        return points.copy(), faces.copy()
    return triangulate(outline, spacing, lines, seed)


def triangulate(outline, spacing, lines=(), seed=0):
    """Points [p, 2] and faces [c, 3] (counter-clockwise) of a panel.

    outline [k, 2] m: its boundary as it is to be sampled (each edge becomes a mesh edge; about `spacing` long),
    lines: further rows of points [l, 2] that become mesh edges (creases). The outline's points come first, then the
    lines'. Takes about a second for 10,000 points.
    """
    outline, fixed = np.round(outline, DIGITS), _fixed(outline, lines)
    low, high = outline.min(0), outline.max(0)
    rng = np.random.default_rng(seed)
    # Random points, then relaxed: grains of every direction. A grid, however shaken, relaxes into a lattice again.
    area = 0.5 * abs(np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1]))
    box = np.prod(high - low)
    count = round(area / (spacing ** 2 * np.sqrt(3) / 2) - 0.5 * len(outline) - (len(fixed) - len(outline)))
    grid = rng.uniform(low, high, (int(max(count, 1) * box / area * 1.02), 2))
    tree = cKDTree(fixed)
    free = grid[inside(grid, outline) & (tree.query(grid)[0] > 0.3 * spacing)]
    for _ in range(RELAXATIONS):
        points = np.concatenate([fixed, free])
        faces = Delaunay(points).simplices
        faces = faces[inside(points[faces].mean(1), outline)]
        corner = points[faces]
        area = 0.5 * np.abs(geometry.doubled_areas(corner))
        weight, total = np.zeros(len(points)), np.zeros((len(points), 2))
        for k in range(3):
            np.add.at(weight, faces[:, k], area)
            np.add.at(total, faces[:, k], area[:, None] * corner.mean(1))
        moved = (total / np.maximum(weight, 1e-12)[:, None])[len(fixed):]
        near = tree.query(moved)[0] < 0.55 * spacing
        free = np.where((near | (weight[len(fixed):] == 0))[:, None], free, moved)
    free = free[tree.query(free)[0] > 0.5 * spacing]
    points = np.concatenate([fixed, free])
    faces = Delaunay(points).simplices
    faces = faces[inside(points[faces].mean(1), outline)]
    corner = points[faces]
    turned = geometry.doubled_areas(corner)
    faces = faces[np.abs(turned) > 1e-3 * spacing ** 2]
    turned = turned[np.abs(turned) > 1e-3 * spacing ** 2]
    return points, np.where(turned[:, None] > 0, faces, faces[:, [0, 2, 1]]).astype(np.int32)


def sew(panels, seams):
    """One mesh of panels [(points [p, 2], faces [c, 3], flipped)], joined where `seams` say.

    flipped: the panel's right side looks down, its faces are turned over. seams: ((panel, point numbers), (panel,
    point numbers)), equally many, in the same order. Vertices are numbered by first appearance.
    """
    first = np.r_[0, np.cumsum([len(points) for points, _, _ in panels])]
    root = np.arange(first[-1])

    def find(i):
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for (pa, a), (pb, b) in seams:
        if len(a) != len(b):
            raise ValueError(f"a seam joins {len(a)} points of panel {pa} to {len(b)} of panel {pb}; as many on both "
                             "sides are needed")
        for i, j in zip(first[pa] + np.asarray(a), first[pb] + np.asarray(b)):
            i, j = find(i), find(j)
            root[max(i, j)] = min(i, j)
    roots = np.array([find(i) for i in range(first[-1])])
    used = np.zeros(first[-1], bool)
    for p, (points, faces, _) in enumerate(panels):
        used[roots[first[p] + faces.reshape(-1)]] = True
    number = np.full(first[-1], -1)
    number[np.flatnonzero(used)] = np.arange(used.sum())
    vertex = [number[roots[first[p]:first[p + 1]]] for p in range(len(panels))]
    faces, pattern, panel = [], [], []
    for p, (points, own, flipped) in enumerate(panels):
        own = own[:, [0, 2, 1]] if flipped else own
        faces.append(vertex[p][own])
        pattern.append(points[own])
        panel.append(np.full(len(own), p))
    return Sewn(int(used.sum()), np.concatenate(faces).astype(np.int32), np.concatenate(pattern),
                np.concatenate(panel), vertex)
