"""What opening a model takes: the shared library's dcloth_model_open, called as a host in another language does."""
import ctypes
import time
from ctypes import POINTER, byref, c_char_p, c_int, c_size_t, c_void_p

import numpy as np

ALIGNMENT = 64


def aligned(size):
    """Bytes that start where the engine wants them."""
    memory = np.zeros(size + ALIGNMENT, np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return memory[start:start + size]


class Opener:
    def __init__(self, library):
        self._library = ctypes.CDLL(str(library))
        self._library.dcloth_model_storage_size.restype = c_size_t
        self._library.dcloth_version.restype = c_char_p
        self._library.dcloth_model_open.restype = c_int
        self._library.dcloth_model_open.argtypes = (c_void_p, c_size_t, c_void_p, c_size_t, POINTER(c_void_p), c_void_p)

    def milliseconds(self, path, evict, repeats):
        """[ms] of `repeats` calls on one model's bytes, each after evict()."""
        data = np.fromfile(path, np.uint8)
        model, view = aligned(len(data)), aligned(self._library.dcloth_model_storage_size())
        model[:] = data
        handle, spent = c_void_p(), []
        arguments = (model.ctypes.data, len(model), view.ctypes.data, len(view), byref(handle), None)
        for _ in range(repeats):
            evict()
            start = time.perf_counter_ns()
            status = self._library.dcloth_model_open(*arguments)
            spent.append((time.perf_counter_ns() - start) * 1e-6)
            if status != 0:
                raise RuntimeError(f"{path}: dcloth_model_open gave status {status}")
        return spent
