"""Finds the C++ libraries of training/ that compute a stage's window and its gradient."""
import ctypes
import os

_ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))


def load(name, shape, sizes, pointers):
    """The library `name` at $DCLOTH_<NAME> or in build/training of this checkout; FileNotFoundError names both.

    sizes: <name>_<size>_size(shape*) of each. pointers {call: pointers behind the shape*} of <name>_<call>_f32, _f64.
    """
    variable = f"DCLOTH_{name.upper()}"
    places = [p for p in (os.environ.get(variable), os.path.join(
        _ROOT, "build", "training", name, f"libdcloth_{name}.so")) if p]
    path = next((p for p in places if os.path.exists(p)), None)
    if path is None:
        raise FileNotFoundError(f"{name} not found at {' or '.join(places)}; build it with scripts/build.sh build "
                                f"-DDCLOTH_BUILD_TESTS=OFF, or set {variable} to its path")
    loaded, first = ctypes.CDLL(path), ctypes.POINTER(shape)
    for size in sizes:
        call = getattr(loaded, f"{name}_{size}_size")
        call.argtypes, call.restype = [first], ctypes.c_int64
    for kind in ("f32", "f64"):
        for what, count in pointers.items():
            call = getattr(loaded, f"{name}_{what}_{kind}")
            call.argtypes, call.restype = [first] + [ctypes.c_void_p] * count, ctypes.c_int32
    return loaded
