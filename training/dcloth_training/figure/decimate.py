"""Fewer triangles: edges collapse onto one of their ends, shortest and flattest first.

The vertices that stay do not move, so one decimation serves every shape of a body and its skin weights too.
Error quadrics: Garland and Heckbert, "Surface simplification using quadric error metrics", 1997.
"""
import heapq

import numpy as np

MIN_QUALITY = 0.22             # of a new triangle: 1 is equilateral, 0 a line
LINE_WEIGHT = 4.0              # of the shape of lines and the border against that of the surface
LONGEST = 1.75                 # an edge, of the wanted length
OFFERS = 3                     # ways out that a vertex keeps in the queue
MAX_TURN = 0.55                # cosine between a triangle's normal before and after


def _quadrics(points, faces, on_border, line):
    """Squared distance to a vertex' planes: 10 numbers, weighted by area, and the area; [n, 11].

    Its planes are those of its triangles and walls that stand on the edges of the border and of lines: they keep their
    shape.
    """
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    out = np.zeros((len(points), 11))

    def add(corners, normal, through, area):
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-18)
        plane = np.concatenate([normal, -(normal * through).sum(1, keepdims=True)], 1)
        terms = np.stack([plane[:, i] * plane[:, j] for i in range(4) for j in range(i, 4)], 1)
        for corner in corners:
            np.add.at(out, corner, np.concatenate([terms * area, area], 1) / len(corners))

    add(faces.T, normal, a, 0.5 * np.linalg.norm(normal, axis=1, keepdims=True))
    for i in range(3):
        first, second = faces[:, i], faces[:, (i + 1) % 3]
        on = (on_border[first] & on_border[second]) | (line[first] > 0) & (line[first] == line[second])
        first, second = first[on], second[on]
        edge = points[second] - points[first]
        add((first, second), np.cross(edge, normal[on]), points[first], LINE_WEIGHT * (edge ** 2).sum(1, keepdims=True))
    return out


def collapse(points, faces, size, tolerance, on_border, line, count, strictly=True):
    """-> the vertices that stay [count] and triangles [f, 3] numbered in `points`.

    points [n, 3], faces [f, 3] of a surface with border, size [n]: wanted edge length in metres, tolerance [n]: how far
    the surface may move, on_border [n] bool and line [n] (0: none): such a vertex goes only
    to another one on the border, or on its line. strictly: refuses to leave more. Cost: about 0.5 ms an edge.
    """
    quadric = _quadrics(points, faces, on_border, line).tolist()
    size, tolerance, line = size.tolist(), tolerance.tolist(), line.tolist()
    border = on_border.tolist()
    place = [tuple(p) for p in points.tolist()]
    triangles = {number: tuple(face) for number, face in enumerate(faces.tolist())}
    around = [set() for _ in place]
    for number, face in triangles.items():
        for vertex in face:
            around[vertex].add(number)
    alive, version = [True] * len(place), [0] * len(place)

    def neighbours(vertex):
        return {v for number in around[vertex] for v in triangles[number]} - {vertex}

    def cross(a, b, c):
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        return (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx), ux * ux + uy * uy + uz * uz + \
            vx * vx + vy * vy + vz * vz + (ux - vx) ** 2 + (uy - vy) ** 2 + (uz - vz) ** 2

    def price(gone, kept):
        """How much it hurts to drop `gone` onto `kept`; None: not allowed."""
        if border[gone] and not border[kept] or line[gone] and line[gone] != line[kept]:
            return None
        a, b = place[gone], place[kept]
        length = ((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2) ** 0.5
        x, y, z = b
        q = quadric[gone]
        squared = (q[0] * x * x + 2 * q[1] * x * y + 2 * q[2] * x * z + 2 * q[3] * x + q[4] * y * y + 2 * q[5] * y * z
                   + 2 * q[6] * y + q[7] * z * z + 2 * q[8] * z + q[9])
        off = (max(squared, 0.0) / max(q[10], 1e-18)) ** 0.5
        return (length / (0.5 * (size[gone] + size[kept]))) ** 2 + (off / tolerance[gone]) ** 2

    def allowed(gone, kept):
        common = neighbours(gone) & neighbours(kept)
        shared = [number for number in around[gone] if kept in triangles[number]]
        if len(common) != len(shared) or (border[gone] and len(shared) != 1):
            return False
        longest = (LONGEST * max(size[gone], size[kept])) ** 2
        at = place[kept]
        for v in neighbours(gone):
            if v != kept and (place[v][0] - at[0]) ** 2 + (place[v][1] - at[1]) ** 2 + (place[v][2] - at[2]) ** 2 > \
                    longest:
                return False
        for number in around[gone]:
            face = triangles[number]
            if kept in face:
                continue
            old, _ = cross(*(place[v] for v in face))
            new, edges = cross(*(at if v == gone else place[v] for v in face))
            before = (old[0] ** 2 + old[1] ** 2 + old[2] ** 2) ** 0.5
            after = (new[0] ** 2 + new[1] ** 2 + new[2] ** 2) ** 0.5
            if after < MIN_QUALITY * edges / 3.4641016 or \
                    old[0] * new[0] + old[1] * new[1] + old[2] * new[2] < MAX_TURN * before * after:
                return False
        return True

    heap = []

    def offer(vertex):
        values = ((price(vertex, other), other) for other in neighbours(vertex))
        for value, other in sorted(v for v in values if v[0] is not None)[:OFFERS]:
            heapq.heappush(heap, (value, version[vertex], vertex, other))

    for vertex in range(len(place)):
        offer(vertex)
    left = len(place)
    while left > count and heap:
        _, stamp, gone, kept = heapq.heappop(heap)
        if not alive[gone] or not alive[kept] or stamp != version[gone] or not allowed(gone, kept):
            continue
        touched = neighbours(gone)
        for number in list(around[gone]):
            face = triangles[number]
            if kept in face:
                for vertex in face:
                    around[vertex].discard(number)
                del triangles[number]
            else:
                triangles[number] = tuple(kept if v == gone else v for v in face)
                around[kept].add(number)
        quadric[kept] = [x + y for x, y in zip(quadric[kept], quadric[gone])]
        alive[gone] = False
        left -= 1
        for vertex in touched:
            version[vertex] += 1
            offer(vertex)
    if strictly and left > count:
        raise ValueError(f"{left} vertices are left and no edge may collapse, wanted {count}: allow longer edges")
    return np.flatnonzero(alive), np.array(sorted(triangles.values()))


def flip_edges(points, faces, line, passes=4, flat=0.9):
    """Turn edges between nearly coplanar triangles where that makes the smaller of the angles larger, but none between
    two vertices of a line [n]. -> [f, 3]"""
    faces = [list(face) for face in faces.tolist()]
    for _ in range(passes):
        owners = {}
        for number, face in enumerate(faces):
            for i in range(3):
                owners[(face[i], face[(i + 1) % 3])] = number
        touched, turned = set(), 0
        for (a, b), first in list(owners.items()):
            second = owners.get((b, a))
            if second is None or a > b or first in touched or second in touched or line[a] and line[a] == line[b]:
                continue
            c = next(v for v in faces[first] if v not in (a, b))
            d = next(v for v in faces[second] if v not in (a, b))
            if (c, d) in owners or (d, c) in owners or c == d:
                continue
            new = ([c, a, d], [d, b, c])
            if _worst(points, new) > _worst(points, (faces[first], faces[second])) + 0.05 and \
                    _alike(points, (faces[first], faces[second]) + new) > flat:
                faces[first], faces[second] = new
                touched |= {first, second}
                owners[(c, d)] = owners[(d, c)] = first
                turned += 1
        if not turned:
            break
    return np.array(faces)


def _worst(points, faces):
    """Quality of the worse of two triangles: 1 is equilateral."""
    out = []
    for face in faces:
        a, b, c = points[face]
        area = np.linalg.norm(np.cross(b - a, c - a))
        out.append(3.4641016 * area / max(((b - a) ** 2).sum() + ((c - b) ** 2).sum() + ((a - c) ** 2).sum(), 1e-18))
    return min(out)


def _alike(points, faces):
    """Smallest cosine between the normals of some triangles."""
    normals = np.array([np.cross(points[f[1]] - points[f[0]], points[f[2]] - points[f[0]]) for f in faces])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-18)
    return (normals @ normals.T).min()
