"""Broken and wrong inputs: refused by name, never a crash, nothing left behind."""
import json
import unicodedata

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


def test_a_bundle_is_no_model_and_a_model_no_bundle(dcloth, files, tmp_path):
    refused(dcloth("inspect", files.bundle), files.bundle)
    refused(dcloth("convert", files.model, "-o", tmp_path / "x.dcloth"), files.model)
    refused(dcloth("run", files.model, files.bundle, "-o", tmp_path / "x.pc2"), files.bundle)
    assert leftovers(tmp_path, set()) == []


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


def test_an_existing_output_survives_a_failure(dcloth, files, tmp_path):
    out = tmp_path / "kept.dcloth"
    out.write_bytes(b"precious")
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(files.bundle.read_bytes()[:-7])
    refused(dcloth("convert", broken, "-o", out), broken)
    assert out.read_bytes() == b"precious"


def test_wrong_shape_in_a_bundle_is_named(dcloth, tmp_path):
    path = tmp_path / "wrong.safetensors"
    small_garment.write_bundle(path, changes={"skeleton.basis": np.zeros((5, 7, 3), np.float32)})
    refused(dcloth("convert", path, "-o", tmp_path / "x.dcloth"), path, "skeleton.basis", "[5, 7, 3]")


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
