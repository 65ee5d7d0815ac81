"""The cloth solver: physics it must keep to, and input it must refuse."""
import dataclasses

import numpy as np
import pytest

from dcloth_training import geometry
from dcloth_training.motion import skeleton
from dcloth_training.simulate import crossings, pattern, settings, solver

try:
    solver.library()
except FileNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)

WOOL = settings.of("wool")


def sheet(side=0.4, spacing=0.02):
    """A level square sheet about the origin at y = 0, right side up: positions [n, 3], Fabric."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * side / 2
    outline = np.concatenate([pattern.sample(corners[k:k + 2], spacing, closed=True) for k in range(4)])
    points, faces = pattern.triangulate(outline, spacing)
    return np.stack([points[:, 0], 0 * points[:, 0], -points[:, 1]], -1), solver.Fabric(faces, points[faces])


def left_edge(points):
    return np.flatnonzero(points[:, 0] < points[:, 0].min() + 1e-6)


def run(points, cloth, pins, frames, body=None, body_faces=None, origin=None, cloth_part=None, wind=None, **changes):
    touched = solver.nothing(frames) if body is None else solver.Body(
        body_faces, np.zeros(len(body_faces), np.int32), np.broadcast_to(body, (frames,) + body.shape[-2:]))
    origin = np.zeros((frames, 3)) if origin is None else origin
    path = np.broadcast_to(points[pins], (frames, len(pins), 3))
    return solver.run(points, cloth, pins, path, touched, origin, {**WOOL, **changes}, wind, cloth_part)


def icosphere(radius, levels=3):
    t = (1 + 5 ** 0.5) / 2
    v = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t), (0, -1, -t), (0, 1, -t),
         (t, 0, -1), (t, 0, 1), (-t, 0, -1), (-t, 0, 1)]
    f = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
         (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
         (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(levels):
        middle, faces = {}, []

        def half(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(v)
                v.append(tuple((np.array(v[a]) + np.array(v[b])) / 2))
            return middle[key]

        for a, b, c in f:
            d, e, g = half(a, b), half(b, c), half(c, a)
            faces += [(a, d, g), (b, e, d), (c, g, e), (d, e, g)]
        v = [tuple(np.array(p) / np.linalg.norm(p)) for p in v]
        f = faces
    return radius * np.array(v), np.array(f)


def test_loose_cloth_falls_as_bodies_do():
    points, cloth = sheet()
    out = run(points, cloth, np.zeros(0, np.int32), 10, air_density=0.0)
    t = np.arange(10) / skeleton.FPS
    # Symplectic Euler falls g t dt / 2 further than g t^2 / 2.
    expected = -9.81 * t * (t + WOOL["frame_seconds"] / WOOL["steps"]) / 2
    assert np.allclose(out[:, :, 1], expected[:, None], atol=2e-5)
    assert np.allclose(out[:, :, [0, 2]], points[:, [0, 2]], atol=2e-5)


def test_a_level_plate_falls_as_fast_as_its_drag_allows():
    """Terminal speed of a flat plate: m g = 1/2 rho c v^2 A."""
    points, cloth = sheet(0.1, 0.0125)
    out = run(points, cloth, np.zeros(0, np.int32), 150, bend=1.0, layer_thickness=0.0)
    speed = (out[-2, :, 1] - out[-1, :, 1]).mean() * skeleton.FPS
    expected = np.sqrt(2 * WOOL["density"] * 9.81 / (WOOL["air_density"] * WOOL["drag_normal"]))
    assert speed == pytest.approx(expected, rel=0.05)      # the plate bends a little


def test_hanging_sheet_hardly_stretches_and_comes_to_rest():
    points, cloth = sheet()
    pins = left_edge(points)
    out = run(points, cloth, pins, 300, damping=60.0)
    far = np.flatnonzero(points[:, 0] > points[:, 0].max() - 1e-6)
    assert np.all(np.linalg.norm(out[-1, far] - out[-1, pins].mean(0), axis=1) > 0.38)
    assert np.allclose(out[-1, far, 1], -0.4, atol=0.012)      # 3 %
    moved = np.linalg.norm(np.diff(out, axis=0), axis=2).mean(1)
    assert moved[-30:].max() < 0.05 * moved[:30].max()         # the air has stopped the swing


def test_wind_in_the_room_is_a_walk_through_still_air():
    """Galilei: cloth carried at constant speed through still air moves as cloth that stands in that wind."""
    points, cloth = sheet(0.3)
    pins, frames = left_edge(points), 40
    speed = np.array([1.5, 0.0, 0.0])
    way = np.arange(frames)[:, None] * speed / skeleton.FPS
    path = points[pins] + way[:, None]
    # The cloth starts at rest in the room; so both are compared once the first swing is over.
    carried = solver.run(points, cloth, pins, path, solver.nothing(frames), way, WOOL) - way[:, None]
    blown = run(points, cloth, pins, frames, wind=np.tile(-speed, (frames, 1)))
    still = run(points, cloth, pins, frames)
    last = -1
    assert np.abs(carried[last] - blown[last]).max() < 0.35 * np.abs(still[last] - blown[last]).max()
    assert (blown[last] - still[last])[:, 0].mean() < -0.03


def test_wind_pushes_across_the_cloth_and_hardly_along_it():
    points, cloth = sheet(0.3)
    pins, frames = left_edge(points), 90
    still = run(points, cloth, pins, frames)[-1]
    across, along = (run(points, cloth, pins, frames, wind=np.tile(wind, (frames, 1)))[-1] - still
                     for wind in ([4.0, 0, 0], [0, 0, 4.0]))
    assert across[:, 0].mean() > 0.05 > 10 * np.abs(along[:, 2].mean())


def test_a_ball_does_not_pass_through():
    ball, ball_faces = icosphere(0.08)
    points, cloth = sheet()
    frames, pins = 40, left_edge(points)
    rise = np.linspace(-0.15, 0.12, frames)   # 7 mm a frame
    body = ball[None] + rise[:, None, None] * np.array([0, 1, 0])
    out = run(points, cloth, pins, frames, body=body, body_faces=ball_faces)
    assert len(out) == frames
    gap = np.linalg.norm(out - np.stack([0 * rise, rise, 0 * rise], 1)[:, None], axis=-1) - 0.08
    # Flat triangles of the ball lie up to r (1 - cos) = 0.08 (edge / 2 r)^2 / 2 = 0.2 mm inside it.
    assert gap.min() > WOOL["thickness"] - 0.001
    assert out[-1, np.argmin(np.linalg.norm(points, axis=1)), 1] > 0.1   # it was lifted
    for frame in range(0, frames, 4):
        assert len(crossings.count(out[frame], cloth.faces, body[frame], ball_faces)[1]) == 0


def test_a_quick_ball_does_not_pass_through_either():
    """5 m/s, a kick: 17 cm a frame."""
    ball, ball_faces = icosphere(0.06)
    points, cloth = sheet()
    frames = 6
    rise = -0.4 + 0.17 * np.arange(frames)
    body = ball[None] + rise[:, None, None] * np.array([0, 1, 0])
    out = run(points, cloth, np.zeros(0, np.int32), frames, body=body, body_faces=ball_faces, gravity=0.0)
    for frame in range(frames):
        assert len(crossings.count(out[frame], cloth.faces, body[frame], ball_faces)[1]) == 0


def test_a_turning_dumbbell_does_not_pass_through():
    """Two balls turn about their middle, which stays where it is: the part's mean says nothing about their speed."""
    ball, ball_faces = icosphere(0.06)
    pair, faces = np.concatenate([ball - [0.3, 0, 0], ball + [0.3, 0, 0]]), np.concatenate([ball_faces] * 2)
    faces[len(ball_faces):] += len(ball)
    points, cloth = sheet(0.3)
    frames = 14
    turn = np.radians(-45 + 6 * np.arange(frames))
    body = np.stack([pair @ np.array([[np.cos(t), np.sin(t), 0], [-np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in turn])
    above = points + [0.3, -0.1, 0]
    out = run(above, cloth, np.zeros(0, np.int32), frames, body=body, body_faces=faces, gravity=0.0)
    assert out[-1, :, 1].max() > above[:, 1].max() + 0.05    # it was hit
    for frame in range(frames):
        assert len(crossings.count(out[frame], cloth.faces, body[frame], faces)[1]) == 0


def test_inner_forces_do_not_move_the_whole():
    """Springs and hinges give back what they take, also where they are solved side by side."""
    points, cloth = sheet()
    mass = np.zeros(len(points))
    area = 0.5 * np.abs(geometry.doubled_areas(cloth.pattern))
    np.add.at(mass, cloth.faces.ravel(), np.repeat(area, 3))
    bent = 1.01 * points + [0, 0.01, 0] * np.sin(40 * points[:, :1])
    out = run(bent, cloth, np.zeros(0, np.int32), 10, gravity=0.0, air_density=0.0, damping=0.0, layer_thickness=0.0)
    assert np.abs(out[-1] - out[0]).max() > 0.005
    middle = np.einsum("n,tnk->tk", mass, out.astype(np.float64)) / mass.sum()
    assert np.abs(middle - middle[0]).max() < 1e-5


def test_friction_holds_a_sheet_on_a_slope():
    """A board tilted by 10 degrees: tan 10 = 0.18. With less friction cloth slides off, with more it stays."""
    points, cloth = sheet(0.2)
    turn = np.radians(10)
    tilt = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    board = np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2], [0, -1, 0]], float) @ tilt.T
    board_faces = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    lying = (points + [0, WOOL["thickness"], 0]) @ tilt.T
    went = [np.linalg.norm((run(lying, cloth, np.zeros(0, np.int32), 45, body=board, body_faces=board_faces,
                                friction=friction)[-1] - lying).mean(0)) for friction in (0.05, 0.3)]
    assert went[0] > 0.2 and went[1] < 0.01


def test_layers_do_not_pass_through_each_other():
    """A sheet falls on a level one that is held by its border; without layers it falls through."""
    low, cloth = sheet(0.3, 0.015)
    small, other = sheet(0.12, 0.015)
    points = np.concatenate([low, small + [0, 0.05, 0]])
    both = solver.Fabric(np.concatenate([cloth.faces, other.faces + len(low)]),
                         np.concatenate([cloth.pattern, other.pattern]))
    pins = np.flatnonzero(np.abs(low[:, [0, 2]]).max(1) > 0.15 - 1e-6)
    held, through = (run(points, both, pins, 40, layer_thickness=thickness)[-1] for thickness in (0.005, 0.0))
    upper = slice(len(low), None)
    assert held[upper, 1].min() > held[:len(low),
                                       1].min() and len(crossings.count(held, both.faces, None, None)[0]) == 0
    assert through[upper, 1].max() < through[:len(low), 1].min()


def test_between_two_parts_cloth_ends_in_the_middle():
    """The hollow of a knee: two balls close on a sheet to 5 mm, less than twice the thickness."""
    ball, ball_faces = icosphere(0.08)
    points, cloth = sheet(0.1, 0.0125)
    frames = 40
    apart = np.linspace(0.1, 0.0825, frames)[:, None, None] * np.array([0, 1, 0])
    body = solver.Body(np.concatenate([ball_faces, ball_faces + len(ball)]),
                       np.repeat([0, 1], len(ball_faces)).astype(np.int32),
                       np.concatenate([ball - apart, ball + apart], axis=1))
    out = solver.run(points, cloth, np.zeros(0, np.int32), np.zeros((frames, 0, 3)), body, np.zeros((frames, 3)),
                     {**WOOL, "gravity": 0.0})
    middle = np.argmin(np.linalg.norm(points, axis=1))
    assert np.abs(out[-5:, middle, 1]).max() < 0.0005     # where sides take turns: 1 mm
    assert len(crossings.count(out[-1], cloth.faces, body.path[-1], body.faces)[1]) == 0


def test_cloth_touches_only_the_parts_it_is_told():
    ball, ball_faces = icosphere(0.08)
    points, cloth = sheet()
    pins = left_edge(points)
    body = ball[None] + np.linspace(-0.15, 0.12, 40)[:, None, None] * np.array([0, 1, 0])
    every, none = np.ones(len(points), np.uint32), np.zeros(len(points), np.uint32)
    lifted, told, through = (run(points, cloth, pins, 40, body=body, body_faces=ball_faces, cloth_part=part)
                             for part in (None, every, none))
    assert np.array_equal(lifted, told)
    assert np.array_equal(through, run(points, cloth, pins, 40))     # as if there were no ball
    middle = np.argmin(np.linalg.norm(points, axis=1))
    assert lifted[-1, middle, 1] > 0.1 > through[-1, middle, 1]
    with pytest.raises(ValueError, match="expected"):
        run(points, cloth, pins, 2, cloth_part=every[:-1])


def test_beside_a_cut_a_part_is_not_touched():
    """Half a ball, open below: cloth that hangs under its rim is left where it is."""
    ball, ball_faces = icosphere(0.08)
    top = ball_faces[(ball[ball_faces][:, :, 1] > -1e-6).all(1)]
    points, cloth = sheet(0.1, 0.0125)
    under = points + [0, -0.03, 0]
    out = run(under, cloth, np.arange(len(points)), 5, body=ball, body_faces=top)
    free = run(under, cloth, np.arange(len(points)), 5)
    assert np.array_equal(out, free)


def test_same_input_same_bits_and_anywhere_in_the_world():
    points, cloth = sheet()
    pins = left_edge(points)[[0, -1]]
    first, second = (run(points, cloth, pins, 30) for _ in range(2))
    assert np.array_equal(first, second)
    place = np.array([512.0, 0, 256.0])
    away = run(points + place, cloth, pins, 10, origin=np.tile(place, (10, 1)))
    # floats 500 m away: 3e-5 m apart, and cloth folds as it likes
    assert np.abs(away - place - first[:10]).max() < 5e-3


def test_a_crease_folds_and_keeps_its_side():
    """A pressed pleat across a sheet without weight opens to its fold angle, outward for a positive one."""
    corners = np.array([[-0.05, -0.1], [0.05, -0.1], [0.05, 0.1], [-0.05, 0.1], [-0.05, -0.1]])
    outline = np.concatenate([pattern.sample(corners[k:k + 2], 0.0125, closed=True) for k in range(4)])
    line = pattern.sample([(0, -0.1), (0, 0.1)], 0.0125)[1:-1]
    points, faces = pattern.triangulate(outline, 0.0125, [line])
    level = np.stack([points[:, 0], 0 * points[:, 0], -points[:, 1]], -1)
    on = np.abs(points[:, 0]) < 1e-6
    for sign in (1, -1):
        cloth = dataclasses.replace(solver.Fabric(faces, points[faces]), crease=np.where(on, sign * np.radians(60), 0))
        out = run(level, cloth, np.zeros(0, np.int32), 60, gravity=0.0, damping=20.0)[-1]
        corner = out[faces]
        up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).mean(0)     # it may have turned
        ridge = (out[on].mean(0) - out[np.abs(points[:, 0]) > 0.045].mean(0)) @ up / np.linalg.norm(up)
        assert sign * ridge == pytest.approx(0.047 * np.sin(np.radians(30)), rel=0.3)


def test_broken_input_ends_the_run_and_says_when():
    points, cloth = sheet()
    assert len(run(points, dataclasses.replace(cloth, faces=cloth.faces + 10000), np.array([0]), 5)) == 0
    path = np.repeat(points[:1][None], 5, 0)
    path[3] = np.nan
    out = solver.run(points, cloth, [0], path, solver.nothing(5), np.zeros((5, 3)), WOOL)
    assert len(out) == 3
    with pytest.raises(ValueError, match="expected"):
        solver.run(points, cloth, [0], path[:4], solver.nothing(5), np.zeros((5, 3)), WOOL)


def test_missing_library_names_where_it_looked(monkeypatch):
    monkeypatch.setenv("DCLOTH_CLOTH_SOLVER", "/nowhere/solver.so")
    solver.library.cache_clear()
    monkeypatch.setattr(solver, "_ROOT", "/nowhere")
    with pytest.raises(FileNotFoundError, match="/nowhere/solver.so"):
        solver.library()
    monkeypatch.undo()
    solver.library.cache_clear()
