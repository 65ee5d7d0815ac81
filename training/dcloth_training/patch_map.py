"""From a patch stage's points to the garment's vertices: each follows the points nearest to its own."""
import copy

import numpy as np
from scipy.spatial import cKDTree

OFF = 0.005         # m: how far off points are in use; the fit allows for it
RIDGE = 1e-9        # of the offsets
LIVELY = 0.9        # of the truth's wrinkles is asked for
MOST_OF_BEST = 1.8  # times the factor on them that fits best


class Moments:
    """Sums over frames that a least squares fit needs: points u [t, K, 3, R] and template displacements [t, n, 3]."""

    def __init__(self, points, vertices):
        size = 3 * points + 1
        self.gram, self.right, self.frames = np.zeros((size, size)), np.zeros((size, 3 * vertices)), 0

    def add(self, moved, displaced):
        rows = moved.transpose(0, 1, 3, 2).reshape(len(moved), -1)
        rows = np.concatenate([rows, np.ones((len(rows), 1), rows.dtype)], 1)
        self.gram += rows.T @ rows
        self.right += rows.T @ displaced.reshape(len(rows), -1)
        self.frames += len(rows)


    def livelier(self, mesh, gains):
        """Moments of truth that moves `gains` times as much in its middle and fine band, about its mean.

        Least squares knows a part of the wrinkles and draws no more than that part. Wrinkles of full size cost a
        fraction of a percent of the error, because most of it is coarse."""
        mean = self.right[-1] / self.frames
        centred = (self.right - np.outer(self.gram[:, -1], mean)).reshape(len(self.right), -1, 3)
        out = copy.copy(self)
        out.right = self.right.copy()
        for gain, band in zip(gains, mesh.bands(centred)[1:]):
            out.right += (gain - 1) * band.reshape(out.right.shape)
        return out


class Liveliness:
    """How drawn cloth moves in its middle and fine band beside the truth: clips of template displacements."""

    def __init__(self, mesh):
        self.mesh, self.drawn, self.wanted, self.alike = mesh, np.zeros(2), np.zeros(2), np.zeros(2)

    def add(self, drawn, wanted):
        """[t, n, 3] of a clip."""
        bands = [self.mesh.bands(shapes - shapes.mean(0))[1:] for shapes in (drawn, wanted)]
        for total, (a, b) in ((self.drawn, (0, 0)), (self.wanted, (1, 1)), (self.alike, (0, 1))):
            total += [np.vdot(bands[a][k].astype(np.float64), bands[b][k]) for k in range(2)]

    def wanting(self):
        """(middle, fine): what they are to be multiplied by. Of what is drawn wrong, no more: at twice the factor that
        fits best, no wrinkles at all would be as near to the truth."""
        drawn = np.maximum(self.drawn, 1e-12)
        return np.minimum(LIVELY * np.sqrt(self.wanted / drawn), MOST_OF_BEST * self.alike / drawn)


def groups_of(layout, template):
    """[n] point of each vertex: the one it is counted to, of several the nearest."""
    places = layout.points_of @ template
    owner = layout.points_of.tocsc()
    return np.array([rows[np.linalg.norm(places[rows] - at, axis=1).argmin()] for rows, at in (
        (owner.indices[owner.indptr[v]:owner.indptr[v + 1]], template[v]) for v in range(len(template)))])


def sources_of(layout, template, count):
    """[P, M] points nearest to each one in the bind pose, itself first."""
    places = layout.points_of @ template
    return cKDTree(places).query(places, count)[1].astype(np.int32)


def fit(moments, groups, sources, off=OFF):
    """(weights [n, M, 3, 3], offsets [n, 3]) for points that are `off` m off. 40 s for 7,952 vertices."""
    count = sources.shape[1]
    weights, offsets = np.zeros((len(groups), count, 3, 3), np.float32), np.zeros((len(groups), 3), np.float32)
    ridge = np.r_[np.full(3 * count, moments.frames * off ** 2), RIDGE]
    for point, near in enumerate(sources):
        own = np.flatnonzero(groups == point)
        at = np.r_[(3 * near[:, None] + np.arange(3)).ravel(), len(moments.gram) - 1]
        columns = (3 * own[:, None] + np.arange(3)).ravel()
        found = np.linalg.solve(moments.gram[np.ix_(at, at)] + np.diag(ridge), moments.right[np.ix_(at, columns)])
        found = found.reshape(len(at), len(own), 3)
        weights[own] = found[:-1].reshape(count, 3, len(own), 3).transpose(2, 0, 3, 1)
        offsets[own] = found[-1]
    return weights, offsets
