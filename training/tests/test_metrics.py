"""E_d and E_n by hand-made cases."""
import numpy as np
import pytest

from dcloth_training import metrics

FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


def test_distance_statistics():
    truth = np.stack([SQUARE, SQUARE])
    moved = truth.copy()
    moved[0, :, 2] += 0.001
    moved[1, :, 0] += 0.003
    moved[1, 0, 0] += 0.004
    d = metrics.summary(moved, truth, FACES)["position_mm"]
    assert d["mean"] == pytest.approx(2.5) and d["max"] == pytest.approx(7)
    assert d["std"] == pytest.approx(1.5)            # frame means 1 and 4 mm
    assert 3 < d["p99"] <= 7


def test_normals_of_a_flat_square_point_up_and_tilt_with_it():
    tilt = np.radians(1e-5)
    turned = SQUARE @ np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)],
                                [0, -np.sin(tilt), np.cos(tilt)]])
    normals = metrics.vertex_normals(np.stack([SQUARE, turned]), FACES)
    assert np.allclose(normals[0], [0, 0, 1])
    assert metrics.angles_degrees(normals[1], normals[0]) == pytest.approx(
        np.full(4, 1e-5), rel=1e-6)
    assert metrics.angles_degrees(normals[:1], -normals[:1]) == pytest.approx(np.full((1, 4), 180))


def test_vertices_without_a_normal_do_not_count():
    loose = np.concatenate([SQUARE, [[9, 9, 9.0]]])[None]
    angle = metrics.angles_degrees(*[metrics.vertex_normals(loose, FACES)] * 2)
    assert np.isnan(angle[0, 4]) and (angle[0, :4] == 0).all()
    assert metrics.summary(loose, loose, FACES)["normal_deg"]["mean"] == 0


def test_large_faces_weigh_more():
    corner = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 1.0]])[None]
    normal = metrics.vertex_normals(corner, np.array([[0, 1, 2], [0, 2, 3]]))[0, 0]
    assert np.allclose(normal, np.array([3, 0, 9]) / np.sqrt(90))
