"""The rasteriser: what is nearer is seen, light comes from above, shadows fall, edges are smooth."""
import numpy as np
import pytest

from dcloth_training import picture_file, raster

SQUARE = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
GREEN, RED = (0, 1, 0), (1, 0, 0)


def canvas(**changes):
    return raster.Canvas(**{"size": 40, "span": 2.0, "centre": (0, 0, 0), "yaw": 0.0, "pitch": 0.0, **changes})


def test_the_nearer_surface_and_its_side_are_seen():
    view = canvas()
    view.draw(SQUARE, FACES, GREEN, RED)
    front = view.image()
    assert front[20, 20, 1] > 0.5 and front[20, 20, 0] < 0.1
    assert np.allclose(front[1, 1], raster.BACKGROUND)
    view.draw(SQUARE + [0, 0, 0.1], FACES[:, ::-1], GREEN, RED)
    back = view.image()
    assert back[20, 20, 0] > 0.5 and back[20, 20, 1] < 0.1
    before = view.colour.copy(), view.depth.copy()
    view.draw(SQUARE + [0, 0, -0.1], FACES, GREEN)          # hidden: nothing changes
    assert np.array_equal(view.colour, before[0]) and np.array_equal(view.depth, before[1])


def test_a_square_covers_its_area_and_colours_run_between_vertices():
    view = canvas(samples=1)
    view.draw(SQUARE, FACES, np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]], float))
    seen = np.isfinite(view.depth)
    assert seen.sum() == 20 * 20 and seen[10:30, 10:30].all()     # half of 40 pixels either way
    row = view.colour[20, 10:30, 0]
    assert np.allclose(row, (np.arange(10, 30) - 19.5) / 20 + 0.5, atol=1e-6)


def test_every_sample_of_a_mesh_is_covered_once_and_by_the_nearest_triangle():
    generator = np.random.default_rng(1)
    points = np.concatenate([generator.uniform(0, 20, (60, 2)), generator.uniform(0, 1, (60, 1))], 1)
    faces = np.array([f for f in generator.integers(0, 60, (60, 3)) if len(set(f)) == 3])
    face, row, column, weight, depth = raster.covered(points, faces, 20)
    found = {(r, c): d for r, c, d in zip(row, column, depth)}
    assert len(found) == len(face) > 200 and np.allclose(weight.sum(1), 1)
    solved = [np.linalg.inv(np.vstack([points[f, :2].T, np.ones(3)])) for f in faces]
    for r in range(20):                                     # plain loops: the nearest of all triangles
        for c in range(20):
            weights = [(matrix @ (c, r, 1), f) for matrix, f in zip(solved, faces)]
            best = max((w @ points[f, 2] for w, f in weights if (w >= -1e-6).all()), default=None)
            assert (best is None) == ((r, c) not in found), (r, c)
            assert best is None or abs(found[r, c] - best) < 1e-6


def test_light_from_above_and_shadow_below():
    lit = []
    for pitch in (-0.8, 0.8):                               # the square turned towards the light, then away from it
        view = canvas()
        view.draw(SQUARE @ raster.about("X", pitch).T, FACES, (0.5, 0.5, 0.5))
        lit.append(view.image()[20, 20, 0])
    assert lit[0] > lit[1] + 0.1
    for shadows, darker in ((True, True), (False, False)):
        view = canvas(pitch=0.9, shadows=shadows)
        view.draw(*raster.ground((0, -0.3, 0), 2.0, (0.8, 0.8, 0.8)), lit=False)
        free = view.image()
        view.draw(0.3 * SQUARE @ raster.about("X", np.pi / 2).T, FACES, GREEN, RED)     # a small roof over it
        change = (free - view.image())[np.isfinite(view.depth).reshape(40, 2, 40, 2).all((1, 3)) & ~view.normal.any(-1)
                                       .reshape(40, 2, 40, 2).any((1, 3))]
        assert (change.max() > 0.1) == darker and change.min() > -1e-6


def test_edges_are_averaged():
    view = canvas(samples=3)
    view.draw(SQUARE @ np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]).T, FACES, (0, 0, 0))
    between = (view.image()[..., 0] > 0.15) & (view.image()[..., 0] < 0.9)
    assert 40 < between.sum() < 200                         # about one pixel wide all around: 80 pixels of edge


def test_normals_point_outward_and_are_weighted_by_area():
    corner = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 1.0]])
    normal = raster.vertex_normals(corner, np.array([[0, 1, 2], [0, 3, 1]]))
    assert np.allclose(normal[0], np.array([0, 2, 4]) / np.sqrt(20))
    assert np.allclose(np.linalg.norm(normal, axis=1), 1)


def test_a_picture_keeps_its_colours_and_appears_whole(tmp_path):
    from matplotlib import image
    generator = np.random.default_rng(2)
    picture = np.tile(generator.uniform(0, 1, (1, 40, 3)), (30, 1, 1))      # few colours: they stay exact
    picture_file.save(str(tmp_path / "a.png"), picture)
    read = image.imread(str(tmp_path / "a.png"))[..., :3]
    assert np.abs(read - picture).max() < 0.5 / 255 + 1e-6
    picture_file.save(str(tmp_path / "b.png"), picture, [(2, 2, "caption", 12)])
    written = image.imread(str(tmp_path / "b.png"))[..., :3]
    assert np.abs(written - read).max(-1)[2:16].any() and np.abs(written - read)[20:].max() < 0.02
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]
    with pytest.raises(OSError):
        picture_file.save(str(tmp_path / "none" / "a.png"), picture)
