"""Writers of point caches for the tests, independent of the readers: PC2, MDD, OBJ sequences, Alembic."""
import struct

import numpy as np


def write_pc2(path, positions, start=0.0, rate=1.0):
    frames, points, _ = positions.shape
    path.write_bytes(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, points, start, rate, frames) +
                     positions.astype("<f4").tobytes())


def write_mdd(path, positions, fps=30.0, first=0.0):
    frames, points, _ = positions.shape
    times = (first + np.arange(frames) / fps).astype(">f4")
    path.write_bytes(struct.pack(">ii", frames, points) + times.tobytes() + positions.astype(">f4").tobytes())


def write_obj(path, points, polygons, digits=17):
    lines = ["# test", "o cloth"] + [f"v {x:.{digits}g} {y:.{digits}g} {z:.{digits}g}" for x, y, z in points]
    lines += ["vt 0 0"] + ["f " + " ".join(f"{v + 1}/1" for v in polygon) for polygon in polygons]
    path.write_text("\n".join(lines) + "\n")


def write_obj_sequence(folder, positions, polygons, first=1):
    folder.mkdir(exist_ok=True)
    for at, points in enumerate(positions):
        write_obj(folder / f"cloth_{first + at:04d}.obj", points, polygons)
    return str(folder / "cloth_*.obj")


class _Ogawa:
    """Byte strings and groups, appended; each call returns what a parent stores of it."""

    def __init__(self):
        self.out = bytearray(b"Ogawa\xff\0\1" + bytes(8))

    def data(self, blob):
        if not blob:
            return 1 << 63
        at = len(self.out)
        self.out += struct.pack("<Q", len(blob)) + blob
        return at | 1 << 63

    def group(self, children):
        if not children:
            return 0
        at = len(self.out)
        self.out += struct.pack(f"<{len(children) + 1}Q", len(children), *children)
        return at


def _header(name, kind, pod=0, extent=0, samples=0, sampling=0, constant=False):
    info = kind | 2 << 2 | pod << 4 | (0x100 if sampling else 0) | (0x800 if constant else 0) | extent << 12
    out = struct.pack("<I", info)
    if kind:
        out += struct.pack("<I", samples) + (struct.pack("<I", sampling) if sampling else b"")
    return out + struct.pack("<I", len(name)) + name.encode()


def write_alembic(path, positions, polygons, fps=30.0, first=0.0, name="cloth"):
    """One PolyMesh under the root, samples at a uniform rate, faces clockwise as Alembic wants them."""
    ogawa, key = _Ogawa(), bytes(16)
    frames = len(positions)
    points = [ogawa.data(key + p.astype("<f4").tobytes()) for p in positions]
    dimensions = ogawa.data(b"")
    indices = np.concatenate([np.array(p[::-1]) for p in polygons]).astype("<i4")
    counts = np.array([len(p) for p in polygons], "<i4")
    geometry = ogawa.group([
        ogawa.group([x for p in points for x in (p, dimensions)]),
        ogawa.group([ogawa.data(key + indices.tobytes()), dimensions]),
        ogawa.group([ogawa.data(key + counts.tobytes()), dimensions]),
        ogawa.data(_header("P", 2, 10, 3, frames, 1) + _header(".faceIndices", 2, 6, 1, 1, 0, True) +
                   _header(".faceCounts", 2, 6, 1, 1, 0, True))])
    properties = ogawa.group([geometry, ogawa.data(_header(".geom", 0))])
    mesh = ogawa.group([properties, ogawa.data(bytes(32))])
    schema = b"schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1"
    headers = struct.pack("<I", len(name)) + name.encode() + b"\xff" + struct.pack("<I", len(schema)) + schema
    top = ogawa.group([ogawa.group([]), mesh, ogawa.data(headers + bytes(32))])
    samplings = struct.pack("<IdId", frames, 1.0, 1, 0.0) + struct.pack("<IdId", frames, 1 / fps, 1, first)
    root = ogawa.group([ogawa.data(struct.pack("<i", 0)), ogawa.data(struct.pack("<i", 10803)), top, ogawa.data(b""),
                        ogawa.data(samplings), ogawa.data(b"")])
    ogawa.out[8:16] = struct.pack("<Q", root)
    path.write_bytes(bytes(ogawa.out))
