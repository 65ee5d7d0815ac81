#!/usr/bin/env python3
"""Takes what a page draws of a character out of a training bundle: skin, its weights, the bind pose.

Usage: extract_character.py BUNDLE OUT   (both .safetensors; converter/BUNDLE.md names the tensors)
"""
import json
import struct
import sys

TENSORS = ("body.positions", "body.faces", "body.joint_weights", "character.bind")
OPTIONAL = ("body.colours",)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    source, target = sys.argv[1:]
    with open(source, "rb") as file:
        data = file.read()
    size, = struct.unpack_from("<Q", data)
    header = json.loads(data[8:8 + size])
    missing = [name for name in TENSORS if name not in header]
    if missing:
        sys.exit(f"extract_character: {source} lacks {', '.join(missing)}; mend: export the bundle with its character")
    metadata = {key: header["__metadata__"][key] for key in ("garment", "joint_names")}
    taken, parts, at = {"__metadata__": metadata}, [], 0
    for name in TENSORS + tuple(name for name in OPTIONAL if name in header):
        entry = header[name]
        begin, end = entry["data_offsets"]
        parts.append(data[8 + size + begin:8 + size + end])
        taken[name] = {**entry, "data_offsets": [at, at + end - begin]}
        at += end - begin
    text = json.dumps(taken).encode()
    text += b" " * (-len(text) % 8)
    with open(target, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(parts))


if __name__ == "__main__":
    main()
