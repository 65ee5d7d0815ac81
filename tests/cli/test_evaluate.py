"""evaluate: JSON of the contract, table, metrics recomputed by hand."""
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import safetensors_file
import small_garment
from checks import STEPS, mesh_error, percentiles


@pytest.fixture(scope="module")
def said(dcloth, files):
    result = dcloth("evaluate", files.bundle, files.walk, files.run, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_variants(said, files):
    rows = {v["name"]: v for v in said["variants"]}
    assert list(rows) == ["rigid", "skinning", "int8/static", "int8/skeleton", "fp32", "fp16", "int8", "int8/outside"]
    assert [v["stages"] for v in rows.values()] == ["none", "none", "static", "skeleton", "mesh", "mesh", "mesh",
                                                    "mesh"]
    for name, row in rows.items():
        mesh_error(row["truth"])
        mesh_error(row["fp32"])
        assert row["truth"]["frames"] == 70 - 2 * 12 and row["truth"]["clips"] == 2
        assert row["recorded"] == row["truth"] and row["scripted"] is None
        if name in ("rigid", "skinning"):
            assert row["model_bytes"] is None and row["tick_ms"] is None
            continue
        percentiles(row["tick_ms"])
        percentiles(row["tick_warm_ms"])
        assert set(row["stages_ms"]) == STEPS
        assert row["instance_bytes"] > 0
    assert rows["fp32"]["model_bytes"] == files.model.stat().st_size
    assert rows["fp32"]["fp32"]["position_mm"]["max"] == 0
    assert 0 < rows["fp16"]["fp32"]["position_mm"]["mean"] < rows["int8"]["fp32"]["position_mm"]["mean"]
    assert said["cpu"] and said["isa"]


def test_sequences(said):
    assert [s["name"] for s in said["sequences"]] == ["walk", "run"]
    names = [v["name"] for v in said["variants"]]
    for sequence in said["sequences"]:
        assert [v["name"] for v in sequence["variants"]] == names
    for i, row in enumerate(said["variants"]):
        parts = [s["variants"][i]["truth"] for s in said["sequences"]]
        errors, alive = ([p[key] if key else p["position_mm"]["mean"] for p in parts] for key in ("", "alive_mm"))
        assert row["truth"]["position_mm"]["mean"] == pytest.approx(sum(errors) / 2, rel=1e-9)
        assert row["truth"]["relative_error"] == pytest.approx(sum(errors) / sum(alive), rel=1e-9)


def test_measures_are_those_of_training(said, files, dcloth, tmp_path):
    """The same numbers from training's metrics.py, of the positions that `run` writes."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "training"))
    from dcloth_training import metrics
    tensors = small_garment.bundle_tensors()
    mesh = metrics.Mesh(tensors["template.faces"], tensors["template.positions"])
    hips = json.loads(safetensors_file.read(files.walk)[1]["joint_names"]).index("hips")
    row = said["sequences"][0]["variants"][4]
    assert row["name"] == "fp32" and said["sequences"][0]["source"] == "recorded"
    read = safetensors_file.read(files.walk)[0]
    out = tmp_path / "x.safetensors"
    assert dcloth("run", files.model, files.walk, "-o", out).returncode == 0
    truth = metrics.Truth(read["truth"], read["joint_matrices"][:, hips], mesh)
    wanted = {**metrics.clip(safetensors_file.read(out)[0]["positions"], truth), **{
        key: truth.measures()[key] for key in ("fine_motion_mm",)}}
    found = row["truth"]
    assert found["alive_mm"] > 1 and found["jitter"]["held_mm"] >= 0 and found["calm_mm"] == wanted["calm_mm"]
    for key in ("alive_mm", "predicted_alive_mm", "relative_error", "offset_mm", "motion_error_mm",
                "relative_motion_error", "fine_motion_mm"):
        assert found[key] == pytest.approx(wanted[key], rel=1e-4), key
    assert found["strain_p99"] == pytest.approx(wanted["strain_p99"], rel=0.05)     # nearest rank, there interpolated
    assert found["jitter"]["ratio"] == pytest.approx(wanted["jitter"]["ratio"], rel=1e-4)
    assert found["normal_deg"]["mean"] == pytest.approx(wanted["normal_deg"]["mean"], rel=1e-4)
    for name, band in wanted["bands"].items():
        for key in ("error_mm", "energy_ratio"):
            assert found["bands"][name][key] == pytest.approx(band[key], rel=1e-3), (name, key)


def test_rigid_hips_are_the_template_moved_by_the_hips(said, files):
    read, metadata = safetensors_file.read(files.walk)[:2]
    hips = read["joint_matrices"][:, json.loads(metadata["joint_names"]).index("hips")].astype(float)
    tensors = small_garment.bundle_tensors()
    bind = tensors["character.bind"][small_garment.JOINTS.index("hips")].astype(float)
    relative, points = hips @ np.linalg.inv(bind), tensors["template.positions"].astype(float)
    positions = np.einsum("tij,nj->tni", relative[:, :3, :3], points) + relative[:, None, :3, 3]
    distance = 1000 * np.linalg.norm(positions - read["truth"], axis=-1)[12:]
    row = said["sequences"][0]["variants"][0]
    assert row["name"] == "rigid" and row["truth"]["position_mm"]["mean"] == pytest.approx(distance.mean(), rel=1e-4)
    assert row["truth"]["bands"]["fine"]["energy_ratio"] < 0.01


def test_recorded_and_scripted_are_two_tables(dcloth, files, tmp_path):
    path = tmp_path / "scripted.safetensors"
    tensors, metadata = safetensors_file.read(files.walk)[:2]
    safetensors_file.write(path, tensors, {**metadata, "clip": "procedural/walk"})
    result = dcloth("evaluate", files.bundle, path, files.run, "--precision", "fp32", "--json")
    said = json.loads(result.stdout)
    assert [s["source"] for s in said["sequences"]] == ["scripted", "recorded"]
    for i, row in enumerate(said["variants"]):
        for source, s in zip(("scripted", "recorded"), said["sequences"]):
            assert row[source] == s["variants"][i]["truth"] and row[source]["clips"] == 1
    for line in ("1 recorded clip; the truth moves by", "1 scripted clip; the truth moves by"):
        assert line in result.stderr


def test_plain_skinning_is_linear_blend_skinning(said):
    poses = np.concatenate([small_garment.motion(40, 30), small_garment.motion(30, 30, speed=1.6)]).astype(np.float32)
    weights = small_garment.bundle_tensors()["static.initial_weights"].astype(float)
    points = small_garment.bundle_tensors()["template.positions"].astype(float)
    skinned = small_garment.skin(points, weights / weights.sum(1, keepdims=True), small_garment.BONES,
                                 poses.astype(float))
    truth = np.concatenate([small_garment.lagging_truth(small_garment.motion(40, 30)),
                            small_garment.lagging_truth(small_garment.motion(30, 30, speed=1.6))])
    distance = np.linalg.norm(skinned - truth.astype(np.float32), axis=-1) * 1000
    walk, run = distance[12:40], distance[52:]      # every clip weighs the same; the first frames do not count
    row = said["variants"][1]["truth"]["position_mm"]
    # Float inputs and outputs of at most 4 m: 12 roundings of 2^-24 * 4 m each.
    bound = 12 * 4000 * 2.0 ** -24
    counted = np.concatenate([walk, run])
    assert abs(row["mean"] - (walk.mean() + run.mean()) / 2) <= bound and abs(row["max"] - counted.max()) <= bound


def test_error_matches_what_run_writes(dcloth, files, said, tmp_path):
    out = tmp_path / "x.safetensors"
    assert dcloth("run", files.model, files.walk, "-o", out).returncode == 0
    positions = safetensors_file.read(out)[0]["positions"].astype(float)
    truth = safetensors_file.read(files.walk)[0]["truth"].astype(float)
    mean = np.linalg.norm(positions - truth, axis=-1)[12:].mean() * 1000
    row = said["sequences"][0]["variants"][4]
    assert row["name"] == "fp32" and row["truth"]["position_mm"]["mean"] == pytest.approx(mean, rel=1e-6)


def test_chosen_precisions_in_their_order(dcloth, files):
    said = json.loads(dcloth("evaluate", files.bundle, files.bare, "--precision", "int8", "--precision", "fp16",
                             "--json").stdout)
    assert [v["name"] for v in said["variants"]] == ["rigid", "skinning", "fp16/static", "fp16/skeleton", "int8",
                                                    "fp16", "fp16/outside"]
    assert all(v["truth"] is None for v in said["variants"])
    assert said["variants"][4]["fp32"]["position_mm"]["mean"] > 0


def test_a_faster_sequence_is_read_at_the_tick_rate(dcloth, files, tmp_path):
    path = tmp_path / "fast.safetensors"
    small_garment.write_sequence(path, small_garment.motion(41, 60), fps=60)
    said = json.loads(dcloth("evaluate", files.bundle, path, "--precision", "fp32", "--json").stdout)
    assert said["sequences"][0]["ticks"] == 21


def test_table(dcloth, files):
    result = dcloth("evaluate", files.bundle, files.walk)
    lines = result.stdout.rstrip("\n").split("\n")
    assert "1 recorded clip; the truth moves by" in lines.pop(0)
    assert len(lines) == 10 and len({len(line) for line in lines}) == 1, "columns are not aligned"
    for word in ("variant", "E_d mm", "of motion", "E_n deg", "rigid", "skinning", "int8/skeleton", "fp16"):
        assert word in result.stdout
