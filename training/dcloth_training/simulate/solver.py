"""The cloth solver (training/cloth_solver, C++) called from Python: one simulation, one thread.

The library is found at $DCLOTH_CLOTH_SOLVER or in build/training beside this checkout;
`scripts/build.sh build -DDCLOTH_BUILD_TESTS=OFF` makes it.
"""
import ctypes
import functools
import os

import numpy as np

_ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
_INT, _FLOAT = ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(ctypes.c_float)
_MASK = ctypes.POINTER(ctypes.c_uint32)


class Settings(ctypes.Structure):
    """cloth_solver_settings: see training/cloth_solver/cloth_solver.h."""
    _fields_ = [("steps", ctypes.c_int32)] + [(name, ctypes.c_float) for name in (
        "frame_seconds", "density", "stretch_compliance", "bend_stiffness",
        "brace_stiffness", "drag_normal", "drag_tangent", "air_follows", "smoothing", "thickness", "contact_drag", "tether")]


class _Problem(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in (
        "vertices", "faces", "pinned", "body_vertices", "body_faces", "body_parts", "frames")] + [
        ("rest", _FLOAT), ("face", _INT), ("pin", _INT), ("pin_path", _FLOAT),
        ("body_face", _INT), ("body_path", _FLOAT), ("body_part", _MASK), ("cloth_part", _MASK),
        ("hips", _FLOAT), ("yoke", ctypes.c_float), ("settings", Settings)]


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


def run(rest, faces, pins, pin_path, body_faces, body_path, body_part, hips, settings,
        yoke=0.0, cloth_part=None):
    """Simulate every frame.

    rest [n, 3] m where the simulation starts, faces [c, 3], pins [p], pin_path [T, p, 3],
    body_faces [g, 3], body_path [T, b, 3], body_part [b] bit masks, hips [T, 4, 4] world matrices,
    settings: a dict with every field of Settings, yoke: m, see cloth_solver.h, cloth_part [n] bit masks of the parts
    each cloth vertex touches, None: all. Returns cloth [k, n, 3] float32: k = T, or fewer when the simulation came
    apart at frame k.
    """
    rest, pin_path, body_path, hips = (np.ascontiguousarray(a, np.float32) for a in (
        rest, pin_path, body_path, np.asarray(hips)[:, :3]))
    faces, pins, body_faces = (np.ascontiguousarray(a, np.int32) for a in (
        faces, pins, body_faces))
    body_part = np.ascontiguousarray(body_part, np.uint32)
    if cloth_part is not None:
        cloth_part = np.ascontiguousarray(cloth_part, np.uint32)
        if cloth_part.shape != (len(rest),):
            raise ValueError(f"cloth_part has shape {cloth_part.shape}, ({len(rest)},) expected")
    frames = len(body_path)
    if not len(pin_path) == len(hips) == frames:
        raise ValueError(f"{frames} body frames, {len(pin_path)} pin frames, {len(hips)} of the hips")
    out = np.empty((frames,) + rest.shape, np.float32)

    def pointer(array, kind=_FLOAT):
        return array.ctypes.data_as(kind)

    problem = _Problem(
        len(rest), len(faces), len(pins), body_path.shape[1], len(body_faces),
        int(body_part.max(initial=0)).bit_length(), frames, pointer(rest), pointer(faces, _INT),
        pointer(pins, _INT), pointer(pin_path), pointer(body_faces, _INT), pointer(body_path),
        pointer(body_part, _MASK),
        None if cloth_part is None else pointer(cloth_part, _MASK), pointer(hips), yoke,
        Settings(**settings))
    return out[:library().cloth_solver_run(ctypes.byref(problem), pointer(out))]
