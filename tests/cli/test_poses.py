"""poses and body: a character that Blender animated and wrote as glTF, FBX (two sets of axes) and BVH comes back as
Blender itself poses it (data/make_walker.py)."""
import errno
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import safetensors_file
import small_garment
from checks import leftovers, refused
from gltf_file import animated, skinned

DATA = Path(__file__).parent / "data"
BVH = ["--up", "z"]    # Blender writes its own axes there; glTF and FBX say theirs


@pytest.fixture(scope="module")
def body(importing, dcloth, tmp_path_factory):
    out = tmp_path_factory.mktemp("body") / "body.safetensors"
    result = dcloth("body", DATA / "walker.glb", "-o", out)
    assert result.returncode == 0, result.stderr
    return out


def poses(dcloth, out, name, *arguments):
    result = dcloth("poses", DATA / name, "-o", out, *arguments)
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(out)
    return tensors["joint_matrices"].astype(np.float64), json.loads(metadata["joint_names"]), metadata


def in_order(matrices, names, wanted):
    return matrices[:, [names.index(n) for n in wanted]]


@pytest.mark.parametrize("name, more",
                         [("walker.glb", []), ("walker.fbx", []), ("walker_z_up.fbx", []), ("walker.bvh", BVH)])
def test_motion_is_blenders(name, more, dcloth, body, walker, tmp_path):
    """G_j B_j^-1 of every joint and frame: what skinning and features are made of. Where the file lays a bone's axes
    does not matter then."""
    names, rest, frames, _ = walker
    bind, held = safetensors_file.read(body)
    bind = in_order(bind["joint_bind"].astype(np.float64)[None], json.loads(held["joint_names"]), names)[0]
    matrices, found, metadata = poses(dcloth, tmp_path / "s.safetensors", name, "--model", body, *more)
    assert len(matrices) == 20 and float(metadata["fps"]) == 30 and sorted(found) == sorted(names)
    relative = in_order(matrices, found, names) @ np.linalg.inv(bind)
    wanted = frames @ np.linalg.inv(rest)
    # Ten float32 roundings of numbers below 2 on the way through exporter, reader, parents and bind matrix; six
    # decimals of degrees and metres in BVH add less. A hundredth of a millimetre on a 2 m body is 5e-6.
    assert np.abs(relative - wanted).max() < 10 * 2 * np.finfo(np.float32).eps
    assert np.abs(np.diff(wanted, axis=0)).max() > 1e-2


def test_body_is_blenders(body, walker):
    names, rest, _, vertices = walker
    tensors, metadata = safetensors_file.read(body)
    assert sorted(json.loads(metadata["joint_names"])) == sorted(names)
    found, wanted = tensors["body_vertices"], vertices
    assert found.shape == wanted.shape    # cut apart by no face
    order = [int(np.argmin(np.linalg.norm(found - v, axis=1))) for v in wanted]
    assert len(set(order)) == len(order) and np.abs(found[order] - wanted).max() < 1e-5
    assert tensors["body_faces"].shape == (2 * 7 * 10, 3) and tensors["body_faces"].max() == len(found) - 1
    assert np.abs(tensors["body_weights"].sum(1) - 1).max() < 1e-5
    parents = dict(zip(json.loads(metadata["joint_names"]), json.loads(metadata["parents"])))
    assert parents["Hips"] == -1 and json.loads(metadata["joint_names"])[parents["LeftLeg"]] == "LeftUpLeg"
    places = in_order(tensors["joint_bind"][None], json.loads(metadata["joint_names"]), names)[0][:, :3, 3]
    assert np.abs(places - rest[:, :3, 3]).max() < 1e-5


def test_fbx_and_gltf_hold_the_same_body(body, dcloth, tmp_path):
    out = tmp_path / "b.safetensors"
    assert dcloth("body", DATA / "walker.fbx", "-o", out).returncode == 0
    one, other = safetensors_file.read(body)[0], safetensors_file.read(out)[0]
    assert np.abs(np.sort(one["body_vertices"], 0) - np.sort(other["body_vertices"], 0)).max() < 1e-5


def test_frames_between_keys(dcloth, importing, walker, tmp_path):
    once, names, _ = poses(dcloth, tmp_path / "a.safetensors", "walker.glb")
    twice, _, _ = poses(dcloth, tmp_path / "b.safetensors", "walker.glb", "--fps", "60")
    assert len(twice) == 39 and np.abs(twice[::2] - once).max() < 1e-5
    hips = names.index("Hips")
    middle = (once[1:, hips, :3, 3] + once[:-1, hips, :3, 3]) / 2
    assert np.abs(twice[1::2, hips, :3, 3] - middle).max() < 1e-5


def test_map_and_model(dcloth, importing, files, tmp_path):
    """A model asks for its own joints; a file maps them to the nodes of the animation."""
    mapping = {"hips": "Hips", "spine": "Chest", "head": "Chest", "thigh_l": "LeftUpLeg", "shin_l": "LeftLeg",
               "thigh_r": "RightUpLeg", "shin_r": "RightLeg"}
    (tmp_path / "map.json").write_text(json.dumps(mapping))
    out = tmp_path / "s.safetensors"
    matrices, names, _ = poses(dcloth, out, "walker.glb", "--model", files.model, "--map", tmp_path / "map.json",
                               "--unit", "1.1")    # as tall as the garment's figure
    assert set(small_garment.FEATURES) <= set(names) <= set(small_garment.JOINTS) and len(matrices) == 20
    alone, bones, _ = poses(dcloth, tmp_path / "a.safetensors", "walker.glb", "--unit", "1.1")
    for joint in names:
        assert np.array_equal(matrices[:, names.index(joint), :3, 3],
                              alone[:, bones.index(mapping[joint]), :3, 3]), joint
    # The bundle asks for no more than its model, and both tell how the joints' axes lie.
    same, asked, _ = poses(dcloth, tmp_path / "b.safetensors", "walker.glb", "--model", files.bundle, "--map",
                           tmp_path / "map.json", "--unit", "1.1")
    assert asked == names and np.abs(same - matrices).max() < 1e-6
    assert dcloth("run", files.model, out, "-o", tmp_path / "p.safetensors").returncode == 0


def test_missing_joints_and_what_comes_closest(dcloth, importing, files, tmp_path):
    out, before = tmp_path / "s.safetensors", set()
    result = dcloth("poses", DATA / "walker.glb", "-o", out, "--model", files.model)
    refused(result, "no node for the joints", "'thigh_l'", "'shin_r'", "'hips', the closest names are 'Hips'", "--map")
    (tmp_path / "m.json").write_text('{"hips": "Hips", "thigh_l": "LeftUpleg"}')
    before = {"m.json"}
    result = dcloth("poses", DATA / "walker.glb", "-o", out, "--model", files.model, "--map", tmp_path / "m.json")
    refused(result, "'thigh_l' (mapped to 'LeftUpleg'), the closest names are 'LeftUpLeg'")
    assert leftovers(tmp_path, before) == []


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1}', '{"a": ["b"]}', "[" * 100000])
def test_bad_maps(text, dcloth, importing, tmp_path):
    (tmp_path / "m.json").write_text(text)
    refused(dcloth("poses", DATA / "walker.glb", "-o", tmp_path / "s.safetensors", "--map", tmp_path / "m.json"),
            "m.json", "JSON")


def test_units_and_axes_that_cannot_be(dcloth, importing, body, tmp_path):
    out = tmp_path / "s.safetensors"
    text = (DATA / "walker.bvh").read_text()
    big = tmp_path / "big.bvh"
    lines = []
    for line in text.split("\n"):    # the skeleton in millimetres
        words = line.split()
        if words and words[0] == "OFFSET":
            line = "OFFSET " + " ".join(str(1000 * float(w)) for w in words[1:])
        lines.append(line)
    big.write_text("\n".join(lines))
    refused(dcloth("poses", big, "-o", out), "joints that span", "0.1 to 10 m", "--unit")
    assert dcloth("poses", big, "-o", out, "--unit", "mm", "--up", "z", "--model", body).returncode == 0
    os.unlink(out)
    refused(dcloth("poses", DATA / "walker.bvh", "-o", out, "--model", body), "at rest", "--up")
    refused(dcloth("poses", DATA / "walker.bvh", "-o", out, "--unit", "ell"), "unit 'ell'")


def test_what_is_no_animation(dcloth, importing, tmp_path):
    out = tmp_path / "s.safetensors"
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    (tmp_path / "empty.glb").write_bytes(b"")
    refused(dcloth("poses", tmp_path / "a.obj", "-o", out), ".glb, .gltf, .vrm, .fbx or .bvh")
    refused(dcloth("poses", tmp_path / "empty.glb", "-o", out), "empty.glb")
    refused(dcloth("poses", tmp_path / "none.fbx", "-o", out), "none.fbx")
    refused(dcloth("body", DATA / "walker.bvh", "-o", out), "no skinned surface")
    refused(dcloth("poses", DATA / "walker.glb", "-o", out, "--clip", "Jump"), "Jump", "--clip")
    refused(dcloth("body", "--mesh", "Body", "--mesh", "Hat", DATA / "walker.glb", "-o", out), "no skinned mesh 'Hat'",
            "'Body'")
    refused(dcloth("body", DATA / "walker.glb", "-o", out, "--mesh", "Hat"), "no skinned mesh 'Hat'", "'Body'")


def test_a_root_that_turns_and_scales(dcloth, importing, tmp_path):
    file, out = tmp_path / "a.glb", tmp_path / "b.safetensors"
    file.write_bytes(skinned())
    result = dcloth("body", file, "-o", out)
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(out)
    names = json.loads(metadata["joint_names"])
    eps = np.finfo(np.float32).eps
    assert np.abs(tensors["body_vertices"] - [[0, 1, 0], [0.1, 0.5, 0], [-0.1, 0.5, 0]]).max() < 8 * eps
    places = tensors["joint_bind"][[names.index("Hips"), names.index("Leg")], :3, 3]
    assert np.abs(places - [[0, 1, 0], [0, 0.5, 0]]).max() < 8 * eps
    assert np.abs(np.linalg.norm(tensors["joint_bind"][:, :3, :3], axis=1) - 1).max() < 8 * eps     # axes of length 1
    file.write_bytes(skinned(pose=0.5))     # the bind pose alone says where the mesh is: in its own centimetres
    refused(dcloth("body", file, "-o", tmp_path / "c.safetensors"), "joints that span 50 m", "--unit")


def test_weights_that_are_no_shares(dcloth, importing, tmp_path):
    """Any finite weights are brought to a sum of 1; ones whose sum is not finite have no shares."""
    file, out = tmp_path / "a.glb", tmp_path / "b.safetensors"
    file.write_bytes(skinned(weights=(3e37, 1e37)))
    result = dcloth("body", file, "-o", out)
    assert result.returncode == 0, result.stderr
    assert np.abs(np.sort(safetensors_file.read(out)[0]["body_weights"], 1)[:, -2:] - [0.25, 0.75]).max() < 1e-6
    os.unlink(out)
    file.write_bytes(skinned(weights=(3e38, 3e38)))
    refused(dcloth("body", file, "-o", out), "a.glb", "vertex 0 of mesh", "add up to infinity", "normalize")
    assert not out.exists()


def test_without_a_process_to_read_in(binary, importing, tmp_path):
    """Where the system grants no second process nothing is read: a damaged file would have the command itself."""
    for command in ("poses", "body"):
        out = tmp_path / "s.safetensors"
        result = subprocess.run([binary, command, str(DATA / "walker.glb"), "-o", str(out)], capture_output=True,
                                text=True,
                                env={**os.environ, "LD_PRELOAD": os.environ["DCLOTH_FAULT_PRELOAD"], "FAULT_AT": "1",
                                     "FAULT_KIND": str(int(errno.EAGAIN))})
        refused(result, "walker.glb", "no second process", os.strerror(errno.EAGAIN))
        assert not out.exists()


def test_hostile_gltf(dcloth, importing, tmp_path):
    file, out = tmp_path / "a.glb", tmp_path / "s.safetensors"

    def run(blob):
        file.write_bytes(blob)
        return dcloth("poses", file, "-o", out)
    path = [[0, 0, 0], [1, 0, 0]]
    good = run(animated([0, 1], path))
    assert good.returncode == 0, good.stderr
    assert safetensors_file.read(out)[0]["joint_matrices"].shape == (31, 1, 4, 4)
    os.unlink(out)
    refused(run(animated([0, 1], [[0, 0, 0], [float("nan"), 0, 0]])), "a.glb", "number")
    refused(run(animated([0, 1], [[0, 0, 0], [1e20, 0, 0]])), "a.glb", "number")
    refused(run(animated([1, 0], path)), "increasing times")
    refused(run(animated([0, float("nan")], path)), "increasing times")
    refused(run(animated([0, 1e9], path)), "a.glb")
    assert run(animated([0, 1], path, [{"name": "Hips", "children": [1]}, {"name": "Hips"}])).returncode == 0
    os.unlink(out)
    deep = [{"name": f"n{i}", "children": [i + 1]} for i in range(3000)] + [{"name": "end"}]
    refused(run(animated([0, 1], path, deep)), "a.glb")
    circle = [{"name": "a", "children": [1]}, {"name": "b", "children": [0]}]
    refused(run(animated([0, 1], path, circle)), "a.glb")
    assert not out.exists()


@pytest.mark.parametrize("name", ["walker.glb", "walker.fbx", "walker.bvh"])
def test_damage_never_ends_the_command_by_a_signal(name, dcloth, importing, tmp_path):
    """Cut short, and bytes changed at random: 0 with a sequence, or 2 with a message and no file."""
    whole, file, out = (DATA / name).read_bytes(), tmp_path / name, tmp_path / "s.safetensors"
    random = np.random.default_rng(7)
    for case in range(16):
        blob = bytearray(whole[:len(whole) * case // 8] if case < 8 else whole)
        if case >= 8:
            for at in random.integers(0, len(blob), 20):
                blob[at] = random.integers(0, 256)
        file.write_bytes(bytes(blob))
        result = dcloth("poses", file, "-o", out)
        assert result.returncode in (0, 2), result.stderr
        assert out.exists() == (result.returncode == 0)
        if result.returncode == 2:
            assert name in result.stderr
        else:
            assert np.isfinite(safetensors_file.read(out)[0]["joint_matrices"]).all()
            os.unlink(out)
