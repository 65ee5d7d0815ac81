"""How deep cloth lies under the body: a true signed distance to the posed triangles.

The body is split into parts that a cloth vertex may or may not touch. Openings (a neck that was cut off, a limb cut out
of the skin) are closed by a fan about their middle, so that each part has an inside. Inside is where the winding number
exceeds one half, which also holds where a posed part overlaps itself, as thigh and calf do in a squat; the depth is the
distance to the nearest triangle. Needs libigl.
"""
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from . import crossings

DEEP = 0.001    # m: less than this under the body is not penetration


def openings(faces):
    """Border loops of a surface: lists of vertex numbers in the direction of their faces."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    known = set(map(tuple, edges.tolist()))
    after = {}
    for a, b in sorted(known):
        if (b, a) not in known:
            after.setdefault(a, []).append(b)
    loops = []
    while after:
        at = start = next(iter(after))
        loop = []
        while at in after:
            loop.append(at)
            following = after[at].pop()
            if not after[at]:
                del after[at]
            at = following
            if at == start:
                break
        loops.append(loop)
    return [loop for loop in loops if len(loop) > 2]


class _Part:
    """Triangles of a part, the openings that are closed when it is posed, and the cloth that may touch it."""

    def __init__(self, numbers, faces, vertices, cloth, cloth_faces):
        self.numbers, self.cloth, self.loops = numbers, cloth, openings(faces)
        fans = [[b, a, vertices + k] for k, loop in enumerate(self.loops) for a, b in zip(loop, loop[1:] + loop[:1])]
        closed = np.concatenate([faces, np.array(fans, np.int64).reshape(-1, 3)])
        self.used, local = np.unique(closed, return_inverse=True)
        self.faces = np.ascontiguousarray(local.reshape(-1, 3), np.int64)
        # Pieces of cloth that hang together: where none of its triangles crosses the part, a piece lies on one side.
        size = int(max(cloth.max(initial=-1), cloth_faces.max(initial=-1))) + 1
        touching = np.zeros(size, bool)
        touching[cloth] = True
        self.cloth_numbers = np.flatnonzero(touching[cloth_faces].all(1))
        self.cloth_faces = cloth_faces[self.cloth_numbers]
        a, b = self.cloth_faces[:, [0, 1]].ravel(), self.cloth_faces[:, [1, 2]].ravel()
        links = scipy.sparse.csr_matrix((np.ones(len(a), bool), (a, b)), (size, size))
        piece = scipy.sparse.csgraph.connected_components(links, directed=False)[1][cloth]
        self.examples, self.piece = np.unique(piece, return_index=True)[1], np.unique(piece, return_inverse=True)[1]

    def posed(self, body):
        """Vertices of the closed surface."""
        middles = [body[loop].mean(0) for loop in self.loops]
        return np.concatenate([body, middles])[self.used] if middles else body[self.used]


class Body:
    """What cloth is kept out of, and which of the cloth.

    faces [g, 3] of the body, outward; cloth_faces [c, 3], cloth_count n. part [g]: the number of the part that a face
    belongs to (None: one part); masks [b]: instead of `part`, bit p where a body vertex belongs to part p (parts may
    overlap: a face belongs to those that all its corners share). touches [n]: bit p where a cloth vertex may touch part
    p; None: all.
    """

    def __init__(self, faces, cloth_faces, cloth_count, part=None, masks=None, touches=None):
        faces, cloth_faces = np.asarray(faces, np.int64), np.asarray(cloth_faces, np.int64)
        self.cloth_count = cloth_count
        touches = np.full(cloth_count, ~np.uint32(0)) if touches is None else np.asarray(touches).astype(np.uint32)
        if masks is not None:
            own = np.bitwise_and.reduce(np.asarray(masks).astype(np.uint32)[faces], axis=1)
        else:
            own = np.uint32(1) << np.asarray(np.zeros(len(faces)) if part is None else part).astype(np.uint32)
        self.vertices = int(faces.max(initial=-1)) + 1
        self.parts = []
        for bit in range(32):
            chosen, cloth = (np.flatnonzero(of & np.uint32(1 << bit)) for of in (own, touches))
            if len(chosen) and len(cloth):
                self.parts.append(_Part(chosen, faces[chosen], self.vertices, cloth, cloth_faces))

    def contact(self, cloth, body):
        """Cloth [n, 3] m against the posed body [b, 3] m.

        -> depth [n] in m under the body, the deepest part's, 0 outside; pairs [k, 2] (cloth triangle, body triangle)
        that intersect, each once. Cloth of 16,000 triangles, a body as large: 20 ms where nothing crosses, else 70 ms
        more.
        """
        import igl      # only what measures penetration needs the package

        cloth, body = np.asarray(cloth, np.float64), np.asarray(body, np.float64)[:self.vertices]
        if cloth.shape != (self.cloth_count, 3):
            raise ValueError(f"cloth of shape {cloth.shape}; expected [{self.cloth_count}, 3]")
        depth, pairs = np.zeros(self.cloth_count), [np.zeros((0, 2), np.int64)]
        for part in self.parts:
            surface, points = part.posed(body), cloth[part.cloth]
            found = crossings.between(cloth, part.cloth_faces, surface, part.faces)
            if len(found):
                near = np.flatnonzero(((points > surface.min(0)) & (points < surface.max(0))).all(1))
                inside = igl.fast_winding_number(surface, part.faces, np.ascontiguousarray(points[near])) > 0.5
                at = near[inside]
                found = found[found[:, 1] < len(part.numbers)]          # not the fans, which nobody sees
                pairs.append(np.stack([part.cloth_numbers[found[:, 0]], part.numbers[found[:, 1]]], -1))
            else:
                winding = igl.winding_number(surface, part.faces, np.ascontiguousarray(points[part.examples]))
                at = np.flatnonzero((winding > 0.5)[part.piece])
            if len(at):
                distance = igl.signed_distance(np.ascontiguousarray(points[at]), surface, part.faces,
                                               igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_UNSIGNED)[0]
                depth[part.cloth[at]] = np.maximum(depth[part.cloth[at]], distance)
        return depth, np.unique(np.concatenate(pairs), axis=0)


def vertex_areas(vertices, faces):
    """Area [n] in m2 that each vertex stands for: a third of its triangles."""
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
    return sum(np.bincount(faces[:, i], area, len(vertices)) for i in range(3))


def summary(depths, areas):
    """{area_share, p99_mm, max_mm} of depths [T, n] m: share of the area more than 1 mm deep, percentile of all depths.

    Vertices outside count as 0 mm deep.
    """
    depths = np.asarray(depths)
    share = ((depths > DEEP) @ areas).mean() / areas.sum()
    return {"area_share": float(share), "p99_mm": float(1e3 * np.percentile(depths, 99)),
            "max_mm": float(1e3 * depths.max(initial=0))}
