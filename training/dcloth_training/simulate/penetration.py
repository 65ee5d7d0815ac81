"""How deep cloth lies under the body: a true signed distance to the posed triangles.

The body is split into parts that a cloth vertex may or may not touch. Openings (a neck that was cut off, a limb cut out of
the skin) are closed by a fan about their middle, so that each part has an inside. Inside is where the winding number
exceeds one half, which also holds where a posed part overlaps itself, as thigh and calf do in a squat; the depth there is
the distance to the nearest triangle. Needs libigl.
"""
import numpy as np

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
    """Triangles of a part and the openings that are closed when it is posed."""

    def __init__(self, faces, vertices, cloth):
        self.cloth, self.loops = cloth, openings(faces)
        fans = [[b, a, vertices + k] for k, loop in enumerate(self.loops) for a, b in zip(loop, loop[1:] + loop[:1])]
        self.faces = np.concatenate([faces, np.array(fans, np.int64).reshape(-1, 3)]).astype(np.int64)
        self.used, self.local = np.unique(self.faces, return_inverse=True)
        self.local = np.ascontiguousarray(self.local.reshape(-1, 3))

    def posed(self, body):
        """Vertices of the closed surface."""
        middles = [body[loop].mean(0) for loop in self.loops]
        return np.concatenate([body, middles])[self.used] if middles else body[self.used]


class Body:
    """What cloth is kept out of.

    faces [g, 3] of the body, outward; cloth_count: n cloth vertices. part [g]: the number of the part that a face belongs
    to (None: one part); masks [b]: instead of `part`, bit p where a body vertex belongs to part p (parts may overlap: a face
    belongs to those that all its corners share). touches [n]: bit p where a cloth vertex may touch part p; None: all.
    ignored [n] bool: cloth vertices that do not count, as pinned ones.
    """

    def __init__(self, faces, cloth_count, part=None, masks=None, touches=None, ignored=None):
        faces = np.asarray(faces, np.int64)
        self.cloth_count = cloth_count
        free = np.ones(cloth_count, bool) if ignored is None else ~np.asarray(ignored, bool)
        touches = np.full(cloth_count, ~np.uint32(0)) if touches is None else np.asarray(touches).astype(np.uint32)
        if masks is not None:
            own = np.bitwise_and.reduce(np.asarray(masks).astype(np.uint32)[faces], axis=1)
        else:
            own = np.uint32(1) << np.asarray(np.zeros(len(faces)) if part is None else part).astype(np.uint32)
        count = int(faces.max(initial=-1)) + 1
        self.parts = []
        for bit in range(32):
            mask = np.uint32(1 << bit)
            chosen, cloth = (own & mask) != 0, np.flatnonzero(((touches & mask) != 0) & free)
            if chosen.any() and len(cloth):
                self.parts.append(_Part(faces[chosen], count, cloth))
        self.vertices = count

    def depth(self, cloth, body):
        """Depth [n] in m of cloth [n, 3] m under the posed body [b, 3] m; 0 outside. The deepest part counts."""
        import igl      # only what measures penetration needs the package

        cloth, body = np.asarray(cloth, np.float64), np.asarray(body, np.float64)[:self.vertices]
        if cloth.shape != (self.cloth_count, 3):
            raise ValueError(f"cloth of shape {cloth.shape}; expected [{self.cloth_count}, 3]")
        out = np.zeros(self.cloth_count)
        for part in self.parts:
            surface, points = part.posed(body), cloth[part.cloth]
            near = np.flatnonzero(((points > surface.min(0)) & (points < surface.max(0))).all(1))
            if not len(near):
                continue
            points = np.ascontiguousarray(points[near])
            inside = igl.fast_winding_number(surface, part.local, points) > 0.5
            near, points = near[inside], np.ascontiguousarray(points[inside])
            if len(near):
                distance = igl.signed_distance(points, surface, part.local,
                                               igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_UNSIGNED)[0]
                at = part.cloth[near]
                out[at] = np.maximum(out[at], distance)
        return out


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
