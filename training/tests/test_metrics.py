"""Every measure by hand-made cases whose values are known."""
import numpy as np
import pytest
from conftest import rigid, rotation, tube

from dcloth_training import metrics

WARM = metrics.WARM_UP

FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


def test_distance_statistics():
    truth = np.stack([SQUARE, SQUARE])
    moved = truth.copy()
    moved[0, :, 2] += 0.001
    moved[1, :, 0] += 0.003
    moved[1, 0, 0] += 0.004
    d = metrics.errors(metrics.distances_mm(moved, truth), np.zeros((2, 4)))["position_mm"]
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
    assert metrics.errors(np.zeros((1, 5)), angle)["normal_deg"]["mean"] == 0


def test_large_faces_weigh_more():
    corner = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 1.0]])[None]
    normal = metrics.vertex_normals(corner, np.array([[0, 1, 2], [0, 2, 3]]))[0, 0]
    assert np.allclose(normal, np.array([3, 0, 9]) / np.sqrt(90))


def turning_hips(frames):
    """Rigid frames [T, 4, 4] that turn, tilt and travel."""
    return np.stack([rigid(rotation([0, 1, 0], 0.2 * t) @ rotation([1, 0, 1], 0.5 * np.sin(t)),
                           [0.1 * t, 1, 0.02 * t * t])
                     for t in range(frames)])


def worn(local, hips):
    """World positions of shapes [T, n, 3] in the hips' frame."""
    return np.einsum("tij,tnj->tni", hips[:, :3, :3], local) + hips[:, None, :3, 3]


def torus(rows, columns):
    """Triangles of a regular grid that closes in both directions: six neighbours everywhere."""
    r, c = np.mgrid[:rows, :columns]
    at = lambda i, j: ((i % rows) * columns + j % columns).ravel()          # noqa: E731
    a, b, d, e = at(r, c), at(r + 1, c), at(r, c + 1), at(r + 1, c + 1)
    return np.concatenate([np.stack([a, b, d], -1), np.stack([d, b, e], -1)])


@pytest.fixture(scope="module")
def swing():
    """(template, mesh, hips, truth positions): a tube that swings to and fro by 20 mm as a whole in the hips' frame."""
    template, faces, _ = tube(0.2, 6, 10, 0.0, -0.5)
    hips = turning_hips(WARM + 40)
    sway = np.zeros((len(hips), 1, 3))
    sway[:, 0, 0] = 0.02 * (-1.0) ** np.arange(len(hips))
    return template, metrics.Mesh(faces, template), hips, worn(template + sway, hips)


def measured(predicted, truth, hips, mesh):
    return metrics.clip(predicted, metrics.Truth(truth, hips, mesh))


def test_a_garment_bolted_to_the_hips_misses_all_that_moves(swing):
    template, mesh, hips, truth = swing
    found = measured(worn(np.repeat(template[None], len(hips), 0), hips), truth, hips, mesh)
    for key in ("alive_mm", "motion_error_mm"):
        assert found[key] == pytest.approx(20, abs=1e-4), key
    assert found["position_mm"]["mean"] == pytest.approx(20, abs=1e-4) and found["frames"] == 40
    assert found["relative_error"] == pytest.approx(1) and found["relative_motion_error"] == pytest.approx(1)
    assert found["offset_mm"] == pytest.approx(0, abs=1e-4)
    assert found["predicted_alive_mm"] == pytest.approx(0, abs=1e-4)
    # A whole that moves rigidly is all coarse.
    assert found["bands"]["coarse"]["error_mm"] == pytest.approx(20, abs=1e-3)
    assert found["bands"]["coarse"]["energy_ratio"] == pytest.approx(0, abs=1e-5)
    assert found["bands"]["fine"]["error_mm"] == pytest.approx(0, abs=1e-3) and found["calm_mm"] is None
    assert found["jitter"]["truth_rms_mm"] == pytest.approx(80, abs=1e-3) and found["jitter"]["ratio"] < 1e-5
    own = metrics.Truth(truth, hips, mesh).measures()
    assert own["alive_mm"] == pytest.approx(20) and own["fine_motion_mm"] == pytest.approx(0, abs=1e-3)


def test_another_drape_is_offset_and_half_a_swing_is_motion(swing):
    template, mesh, hips, truth = swing
    local = metrics.in_hips(truth, hips)
    middle = local - template
    found = measured(worn(template + 0.5 * middle + [0, 0.003, 0.004], hips), truth, hips, mesh)
    assert found["offset_mm"] == pytest.approx(5, abs=1e-4) and found["motion_error_mm"] == pytest.approx(10, abs=1e-4)
    assert found["relative_motion_error"] == pytest.approx(0.5)
    assert found["position_mm"]["mean"] == pytest.approx(np.sqrt(10 ** 2 + 5 ** 2), abs=1e-4)
    assert found["bands"]["coarse"]["error_mm"] == pytest.approx(np.sqrt(10 ** 2 + 5 ** 2), abs=1e-3)
    assert found["bands"]["coarse"]["energy_ratio"] == pytest.approx(0.5)
    assert found["jitter"]["ratio"] == pytest.approx(0.5)
    assert found["predicted_alive_mm"] == pytest.approx(10, abs=1e-4)


def test_the_first_frames_do_not_count(swing):
    template, mesh, hips, truth = swing
    broken = truth.copy()
    broken[:WARM] += 1.0
    assert measured(broken, truth, hips, mesh)["position_mm"]["max"] == pytest.approx(0, abs=1e-6)
    broken[WARM] += 1.0
    assert measured(broken, truth, hips, mesh)["position_mm"]["max"] == pytest.approx(1e3 * np.sqrt(3))
    short = measured(broken[:WARM], truth[:WARM], hips[:WARM], mesh)      # a clip no longer than that counts whole
    assert short["frames"] == WARM and short["position_mm"]["mean"] == pytest.approx(1e3 * np.sqrt(3))
    with pytest.raises(ValueError, match="a prediction of shape"):
        measured(broken[1:], truth, hips, mesh)


@pytest.mark.parametrize("waves,band", [((1, 0), "coarse"), ((3, 1), "middle"), ((12, 0), "fine")])
def test_bands_are_what_repeated_averaging_leaves(waves, band):
    """Waves over a closed grid are eigenvectors of the averaging: each step multiplies them by a known number."""
    rows = columns = 24
    faces = torus(rows, columns)
    r, c = np.divmod(np.arange(rows * columns), columns)
    u, v = (2 * np.pi * w / rows for w in waves)
    factor = 0.5 + (np.cos(u) + np.cos(v) + np.cos(u - v)) / 6
    assert len(metrics.edges_of(faces)) == 3 * rows * columns
    wave = np.zeros((3, rows * columns, 3))
    wave[..., 1] = np.array([1.0, 0.0, -1.0])[:, None] * 0.01 * np.cos(r * u + c * v)
    mesh = metrics.Mesh(faces, np.random.default_rng(0).normal(size=(rows * columns, 3)))
    shares = {"coarse": factor ** 40, "middle": factor ** 8 - factor ** 40, "fine": 1 - factor ** 8}
    assert max(shares, key=shares.get) == band
    for name, found in zip(metrics.BANDS, mesh.bands(wave)):
        assert np.allclose(found, shares[name] * wave, atol=1e-8), name
    hips = np.repeat(np.eye(4)[None], 3, 0)
    found = measured(0 * wave, wave, hips, mesh)["bands"]
    mean = 1e3 * np.abs(wave).sum(-1).mean()
    for name in metrics.BANDS:
        assert found[name]["error_mm"] == pytest.approx(shares[name] * mean, abs=1e-5)
    own = metrics.Truth(wave, hips, mesh).measures()
    assert own["fine_motion_mm"] == pytest.approx((1 - shares["coarse"]) * mean, abs=1e-5)


def test_averaged_wrinkles_and_boiling_cloth_are_seen(swing):
    template, mesh, hips, truth = swing
    generator = np.random.default_rng(4)
    wrinkles = generator.normal(0, 0.004, (len(hips), len(template), 3))
    wrinkled = worn(metrics.in_hips(truth, hips) + wrinkles, hips)
    flat = measured(truth, wrinkled, hips, mesh)
    assert flat["bands"]["fine"]["energy_ratio"] < 0.01 and flat["bands"]["coarse"]["energy_ratio"] > 0.95
    boiling = measured(wrinkled, truth, hips, mesh)
    assert boiling["jitter"]["ratio"] > 1.01 and boiling["bands"]["fine"]["energy_ratio"] > 100
    assert boiling["strain_p99"] > 10 * measured(truth, truth, hips, mesh)["strain_p99"]


def test_a_calm_garment_must_not_breathe(swing):
    template, mesh, hips, _ = swing
    breath = np.zeros((len(hips), 1, 3))
    breath[:, 0, 1] = (-1.0) ** np.arange(len(hips))
    still, breathing = (worn(template + size * breath, hips) for size in (0.001, 0.004))
    assert measured(breathing, still, hips, mesh)["calm_mm"] == pytest.approx(3, abs=1e-4)
    assert measured(still, breathing, hips, mesh)["calm_mm"] == pytest.approx(-3, abs=1e-4)
    assert metrics.held_mm(np.repeat(template[None], 5, 0)) == 0
    assert metrics.held_mm(template + 0.0005 * breath) == pytest.approx(1)


def test_strain_of_a_garment_one_tenth_too_large(swing):
    template, mesh, hips, truth = swing
    assert measured(worn(np.repeat(1.1 * template[None], len(hips), 0), hips), truth, hips, mesh)["strain_p99"] == \
        pytest.approx(0.1)
    half = metrics.Mesh(mesh.faces, template, 0.5 * mesh.rest_length)     # cut at half the size
    assert half.strain(template[None]) == pytest.approx(np.ones((1, len(mesh.edges))))


def test_clips_weigh_the_same_and_quotients_are_of_sums(swing):
    template, mesh, hips, truth = swing
    local, half = metrics.in_hips(truth, hips), 12 + 20
    rigid_hips = worn(np.repeat(template[None], len(hips), 0), hips)
    rows = [measured(rigid_hips, truth, hips, mesh),                       # 20 mm, alive 20, 40 frames
            measured(rigid_hips[:half], worn(template + 3 * (local - template), hips)[:half], hips[:half],
                     mesh)]                                                # 60 mm, alive 60, 20 frames
    rows[0]["penetration"] = {"area_share": 0.25, "p99_mm": 1.0}
    rows[0]["crossings"] = {"cloth": 2.0, "body": None}
    rows[1]["bands"]["coarse"].update(rms_mm=60.0)
    found = metrics.over_clips(rows)
    assert found["clips"] == 2 and found["frames"] == 60
    assert found["position_mm"]["mean"] == pytest.approx(40, abs=1e-3)
    assert found["alive_mm"] == pytest.approx(40, abs=1e-3)
    assert found["relative_error"] == pytest.approx(80 / 80)
    assert found["position_mm"]["max"] == pytest.approx(60, abs=1e-3)
    assert found["bands"]["coarse"]["energy_ratio"] == pytest.approx(np.sqrt(60 ** 2 / (20 ** 2 + 60 ** 2)))
    assert found["penetration"] == {"area_share": 0.25, "p99_mm": 1.0} and found["crossings"] == {"cloth": 2.0}
    assert "calm_mm" not in found and "fine_motion_mm" not in found
    rows[1]["position_mm"]["mean"] = 0.0
    assert metrics.over_clips(rows)["relative_error"] == pytest.approx(20 / 80)   # not the mean of 1 and 0
