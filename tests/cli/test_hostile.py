"""Broken and wrong inputs: refused by name, never a crash, nothing left behind."""
import io
import json
import pickle
import re
import subprocess
import sys
import unicodedata
import zipfile

import numpy as np
import pytest

import safetensors_file
import small_garment
from checks import leftovers, refused


@pytest.mark.parametrize("part", [0, 1, 3, 8, 100, 0.25, 0.5, 0.9, -1])
def test_truncated_model(dcloth, files, tmp_path, part):
    data = files.model.read_bytes()
    length = int(len(data) * part) if isinstance(part, float) else part if part >= 0 else len(data) + part
    cut = tmp_path / "cut.dcloth"
    cut.write_bytes(data[:length])
    refused(dcloth("inspect", cut), cut)
    out = tmp_path / "out.safetensors"
    refused(dcloth("run", cut, files.walk, "-o", out), cut)
    assert leftovers(tmp_path, {"cut.dcloth"}) == []


@pytest.mark.parametrize("length, words", [(0, ["0 bytes"]), (64, ["expected"]), (6400, ["weights", "at byte"])])
def test_what_the_engine_says_of_a_model_is_said_once(dcloth, files, tmp_path, length, words):
    cut = tmp_path / "cut.dcloth"
    cut.write_bytes(files.model.read_bytes()[:length])
    result = dcloth("inspect", cut)
    refused(result, cut, "found", "expected", *words)
    assert result.stderr.count("found") == 1 and result.stderr.count("convert the bundle again") <= 1
    assert "null pointer" not in result.stderr and "allowed:" not in result.stderr


def test_flipped_bits_are_refused_or_harmless(dcloth, files, tmp_path):
    """One flipped bit may hit a weight and stay a valid model; it must never kill the tool."""
    data = bytearray(files.model.read_bytes())
    random = np.random.default_rng(3)
    head = min(len(data), 6000)  # tables lie at an end of the file: flip there, and across
    places = np.concatenate([random.integers(0, head, 40), len(data) - 1 - random.integers(0, head, 40),
                             random.integers(0, len(data), 20)])
    codes = set()
    for at in places:
        flipped = bytearray(data)
        flipped[at] ^= 1 << int(random.integers(8))
        path = tmp_path / "flipped.dcloth"
        path.write_bytes(flipped)
        result = dcloth("inspect", path)
        assert result.returncode in (0, 2)
        if result.returncode == 2:
            refused(result, path)
        codes.add(result.returncode)
    assert 2 in codes, "no flip was refused: the flips missed every table"


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_numbers_in_poses(dcloth, files, tmp_path, bad):
    poses = small_garment.motion(10, 30)
    poses[5, 2, 1, 3] = bad
    path = tmp_path / "bad.safetensors"
    small_garment.write_sequence(path, poses, truth=False)
    refused(dcloth("run", files.model, path, "-o", tmp_path / "x.pc2"), path, "joint_matrices")
    refused(dcloth("profile", files.model, path), path, "joint_matrices")
    assert leftovers(tmp_path, {"bad.safetensors"}) == []


def test_joints_of_another_character(dcloth, files, tmp_path):
    path = tmp_path / "other.safetensors"
    small_garment.write_sequence(path, small_garment.motion(10, 30),
                                 names=["bone_" + n for n in small_garment.JOINTS], truth=False)
    for arguments in (["run", files.model, path, "-o", tmp_path / "x.pc2"], ["profile", files.model, path],
                      ["evaluate", files.bundle, path]):
        refused(dcloth(*arguments), path, "hips")
    assert leftovers(tmp_path, {"other.safetensors"}) == []


def test_joint_order_does_not_matter(dcloth, files, tmp_path):
    poses = small_garment.motion(10, 30)
    order = [6, 2, 0, 5, 1, 4, 3]
    straight, shuffled = tmp_path / "a.safetensors", tmp_path / "b.safetensors"
    small_garment.write_sequence(straight, poses, truth=False)
    small_garment.write_sequence(shuffled, poses[:, order], names=[small_garment.JOINTS[i] for i in order], truth=False)
    outputs = []
    for path in (straight, shuffled):
        out = tmp_path / (path.stem + "_out.safetensors")
        assert dcloth("run", files.model, path, "-o", out).returncode == 0
        outputs.append(safetensors_file.read(out)[0]["positions"])
    assert np.array_equal(*outputs)


def test_truth_of_another_garment(dcloth, files, tmp_path):
    poses = small_garment.motion(10, 30)
    path = tmp_path / "other.safetensors"
    small_garment.write_sequence(path, poses, changes={"truth": np.zeros((10, 77, 3), np.float32)})
    for arguments in (["evaluate", files.bundle, path], ["profile", files.model, path]):
        refused(dcloth(*arguments), path, "77", str(small_garment.VERTICES))


def test_frame_rate_that_is_no_multiple(dcloth, files, tmp_path):
    path = tmp_path / "slow.safetensors"
    small_garment.write_sequence(path, small_garment.motion(10, 24), fps=24)
    html = tmp_path / "x.html"
    refused(dcloth("evaluate", files.bundle, path, "--html", html), path, "24", "tick rate")
    assert not html.exists()


def zip_of(name):
    packed = io.BytesIO()
    zipfile.ZipFile(packed, "w").writestr(name, b"")
    return packed.getvalue()


FOREIGN = {
    "a Git LFS pointer": (b"version https://git-lfs.github.com/spec/v1\noid sha256:" + 64 * b"0" + b"\nsize 15483236\n",
                          "git lfs pull"),
    "a file of torch.save": (zip_of("archive/data.pkl"), "torch.load('old.pt', weights_only=True)"),
    "a pickle, as torch.save writes": (pickle.dumps({"mesh.basis": 64 * [0.5]}, 2), "torch.load('old.pt'"),
    "an ONNX file": (b"\x08\x07\x12\x07pytorch\x1a\x052.1.0:" + bytes(64), "converter/BUNDLE.md"),
    "a zip archive": (zip_of("skirt.safetensors"), "unpack"),
    "a web page": (b"<!DOCTYPE html><html><title>Sign in</title></html>", "the file itself"),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_files_of_other_programs_are_named(dcloth, files, tmp_path, kind):
    path = tmp_path / "theirs.safetensors"
    path.write_bytes(FOREIGN[kind][0])
    for arguments in (["convert", path, "-o", tmp_path / "x.dcloth"], ["evaluate", path, files.walk],
                      ["run", files.model, path, "-o", tmp_path / "x.pc2"], ["inspect", path]):
        result = dcloth(*arguments)
        refused(result, path, f"found {kind}, expected", FOREIGN[kind][1])
        assert len(result.stderr.splitlines()) == 1
    assert leftovers(tmp_path, {"theirs.safetensors"}) == []


def mended(said, folder):
    """What the command in the message makes of old.safetensors."""
    command = re.search(r'python3 -c "([^"]+)"', said).group(1)
    subprocess.run([sys.executable, "-c", command], cwd=folder, check=True)
    return folder / "new.safetensors"


@pytest.mark.parametrize("prefix, whose", [("_orig_mod.", "torch.compile"), ("module.", "torch.nn.DataParallel")])
@pytest.mark.parametrize("place", ["", "mesh."])
def test_prefixes_of_wrappers_are_named(dcloth, files, tmp_path, prefix, whose, place):
    tensors, metadata = safetensors_file.read(files.bundle)
    wrapped = {name.replace(place, place + prefix, 1) if name.startswith(place) else name: value
               for name, value in tensors.items()}
    safetensors_file.write(tmp_path / "old.safetensors", wrapped, metadata)
    result = dcloth("convert", tmp_path / "old.safetensors", "-o", tmp_path / "x.dcloth")
    refused(result, f"the prefix '{prefix}' of {whose}")
    assert len(result.stderr.splitlines()) == 1
    pytest.importorskip("safetensors.torch")
    assert dcloth("convert", mended(result.stderr, tmp_path), "-o", tmp_path / "x.dcloth").returncode == 0
    assert (tmp_path / "x.dcloth").read_bytes() == files.model.read_bytes()


@pytest.mark.parametrize("name, dtype", [("mesh.mlp.0.weight", "F64"), ("mesh.mlp.0.weight", "BF16"),
                                         ("template.positions", "F64"), ("template.positions", "F16"),
                                         ("template.faces", "I64")])
def test_dtypes_that_must_be_cast_are_named(dcloth, files, tmp_path, name, dtype):
    tensors, metadata = safetensors_file.read(files.bundle)
    value = tensors[name]
    if dtype == "BF16":
        value = (value.view(np.uint32) & 0xFFFF0000).view(np.float32)
        tensors[name] = value
        safetensors_file.write(tmp_path / "wanted.safetensors", tensors, metadata)
        value = (value.view(np.uint32) >> 16).astype(np.uint16)
    elif dtype == "F16":
        value = value.astype(np.float16)
        safetensors_file.write(tmp_path / "wanted.safetensors", {**tensors, name: value.astype(np.float32)}, metadata)
    else:
        safetensors_file.write(tmp_path / "wanted.safetensors", tensors, metadata)
        value = value.astype({"F64": np.float64, "I64": np.int64}[dtype])
    safetensors_file.write(tmp_path / "old.safetensors", {**tensors, name: value}, metadata)
    result = dcloth("convert", tmp_path / "old.safetensors", "-o", tmp_path / "x.dcloth")
    refused(result, f"tensor {name}: found dtype {dtype}", "python3 -c")
    assert len(result.stderr.splitlines()) == 1
    pytest.importorskip("safetensors.torch")
    models = []
    for bundle in (mended(result.stderr, tmp_path), tmp_path / "wanted.safetensors"):
        assert dcloth("convert", bundle, "-o", tmp_path / "x.dcloth").returncode == 0
        models.append((tmp_path / "x.dcloth").read_bytes())
    assert models[0] == models[1]


def test_an_existing_output_survives_a_failure(dcloth, files, tmp_path):
    out = tmp_path / "kept.dcloth"
    out.write_bytes(b"precious")
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(files.bundle.read_bytes()[:-7])
    refused(dcloth("convert", broken, "-o", out), broken)
    assert out.read_bytes() == b"precious"


@pytest.mark.parametrize("fps", [1e-300, 1e-9])
def test_a_sequence_that_claims_to_last_for_ages(dcloth, files, tmp_path, fps):
    path = tmp_path / "slow.safetensors"
    small_garment.write_sequence(path, small_garment.motion(2, 30), fps=fps, truth=False)
    for arguments in (["run", files.model, path, "-o", tmp_path / "x.pc2"], ["profile", files.model, path]):
        refused(dcloth(*arguments, timeout=60), path, "fps", "frames")
    assert leftovers(tmp_path, {"slow.safetensors"}) == []


def test_weights_that_diverged(dcloth, files, tmp_path):
    """Finite weights whose products are not: no file full of NaN."""
    bundle, model = tmp_path / "b.safetensors", tmp_path / "m.dcloth"
    weight = small_garment.bundle_tensors()["static.mlp.2.weight"]
    small_garment.write_bundle(bundle, changes={"static.mlp.2.weight": np.full_like(weight, 3e38),
                                                "static.mlp.0.bias": np.full(small_garment.HIDDEN, 9, np.float32)})
    assert dcloth("convert", bundle, "-o", model).returncode == 0
    for name in ("x.pc2", "x.html", "x.safetensors"):
        refused(dcloth("run", model, files.bare, "-o", tmp_path / name), model, "NaN or infinity", "frame 0")
    assert leftovers(tmp_path, {"b.safetensors", "m.dcloth"}) == []


def test_names_give_no_orders_to_a_terminal(dcloth, tmp_path):
    """ESC [ 2 J clears a screen, ESC ] 0 ; renames a window, U+009B is ESC [ in one; a line break forges a line of a
    log."""
    garment, joint = "cone\x1b[2J\nskirt\u009b31m", "head\x1b]0;mine\x07\x7f"
    names = [joint if name == "head" else name for name in small_garment.JOINTS]
    bundle, model, sequence = tmp_path / "b.safetensors", tmp_path / "m.dcloth", tmp_path / "s.safetensors"
    small_garment.write_bundle(bundle)
    tensors, metadata = safetensors_file.read(bundle)
    safetensors_file.write(bundle, tensors, {**metadata, "garment": garment, "joint_names": json.dumps(names)})
    small_garment.write_sequence(sequence, small_garment.motion(10, 30), names=names)
    assert dcloth("convert", bundle, "-o", model).returncode == 0
    for arguments in (["inspect", model], ["profile", model, sequence],
                      ["run", model, sequence, "-o", tmp_path / "x.pc2"],
                      ["evaluate", bundle, sequence, "--precision", "int8"]):
        done = dcloth(*arguments)
        assert done.returncode == 0
        said = (done.stdout + done.stderr).replace("\n", "")
        assert [c for c in said if unicodedata.category(c) == "Cc"] == [], arguments[0]
    assert "cone?[2J?skirt?31m" in dcloth("inspect", model).stdout
    described = json.loads(dcloth("inspect", model, "--json").stdout)
    assert described["garment"] == garment and joint in described["joints"]  # data stay as they are
