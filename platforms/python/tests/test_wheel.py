"""The installed wheel: models, cloths, errors, states, space, wind, fit, conversion, the command."""
import os
import sys
import threading
from pathlib import Path

import dcloth
import numpy as np
import pytest
from conftest import REPOSITORY

ALLOWED_MM = 0.01


def largest_mm(a, b):
    return 1000 * float(np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1).max())


@pytest.fixture
def cloth(skirt, walk):
    made = dcloth.Cloth(dcloth.Model(skirt.model))
    made.bind_joints(walk.names)
    return made


def play(cloth, walk, frames=None, **options):
    poses = walk.poses[:frames]
    return np.array([cloth.update(pose, 1 / walk.fps, **options)[0] for pose in poses])


def test_the_package_is_the_wheel():
    assert Path(dcloth.__file__).is_relative_to(sys.prefix)
    assert (Path(dcloth.__file__).parent / "py.typed").exists()
    assert os.access(dcloth.command_path(), os.X_OK)
    assert dcloth.garments() == {}  # a release's has some (scripts/test_packages.sh)


def test_model_says_what_it_holds(skirt):
    model = dcloth.Model(skirt.model)
    assert (model.name, model.precision, model.vertex_count, model.tick_rate) == ("skirt", "int8", 8170, 30)
    assert model.stages is dcloth.Stages.MESH and model.reads_wind and model.body_vertex_count > 0
    assert len(model.joint_names) == len(model.joint_parents) == len(model.joint_binds) == skirt.report["joint_count"]
    assert model.joint_names[0] == "Hips" and model.joint_parents[0] == -1
    assert model.positions.shape == (8170, 3) and model.positions.dtype == np.float32
    assert model.triangles.shape == (16076, 3) and model.triangles.max() == 8169
    assert not model.positions.flags.writeable and not model.triangles.flags.writeable
    np.testing.assert_array_equal(model.joint_binds[:, 3], [[0, 0, 0, 1]] * len(model.joint_names))


def test_a_texture_repeats_vertices_at_seams(skirt):
    model = dcloth.Model(skirt.model)
    places, triangles, seam = model.texture_coordinates, model.textured_triangles, model.seam_vertices
    assert places.shape == (8170 + len(seam), 2) and 0 < len(seam) < 400
    assert (places >= 0).all() and (places <= 1).all()
    drawn = np.concatenate([np.arange(8170), seam])
    np.testing.assert_array_equal(drawn[triangles], model.triangles)
    assert triangles.max() == len(places) - 1


def test_views_outlive_the_model(skirt):
    positions = dcloth.Model(skirt.model).positions
    kept = positions.copy()
    other = dcloth.Model(Path(skirt.model).read_bytes())
    np.testing.assert_array_equal(positions, kept)
    np.testing.assert_array_equal(other.positions, kept)


def test_vertices_as_in_cpp(cloth, walk, native):
    found, expected = play(cloth, walk), native()
    distance = largest_mm(found, expected)
    print(f"{len(found)} frames, largest distance of a vertex {distance:.6f} mm")
    assert found.shape == expected.shape and distance < ALLOWED_MM


def test_outside_body_as_in_cpp_and_a_fault_would_be_seen(skirt, walk, native, cloth):
    expected, outside = native(), native("--outside-body")
    found = play(cloth, walk, outside_body=True)
    distance = largest_mm(found, outside)
    print(f"{len(found)} frames, largest distance of a vertex {distance:.6f} mm")
    assert distance < ALLOWED_MM
    assert largest_mm(found, expected) > 1


def test_normals_are_unit_and_outward(cloth, walk):
    positions, normals = cloth.update(walk.poses[0], 0)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    a, b, c = np.moveaxis(positions[cloth.model.triangles.astype(int)], 1, 0)
    faces = np.cross(b - a, c - a)
    assert (np.einsum("ij,ij->i", faces, normals[cloth.model.triangles[:, 0].astype(int)]) > 0).mean() > 0.95


def test_arrays_of_the_caller(skirt, walk, cloth):
    expected = cloth.update(walk.poses[0], 0)
    cloth.reset()
    interleaved = np.full((cloth.model.vertex_count, 8), 7, np.float32)
    positions, normals = cloth.update(walk.poses[0], 0, positions=interleaved[:, :3], normals=interleaved[:, 3:6])
    assert np.shares_memory(positions, interleaved)
    np.testing.assert_array_equal(interleaved[:, :3], expected[0])
    np.testing.assert_array_equal(interleaved[:, 3:6], expected[1])
    assert (interleaved[:, 6:] == 7).all()
    cloth.reset()
    swapped = np.ascontiguousarray(walk.poses[0].transpose(0, 2, 1))
    np.testing.assert_array_equal(cloth.update(swapped, 0, column_major=True)[0], expected[0])


@pytest.mark.parametrize("array, found", [
    (np.empty((8170, 3)), "float64 [8170, 3]"),
    (np.empty((8170, 4), np.float32), "float32 [8170, 4]"),
    (np.empty((8169, 3), np.float32), "8169 rows, allowed: 8170"),
    (np.empty((8170, 3), np.float32)[::-1], "reverse"),
    (np.empty((3, 8170), np.float32).T, "do not follow each other"),
    (np.broadcast_to(np.float32(0), (8170, 3)), "read-only"),
    ([[0, 0, 0]], "list"),
])
def test_wrong_arrays_are_refused(cloth, walk, array, found):
    with pytest.raises(dcloth.Error) as raised:
        cloth.update(walk.poses[0], 0, positions=array)
    assert raised.value.status == "ARGUMENT" and found in raised.value.text and "allowed" in raised.value.text


def test_errors_carry_the_engines_status_and_text(skirt, walk, cloth, tmp_path):
    with pytest.raises(dcloth.Error, match="^FORMAT: ") as raised:
        dcloth.Model(b"no model" * 100)
    assert raised.value.status == "FORMAT" and str(raised.value) == f"FORMAT: {raised.value.text}"
    whole = skirt.model.read_bytes()
    for size in (0, 1, 64, len(whole) // 2, len(whole) - 64):
        with pytest.raises(dcloth.Error):
            dcloth.Model(whole[:size])
    with pytest.raises(FileNotFoundError):
        dcloth.Model(tmp_path / "missing.dcloth")
    with pytest.raises(dcloth.Error) as raised:
        cloth.bind_joints(["Hips", "Spine"])
    assert raised.value.status == "JOINTS" and "LeftUpLeg" in raised.value.text
    with pytest.raises(dcloth.Error) as raised:
        cloth.update(walk.poses[0][:3], 0)
    assert raised.value.status == "POSE" and "3" in raised.value.text and str(len(walk.names)) in raised.value.text
    broken = walk.poses[0].copy()
    broken[2, 1, 3] = np.nan
    with pytest.raises(dcloth.Error, match="POSE: .*Spine"):
        cloth.update(broken, 0)
    with pytest.raises(dcloth.Error, match="ARGUMENT: "):
        cloth.update(walk.poses[0], -1)
    with pytest.raises(dcloth.Error, match=r"joint_matrices: found shape \[4, 4\], allowed: \[any, 4, 4\]"):
        cloth.update(walk.poses[0][0], 0)


def test_a_refused_update_changes_nothing(skirt, walk, cloth):
    expected = play(cloth, walk, 3)
    cloth.reset()
    play(cloth, walk, 2)
    with pytest.raises(dcloth.Error):
        cloth.update(walk.poses[2], float("nan"))
    np.testing.assert_array_equal(cloth.update(walk.poses[2], 1 / walk.fps)[0], expected[2])


def test_states(skirt, walk, cloth):
    play(cloth, walk, 5)
    state = cloth.save()
    expected = cloth.update(walk.poses[5], 1 / walk.fps)[0]
    other = dcloth.Cloth(dcloth.Model(skirt.model))
    other.bind_joints(walk.names)
    other.restore(state)
    np.testing.assert_array_equal(other.update(walk.poses[5], 1 / walk.fps)[0], expected)
    with pytest.raises(dcloth.Error):
        other.restore(state[:-1])


def test_space(walk, cloth):
    """Panda3D's axes: z is up, the character faces -y."""
    expected = play(cloth, walk, 4)
    turn = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64)  # y-up to z-up
    centimetres = np.diag([100, 100, 100, 1])
    cloth.reset()
    cloth.set_space("+x", "+z", "-y", 0.01)
    found = np.array([
        cloth.update(centimetres @ turn @ pose @ turn.T @ np.linalg.inv(centimetres), 1 / walk.fps)[0]
        for pose in walk.poses[:4]])
    assert largest_mm(found / 100 @ turn[:3, :3], expected) < ALLOWED_MM
    with pytest.raises(dcloth.Error, match="ARGUMENT: .*'up'"):
        cloth.set_space(up="up")
    with pytest.raises(dcloth.Error, match="ARGUMENT: "):
        cloth.set_space("+x", "+x", "+z")


def test_bind_pose(skirt, walk):
    """Joints whose own axes are turned draw the same cloth once their bind pose is known."""
    model = dcloth.Model(skirt.model)
    order = [walk.names.index(name) for name in model.joint_names]
    expected = play(dcloth.Cloth(model), type(walk)(poses=walk.poses[:, order], fps=walk.fps), 4)
    turn = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], np.float32)
    cloth = dcloth.Cloth(model)
    cloth.set_bind_pose(model.joint_binds @ turn)
    found = play(cloth, type(walk)(poses=walk.poses[:, order] @ turn, fps=walk.fps), 4)
    assert largest_mm(found, expected) < ALLOWED_MM


def test_wind(walk, cloth):
    calm = play(cloth, walk, 30)
    cloth.reset()
    cloth.set_wind([0, 0, -5])
    assert largest_mm(play(cloth, walk, 30), calm) > 5
    with pytest.raises(dcloth.Error, match="ARGUMENT: .*wind"):
        cloth.set_wind([0, 0, 101])
    with pytest.raises(dcloth.Error, match="wind: found shape"):
        cloth.set_wind([0, 0])


def test_fit_to_the_figure_of_training(skirt, walk):
    """The training figure under another rig's names: the garment keeps its size."""
    model = dcloth.Model(skirt.model)
    names = [f"mixamorig:{name}" for name in model.joint_names]
    cloth = dcloth.Cloth(model)
    fit = cloth.fit(names, model.joint_binds)
    assert fit.scale == pytest.approx(1, abs=1e-3) and not fit.warnings & dcloth.FitWarning.PROPORTIONS
    assert fit.joints["left upper leg"] == model.joint_names.index("LeftUpLeg")
    order = [walk.names.index(name) for name in model.joint_names]
    poses = type(walk)(poses=walk.poses[:, order], fps=walk.fps)
    assert largest_mm(play(cloth, poses, 4), play(dcloth.Cloth(model), poses, 4)) < 1
    with pytest.raises(dcloth.Error):
        cloth.set_space()
    with pytest.raises(dcloth.Error) as raised:
        dcloth.Cloth(model).fit([f"bone{i}" for i in range(len(names))], model.joint_binds)
    assert raised.value.status == "JOINTS"
    strange = [f"bone{i}" for i in range(len(names))]
    roles = {"Hips": "hips", "LeftUpLeg": "left upper leg", "RightUpLeg": "right upper leg",
             "LeftLeg": "left lower leg",
             "RightLeg": "right lower leg", "LeftFoot": "left foot", "RightFoot": "right foot", "Spine": "spine",
             "LeftArm": "left upper arm", "RightArm": "right upper arm"}
    by_role = dcloth.Cloth(model).fit(strange, model.joint_binds, joint_roles={
        strange[model.joint_names.index(joint)]: role for joint, role in roles.items()})
    assert by_role.joints["left foot"] == model.joint_names.index("LeftFoot")
    with pytest.raises(dcloth.Error, match="joint_roles: found role 'knee'"):
        cloth.fit(names, model.joint_binds, joint_roles={names[0]: "knee"})


def test_fit_onto_a_skin(skirt, walk):
    from safetensors import safe_open
    with safe_open(skirt.bundle, "np") as file:
        weights = file.get_tensor("body.joint_weights")
        positions, faces = file.get_tensor("body.positions"), file.get_tensor("body.faces")
        binds = file.get_tensor("character.bind")
    strongest = np.argsort(-weights, axis=1)[:, :4]
    body = dcloth.Body(positions, strongest, np.take_along_axis(weights, strongest, 1), faces)
    cloth = dcloth.Cloth(dcloth.Model(skirt.model))
    fit = cloth.fit(walk.names, binds, body=body)
    print(fit)
    assert fit.waist_ratio == pytest.approx(1, abs=0.05) and fit.hips_ratio == pytest.approx(1, abs=0.05)
    play(cloth, walk, 4)
    with pytest.raises(dcloth.Error, match="different bytes at the start"):
        cloth.set_fit(bytes(200))
    with pytest.raises(dcloth.Error, match="body_joints and body_weights"):
        cloth.fit(walk.names, binds, body=dcloth.Body(positions, strongest[:, :2], weights[:, :4]))


def test_threads(skirt, walk):
    """Cloths of one model on threads of their own draw what they draw alone; calls on one cloth take turns."""
    model = dcloth.Model(skirt.model)
    shared = dcloth.Cloth(model)
    shared.bind_joints(walk.names)

    def alone(results, i):
        cloth = dcloth.Cloth(model)
        cloth.bind_joints(walk.names)
        results[i] = play(cloth, walk, 20)

    def together():
        for pose in walk.poses[:20]:
            assert np.isfinite(shared.update(pose, 1 / walk.fps)[0]).all()

    results = [None] * 3
    threads = [threading.Thread(target=alone, args=(results, i)) for i in range(3)]
    threads += [threading.Thread(target=together) for _ in range(2)]
    for thread in threads: thread.start()
    for thread in threads: thread.join()
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


def test_stages_and_unseen(walk, cloth):
    full = play(cloth, walk, 10)
    cloth.reset()
    static = play(cloth, walk, 10, stages=dcloth.Stages.STATIC)
    assert largest_mm(static, full) > 1
    cloth.reset()
    for pose in walk.poses[:9]:
        cloth.update_unseen(pose, 1 / walk.fps)
    assert cloth.tick_share == pytest.approx(1, abs=0.01) and not cloth.frozen and cloth.lag_seconds >= 0
    np.testing.assert_array_equal(cloth.update(walk.poses[9], 1 / walk.fps)[0], full[9])


def test_convert_and_its_errors(skirt, short, tmp_path):
    assert skirt.report["precision"] == "int8" and skirt.report["model_bytes"] == skirt.model.stat().st_size
    with pytest.raises(dcloth.Error) as raised:
        dcloth.convert(skirt.model, tmp_path / "out.dcloth")
    assert raised.value.status == "INPUT" and "skirt.dcloth" in raised.value.text
    with pytest.raises(dcloth.Error) as raised:
        dcloth.convert(skirt.bundle, tmp_path / "out.dcloth", precision="int4")
    assert raised.value.status == "INPUT" and "int4" in raised.value.text
    assert raised.value.text.count("\n") == 0
    with pytest.raises(dcloth.Error) as raised:
        dcloth.convert(skirt.bundle, tmp_path / "out.dcloth", precision="int8", max_error_mm=1e-6, motion=[short])
    assert raised.value.status == "THRESHOLD"
    assert not (tmp_path / "out.dcloth").exists()


def test_evaluate(skirt, short):
    report = dcloth.evaluate(skirt.bundle, [short], precision=["int8"])
    variant = next(v for v in report["variants"] if v["name"] == "int8")
    assert 5 < variant["truth"]["position_mm"]["mean"] < 50


def test_command(skirt, command):
    version = command("--version")
    assert version.returncode == 0 and version.stdout.strip() == dcloth.__version__
    described = command("inspect", skirt.model)
    assert described.returncode == 0 and "8170 vertices" in described.stdout
    refused = command("inspect", skirt.bundle)
    assert refused.returncode == 2 and refused.stderr.startswith("dcloth: error: ")
    poses = command("poses", "clip.fbx", "-o", "unused.safetensors", "--model", skirt.model)
    assert poses.returncode == 2 and "clip.fbx" in poses.stderr


def test_the_readme(walk, tmp_path, monkeypatch):
    """The lines under "Use" run as they stand."""
    text = (REPOSITORY / "platforms/python/README.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(REPOSITORY / "models")
    names = {"names": walk.names, "motion": walk.poses[:3]}
    exec(text.split("```python\n")[1].split("```")[0], names)
    assert names["positions"].shape == names["normals"].shape == (8170, 3)
