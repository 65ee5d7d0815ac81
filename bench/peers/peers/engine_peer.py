"""dcloth itself, through the shared library that engine.h describes."""
import ctypes
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_uint32, c_uint64, c_void_p

import numpy as np

STEPS = ("pose", "static", "skeleton", "mesh", "displacement", "skinning", "normals", "penetration")
NETWORK_STEPS = ("static", "skeleton", "mesh", "displacement")


class _Times(ctypes.Structure):
    _fields_ = [("steps", c_uint64 * len(STEPS)), ("whole", c_uint64)]


_SIGNATURES = {"peers_error": (c_char_p,), "peers_open": (c_void_p, c_char_p, c_char_p),
               "peers_open_times": (c_int, c_char_p, c_int, c_uint32, POINTER(c_double)),
               "peers_model_bytes": (c_uint64, c_void_p), "peers_instance_bytes": (c_uint64, c_void_p),
               "peers_isa": (c_char_p,), "peers_reset": (c_int, c_void_p),
               "peers_tick": (c_int, c_void_p, c_uint32, POINTER(_Times)),
               "peers_positions": (POINTER(c_float), c_void_p, POINTER(c_uint32)), "peers_evict": (None,),
               "peers_evicted_bytes": (c_uint64,), "peers_read_rate": (c_double, c_uint64),
               "peers_fma_rate": (c_double, c_uint32)}


class Library:
    """libdcloth_peers.so; its functions without their prefix."""

    def __init__(self, path):
        library = ctypes.CDLL(str(path))
        for name, (result, *arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
            setattr(self, name[len("peers_"):], function)

    def open_milliseconds(self, model, cold, count):
        """[count] of dcloth_model_open on a file's bytes, called from C++."""
        spent = (c_double * count)()
        if self.open_times(str(model).encode(), cold, count, spent) != 0:
            raise RuntimeError(self.error().decode())
        return list(spent)


class EnginePeer:
    """A .dcloth model on a sequence. A tick is the whole frame: features, network, skinning and normals."""

    name, note, tried = "dcloth", "", ()

    def __init__(self, library, model, sequence, precision, basis_rows):
        self._library, self.precision, self.basis_rows, self._times = library, precision, basis_rows, _Times()
        self._handle = library.open(str(model).encode(), str(sequence).encode())
        if not self._handle:
            raise RuntimeError(library.error().decode())
        self.version = library.isa().decode()
        self.weight_bytes = library.model_bytes(self._handle)
        self.instance_bytes = library.instance_bytes(self._handle)

    def reset(self):
        self._check(self._library.reset(self._handle))

    def tick(self, frame):
        """{step: ns}, with `whole`, the time of the whole frame."""
        self._check(self._library.tick(self._handle, frame, ctypes.byref(self._times)))
        return {**dict(zip(STEPS, self._times.steps)), "whole": self._times.whole}

    def positions(self):
        """[n, 3] of the last tick, world metres; valid until the next one."""
        count = c_uint32()
        data = self._library.positions(self._handle, ctypes.byref(count))
        return np.ctypeslib.as_array(data, (count.value, 3))

    def _check(self, status):
        if status != 0:
            raise RuntimeError(self._library.error().decode())
