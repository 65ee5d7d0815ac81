"""dress: a garment on a character that it was not made for; what it writes, what it says, what it refuses."""
import json
import re
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

import gltf_file
import safetensors_file
import small_garment
import test_report
from checks import leftovers, refused
from gltf_figure import NAMES, Figure

DATA = Path(__file__).parent / "data"
WALKER = DATA / "walker.glb"


@pytest.fixture(scope="module")
def dressed(importing, dcloth, files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dressed")
    outputs = [part for name in ("out.html", "out.glb", "out.dcloth-fit") for part in ("-o", folder / name)]
    result = dcloth("dress", WALKER, "--garment", files.model, *outputs, "--json")
    assert result.returncode == 0, result.stderr
    return folder, json.loads(result.stdout)


def read_glb(path):
    """-> the document, a function that reads an accessor as [count, width]."""
    data = path.read_bytes()
    magic, version, size = struct.unpack_from("<4sII", data)
    assert magic == b"glTF" and version == 2 and size == len(data)
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:20 + length])
    binary = data[20 + length + 8:]
    assert len(binary) == document["buffers"][0]["byteLength"]

    def accessor(index):
        a = document["accessors"][index]
        view = document["bufferViews"][a["bufferView"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[a["type"]]
        kind = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[a["componentType"]]
        values = np.frombuffer(binary, kind, a["count"] * width, view["byteOffset"]).reshape(-1, width)
        assert view["byteOffset"] % 4 == 0 and np.isfinite(values).all()
        if "min" in a:
            assert np.array_equal(values.min(0), np.array(a["min"], values.dtype)), "bounds that readers trust"
        return values
    return document, accessor


def test_says_how_it_fits(dressed):
    _, report = dressed
    assert report["joints"] == {"hips": "Hips", "spine": "Chest", "left upper leg": "LeftUpLeg",
                                "left lower leg": "LeftLeg", "right upper leg": "RightUpLeg",
                                "right lower leg": "RightLeg"}
    fit = report["fit"]
    assert 0.3 < fit["scale"] < 3 and fit["penetration_mm"] >= 0 and fit["gap_mm"] >= 0
    assert "facing" in fit["warnings"], "the walker has no toes"
    assert report["clips"] == [{"name": "Walk", "frames": 20}]


def test_the_fit_is_for_a_game(dressed, dcloth, files, tmp_path):
    """engine/format/fit_file.h: garment and joints by name; the same for every precision of the garment."""
    folder, report = dressed
    data = (folder / "out.dcloth-fit").read_bytes()
    magic, version, _, size, _, joint_count, host_joint_count = struct.unpack_from("<4sIQQQII", data)
    assert (magic, version, size) == (b"DCLF", 1, len(data)) and size % 64 == 0
    assert data[72:136].rstrip(b"\0").decode() == report["garment"]
    joints = [struct.unpack_from("<12dI60s", data, 192 + 160 * j) for j in range(joint_count)]
    assert {joint[13].rstrip(b"\0").decode() for joint in joints} <= set(report["joints"].values())
    assert all(joint[12] < host_joint_count for joint in joints)
    for precision in ("fp32", "int8"):
        model, fit = tmp_path / f"{precision}.dcloth", tmp_path / f"{precision}.dcloth-fit"
        assert dcloth("convert", files.bundle, "-o", model, "--precision", precision).returncode == 0
        assert dcloth("dress", WALKER, "--garment", model, "-o", fit).returncode == 0
        assert fit.read_bytes() == data


def test_the_page_holds_body_and_cloth(dressed):
    folder, _ = dressed
    page = (folder / "out.html").read_text()
    data = json.loads(re.search(r'id="report-data">(.*?)</script>', page, re.DOTALL)[1])
    assert data["vertex_count"] == small_garment.VERTICES
    assert data["body"]["count"] > 50 and data["sequences"][0]["frames"] == 20
    assert page.count('id="blob-') > 6


def png(rows):
    """An RGB picture of rows [h, w, 3], 0 to 255."""
    rows = np.array(rows, np.uint8)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    lines = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", rows.shape[1], rows.shape[0], 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")


def painted(place, picture, webp=False, material=None):
    """The walker, all of whose skin shows one place of a picture."""
    data = WALKER.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20:20 + length]), bytearray(data[20 + length + 8:])

    def view(content):
        binary.extend(bytes(-len(binary) % 4))
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(content)})
        binary.extend(content)
        return len(document["bufferViews"]) - 1
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            count = document["accessors"][primitive["attributes"]["POSITION"]]["count"]
            document["accessors"].append({"bufferView": view(np.tile(np.array(place, "<f4"), (count, 1)).tobytes()),
                                          "componentType": 5126, "count": count, "type": "VEC2"})
            primitive["attributes"]["TEXCOORD_0"] = len(document["accessors"]) - 1
            primitive["material"] = 0
    document["images"] = [{"bufferView": view(picture), "mimeType": "image/png"}]
    document["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}} if webp else {"source": 0}]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, **(material or {})}]
    document["buffers"][0]["byteLength"] = len(binary)
    return gltf_file.glb(document, bytes(binary))


PICTURE = png([[[255, 0, 255], [255, 255, 0]], [[0, 90, 255], [255, 255, 255]]])     # blue at the lower left


@pytest.mark.parametrize("webp", [False, True])
def test_the_page_shows_the_characters_pictures(webp, importing, dcloth, files, tmp_path):
    hero, out = tmp_path / "hero.glb", tmp_path / "out.html"
    hero.write_bytes(painted((0.25, 0.75), PICTURE, webp, {"alphaMode": "MASK"}))
    result = dcloth("dress", hero, "--garment", files.model, "-o", out)
    assert result.returncode == 0, result.stderr
    _, data, blobs = test_report.page_parts(out)
    body = data["body"]
    assert [blobs[k] for k in body["pictures"]] == [PICTURE]
    assert [(part["picture"], part["cut_out"]) for part in body["parts"]] == [(0, True)]
    places = np.frombuffer(blobs[body["texture_coordinates"]], "<f4").reshape(-1, 2)
    assert len(places) == body["count"] and np.abs(places - [0.25, 0.75]).max() < 1e-6
    if test_report.CHROMIUM is None:
        pytest.skip("no chromium on this machine: what the page shows is not tested")
    image = test_report.picture(out, "frame=10&theme=light", tmp_path / "picture.png")
    blue = (image[:, :, 2] > 1.5 * image[:, :, 0]) & (image[:, :, 2] > 0.2)
    assert blue.sum() > 2000, "the skin does not show the lower left of its picture"


def test_the_page_frames_the_whole_figure(importing, dcloth, files, tmp_path):
    """The top of the head is green, the feet are blue: both are seen."""
    figure = Figure()
    colours = np.full((len(figure.vertices), 4), 255, "u1")
    head, feet = (np.isin(figure.joint_of, [NAMES.index(name) for name in names])
                  for names in (["Head"], ["LeftFoot", "RightFoot"]))
    crown = head & (figure.vertices[:, 1] > figure.vertices[head, 1].max() - 0.06)
    colours[crown] = [0, 255, 0, 255]
    colours[feet] = [0, 0, 255, 255]
    figure.primitive["attributes"]["COLOR_0"] = figure.add(colours, "VEC4", normalized=True)
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / "o.html")
    assert result.returncode == 0, result.stderr
    if test_report.CHROMIUM is None:
        pytest.skip("no chromium on this machine: what the page shows is not tested")
    image = test_report.picture(tmp_path / "o.html", "frame=10&theme=light", tmp_path / "picture.png")
    red, green, blue = (image[:, :, c] for c in range(3))
    assert ((green > 1.3 * red) & (green > 1.3 * blue)).sum() > 100, "the head is cut off"
    assert ((blue > 1.3 * red) & (blue > 1.3 * green)).sum() > 200, "the feet are cut off"


def test_the_page_shows_the_colours_of_vertices(importing, dcloth, files, tmp_path):
    """Of glTF, where they are linear by definition; as bytes here."""
    data = WALKER.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20:20 + length]), bytearray(data[20 + length + 8:])
    primitive = document["meshes"][0]["primitives"][0]
    count = document["accessors"][primitive["attributes"]["POSITION"]]["count"]
    painted_rows = np.tile(np.array([0, 55, 255, 255], "u1"), (count, 1))
    binary.extend(bytes(-len(binary) % 4))
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": painted_rows.nbytes})
    binary.extend(painted_rows.tobytes())
    document["accessors"].append({"bufferView": len(document["bufferViews"]) - 1, "componentType": 5121,
                                  "count": count, "type": "VEC4", "normalized": True})
    primitive["attributes"]["COLOR_0"] = len(document["accessors"]) - 1
    document["buffers"][0]["byteLength"] = len(binary)
    hero, out = tmp_path / "hero.glb", tmp_path / "out.html"
    hero.write_bytes(gltf_file.glb(document, bytes(binary)))
    result = dcloth("dress", hero, "--garment", files.model, "-o", out)
    assert result.returncode == 0, result.stderr
    _, page, blobs = test_report.page_parts(out)
    colours = np.frombuffer(blobs[page["body"]["colours"]], "u1").reshape(-1, 3)
    assert len(colours) == page["body"]["count"]
    shown = round(255 * (55 / 255) ** (1 / 2.2))
    rest = (colours == 255).all(1)  # of other meshes
    assert (colours[~rest] == [0, shown, 255]).all() and (~rest).any()


def test_what_is_no_picture_is_left_out(importing, dcloth, files, tmp_path):
    hero, out = tmp_path / "hero.glb", tmp_path / "out.html"
    hero.write_bytes(painted((0.25, 0.75), b"<svg onload=alert(1)>"))
    result = dcloth("dress", hero, "--garment", files.model, "-o", out)
    assert result.returncode == 0, result.stderr
    body = test_report.page_parts(out)[1]["body"]
    assert body["pictures"] == [] and [part["picture"] for part in body["parts"]] == [-1]


def test_the_gltf_moves_body_and_cloth(dressed):
    folder, report = dressed
    document, accessor = read_glb(folder / "out.glb")
    body, garment = document["meshes"]
    assert [mesh["name"] for mesh in document["meshes"]] == ["body", "garment"]
    positions = accessor(garment["primitives"][0]["attributes"]["POSITION"])
    targets = [accessor(t["POSITION"]) for t in garment["primitives"][0]["targets"]]
    assert len(positions) == small_garment.VERTICES and len(targets) == report["clips"][0]["frames"] - 1
    weights = accessor(document["animations"][0]["samplers"][-1]["output"]).reshape(len(targets) + 1, len(targets))
    assert np.array_equal(weights[1:], np.eye(len(targets))) and not weights[0].any()
    skin = body["primitives"][0]
    assert accessor(skin["indices"]).max() < len(accessor(skin["attributes"]["POSITION"]))

    # The skirt stays around the hips of the body that moves.
    nodes = {node.get("name"): i for i, node in enumerate(document["nodes"])}
    animation = document["animations"][0]
    ways = {c["target"]["node"]: accessor(animation["samplers"][c["sampler"]]["output"])
            for c in animation["channels"] if c["target"]["path"] == "translation"}
    for frame, target in enumerate([np.zeros_like(positions), *targets]):
        waist = (positions + target)[:small_garment.COLUMNS].mean(0)
        assert np.linalg.norm(waist - ways[nodes["Hips"]][frame]) < 0.2


def test_the_gltf_has_the_models_texture(dressed, dcloth, files, tmp_path):
    """A seam along the first column of the tube: its vertices come twice, and move as one."""
    folder, _ = dressed
    tensors, metadata = safetensors_file.read(files.bundle)
    faces = tensors["template.faces"]
    u, v = faces % small_garment.COLUMNS / small_garment.COLUMNS, faces // small_garment.COLUMNS / 100
    u = np.where((u == 0) & (u.max(1, keepdims=True) > 0.5), 1, u)
    bundle, model = tmp_path / "textured.safetensors", tmp_path / "textured.dcloth"
    safetensors_file.write(bundle, {**tensors, "template.texture_coordinates": np.stack([u, v], -1).astype("f4")},
                           metadata)
    assert dcloth("convert", bundle, "-o", model).returncode == 0
    result = dcloth("dress", WALKER, "--garment", model, "-o", tmp_path / "out.glb")
    assert result.returncode == 0, result.stderr
    plain, textured = (read_glb(path / "out.glb") for path in (folder, tmp_path))
    own, given = (document["meshes"][1]["primitives"][0] for document, _ in (plain, textured))
    corners = textured[1](given["indices"])[:, 0]
    coordinates = textured[1](given["attributes"]["TEXCOORD_0"])
    assert np.allclose(coordinates[corners], np.stack([u, v], -1).reshape(-1, 2), atol=1e-6)
    assert len(coordinates) == small_garment.VERTICES + small_garment.VERTICES // small_garment.COLUMNS
    for frame in (None, 0, -1):
        moves = [read(p["attributes"]["POSITION"] if frame is None else p["targets"][frame]["POSITION"])
                 for p, read in ((own, plain[1]), (given, textured[1]))]
        assert np.array_equal(moves[0][plain[1](own["indices"])[:, 0]], moves[1][corners])


def test_vrm_is_gltf(dressed, dcloth, files, tmp_path):
    _, report = dressed
    shutil.copy(WALKER, tmp_path / "walker.vrm")
    result = dcloth("dress", tmp_path / "walker.vrm", "--garment", files.model, "-o", tmp_path / "o.dcloth-fit",
                    "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["fit"] == report["fit"]


def test_animation_of_another_file(dressed, dcloth, files, tmp_path):
    """The walker's own clip out of its FBX file, whose axes are others."""
    folder, _ = dressed
    result = dcloth("dress", WALKER, "--garment", files.model, "--animation", "Walk", "-o", tmp_path / "own.glb")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "own.glb").read_bytes() == (folder / "out.glb").read_bytes()
    result = dcloth("dress", WALKER, "--garment", files.model, "--animation", DATA / "walker.fbx",
                    "-o", tmp_path / "o.glb")
    assert result.returncode == 0, result.stderr
    (own, read_own), (other, read_other) = read_glb(tmp_path / "own.glb"), read_glb(tmp_path / "o.glb")
    for document, read in ((own, read_own), (other, read_other)):
        primitive = document["meshes"][1]["primitives"][0]
        first = read(primitive["attributes"]["POSITION"])
        document["frames"] = np.array([first, *(first + read(target["POSITION"]) for target in primitive["targets"])])
    frames = min(len(own["frames"]), len(other["frames"]))
    assert frames >= 19
    apart = np.linalg.norm(own["frames"][:frames] - other["frames"][:frames], axis=-1)
    assert apart.mean() < 0.01, "the skirt moves as with the character's own clip, to a frame's rounding"


def test_map_names_parts(importing, dcloth, files, tmp_path):
    out = tmp_path / "o.dcloth-fit"
    names = tmp_path / "map.json"

    def dress(map_):
        names.write_text(json.dumps(map_))
        return dcloth("dress", WALKER, "--garment", files.model, "--map", names, "-o", out, "--json")

    result = dress({"left upper leg": "LeftUpLeg", "Hips": "Hips"})
    assert result.returncode == 0, result.stderr
    refused(dress({"left upper leg": "LeftUpLag"}), "no node 'LeftUpLag'", "the closest names are 'LeftUpLeg'")
    refused(dress({"left wing": "LeftUpLeg"}), "'left wing'", "one of 'hips'", "'left upper leg'")
    refused(dress({"left upper leg": "RightUpLeg", "right upper leg": "LeftUpLeg"}), "to the right of", "swapped")


Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])     # ours to Blender's


def test_the_fit_alone_plays_nothing(importing, dcloth, files, tmp_path):
    """A clip of half a day takes as long as one of a second."""
    (tmp_path / "hero.glb").write_bytes(Figure().raise_leg(seconds=43_200.0).glb())
    result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / "o.dcloth-fit", "--json",
                    timeout=20)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["clips"] == [{"name": "Raise", "frames": 43_200 * 30 + 1}]


def peak_bytes(*command):
    """Of the command and its children. A process counts what it was forked from: so a small one forks it."""
    run = """import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"""
    said = subprocess.run([sys.executable, "-I", "-S", "-c", run, *map(str, command)], capture_output=True, check=True)
    return 1024 * int(said.stdout)


def test_frames_of_a_page_are_packed_while_they_are_played(importing, binary, files, tmp_path):
    """So a longer clip takes less memory than its frames would, of six bytes a vertex."""
    peak = []
    for seconds in (12, 119):
        (tmp_path / "hero.glb").write_bytes(Figure().raise_leg(seconds=float(seconds)).glb())
        peak.append(peak_bytes(binary, "dress", tmp_path / "hero.glb", "--garment", files.model,
                               "-o", tmp_path / f"{seconds}.html"))
    assert peak[1] - peak[0] < (119 - 12) * 30 * 6 * small_garment.VERTICES


def test_page_and_gltf_hold_the_same_frames(importing, dcloth, files, tmp_path):
    """The page's in several parts, the last of which is not full."""
    (tmp_path / "hero.glb").write_bytes(Figure().raise_leg(seconds=9.0).glb())
    page, scene = tmp_path / "o.html", tmp_path / "o.glb"
    outputs = [part for path in (page, scene, tmp_path / "again.html") for part in ("-o", path)]
    result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, *outputs)
    assert result.returncode == 0, result.stderr
    document, accessor = read_glb(scene)
    primitive = document["meshes"][1]["primitives"][0]
    rest = accessor(primitive["attributes"]["POSITION"])
    frames = np.stack([rest, *(rest + accessor(target["POSITION"]) for target in primitive["targets"])])
    _, data, blobs = test_report.page_parts(page)
    track, = data["sequences"][0]["tracks"]
    assert [part["frames"] for part in track["parts"]] == [120, 120, 31]
    shown = test_report.metres_of(data, blobs)["cloth"]
    assert shown.shape == frames.shape and page.read_bytes() == (tmp_path / "again.html").read_bytes()
    assert np.abs(shown - frames).max() <= data["quantum_mm"] / 2000 + 1e-5


@pytest.mark.parametrize("name, seconds, most", [("o.html", 200.0, 3600), ("o.glb", 30.0, 600)])
def test_clips_that_are_too_long_are_refused_before_they_are_played(name, seconds, most, importing, dcloth, files,
                                                                    tmp_path):
    (tmp_path / "hero.glb").write_bytes(Figure().raise_leg(seconds=seconds).glb())
    result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / name, timeout=20)
    assert result.returncode == 2 and not (tmp_path / name).exists()
    for word in (f"{round(seconds * 30) + 1} frames", f"at most {most}", "--animation"):
        assert word in result.stderr


@pytest.mark.parametrize("up", ["z", "Z"])
def test_up_axis(up, importing, dcloth, files, tmp_path):
    fits = []
    for figure, more in ((Figure(), []), (Figure(turn=Z_UP), ["--up", up])):
        (tmp_path / "hero.glb").write_bytes(figure.glb())
        result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / "o.dcloth-fit",
                        "--json", *more)
        assert result.returncode == 0, result.stderr
        fits.append(json.loads(result.stdout)["fit"])
    assert fits[0]["warnings"] == fits[1]["warnings"]
    for key in ("scale", "gap_mm", "penetration_mm", "stance_degrees"):
        assert fits[1][key] == pytest.approx(fits[0][key], abs=0.01), key


def lying():
    return Figure(turn=Z_UP), [], ["stands along +Z", "expected +Y", "--up z"]


def in_centimetres():
    return Figure(), ["--unit", "cm"], ["times the size", "--unit"]


def swapped():
    sides = {"Left": "Right", "Right": "Left"}
    return Figure(lambda name: next((sides[s] + name[len(s):] for s in sides if name.startswith(s)), name)), [], \
        ["toes that point backwards", "--map", "--up"]


def nameless():
    return Figure(lambda name: "x" + str(len(name))), [], ["no joint for 'hips'", "--map"]


@pytest.mark.parametrize("make", [lying, in_centimetres, swapped, nameless])
def test_advice_is_the_commands_own(make, importing, dcloth, files, tmp_path):
    figure, more, words = make()
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    result = dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / "o.dcloth-fit", *more)
    refused(result, *words)
    for word in ("dcloth_cloth", "joint_roles", "dcloth_fit.h", "the space"):
        assert word not in result.stderr


def without_skin(figure):
    del figure.document["nodes"][-1]["skin"], figure.document["skins"]
    return ["without a skin", "none of 1 meshes is bound to joints"]


def mirrored(figure):
    figure.document["nodes"].append({"name": "Mirror", "scale": [-1, 1, 1], "children": [0]})
    figure.document["scenes"][0]["nodes"] = [len(figure.document["nodes"]) - 1, len(figure.document["nodes"]) - 2]
    return ["mirrored", "'Mirror'", "apply the scale"]


@pytest.mark.parametrize("spoil", [without_skin, mirrored])
def test_characters_that_no_garment_fits_are_told_why(spoil, importing, dcloth, files, tmp_path):
    figure = Figure()
    words = spoil(figure)
    (tmp_path / "hero.glb").write_bytes(figure.glb())
    refused(dcloth("dress", tmp_path / "hero.glb", "--garment", files.model, "-o", tmp_path / "o.dcloth-fit"), *words)


def test_refuses_what_it_cannot_do(importing, dcloth, files, tmp_path):
    before = {path.name for path in tmp_path.iterdir()}
    refused(dcloth("dress", WALKER, "--garment", "cape", "-o", tmp_path / "o.html"),
            "no garment with this name", "cape.dcloth")
    refused(dcloth("dress", WALKER, "--garment", files.model, "-o", tmp_path / "o.obj"), ".html, .glb or .dcloth-fit")
    refused(dcloth("dress", WALKER, "--garment", files.model, "-o", tmp_path / "o.html", "--animation", "Fly"),
            "'Walk'")
    refused(dcloth("dress", DATA / "walker.bvh", "--garment", files.model, "-o", tmp_path / "o.html", "--up", "y"))
    assert not leftovers(tmp_path, before)
