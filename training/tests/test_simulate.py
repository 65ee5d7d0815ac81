"""Simulation: garment, files and checks, without a solver."""
import dataclasses
import functools
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dcloth_training import figure, metrics, safetensors_io, sequence
from dcloth_training.motion import skeleton
from dcloth_training.simulate import body as parts, checks, clips, cloth_job, garment, pattern, settings, statics


TRAINING = os.path.join(os.path.dirname(__file__), "..")
MODELS = os.path.join(TRAINING, "..", "models")


@pytest.fixture(scope="module")
def body():
    return figure.load()


@pytest.fixture(scope="module")
def skirt(body):
    return garment.skirt(body)


@pytest.fixture(scope="module", params=sorted(garment.GARMENTS))
def worn(request, body):
    return garment.GARMENTS[request.param](body)


def test_the_texture_is_the_pattern(worn):
    """No stretch, no panel mirrored, none over another, and few seams."""
    corners = worn.texture.astype(np.float64)
    assert corners.shape == (*worn.faces.shape, 2) and corners.min() == 0 and corners.max() == 1

    def edges(flat):
        return np.stack([flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]], 1)
    right_side_up = edges(corners * [1, -1])
    assert (np.linalg.det(right_side_up) > 0).all()
    lengths = [np.linalg.norm(edges(flat), axis=-1) for flat in (corners, worn.cloth.pattern)]
    assert np.allclose(lengths[0] / lengths[1], np.median(lengths[0] / lengths[1]), rtol=1e-4)
    square = 1 / np.median(lengths[1] / lengths[0]) ** 2
    area = 0.5 * np.abs(np.linalg.det(edges(worn.cloth.pattern))).sum() * square
    filled = np.zeros((500, 500), bool)
    inside = np.random.default_rng(0).dirichlet((1, 1, 1), 60)
    at = np.floor(np.einsum("ck,fkd->cfd", inside, corners).reshape(-1, 2) * 500).astype(int).clip(max=499)
    filled[at[:, 1], at[:, 0]] = True
    assert abs(filled.mean() - area) < 0.02, "overlapping panels fill less than their area"
    drawn = np.unique(np.concatenate([worn.faces.reshape(-1, 1), worn.texture.reshape(-1, 2)], 1), axis=0)
    assert len(worn.vertices) < len(drawn) < 1.04 * len(worn.vertices)


def test_garments_are_exactly_mirror_symmetric(worn):
    count = len(worn.vertices)
    assert {"skirt": 7500 < count < 8500, "robe": 9200 < count < 10200}[worn.name]
    assert np.array_equal(worn.mirror[worn.mirror], np.arange(count))
    assert np.allclose(worn.vertices[worn.mirror], worn.vertices * [-1, 1, 1], atol=1e-12)
    assert np.array_equal(worn.pinned[worn.mirror], worn.pinned)
    left, right = ((worn.touches & bit) > 0 for bit in (parts.LEFT_ARM, parts.RIGHT_ARM))
    assert np.array_equal(left[worn.mirror], right)
    triangles = {tuple(sorted(f)) for f in worn.faces.tolist()}
    assert {tuple(sorted(worn.mirror[list(f)])) for f in triangles} == triangles


def test_garments_are_sewn_without_holes_and_face_outward(worn):
    pairs = np.concatenate([worn.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    edges, number, uses = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True, return_counts=True)
    assert set(uses) == {1, 2} and number.max() == len(edges) - 1
    assert len(np.unique(pairs, axis=0)) == len(pairs)      # neighbours agree on their right side
    border = edges[uses == 1]
    graph = coo_matrix((np.ones(len(border)), border.T), (len(worn.vertices),) * 2)
    loops = connected_components(graph, directed=False)[1]
    # Skirt: waist and hem. Robe: neck, two sleeves, the hem with its slit.
    assert len(np.unique(loops[border[:, 0]])) == {"skirt": 2, "robe": 4}[worn.name]
    low = worn.vertices[:, 1] < worn.vertices[:, 1].min() + 0.3
    a, b, c = (worn.vertices[worn.faces[low[worn.faces].all(1)][:, i]] for i in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) * [1, 0, 1]) > 0).mean() > 0.99


# Panels and start of both garments, and of a coarser cut that is not kept.
CUT = """
import hashlib
import numpy as np
from dcloth_training import figure
from dcloth_training.simulate import garment
for name, changes in (("skirt", {}), ("robe", {}), ("skirt", {"spacing": 0.03})):
    worn = garment.GARMENTS[name](figure.load(), **changes)
    given = [worn.vertices, worn.cloth.pattern, worn.cloth.mass_scale, worn.cloth.bend_scale, worn.cloth.crease]
    arrays = [np.float32(array) for array in given] + [worn.faces, worn.mirror, worn.pinned, worn.touches]
    print(name, *(hashlib.sha256(np.ascontiguousarray(array)).hexdigest()[:12] for array in arrays))
"""


def test_every_processor_cuts_the_same_cloth():
    """The matrix library has kernels of its own for each processor, and so have numpy's sines: last bits differ."""
    old = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES":
           "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"}

    def cut(processor):
        environment = {**os.environ, **processor, "PYTHONPATH": TRAINING}
        return subprocess.run([sys.executable, "-W", "ignore", "-c", CUT], env=environment, text=True, check=True,
                              stdout=subprocess.PIPE).stdout.splitlines()
    cuts = [cut(processor) for processor in ({"OPENBLAS_CORETYPE": "Haswell"}, {"OPENBLAS_CORETYPE": "Prescott"}, old)]
    assert len(cuts[0]) == 3
    assert cuts[0] == cuts[1] == cuts[2]


def test_the_bundled_garments_are_cut_as_they_were(worn):
    bundled = safetensors_io.read(os.path.join(MODELS, worn.name, f"{worn.name}.safetensors"))[0]
    assert np.array_equal(worn.faces, bundled["template.faces"])


def test_panels_that_are_kept_are_cut_no_more(body, tmp_path, monkeypatch):
    made, path = {}, str(tmp_path / "panels.safetensors")
    first = garment.skirt(body, made, spacing=0.03)
    pattern.keep(made, path)
    monkeypatch.setattr(pattern, "KEPT", path)
    monkeypatch.setattr(pattern, "_kept", functools.lru_cache(pattern._kept.__wrapped__))

    def refused(*_):
        raise AssertionError("cut anew")
    monkeypatch.setattr(pattern, "triangulate", refused)
    second = garment.skirt(body, spacing=0.03)
    assert np.array_equal(first.faces, second.faces)
    assert np.abs(first.cloth.pattern - second.cloth.pattern).max() < pattern.KEPT_WITHIN
    with pytest.raises(AssertionError, match="cut anew"):     # another outline is another panel
        garment.skirt(body, spacing=0.03, length=0.59)


def test_a_mesh_has_no_direction(worn):
    """Edges lie in every direction of the pattern alike: a lattice would print through the cloth."""
    side = worn.cloth.pattern - np.roll(worn.cloth.pattern, -1, 1)
    angle = np.degrees(np.arctan2(side[..., 1], side[..., 0])).ravel() % 180
    share = np.histogram(angle, 12, (0, 180))[0] / angle.size
    assert share.min() > 0.85 / 12 and share.max() < 1.2 / 12
    length = np.linalg.norm(side, axis=-1).ravel()
    assert np.percentile(length, 99) < 1.7 * length.mean() and length.min() > 0.25 * length.mean()


def test_a_garment_cut_larger_is_a_little_larger(skirt):
    larger = garment.perturbed(skirt, 1.0005)
    assert np.allclose(larger.cloth.pattern, 1.0005 * skirt.cloth.pattern) and larger.vertices is skirt.vertices


def test_what_collides_is_the_skin_that_the_garment_touches(body, skirt):
    vertices, faces, _, masks = cloth_job.collider(body, skirt)
    assert vertices is body.vertices and faces is body.faces
    there = masks > 0
    assert not there[np.abs(body.vertices[:, 0]) > 0.35].any()     # no arms
    assert there[(body.vertices[:, 1] < 1.2) & (np.abs(body.vertices[:, 0]) < 0.3)].all()
    thigh = np.argmax(body.weights, 1) == skeleton.INDEX["LeftUpLeg"]
    assert (masks[thigh] & parts.LEFT_LEG).all()
    assert not (masks[thigh & (body.vertices[:, 1] < 0.6)] & ~np.uint32(parts.LEFT_LEG)).any()


def test_parts_overlap_and_leave_the_other_limbs_out(body):
    faces, part = parts.cut_parts(body)
    owner = np.argmax(body.weights, 1)
    for number, names in enumerate(parts.PARTS):
        own = set(np.unique(faces[part == number]))
        core = set(np.flatnonzero(np.isin(owner, [skeleton.INDEX[name] for name in names])))
        assert core <= own and len(own) > len(core)
    right = np.isin(owner, [skeleton.INDEX[name] for k in (3, 4) for name in parts.PARTS[k]])
    assert not right[np.unique(faces[part == 1])].any()


def test_pins_follow_the_skin_beside_them(body, skirt):
    weights = cloth_job.pin_weights(skirt, body)
    assert weights.shape == (skirt.pinned.sum(), len(body.names)) and np.allclose(weights.sum(1), 1)
    holding = {body.names[k] for k in np.flatnonzero(weights.max(0) > 0.05)}
    assert holding <= {"Hips", "Spine", "LeftUpLeg", "RightUpLeg"}


def test_rest_lengths_are_those_of_the_pattern(skirt):
    lengths, edges = cloth_job.rest_lengths(skirt), metrics.edges_of(skirt.faces)
    assert len(lengths) == len(edges)
    edge = np.flatnonzero((edges == np.sort(skirt.faces[1234, :2])).all(1))[0]
    assert lengths[edge] == pytest.approx(np.linalg.norm(np.subtract(*skirt.cloth.pattern[1234, :2])))


def test_settings_change_one_value_and_refuse_unknown():
    assert settings.of("wool", steps=20)["steps"] == 20 != settings.of("wool")["steps"]
    assert settings.of("cotton")["density"] != settings.of("wool")["density"]
    with pytest.raises(ValueError, match="unknown settings"):
        settings.of("wool", bogus=1)


def test_a_demo_clip_is_whole_and_starts_at_the_origin():
    motion = clips.load("procedural/demo_sway_spin")
    assert len(motion) > 140 and np.allclose(motion.root[0, [0, 2]], 0, atol=1e-9)
    with pytest.raises(ValueError, match="--motion"):
        clips.load("mocap/walk")


@pytest.mark.parametrize("felt", [skeleton.LOWER_BODY, skeleton.WHOLE_BODY])
def test_static_tour_rests_in_every_pose(felt):
    poses = statics.order(statics.select([clips.load("procedural/kicks")], 6, felt), felt)
    tour, rests = statics.tour(poses)
    assert len(poses) == len(rests) == 6
    assert np.allclose(tour.local[rests], poses.local)
    assert np.allclose(tour.root[:, [0, 2]], 0)


@pytest.fixture(scope="module")
def hanging(body):
    """A skirt as it is cut, wide enough to stand clear of the body, its rest lengths those of that shape."""
    skirt = garment.skirt(body, sector=2.9, spacing=0.0116)
    corner = skirt.vertices[skirt.faces]
    base, side = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    flat = np.zeros((len(corner), 3, 2))       # each triangle laid flat
    flat[:, 1, 0] = np.linalg.norm(base, axis=1)
    flat[:, 2, 0] = np.einsum("ij,ij->i", side, base) / flat[:, 1, 0]
    flat[:, 2, 1] = np.sqrt((side ** 2).sum(1) - flat[:, 2, 0] ** 2)
    return dataclasses.replace(skirt, cloth=dataclasses.replace(skirt.cloth, pattern=flat))


def still(worn, count):
    return cloth_job.Result(np.repeat(worn.vertices[None], count, 0).astype(np.float32),
                            skeleton.joint_matrices(skeleton.rest_motion(count)), 1.0)


def test_checks_refuse_stretched_sunken_and_broken_cloth(body, hanging):
    good = still(hanging, 4)
    assert checks.refuse(checks.measure(good, body, hanging)) is None
    for name, factor in {"stretch_p99": 2.0, "through_share": 0.7}.items():
        bad = dataclasses.replace(good, cloth=(good.cloth * [factor, 1, factor]).astype(np.float32))
        assert name in checks.refuse(checks.measure(bad, body, hanging))
    torn = good.cloth.copy()
    torn[2, 4000] += [0, 0, 0.5]
    assert "torn_share" in checks.refuse(checks.measure(dataclasses.replace(good, cloth=torn), body, hanging, every=1))
    numbers = checks.measure(good, body, hanging)
    numbers["speed_max"] = float("nan")
    assert "speed_max" in checks.refuse(numbers)


def test_numbers_say_what_is_not_cloth(body, hanging):
    """One frame of four with a dent in the front that goes into a thigh, another with the front pulled out at the
    back."""
    good = still(hanging, 4)
    cloth, at = good.cloth.astype(np.float64), hanging.vertices
    front = at[:, 2] > 0.15
    dent = front & (at[:, 1] < 0.7) & (at[:, 1] > 0.6) & (np.abs(at[:, 0]) < 0.15)
    cloth[1, dent, 2] -= 0.25
    cloth[3, front, 2] -= 0.7
    numbers = checks.measure(dataclasses.replace(good, cloth=cloth.astype(np.float32)), body, hanging, every=1)
    assert numbers["frames_measured"] == 4 and numbers["crossed_share"] == 0.5 == numbers["through_share"]
    assert numbers["tangled_share"] >= 0.25 and numbers["cloth_crossings_frame"] == 3
    assert numbers["cloth_crossings_max"] > 100 and numbers["body_crossings_max"] > 20
    assert 10 < numbers["penetration_max_mm"] < 100 and 0 < numbers["penetration_area_share"] < 0.2
    clean = checks.measure(good, body, hanging)
    for key in ("crossed_share", "tangled_share", "torn_share", "through_share", "penetration_max_mm",
                "cloth_crossings", "body_crossings", "penetration_area_share"):
        assert clean[key] == 0, key
    assert clean["strain_p99"] == pytest.approx(0, abs=1e-3)


def test_one_bad_drape_does_not_take_the_others_with_it(body, hanging):
    result = still(hanging, 3)
    cloth, matrices = result.cloth.copy(), result.matrices.copy()
    cloth[1] *= [2.0, 1, 2.0]
    matrices[2, :, 0, 3] = 0.001    # tells the last pose apart
    kept, good = checks.drapes(cloth_job.Result(cloth, matrices, 1.0), body, hanging)
    assert good.tolist() == [True, False, True]
    assert np.array_equal(kept.cloth, cloth[[0, 2]]) and np.array_equal(kept.matrices, matrices[[0, 2]])


def test_sequence_round_trip_and_refusal(tmp_path):
    path = str(tmp_path / "a.safetensors")
    matrices = skeleton.joint_matrices(skeleton.rest_motion(3))
    truth = np.random.default_rng(0).normal(size=(3, 5, 3)).astype(np.float32)
    sequence.write(path, sequence.Sequence(matrices, truth, skeleton.NAMES, 30.0, "a/b", "dynamic"))
    back = sequence.read(path)
    assert np.array_equal(back.truth, truth) and back.joint_names == list(skeleton.NAMES)
    assert back.fps == 30.0 and back.kind == "dynamic" and back.clip == "a/b"
    for broken in (truth[:2], np.full_like(truth, np.nan)):
        sequence.write(path, sequence.Sequence(matrices, broken, skeleton.NAMES, 30.0, "a/b", "dynamic"))
        with pytest.raises(safetensors_io.SafetensorsError, match="a.safetensors"):
            sequence.read(path)


def pack(header, data=b"", length=None):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + data


def tensor(begin=0, end=4, dtype="F32", shape=(1,)):
    return {"dtype": dtype, "shape": list(shape), "data_offsets": [begin, end]}


def test_safetensors_round_trip(tmp_path):
    path = str(tmp_path / "a.safetensors")
    generator = np.random.default_rng(0)
    tensors = {f"t{i}": (generator.random((2, i)) * 100).astype(d) for i, d in enumerate(
        ("f4", "f2", "f8", "i4", "i8", "u8", "u4", "u1", "i1", "i2", "u2", "?"))}
    tensors["scalar"] = np.float32(3)
    safetensors_io.write(path, tensors, {"a": "b"})
    back, metadata = safetensors_io.read(path)
    assert metadata == {"a": "b"} and set(back) == set(tensors)
    for name, value in tensors.items():
        assert back[name].dtype == np.asarray(value).dtype and np.array_equal(back[name], value)
    assert set(safetensors_io.read(path, ["t1"])[0]) == {"t1"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.safetensors"]
    back["t1"][:] = 0    # what was read is the reader's own
    assert np.array_equal(safetensors_io.read(path)[0]["t1"], tensors["t1"])
    with pytest.raises(safetensors_io.SafetensorsError):
        safetensors_io.write(path, {"c": np.zeros(2, complex)})
    assert len(safetensors_io.read(path)[0]) == len(tensors)  # the old file survives
    longest = str(tmp_path / ("n" * 255))
    safetensors_io.write(longest, tensors)
    assert len(safetensors_io.read(longest)[0]) == len(tensors)
    assert {p.name for p in tmp_path.iterdir()} == {"a.safetensors", "n" * 255}


def test_safetensors_writes_the_same_bytes_again(tmp_path):
    metadata = {f"key{i}": str(i) for i in range(12)}
    for name in ("a", "b"):
        safetensors_io.write(str(tmp_path / name), {"x": np.arange(4.0), "n": np.arange(3)}, metadata)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert safetensors_io.read(str(tmp_path / "a"))[1] == metadata


MALFORMED = {
    "empty": b"",
    "short": b"\1\2\3",
    "length beyond the file": pack({}, length=1 << 20),
    "length wraps": pack({}, length=(1 << 64) - 1),
    "not JSON": pack(b"{nope"),
    "not UTF-8": pack(b"\xff\xfe\xfd"),
    "a list": pack(b"[]"),
    "deep": pack(b"[" * 100000),
    "metadata not text": pack({"__metadata__": {"a": 1}}),
    "entry without dtype": pack({"a": {"shape": [1], "data_offsets": [0, 4]}}, b"1234"),
    "dtype unknown": pack({"a": tensor(dtype="F13")}, b"1234"),
    "dtype a list": pack({"a": tensor(dtype=["F32"])}, b"1234"),
    "shape negative": pack({"a": tensor(shape=(-1,))}, b"1234"),
    "shape bool": pack({"a": tensor(shape=(True,))}, b"1234"),
    "shape wraps": pack({"a": tensor(shape=(1 << 33, 1 << 33))}, b"1234"),
    "size wrong": pack({"a": tensor(shape=(2,))}, b"1234"),
    "offsets reversed": pack({"a": tensor(4, 0)}, b"1234"),
    "offsets float": pack({"a": tensor(0.0, 4.0)}, b"1234"),
    "truncated": pack({"a": tensor()}, b"123"),
    "trailing bytes": pack({"a": tensor()}, b"12345"),
    "overlap": pack({"a": tensor(), "b": tensor(2, 6)}, b"123456"),
    "same bytes twice": pack({"a": tensor(), "b": tensor()}, b"1234"),
    "hole": pack({"a": tensor(), "b": tensor(8, 12)}, b"123456789012"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_safetensors_refuses(tmp_path, name):
    path = tmp_path / "bad.safetensors"
    path.write_bytes(MALFORMED[name])
    with pytest.raises(safetensors_io.SafetensorsError, match="bad.safetensors"):
        safetensors_io.read(str(path))


def test_safetensors_refuses_every_truncation(tmp_path):
    path = tmp_path / "bad.safetensors"
    safetensors_io.write(str(path), {"a": np.arange(4, dtype=np.float32), "b": np.zeros(3, np.uint8)})
    whole = path.read_bytes()
    assert len(whole) > 50
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        with pytest.raises(safetensors_io.SafetensorsError):
            safetensors_io.read(str(path))
