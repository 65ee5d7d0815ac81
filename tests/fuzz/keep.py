#!/usr/bin/env python3
"""Keeps of what fuzzers found the inputs that reach every edge: tests/fuzz/kept/TARGET.pack, which fuzz_replay runs in
every build.

Usage: keep.py FUZZERS FOLDER [TARGET...]    after scripts/fuzz.sh: keep.py build-fuzz out/fuzz

A pack holds inputs one behind the other, each after its length (32 bits, little-endian). Inputs above a target's limit
are left out: the edges that only they reach are few, and they would be most of the bytes.
"""
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

KEPT = Path(__file__).resolve().parent / "kept"
MOST_BYTES = {"model": 8192, "bundle": 3072, "gltf": 3072}


def smallest_cover(fuzzer, folders, most):
    with tempfile.TemporaryDirectory() as scratch:
        candidates, cover = Path(scratch, "candidates"), Path(scratch, "cover")
        candidates.mkdir(), cover.mkdir()
        for folder in folders:
            for file in folder.iterdir():
                if file.stat().st_size <= most:
                    (candidates / file.name).write_bytes(file.read_bytes())
        result = subprocess.run([fuzzer, "-set_cover_merge=1", cover, candidates], capture_output=True)
        if result.returncode != 0:
            sys.exit(result.stderr.decode(errors="replace")[-2000:])
        inputs = [file.read_bytes() for file in cover.iterdir()]
        return sorted(inputs, key=lambda data: (len(data), data)), len(list(candidates.iterdir()))


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    fuzzers, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    for target in sys.argv[3:] or sorted(path.name for path in (folder / "corpus").iterdir()):
        inputs, all_inputs = smallest_cover(fuzzers / f"fuzz_{target}",
                                            [folder / "corpus" / target, folder / "seeds" / target],
                                            MOST_BYTES.get(target, 1 << 16))
        pack = b"".join(struct.pack("<I", len(data)) + data for data in inputs)
        (KEPT / f"{target}.pack").write_bytes(pack)
        print(f"{target}: {len(inputs)} of {all_inputs} inputs, {len(pack)} bytes")


if __name__ == "__main__":
    main()
