#!/usr/bin/env python3
"""Files of a release that no compiler makes (scripts/package.sh).

Usage: package_files.py version
       package_files.py sequence IN.safetensors OUT.safetensors
       package_files.py clip IN.safetensors OUT.safetensors FRAMES
       package_files.py apart A.safetensors B.safetensors MM
       package_files.py examples FOLDER
       package_files.py archive FOLDER OUT.tar.xz|OUT.zip SECONDS

version: prints the project's, after comparing it with the packages that repeat it. sequence: the motion without the
simulated cloth. clip: the first FRAMES of motion and cloth. apart: how far the vertices of two outputs of `dcloth run`
are from each other; more than MM is an error. examples: the host and CMakeLists.txt that docs/integrate.md shows.
archive: FOLDER with all names sorted, every time SECONDS since 1970 and no owners, so that the same files are the same
archive.
"""
import array
import json
import lzma
import re
import struct
import sys
import tarfile
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def version():
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"project\(dcloth VERSION (\d+\.\d+\.\d+)", text)
    if found is None:
        sys.exit("package_files: CMakeLists.txt has no project(dcloth VERSION ...)")
    for name in ("platforms/web/package.json", "platforms/unity/package.json"):
        said = json.loads((ROOT / name).read_text(encoding="utf-8"))["version"]
        if said != found[1]:
            sys.exit(f"package_files: {name}: version {said}; CMakeLists.txt says {found[1]}; make them equal")
    print(found[1])


def read(source):
    """The header of a .safetensors file and the bytes of its tensors."""
    data = Path(source).read_bytes()
    size = struct.unpack_from("<Q", data)[0]
    return json.loads(data[8:8 + size]), data[8 + size:]


def rewrite(source, out, change):
    """A sequence with the tensors that `change` keeps: (name, entry) -> bytes of the tensor, or None."""
    header, data = read(source)
    kept, body = {}, b""
    for name, entry in header.items():
        if name == "__metadata__":
            kept[name] = entry
            continue
        begin, end = entry["data_offsets"]
        tensor = change(name, entry, data[begin:end])
        if tensor is not None:
            kept[name] = {**entry, "data_offsets": [len(body), len(body) + len(tensor)]}
            body += tensor
    if "joint_matrices" not in kept:
        sys.exit(f"package_files: {source}: no joint_matrices; allowed: a sequence")
    text = json.dumps(kept, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    Path(out).write_bytes(struct.pack("<Q", len(text)) + text + body)


def sequence(source, out):
    rewrite(source, out, lambda name, _, data: None if name.startswith("truth") else data)


def clip(source, out, frames):
    def first(_, entry, data):
        count = min(int(frames), entry["shape"][0])
        kept = data[:len(data) // entry["shape"][0] * count]
        entry["shape"][0] = count
        return kept
    rewrite(source, out, first)


def apart(first, second, allowed_mm):
    (shape, a), (other_shape, b) = map(positions, (first, second))
    if shape != other_shape or not a:
        sys.exit(f"package_files: {first} has positions of shape {shape}, {second} of {other_shape}")
    worst = 0
    for i in range(0, len(a), 3):
        square = (a[i] - b[i]) ** 2 + (a[i + 1] - b[i + 1]) ** 2 + (a[i + 2] - b[i + 2]) ** 2
        if not square <= worst:  # NaN stays
            worst = square
    said = f"{shape[0]} frames, within {1000 * worst ** 0.5:.6f} mm"
    if not 1000 * worst ** 0.5 <= float(allowed_mm):
        sys.exit(f"package_files: {first} and {second}: {said}; allowed: {allowed_mm} mm")
    print(said)


def positions(source):
    header, data = read(source)
    begin, end = header["positions"]["data_offsets"]
    return header["positions"]["shape"], array.array("f", data[begin:end])


def examples(folder):
    page = (ROOT / "docs/integrate.md").read_text(encoding="utf-8")
    for language, begins, name in (("c", "#include", "game.c"), ("cmake", "cmake_minimum", "CMakeLists.txt")):
        blocks = re.findall(rf"^```{language}\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
        blocks = [block for block in blocks if block.startswith(begins)]
        if len(blocks) != 1:
            sys.exit(f"package_files: docs/integrate.md: {len(blocks)} blocks of {language} begin with {begins}; "
                     "expected: 1")
        Path(folder, name).write_text(blocks[0], encoding="utf-8")


def archive(folder, out, seconds):
    folder, part, seconds = Path(folder), Path(out + ".part"), int(seconds)
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    if not files:
        sys.exit(f"package_files: {folder} is empty")
    names = [(path, f"{folder.name}/{name}", 0o755 if path.stat().st_mode & 0o100 else 0o644)
             for name, path in sorted(files.items())]
    if out.endswith(".zip"):
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
            for path, name, mode in names:
                info = zipfile.ZipInfo(name, time.gmtime(max(seconds, 315532800))[:6])
                info.create_system, info.external_attr = 3, (0o100000 | mode) << 16
                info.compress_type = zipfile.ZIP_DEFLATED
                packed.writestr(info, path.read_bytes())
    else:
        with (lzma.open(part, "wb", preset=1) as stream,
              tarfile.open(fileobj=stream, mode="w", format=tarfile.GNU_FORMAT) as packed):
            for path, name, mode in names:
                info = tarfile.TarInfo(name)
                info.size, info.mtime, info.mode = path.stat().st_size, seconds, mode
                with path.open("rb") as data:
                    packed.addfile(info, data)
    part.replace(out)


def main():
    commands = {"version": (version, 0), "sequence": (sequence, 2), "clip": (clip, 3),
                "apart": (apart, 3), "examples": (examples, 1), "archive": (archive, 3)}
    command, count = commands.get(sys.argv[1] if len(sys.argv) > 1 else "", (None, 0))
    if command is None or len(sys.argv) != 2 + count:
        sys.exit(__doc__)
    command(*sys.argv[2:])


if __name__ == "__main__":
    main()
