"""A garment's mesh as artists save it (OBJ, glTF): corners with texture coordinates, colours of vertices."""
import base64
import json
import os
import struct
from dataclasses import dataclass

import numpy as np

from ..truth import checks
from ..truth.errors import refuse

MAX_BYTES = 1 << 30
_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass
class Mesh:
    """vertices [n, 3] m, +Y up; faces [c, 3]; uv [c, 3, 2] of the faces' corners, v down as in glTF, or
    None; colours [n, 3] 0 to 1, or None."""
    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray = None
    colours: np.ndarray = None


def _fans(polygons):
    return [(p[0], a, b) for p in polygons for a, b in zip(p[1:], p[2:])]


def read_obj(path, metres, axes):
    points, colours, textures, corners = [], [], [], []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            words = line.split()
            try:
                if words[:1] == ["v"]:
                    points.append([float(x) for x in words[1:4]])
                    if len(points[-1]) != 3 or not np.isfinite(points[-1]).all():
                        raise ValueError
                    if len(words) >= 7:
                        colours.append([float(x) for x in words[4:7]])
                elif words[:1] == ["vt"]:
                    u, v = (float(x) for x in words[1:3])
                    textures.append([u, 1 - v])
                elif words[:1] == ["f"]:
                    polygon = []
                    for word in words[1:]:
                        indices = word.split("/")
                        at = [int(x) if x else 0 for x in indices[:2]] + [0] * (2 - len(indices[:2]))
                        polygon.append((at[0] - 1 if at[0] > 0 else len(points) + at[0],
                                        at[1] - 1 if at[1] > 0 else len(textures) + at[1] if at[1] else -1))
                    if len(polygon) < 3 or min(corner[0] for corner in polygon) < 0:
                        raise ValueError
                    corners.append(polygon)
            except ValueError:
                refuse(f"{path}:{number}", f"'{line.strip()[:60]}'", "v x y z, vt u v, or f with three corners or more",
                       "export the mesh again")
    if not points or not corners:
        refuse(path, f"{len(points)} vertices and {len(corners)} faces", "a mesh with faces",
               "export the garment with its faces")
    triangles = np.array(_fans(corners), np.int64)
    if triangles[..., 0].max() >= len(points) or triangles[..., 1].max() >= len(textures):
        refuse(path, f"a face with vertex {triangles[..., 0].max() + 1} and texture vertex "
                     f"{triangles[..., 1].max() + 1}",
               f"1 to {len(points)} and 1 to {len(textures)}", "export the mesh again")
    uv = np.array(textures, float)[triangles[..., 1]] if len(textures) and (triangles[..., 1] >= 0).all() else None
    return Mesh(checks.canonical(np.array(points), metres, axes), triangles[..., 0], uv,
                np.array(colours) if len(colours) == len(points) else None)


def _glb_parts(path):
    with open(path, "rb") as file:
        data = file.read()
    if data[:4] == b"glTF":
        if len(data) < 20 or struct.unpack("<I", data[4:8])[0] != 2:
            refuse(path, "a binary glTF of another version", "version 2")
        size = struct.unpack("<I", data[12:16])[0]
        text, rest = data[20:20 + size], data[20 + size:]
        binary = rest[8:8 + struct.unpack("<I", rest[:4])[0]] if len(rest) >= 8 else b""
    else:
        text, binary = data, b""
    try:
        return json.loads(text.decode("utf-8")), binary
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        refuse(path, f"no glTF: {error}", ".glb or .gltf", "export the garment again")


class _Gltf:
    """Accessors of a glTF file, each checked against its buffer."""

    def __init__(self, path):
        self.path, (self.document, binary) = path, _glb_parts(path)
        used = set(self.document.get("extensionsRequired", ()))
        packed = used & {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization"}
        if packed:
            refuse(path, f"a mesh packed with {', '.join(sorted(packed))}", "plain glTF",
                   "export it without compression")
        self.buffers = [self._buffer(entry, binary) for entry in self.document.get("buffers", ())]

    def _buffer(self, entry, binary):
        uri = entry.get("uri")
        if uri is None:
            return binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        place = os.path.join(os.path.dirname(os.path.abspath(self.path)), uri)
        if os.path.isabs(uri) or ".." in uri.split("/") or not os.path.isfile(place):
            refuse(self.path, f"a buffer '{uri}'", "a file in the same folder", "export as .glb, which is one file")
        with open(place, "rb") as file:
            return file.read()

    def values(self, number):
        """[count, components] of an accessor."""
        try:
            accessor = self.document["accessors"][number]
            view = self.document["bufferViews"][accessor["bufferView"]]
            kind, width = np.dtype(_KINDS[accessor["componentType"]]), _COUNTS[accessor["type"]]
            buffer = self.buffers[view["buffer"]]
            first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            stride = view.get("byteStride", kind.itemsize * width)
            out = np.ndarray((accessor["count"], width), kind, buffer, first, (stride, kind.itemsize))
        except (KeyError, IndexError, TypeError, ValueError) as error:
            refuse(self.path, f"accessor {number} that does not fit its buffer ({error})", "whole accessors",
                   "export the garment again")
        if accessor.get("normalized"):
            return out.astype(np.float64) / np.iinfo(kind).max
        return out.astype(np.float64 if kind.kind == "f" else np.int64)

    def placed(self):
        """(name of the mesh, mesh, node to world [4, 4]) of every mesh in the scene; a skin's mesh stands where its
        bind pose puts it, as glTF says."""
        nodes = self.document.get("nodes", [])
        out = []

        def visit(number, above, depth):
            if depth > 256 or not 0 <= number < len(nodes):
                refuse(self.path, f"node {number} at depth {depth}", "nodes of the file, at most 256 deep")
            node = nodes[number]
            here = above @ _local(node)
            if "mesh" in node:
                mesh = self.document["meshes"][node["mesh"]]
                out.append((node.get("name") or mesh.get("name", ""), mesh, np.eye(4) if "skin" in node else here))
            for child in node.get("children", ()):
                visit(child, here, depth + 1)

        children = {child for node in nodes for child in node.get("children", ())}
        for root in range(len(nodes)):
            if root not in children:
                visit(root, np.eye(4), 0)
        return out


def _local(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    out = np.eye(4)
    out[:3, :3] = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]) * \
        np.array(node.get("scale", (1, 1, 1)))
    out[:3, 3] = node.get("translation", (0, 0, 0))
    return out


def read_gltf(path, wanted=None):
    file = _Gltf(path)
    placed = file.placed()
    chosen = [entry for entry in placed if wanted is None or wanted in (entry[0], entry[1].get("name"))]
    if not chosen or wanted is None and len(chosen) > 1:
        refuse(path, f"{len(placed)} meshes: {', '.join(name for name, _, _ in placed) or 'none'}",
               "one garment", f"choose it: {path}#{placed[0][0] if placed else 'NAME'}")
    points, faces, uvs, colours = [], [], [], []
    for _, mesh, to_world in chosen:
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) != 4:
                continue
            own = primitive["attributes"]
            at = file.values(own["POSITION"])
            indices = file.values(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(at))
            if len(indices) % 3 or not len(indices) or indices.max() >= len(at):
                refuse(path, f"triangles of {len(indices)} corners up to vertex {indices.max(initial=0)}",
                       f"three corners each, of {len(at)} vertices", "export the garment again")
            corners = indices.reshape(-1, 3)
            faces.append(corners + sum(map(len, points)))
            points.append(at @ to_world[:3, :3].T + to_world[:3, 3])
            uvs.append(file.values(own["TEXCOORD_0"])[corners] if "TEXCOORD_0" in own else None)
            colours.append(file.values(own["COLOR_0"])[:, :3] if "COLOR_0" in own else None)
    if not points:
        refuse(path, "no triangles", "a mesh of triangles", "export the garment again")
    return Mesh(np.concatenate(points), np.concatenate(faces),
                np.concatenate(uvs) if all(u is not None for u in uvs) else None,
                np.concatenate(colours) if all(c is not None for c in colours) else None)


def read(path, unit="m", up="y"):
    """The mesh of "dress.obj", "dress.glb" or, of several in a file, "dress.glb#NAME"."""
    place, _, name = path.partition("#")
    if os.path.isfile(path):
        place, name = path, ""
    if not os.path.isfile(place):
        refuse(place, "no such file", "a garment: .obj, .glb or .gltf")
    if os.path.getsize(place) > MAX_BYTES:
        refuse(place, f"{os.path.getsize(place)} bytes", f"{MAX_BYTES} at most")
    kind = os.path.splitext(place)[1].lower()
    if kind == ".obj":
        return read_obj(place, checks.unit_of(place, unit), checks.axes_of(place, up))
    if kind in (".glb", ".gltf"):
        mesh = read_gltf(place, name or None)
        if not np.isfinite(mesh.vertices).all():
            refuse(place, "positions that are not finite", "finite numbers", "export the garment again")
        return mesh
    refuse(place, f"a name ending '{kind}'", ".obj, .glb or .gltf")


def welded(mesh, within):
    """Vertices closer than `within` m become one, as at seams of a texture; faces that collapse are left out.

    -> Mesh with vertices in the order of their first appearance, number [n] that each vertex got."""
    key = np.round(mesh.vertices / within).astype(np.int64)
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    number = rank[number.reshape(-1)]
    faces = number[mesh.faces]
    good = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    first = first[order]
    faces = faces[good]
    used = np.unique(faces)
    dense = np.full(len(first), -1)
    dense[used] = np.arange(len(used))
    return Mesh(mesh.vertices[first][used], dense[faces], None if mesh.uv is None else mesh.uv[good],
                None if mesh.colours is None else mesh.colours[first][used]), dense[number]


def refined(mesh, times):
    """Every triangle cut in four, `times` times."""
    for _ in range(times):
        count = len(mesh.vertices)
        sides = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, 1)], -1), -1)
        edges, number = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
        middle = count + number.reshape(-1, 3)
        a, b, c = mesh.faces.T
        ab, bc, ca = middle.T
        faces = np.concatenate([np.stack(f, 1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        uv = None
        if mesh.uv is not None:
            ua, ub, uc = (mesh.uv[:, k] for k in range(3))
            mab, mbc, mca = 0.5 * (ua + ub), 0.5 * (ub + uc), 0.5 * (uc + ua)
            uv = np.concatenate([np.stack(f, 1)
                                 for f in ((ua, mab, mca), (mab, ub, mbc), (mca, mbc, uc), (mab, mbc, mca))])
        colours = None if mesh.colours is None else np.concatenate([mesh.colours, mesh.colours[edges].mean(1)])
        mesh = Mesh(np.concatenate([mesh.vertices, mesh.vertices[edges].mean(1)]), faces, uv, colours)
    return mesh
