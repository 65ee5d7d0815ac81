"""Arrays as the extension module takes them: contiguous, of one number type, of the right shape."""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._error import Error


def packed(value: ArrayLike, dtype: Any, shape: tuple[int | None, ...], name: str) -> NDArray[Any]:
    """`value` as a contiguous array; without a copy where it is one already. None in `shape` allows any size."""
    array = np.ascontiguousarray(value, dtype)
    if array.ndim != len(shape) or any(allowed not in (None, size) for size, allowed in zip(array.shape, shape)):
        allowed = ", ".join("any" if size is None else str(size) for size in shape)
        raise Error("ARGUMENT", f"{name}: found shape {list(np.shape(value))}, allowed: [{allowed}]")
    return array


def matrices(value: ArrayLike, name: str) -> NDArray[np.float32]:
    return packed(value, np.float32, (None, 4, 4), name)


def output(value: NDArray[np.float32], name: str) -> NDArray[np.float32]:
    """An array of the caller's that is written to: never copied, so it must be right as it is."""
    found = f"{type(value).__name__}"
    if isinstance(value, np.ndarray):
        if value.dtype == np.float32 and value.ndim == 2 and value.shape[1] == 3 and value.flags.writeable:
            return value
        found = f"{'' if value.flags.writeable else 'read-only '}{value.dtype} {list(value.shape)}"
    raise Error("ARGUMENT", f"{name}: found {found}, allowed: a writable float32 array [vertex_count, 3]; "
                f"np.empty((model.vertex_count, 3), np.float32) makes one")
