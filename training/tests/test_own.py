"""A character and a garment of the user's own: what is read of them, and what is refused."""
import json
import shutil
import struct

import numpy as np
import pytest
import torch

import conftest
from dcloth_training import figure, loop, make, safetensors_io, sequence
from dcloth_training.motion import procedural, retarget, skeleton
from dcloth_training.own import dress, hero as heroes, mesh as meshes, motions, subject
from dcloth_training.simulate import body as parts, clips, garment, run, solver
from dcloth_training.truth.errors import TruthError

ROLES = {"Hips": "hips", "Spine": "spine", "Spine1": "chest", "Spine2": "upper chest", "Neck": "neck", "Head": "head",
         **{side + name: f"{side.lower()} {role}" for side in ("Left", "Right") for name, role in (
             ("Shoulder", "shoulder"), ("Arm", "upper arm"), ("ForeArm", "lower arm"), ("Hand", "hand"),
             ("UpLeg", "upper leg"), ("Leg", "lower leg"), ("Foot", "foot"), ("ToeBase", "toes"))}}


def written(turn=None, move=None, roles=ROLES):
    """What `dcloth hero` writes of our figure under Mixamo's names, with a root above and a finger below; `turn` [J, 3,
    3] gives the joints other axes, `move` [4, 4] another place."""
    body = figure.load()
    names = ["Armature", *body.names, "LeftHandIndex1"]
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[1:-1, :3, 3] = body.joints
    bind[-1, :3, 3] = body.joints[skeleton.INDEX["LeftHand"]] + [0.08, 0, 0]
    vertices = body.vertices.copy()
    if turn is not None:
        bind[:, :3, :3] = turn
    if move is not None:
        bind, vertices = move @ bind, vertices @ move[:3, :3].T + move[:3, 3]
    top = np.argsort(-body.weights, 1)[:, :4]
    joints, weights = top + 1, np.take_along_axis(body.weights, top, 1)
    hand = (joints == 1 + skeleton.INDEX["LeftHand"]) & (body.vertices[:, :1] > bind[-1, 0, 3])
    joints[hand] = len(names) - 1
    tensors = {"joint_bind": bind.astype(np.float32), "body_vertices": vertices.astype(np.float32),
               "body_joints": joints.astype(np.int32), "body_weights": weights.astype(np.float32),
               "body_faces": body.faces.astype(np.int32), "body_mesh": np.zeros(len(vertices), np.int32)}
    parents = [-1, *(int(p) + 1 for p in body.parents), names.index("LeftHand")]
    return tensors, {"joint_names": json.dumps([f"mixamorig:{name}" for name in names]), "parents": json.dumps(parents),
                     "roles": json.dumps([roles.get(name, "none") for name in names]), "meshes": '["Body"]',
                     "clips": "[]"}


def read(*arguments, **more):
    pytest.importorskip("igl")
    return heroes.of_tensors("hero.glb", *written(*arguments, **more), most=10 ** 6)[0]


@pytest.fixture(scope="module")
def hero():
    return read()


def test_a_character_has_its_parts_and_no_fingers(hero):
    body = figure.load()
    assert hero.names[0] == "mixamorig:Hips" and len(hero.names) == len(body.names)
    assert hero.parents[0] == -1 and (hero.parents[1:] < np.arange(1, len(hero.names))).all()
    order = [hero.names.index("mixamorig:" + name) for name in body.names]
    assert np.array_equal(hero.owner[order], parts.owners(body))
    assert np.array_equal(np.array(hero.names)[[hero.roles[role] for role in ROLES.values()]],
                          ["mixamorig:" + name for name in ROLES])
    assert len(hero.vertices) > 0.95 * len(body.vertices) and np.allclose(hero.weights.sum(1), 1)
    own = hero.weights[:, hero.names.index("mixamorig:LeftHand")]
    # the finger's too
    assert own[hero.vertices[:, 0] > body.joints[skeleton.INDEX["LeftHand"], 0] + 0.1].min() > 0.9


def test_the_skin_is_made_coarser_where_it_lies():
    pytest.importorskip("igl")
    coarse = heroes.of_tensors("hero.glb", *written(), most=2500)[0]
    fine = figure.load()
    assert len(coarse.vertices) <= 2600
    from scipy.spatial import cKDTree
    assert cKDTree(fine.vertices).query(coarse.vertices)[0].max() < 1e-6
    assert cKDTree(coarse.vertices).query(fine.vertices)[0].max() < 0.06


def test_what_lies_inside_of_the_body_is_left_out():
    pytest.importorskip("igl")
    ball, faces, _ = conftest.tube(0.2, 8, 12, 0.3, -0.3)
    ends = np.array([[0, 0.3, 0], [0, -0.3, 0]])
    caps = [[len(ball), a, (a + 1) % 12] for a in range(12)] + \
        [[len(ball) + 1, 84 + (a + 1) % 12, 84 + a] for a in range(12)]
    outer = np.concatenate([ball, ends])
    triangles = np.concatenate([faces, np.array(caps)])
    both = np.concatenate([outer, 0.5 * outer])
    inward = (triangles + len(outer))[:, [0, 2, 1]]         # turned the wrong way, too
    vertices, kept, weights, told = heroes.surface(both, np.concatenate([triangles, inward]), np.ones((len(both), 1)))
    assert len(vertices) == len(outer) and len(kept) == len(triangles) and f"{len(triangles)} hidden" in told
    a, b, c = (vertices[kept[:, i]] for i in range(3))
    assert np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c)).min() > 0


def test_a_skeleton_without_legs_is_refused():
    roles = {name: role for name, role in ROLES.items() if "leg" not in role}
    with pytest.raises(TruthError, match="left upper leg.*--map.*mixamorig:LeftUpLeg"):
        read(roles=roles)


@pytest.mark.parametrize("name", ["kicks", "walk_weave"])
def test_our_own_motion_comes_back_on_our_own_figure(name, hero):
    motion = clips.load("procedural/" + name)
    wanted = skeleton.joint_matrices(motion)
    found = hero.matrices(motions.onto_hero(motion, hero))
    order = [hero.names.index("mixamorig:" + other) for other in skeleton.NAMES]
    apart = np.linalg.norm(found[:, order][..., :3, 3] - wanted[..., :3, 3], axis=-1)
    legs = [k for k, other in enumerate(skeleton.NAMES) if "Leg" in other or "Foot" in other or other == "Hips"]
    assert apart[:, legs].max() < 0.01      # the figure's thighs hang within a degree of plumb
    assert apart.max() < 0.04


def test_other_axes_and_facing_change_no_limb(hero):
    """A character whose joints have axes of their own and that faces -Z, as VRM 0's do, walks as the other one does."""
    generator = np.random.default_rng(4)
    turn = np.stack([conftest.rotation(generator.normal(size=3), generator.uniform(0, 3))
                     for _ in range(len(hero.names) + 2)])
    about = np.diag([-1.0, 1, -1, 1])
    other = read(turn, about)
    motion = clips.load("procedural/kicks")[:40]
    found, wanted = (h.matrices(motions.onto_hero(motion, h))[:, :, :3, 3] for h in (other, hero))
    assert np.abs(found - wanted).max() < 1e-5
    again = other.motion(other.matrices(motions.onto_hero(motion, other)))
    assert np.abs(other.matrices(again)[:, :, :3, 3] - found).max() < 1e-6


def test_arms_that_hang_in_bind_pose_are_lifted_by_a_t_pose():
    """A-pose: its bones point where the figure's do."""
    tensors, metadata = written()
    names = [name.partition(":")[2] for name in json.loads(metadata["joint_names"])]
    down = conftest.rotation([0, 0, 1], -0.8)
    at = tensors["joint_bind"].astype(float)
    shoulder = at[names.index("LeftArm"), :3, 3].copy()
    for name in ("LeftForeArm", "LeftHand", "LeftHandIndex1"):
        j = names.index(name)
        at[j, :3, 3] = shoulder + down @ (at[j, :3, 3] - shoulder)
    tensors["joint_bind"] = at.astype(np.float32)
    pytest.importorskip("igl")
    hero = heroes.of_tensors("hero.glb", tensors, metadata)[0]
    posed = hero.matrices(motions.onto_hero(skeleton.rest_motion(1), hero))[0]
    arm, hand = (posed[hero.roles[role], :3, 3] for role in ("left upper arm", "left hand"))
    assert hand[0] - arm[0] > 0.4 and abs(hand[1] - arm[1]) < 0.01


# The garment ----------------------------------------------------------------------------------------------------------

def skirt_mesh(rings=8, columns=24, uv=True):
    """A cone that hangs from the figure's waist: vertices, quads, texture coordinates [vertices] that are its flat
    pattern."""
    top, low, waist = 1.08, 0.55, 0.125
    angle = 2 * np.pi * np.arange(columns + 1) / columns
    radius = waist + 0.15 * np.linspace(0, 1, rings)
    height = np.linspace(top, low, rings)
    points = np.array([[r * np.sin(a), y, 0.035 + r * np.cos(a)] for r, y in zip(radius, height) for a in angle[:-1]])
    slant = np.hypot(np.gradient(radius), np.gradient(height)).mean() * np.arange(rings) + \
        waist * np.hypot(0.15, top - low) / 0.15
    half = 0.15 / np.hypot(0.15, top - low)
    flat = np.array([[s * np.sin(half * a), -s * np.cos(half * a)] for s in slant for a in angle])
    quads = [(r * columns + c, (r + 1) * columns + c, (r + 1) * columns + (c + 1) % columns,
              r * columns + (c + 1) % columns)
             for r in range(rings - 1) for c in range(columns)]
    texture = [(r * (columns + 1) + c, (r + 1) * (columns + 1) + c, (r + 1) * (columns + 1) + c + 1,
                r * (columns + 1) + c + 1)
               for r in range(rings - 1) for c in range(columns)]
    return points, quads, (flat, texture) if uv else None


def write_obj(path, points, polygons, texture=None, colours=None):
    lines = ["v " + " ".join(map(str, (*p, *(colours[i] if colours is not None else ()))))
             for i, p in enumerate(points)]
    if texture:
        lines += [f"vt {u} {v}" for u, v in texture[0]]
    for k, polygon in enumerate(polygons):
        lines.append("f " + " ".join(f"{v + 1}/{texture[1][k][i] + 1}" if texture else str(v + 1)
                                     for i, v in enumerate(polygon)))
    path.write_text("\n".join(lines))
    return str(path)


def write_glb(path, mesh, scale=1.0):
    """A mesh with a vertex of its own for every corner, as files with texture seams have, under a node of another
    scale."""
    points = (mesh.vertices[mesh.faces].reshape(-1, 3) / scale).astype("<f4")
    uv = mesh.uv.reshape(-1, 2).astype("<f4")
    index = np.arange(len(points), dtype="<u4")
    binary = points.tobytes() + uv.tobytes() + index.tobytes()
    views, at = [], 0
    for part in (points, uv, index):
        views.append({"buffer": 0, "byteOffset": at, "byteLength": part.nbytes})
        at += part.nbytes
    document = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(binary)}], "bufferViews": views,
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3"},
                              {"bufferView": 1, "componentType": 5126, "count": len(points), "type": "VEC2"},
                              {"bufferView": 2, "componentType": 5125, "count": len(points), "type": "SCALAR"}],
                "meshes": [{"name": "Dress",
                            "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}],
                "nodes": [{"name": "Empty", "children": [1], "scale": [scale] * 3}, {"mesh": 0}],
                "scenes": [{"nodes": [0]}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
                     + struct.pack("<II", len(text), 0x4E4F534A)
                     + text + struct.pack("<II", len(binary), 0x004E4942) + binary)
    return str(path)


def test_obj_and_gltf_are_one_garment(hero, tmp_path):
    points, quads, texture = skirt_mesh()
    obj = write_obj(tmp_path / "dress.obj", points, quads, texture)
    glb = write_glb(tmp_path / "dress.glb", meshes.read(obj), 0.01)
    ours, theirs = (dress.make(path, hero, "wool") for path in (obj, glb))
    assert len(ours.worn.vertices) == len(theirs.worn.vertices) == len(points)
    corner = [made.worn.vertices[made.worn.faces] for made in (ours, theirs)]
    assert np.abs(corner[0] - corner[1]).max() < 1e-5
    assert np.abs(ours.worn.cloth.pattern - theirs.worn.cloth.pattern).max() < 1e-4
    assert ours.worn.pinned.sum() == theirs.worn.pinned.sum() == 24


def edge_lengths(corners):
    return np.linalg.norm(corners - np.roll(corners, -1, 1), axis=-1)


def test_flat_panels_in_the_texture_are_the_pattern_at_any_scale(hero, tmp_path):
    points, quads, texture = skirt_mesh()
    flat = (0.013 * texture[0] + 0.5, texture[1])
    made = dress.make(write_obj(tmp_path / "d.obj", points, quads, flat), hero, "wool")
    assert "are the pattern" in made.told[0]
    found = edge_lengths(made.worn.cloth.pattern)
    assert np.abs(found / edge_lengths(made.worn.vertices[made.worn.faces]) - 1).max() < 0.05
    mirrored = (flat[0] * [-1, 1], texture[1])      # a texture laid out face down
    again = dress.make(write_obj(tmp_path / "m.obj", points, quads, mirrored), hero, "wool")
    side = again.worn.cloth.pattern
    area = np.cross(side[:, 1] - side[:, 0], side[:, 2] - side[:, 0])
    assert (area > 0).all() and np.abs(edge_lengths(side) - found).max() < 1e-6


def test_a_texture_that_keeps_no_lengths_is_not_the_pattern(hero, tmp_path):
    points, quads, texture = skirt_mesh()
    squeezed = (texture[0] * [0.3, 1.0], texture[1])
    made = dress.make(write_obj(tmp_path / "d.obj", points, quads, squeezed), hero, "wool")
    assert "do not keep lengths" in made.told[0]
    faces, corners = made.worn.faces, made.worn.cloth.pattern
    assert np.abs(edge_lengths(corners) - edge_lengths(made.worn.vertices[faces])).max() < 1e-9
    bare = dress.make(write_obj(tmp_path / "b.obj", points, quads), hero, "wool")
    down = bare.worn.cloth.pattern
    drop = (bare.worn.vertices[bare.worn.faces][:, 1] - bare.worn.vertices[bare.worn.faces][:, 0])[:, 1]
    assert np.corrcoef(drop, (down[:, 1] - down[:, 0])[:, 1])[0, 1] > 0.99      # the warp runs down


def test_faces_look_outward_and_agree(hero, tmp_path):
    points, quads, _ = skirt_mesh()
    muddled = [tuple(reversed(q)) if k % 3 else q for k, q in enumerate(quads)]
    worn = dress.make(write_obj(tmp_path / "d.obj", points, muddled), hero, "wool").worn
    a, b, c = (worn.vertices[worn.faces[:, i]] for i in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c - [0, 0, 0.1]) * [1, 0, 1]) > 0).all()


def test_pins(hero, tmp_path):
    points, quads, texture = skirt_mesh()
    colours = np.tile([0.8, 0.8, 0.8], (len(points), 1))
    colours[:48] = [1, 0, 0]
    painted = write_obj(tmp_path / "red.obj", points, quads, texture, colours)
    assert dress.make(painted, hero, "wool").worn.pinned.sum() == 48            # red without being asked
    assert dress.make(painted, hero, "wool", "top").worn.pinned.sum() == 24
    assert not dress.make(painted, hero, "wool", "none").worn.pinned.any()
    touching = dress.make(painted, hero, "wool", "bone:hips,spine,chest").worn.pinned
    assert 0 < touching.sum() < 48 and (points[touching, 1] > 0.85).all()
    for pin, words in (("colour:blue", "no blue vertices"), ("bone:tail", "a role .*left upper leg"),
                       ("bone:head", "touch it"), ("ceiling", "top, none, colour")):
        with pytest.raises(TruthError, match=words):
            dress.make(painted, hero, "wool", pin)
    with pytest.raises(TruthError, match="without vertex colours"):
        dress.make(write_obj(tmp_path / "d.obj", points, quads), hero, "wool", "colour:red")


def test_what_touches_what_is_as_in_our_own_garments(hero):
    """Our robe's masks were set by its cut; here they follow from where its cloth lies."""
    for name, alike in (("robe", 0.85), ("skirt", 0.999)):
        worn = garment.GARMENTS[name](figure.load())
        found = dress.touches(worn.vertices, hero)
        arms = np.uint32(parts.LEFT_ARM | parts.RIGHT_ARM)
        assert ((found & arms) == (worn.touches & arms)).mean() > alike, name


def ball():
    points, faces, _ = conftest.tube(0.3, 4, 8, 1.0, 0.6)
    caps = [(32, a, (a + 1) % 8) for a in range(8)] + [(33, 24 + (a + 1) % 8, 24 + a) for a in range(8)]
    return np.concatenate([points, [[0, 1, 0], [0, .6, 0]]]), [*map(tuple, faces.tolist()), *caps]


def test_what_is_no_sheet_of_cloth_on_the_character_is_refused(hero, tmp_path):
    points, quads, _ = skirt_mesh()
    with pytest.raises(TruthError, match="without a border.*thickness"):
        dress.make(write_obj(tmp_path / "ball.obj", *ball()), hero, "wool")
    fin = [*quads, (0, 24, 100)]
    with pytest.raises(TruthError, match="three faces or more meet.*Non Manifold"):
        dress.make(write_obj(tmp_path / "fin.obj", points, fin), hero, "wool")
    with pytest.raises(TruthError, match="from the skin.*--garment-unit"):
        dress.make(write_obj(tmp_path / "cm.obj", 100 * points, quads), hero, "wool")
    assert dress.make(str(tmp_path / "cm.obj"), hero, "wool", unit="cm").worn.pinned.any()
    with pytest.raises(TruthError, match="no border that lies on the skin.*--pin"):
        dress.make(write_obj(tmp_path / "wide.obj", points * [1.5, 1, 1.5], quads), hero, "wool")
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF\x02\0\0\0" + b"\0" * 40)
    with pytest.raises(TruthError, match="glTF"):
        dress.make(str(broken), hero, "wool")
    (tmp_path / "d.stl").write_text("solid")
    with pytest.raises(TruthError, match=r"\.obj, \.glb or \.gltf"):
        dress.make(str(tmp_path / "d.stl"), hero, "wool")


def test_refined_keeps_the_pattern(hero, tmp_path):
    points, quads, texture = skirt_mesh()
    path = write_obj(tmp_path / "d.obj", points, quads, texture)
    once, more = (dress.make(path, hero, "wool", refine=k).worn for k in (0, 1))
    assert len(more.faces) == 4 * len(once.faces) and more.pinned.sum() == 48

    def area(worn):
        side = worn.cloth.pattern
        return 0.5 * np.cross(side[:, 1] - side[:, 0], side[:, 2] - side[:, 0]).sum()
    assert area(more) == pytest.approx(area(once), rel=0.02)


# The way --------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("last", ["patch", "mesh"])
@pytest.mark.parametrize("frames, own", [(1000, []), (100000, []), (30000, [(f"clip{k}", 200) for k in range(6)])])
def test_the_plan_spends_what_it_is_given(frames, own, last):
    plan = make.choose(own, frames, last)
    names = plan["held_out"] + plan["validation"] + plan["training"]
    assert len(set(names)) == len(names) and len(plan["training"]) >= make.FEWEST_CLIPS
    assert {name for name, _ in own} <= set(names)
    assert plan["drapes"] == 0 if last == "patch" else plan["drapes"] >= make.FEWEST_DRAPES
    if frames > 5000:
        assert 0.9 * frames < plan["frames"] <= frames
        assert not own or "clip5" in plan["held_out"] and "clip4" in plan["validation"]
    more = make.choose(own, 2 * frames, last)
    assert plan["training"] == more["training"][:len(plan["training"])]     # the most important first
    assert all(name.partition("/")[2] in procedural.SCRIPTS or "random_" in name for name in names if "/" in name)


@pytest.fixture
def begun(tmp_path):
    """A folder with the character as `dcloth hero` writes it, and a garment with vertices 2 cm apart."""
    (tmp_path / "hero.glb").write_text("read already")
    safetensors_io.write(tmp_path / "hero.safetensors", *written())
    points, quads, texture = skirt_mesh(28, 72)
    return tmp_path, write_obj(tmp_path / "dress.obj", points, quads, texture)


def test_simulates_an_own_garment_and_goes_on(begun, capsys):
    pytest.importorskip("igl")
    try:
        solver.library()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    folder, mesh = begun
    arguments = ["--out", str(folder), "--character", str(folder / "hero.glb"), "--garment", mesh, "--clips",
                 "procedural/side_steps,static", "--poses", "2", "--workers", "1"]
    assert run.main(arguments) == 0
    told = capsys.readouterr().out
    assert "texture coordinates are the pattern" in told and "left] " in told
    clip = sequence.read(folder / "dynamic" / "procedural-side_steps.safetensors")
    assert clip.joint_names[0] == "mixamorig:Hips" and clip.truth.shape[1:] == (2016, 3) and clip.wind is None
    tensors, metadata = safetensors_io.read(folder / "character.safetensors")
    assert metadata["hips"] == "mixamorig:Hips" and "mixamorig:LeftUpLeg" in json.loads(metadata["feature_joints"])
    hips = clip.joint_matrices[:, 0, :3, 3]
    assert np.abs(clip.truth - hips[:, None]).max() < 1.2            # the cloth goes where the character goes
    pinned = tensors["pinned"].astype(bool)
    assert np.ptp(hips[:, 0]) > 0.3 and np.abs(np.ptp(clip.truth[:, pinned].mean(1)[:, 0]) - np.ptp(hips[:, 0])) < 0.1
    before = (folder / "dynamic" / "procedural-side_steps.safetensors").stat().st_mtime_ns
    assert run.main(arguments) == 0
    assert (folder / "dynamic" / "procedural-side_steps.safetensors").stat().st_mtime_ns == before
    safetensors_io.write(folder / "hero.safetensors", *written(move=conftest.rigid(np.eye(3), [0.005, 0, 0])))
    assert run.main(arguments) == 2 and "another character" in capsys.readouterr().err
    other = write_obj(folder / "other.obj", *skirt_mesh(9)[:2])
    assert run.main([*arguments[:5], other, *arguments[6:]]) == 2
    assert "another garment of 2,016 vertices" in capsys.readouterr().err


def test_long_clips_are_cut_into_pieces_that_may_be_named(hero, tmp_path, monkeypatch):
    lengths = {"walk": 40, "dance": 750, "clips-Run": 390}
    safetensors_io.write(tmp_path / "hero.safetensors", *written())
    chosen = motions.Clips(None, hero, str(tmp_path))

    def sampled(name):
        motion = hero.rest(lengths[name])
        motion.root[:, 2] += np.arange(len(motion)) / 30
        return motion
    monkeypatch.setattr(chosen, "_sampled", sampled)
    assert chosen.pieces("a/walk.fbx") == ["walk"] and chosen.pieces("clips.glb#Run") == ["clips-Run"]
    pieces = chosen.pieces("b/dance.glb")
    assert pieces == ["dance", "dance@300", "dance@600"] and chosen.pieces("dance@300") == ["dance@300"]
    assert chosen.pieces("b/dance.glb") == pieces       # asked again
    long = [len(chosen.load(name)) for name in pieces]
    assert [n - motions.EASE_FRAMES // 2 for n in long] == [300, 300, 150]
    assert len(chosen.load("walk")) > motions.LOOP_FRAMES and len(chosen.load("clips-Run")) > 390
    assert chosen.load("dance@600").root[0].round(6).tolist() == [0, round(hero.joints[0, 1], 6), 0]
    with pytest.raises(TruthError, match="a second clip 'walk'"):
        chosen.pieces("b/walk.fbx")
    assert chosen.pieces("procedural/kicks") == ["procedural/kicks"]


def test_each_step_of_training_has_minutes_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "affordable", lambda epochs, minutes, *_: minutes)
    epochs = {}
    with loop.limited({"a": 3}):
        for step in ("a", "b"):
            module = torch.nn.Linear(1, 1)
            history = loop.fit(step, module, 9, lambda _, m=module: [m(torch.ones(1, 1)).square().sum()], lambda: 1.0,
                               str(tmp_path), log=lambda _: None)
            epochs[step] = history[-1]["epoch"]
    assert epochs == {"a": 3, "b": 9}


def test_the_cost_is_told_first_and_the_plan_is_kept(begun, monkeypatch, capsys):
    pytest.importorskip("igl")
    folder, mesh = begun
    monkeypatch.setattr(make.animation, "find_command", lambda _: "dcloth")
    monkeypatch.setattr(make.subject.Own, "put_on", lambda self: None)
    words = ["--character", str(folder / "hero.glb"), "--garment", mesh, "--out", str(folder), "--minutes", "20"]
    assert make.main([*words, "--plan"]) == 0
    told = capsys.readouterr().out
    assert "plan: about 14 min of simulation" in told and "min of training" in told and "GB on disk" in told
    assert not (folder / "plan.json").exists()

    def stop(*_):
        raise ValueError("stopped here")
    monkeypatch.setattr(make.simulate, "run", stop)
    assert make.main(words) == 2 and "stopped here" in capsys.readouterr().err
    kept = (folder / "plan.json").read_text()
    assert make.main([*words, "--workers", "1"]) == 2 and "stopped here" in capsys.readouterr().err     # goes on
    assert (folder / "plan.json").read_text() == kept
    assert make.main([*words, "--fabric", "cotton"]) == 2
    assert "begun with --fabric wool, now cotton" in capsys.readouterr().err


def test_drapes_that_catch_on_the_body_are_told_once():
    drapes = run.Drapes()
    assert drapes.add(20, 2) is None and drapes.add(20, 0) is None, "too few to tell"
    assert "5 of 60 drapes" in drapes.add(20, 3)
    assert drapes.add(20, 0) is None, "once"
    good = run.Drapes()
    assert all(good.add(20, 10) is None for _ in range(5))


def test_a_refused_clip_is_replaced_and_too_few_end_the_way(tmp_path, monkeypatch):
    options = make.arguments(["--character", "h.glb", "--garment", "d.obj", "--out", str(tmp_path)])
    plan = {"held_out": ["procedural/demo_walk_turn"], "validation": ["walk"], "drapes": 14,
            "training": [f"procedural/random_{k}" for k in range(6)]}
    (tmp_path / "dynamic").mkdir()
    (tmp_path / "static").mkdir()
    (tmp_path / "static" / "drapes-00.safetensors").touch()
    monkeypatch.setattr(make.simulate, "run", lambda options, chosen: 1)
    good = ["procedural-demo_walk_turn", *(f"procedural-random_{k}" for k in range(5))]
    for name in good:
        (tmp_path / "dynamic" / (name + ".safetensors")).touch()
    left = make.simulated(options, None, plan)
    assert left == {"held_out": ["procedural/demo_walk_turn"], "validation": ["procedural/random_4"],
                    "training": [f"procedural/random_{k}" for k in range(4)]}
    for name in good[2:]:
        (tmp_path / "dynamic" / (name + ".safetensors")).unlink()
    with pytest.raises(TruthError, match="2 clips of 8 that are cloth.*mend the garment"):
        make.simulated(options, None, plan)


def test_the_page_holds_the_figures_and_what_was_refused(tmp_path):
    options = make.arguments(["--character", "a/h&b.glb", "--garment", "d.obj", "--out", str(tmp_path)])
    options.name = "d"
    (tmp_path / "d.dcloth").write_bytes(b"0" * 2500000)
    (tmp_path
     / "manifest.jsonl").write_text('{"clip": "walk", "seconds": 1800}\n{"clip": "run", "refused": "<torn>"}\n')
    numbers = tmp_path / "evaluate.json"
    numbers.write_text(json.dumps({"variants": [
        {"name": "int8", "tick_ms": {"p50": 0.25}, "truth": {"position_mm": {"mean": 7.25}, "relative_error": 0.31}},
        {"name": "rigid", "tick_ms": None, "truth": {"position_mm": {"mean": 30}, "relative_error": 1.2}},
        {"name": "bare", "tick_ms": None, "truth": None}]}))
    make.page(options, str(tmp_path / "d.dcloth"), str(numbers), {"training": ["a", "b"], "held_out": ["c"]})
    text = (tmp_path / "index.html").read_text()
    assert "<td>int8</td><td>7.2</td><td>31</td><td>0.25</td>" in text and "bare" not in text
    assert "<td>rigid</td><td>30.0</td><td>120</td><td>0</td>" in text
    assert "0.50 core hours" in text and "2.50 MB" in text and "h&amp;b.glb" in text and "run: &lt;torn&gt;" in text


@pytest.fixture
def cluster(monkeypatch):
    """The address of a Dask scheduler with two workers, processes of their own."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
                                  silence_logs=50) as running:
        yield running.scheduler_address


@pytest.mark.long
def test_two_workers_of_a_cluster_give_the_bits_of_one(begun, cluster, capsys):
    pytest.importorskip("igl")
    try:
        solver.library()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    folder, mesh = begun
    common = ["--character", str(folder / "hero.glb"), "--garment", mesh, "--clips",
              "procedural/side_steps,procedural/walk_start_stop"]
    for out, more in (("here", ["--workers", "1"]), ("there", ["--cluster", cluster])):
        (folder / out).mkdir()
        safetensors_io.write(folder / out / "hero.safetensors", *written())
        if out == "there":      # put on once
            shutil.copy(folder / "here" / "character.safetensors", folder / out)
        assert run.main(["--out", str(folder / out), *common, *more]) == 0, capsys.readouterr()
    for name in ("procedural-side_steps", "procedural-walk_start_stop"):
        here, there = ((folder / out / "dynamic" / f"{name}.safetensors").read_bytes() for out in ("here", "there"))
        assert here == there and len(here) > 10 ** 6
    entries = [json.loads(line) for line in (folder / "there" / "manifest.jsonl").read_text().splitlines()]
    assert sorted(entry["clip"] for entry in entries) == ["procedural/side_steps", "procedural/walk_start_stop"]
    assert all(len(entry["sha256"]) == 64 for entry in entries)


def test_a_cluster_that_is_not_there_is_told(begun, monkeypatch, capsys):
    pytest.importorskip("distributed")
    monkeypatch.setattr(run, "CLUSTER_SECONDS", 0.5)
    monkeypatch.setattr(subject.Own, "put_on", lambda self: (self.body, self.worn))
    folder, mesh = begun
    assert run.main(["--out", str(folder), "--character", str(folder / "hero.glb"), "--garment", mesh, "--clips",
                     "procedural/dodges", "--cluster", "tcp://127.0.0.1:1"]) == 2
    told = capsys.readouterr().err
    assert "no Dask scheduler answers there" in told and "dask worker" in told


def test_few_drapes_get_company_from_the_clips_to_learn_from(tmp_path):
    options = make.arguments(["--character", "h.glb", "--garment", "d.obj", "--out", str(tmp_path)])
    for folder in ("static", "dynamic"):
        (tmp_path / folder).mkdir()
    for k, name in enumerate(("a", "b", "held")):
        matrices = np.tile(np.eye(4), (12, 2, 1, 1))
        truth = np.full((12, 5, 3), 10.0 * k) + np.arange(12)[:, None, None]
        sequence.write(make.clip_file(options, name),
                       sequence.Sequence(matrices, truth, ["x", "y"], 30.0, name, "dynamic"))
    there = {"training": ["a", "b"], "held_out": ["held"], "validation": []}
    make.stand_ins(options, there, make.ENOUGH_DRAPES)
    path = tmp_path / "static" / "drapes-of-clips.safetensors"
    assert not path.exists()
    make.stand_ins(options, there, 14)
    found = sequence.read(path)
    assert found.truth[:, 0, 0].tolist() == [0, 5, 10, 10, 15, 20] and found.kind == "static"


def test_a_recording_of_15_joints_comes_by_way_of_our_figure(hero, tmp_path):
    """Its rest has no axes of the character's, so `dcloth hero` would refuse it."""
    names, lines, depth = retarget.NAMES, ["HIERARCHY"], []
    parents = {"Hips": None, "Chest": "Hips", "Neck": "Chest", "RightArm": "Chest", "LeftArm": "Chest",
               "RightUpLeg": "Hips", "LeftUpLeg": "Hips"}
    for side in ("Left", "Right"):
        parents.update({side + low: side + high
                        for low, high in (("ForeArm", "Arm"), ("Hand", "ForeArm"), ("Leg", "UpLeg"),
                                          ("Foot", "Leg"))})
    for name, offset in zip(names, retarget.OFFSETS):
        while depth and depth[-1] != parents[name]:
            depth.pop()
            lines.append("}")
        channels = "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation" if not depth else \
            "3 Zrotation Yrotation Xrotation"
        lines += [f"{'JOINT' if depth else 'ROOT'} {name}", "{", "OFFSET " + " ".join(map(str, offset)),
                  f"CHANNELS {channels}"]
        depth.append(name)
    lines += ["}"] * len(depth) + ["MOTION", "Frames: 90", "Frame Time: 0.0333333"]
    for frame in range(90):
        values = [0, 0.88, 0.01 * frame] + [0] * (3 * len(names))
        values[3 + 3 * names.index("LeftUpLeg") + 2] = -40      # the left thigh lifted about +X
        lines.append(" ".join(map(str, values)))
    path = tmp_path / "lift.bvh"
    path.write_text("\n".join(lines))
    safetensors_io.write(tmp_path / "hero.safetensors", *written())
    chosen = motions.Clips(None, hero, str(tmp_path))
    assert chosen.pieces(str(path)) == ["lift"]
    posed = hero.matrices(chosen.load("lift"))[-1]
    at = {role: posed[hero.roles[role], :3, 3] for role in ("left upper leg", "left lower leg", "right lower leg")}
    lifted = at["left lower leg"] - at["left upper leg"]
    assert np.degrees(np.arctan2(lifted[2], -lifted[1])) == pytest.approx(40, abs=3)
    assert at["left lower leg"][2] - at["right lower leg"][2] > 0.2
