"""The cloth solver: physics it must keep to, and input it must refuse."""

import numpy as np
import pytest

from dcloth_training import figure
from dcloth_training.motion import rotations, skeleton
from dcloth_training.simulate import (clips, cloth_job, garment, run as ground_truth,
                                      settings, solver, statics)

try:
    solver.library()
except FileNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)

FAR_BODY = np.array([[0, -50, 0], [1, -50, 0], [0, -50, 1]], float)


def sheet(side=21, edge=0.02):
    """A level square sheet [side^2, 3] around the origin at y = 0, triangles facing up."""
    line = (np.arange(side) - (side - 1) / 2) * edge
    points = np.stack(np.meshgrid(line, [0.0], line, indexing="ij"), -1).reshape(-1, 3)
    i = np.arange(side * side).reshape(side, side)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])


def run(points, faces, pins, frames, body=FAR_BODY, body_faces=((0, 1, 2),), hips=None, cloth_part=None, **changes):
    pin_path = np.broadcast_to(points[pins], (frames, len(pins), 3))
    body_path = body if body.ndim == 3 else np.broadcast_to(body, (frames,) + body.shape)
    hips = np.broadcast_to(np.eye(4), (frames, 4, 4)) if hips is None else hips
    return solver.run(points, faces, pins, pin_path, np.array(body_faces), body_path,
                      np.ones(body_path.shape[1], np.uint32), hips, settings.with_changes(**changes),
                      cloth_part=cloth_part)


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
    points, faces = sheet()
    points = np.concatenate([points, [[5.0, 0, 0], [5.1, 0, 0], [5.0, 0, 0.1]]])
    faces = np.concatenate([faces, [[441, 442, 443]]])   # the pin is on another piece
    out = run(points, faces, np.array([441]), 10, drag_normal=0.0, drag_tangent=0.0, air_follows=0.0)
    t = np.arange(10) / skeleton.FPS
    # Symplectic Euler falls g t dt / 2 further than g t^2 / 2.
    dt = 1 / (settings.GROUND_TRUTH["steps"] * skeleton.FPS)
    expected = -9.81 * t * (t + dt) / 2
    assert np.allclose(out[:, :441, 1], expected[:, None], atol=2e-5)
    assert np.allclose(out[:, :441, [0, 2]], points[:441][:, [0, 2]], atol=2e-5)


def test_hanging_sheet_hardly_stretches_and_comes_to_rest():
    points, faces = sheet()
    pins = np.flatnonzero(points[:, 0] < points[:, 0].min() + 1e-6)
    out = run(points, faces, pins, 150)
    length = np.linalg.norm(out[-1, -21:] - points[pins], axis=1)
    assert np.all(length < 1.02 * 0.4) and np.all(length > 0.95 * 0.4)
    assert np.allclose(out[-1, -21:, 1], -0.4, atol=0.02)
    assert np.linalg.norm(out[-1] - out[-2], axis=1).max() < 1e-4


def test_a_ball_does_not_pass_through():
    ball, ball_faces = icosphere(0.08)
    points, faces = sheet()
    frames = 40
    rise = np.linspace(-0.15, 0.12, frames)   # 7 mm a frame
    body = ball[None] + rise[:, None, None] * np.array([0, 1, 0])
    pins = np.flatnonzero(points[:, 0] < points[:, 0].min() + 1e-6)   # one edge: it need not stretch
    out = run(points, faces, pins, frames, body=body, body_faces=ball_faces)
    assert len(out) == frames
    gap = np.linalg.norm(out - np.stack([0 * rise, rise, 0 * rise], 1)[:, None], axis=-1) - 0.08
    # Flat triangles of the ball lie up to r (1 - cos) = 0.08 (edge / 2 r)^2 / 2 = 0.2 mm inside it.
    assert gap.min() > settings.GROUND_TRUTH["thickness"] - 0.001
    assert out[-1, 220, 1] > 0.1   # it was lifted


def test_cloth_touches_only_the_parts_it_is_told():
    ball, ball_faces = icosphere(0.08)
    points, faces = sheet()
    pins = np.flatnonzero(points[:, 0] < points[:, 0].min() + 1e-6)
    body = ball[None] + np.linspace(-0.15, 0.12, 40)[:, None, None] * np.array([0, 1, 0])
    every, none = np.ones(len(points), np.uint32), np.zeros(len(points), np.uint32)
    lifted, told, through = (run(points, faces, pins, 40, body=body, body_faces=ball_faces, cloth_part=part)
                             for part in (None, every, none))
    assert np.array_equal(lifted, told)
    assert np.array_equal(through, run(points, faces, pins, 40))     # as if there were no ball
    assert lifted[-1, 220, 1] > 0.1 > through[-1, 220, 1]
    with pytest.raises(ValueError, match="cloth_part has shape"):
        run(points, faces, pins, 2, cloth_part=every[:-1])


def test_same_input_same_bits_and_anywhere_in_the_world():
    points, faces = sheet()
    pins = np.array([0, 20])
    first, second = (run(points, faces, pins, 30) for _ in range(2))
    assert np.array_equal(first, second)
    hips = np.tile(np.eye(4), (30, 1, 1))
    hips[:, :3, 3] = [512.0, 0, 256.0]
    away = run(points + hips[0, :3, 3], faces, pins, 30, hips=hips)
    assert np.abs(away - hips[0, :3, 3] - first).max() < 2e-3   # floats 500 m away: 3e-5 m apart


def test_air_that_follows_carries_cloth_along():
    points, faces = sheet()
    pins = np.array([0])
    hips = np.tile(np.eye(4), (30, 1, 1))
    hips[:, 0, 3] = 0.05 * np.arange(30)
    still, carried = (run(points, faces, pins, 30, hips=hips, air_follows=share)[-1, 1:, 0].mean()
                      for share in (0.0, 1.0))
    assert carried > still + 0.05


def test_skirt_hangs_symmetric_and_still():
    skirt, rest = garment.skirt(), skeleton.rest_motion(75)
    result = cloth_job.simulate(rest, figure.load(), skirt, [73, 74])
    drape = result.cloth[1]
    lopsided = np.linalg.norm(drape - drape[skirt.mirror] * [-1, 1, 1], axis=1).mean()
    moving = np.linalg.norm(result.cloth[1] - result.cloth[0], axis=1).mean()
    assert lopsided < 0.002 and moving < 1e-4


def test_a_skirt_kicked_up_comes_down_again():
    motion, skirt, body = skeleton.rest_motion(100), garment.skirt(), figure.load()
    up = np.clip(np.minimum(np.arange(100) / 8, (68 - np.arange(100)) / 8), 0, 1)
    motion.local[:, skeleton.INDEX["RightUpLeg"]] = rotations.about_axis("X", -1.95 * up)   # past level
    motion.local[:, skeleton.INDEX["LeftUpLeg"]] = rotations.about_axis("X", 0.95 * up)
    cloth = cloth_job.simulate(motion, body, skirt, [0, -1]).cloth
    hem = cloth[:, -garment.COLUMNS:, 1].mean(1)
    assert hem[1] == pytest.approx(hem[0], abs=0.01)


def test_a_pose_has_one_drape_whatever_came_before():
    skirt, body = garment.skirt(), figure.load()
    kicks, crouches = (clips.load(f"procedural/{name}") for name in ("kicks", "crouch_walk"))
    poses = statics.without_root(skeleton.Motion(*(np.concatenate([
        getattr(kicks, part)[20:140:30], getattr(crouches, part)[20:140:30]]) for part in ("root", "local"))))

    def drapes(order):
        tour, rests = statics.tour(poses[order])
        joined, frames = ground_truth.with_lead(tour)
        return cloth_job.simulate(joined, body, skirt, frames[rests]).cloth[np.argsort(order)]

    first, second = drapes(np.arange(8)), drapes(np.array([5, 0, 7, 2, 6, 3, 1, 4]))
    apart = np.linalg.norm(first - second, axis=-1).mean(1)
    differ = np.linalg.norm(first - first.mean(0), axis=-1).mean()
    assert differ > 0.01 and apart.max() < 0.002   # without braces over dents: 0.02 to 0.03


def test_broken_input_ends_the_run_and_says_when():
    points, faces = sheet()
    assert len(run(points, faces + 1000, np.array([0]), 5)) == 0
    body = np.broadcast_to(FAR_BODY, (5, 3, 3)).copy()
    pin_path = np.repeat(points[:1][None], 5, 0)
    pin_path[3] = np.nan
    hips = np.broadcast_to(np.eye(4), (5, 4, 4))
    out = solver.run(points, faces, [0], pin_path, [[0, 1, 2]], body, np.ones(3), hips,
                     settings.GROUND_TRUTH)
    assert len(out) == 3
    with pytest.raises(ValueError, match="frames"):
        solver.run(points, faces, [0], pin_path[:4], [[0, 1, 2]], body, np.ones(3), hips,
                   settings.GROUND_TRUTH)


def test_missing_library_names_where_it_looked(monkeypatch):
    monkeypatch.setenv("DCLOTH_CLOTH_SOLVER", "/nowhere/solver.so")
    solver.library.cache_clear()
    monkeypatch.setattr(solver, "_ROOT", "/nowhere")
    with pytest.raises(FileNotFoundError, match="/nowhere/solver.so"):
        solver.library()
    monkeypatch.undo()
    solver.library.cache_clear()
