"""Nearest points on the body's surface, the cloth bones they give, and the mesh graph N(i).

numpy and scipy only; metres, bind pose.
"""
import numpy as np
from scipy.spatial import cKDTree

CANDIDATE_FACES = 48
_BLOCK = 256      # points whose candidates are in memory together


def doubled_areas(corner):
    """[c] of the plane triangles corner [c, 3, 2]: positive where they turn anticlockwise."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _on_segment(p, a, b):
    """Parameter t in [0, 1] of the point of a + t (b - a) nearest to p; all [k, 3]."""
    d = b - a
    length = np.maximum((d * d).sum(-1), 1e-30)
    return np.clip(((p - a) * d).sum(-1) / length, 0.0, 1.0)


def closest_on_triangles(p, a, b, c):
    """Barycentric coordinates [k, 3] of the point of triangle abc nearest to p; all [k, 3]."""
    ab, ac, ap = b - a, c - a, p - a
    d00, d01, d11 = (ab * ab).sum(-1), (ab * ac).sum(-1), (ac * ac).sum(-1)
    d20, d21 = (ap * ab).sum(-1), (ap * ac).sum(-1)
    determinant = np.maximum(d00 * d11 - d01 * d01, 1e-30)
    v = (d11 * d20 - d01 * d21) / determinant
    w = (d00 * d21 - d01 * d20) / determinant
    zero = np.zeros_like(v)
    options = [np.stack([1.0 - v - w, v, w], -1)]
    for corners, (i, j) in (((a, b), (0, 1)), ((b, c), (1, 2)), ((c, a), (2, 0))):
        t = _on_segment(p, *corners)
        coordinates = [zero, zero, zero]
        coordinates[i], coordinates[j] = 1.0 - t, t
        options.append(np.stack(coordinates, -1))
    options = np.stack(options)                                        # [4, k, 3]
    points = options[..., :1] * a + options[..., 1:2] * b + options[..., 2:] * c
    distance = np.linalg.norm(points - p, axis=-1)
    distance[0][(options[0] < 0).any(-1)] = np.inf                     # projection outside
    best = distance.argmin(0)
    return options[best, np.arange(len(p))]


def nearest_on_surface(points, vertices, faces):
    """Nearest surface point of each of `points` [n, 3] -> (points [n, 3], face [n], bary [n, 3]); of equals the first
    face.

    Exact: a face lies no nearer than its centroid less its radius. The faces with the nearest centroids decide wherever
    their best distance stays below that bound; elsewhere all that may be nearer are tried, found in a tree for each
    size of triangle. 8,000 points and 49,000 triangles of very different sizes: 3 s.
    """
    points, vertices = np.asarray(points, np.float64), np.asarray(vertices, np.float64)
    corners = vertices[faces]
    centroid = corners.mean(1)
    radius = np.linalg.norm(corners - centroid[:, None], axis=-1).max(1)
    count = min(CANDIDATE_FACES, len(faces))
    reach, near = cKDTree(centroid).query(points, count)
    reach, near = reach.reshape(-1, count), near.reshape(-1, count)

    def on_faces(p, candidates):
        """(point, bary, distance) of each point's nearest on the face that stands beside it."""
        triangle = corners[candidates]
        bary = closest_on_triangles(p, *triangle.transpose(1, 0, 2))
        found = (bary[..., None] * triangle).sum(1)
        return found, bary, np.linalg.norm(found - p, axis=-1)

    found, bary, distance = on_faces(np.repeat(points, count, 0), near.ravel())
    pick = np.arange(len(points)) * count + distance.reshape(-1, count).argmin(1)
    found, face, bary, distance = found[pick], near.ravel()[pick], bary[pick], distance[pick]
    open_ = np.flatnonzero(distance > reach[:, -1] - radius.max()) if count < len(faces) else np.zeros(0, int)
    sizes = np.frexp(radius)[1]     # of one size: within a factor of two
    trees = [(np.flatnonzero(sizes == size), cKDTree(centroid[sizes == size]), radius[sizes == size].max())
             for size in np.unique(sizes)] if len(open_) else []
    for at in range(0, len(open_), _BLOCK):
        some = open_[at:at + _BLOCK]
        owner, tried = [], []
        for own, tree, most in trees:
            for k, inside in enumerate(tree.query_ball_point(points[some], distance[some] * (1 + 1e-9) + most)):
                owner.append(np.full(len(inside), k))
                tried.append(own[inside])
        owner, tried = np.concatenate(owner), np.concatenate(tried).astype(int)
        order = np.lexsort((tried, owner))
        owner, tried = owner[order], tried[order]
        where, weights, away = on_faces(points[some][owner], tried)
        order = np.lexsort((tried, away, owner))
        first = order[np.searchsorted(owner[order], np.arange(len(some)))]
        found[some], face[some], bary[some] = where[first], tried[first], weights[first]
    return found, face, bary


def nearest_weights(points, vertices, faces, weights, keep=None):
    """Nearest surface point of each point and its skin weights -> ([n, 3], [n, J]).

    `keep` [b] limits the surface to faces all of whose corners are kept.
    """
    if keep is not None:
        faces = faces[np.asarray(keep, bool)[faces].all(1)]
    found, face, bary = nearest_on_surface(points, vertices, faces)
    mixed = (bary[..., None] * np.asarray(weights, np.float64)[faces[face]]).sum(1)
    mixed[mixed < 1e-4] = 0.0
    return found, mixed / mixed.sum(1, keepdims=True)


def choose_bones(weights, threshold=0.05):
    """Joints that move cloth -> (bones [m], initial weights [n, m], rows sum to 1).

    A joint is a bone where some vertex follows it by more than `threshold`.
    """
    bones = np.flatnonzero(weights.max(0) > threshold)
    kept = weights[:, bones]
    total = kept.sum(1, keepdims=True)
    if (total <= 0).any():
        raise ValueError(f"{int((total <= 0).sum())} vertices follow no bone at threshold "
                         f"{threshold}; lower it")
    return bones, kept / total


def neighbours(faces, count):
    """The mesh graph: for each vertex itself first, then its edge neighbours in rising order."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    starts = np.searchsorted(edges[:, 0], np.arange(count + 1))
    return [np.concatenate([[i], edges[starts[i]:starts[i + 1], 1]]) for i in range(count)]


def padded_neighbours(faces, count):
    """N(i) as a table -> (columns [n, k] i64, present [n, k] bool); padding repeats i."""
    lists = neighbours(faces, count)
    width = max(map(len, lists))
    columns = np.repeat(np.arange(count)[:, None], width, 1)
    present = np.zeros((count, width), bool)
    for i, row in enumerate(lists):
        columns[i, :len(row)] = row
        present[i, :len(row)] = True
    return columns, present
