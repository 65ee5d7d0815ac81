"""hero: a character and its clips as training simulates a garment on them."""
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gltf_file
import safetensors_file
from checks import leftovers, refused
from gltf_figure import NAMES, Figure

DATA = Path(__file__).parent / "data"
WALKER = DATA / "walker.glb"


@pytest.fixture(scope="module")
def hero(importing, dcloth, tmp_path_factory):
    """(tensors, metadata) of the walker."""
    out = tmp_path_factory.mktemp("hero") / "hero.safetensors"
    result = dcloth("hero", WALKER, "-o", out)
    assert result.returncode == 0, result.stderr
    return safetensors_file.read(out)


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
    found = relative(tensors["joint_matrices"].astype(np.float64)[:, order],
                     hero[0]["joint_bind"].astype(np.float64)[order])
    wanted = relative(walker[2], walker[1])
    frames = min(len(found), len(wanted))
    assert frames >= 19
    assert np.abs(found[:frames, :, :3, :3] - wanted[:frames, :, :3, :3]).max() < (2e-2 if "fbx" in animation else 2e-3)


PERSON = {  # name: (joint above, place in the T pose)
    "Hips": (None, (0, 1, 0)), "Spine": ("Hips", (0, 1.1, 0)), "Spine1": ("Spine", (0, 1.25, 0)),
    "Neck": ("Spine1", (0, 1.5, 0)), "Head": ("Neck", (0, 1.6, 0)),
    **{side + name: (above if above in ("Hips", "Spine1") else side + above, (sign * x, y, z))
       for side, sign in (("Left", 1), ("Right", -1))
       for name, above, (x, y, z) in (
           ("Shoulder", "Spine1", (.04, 1.45, 0)), ("Arm", "Shoulder", (.18, 1.45, 0)),
           ("ForeArm", "Arm", (.45, 1.45, 0)),
           ("Hand", "ForeArm", (.7, 1.45, 0)), ("UpLeg", "Hips", (.1, .95, 0)), ("Leg", "UpLeg", (.1, .5, 0)),
           ("Foot", "Leg", (.1, .08, 0)), ("ToeBase", "Foot", (.1, .02, .14)))}}


def person(axes, rest, frames, skin):
    """A .glb of PERSON. Each joint's axes are turned by `axes` [J]; joints rest turned by `rest` [J] against their
    parents and go through `frames` [F, J], Rotations; `skin` binds a triangle in the T pose."""
    names = list(PERSON)
    place = np.array([PERSON[name][1] for name in names], float)
    above = [-1 if PERSON[name][0] is None else names.index(PERSON[name][0]) for name in names]

    def local(turns):
        """Rotation and translation of each node."""
        turned = [axes[p].inv() * turn * axes[j] if p >= 0 else turn * axes[j]
                  for j, (p, turn) in enumerate(zip(above, turns))]
        moved = [axes[p].inv().apply(place[j] - place[p]) if p >= 0 else place[j] for j, p in enumerate(above)]
        return np.array([turn.as_quat() for turn in turned]), np.array(moved)

    quaternions, moved = local(rest)
    nodes = [{"name": name, "rotation": list(quaternions[j]), "translation": list(moved[j]),
              "children": [c for c, p in enumerate(above) if p == j]} for j, name in enumerate(names)]
    nodes = [{key: value for key, value in node.items() if value != []} for node in nodes]
    keys = np.array([local(turns)[0] for turns in frames], "<f4")
    parts = [(np.arange(len(frames), dtype="<f4") / 30, "SCALAR")] + [(keys[:, j], "VEC4") for j in range(len(names))]
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "animations": [{"name": "go", "samplers": [{"input": 0, "output": 1 + j} for j in range(len(names))],
                        "channels": [{"sampler": j, "target": {"node": j, "path": "rotation"}}
                                     for j in range(len(names))]}]}
    if skin:
        bind = np.array([np.eye(4) for _ in names])
        bind[:, :3, :3] = [turn.as_matrix() for turn in axes]
        bind[:, :3, 3] = place
        first = len(parts)
        parts += [(np.array([[0, 1.2, .1], [.1, 1, .1], [-.1, 1, .1]], "<f4"), "VEC3"),
                  (np.zeros((3, 4), "u1"), "VEC4"), (np.tile(np.array([1, 0, 0, 0], "<f4"), (3, 1)), "VEC4"),
                  (np.linalg.inv(bind).transpose(0, 2, 1).astype("<f4"), "MAT4")]
        attributes = {"POSITION": first, "JOINTS_0": first + 1, "WEIGHTS_0": first + 2}
        nodes.append({"name": "Skin", "mesh": 0, "skin": 0})
        document["scenes"][0]["nodes"].append(len(nodes) - 1)
        document["meshes"] = [{"primitives": [{"attributes": attributes}]}]
        document["skins"] = [{"joints": list(range(len(names))), "inverseBindMatrices": first + 3}]
    binary, views, accessors = b"", [], []
    for values, kind in parts:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
        accessor = {"bufferView": len(accessors), "componentType": 5121 if values.dtype == np.uint8 else 5126,
                    "count": len(values), "type": kind}
        if kind in ("SCALAR", "VEC3"):
            flat = values.reshape(len(values), -1)
            accessor |= {"min": flat.min(0).tolist(), "max": flat.max(0).tolist()}
        accessors.append(accessor)
        binary += values.tobytes()
        binary += bytes(-len(binary) % 4)
    document |= {"buffers": [{"byteLength": len(binary)}], "bufferViews": views, "accessors": accessors}
    return gltf_file.glb(document, binary)


@pytest.mark.parametrize("lowered", [0, 60, -35])
def test_a_clip_whose_arms_rest_lower(lowered, hero, dcloth, tmp_path):
    """A clip without skin, of a skeleton with axes of its own that rests in an A pose, on one bound in a T pose."""
    random = np.random.default_rng(4)
    count, frames = len(PERSON), 5
    own, other = Rotation.random(count, random), Rotation.random(count, random)
    poses = [Rotation.from_rotvec(0.5 * random.standard_normal((count, 3))) for _ in range(frames)]
    still = [Rotation.identity()] * count
    lower = [Rotation.from_euler("z", -lowered if name == "LeftArm" else lowered if name == "RightArm" else 0,
                                 degrees=True)
             for name in PERSON]
    (tmp_path / "hero.glb").write_bytes(person(own, still, poses, True))
    (tmp_path / "clip.glb").write_bytes(person(other, lower, poses, False))
    out = {}
    for animation in ("0", tmp_path / "clip.glb"):
        result = dcloth("hero", tmp_path / "hero.glb", "--animation", animation, "-o", tmp_path / "o.safetensors")
        assert result.returncode == 0, result.stderr
        out[animation] = safetensors_file.read(tmp_path / "o.safetensors")[0]["joint_matrices"]
    wanted, found = out.values()
    assert wanted.shape[:2] == (frames, count)
    assert np.abs(found - wanted).max() < 1e-3


UNREAL = {"Hips": "pelvis", "Spine": "spine_01", "Spine1": "spine_02", "Spine2": "spine_03", "Neck": "neck_01",
          "Head": "head", **{side + name: f"{word}_{side[0].lower()}" for side in ("Left", "Right") for name, word in (
              ("Shoulder", "clavicle"), ("Arm", "upperarm"), ("ForeArm", "lowerarm"), ("Hand", "hand"),
              ("UpLeg", "thigh"), ("Leg", "calf"), ("Foot", "foot"), ("ToeBase", "ball"))}}


@pytest.mark.parametrize("prefix", ["", "Character1_", "SK_Hero-Body_"])
@pytest.mark.parametrize("rise", [0, 35])
def test_a_clip_whose_collar_bones_rise(rise, prefix, hero, dcloth, tmp_path):
    """Unreal's names and a clip with other axes, both in a T pose. The collar bones are turned as theirs are, arms and
    legs move as with the clip of the same figure."""
    axes = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)
    (tmp_path / "hero.glb").write_bytes(Figure(UNREAL.get).glb())
    (tmp_path / "clip.glb").write_bytes(Figure(lambda name: prefix + name, axes, rise).raise_leg().glb())
    out = tmp_path / "o.safetensors"
    result = dcloth("hero", tmp_path / "hero.glb", "--animation", tmp_path / "clip.glb", "-o", out)
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(out)
    names = json.loads(metadata["joint_names"])
    matrices = tensors["joint_matrices"].astype(float)
    assert len(matrices) == 61 and set(names) == set(UNREAL.values())

    def turned(name, frame):
        return np.degrees(Rotation.from_matrix(matrices[frame, names.index(UNREAL[name]), :3, :3]).magnitude())
    for frame, leg in ((0, 0), (30, 80), (60, 0)):
        for name in NAMES:
            wanted = leg if name in ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase") else \
                rise if name.endswith("Shoulder") else 0
            assert turned(name, frame) == pytest.approx(wanted, abs=0.1), (name, frame)


def test_a_clip_that_rests_in_another_pose_with_other_axes(hero, dcloth, tmp_path):
    random = np.random.default_rng(5)
    count = len(PERSON)
    poses = [Rotation.from_rotvec(0.5 * random.standard_normal((count, 3)))]
    sitting = [Rotation.from_euler("x", -80 if name.endswith("UpLeg") else 80 if name in ("LeftLeg", "RightLeg") else 0,
                                   degrees=True) for name in PERSON]
    (tmp_path / "hero.glb").write_bytes(person(Rotation.random(count, random), [Rotation.identity()] * count, poses,
                                               True))
    (tmp_path / "clip.glb").write_bytes(person(Rotation.random(count, random), sitting, poses, False))
    refused(dcloth("hero", tmp_path / "hero.glb", "--animation", tmp_path / "clip.glb", "-o",
                   tmp_path / "o.safetensors"),
            "joints whose axes", "T or A pose")


def test_accessors_without_bytes_are_zeros(hero, dcloth, tmp_path):
    """glTF leaves out a view where all is zero; gltf-transform writes joints of a mesh with one bone so."""
    document, binary = gltf_file.skin()
    zero = np.array([[0, 0, 0, 0]] * 3, "u1").tobytes()
    view = document["bufferViews"][2]
    binary = binary[:view["byteOffset"]] + zero + binary[view["byteOffset"] + len(zero):]
    out = {}
    for name in ("given", "left out", "no byte more"):
        if name == "left out":
            del document["accessors"][2]["bufferView"]
        text = json.dumps(document)
        if name == "no byte more":      # a chunk whose padding is not counted
            document["asset"]["extras"] = " " * (-len(text) % 4 + 1)
        (tmp_path / "hero.glb").write_bytes(gltf_file.glb(document, binary))
        result = dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors")
        assert result.returncode == 0, result.stderr
        out[name] = safetensors_file.read(tmp_path / "o.safetensors")[0]
    for other in ("left out", "no byte more"):
        for key, values in out["given"].items():
            assert np.array_equal(values, out[other][key]), key


@pytest.mark.parametrize("count", [1 << 28, (1 << 32) - 1, -1, 1e300, "3"])
def test_accessors_without_bytes_that_are_no_zeros(count, hero, dcloth, tmp_path):
    document, binary = gltf_file.skin()
    document["accessors"][0] = {"componentType": 5126, "count": count, "type": "VEC3"}
    (tmp_path / "hero.glb").write_bytes(gltf_file.glb(document, binary))
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"), "hero.glb",
            "no bytes" if isinstance(count, int) and count > 0 else "count")
    assert not leftovers(tmp_path, {"hero.glb"})


def own_space(map_to_world, leg):
    """gltf_file.skin with a second, smaller mesh that lies in a space of its own; `leg` spoils one of its bones."""
    document, binary = gltf_file.skin()
    accessors, views = document["accessors"], document["bufferViews"]
    points = np.frombuffer(binary[:36], "<f4").reshape(3, 3)
    inverse = np.frombuffer(binary[views[4]["byteOffset"]:], "<f4", 32).reshape(2, 4, 4).transpose(0, 2, 1)
    moved = (np.c_[points, np.ones(3)] @ np.linalg.inv(map_to_world).T)[:, :3]
    bind = np.stack([inverse[0] @ map_to_world, inverse[1] @ map_to_world @ leg])
    for values, kind, count in ((moved, "VEC3", 3), (bind.transpose(0, 2, 1), "MAT4", 2)):
        accessors.append({"bufferView": len(views), "componentType": 5126, "count": count, "type": kind})
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": 4 * values.size})
        binary += values.astype("<f4").tobytes()
    document["buffers"] = [{"byteLength": len(binary)}]
    document["meshes"].append({"primitives": [{"attributes": {"POSITION": 5, "JOINTS_0": 2, "WEIGHTS_0": 3},
                                               "indices": 1}]})
    document["skins"].append({"joints": [1, 2], "inverseBindMatrices": 6})
    document["nodes"].append({"name": "Eye", "mesh": 1, "skin": 1})
    document["nodes"][0]["children"].append(4)
    return gltf_file.glb(document, binary)


def test_a_mesh_in_a_space_of_its_own(hero, dcloth, tmp_path):
    """Eyes and hair of Sketchfab's characters: other numbers, the same place on the skeleton."""
    turn = np.eye(4)
    turn[:3, :3] = 25 * Rotation.from_euler("xyz", [0.3, 1.2, -0.7]).as_matrix()
    turn[:3, 3] = [3, -40, 17]
    (tmp_path / "hero.glb").write_bytes(own_space(turn, np.eye(4)))
    result = dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors")
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(tmp_path / "o.safetensors")
    assert len(json.loads(metadata["meshes"])) == 2
    found = tensors["body_vertices"].reshape(2, 3, 3)
    assert np.abs(found[0] - found[1]).max() < 1e-5 and np.abs(found[0]).max() > 0.5
    other = np.eye(4)
    other[1, 3] = 20
    (tmp_path / "hero.glb").write_bytes(own_space(turn, other))
    refused(dcloth("hero", tmp_path / "hero.glb", "-o", tmp_path / "o.safetensors"), "a second bind pose of bone")


def test_refuses_what_it_cannot_do(hero, dcloth, tmp_path):
    refused(dcloth("hero", WALKER, "--animation", "Fly", "-o", tmp_path / "o.safetensors"), "no clip 'Fly'", "Walk")
    refused(dcloth("hero", DATA / "walker.bvh", "-o", tmp_path / "o.safetensors"), "no skinned surface")
    refused(dcloth("hero", WALKER, "-o", WALKER), "walker.glb")
    assert not leftovers(tmp_path, set())
