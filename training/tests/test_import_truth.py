"""Cloth from elsewhere becomes the same dataset, whatever format brings it; what does not fit is refused."""
import json

import numpy as np
import pytest

import cache_files
import conftest
from dcloth_training import dataset, import_truth, rig, safetensors_io, sequence
from dcloth_training.truth.errors import TruthError

RINGS, COLUMNS = 6, 10
QUADS = [(r * COLUMNS + a, (r + 1) * COLUMNS + a, (r + 1) * COLUMNS + b, r * COLUMNS + b)
         for r in range(RINGS - 1) for a, b in zip(range(COLUMNS), [*range(1, COLUMNS), 0])]
# What becomes +X, +Y, +Z of ours: Blender's axes.
Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def clip_of(tiny):
    return sequence.read(tiny / "dynamic" / "a-one.safetensors")


def in_file(points, unit, up):
    return ((points.astype(np.float64) @ (Z_UP if up == "z" else np.eye(3))) / unit).astype(np.float32)


def write_cache(kind, folder, positions, polygons=QUADS, fps=30.0):
    """Writes a cache, returns what the project file says of it."""
    if kind == "obj":
        cache_files.write_obj_sequence(folder / "frames", positions, polygons)
        return {"cache": "frames/cloth_*.obj", "fps": fps}
    path = folder / f"cloth.{kind}"
    if kind == "pc2":
        cache_files.write_pc2(path, positions)
        return {"cache": path.name, "fps": fps}
    if kind == "mdd":
        cache_files.write_mdd(path, positions, fps)
    else:
        cache_files.write_alembic(path, positions, polygons, fps, first=1 / fps)
    return {"cache": path.name}


def project(folder, tiny, clip, garment=QUADS, **more):
    template = safetensors_io.read(tiny / "character.safetensors")[0]["cloth_template"]
    cache_files.write_obj(folder / "garment.obj", template, garment)
    path = folder / "project.json"
    path.write_text(json.dumps({
        "character": str(tiny / "character.safetensors"), "garment": "garment.obj",
        "clips": [{"name": "a/one", "animation": str(tiny / "dynamic" / "a-one.safetensors"), **clip}], **more}))
    return str(path)


@pytest.mark.parametrize("kind", ["pc2", "mdd", "obj", "abc"])
@pytest.mark.parametrize("unit, metres, up", [("m", 1.0, "y"), ("cm", 0.01, "z")])
def test_round_trip(kind, unit, metres, up, tiny, tmp_path):
    wanted = clip_of(tiny)
    said = write_cache(kind, tmp_path, in_file(wanted.truth, metres, up))
    import_truth.run(project(tmp_path, tiny, {**said, "unit": unit, "up": up}), str(tmp_path / "out"))
    found = sequence.read(tmp_path / "out" / "dynamic" / "a-one.safetensors")
    assert np.array_equal(found.joint_matrices, wanted.joint_matrices) and found.clip == "a/one" and found.fps == 30
    # In metres every format holds float32 as it is; a unit rounds once on the way there and once on the way back.
    bound = 0 if unit == "m" else 2 * np.abs(wanted.truth).max() * np.finfo(np.float32).eps
    assert np.abs(found.truth - wanted.truth).max() <= bound


def test_training_reads_what_is_written(tiny, tmp_path):
    said = write_cache("pc2", tmp_path, clip_of(tiny).truth)
    import_truth.run(project(tmp_path, tiny, said), str(tmp_path / "out"))
    character = rig.read_character(tmp_path / "out" / "character.safetensors")
    before = rig.read_character(tiny / "character.safetensors")
    assert np.array_equal(character.mirror, before.mirror) and character.joint_mirror == before.joint_mirror
    assert np.array_equal(character.template, before.template)
    fitted = rig.fit(character)
    clips = dataset.load(dataset.find(str(tmp_path / "out"), "dynamic"), fitted.rig, character)
    assert [c.mirrored for c in clips] == [False, True] and len(clips[0]) == 40
    drapes = dataset.load(dataset.find(str(tmp_path / "out"), "static"), fitted.rig, character)
    assert len(drapes[0]) == 4, "every tenth tick stands in for drapes"


def test_a_garment_without_mirror_image_is_seen_once(tiny, tmp_path, capsys):
    triangles = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
    said = write_cache("pc2", tmp_path, clip_of(tiny).truth)
    import_truth.run(project(tmp_path, tiny, said, garment=triangles), str(tmp_path / "out"))
    assert "no mirror image: the faces" in capsys.readouterr().out
    character = rig.read_character(tmp_path / "out" / "character.safetensors")
    clips = dataset.load(dataset.find(str(tmp_path / "out"), "dynamic"), rig.fit(character).rig, character)
    assert character.mirror is None and [c.mirrored for c in clips] == [False]


def test_a_cache_at_60_hz_gives_its_every_second_sample(tiny, tmp_path):
    truth = clip_of(tiny).truth
    double = np.repeat(truth, 2, 0)[:-1]
    double[1::2] += 0.01
    said = write_cache("mdd", tmp_path, double, fps=60)
    import_truth.run(project(tmp_path, tiny, said), str(tmp_path / "out"))
    assert np.array_equal(sequence.read(tmp_path / "out" / "dynamic" / "a-one.safetensors").truth, truth)


def test_a_cache_that_begins_later(tiny, tmp_path):
    wanted = clip_of(tiny)
    said = write_cache("abc", tmp_path, wanted.truth[6:30])
    import_truth.run(project(tmp_path, tiny, {**said, "offset_seconds": 0.2}), str(tmp_path / "out"))
    found = sequence.read(tmp_path / "out" / "dynamic" / "a-one.safetensors")
    assert np.array_equal(found.truth, wanted.truth[6:30])
    assert np.array_equal(found.joint_matrices, wanted.joint_matrices[6:30])


def shuffled(truth):
    return truth[:, np.random.default_rng(1).permutation(truth.shape[1])]


def blown_up(truth):
    out = truth.copy()
    out[17] += np.random.default_rng(1).normal(0, 3, out[17].shape).astype(np.float32)
    return out


@pytest.mark.parametrize("change, said, words", [
    (lambda t: t, {"fps": 24}, r"cache of 1.625 s \(40 samples\) on an animation of 1.300 s \(40 ticks"),
    (lambda t: t[::2], {"fps": 15}, "15 samples a second.*multiple"),
    (lambda t: t * np.float32(100), {}, "edges 100 times.*unit"),
    (lambda t: in_file(t, 1, "z"), {}, r'hang on.*set "up": "z"'),
    (shuffled, {}, "frame 0: found .*% of the edges.*another order"),
    (blown_up, {}, "frame 17: .*blew up"),
    (lambda t: t[:, :-1], {}, "59 vertices, allowed 60 as in .*garment.obj"),
    (lambda t: t + np.float32([40, 0, 0]), {}, "40 m from the body.*world space"),
    (lambda t: t, {"offset_seconds": 9}, "0 ticks that cache and animation have in common"),
    (lambda t: t, {"fps": None}, "no frame rate.*set \"fps\""),
    (lambda t: t, {"cache": "cloth.c4d"}, "no such file"),
    (lambda t: t, {"unit": "yards"}, "unit 'yards'"),
    (lambda t: t, {"speed": 2}, "'speed' in clip 0.*offset_seconds"),
    (lambda t: t, {"kind": "wet"}, "kind 'wet'"),
    (lambda t: t, {"name": "../../x"}, "clip name"),
])
def test_refused(change, said, words, tiny, tmp_path):
    cache = write_cache("pc2", tmp_path, change(clip_of(tiny).truth))
    with pytest.raises(TruthError, match=words):
        import_truth.run(project(tmp_path, tiny, {**cache, **said}), str(tmp_path / "out"))
    assert not list((tmp_path / "out").glob("dynamic/*"))


@pytest.mark.parametrize("kind", ["obj", "abc"])
def test_faces_in_another_order_of_vertices_are_refused(kind, tiny, tmp_path):
    order = np.random.default_rng(2).permutation(RINGS * COLUMNS)
    place = np.argsort(order)
    renumbered = [tuple(int(place[v]) for v in q) for q in QUADS]
    cache = write_cache(kind, tmp_path, clip_of(tiny).truth[:, order], renumbered)
    with pytest.raises(TruthError, match="50 faces, number 0.*vertex order"):
        import_truth.run(project(tmp_path, tiny, cache), str(tmp_path / "out"))


@pytest.mark.parametrize("more, words", [
    ({"hips": "Pelvis"}, "no joints Pelvis.*LeftUpLeg.*hips"), ({"garment_unit": "cm"}, "edges .* times as long.*unit"),
    ({"garment_up": "z"}, "from the body in bind pose|hang on"), ({"clips": []}, "no clips"),
    ({"colour": 1}, "'colour' in project"),
    ({"defaults": {"fps": "fast"}}, "fps 'fast'")])
def test_projects_refused(more, words, tiny, tmp_path):
    cache = write_cache("mdd", tmp_path, clip_of(tiny).truth)
    with pytest.raises(TruthError, match=words):
        import_truth.run(project(tmp_path, tiny, cache, **more), str(tmp_path / "out"))


def test_the_command_says_what_is_wrong(tmp_path, capsys):
    (tmp_path / "p.json").write_text("{")
    assert import_truth.main([str(tmp_path / "p.json"), "--out", str(tmp_path / "out")]) == 2
    assert "import_truth: error: " in capsys.readouterr().err


def test_other_names_of_joints(tiny, tmp_path):
    """A character whose hips are called otherwise is trained with what its file says."""
    tensors, metadata = safetensors_io.read(tiny / "character.safetensors")
    named = ["mixamorig:Hips", "LThigh", "RThigh", "LShin", "RShin"]
    safetensors_io.write(tmp_path / "c.safetensors", tensors, {"joint_names": json.dumps(named)})
    item = clip_of(tiny)
    sequence.write(tmp_path / "walk.safetensors",
                   sequence.Sequence(item.joint_matrices, None, named, 30.0, "walk", "dynamic"))
    said = write_cache("pc2", tmp_path, item.truth)
    import_truth.run(project(tmp_path, tiny, {**said, "animation": "walk.safetensors"}, character="c.safetensors",
                             hips=named[0], feature_joints=named), str(tmp_path / "out"))
    character = rig.read_character(tmp_path / "out" / "character.safetensors")
    assert character.hips == named[0] and rig.fit(character).rig.feature_joints == [0, 1, 2, 3, 4]
    assert named != conftest.NAMES and character.mirror is None
