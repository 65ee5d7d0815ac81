"""glTF as its specification says: one figure, written in every way that writers of glTF have, is dressed alike."""
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import safetensors_file
from checks import leftovers, refused
from gltf_figure import NAMES, Figure

SKIRT = Path(__file__).parents[2] / "models/skirt/skirt.safetensors"
FRAMES = [0, 8, 15, 22, 30, 45, 60]


@pytest.fixture(scope="module")
def skirt(dcloth, tmp_path_factory):
    """A garment that measures girths."""
    model = tmp_path_factory.mktemp("skirt") / "skirt.dcloth"
    assert dcloth("convert", SKIRT, "--precision", "int8", "-o", model).returncode == 0
    return model


def dress(dcloth, garment, folder, glb, name="hero.glb"):
    (folder / name).write_bytes(glb)
    result = dcloth("dress", folder / name, "--garment", garment, "-o", folder / "o.dcloth-fit", "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def plain(dcloth, skirt, tmp_path_factory):
    report = dress(dcloth, skirt, tmp_path_factory.mktemp("plain"), Figure().glb())
    assert len(report["joints"]) == 22 and report["fit"]["hips_ratio"] > 0.5
    return report


def quantised(most):
    """KHR_mesh_quantization as gltfpack writes it: 16-bit places, undone by the bind matrices."""
    figure = Figure()
    low, size = figure.vertices.min(0).astype(float), float(np.ptp(figure.vertices, 0).max())
    places = np.zeros((len(figure.vertices), 4), "<u2")
    places[:, :3] = np.round((figure.vertices - low) / size * most)
    figure.primitive["attributes"]["POSITION"] = figure.add(places, "VEC3", 8,
                                                            normalized=most == 65535)
    undo = np.eye(4)
    undo[:3, :3] *= size if most == 65535 else size / most
    undo[:3, 3] = low
    figure.bind(figure.inverse @ undo)
    figure.document["extensionsUsed"] = figure.document["extensionsRequired"] = ["KHR_mesh_quantization"]
    return figure


def without_bind_matrices():
    """Vertices are then in their joints' own spaces."""
    figure = Figure()
    own = figure.vertices + figure.inverse[figure.joint_of, :3, 3].astype("<f4")
    figure.primitive["attributes"]["POSITION"] = figure.add(own, "VEC3")
    del figure.skin["inverseBindMatrices"]
    return figure


def named_like_the_hips():
    figure = Figure()
    figure.document["nodes"][-1]["name"] = figure.mesh["name"] = "Hips"
    figure.document["scenes"][0]["nodes"].reverse()     # the mesh comes first
    return figure.raise_leg()


def sparse():
    """Half of the vertices are given in a sparse list, over zeros."""
    figure = Figure()
    kept = np.arange(len(figure.vertices)) % 2 == 0
    changed = np.flatnonzero(~kept).astype("<u2")
    position = figure.add(np.where(kept[:, None], figure.vertices, 0).astype("<f4"), "VEC3")
    figure.document["accessors"][position]["sparse"] = {
        "count": len(changed), "indices": {"bufferView": figure.view(changed.tobytes()), "componentType": 5123},
        "values": {"bufferView": figure.view(figure.vertices[changed].tobytes())}}
    figure.primitive["attributes"]["POSITION"] = position
    return figure


def weights_of_bytes():
    """Shares of two joints as normalized bytes, the same joint twice."""
    figure = Figure()
    joints, weights = np.zeros((len(figure.vertices), 4), "<u2"), np.zeros((len(figure.vertices), 4), "u1")
    joints[:, :2], weights[:, :2] = figure.joint_of[:, None], (155, 100)
    figure.primitive["attributes"] |= {"JOINTS_0": figure.add(joints, "VEC4"),
                                       "WEIGHTS_0": figure.add(weights, "VEC4", normalized=True)}
    return figure


def morph(weight, of_node=False):
    """A target that widens the hips by 40 %."""
    figure = Figure()
    v = figure.vertices
    hips = (abs(v[:, 1:2] - .93) < .2) & (abs(v[:, 0:1]) < .3)
    target = figure.add(np.where(hips, v * [.4, 0, .4], 0).astype("<f4"), "VEC3")
    figure.primitive["targets"] = [{"POSITION": target}]
    figure.mesh["weights"] = [0.0 if of_node else weight]
    if of_node:
        figure.document["nodes"][-1]["weights"] = [weight]
    return figure


@pytest.mark.parametrize("make", [lambda: quantised(16383), lambda: quantised(65535), without_bind_matrices,
                                  named_like_the_hips, sparse, weights_of_bytes, lambda: morph(0.0),
                                  lambda: Figure(lambda name: f"{name}_{NAMES.index(name) + 1:02d}"),
                                  lambda: Figure(lambda name: "Character1_" + name),
                                  lambda: Figure(lambda name: "The knight|" + name)],
                         ids=["quantised14", "quantised16", "no_bind", "equal_names", "sparse", "weights", "morph_off",
                              "sketchfab", "humanik", "any_prefix"])
def test_one_figure_is_dressed_alike(make, plain, dcloth, skirt, tmp_path):
    report = dress(dcloth, skirt, tmp_path, make().glb())
    fit = report["fit"]
    assert len(report["joints"]) == 22 and fit["warnings"] == plain["fit"]["warnings"]
    for key in ("scale", "bone_scale", "waist_ratio", "hips_ratio"):
        # A step of 14 bits over 1.8 m is a tenth of a millimetre, of girths of a metre.
        assert fit[key] == pytest.approx(plain["fit"][key], abs=1e-3), key
    for key in ("gap_mm", "penetration_mm"):
        assert fit[key] == pytest.approx(plain["fit"][key], abs=0.2), key


@pytest.mark.parametrize("of_node", [False, True])
def test_a_morph_target_that_is_on_from_the_start(of_node, plain, dcloth, skirt, tmp_path):
    hips = dress(dcloth, skirt, tmp_path, morph(1.0, of_node).glb())["fit"]["hips_ratio"]
    assert 1.3 < hips / plain["fit"]["hips_ratio"] < 1.45


def thigh_degrees(dcloth, folder, figure):
    (folder / "hero.glb").write_bytes(figure.glb())
    result = dcloth("hero", folder / "hero.glb", "--animation", "Raise", "-o", folder / "o.safetensors")
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(folder / "o.safetensors")
    thigh = json.loads(metadata["joint_names"]).index("LeftUpLeg")
    return np.degrees(Rotation.from_matrix(tensors["joint_matrices"][FRAMES, thigh, :3, :3]).magnitude())


@pytest.mark.parametrize("interpolation, kind, wanted", [
    ("LINEAR", "<f4", [0, 21.33, 40, 58.67, 80, 40, 0]), ("STEP", "<f4", [0, 0, 0, 0, 80, 80, 0]),
    ("CUBICSPLINE", "<f4", [0, 13.4, 40, 66.6, 80, 40, 0]), ("LINEAR", "<i2", [0, 21.33, 40, 58.67, 80, 40, 0]),
    ("LINEAR", "i1", [0, 21.33, 40, 58.67, 80, 40, 0]), ("STEP", "<i2", [0, 0, 0, 0, 80, 80, 0])])
def test_keys_are_interpolated_as_they_say(interpolation, kind, wanted, dcloth, tmp_path):
    """glTF 2.0, appendix C: the thigh at 0, 80 and 0 degrees after 0, 1 and 2 seconds."""
    found = thigh_degrees(dcloth, tmp_path, Figure().raise_leg(interpolation, kind))
    assert found == pytest.approx(wanted, abs={"<f4": 0.05, "<i2": 0.05, "i1": 0.5}[kind])


def test_a_clip_moves_its_node_not_its_namesake(dcloth, tmp_path):
    """Two joints of one name: the left thigh's clip turns the left one."""
    figure = Figure(lambda name: "Thigh" if name.endswith("UpLeg") else name).raise_leg()
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    result = dcloth("hero", tmp_path / "hero.glb", "--animation", "Raise", "-o", tmp_path / "o.safetensors")
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(tmp_path / "o.safetensors")
    names = json.loads(metadata["joint_names"])
    assert len(set(names)) == len(names) == len(NAMES)
    turned = np.degrees(Rotation.from_matrix(tensors["joint_matrices"][30, :, :3, :3]).magnitude())
    moved = [name for name, degrees in zip(names, turned) if degrees > 1]
    assert sorted(moved) == sorted(["Thigh", "LeftLeg", "LeftFoot", "LeftToeBase"])


def test_roles_of_vrm_clips(dcloth, skirt, tmp_path):
    """A .vrma says which node is which bone; here the names say nothing."""
    figure = Figure(lambda name: f"j{NAMES.index(name)}").raise_leg()
    bones = {"hips": "Hips", "spine": "Spine", "chest": "Spine1", "neck": "Neck", "head": "Head",
             **{side.lower() + bone: side + name for side in ("Left", "Right")
                for bone, name in (("UpperLeg", "UpLeg"), ("LowerLeg", "Leg"), ("Foot", "Foot"), ("UpperArm", "Arm"),
                                   ("LowerArm", "ForeArm"), ("Hand", "Hand"))}}
    figure.document["extensions"] = {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {
        "humanBones": {bone: {"node": NAMES.index(name)} for bone, name in bones.items()}}}}
    joints = dress(dcloth, skirt, tmp_path, figure.glb(), "hero.vrma")["joints"]
    assert joints["left upper leg"] == f"j{NAMES.index('LeftUpLeg')}"


# What is damaged or not there is named, with its place.

def test_json_with_a_nan(dcloth, tmp_path):
    figure = Figure()
    figure.document["accessors"][0]["min"] = [float("nan"), 0, 0]
    glb = figure.glb()
    (tmp_path / "hero.glb").write_bytes(glb)
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"),
            f"not JSON at byte {glb.index(b'NaN')} (line 1)", "[NaN", "no NaN")


@pytest.mark.parametrize("length", [30, 200, -9])
def test_a_file_that_is_cut_off(length, dcloth, tmp_path):
    glb = Figure().glb()[:length]
    (tmp_path / "hero.glb").write_bytes(glb)
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"),
            f"at most {len(glb)}, the size of the file", "cut off")


def test_a_chunk_that_is_cut_off(dcloth, tmp_path):
    glb = bytearray(Figure().glb())
    at = 20 + struct.unpack_from("<I", glb, 12)[0]
    struct.pack_into("<I", glb, at, len(glb))
    (tmp_path / "hero.glb").write_bytes(glb)
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"), f"a chunk at byte {at} of")


@pytest.mark.parametrize("uri", ["hero.bin", "../hero.bin", "/etc/hostname"])
def test_a_buffer_that_is_not_there(uri, dcloth, tmp_path):
    """Nor is one outside of the file's folder."""
    folder = tmp_path / "model"
    folder.mkdir()
    figure = Figure()
    (tmp_path / "hero.bin").write_bytes(figure.binary)
    figure.document["buffers"] = [{"byteLength": len(figure.binary), "uri": uri}]
    (folder / "hero.gltf").write_text(json.dumps(figure.document))
    refused(dcloth("hero", folder / "hero.gltf", "-o", tmp_path / "o.safetensors"), "hero.gltf", "not found", uri)
    assert not leftovers(tmp_path, {"model", "hero.bin"})
    figure.document["buffers"][0]["uri"] = "the%20hero.bin"
    (folder / "hero.gltf").write_text(json.dumps(figure.document))
    (folder / "the hero.bin").write_bytes(figure.binary)
    assert dcloth("hero", folder / "hero.gltf", "-o", tmp_path / "o.safetensors").returncode == 0


def test_a_view_beyond_its_buffer(dcloth, tmp_path):
    figure = Figure()
    figure.document["bufferViews"][0]["byteOffset"] = len(figure.binary) - 8
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"),
            "buffer view 0 of", "the places of mesh 'Figure'", "range of buffer 0")


@pytest.mark.parametrize("view", [10_000, 1 << 30])
def test_a_view_that_is_not_there(view, dcloth, tmp_path):
    figure = Figure()
    figure.document["accessors"][0]["bufferView"] = view
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"),
            f"buffer view {view} for the places of mesh 'Figure'", "one of the file's")


def version_1_glb(text):
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<IIII", 1, 20 + len(text), len(text), 0) + text


def test_other_versions_of_gltf_are_named(dcloth, tmp_path):
    """Version 1 names its nodes in an object, so that 2.0 finds none; its binary has no chunks."""
    first = json.dumps({"asset": {"version": "1.0"}, "nodes": {"Hips": {"name": "Hips"}}}).encode()
    newer = bytearray(Figure().glb())
    struct.pack_into("<I", newer, 4, 3)
    for name, contents, version in (("a.gltf", first, "1.0"), ("a.glb", version_1_glb(first), "1.0"),
                                    ("b.glb", newer, "3.0")):
        (tmp_path / name).write_bytes(contents)
        refused(dcloth("hero", tmp_path / name, "-o", tmp_path / "o.safetensors"), name,
                f"found a file of glTF {version}, expected glTF 2.0", "npx gltf-pipeline -i OLD.gltf")


@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
def test_compressed_meshes(name, dcloth, tmp_path):
    figure = Figure()
    figure.document["extensionsUsed"] = figure.document["extensionsRequired"] = [name]
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"), name,
            "npx @gltf-transform/cli copy")


def test_a_skin_of_fewer_matrices_than_joints(dcloth, tmp_path):
    figure = Figure()
    figure.document["accessors"][figure.skin["inverseBindMatrices"]]["count"] = 3
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"), "3 bind matrices",
            f"{len(NAMES)} joints")
