"""Alembic (Ogawa): the polygon meshes of an archive with their points in world space, sample by sample.

Only what a cloth cache holds is read: transforms (Xform), polygon meshes, time samplings. Python alone; what the
format looks like is in Alembic's own reader (AbcCoreOgawa, AbcGeom).
"""
from dataclasses import dataclass, field

import numpy as np

from .cache import MAX_BYTES, Cache
from .errors import refuse
from .ogawa import Ogawa, Words

MAX_DEPTH, MAX_OBJECTS, MAX_SAMPLES = 64, 10_000, 1_000_000
ACYCLIC = np.finfo(np.float64).max / 32
_TYPES = {0: "?", 1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4",
          11: "<f8"}
_SCALE, _TRANSLATE, _ROTATE, _MATRIX, _ROTATE_X = 0, 1, 2, 3, 4
_OPERANDS = {_SCALE: 3, _TRANSLATE: 3, _ROTATE: 4, _MATRIX: 16, 4: 1, 5: 1, 6: 1}


@dataclass
class Property:
    name: str
    kind: int                 # 0 compound, 1 scalar, 2 array
    group: object             # children are samples or, of a compound, properties
    dtype: str = ""
    extent: int = 0
    count: int = 0            # samples
    first: int = 0            # samples before `first` equal sample 0, those from `last` on the last one
    last: int = 0
    sampling: int = 0

    def sample(self, index):
        """Numbers of a sample, flat. Equal samples are stored once."""
        index = min(max(index, 0), self.count - 1)
        if index < self.first or self.first == self.last == 0:
            stored = 0
        else:
            stored = min(index, self.last) - self.first + 1
        blob = self.group.data(2 * stored if self.kind == 2 else stored)[16:]   # after a digest of 16 bytes
        if len(blob) % np.dtype(self.dtype).itemsize:
            self.group.file.damaged(f"{len(blob)} bytes of '{self.name}'")
        return np.frombuffer(blob, self.dtype)


@dataclass
class Object:
    path: str
    schema: str
    properties: dict = field(default_factory=dict)
    parent: object = None


class Archive:
    def __init__(self, path):
        self.file = Ogawa(path)
        root = self.file.root
        if len(root) < 6:
            self.file.damaged(f"a root of {len(root)} children")
        self.samplings = self._samplings(Words(self.file, root.data(4), "time samplings"))
        self.metadata = [""]
        words = Words(self.file, root.data(5), "shared metadata")
        while words:
            self.metadata.append(words.text(words.unpack("B")))
        self.objects = []
        self._objects(root.group(2), None, "")

    def _samplings(self, words):
        """[(seconds a cycle or None, times)]"""
        out = []
        while words:
            words.unpack("I")
            cycle, count = words.unpack("d"), words.unpack("I")
            times = np.frombuffer(words.take(8 * count), "<f8")
            if not np.isfinite(times).all() or count == 0:
                self.file.damaged("a time sampling without finite times")
            out.append((None if cycle == ACYCLIC else cycle, times))
        return out

    def seconds(self, prop):
        """Time of each sample."""
        if prop.sampling >= len(self.samplings):
            self.file.damaged(f"'{prop.name}' on time sampling {prop.sampling} of {len(self.samplings)}")
        cycle, times = self.samplings[prop.sampling]
        index = np.arange(prop.count)
        if cycle is None:
            if prop.count > len(times):
                self.file.damaged(f"{prop.count} samples of '{prop.name}' and {len(times)} times")
            return times[:prop.count]
        return times[index % len(times)] + cycle * (index // len(times))

    def _objects(self, group, parent, path):
        waiting = [(group, parent, path, 0)]     # not recursive: a cycle of offsets ends at the depth limit
        while waiting:
            group, parent, path, depth = waiting.pop()
            if depth > MAX_DEPTH or len(self.objects) > MAX_OBJECTS:
                self.file.damaged(f"objects nested deeper than {MAX_DEPTH} or more than {MAX_OBJECTS}")
            if len(group) < 2:
                continue
            words, child = Words(self.file, group.data(len(group) - 1)[:-32], "object headers"), 0
            while words:
                name = words.text(words.unpack("I"))
                metadata, child = self._metadata(words, words.unpack("B"), "I"), child + 1
                schema = dict(p.split("=", 1) for p in metadata.split(";") if "=" in p).get("schema", "")
                below = group.group(child)
                one = Object(f"{path}/{name}", schema, parent=parent)
                if len(below):
                    one.properties = self._properties(below.group(0))
                self.objects.append(one)
                waiting.append((below, one, one.path, depth + 1))

    def _metadata(self, words, index, size_code):
        if index == 0xff:
            return words.text(words.unpack(size_code))
        if index >= len(self.metadata):
            self.file.damaged(f"metadata {index} of {len(self.metadata)}")
        return self.metadata[index]

    def _properties(self, group):
        out = {}
        if len(group) == 0:
            return out
        words, index = Words(self.file, group.data(len(group) - 1), "property headers"), 0
        while words:
            info = words.unpack("I")
            kind, code = info & 3, "BHII"[info >> 2 & 3]
            prop = Property("", min(kind, 2), group.group(index))
            if kind:
                prop.dtype = _TYPES.get(info >> 4 & 15, "u1")    # texts are never looked at
                prop.extent, prop.count = info >> 12 & 0xff, words.unpack(code)
                prop.first, prop.last = (0, 0) if info & 0x800 else (1, prop.count - 1)
                if info & 0x200:
                    prop.first, prop.last = words.unpack(code), words.unpack(code)
                if info & 0x100:
                    prop.sampling = words.unpack(code)
            if prop.count > MAX_SAMPLES or not prop.first <= max(prop.last, 1) <= max(prop.count, 1):
                self.file.damaged(f"a property of {prop.count} samples, of which {prop.first} to {prop.last} differ")
            prop.name = words.text(words.unpack(code))
            self._metadata(words, info >> 20 & 0xff, code)
            out[prop.name] = prop
            index += 1
        return out

    def compound(self, item, name):
        prop = item.properties.get(name)
        return self._properties(prop.group) if prop is not None and prop.kind == 0 else {}

    def local(self, item, seconds):
        """A transform's matrix at a time, for column vectors [4, 4]."""
        values = self.compound(item, ".xform")
        if ".ops" not in values or ".vals" not in values:
            return np.eye(4), True
        inherits = bool(values[".inherits"].sample(0)[0]) if ".inherits" in values else True
        kinds, prop = values[".ops"].sample(0), values[".vals"]
        times = self.seconds(prop)
        after = int(np.searchsorted(times, seconds))
        after = min(max(after, 0), len(times) - 1)
        before = after if times[after] <= seconds or after == 0 else after - 1
        numbers = prop.sample(before).astype(np.float64)
        if before != after:
            share = (seconds - times[before]) / (times[after] - times[before])
            numbers = (1 - share) * numbers + share * prop.sample(after)
        out, at = np.eye(4), 0
        for code in kinds:
            kind = int(code) >> 4
            size = _OPERANDS.get(kind, 0)
            part = numbers[at:at + size]
            if size == 0 or len(part) != size or not np.isfinite(part).all():
                self.file.damaged(f"the transform of {item.path}")
            out, at = out @ _operation(kind, part), at + size
        return out, inherits

    def world(self, item, seconds):
        out, item = np.eye(4), item.parent
        while item is not None:
            if item.schema.startswith("AbcGeom_Xform"):
                local, inherits = self.local(item, seconds)
                out = local @ out
                if not inherits:
                    break
            item = item.parent
        return out


def _operation(kind, values):
    out = np.eye(4)
    if kind == _SCALE:
        out[:3, :3] = np.diag(values)
    elif kind == _TRANSLATE:
        out[:3, 3] = values
    elif kind == _MATRIX:
        out = values.reshape(4, 4).T     # stored for row vectors
    else:
        axis = values[:3] if kind == _ROTATE else np.eye(3)[kind - _ROTATE_X]
        length, angle = np.linalg.norm(axis), np.radians(values[-1])
        if length > 0:
            x, y, z = axis / length
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            out[:3, :3] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return out


def _polygons(archive, item, geometry):
    for name in (".faceCounts", ".faceIndices", "P"):
        if name not in geometry or geometry[name].count < 1:
            archive.file.damaged(f"mesh {item.path} without {name}")
    counts, indices = geometry[".faceCounts"].sample(0), geometry[".faceIndices"].sample(0)
    points = len(geometry["P"].sample(0)) // 3
    if (counts < 3).any() or counts.astype(np.int64).sum() != len(indices) or \
            (len(indices) and not 0 <= indices.min() <= indices.max() < points):
        archive.file.damaged(f"faces of mesh {item.path} beyond its {points} points")
    ends = np.cumsum(counts.astype(np.int64))
    return [tuple(indices[end - count:end].tolist()) for end, count in zip(ends, counts)]


def read(path, mesh=None):
    """Cache of the mesh of that name (its object or transform; may be left out where there is only one)."""
    archive = Archive(path)
    meshes = [o for o in archive.objects if o.schema.startswith(("AbcGeom_PolyMesh", "AbcGeom_SubD"))]
    chosen = [o for o in meshes if mesh is None or mesh in o.path.split("/") or mesh == o.path]
    if len(chosen) != 1:
        refuse(path, f"meshes {', '.join(o.path for o in meshes[:20]) or '(none)'}",
               "one mesh" if mesh is None else f"one mesh named '{mesh}'", 'name it: "mesh": "NAME"')
    item = chosen[0]
    geometry = archive.compound(item, ".geom")
    polygons = _polygons(archive, item, geometry)
    topology = [geometry[name] for name in (".faceCounts", ".faceIndices")]
    if any(p.count > 1 and p.last > 0 for p in topology):
        refuse(path, f"faces of {item.path} that change over time", "one topology in all frames",
               "export without remeshing, adaptive subdivision or tearing")
    points = geometry["P"]
    # A mesh that stands still under a moving transform has one sample of points and many of its parents.
    clock, parent = points, item.parent
    while parent is not None:
        moving = archive.compound(parent, ".xform").get(".vals")
        if moving is not None and moving.count > clock.count:
            clock = moving
        parent = parent.parent
    seconds = archive.seconds(clock)
    shape = (len(seconds), len(points.sample(0)) // 3, 3)
    if np.prod(shape, dtype=object) * 4 > MAX_BYTES:
        archive.file.damaged(f"points of shape {shape}")
    positions = np.empty(shape, np.float32)
    for at, time in enumerate(seconds):
        local = points.sample(at)
        if len(local) != 3 * shape[1]:
            refuse(path, f"{len(local) // 3} vertices", f"{shape[1]} as in the first frame",
                   "export with vertex order kept, without remeshing", at)
        matrix = archive.world(item, time)
        with np.errstate(all="ignore"):    # what overflows is refused with its frame and vertex
            positions[at] = local.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return Cache(path, positions, seconds, polygons, inward=True)
