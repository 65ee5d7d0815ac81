"""Reads and writes .safetensors files: the safetensors library, atomic writes, and errors that name the file.

Files are untrusted. The library refuses bad headers, overlaps, holes and truncation; what it says is raised as
SafetensorsError with the path in front. The same tensors and metadata always give the same bytes.
"""
import json
import os
import struct

import numpy as np
import safetensors
import safetensors.numpy

_KINDS = "?bhilqBHILQefd"    # numpy's characters for bool, integers and floats of 16 to 64 bits


class SafetensorsError(ValueError):
    """A file that is not a valid safetensors file, or data that cannot be written as one."""


def _parts(path, arrays, metadata):
    """The file's header and data. Metadata stays in the order given: the library would shuffle it."""
    for key, value in metadata.items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise SafetensorsError(f"{path}: metadata '{key}' must map a string to a string")
    blob = safetensors.numpy.save(arrays)
    length, = struct.unpack("<Q", blob[:8])
    header = json.loads(blob[8:8 + length])
    text = json.dumps({"__metadata__": dict(metadata), **header} if metadata else header,
                      separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text, memoryview(blob)[8 + length:]


def write(path, tensors, metadata=None):
    """Write {name: array} and metadata {str: str} to `path`; nothing half-written is left."""
    arrays = {name: np.ascontiguousarray(array).reshape(np.shape(array)) for name, array in tensors.items()}
    for name, array in arrays.items():
        if array.dtype.char not in _KINDS or name == "__metadata__":
            raise SafetensorsError(f"{path}: tensor '{name}': dtype {array.dtype} or name not supported, expected "
                                   f"booleans, integers or floats of 16 to 64 bits")
    parts = _parts(path, arrays, metadata or {})
    # A long name leaves no room for more: file systems end at 255 bytes, some at 143.
    folder, name = os.path.split(path)
    name = "dcloth" if len(os.fsencode(name)) > 100 else name
    temporary = os.path.join(folder, f"{name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            for part in parts:
                file.write(part)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise


def read(path, names=None, without=()):
    """Read a file -> ({name: array}, metadata). `names` limits what is loaded; what `without` names is not."""
    with open(path, "rb"):      # the library does not say which file is missing
        pass
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            found = list(file.keys())
            missing = [name for name in names or () if name not in found]
            if missing:
                raise SafetensorsError(f"{path}: no tensor '{missing[0]}', found {sorted(found)}")
            wanted = found if names is None else names
            return {name: file.get_tensor(name) for name in wanted if name not in without}, file.metadata() or {}
    except (safetensors.SafetensorError, TypeError, AttributeError, KeyError) as error:
        raise SafetensorsError(f"{path}: not a safetensors file that can be read here: {error}") from None
