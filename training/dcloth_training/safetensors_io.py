"""A small, strict safetensors reader and writer on numpy alone.

Layout: u64 header length, JSON header {name: {dtype, shape, data_offsets}}, then the tensors.
Files are untrusted: a bad header, overlap, hole or truncation is refused with the file, the
tensor, what was found and what was expected. Writing is atomic (temporary file, then rename).
"""
import json
import os
import struct

import numpy as np

MAX_HEADER_BYTES = 16 << 20
_DTYPES = {"BOOL": "?", "U8": "<u1", "I8": "<i1", "U16": "<u2", "I16": "<i2", "U32": "<u4",
           "I32": "<i4", "U64": "<u8", "I64": "<i8", "F16": "<f2", "F32": "<f4", "F64": "<f8"}
_CODES = {np.dtype(v): k for k, v in _DTYPES.items()}


class SafetensorsError(ValueError):
    """A file that is not a valid safetensors file, or data that cannot be written as one."""


def write(path, tensors, metadata=None):
    """Write {name: array} and metadata {str: str} to `path`; nothing half-written is left."""
    header, blobs, offset = {}, [], 0
    if metadata:
        for key, value in metadata.items():
            if not isinstance(key, str) or not isinstance(value, str):
                raise SafetensorsError(f"{path}: metadata '{key}' must map a string to a string")
        header["__metadata__"] = dict(metadata)
    # Widest types first keeps every tensor aligned to its element size.
    order = sorted(tensors, key=lambda name: (-np.asarray(tensors[name]).dtype.itemsize, name))
    for name in order:
        array = np.asarray(tensors[name])
        code = _CODES.get(array.dtype.newbyteorder("<"))
        if code is None or name == "__metadata__":
            raise SafetensorsError(f"{path}: tensor '{name}': dtype {array.dtype} or name not "
                                   f"supported, expected one of {sorted(_DTYPES)}")
        blob = np.ascontiguousarray(array, dtype=_DTYPES[code]).tobytes()
        header[name] = {"dtype": code, "shape": list(array.shape),
                        "data_offsets": [offset, offset + len(blob)]}
        offset += len(blob)
        blobs.append(blob)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    # A long name leaves no room for more: file systems end at 255 bytes, some at 143.
    folder, name = os.path.split(path)
    name = "dcloth" if len(os.fsencode(name)) > 100 else name
    temporary = os.path.join(folder, f"{name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            file.write(struct.pack("<Q", len(text)) + text)
            for blob in blobs:
                file.write(blob)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise


def _read_header(path, file):
    size = os.fstat(file.fileno()).st_size
    prefix = file.read(8)
    if len(prefix) < 8:
        raise SafetensorsError(f"{path}: {size} bytes, expected at least 8")
    length = struct.unpack("<Q", prefix)[0]
    if length > MAX_HEADER_BYTES or 8 + length > size:
        raise SafetensorsError(f"{path}: header of {length} bytes, expected at most "
                               f"{min(MAX_HEADER_BYTES, size - 8)}")

    def unique(pairs):
        if len({k for k, _ in pairs}) != len(pairs):
            raise SafetensorsError(f"{path}: a key appears twice in the header")
        return dict(pairs)

    try:
        header = json.loads(file.read(length).decode("utf-8"), object_pairs_hook=unique)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise SafetensorsError(f"{path}: header is not JSON: {error}") from None
    if not isinstance(header, dict):
        raise SafetensorsError(f"{path}: header is {type(header).__name__}, expected an object")
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict) or not all(isinstance(v, str) for v in metadata.values()):
        raise SafetensorsError(f"{path}: __metadata__ must map strings to strings")
    return header, metadata, 8 + length, size - 8 - length


def _is_count(value):
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 48


def _check(path, name, entry, data_bytes):
    """One header entry -> (begin, end, dtype, shape)."""
    def refuse(found, expected):
        raise SafetensorsError(f"{path}: tensor '{name}': found {found}, expected {expected}")

    if not isinstance(entry, dict) or set(entry) != {"dtype", "shape", "data_offsets"}:
        refuse(entry, "dtype, shape and data_offsets")
    dtype, shape, offsets = entry["dtype"], entry["shape"], entry["data_offsets"]
    if not isinstance(dtype, str) or dtype not in _DTYPES:
        refuse(f"dtype {dtype}", f"one of {sorted(_DTYPES)}")
    if not isinstance(shape, list) or len(shape) > 32 or not all(map(_is_count, shape)):
        refuse(f"shape {shape}", "a list of counts")
    if not isinstance(offsets, list) or len(offsets) != 2 or not all(map(_is_count, offsets)):
        refuse(f"data_offsets {offsets}", "two byte offsets")
    size = np.dtype(_DTYPES[dtype]).itemsize
    for extent in shape:  # Python integers do not wrap, unlike numpy's product
        size *= extent
    if offsets[1] - offsets[0] != size:
        refuse(f"{offsets[1] - offsets[0]} bytes", f"{size} for {dtype} {shape}")
    if offsets[1] > data_bytes:
        refuse(f"end at byte {offsets[1]}", f"at most {data_bytes} (file truncated?)")
    return offsets[0], offsets[1], _DTYPES[dtype], shape


def read(path, names=None, without=()):
    """Read a file -> ({name: array}, metadata). `names` limits what is loaded; what `without` names is not."""
    with open(path, "rb") as file:
        header, metadata, start, data_bytes = _read_header(path, file)
        spans = {name: _check(path, name, entry, data_bytes) for name, entry in header.items()}
        at = 0
        for name, (begin, end, _, _) in sorted(spans.items(), key=lambda s: s[1][:2]):
            if begin != at:
                raise SafetensorsError(f"{path}: tensor '{name}': begins at byte {begin}, "
                                       f"expected {at} ({'overlap' if begin < at else 'hole'})")
            at = end
        if at != data_bytes:
            raise SafetensorsError(f"{path}: tensors end at byte {at}, file's data at {data_bytes}")
        out = {}
        for name in spans if names is None else names:
            if name in without:
                continue
            if name not in spans:
                raise SafetensorsError(f"{path}: no tensor '{name}', found {sorted(spans)}")
            begin, end, dtype, shape = spans[name]
            file.seek(start + begin)
            out[name] = np.frombuffer(file.read(end - begin), dtype=dtype).reshape(shape).copy()
    return out, metadata
