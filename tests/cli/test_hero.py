"""hero: a character and its clips as training simulates a garment on them."""
import json
from pathlib import Path

import numpy as np
import pytest

import safetensors_file
from checks import leftovers, refused

DATA = Path(__file__).parent / "data"
WALKER = DATA / "walker.glb"
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])    # Blender's axes to ours


@pytest.fixture(scope="module")
def hero(dcloth, tmp_path_factory):
    """(tensors, metadata) of the walker; skips where the command was built without assimp, and says so."""
    out = tmp_path_factory.mktemp("hero") / "hero.safetensors"
    result = dcloth("hero", WALKER, "-o", out)
    if "built without assimp" in result.stderr:
        pytest.skip("dcloth was built without assimp: reading characters is not tested")
    assert result.returncode == 0, result.stderr
    return safetensors_file.read(out)


@pytest.fixture(scope="module")
def walker():
    """Joint names, rest [J, 4, 4], frames [20, J, 4, 4] in our axes, as Blender says them."""
    tensors, metadata = safetensors_file.read(DATA / "walker.safetensors")
    return json.loads(metadata["joint_names"]), Z_UP @ tensors["rest"].astype(np.float64), \
        Z_UP @ tensors["frames"].astype(np.float64)


def relative(matrices, bind):
    return matrices @ np.linalg.inv(bind)


def test_joints_have_their_roles_and_the_skin_its_weights(hero, walker):
    tensors, metadata = hero
    names, roles, parents = (json.loads(metadata[key]) for key in ("joint_names", "roles", "parents"))
    for name, role in (("Hips", "hips"), ("LeftUpLeg", "left upper leg"), ("RightLeg", "right lower leg")):
        assert roles[names.index(name)] == role
    assert names[parents[names.index("LeftLeg")]] == "LeftUpLeg" and parents[names.index("Hips")] == -1
    order = [names.index(name) for name in walker[0]]
    assert np.abs(tensors["joint_bind"][order][:, :3, 3] - walker[1][:, :3, 3]).max() < 1e-4
    count = len(tensors["body_vertices"])
    assert tensors["body_joints"].shape == tensors["body_weights"].shape == (count, 4)
    assert np.abs(tensors["body_weights"].sum(1) - 1).max() < 1e-6
    assert tensors["body_joints"].min() >= 0 and tensors["body_joints"].max() < len(names)
    assert tensors["body_faces"].max() < count and tensors["body_mesh"].max() + 1 == len(json.loads(metadata["meshes"]))
    assert len(json.loads(metadata["clips"])) >= 1


@pytest.mark.parametrize("animation", ["0", "Walk", "walker.fbx", "walker.glb#Walk"])
def test_a_clip_moves_the_joints_as_blender_does(animation, hero, walker, dcloth, tmp_path):
    out = tmp_path / "clip.safetensors"
    given = DATA / animation if "." in animation else animation
    result = dcloth("hero", WALKER, "--animation", given, "-o", out)
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(out)
    names = json.loads(metadata["joint_names"])
    assert names == json.loads(hero[1]["joint_names"]) and float(metadata["fps"]) == 30
    order = [names.index(name) for name in walker[0]]
    found = relative(tensors["joint_matrices"].astype(np.float64)[:, order], hero[0]["joint_bind"].astype(np.float64)[order])
    wanted = relative(walker[2], walker[1])
    frames = min(len(found), len(wanted))
    assert frames >= 19
    assert np.abs(found[:frames, :, :3, :3] - wanted[:frames, :, :3, :3]).max() < (2e-2 if "fbx" in animation else 2e-3)


def test_refuses_what_it_cannot_do(hero, dcloth, tmp_path):
    refused(dcloth("hero", WALKER, "--animation", "Fly", "-o", tmp_path / "o.safetensors"), "no clip 'Fly'", "Walk")
    refused(dcloth("hero", DATA / "walker.bvh", "-o", tmp_path / "o.safetensors"), "no skinned surface")
    refused(dcloth("hero", WALKER, "-o", WALKER), "walker.glb")
    assert not leftovers(tmp_path, set())
