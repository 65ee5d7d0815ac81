"""The cloth solver (training/cloth_solver, C++) called from Python: one simulation, one thread.

The library is found at $DCLOTH_CLOTH_SOLVER or in build/training beside this checkout;
`scripts/build.sh build -DDCLOTH_BUILD_TESTS=OFF` makes it.
"""
import ctypes
import functools
import os
from dataclasses import dataclass

import numpy as np

_ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
_INT, _FLOAT = ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(ctypes.c_float)
_MASK = ctypes.POINTER(ctypes.c_uint32)


class Settings(ctypes.Structure):
    """cloth_solver_settings: see training/cloth_solver/cloth_solver.h."""
    _fields_ = [(name, ctypes.c_int32) for name in ("steps", "stretch_passes")] + [
        (name, ctypes.c_float) for name in (
            "frame_seconds", "gravity", "density", "stretch", "bias", "compression", "bend", "damping", "drag_normal",
            "drag_tangent", "air_density", "friction", "thickness", "layer_thickness", "max_speed",
            "tether")]


class _Problem(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in (
        "vertices", "faces", "pinned", "body_vertices", "body_faces", "body_parts", "frames")] + [
        ("start", _FLOAT), ("face", _INT), ("pattern", _FLOAT), ("mass_scale", _FLOAT), ("bend_scale", _FLOAT),
        ("crease", _FLOAT), ("pin", _INT), ("pin_path", _FLOAT), ("body_face", _INT), ("body_part", _INT),
        ("body_path", _FLOAT), ("cloth_part", _MASK), ("origin", _FLOAT), ("wind", _FLOAT), ("settings", Settings)]


@functools.lru_cache(maxsize=None)
def library():
    """The loaded library; FileNotFoundError names the places looked at."""
    name = "libdcloth_cloth_solver.so"
    places = [p for p in (os.environ.get("DCLOTH_CLOTH_SOLVER"),
                          os.path.join(_ROOT, "build", "training", "cloth_solver", name)) if p]
    for path in places:
        if os.path.exists(path):
            loaded = ctypes.CDLL(path)
            loaded.cloth_solver_run.argtypes = [ctypes.POINTER(_Problem), _FLOAT]
            loaded.cloth_solver_run.restype = ctypes.c_int32
            return loaded
    raise FileNotFoundError(f"cloth solver not found at {' or '.join(places)}; build it with "
                            "scripts/build.sh build -DDCLOTH_BUILD_TESTS=OFF, or set DCLOTH_CLOTH_SOLVER to its path")


@dataclass
class Fabric:
    """A piece of sewn cloth: faces [c, 3], pattern [c, 3, 2] m; per vertex, or None: mass_scale [n], bend_scale [n]
    (factors), crease [n] rad (cloth_solver.h)."""
    faces: np.ndarray
    pattern: np.ndarray
    mass_scale: np.ndarray = None
    bend_scale: np.ndarray = None
    crease: np.ndarray = None


@dataclass
class Body:
    """What the cloth touches: faces [g, 3] outward, part [g] numbers of closed surfaces, path [T, b, 3] m."""
    faces: np.ndarray
    part: np.ndarray
    path: np.ndarray


def nothing(frames):
    """No body, for `frames` frames."""
    return Body(np.zeros((0, 3), np.int32), np.zeros(0, np.int32), np.zeros((frames, 0, 3)))


def run(start, fabric, pins, pin_path, body, origin, settings, wind=None, cloth_part=None):
    """Simulate every frame of body.path.

    start [n, 3] m world positions in frame 0, pins [p] vertex numbers, pin_path [T, p, 3] m, origin [T, 3] m a point
    near the cloth, settings: a dict with every field of Settings, wind [T, 3] m/s or None: still air, cloth_part [n]
    bit masks of the body parts each cloth vertex touches, None: all. Returns cloth [k, n, 3] float32: k = T, or fewer
    when the simulation came apart at frame k. ValueError: shapes that do not fit.
    """
    frames, count, keep = len(body.path), len(start), []

    def pointer(array, kind, shape, dtype):
        if array is None:
            return None
        array = np.ascontiguousarray(array, dtype)
        if array.shape != shape:
            raise ValueError(f"array of shape {array.shape} given, {shape} expected")
        keep.append(array)
        return array.ctypes.data_as(kind)

    def floats(array, *shape):
        return pointer(array, _FLOAT, shape, np.float32)

    faces, parts = len(fabric.faces), int(np.max(body.part, initial=-1)) + 1
    out = np.empty((frames, count, 3), np.float32)
    problem = _Problem(
        count, faces, len(pins), body.path.shape[1], len(body.faces), parts, frames,
        floats(start, count, 3), pointer(fabric.faces, _INT, (faces, 3), np.int32), floats(fabric.pattern, faces, 3, 2),
        floats(fabric.mass_scale, count), floats(fabric.bend_scale, count), floats(fabric.crease, count),
        pointer(pins, _INT, (len(pins),), np.int32), floats(pin_path, frames, len(pins), 3),
        pointer(body.faces, _INT, (len(body.faces), 3), np.int32),
        pointer(body.part, _INT, (len(body.faces),), np.int32),
        floats(body.path, frames, body.path.shape[1], 3), pointer(cloth_part, _MASK, (count,), np.uint32),
        floats(origin, frames, 3), floats(wind, frames, 3), Settings(**settings))
    return out[:library().cloth_solver_run(ctypes.byref(problem), out.ctypes.data_as(_FLOAT))]
