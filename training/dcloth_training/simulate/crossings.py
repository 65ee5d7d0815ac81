"""Where cloth passes through itself or through the body: exact, by training/cloth_solver/crossings.h.

Two triangles cross where they share a point. Coordinates are rounded to 15 nm first; after that nothing is approximate.
"""
import ctypes

import numpy as np

from . import solver

_FEW = 4096     # pairs; more than that and the search runs twice


def _pairs(vertices, faces, other, other_faces):
    """Intersecting triangles [k, 2] int32 of two meshes, or of one where `other` is None."""
    def arguments(points, triangles):
        points = np.ascontiguousarray(points, np.float64)
        triangles = np.ascontiguousarray(triangles, np.int32)
        for array, what in ((points, "vertices"), (triangles, "faces")):
            if array.ndim != 2 or array.shape[1] != 3:
                raise ValueError(f"{what} of shape {array.shape}; expected [any, 3]")
        return points, triangles

    def pointer(array, kind):
        return array.ctypes.data_as(ctypes.POINTER(kind))

    given, kept = [], []        # the arrays live until the call is over
    for points, triangles in ((vertices, faces), (other, other_faces)):
        if points is None:
            given += [None, 0, None, 0]
            continue
        points, triangles = arguments(points, triangles)
        kept += [points, triangles]
        given += [pointer(points, ctypes.c_double), len(points), pointer(triangles, ctypes.c_int32), len(triangles)]
    search = solver.library().cloth_crossings
    search.restype = ctypes.c_int64
    search.argtypes = 2 * [ctypes.POINTER(ctypes.c_double), ctypes.c_int32, ctypes.POINTER(ctypes.c_int32),
                           ctypes.c_int32] + [ctypes.POINTER(ctypes.c_int32), ctypes.c_int64]
    room = _FEW
    while True:
        out = np.empty((room, 2), np.int32)
        found = search(*given, pointer(out, ctypes.c_int32), room)
        if found < 0:
            raise ValueError("a coordinate is not finite or 16 m from the cloth, or a face names a vertex that is not "
                             "there")
        if found <= room:
            return out[:found]
        room = found


def within(cloth, faces):
    """Pairs [k, 2] int32 of a mesh's triangles that intersect and share no vertex, the lower index first, sorted.

    cloth [n, 3] m, faces [c, 3]. Vertices at one place count as one. 16,000 triangles cost about 10 ms.
    """
    return _pairs(cloth, faces, None, None)


def between(cloth, cloth_faces, body, body_faces):
    """Pairs [k, 2] int32 (cloth triangle, body triangle) that intersect, sorted.

    cloth [n, 3] m, cloth_faces [c, 3], body [b, 3] m in the same pose, body_faces [g, 3].
    """
    return _pairs(cloth, cloth_faces, body, body_faces)


def count(cloth, cloth_faces, body, body_faces):
    """(cloth_pairs [k, 2], body_pairs [k, 2]): within() and between() of a frame."""
    return within(cloth, cloth_faces), between(cloth, cloth_faces, body, body_faces)
