"""The robe: symmetric, one clean sheet, evenly meshed, clear of the body, pinned at the yoke."""
import pathlib

import numpy as np
import pytest
from scipy import sparse

from dcloth_training import metrics, rig, safetensors_io
from dcloth_training.motion import rotations, skeleton
from dcloth_training.motion.skeleton import HIP_HEIGHT, INDEX
from dcloth_training.simulate import closed_arms, cloth_job, garment, garment_robe, mannequin, run

MODELS = pathlib.Path(__file__).parents[2] / "models"


@pytest.fixture(scope="module")
def robe():
    return garment_robe.robe()


def directed_sides(faces):
    return np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])


def test_robe_is_exactly_mirror_symmetric(robe):
    n = len(robe.vertices)
    assert 9500 <= n <= 9900 and robe.mirror.dtype == np.int32
    assert np.array_equal(robe.mirror[robe.mirror], np.arange(n))
    assert np.array_equal(robe.vertices[robe.mirror], robe.vertices * [-1, 1, 1])
    assert np.array_equal(robe.pinned[robe.mirror], robe.pinned)
    own = robe.mirror == np.arange(n)
    assert np.array_equal(own, robe.vertices[:, 0] == 0.0) and own.sum() > 100
    triangles = {tuple(sorted(f)) for f in robe.faces.tolist()}
    assert len(triangles) == len(robe.faces)
    assert {tuple(sorted(f)) for f in robe.mirror[robe.faces].tolist()} == triangles


def test_robe_is_one_manifold_sheet_with_four_openings(robe):
    n = len(robe.vertices)
    sides = directed_sides(robe.faces)
    assert len(np.unique(sides, axis=0)) == len(sides)      # consistently oriented, no side thrice
    pairs, uses = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    assert set(uses) == {1, 2} and set(np.unique(robe.faces)) == set(range(n))

    def pieces(edges, vertices):
        graph = sparse.coo_matrix((np.ones(len(edges)), edges.T), (n, n))
        labels = sparse.csgraph.connected_components(graph, directed=False)[1]
        return len(np.unique(labels[vertices]))

    assert pieces(pairs, np.arange(n)) == 1
    border = pairs[uses == 1]
    assert pieces(border, np.unique(border)) == 4           # hem, two cuffs, neck
    assert (np.bincount(border.ravel())[np.unique(border)] == 2).all()
    # A sphere with four holes: no handle, no twist.
    assert n - len(pairs) + len(robe.faces) == 2 - 4
    # Around every vertex the triangles form one fan: their opposite sides make one open or closed path.
    opposite = robe.faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2)
    corner = robe.faces.ravel()
    order = np.argsort(corner, kind="stable")
    starts = np.searchsorted(corner[order], np.arange(n + 1))
    for v in range(n):
        ring = opposite[order[starts[v]:starts[v + 1]]]
        step = dict(ring.tolist())
        first = (set(step) - set(step.values()) or set(step)).pop()
        at, seen = first, 0
        while at in step and seen < len(step):
            at, seen = step[at], seen + 1
        assert seen == len(ring)


def test_robe_faces_outward(robe):
    """Rays from a face leave the robe: the field behind it is negative, before it positive."""
    a, b, c = (robe.vertices[robe.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = (a + b + c) / 3 - [0, HIP_HEIGHT, 0]
    # A pleat at the hem, 36 mm deep and 10 a turn of 1.9 m, has a radius of curvature of 25 mm: a
    # chord of 30 mm leaves the surface by 4.5 mm. 8 mm is beyond that and well within a fold.
    assert (garment_robe._field(middle + 0.008 * normal) > 0).all()
    assert (garment_robe._field(middle - 0.008 * normal) < 0).all()


def test_robe_is_evenly_meshed(robe):
    pairs = metrics.edges_of(robe.faces)
    length = 1e3 * np.linalg.norm(robe.vertices[pairs[:, 0]] - robe.vertices[pairs[:, 1]], axis=1)
    # 2.02 square metres in 9,512 vertices: cells of 14.6 mm, diagonals of 20.6 mm. Columns run down from the belt to a
    # hem twice as long, where cells are 23 mm wide, so all but one in a hundred edges stay within a third of a cell
    # below and within a half of its diagonal above; none is below half or beyond twice.
    a, b, c = (robe.vertices[robe.faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert 2.0 < area < 2.1
    cell = 1e3 * np.sqrt(area / len(robe.vertices))
    low, high = np.percentile(length, [1, 99])
    assert low > cell * 2 / 3 and high < cell * np.sqrt(2) * 3 / 2
    assert length.min() > cell / 2 and length.max() < 2 * np.sqrt(2) * cell
    a, b, c = (robe.vertices[robe.faces[:, i]] for i in range(3))
    cosines = [np.einsum("ij,ij->i", q - p, r - p) / np.linalg.norm(q - p, axis=1)
               / np.linalg.norm(r - p, axis=1) for p, q, r in ((a, b, c), (b, c, a), (c, a, b))]
    angles = np.degrees(np.arccos(cosines))                # 29 degrees in a cell of 23 by 13 mm, less where sheared
    assert np.percentile(angles.min(0), 1) > 28 and angles.min() > 15
    assert np.percentile(angles.max(0), 99) < 105 and angles.max() < 140


def test_robe_is_clear_of_the_body(robe):
    at = robe.vertices - [0, HIP_HEIGHT, 0]
    middles = at[robe.faces].mean(1)
    assert mannequin.surface_distance(at).min() >= 0.010
    assert mannequin.surface_distance(middles).min() >= 0.009


def test_robe_reaches_from_cuff_to_cuff_and_just_below_the_knee(robe):
    low, high = robe.vertices.min(0), robe.vertices.max(0)
    hand = skeleton.bind_matrices()[INDEX["LeftHand"], :3, 3]
    assert abs(high[0] - hand[0]) < 0.03 and low[0] == -high[0]
    knee = HIP_HEIGHT - 0.421546
    assert 0.03 < knee - low[1] < 0.07  # longer, and a raised heel lifts the hem, or comes through


def test_pleats_grow_to_the_hem_and_flutes_to_the_cuffs(robe):
    at = robe.vertices - [0, HIP_HEIGHT, 0]

    def waves(points, centre, axes):
        radius = np.linalg.norm((points - centre)[:, axes], axis=1)
        angle = np.arctan2(*(points - centre)[:, axes].T)
        # Curvature of the outline changes sign twice a wave: count maxima of the radius.
        sorted_radius = radius[np.argsort(angle)]
        smooth = sum(np.roll(sorted_radius, k) for k in (-1, 0, 1)) / 3
        return int(((smooth > np.roll(smooth, 1)) & (smooth >= np.roll(smooth, -1))).sum())

    hem = at[np.isclose(at[:, 1], garment_robe.HEM)]
    assert waves(hem, np.zeros(3), [0, 2]) == garment_robe.PLEATS
    cuff = at[np.isclose(at[:, 0], garment_robe.CUFF)]
    assert 4 <= waves(cuff, cuff.mean(0), [2, 1]) <= garment_robe.FLUTES


def test_yoke_is_pinned_to_the_chest_and_belt_and_skirt_to_the_hips(robe):
    assert np.array_equal(robe.pin_joints >= 0, robe.pinned)
    assert set(robe.pin_joints[robe.pinned]) == {INDEX[n] for n in ("Chest", "Hips", "LeftForeArm", "RightForeArm")}
    at = robe.vertices - [0, HIP_HEIGHT, 0]
    cuff = at[robe.pin_joints == INDEX["LeftForeArm"]]     # all round: an elbow came through half a cuff
    assert cuff[:, 0].min() > 0.65 and cuff[:, 1].min() < 0.30 and np.ptp(cuff[:, 2]) > 0.18
    yoke, belt = (at[robe.pin_joints == INDEX[name]] for name in ("Chest", "Hips"))
    assert 200 < len(yoke) < 400 and yoke[:, 1].min() > 0.40 and np.abs(yoke[:, 0]).max() < 0.15
    rings = len(belt) / (4 * garment_robe.CHEST_COLUMNS + 2 * garment_robe.SIDE_CELLS)
    assert rings in (3, 4) and belt[:, 1].min() > 0.08 and belt[:, 1].max() < 0.16
    skirt = garment.skirt()
    assert set(skirt.pin_joints[skirt.pinned]) == {INDEX["Hips"]}
    assert set(skirt.pin_joints[~skirt.pinned]) == {-1}


def test_each_garment_names_its_collider(robe):
    skirt = garment.skirt()
    with_arms, without = (mannequin.mannequin(g.not_colliding) for g in (robe, skirt))
    assert with_arms.collider.all() and np.array_equal(with_arms.vertices, without.vertices)
    assert np.array_equal(without.collider, mannequin.mannequin().collider)
    arms = with_arms.weights[:, [INDEX["LeftForeArm"], INDEX["RightHand"]]].sum(1) > 0.6
    assert arms.any() and not without.collider[arms].any()
    keep, faces = mannequin.collider_mesh(without)
    plain = cloth_job.collider(without, skirt)              # skin alone, as it always was
    assert np.array_equal(plain[0], without.vertices[keep]) and np.array_equal(plain[1], faces)
    assert np.array_equal(plain[3], cloth_job.body_parts(without.weights[keep], faces)) and plain[3].max() == 7


def test_sleeves_touch_arms_and_the_body_tube_touches_trunk_and_legs(robe):
    trunk, legs, arm, fore = 1, 2 | 4, 8, 32
    at, touches = robe.vertices - [0, HIP_HEIGHT, 0], robe.touches
    swapped = touches & 1
    for left in (2, 8, 32):                                 # a left part's right one is the next bit
        swapped |= (touches & left) << 1 | (touches & 2 * left) >> 1
    at_rest_on_legs = touches & legs == legs
    assert np.array_equal(np.where(at_rest_on_legs, touches, swapped)[robe.mirror], touches)
    sleeve, tube = (at[:, 0] > 0.30) & (at[:, 1] > 0.20), at[:, 1] < 0.30
    assert set(touches[sleeve]) == {arm, fore} and set(touches[robe.mirror][sleeve]) == {2 * arm, 2 * fore}
    elbow = skeleton.bind_matrices()[INDEX["LeftForeArm"], 0, 3]
    upper, lower = (at[touches == mask, 0] for mask in (arm, fore))
    assert upper.max() < lower.min() + 0.01 and abs(upper.max() - elbow) < 0.03
    assert (touches[tube & (np.abs(at[:, 0]) < 0.26)] == trunk | legs).all()
    both = touches == trunk | arm
    assert 300 < both.sum() < 500 and at[both, 0].min() > 0.10 and at[both, 0].max() < 0.30
    assert touches.min() > 0                                # no vertex is left without a body


def test_the_character_and_the_bundle_say_what_cloth_touches(robe, tmp_path, monkeypatch):
    for worn in (robe, garment.skirt()):
        hung = cloth_job.Result(np.stack([worn.vertices] * 2), None, 0.0)
        monkeypatch.setattr(cloth_job, "simulate", lambda *given: hung)
        body, path = mannequin.mannequin(worn.not_colliding), str(tmp_path / f"{len(worn.vertices)}.safetensors")
        run.make_character(path, body, worn)
        character = rig.read_character(path)
        if worn.touches is None:
            assert character.touches is None and character.body_parts is None
    parts = cloth_job.skin_parts(mannequin.mannequin(robe.not_colliding))
    assert len(np.unique(robe.touches)) == 8                # as many as a model holds
    character = rig.read_character(str(tmp_path / f"{len(robe.vertices)}.safetensors"))
    bundled, _ = safetensors_io.read(MODELS / "robe" / "robe.safetensors", ("template.touches", "body.parts"))
    for touches, of_body in ((character.touches, character.body_parts), bundled.values()):
        assert np.array_equal(touches, robe.touches) and np.array_equal(of_body, parts)
    weights, skin = mannequin.mannequin().weights, cloth_job.skin_parts(mannequin.mannequin())
    arms = weights[:, INDEX["LeftForeArm"]] > 0.9           # which nothing collides with under a skirt
    assert arms.any() and not skin[arms].any() and parts[arms].all()


def test_closed_arms_are_closed_surfaces_on_the_skin():
    halves = closed_arms.closed_arms()
    assert [joint for joint, *_ in halves] == ["LeftArm", "RightArm", "LeftForeArm", "RightForeArm"]
    bind = skeleton.bind_matrices()[:, :3, 3]
    for joint, vertices, faces, weights in halves:
        edges = np.sort(directed_sides(faces), axis=1)
        assert len(np.unique(directed_sides(faces), axis=0)) == len(edges)
        pairs, uses = np.unique(edges, axis=0, return_counts=True)
        assert (uses == 2).all() and len(vertices) - len(pairs) + len(faces) == 2      # a sphere
        a, b, c = (vertices[faces[:, k]] - vertices.mean(0) for k in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0      # outward
        assert np.allclose(weights.sum(1), 1) and weights[:, INDEX[joint]].max() == 1
        assert set(np.flatnonzero(weights.any(0))) <= {INDEX[joint], INDEX[joint.replace("ForeArm", "Hand")]}
        # About its joint it is a ball that turns with it alone.
        ball = vertices[np.sign(bind[INDEX[joint], 0]) * (vertices[:, 0] - bind[INDEX[joint], 0]) < -1e-9]
        assert len(ball) > 80 and np.ptp(np.linalg.norm(ball - bind[INDEX[joint]], axis=1)) < 0.015
    for left, right in (halves[:2], halves[2:]):
        assert np.array_equal(right[1], left[1] * [-1, 1, 1])
        assert np.array_equal(right[3][:, skeleton.MIRROR], left[3])
    # Away from shoulder and elbow it lies on the skin; where three limbs meet the skin's blend swells by ln 3 of its scale.
    vertices = np.concatenate([half[1] for half in halves]) - [0, HIP_HEIGHT, 0]
    x = np.abs(vertices[:, 0])
    off = mannequin.surface_distance(vertices)
    assert off.max() < 0.001
    off = off[((x > 0.26) & (x < 0.40)) | (x > 0.52)]
    assert off.min() > -np.log(3) * mannequin.LIMB_SHARPNESS and abs(np.median(off)) < 0.001


def turns_about(ring, matrix):
    """How often a closed ring of points goes round the bone (along x) of a joint's world matrix."""
    local = (ring - matrix[:3, 3]) @ matrix[:3, :3]
    angle = np.arctan2(local[:, 2], local[:, 1])
    step = np.diff(angle, append=angle[0])
    return abs(round(((step + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi)))


def test_an_arm_stays_in_its_sleeve_when_the_elbow_bends(robe):
    # As far as any of our clips does, 130 degrees, both arms drawn in front of the chest within a third of a second.
    frames = 24
    motion = skeleton.rest_motion(frames)
    local, bent = motion.local.copy(), np.radians(np.clip((np.arange(frames) - 4) / 10, 0, 1))
    for side, sign in (("Left", -1), ("Right", 1)):
        local[:, INDEX[side + "Arm"]] = (rotations.about_axis("Y", sign * 70 * bent)
                                         @ rotations.about_axis("Z", sign * 30 * bent))
        local[:, INDEX[side + "ForeArm"]] = rotations.about_axis("Y", sign * 130 * bent)
    worn = cloth_job.simulate(skeleton.Motion(motion.root, local), mannequin.mannequin(robe.not_colliding), robe,
                              np.arange(frames))
    upper, strip, _, _ = garment_robe._number()
    middle = len(upper) // 2
    for side, sign in (("Left", 1), ("Right", -1)):
        for beyond in (8, 12, 16, 20, 24, 28):
            joint = side + ("Arm" if beyond <= garment_robe.ELBOW_COLUMN else "ForeArm")
            column = middle + sign * (garment_robe.CHEST_COLUMNS + beyond)
            ring = np.concatenate([upper[column], strip[column, 1:-1][::-1]])
            for cloth, matrices in zip(worn.cloth, worn.matrices):
                assert turns_about(cloth[ring].astype(float), matrices[INDEX[joint]]) == 1, (joint, beyond)


def test_radius_scale_widens_every_free_part_a_little(robe):
    other = garment_robe.robe(1.0005)
    shift = np.linalg.norm(other.vertices - robe.vertices, axis=1)
    # 0.05 % of a radius of 0.05 to 0.29 m.
    assert 1e-5 < np.percentile(shift, 1) and 1e-4 < shift.max() < 2e-4
    assert np.array_equal(other.faces, robe.faces)
    assert np.array_equal(other.vertices[other.mirror], other.vertices * [-1, 1, 1])
