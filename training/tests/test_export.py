"""Bundles: what is written is what runs; a wrong file is refused."""
import dataclasses
import json

import numpy as np
import pytest
import torch

from conftest import train_tiny as run
from dcloth_training import (bundle, evaluate, export, network, reference, rig, safetensors_io,
                             sequence, stages)
from dcloth_training.motion import skeleton
from dcloth_training.simulate import crossings
from dcloth_training.stages import skeleton_stage

PAPER = [stage.name for stage in stages.up_to("mesh")]
LEVELS = [evaluate.LEVELS[stage] for stage in PAPER]


@pytest.fixture(scope="module")
def files(tiny, trained, tmp_path_factory):
    out = tmp_path_factory.mktemp("bundles")
    for name, half in (("whole", False), ("half", True)):
        net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
        bundle.write(out / name, net, fitted, character, provenance, half=half)
    return out


def item(tiny):
    return sequence.read(tiny / "dynamic" / "a-held.safetensors")


def test_bundle_tells_the_joints_above(tiny, trained, files, tmp_path):
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
    parents = np.arange(len(character.joint_names)) - 1    # of a NumPy type, which json refuses
    bundle.write(tmp_path / "told", net, fitted, dataclasses.replace(character, parents=parents), provenance)
    assert json.loads(safetensors_io.read(tmp_path / "told")[1]["parents"]) == parents.tolist()
    assert character.parents is None and "parents" not in safetensors_io.read(files / "half")[1]


@pytest.mark.parametrize("last", PAPER)
def test_bundle_runs_as_the_trained_network(tiny, trained, files, last):
    net, fitted, *_ = trained[0]
    read, rig, faces, _ = bundle.read(files / "whole")
    assert rig.bones == fitted.rig.bones and rig.feature_joints == fitted.rig.feature_joints
    matrices = item(tiny).joint_matrices
    expected = net.double().run(network.pose_of(matrices, fitted.rig), last)
    net.float()
    got = reference.run(read, rig, matrices, last)
    # Only W_I, statistics and geometry pass through float32, where they came from.
    assert (got - expected).abs().max() < 1e-6


def test_stages_differ_and_half_precision_stays_close(tiny, files):
    matrices = item(tiny).joint_matrices
    whole, rig, *_ = bundle.read(files / "whole")
    half, *_ = bundle.read(files / "half")
    by_stage = [reference.run(whole, rig, matrices, s) for s in PAPER]
    assert all((a - b).abs().max() > 1e-5 for a, b in zip(by_stage, by_stage[1:]))
    difference = (reference.run(half, rig, matrices) - by_stage[2]).abs().max()
    assert 0 < difference < 1e-3        # metres; 2^-11 of displacements of some decimetres


def test_bundle_has_no_more_influences_than_asked_for(files):
    for name in ("whole", "half"):
        weights = bundle.read(files / name)[0].static.weights()
        assert (weights > 0).sum(1).max() == 3 < weights.shape[1]


def test_recurrent_state_is_used(tiny, files):
    net, rig, *_ = bundle.read(files / "whole")
    matrices = item(tiny).joint_matrices
    later = reference.run(net, rig, matrices[5:], "skeleton")
    assert (later - reference.run(net, rig, matrices, "skeleton")[5:]).abs().max() > 1e-6


def test_intermediates_have_one_row_a_tick(tiny, files, tmp_path):
    path = tmp_path / "out.safetensors"
    reference.main([str(files / "half"), str(tiny / "dynamic" / "a-held.safetensors"), "-o",
                    str(path), "--intermediates", "--frames", "7"])
    tensors, metadata = safetensors_io.read(path)
    assert {k: v.shape for k, v in tensors.items()} == {
        "positions": (7, 60, 3), "features": (7, 49), "pivots": (7, 5, 3), "h_S": (7, 16),
        "Q": (7, 4)}
    assert metadata == {"stages": "mesh"}


def test_a_bundle_may_stop_after_stage_one(tiny, tmp_path):
    net, fitted, character, provenance = run(tiny, tmp_path / "t", "--stages", "static")
    bundle.write(tmp_path / "b", net, fitted, character, provenance)
    read, rig, *_ = bundle.read(tmp_path / "b")
    assert read.last_stage() == "static" and "skeleton.basis" not in safetensors_io.read(
        tmp_path / "b")[0]
    with pytest.raises(ValueError, match="stops after 'static'"):
        reference.run(read, rig, item(tiny).joint_matrices, "mesh")


def test_a_basis_of_few_directions_is_stored_as_factors(tiny, trained, tmp_path):
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
    generator = np.random.default_rng(2)
    low = generator.normal(size=(16, 3)) @ generator.normal(size=(3, 180)) * 0.01
    with torch.no_grad():
        net.skeleton.basis.copy_(torch.from_numpy(low.reshape(16, 60, 3)))
    bundle.write(tmp_path / "b", net, fitted, character, provenance, half=False)
    tensors, _ = safetensors_io.read(tmp_path / "b")
    assert tensors["skeleton.readout"].shape == (16, 3) and tensors["skeleton.components"].shape == (3, 60, 3)
    assert "skeleton.basis" not in tensors
    read, *_ = bundle.read(tmp_path / "b")
    assert np.abs(read.skeleton.basis.detach().numpy().reshape(16, -1) - low).max() < 1e-8
    assert skeleton_stage.factors(generator.normal(size=(16, 60, 3))) is None
    tensors, metadata = safetensors_io.read(tmp_path / "b")
    del tensors["skeleton.readout"]
    safetensors_io.write(tmp_path / "bad", tensors, metadata)
    with pytest.raises(bundle.BundleError, match="belong together"):
        bundle.read(tmp_path / "bad")


@pytest.mark.parametrize("change,message", [
    (lambda t, m: m.update(format="other"), "format 'other'"),
    (lambda t, m: m.update(hips="Tail"), "Tail"),
    (lambda t, m: t.pop("static.mlp.0.weight"), "static.mlp.0.weight"),
    (lambda t, m: t.update({"skeleton.gru.bias_hh": np.zeros(3, np.float16)}), "found \\[3\\]"),
    (lambda t, m: t.pop("nearest.points"), "nearest.points"),
    (lambda t, m: t.update({"mesh.mlp.2.bias": np.zeros((4, 1), np.float32)}), "mesh.mlp.2.bias")])
def test_wrong_bundles_are_refused_by_name(files, tmp_path, change, message):
    tensors, metadata = safetensors_io.read(files / "half")
    change(tensors, metadata)
    safetensors_io.write(tmp_path / "bad", tensors, metadata)
    with pytest.raises(bundle.BundleError, match=message):
        bundle.read(tmp_path / "bad")


def touching(tiny, path, change=lambda t: None):
    """The tiny character, whose cloth touches parts of its body."""
    tensors, metadata = safetensors_io.read(tiny / "character.safetensors")
    tensors["cloth_touches"] = np.arange(len(tensors["cloth_template"]), dtype=np.int32) % 3
    tensors["body_parts"] = 1 + np.arange(len(tensors["body_vertices"]), dtype=np.int32) % 2
    change(tensors)
    safetensors_io.write(path, tensors, metadata)
    return rig.read_character(path)


def test_what_cloth_touches_goes_from_the_data_into_the_bundle(tiny, trained, files, tmp_path):
    character = touching(tiny, tmp_path / "character.safetensors")
    net, fitted, _, provenance = trained[0]
    bundle.write(tmp_path / "b", net, fitted, character, provenance)
    tensors, _ = safetensors_io.read(tmp_path / "b")
    for name, value in (("template.touches", character.touches), ("body.parts", character.body_parts)):
        assert tensors[name].dtype == np.int32 and np.array_equal(tensors[name], value)
    bundle.read(tmp_path / "b")
    assert not {"template.touches", "body.parts"} & safetensors_io.read(files / "half")[0].keys()


def test_a_texture_goes_from_the_data_into_the_bundle(tiny, trained, files, tmp_path):
    def add(tensors):
        tensors["cloth_texture"] = np.random.default_rng(1).random((*tensors["cloth_faces"].shape, 2), np.float32)
    character = touching(tiny, tmp_path / "character.safetensors", add)
    net, fitted, _, provenance = trained[0]
    bundle.write(tmp_path / "b", net, fitted, character, provenance)
    written = safetensors_io.read(tmp_path / "b")[0]["template.texture_coordinates"]
    assert written.dtype == np.float16 and np.abs(written - character.texture).max() < 2.5e-4
    assert "template.texture_coordinates" not in safetensors_io.read(files / "half")[0]
    for spoilt in (lambda t: t.update(cloth_texture=t["cloth_texture"][:-1]),
                   lambda t: t["cloth_texture"].__setitem__((0, 0, 0), np.nan)):
        with pytest.raises(safetensors_io.SafetensorsError, match="not a character.*cloth_texture"):
            touching(tiny, tmp_path / "character.safetensors", lambda t: (add(t), spoilt(t)))


@pytest.mark.parametrize("name,change", [
    ("cloth_touches", lambda t: t.pop("cloth_touches")),
    ("body_parts", lambda t: t.pop("body_parts")),
    ("cloth_touches", lambda t: t.update(cloth_touches=t["cloth_touches"][:-1])),
    ("body_parts", lambda t: t.update(body_parts=t["body_parts"].astype(np.float32))),
    ("body_parts", lambda t: t.update(body_parts=-t["body_parts"]))])
def test_a_character_with_half_of_its_parts_is_refused(name, change, tiny, tmp_path):
    with pytest.raises(safetensors_io.SafetensorsError, match=f"not a character.*{name}"):
        touching(tiny, tmp_path / "character.safetensors", change)


def test_weights_beyond_half_precision_are_refused(tiny, trained, tmp_path):
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
    with torch.no_grad():
        net.mesh.mlp[0].bias[0] = 1e6
    with pytest.raises(bundle.BundleError, match="mesh.mlp.0.bias.*--float32"):
        bundle.write(tmp_path / "b", net, fitted, character, provenance)
    assert not (tmp_path / "b").exists()


def test_compact_sequences_keep_the_truth(tiny, tmp_path):
    source = tiny / "dynamic" / "a-held.safetensors"
    export.main(["sequence", str(source), "-o", str(tmp_path / "c")])
    before, after = sequence.read(source), sequence.read(tmp_path / "c")
    assert np.array_equal(before.joint_matrices, after.joint_matrices)
    # Within 1 m of the hips: half a unit in the last place of float16 is 2^-12 m below 1 m.
    assert np.abs(before.truth - after.truth).max() <= 2.0 ** -12 + 1e-7
    assert (tmp_path / "c").stat().st_size < source.stat().st_size


def test_evaluation_lists_every_level(tiny, files, tmp_path, capsys):
    evaluate.main([str(files / "half"), str(tiny / "dynamic" / "a-held.safetensors"), "-o",
                   str(tmp_path / "e")])
    results = json.loads((tmp_path / "e.json").read_text())
    assert list(results["a/held"]) == ["truth", evaluate.SCALE, evaluate.PLAIN, *LEVELS]
    said = capsys.readouterr().out
    assert "recorded clips" in said and "a/held" in said and "scripted" not in said
    row = results["a/held"]
    assert row["truth"]["alive_mm"] > 1 and row["truth"]["penetration"].keys() == {"area_share", "p99_mm"}
    for name in list(row)[1:]:
        found = row[name]
        assert found["relative_error"] == found["position_mm"]["mean"] / row["truth"]["alive_mm"]
        assert found["crossings"]["body"] >= 0 and 0 <= found["penetration"]["area_share"] <= 1
        assert found["jitter"]["held_mm"] < 0.5 and set(found["bands"]) == {"coarse", "middle", "fine"}
    assert row[evaluate.SCALE]["bands"]["coarse"]["energy_ratio"] < 1e-3
    # Counted by hand: cloth and body triangles of a frame that cross.
    referee = evaluate.Referee(files / "half")
    item = sequence.read(tiny / "dynamic" / "a-held.safetensors")
    body = skeleton.skin(*referee.bind, item.joint_matrices[12::5].astype(np.float64))
    faces = safetensors_io.read(files / "half")[0]["body.faces"]
    pairs = [len(crossings.between(cloth, referee.faces, posed, faces))
             for cloth, posed in zip(item.truth[12::5], body)]
    assert row["truth"]["crossings"]["body"] == sum(pairs) / len(pairs) > 0
    assert (tmp_path / "e.png").exists() and (tmp_path / "e.txt").exists()
