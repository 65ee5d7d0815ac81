"""Safetensors in a few lines: what the tests write and read. Independent of the product's own reader on purpose."""
import json
import struct

import numpy as np

_NAMES = {"float32": "F32", "float16": "F16", "int32": "I32", "uint8": "U8", "float64": "F64", "int64": "I64",
          "uint16": "BF16"}  # NumPy has no bfloat16: the upper halves of float32
_TYPES = {"F32": np.float32, "F16": np.float16, "I32": np.int32, "U8": np.uint8}


def write(path, tensors, metadata):
    header, offset = {"__metadata__": metadata}, 0
    for name, value in tensors.items():
        header[name] = {"dtype": _NAMES[value.dtype.name], "shape": list(value.shape),
                        "data_offsets": [offset, offset + value.nbytes]}
        offset += value.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as out:
        out.write(struct.pack("<Q", len(text)) + text)
        for value in tensors.values():
            out.write(np.ascontiguousarray(value).tobytes())


def read(path):
    with open(path, "rb") as file:
        data = file.read()
    size, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8:8 + size])
    metadata = header.pop("__metadata__", {})
    body, tensors = data[8 + size:], {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        tensors[name] = np.frombuffer(body[begin:end], _TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata
