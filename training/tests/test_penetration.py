"""Depth under the body: spheres and limbs whose distances are known."""
import numpy as np
import pytest
from conftest import tube

from dcloth_training.simulate import crossings, penetration


def sphere(rings=60, columns=120, radius=0.1):
    """A closed sphere, outward; vertices [b, 3], faces [g, 3]."""
    vertices, faces, _ = tube(1.0, rings, columns, 1.0, -1.0)
    across = np.sin(np.linspace(0, np.pi, rings + 2)[1:-1]).repeat(columns)
    along = np.cos(np.linspace(0, np.pi, rings + 2)[1:-1]).repeat(columns)
    vertices = np.stack([vertices[:, 0] * across, along, vertices[:, 2] * across], -1)
    top, bottom = len(vertices), len(vertices) + 1
    last = (rings - 1) * columns
    ends = [[top, c, (c + 1) % columns] for c in range(columns)] + [
        [bottom, last + (c + 1) % columns, last + c] for c in range(columns)]
    return radius * np.concatenate([vertices, [[0, 1, 0], [0, -1, 0]]]), np.concatenate([faces, ends]).astype(np.int32)


NONE = np.zeros((0, 3), np.int32)


def depth_of(faces, cloth, body, **given):
    """Depth of loose points."""
    return penetration.Body(faces, NONE, len(cloth), **given).contact(cloth, body)[0]


def shells(radii, generator, each=50):
    """Points [k each, 3] at these distances from the origin."""
    direction = generator.normal(size=(len(radii) * each, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * np.repeat(radii, each)[:, None]


def test_depth_in_a_sphere():
    vertices, faces = sphere()
    radii = np.array([0.02, 0.05, 0.09, 0.098, 0.102, 0.15, 0.5])
    cloth = shells(radii, np.random.default_rng(0))
    depth = depth_of(faces, cloth + [3, 1, -2], vertices + [3, 1, -2]).reshape(-1, 50)
    # Flat triangles lie inside of the sphere, by 0.1 (1 - cos(pi / 120)) m = 0.034 mm along each of their two sides.
    assert np.allclose(depth, np.maximum(0.1 - radii, 0)[:, None], atol=7e-5)
    assert (depth[4:] == 0).all()


def test_an_open_limb_is_closed_and_the_neighbourhood_of_its_end_is_outside():
    vertices, faces, _ = tube(0.05, 30, 60, 1.0, 0.5)
    assert sorted(len(loop) for loop in penetration.openings(faces)) == [60, 60]
    height = np.linspace(0.51, 0.99, 20)
    axis = np.stack([0 * height, height, 0 * height], -1)
    beyond = axis + [0, 0.6, 0]
    cloth = np.concatenate([axis, beyond, axis + [0.06, 0, 0], [[0.045, 0.75, 0]]])
    depth = depth_of(faces, cloth, vertices)
    from_end = np.minimum(height - 0.5, 1.0 - height)
    assert np.allclose(depth[:20], np.minimum(from_end, 0.05), atol=1e-4)
    assert (depth[20:60] == 0).all() and depth[60] == pytest.approx(0.005, abs=1e-4)


def test_overlapping_parts_have_no_hollow_inside():
    """A part that overlaps itself, as thigh and calf in a squat: the sheet of one inside the other is no outside."""
    vertices, faces = sphere()
    both = np.concatenate([vertices, vertices + [0.12, 0, 0]])
    together = np.concatenate([faces, faces + len(vertices)])
    cloth = np.array([[0.06, 0, 0], [0.03, 0, 0], [0.01, 0, 0], [0.25, 0, 0]])
    depth = depth_of(together, cloth, both)
    # Nearest triangle: both spheres' fronts 40 mm away; the second one's, 10 mm; the same, 10 mm on its outer side.
    assert np.allclose(depth, [0.04, 0.01, 0.01, 0], atol=1e-4)


def test_cloth_counts_only_against_what_it_may_touch():
    vertices, faces = sphere()
    both = np.concatenate([vertices, vertices + [0.5, 0, 0]])
    together = np.concatenate([faces, faces + len(vertices)])
    cloth = np.array([[0, 0.05, 0], [0, 0.05, 0], [0.5, 0.05, 0], [0.5, 0.05, 0], [0, 0.05, 0]])
    touches = np.array([1, 2, 1, 2, 3])
    wanted = [0.05, 0, 0, 0.05, 0.05]
    part = np.repeat([0, 1], len(faces))
    masks = np.repeat([1, 2], len(vertices))
    for given in ({"part": part}, {"masks": masks}):
        depth = depth_of(together, cloth, both, touches=touches, **given)
        assert np.allclose(depth, wanted, atol=1e-4), given
    with pytest.raises(ValueError, match="cloth of shape"):
        penetration.Body(together, NONE, 4).contact(cloth, both)


def test_a_sheet_of_cloth_is_measured_as_its_points_are():
    """Connected cloth takes a shortcut where nothing crosses; the answer must be that of the points."""
    vertices, faces = sphere(30, 60)
    sheet, sheet_faces, _ = tube(0.05, 20, 30, 0.2, -0.2)
    inside, inside_faces, _ = tube(0.02, 4, 8, 0.03, -0.03)
    away = inside + [1, 0, 0]
    for cloth, own, crosses in ((sheet, sheet_faces, True), (inside, inside_faces, False), (away, inside_faces, False),
                                (np.concatenate([inside, away]), np.concatenate([inside_faces, inside_faces + 32]),
                                 False)):
        depth, pairs = penetration.Body(faces, own, len(cloth)).contact(cloth, vertices)
        assert np.allclose(depth, depth_of(faces, cloth, vertices), atol=1e-12)
        assert (len(pairs) > 0) == crosses
        assert pairs.tolist() == crossings.between(cloth, own, vertices, faces).tolist()


def test_crossing_pairs_are_of_faces_that_may_touch_and_leave_out_the_fans():
    limb, faces, _ = tube(0.05, 10, 24, 1.0, 0.5)
    two = np.concatenate([limb, limb + [0.3, 0, 0]])
    both = np.concatenate([faces, faces + len(limb)])
    sheet = np.array([[-0.1, 0.7, 0], [0.5, 0.7, 0], [-0.1, 0.72, 0.2], [0, 1.1, 0.01], [0.02, 0.9, 0.01],
                      [0, 1.1, 0.0]])
    own = np.array([[0, 1, 2], [3, 4, 5]])          # one through both limbs, one down through the open end of the first
    part = np.repeat([0, 1], len(faces))
    body = penetration.Body(both, own, 6, part=part)
    depth, pairs = body.contact(sheet, two)
    assert set(pairs[:, 0]) == {0} and (pairs[:, 1] < len(faces)).any() and (pairs[:, 1] >= len(faces)).any()
    assert depth[4] == pytest.approx(0.05 - np.hypot(0.02, 0.01), abs=1e-3) and (depth[[0, 1, 2, 3, 5]] == 0).all()
    first = penetration.Body(both, own, 6, part=part, touches=np.ones(6)).contact(sheet, two)[1]
    assert len(first) and (first[:, 1] < len(faces)).all()


def test_summary_weighs_by_area():
    # Two triangles; the second's area is three times the first's. Vertices 0 and 1 belong to the first alone.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 3.0], [2, 1, 0.0]])
    faces = np.array([[0, 1, 2], [2, 3, 4]])
    areas = penetration.vertex_areas(vertices, faces)
    assert np.allclose(areas, [1 / 6, 1 / 6, 1 / 6 + 1, 1, 1]) and np.isclose(areas.sum(), 3.5)
    depths = np.zeros((2, 5))
    depths[0, 0], depths[0, 3], depths[1, 1] = 0.0011, 0.02, 0.0009
    found = penetration.summary(depths, areas)
    assert found["area_share"] == pytest.approx((1 / 6 + 1) / 3.5 / 2) and found["max_mm"] == pytest.approx(20)
    assert found["p99_mm"] == pytest.approx(1e3 * np.percentile([0] * 7 + [0.0009, 0.0011, 0.02], 99))
