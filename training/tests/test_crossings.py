"""Crossing triangles against integers' separating axes, against ipctk, and on cloth pushed through itself."""
import ipctk
import numpy as np
import pytest
from conftest import tube

from dcloth_training.simulate import crossings

GRID = 2.0**-26


def soup(corners):
    """Vertices [3k, 3] and faces [k, 3] of triangles [k, 3, 3] that share nothing."""
    return np.asarray(corners, float).reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)


def disjoint(a, b):
    """Are two closed triangles [3, 3] of integers apart? By separating axes, in exact integers."""
    a, b = [[[int(x) for x in p] for p in t] for t in (a, b)]

    def cross(u, v):
        return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

    def sides(t):
        return [[q - p for p, q in zip(t[k], t[(k + 1) % 3])] for k in range(3)]

    own, other = sides(a), sides(b)
    normals = [cross(*own[:2]), cross(*other[:2])]
    axes = normals + [cross(u, v) for u in own for v in other] + [
        cross(n, u) for n, edges in zip(normals, (own, other)) for u in edges]
    for axis in axes:
        p, q = ([sum(x * y for x, y in zip(axis, point)) for point in t] for t in (a, b))
        if max(p) < min(q) or max(q) < min(p):
            return True
    return False


def with_area(triangles):
    a, b, c = np.moveaxis(triangles, 1, 0)
    return triangles[np.cross(b - a, c - a).any(1)]


def test_two_triangles_by_hand():
    flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    cases = {"pierced": ([[.2, .2, -1], [.3, .2, 1], [.2, .3, 1]], True),
             "beside": ([[1.2, .2, -1], [1.3, .2, 1], [1.2, .3, 1]], False),
             "above": ([[.2, .2, 1], [.3, .2, 2], [.2, .3, 2]], False),
             "plane crossed outside": ([[.8, .8, -1], [.9, .8, 1], [.8, .9, 1]], False),
             "touched by a corner": ([[.2, .2, 0], [.3, .2, 1], [.2, .3, 1]], True),
             "a grid step short of it": ([[.2, .2, GRID], [.3, .2, 1], [.2, .3, 1]], False),
             "in its plane, overlapping": ([[.2, .2, 0], [2, .2, 0], [.2, 2, 0]], True),
             "in its plane, inside": ([[.2, .2, 0], [.3, .2, 0], [.2, .3, 0]], True),
             "in its plane, around": ([[-5, -5, 0], [9, -5, 0], [-5, 9, 0]], True),
             "in its plane, beside": ([[2, .2, 0], [3, .2, 0], [2, 2, 0]], False),
             "standing on it along an edge": ([[.2, .2, 0], [.3, .2, 0], [.2, .3, 1]], True),
             "standing beside it": ([[1.2, .2, 0], [1.3, .2, 0], [1.2, .3, 1]], False)}
    for name, (corners, wanted) in cases.items():
        for one, two in ((flat, corners), (corners, flat)):
            found = crossings.between(*soup([one]), *soup([two]))
            assert (len(found) == 1) == wanted, name
            assert len(crossings.within(*soup([one, two]))) == wanted, name


def test_small_integers_where_everything_touches():
    generator = np.random.default_rng(1)
    one, two = (with_area(generator.integers(0, 4, (120, 3, 3))) for _ in range(2))
    found = crossings.between(*soup(one), *soup(two))
    wanted = [[i, j] for i in range(len(one)) for j in range(len(two)) if not disjoint(one[i], two[j])]
    assert 2000 < len(wanted) < 0.9 * len(one) * len(two)
    assert found.tolist() == wanted


def test_a_grid_step_decides_where_doubles_cannot():
    """Corners within a few grid steps of a large triangle's plane: the true sign needs 93 bits."""
    generator = np.random.default_rng(2)
    seen = {True: 0, False: 0}
    for _ in range(400):
        big = generator.integers(-2**29, 2**29, (3, 3))
        u, v = generator.uniform(.1, .45, 2)
        base = np.rint(big[0] + u * (big[1] - big[0]) + v * (big[2] - big[0])).astype(np.int64)
        across = generator.integers(-3, 4, 3)
        small = np.stack([base + across, base + generator.integers(-3, 4, 3), base + 5 * across])
        if not len(with_area(small[None])):
            continue
        apart = disjoint(big, small)
        seen[apart] += 1
        assert len(crossings.between(*soup([big * GRID]), *soup([small * GRID]))) == (not apart)
    assert min(seen.values()) > 30, seen


def test_random_triangles_as_ipctk_finds_them():
    generator = np.random.default_rng(3)
    corners = generator.uniform(0, 1, (400, 1, 3)) + generator.normal(0, .06, (400, 3, 3))
    vertices, faces = soup(corners)

    def meet(a, b):
        return any(ipctk.is_edge_intersecting_triangle(s[k], s[(k + 1) % 3], *t)
                   for s, t in ((a, b), (b, a)) for k in range(3))

    low, high = corners.min(1), corners.max(1)
    near = [(i, j) for i in range(400) for j in range(i + 1, 400)
            if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()]
    wanted = [[i, j] for i, j in near if meet(corners[i], corners[j])]
    assert len(wanted) > 50
    assert crossings.within(vertices, faces).tolist() == wanted


def test_neighbours_do_not_count_and_seams_are_closed():
    cloth, faces, _ = tube(0.2, 12, 20, 1.0, 0.5)
    assert len(crossings.within(cloth, faces)) == 0
    # The same surface with every triangle's corners its own, as at UV seams.
    assert len(crossings.within(*soup(cloth[faces]))) == 0


def test_cloth_pushed_through_itself_and_into_the_body():
    cloth, faces, _ = tube(0.2, 12, 20, 1.0, 0.5)
    body, body_faces, _ = tube(0.15, 6, 20, 1.1, 0.2)
    assert [len(pairs) for pairs in crossings.count(cloth, faces, body, body_faces)] == [0, 0]
    front = cloth[:, 2] > 0.19
    pushed = cloth - np.outer(front, [0, 0, 0.45])      # the front passes out at the back, through everything
    own, against = crossings.count(pushed, faces, body, body_faces)
    assert len(own) > 10 and len(against) > 10
    assert (own[:, 0] < own[:, 1]).all()
    share = [set(faces[a]) & set(faces[b]) for a, b in own]
    assert not any(share)
    mesh = ipctk.CollisionMesh(pushed, ipctk.edges(faces), faces)
    assert ipctk.has_intersections(mesh, pushed)


def test_many_pairs_and_no_pairs():
    crossed = np.repeat([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, -1, -1], [0, 1, -1], [0, 0, 1]]], 80, 0)
    crossed = crossed + np.linspace(0, .01, 160)[:, None, None]
    pairs = crossings.between(*soup(crossed), *soup(crossed))
    assert len(pairs) > 6400 and len(np.unique(pairs, axis=0)) == len(pairs)    # more than a first call has room for
    none = np.empty((0, 3))
    assert crossings.between(*soup(crossed), none, none.astype(np.int32)).shape == (0, 2)
    assert crossings.within(none, none.astype(np.int32)).shape == (0, 2)


@pytest.mark.parametrize("fault", ["nan", "infinite", "far", "index", "shape"])
def test_malformed_meshes_are_refused(fault):
    vertices, faces = soup([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    if fault == "index":
        faces = faces + 1
    elif fault == "shape":
        vertices = vertices[:, :2]
    else:
        vertices[2, 1] = {"nan": np.nan, "infinite": np.inf, "far": 40.0}[fault]
    with pytest.raises(ValueError):
        crossings.within(vertices, faces)
    good = soup([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    with pytest.raises(ValueError):
        crossings.between(*good, vertices, faces)
