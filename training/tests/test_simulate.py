"""Simulation: garment, files and checks, without a solver."""
import json
import struct

import numpy as np
import pytest

from dcloth_training import figure, safetensors_io, sequence
from dcloth_training.motion import skeleton
from dcloth_training.simulate import (checks, clips, cloth_job, garment, settings,
                                      statics)


@pytest.fixture(scope="module")
def body():
    return figure.load()


def test_skirt_is_exactly_mirror_symmetric():
    skirt = garment.skirt()
    assert len(skirt.vertices) == garment.RINGS * garment.COLUMNS == 7952
    assert np.array_equal(skirt.mirror[skirt.mirror], np.arange(7952))
    assert np.array_equal(skirt.vertices[skirt.mirror], skirt.vertices * [-1, 1, 1])
    assert np.array_equal(skirt.pinned[skirt.mirror], skirt.pinned)
    assert (skirt.mirror == np.arange(7952)).sum() == 2 * garment.RINGS
    triangles = {tuple(sorted(f)) for f in skirt.faces}
    assert {tuple(sorted(skirt.mirror[list(f)])) for f in triangles} == triangles


def test_skirt_is_a_clean_tube_facing_outward():
    skirt = garment.skirt()
    pairs = np.sort(np.concatenate([skirt.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    _, uses = np.unique(pairs, axis=0, return_counts=True)
    assert set(uses) == {1, 2} and (uses == 1).sum() == 2 * garment.COLUMNS  # waist and hem
    a, b, c = (skirt.vertices[skirt.faces[:, i]] for i in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) * [1, 0, 1])
    assert (outward > 0).all()


def test_radius_scale_moves_every_vertex_a_little():
    shift = np.abs(garment.skirt(1.0005).vertices - garment.skirt().vertices).max()
    assert 1e-4 < shift < 4e-4


def test_what_collides_is_the_skin_without_arms_and_head(body):
    skirt = garment.skirt()
    keep, faces = cloth_job.collider_mesh(body, skirt)
    assert 3000 < len(keep) < len(body.vertices) and faces.max() == len(keep) - 1
    there = cloth_job.collided(body, skirt)
    assert not there[body.vertices[:, 1] > 1.5].any() and not there[np.abs(body.vertices[:, 0]) > 0.3].any()
    assert there[(body.vertices[:, 1] < 1.2) & (np.abs(body.vertices[:, 0]) < 0.3)].all()
    masks = cloth_job.skin_parts(body, skirt)
    assert ((masks > 0) == there).all()
    thigh = np.argmax(body.weights, 1) == skeleton.INDEX["LeftUpLeg"]
    assert (masks[thigh] & 2).all() and not (masks[thigh & (body.vertices[:, 1] < 0.6)] & ~np.uint32(2)).any()


def test_pins_follow_the_hips():
    skirt, rest = garment.skirt(), skeleton.rest_motion(2)
    rest.root[1] += [0.5, 0.0, 1.0]
    pins = cloth_job.pin_paths(skirt, skeleton.joint_matrices(rest))
    assert np.allclose(pins[0], skirt.vertices[skirt.pinned]) and np.allclose(pins[1] - pins[0], [0.5, 0.0, 1.0])


def test_settings_change_one_value_and_refuse_unknown():
    assert settings.with_changes(steps=20)["steps"] == 20 != settings.GROUND_TRUTH["steps"]
    with pytest.raises(ValueError, match="unknown settings"):
        settings.with_changes(bogus=1)


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


def test_checks_refuse_stretched_sunken_and_broken_cloth(body):
    skirt, rest = garment.skirt(), skeleton.joint_matrices(skeleton.rest_motion(4))
    good = cloth_job.Result(np.repeat(skirt.vertices[None], 4, 0).astype(np.float32), rest, 1.0)
    assert checks.refuse(checks.measure(good, body, skirt)) is None
    for name, factor in {"stretch_p99": 2.0, "through_share": 0.8}.items():
        bad = cloth_job.Result((good.cloth * [factor, 1, factor]).astype(np.float32), rest, 1.0)
        assert name in checks.refuse(checks.measure(bad, body, skirt))
    torn = good.cloth.copy()
    torn[2, 4000] += [0, 0, 0.5]
    assert "torn_share" in checks.refuse(checks.measure(cloth_job.Result(torn, rest, 1.0), body, skirt, every=1))
    numbers = checks.measure(good, body, skirt)
    numbers["speed_max"] = float("nan")
    assert "speed_max" in checks.refuse(numbers)


def test_numbers_say_what_is_not_cloth(body):
    """One frame of four with a dent in the front that goes into a thigh, another with the front pulled out at the back."""
    skirt, rest = garment.skirt(), skeleton.joint_matrices(skeleton.rest_motion(4))
    cloth = np.repeat(skirt.vertices[None], 4, 0)
    front = skirt.vertices[:, 2] > 0.15
    dent = front & (skirt.vertices[:, 1] < 0.7) & (skirt.vertices[:, 1] > 0.6) & (np.abs(skirt.vertices[:, 0]) < 0.15)
    cloth[1, dent, 2] -= 0.2
    cloth[3, front, 2] -= 0.6
    numbers = checks.measure(cloth_job.Result(cloth.astype(np.float32), rest, 1.0), body, skirt, every=1)
    assert numbers["frames_measured"] == 4 and numbers["crossed_share"] == 0.5 == numbers["through_share"]
    assert numbers["tangled_share"] == 0.25 and numbers["cloth_crossings_frame"] == 3
    assert numbers["cloth_crossings_max"] > 100 and numbers["body_crossings_max"] > 20
    assert 10 < numbers["penetration_max_mm"] < 100 and 0 < numbers["penetration_area_share"] < 0.2
    clean = checks.measure(cloth_job.Result(np.repeat(skirt.vertices[None], 4, 0).astype(np.float32), rest, 1.0), body, skirt)
    for key in ("crossed_share", "tangled_share", "torn_share", "through_share", "penetration_max_mm", "cloth_crossings",
                "body_crossings", "penetration_area_share"):
        assert clean[key] == 0, key
    assert clean["strain_p99"] == pytest.approx(0, abs=1e-4) and clean["stretch_max"] == pytest.approx(1, abs=1e-3)


def test_one_bad_drape_does_not_take_the_others_with_it(body):
    skirt, rest = garment.skirt(), skeleton.joint_matrices(skeleton.rest_motion(3))
    cloth = np.repeat(skirt.vertices[None], 3, 0).astype(np.float32)
    cloth[1] *= [2.0, 1, 2.0]
    rest[2, :, 0, 3] = 0.001    # tells the last pose apart
    kept, good = checks.drapes(cloth_job.Result(cloth, rest, 1.0), body, skirt)
    assert good.tolist() == [True, False, True]
    assert np.array_equal(kept.cloth, cloth[[0, 2]]) and np.array_equal(kept.matrices, rest[[0, 2]])


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
    with pytest.raises(safetensors_io.SafetensorsError):
        safetensors_io.write(path, {"c": np.zeros(2, complex)})
    assert len(safetensors_io.read(path)[0]) == len(tensors)  # the old file survives
    longest = str(tmp_path / ("n" * 255))
    safetensors_io.write(longest, tensors)
    assert len(safetensors_io.read(longest)[0]) == len(tensors)
    assert {p.name for p in tmp_path.iterdir()} == {"a.safetensors", "n" * 255}


MALFORMED = {
    "empty": b"",
    "short": b"\1\2\3",
    "length beyond the file": pack({}, length=1 << 20),
    "length wraps": pack({}, length=(1 << 64) - 1),
    "not JSON": pack(b"{nope"),
    "not UTF-8": pack(b"\xff\xfe\xfd"),
    "a list": pack(b"[]"),
    "deep": pack(b"[" * 100000),
    "key twice": pack(b'{"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},'
                      b'"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}', b"1234"),
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
