"""Nearest surface points, bones and the mesh graph."""
import numpy as np
from scipy.spatial import ConvexHull
import pytest

from conftest import tube
from dcloth_training import geometry


def brute(points, vertices, faces, steps=60):
    """Nearest distance over a fine barycentric grid of every face."""
    grid = np.array([(i, j, steps - i - j) for i in range(steps + 1)
                     for j in range(steps + 1 - i)]) / steps
    samples = np.einsum("gk,fkc->fgc", grid, vertices[faces]).reshape(-1, 3)
    return np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])


def test_nearest_point_is_on_the_surface_and_nearest():
    vertices, faces, _ = tube(0.3, 5, 9, 1, 0)
    points = np.random.default_rng(2).uniform(-0.6, 1.2, (60, 3))
    found, face, bary = geometry.nearest_on_surface(points, vertices, faces)
    assert np.allclose((bary[..., None] * vertices[faces[face]]).sum(1), found)
    assert (bary > -1e-12).all() and np.allclose(bary.sum(1), 1)
    distance, sampled = np.linalg.norm(found - points, axis=1), brute(points, vertices, faces)
    assert (distance <= sampled + 1e-12).all()
    longest = max(np.linalg.norm(vertices[faces[:, i]] - vertices[faces[:, i - 1]], axis=1).max()
                  for i in range(3))
    assert (sampled - distance).max() <= longest / 60   # a grid point lies within one cell


def test_one_large_face_beats_many_near_centroids():
    far = np.array([[-5, 0, -5], [5, 0, -5], [0, 0, 9.0]])
    small = np.random.default_rng(0).uniform(-.1, .1, (80, 3, 3)) + [4.5, 0.5, -4.5]
    vertices = np.concatenate([far, small.reshape(-1, 3)])
    faces = np.arange(len(vertices)).reshape(-1, 3)
    found, face, _ = geometry.nearest_on_surface([[4.4, 0.01, -4.9]], vertices, faces)
    assert face[0] == 0 and np.allclose(found, [[4.4, 0, -4.9]])


def test_weights_come_from_the_kept_part_only():
    vertices, faces, _ = tube(0.3, 5, 9, 1, 0)
    weights = np.zeros((len(vertices), 2))
    weights[:, 0] = vertices[:, 1]
    weights[:, 1] = 1 - vertices[:, 1]
    _, mixed = geometry.nearest_weights([[0.4, 0.6, 0]], vertices, faces, weights)
    assert np.allclose(mixed, [[0.6, 0.4]])
    _, lower = geometry.nearest_weights([[0.4, 0.9, 0]], vertices, faces, weights,
                                        vertices[:, 1] < 0.55)
    assert np.allclose(lower, [[0.5, 0.5]])


def test_bones_are_the_joints_that_some_vertex_follows():
    bones, kept = geometry.choose_bones(np.array([[0.9, 0.02, 0.08], [0.97, 0.03, 0.0]]))
    assert bones.tolist() == [0, 2] and np.allclose(kept.sum(1), 1)
    with pytest.raises(ValueError, match="1 vertices follow no bone"):
        geometry.choose_bones(np.array([[1.0, 0, 0], [0, 0.5, 0.5]]), 0.6)


def test_graph_holds_each_vertex_and_its_edge_neighbours():
    rows = geometry.neighbours(np.array([[0, 1, 2], [2, 1, 3]]), 5)
    assert [r.tolist() for r in rows] == [[0, 1, 2], [1, 0, 2, 3], [2, 0, 1, 3], [3, 1, 2], [4]]
    columns, present = geometry.padded_neighbours(np.array([[0, 1, 2], [2, 1, 3]]), 5)
    assert columns.shape == (5, 4) and present.sum() == 3 + 4 + 4 + 3 + 1
    assert columns[0].tolist() == [0, 1, 2, 0] and present[0].tolist() == [True] * 3 + [False]


def test_triangles_of_very_different_sizes_are_searched_exactly():
    """Against all of them; a fine ball inside of a coarse one, where few centroids decide nothing."""
    generator = np.random.default_rng(4)
    fine, coarse = generator.normal(size=(300, 3)), generator.normal(size=(40, 3))
    vertices = np.concatenate([0.3 * fine / np.linalg.norm(fine, axis=1, keepdims=True),
                               coarse / np.linalg.norm(coarse, axis=1, keepdims=True)])
    faces = np.concatenate([ConvexHull(vertices[:300]).simplices, 300 + ConvexHull(vertices[300:]).simplices])
    points = generator.uniform(-1, 1, (200, 3))
    found, face, bary = geometry.nearest_on_surface(points, vertices, faces)
    every = np.tile(np.arange(len(faces)), len(points))
    corner = vertices[faces][every].transpose(1, 0, 2)
    weight = geometry.closest_on_triangles(np.repeat(points, len(faces), 0), *corner)
    away = np.linalg.norm((weight[..., None] * vertices[faces][every]).sum(1) - np.repeat(points, len(faces), 0),
                          axis=1)
    away = away.reshape(len(points), -1)
    assert np.array_equal(face, away.argmin(1)) and (face >= len(faces) - 60).any()
    assert np.array_equal(np.linalg.norm(found - points, axis=1), away.min(1))
    assert np.allclose((bary[..., None] * vertices[faces[face]]).sum(1), found, atol=1e-12)


def test_plane_triangles_have_the_areas_that_they_have_in_space():
    corner = np.random.default_rng(5).standard_normal((50, 3, 2))
    flat = np.concatenate([corner, np.zeros((50, 3, 1))], 2)
    expected = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])[:, 2]
    np.testing.assert_allclose(geometry.doubled_areas(corner), expected, rtol=1e-12)
    assert (expected > 0).any() and (expected < 0).any()
