"""Named corruptions of glTF and BVH files: what a damaged disk, a broken exporter or an attacker makes of an animation
or a skin. One list for each; every entry is a name and the bytes of a file."""
import copy
import struct

import numpy as np

from gltf_file import animation, glb, skin

TIMES, PATH = [0, 1], [[0, 0, 0], [1, 0, 0]]
HUGE = [-1, 2**32, 1e300]


def broken_containers():
    """The binary container around the document, then text that is no document."""
    good = glb(*animation(TIMES, PATH))
    words = {"magic": 0, "version": 4, "length": 8, "json_length": 12, "json_type": 16}
    for name, at in words.items():
        for value in (0, 1, 0xFFFFFF, 0x7FFFFFFF, 0xFFFFFFFF):
            yield f"{name}_{value:x}", good[:at] + struct.pack("<I", value) + good[at + 4:]
    binary = 20 + struct.unpack_from("<I", good, 12)[0]
    for value in (0xFFFFFC, 0xFFFFFFFC, 4):
        yield f"binary_length_{value:x}", good[:binary] + struct.pack("<I", value) + good[binary + 4:]
    yield "without_binary", good[:binary]
    texts = {"empty": b"", "array": b"[]", "number": b"3", "null": b"null", "cut": good[20:60], "nul": b"{\0}",
             "not_utf8": b'{"asset":{"version":"\xff\xfe"}}', "deep_arrays": b"[" * 200_000,
             "deep_objects": b'{"a":' * 100_000, "no_asset": b"{}", "asset_null": b'{"asset":null}'}
    for name, text in texts.items():
        yield f"text_{name}", glb(text)


def documents():
    """One field of a sound document changed at a time."""
    def at(path, *values):
        for value in values:
            yield path, value
    big = HUGE
    yield from at(["asset", "version"], "9", 2, None, "", "x" * 100_000)
    yield from at(["scene"], 7, *big, "first")
    yield from at(["scenes"], [], None, {}, [{"nodes": [99]}], [{"nodes": [0, 0]}], [{"nodes": "Hips"}])
    yield from at(["nodes"], [], None, [None], {"a": 1}, [3])
    yield from at(["nodes", 0], {"name": 5}, {"name": "Hips", "children": [0]}, {"name": "Hips", "children": [99]},
                  {"name": "Hips", "children": [-1]}, {"name": "x" * 3000})
    yield from at(["nodes", 0, "matrix"], [1] * 15, [0] * 16, [1e39] * 16, ["a"] * 16, None)
    yield from at(["nodes", 0, "rotation"], [0, 0, 0, 0], [1e30] * 4, [1, 2], "none")
    yield from at(["nodes", 0, "scale"], [0, 0, 0], [1e38] * 3, [-1, 1, 1], [])
    yield from at(["nodes", 0, "skin"], 0, *big)
    yield from at(["nodes", 0, "mesh"], 0, *big)
    yield from at(["buffers"], [], None, [{}], [{"byteLength": 4, "uri": "../../../etc/passwd"}],
                  [{"byteLength": 32, "uri": "data:application/octet-stream;base64,*!*"}],
                  [{"byteLength": 32, "uri": "missing.bin"}], [{"byteLength": 32, "uri": ""}])
    yield from at(["buffers", 0, "byteLength"], 0, 3, 33, *big, "32")
    for view in (0, 1):
        yield from at(["bufferViews", view, "buffer"], 1, *big)
        yield from at(["bufferViews", view, "byteOffset"], 31, 33, *big)
        yield from at(["bufferViews", view, "byteLength"], 0, 3, *big)
        yield from at(["bufferViews", view, "byteStride"], 1, 255, *big)
        yield from at(["accessors", view, "bufferView"], 2, *big)
        yield from at(["accessors", view, "byteOffset"], 1, 25, *big)
        yield from at(["accessors", view, "componentType"], 0, 1, 5120, 5123, 5130, *big)
        yield from at(["accessors", view, "count"], 0, 1, 3, 1000, *big)
        yield from at(["accessors", view, "type"], "MAT4", "VEC9", "", 3)
        yield from at(["accessors", view, "sparse"], {"count": 99, "indices": {"bufferView": 0, "componentType": 5125},
                                                      "values": {"bufferView": 1}}, {}, 5)
        # Zeros without a view, but for one value: gigabytes of them out of no bytes.
        yield from at(["accessors", view], {"componentType": 5126, "count": 2**28, "type": "VEC3", "sparse": {
            "count": 1, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 1}}})
    sampler, channel = ["animations", 0, "samplers", 0], ["animations", 0, "channels", 0]
    yield from at(["animations"], None, {}, [], [None], [{}])
    yield from at(["animations", 0, "samplers"], [], None)
    yield from at(["animations", 0, "channels"], [], None)
    yield from at(sampler + ["input"], 1, 2, *big)
    yield from at(sampler + ["output"], 0, 2, *big)
    yield from at(sampler + ["interpolation"], "CUBICSPLINE", "MAGIC", 4)
    yield from at(channel + ["sampler"], 1, *big)
    yield from at(channel + ["target"], {}, None, {"node": 9, "path": "translation"}, {"node": 0, "path": "wobble"},
                  {"node": 0, "path": "rotation"}, {"node": 0, "path": "weights"}, {"path": "translation"})


def changed(document, binary, fields):
    """The document with each of `fields`, (path, value), changed alone."""
    for path, value in fields:
        one = copy.deepcopy(document)
        place = one
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value
        text = repr(value)
        yield ".".join(map(str, path)) + "=" + (text if len(text) < 30 else text[:27] + "..."), glb(one, binary)


def broken_gltf():
    yield from broken_containers()
    yield from changed(*animation(TIMES, PATH), documents())


def skin_fields():
    def at(path, *values):
        for value in values:
            yield path, value
    big = HUGE
    helper = "Leg_$AssimpFbx$_Rotation"
    yield from at(["nodes", 2, "name"], helper, "Hips", "", "x" * 3000, 5)
    yield from at(["nodes", 0, "scale"], [0] * 3, [1e30] * 3, [1e-30] * 3, [-0.01, 0.01, 0.01], [1e9] * 3)
    yield from at(["nodes", 1, "translation"], [0, 0, 1e9], [1e30] * 3, [0, 0])
    yield from at(["nodes", 1, "children"], [], [1], [0], [2, 2], [3, 2], [99], *big)
    yield from at(["nodes", 3], {"name": "Skin"}, {"name": "Hips", "mesh": 0, "skin": 0}, {"mesh": 0}, {"skin": 0},
                  None)
    yield from at(["skins"], [], None, [{}], [{"joints": []}], [{"joints": [1, 2]}])
    yield from at(["skins", 0, "joints"], [1], [2, 1], [1, 1], [1, 99], [0, 1, 2, 3] * 5, [-1, 1], None, 3)
    yield from at(["skins", 0, "inverseBindMatrices"], 0, 3, 5, *big)
    yield from at(["meshes", 0, "primitives"], [], None, [{}], [{"attributes": {}}])
    for name in ("POSITION", "JOINTS_0", "WEIGHTS_0"):
        yield from at(["meshes", 0, "primitives", 0, "attributes", name], 0, 1, 2, 3, 4, 5, *big)
    yield from at(["meshes", 0, "primitives", 0, "indices"], 0, 2, 3, 4, 5, *big)
    yield from at(["meshes", 0, "primitives", 0, "mode"], 0, 1, 5, 6, 7, -1)
    for accessor in range(5):
        yield from at(["accessors", accessor, "count"], 0, 1, 2, 4, 1000, *big)
        yield from at(["accessors", accessor, "componentType"], 5120, 5121, 5123, 5125, 5126, 0)
        yield from at(["accessors", accessor, "type"], "SCALAR", "VEC2", "VEC3", "VEC4", "MAT4", 3)


def skin_numbers():
    """Each part of the buffer, its numbers replaced: places, corners, bones of a vertex, weights, bind matrices."""
    document, binary = skin()
    values = {"zero": 0.0, "nan": np.nan, "inf": np.inf, "1e30": 1e30, "3e38": 3e38, "1e-42": 1e-42, "-1": -1.0}
    for part, name in ((0, "places"), (3, "weights"), (4, "binds")):
        view = document["bufferViews"][part]
        for word, value in values.items():
            for first in (True, False):   # one number, or all
                start, count = view["byteOffset"], 1 if first else view["byteLength"] // 4
                broken = bytearray(binary)
                broken[start:start + 4 * count] = np.full(count, value, "<f4").tobytes()
                yield f"{'first_of' if first else 'all'}_{name}_{word}", glb(document, bytes(broken))
    for part, name in ((1, "corners"), (2, "bones")):
        view = document["bufferViews"][part]
        for value in (0, 2, 3, 0x7F, 0xFF):
            broken = bytearray(binary)
            broken[view["byteOffset"]:view["byteOffset"] + view["byteLength"]] = bytes([value]) * view["byteLength"]
            yield f"all_{name}_{value}", glb(document, bytes(broken))


def broken_skins():
    yield from changed(*skin(), skin_fields())
    yield from skin_numbers()


def broken_bvh(text):
    """`text`: a sound file whose first joint is the root, six channels a joint."""
    def change(name, old, new, count=1):
        assert old in text, old
        yield name, text.replace(old, new, count).encode()
    head, motion = text.split("MOTION\n")
    rows = motion.split("\n")[2:]
    yield "empty", b""
    yield "no_motion", head.encode()
    yield "motion_alone", ("MOTION\n" + motion).encode()
    yield "head_twice", (head + text).encode()
    yield from change("no_hierarchy", "HIERARCHY", "")
    yield from change("no_root", "ROOT Hips", "JOINT Hips")
    yield from change("nameless", "JOINT Chest", "JOINT")
    yield from change("long_name", "JOINT Chest", "JOINT " + "x" * 100_000)
    yield from change("nul_in_a_name", "JOINT Chest", "JOINT Ch\0est")
    yield from change("same_name", "JOINT Chest", "JOINT Hips")
    yield from change("brace_missing", "{", "")
    yield from change("brace_more", "{", "{{")
    yield from change("closed_early", "OFFSET", "}\n\tOFFSET")
    yield from change("never_closed", "}\nMOTION", "\nMOTION")
    yield from change("no_end_site", "End Site", "JOINT Tip")
    for value in ("nan", "inf", "1e300", "0x10", "--1", "word", ""):
        yield from change(f"offset_{value}", "OFFSET 0.000000 0.000000 1.000000", f"OFFSET 0.0 {value} 1.0")
        yield f"value_{value}", text.replace(rows[0].split()[0], value, 1).encode() if value else text.encode()[:-30]
    for value in ("0", "-1", "2", "7", "1000000000", "4294967302", "99999999999999999999", "six", ""):
        yield from change(f"channels_{value}", "CHANNELS 6", f"CHANNELS {value}")
        yield from change(f"frames_{value}", "Frames: 20", f"Frames: {value}")
    yield from change("channel_unknown", "Xposition", "Wposition")
    yield from change("channel_twice", "Yposition", "Xposition")
    for value in ("0", "-1", "nan", "inf", "1e-30", "1e30", "word", ""):
        yield from change(f"frame_time_{value}", "Frame Time: 0.033333", f"Frame Time: {value}")
    yield "row_short", (head + "MOTION\nFrames: 20\nFrame Time: 0.033333\n" + "\n".join(r[:40] for r in rows)).encode()
    yield "row_long", text.replace("\n" + rows[0], "\n" + rows[0] + " 1" * 100_000, 1).encode()
    deep = "".join(f"JOINT j{i}\n{{\nOFFSET 0 0 0.1\nCHANNELS 0\n" for i in range(20_000))
    yield "deep", text.replace("JOINT Chest", deep + "JOINT Chest", 1).encode()
    leaf = "\n{\nOFFSET 0 0 0.1\nCHANNELS 0\nEnd Site\n{\nOFFSET 0 0 1\n}\n}\n"
    wide = "".join(f"JOINT w{i}{leaf}" for i in range(70_000))
    yield "wide", text.replace("JOINT Chest", wide + "JOINT Chest", 1).encode()
