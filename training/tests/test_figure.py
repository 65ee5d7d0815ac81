"""The figure: closed, symmetric, within the engine's limits, and whole in the poses that garments are made for."""
import os

import numpy as np
import pytest

from dcloth_training import figure
from dcloth_training.figure import decimate, makehuman, shape
from dcloth_training.motion import rotations

SHAPES = ("average", "slim", "heavy")
ENGINE_LIMIT = 8192


def posed(body, turns):
    """Skinned vertices with {joint: [(axis, degrees), ...]} local rotations; the tests' own forward kinematics."""
    turn, at = np.zeros((len(body.names), 3, 3)), body.joints.copy()
    for j, parent in enumerate(body.parents):
        own = np.eye(3)
        for axis, degrees in turns.get(body.names[j], ()):
            own = own @ rotations.about_axis(axis, np.radians(degrees))
        turn[j] = own if parent < 0 else turn[parent] @ own
        if parent >= 0:
            at[j] = at[parent] + turn[parent] @ (body.joints[j] - body.joints[parent])
    return np.einsum("nj,njk->nk", body.weights,
                     np.einsum("jab,njb->nja", turn, body.vertices[:, None] - body.joints) + at)


def edge_counts(faces):
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(edges, axis=0, return_counts=True)


def volume(points, faces):
    a, b, c = (points[faces[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("name", SHAPES)
def test_surface_is_closed_and_outward_and_fits_the_engine(name):
    body = figure.load(name)
    assert len(body.vertices) <= ENGINE_LIMIT
    edges, counts = edge_counts(body.faces)
    assert (counts == 1).all()                      # each edge once in either direction: closed and oriented
    assert set(map(tuple, edges)) == set(map(tuple, edges[:, ::-1]))
    assert len(body.vertices) - len(edges) // 2 + len(body.faces) == 2      # a sphere: no handle, one piece
    assert 0.04 < volume(body.vertices, body.faces) < 0.09
    assert abs(body.vertices[:, 1].min()) < 0.003 and 1.65 < body.vertices[:, 1].max() < 1.72


@pytest.mark.parametrize("name", SHAPES)
def test_left_and_right_are_mirror_images(name):
    body = figure.load(name)
    flip = np.array([-1.0, 1.0, 1.0])
    assert np.array_equal(body.mirror[body.mirror], np.arange(len(body.vertices)))
    assert np.array_equal(body.vertices[body.mirror] * flip, body.vertices)
    assert np.allclose(body.weights[body.mirror][:, makehuman.MIRRORED], body.weights, atol=1e-4)
    faces = {frozenset(face) for face in body.faces.tolist()}
    assert {frozenset(face) for face in body.mirror[body.faces].tolist()} == faces
    assert np.allclose(body.joints[makehuman.MIRRORED] * flip, body.joints, atol=1e-6)


def test_weights_are_few_and_sum_to_one():
    body = figure.load()
    assert (body.weights > 0).sum(1).max() <= 4 and (body.weights >= 0).all()
    assert np.allclose(body.weights.sum(1), 1, atol=1e-9)
    # Smooth: no jump over an edge of a centimetre or more.
    edges, _ = edge_counts(body.faces)
    jump = np.abs(body.weights[edges[:, 0]] - body.weights[edges[:, 1]]).max(1)
    assert jump.max() < 0.75 and np.percentile(jump, 99) < 0.45


def test_t_pose_is_mixamos():
    body = figure.load()
    at = dict(zip(body.names, body.joints))
    for side, sign in (("Left", 1), ("Right", -1)):
        arm = [at[side + joint] for joint in ("Arm", "ForeArm", "Hand")]
        assert np.ptp([p[1] for p in arm]) < 1e-6 and sign * (arm[2][0] - arm[0][0]) > 0.4      # level, outward
        leg = [at[side + joint] for joint in ("UpLeg", "Leg", "Foot")]
        assert np.ptp([p[0] for p in leg]) < 1e-6 and np.ptp([p[2] for p in leg]) < 1e-6       # straight down
        assert at[side + "ToeBase"][2] > leg[2][2] + 0.1
    assert [body.names[p] if p >= 0 else None for p in body.parents][:7] == [
        None, "Hips", "Spine", "Spine1", "Spine2", "Neck", "Spine2"]
    # Thighs stand apart: cloth may hang between them.
    thigh = body.weights[:, body.names.index("LeftUpLeg")] > 0.9
    assert body.vertices[thigh, 0].min() > 0.001


def test_edges_are_short_where_cloth_lies():
    body = figure.load()
    edges, _ = edge_counts(body.faces)
    middle = body.vertices[edges].mean(1)
    length = np.linalg.norm(body.vertices[edges[:, 0]] - body.vertices[edges[:, 1]], axis=1)
    worn = (middle[:, 1] > 0.45) & (middle[:, 1] < 1.3) & (np.abs(middle[:, 0]) < 0.25)
    assert 0.015 < np.median(length[worn]) < 0.024 and np.percentile(length[worn], 99) < 0.036


def arms(degrees):
    return {"LeftArm": [("Z", -degrees)], "RightArm": [("Z", degrees)]}


POSES = {
    "stand": arms(68),
    "front kick": {**arms(50), "RightUpLeg": [("X", -95)]},
    "high kick": {**arms(50), "RightUpLeg": [("X", -125)]},
    "deep squat": {**arms(60), "Hips": [("X", 25)], "LeftUpLeg": [("X", -125), ("Z", 15)], "LeftLeg": [("X", 130)],
                   "RightUpLeg": [("X", -125), ("Z", -15)], "RightLeg": [("X", 130)]},
    "arms up": {"LeftShoulder": [("Z", 22)], "LeftArm": [("Z", 60)],
                "RightShoulder": [("Z", -22)], "RightArm": [("Z", -60)]},
}


@pytest.mark.parametrize("pose", POSES)
def test_no_limb_collapses(pose):
    """Linear blend skinning loses volume at a sharp joint: 9 % of the whole body in a deep squat, and few triangles
    fold over."""
    body = figure.load()
    points = posed(body, POSES[pose])
    assert abs(volume(points, body.faces) / volume(body.vertices, body.faces) - 1) < 0.10
    normals = [np.cross(p[body.faces[:, 1]] - p[body.faces[:, 0]], p[body.faces[:, 2]] - p[body.faces[:, 0]])
               for p in (points, body.vertices)]
    area = np.linalg.norm(normals[0], axis=1) / np.linalg.norm(normals[1], axis=1)
    # Next to each other: neighbours that face against one another are a fold.
    edges, face = np.concatenate([body.faces[:, [i, (i + 1) % 3]]
                                  for i in range(3)]), np.tile(np.arange(len(body.faces)), 3)
    owner = {tuple(edge): f for edge, f in zip(edges.tolist(), face)}
    pairs = np.array([(f, owner[b, a]) for (a, b), f in owner.items() if a < b])
    unit = normals[0] / np.linalg.norm(normals[0], axis=1, keepdims=True)
    folded = (unit[pairs[:, 0]] * unit[pairs[:, 1]]).sum(1) < -0.5
    assert folded.mean() < 0.004 and np.percentile(area, 0.5) > 0.2


def test_regions_are_drawn_with_sharp_edges():
    body = figure.load()
    source, faces, colours = body.drawing()
    assert np.array_equal(source[faces], body.faces)
    for face in (0, len(faces) // 2, len(faces) - 1):
        assert np.array_equal(colours[faces[face]], np.repeat(body.palette[body.face_regions[face]][None], 3, 0))
    used = {body.region_names[r] for r in np.unique(body.face_regions)}
    assert used == set(body.region_names)
    area = np.linalg.norm(np.cross(*(body.vertices[body.faces[:, i]] - body.vertices[body.faces[:, 0]]
                                     for i in (1, 2))),
                          axis=1) / 2
    eyes = area[np.isin(body.face_regions, [body.region_names.index(r) for r in ("eye", "iris", "pupil")])].sum()
    assert 2e-4 < eyes < 2e-3      # two eyes: a few square centimetres


@pytest.mark.parametrize("shape", SHAPES)
def test_a_face_has_the_colour_of_its_last_corner(shape):
    body = figure.load(shape)
    turned = body.faces_by_colour
    assert np.array_equal(body.regions[turned[:, 2]], body.face_regions)
    rolled = np.stack([np.roll(body.faces, k, 1) for k in range(3)], 1)
    assert (rolled == turned[:, None]).all(2).any(1).all()      # the same triangles, the same way round


def test_file_is_small_and_names_are_checked():
    assert os.path.getsize(figure.FILE) < 2 << 20
    with pytest.raises(ValueError, match="figure 'tall', allowed: average, heavy, slim"):
        figure.load("tall")


def test_bake_takes_no_other_wheel(tmp_path):
    path = tmp_path / makehuman.WHEEL
    path.write_bytes(b"PK\5\6" + bytes(18))
    with pytest.raises(makehuman.SourceError, match="SHA-256 .* expected " + makehuman.SHA256):
        makehuman.Source(str(path))


def grid(n):
    """A square patch of n by n quads and its border."""
    u = np.linspace(0, 1, n + 1)
    points = np.stack(np.meshgrid(u, u, [0.0], indexing="ij"), -1).reshape(-1, 3)
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    border = ((points[:, :2] == 0) | (points[:, :2] == 1)).any(1)
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), border


def test_decimation_keeps_the_plane_the_border_and_a_line():
    points, faces, border = grid(12)
    line = np.where(np.abs(points[:, 0] - 0.5) < 1e-9, 1, 0)
    everywhere = np.ones(len(points))
    kept, left = decimate.collapse(points, faces, 0.4 * everywhere, 0.01 * everywhere, border, line, 60)
    assert len(kept) == 60 and set(np.unique(left)) == set(kept)
    a, b, c = (points[left[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert (area > 0).all() and np.isclose(area.sum(), 1)               # nothing folds, nothing is lost
    x = points[left, 0] - 0.5
    assert not ((x.min(1) < -1e-9) & (x.max(1) > 1e-9)).any()           # no triangle crosses the line
    with pytest.raises(ValueError, match="no edge may collapse, wanted 3"):
        decimate.collapse(points, faces, 0.05 * everywhere, 0.01 * everywhere, border, line, 3)


def test_film_closes_an_opening_and_a_plate_goes_on_as_its_surroundings():
    points, faces, border = grid(12)
    dome = points + [0, 0, 1] * (1 - ((points - 0.5) ** 2).sum(1, keepdims=True))
    inner = np.linalg.norm(points[:, :2] - 0.5, axis=1) < 0.2
    spoilt = dome.copy()
    spoilt[inner, 2] += 0.3
    graph = shape.neighbours(faces, len(points))
    film, plate = (shape.filled(spoilt, inner, graph, smooth)[inner, 2] for smooth in (False, True))
    assert np.abs(plate - dome[inner, 2]).max() < 0.01 < np.abs(film - dome[inner, 2]).max() < 0.08
