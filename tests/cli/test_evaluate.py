"""evaluate: JSON of the contract, table, metrics recomputed by hand."""
import json

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
    assert list(rows) == ["skinning", "int8/static", "int8/skeleton", "fp32", "fp16", "int8", "int8/outside"]
    assert [v["stages"] for v in rows.values()] == ["none", "static", "skeleton", "mesh", "mesh", "mesh", "mesh"]
    for name, row in rows.items():
        mesh_error(row["truth"])
        mesh_error(row["fp32"])
        assert row["truth"]["frames"] == 70
        if name == "skinning":
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
        mean = sum(p["position_mm"]["mean"] * p["frames"] for p in parts) / sum(p["frames"] for p in parts)
        assert row["truth"]["position_mm"]["mean"] == pytest.approx(mean, rel=1e-9)


def test_plain_skinning_is_linear_blend_skinning(said):
    poses = np.concatenate([small_garment.motion(40, 30), small_garment.motion(30, 30, speed=1.6)]).astype(np.float32)
    weights = small_garment.bundle_tensors()["static.initial_weights"].astype(float)
    points = small_garment.bundle_tensors()["template.positions"].astype(float)
    skinned = small_garment.skin(points, weights / weights.sum(1, keepdims=True), small_garment.BONES, poses.astype(float))
    truth = np.concatenate([small_garment.lagging_truth(small_garment.motion(40, 30)),
                            small_garment.lagging_truth(small_garment.motion(30, 30, speed=1.6))])
    distance = np.linalg.norm(skinned - truth.astype(np.float32), axis=-1) * 1000
    row = said["variants"][0]["truth"]["position_mm"]
    # Float inputs and outputs of at most 4 m: 12 roundings of 2^-24 * 4 m each.
    bound = 12 * 4000 * 2.0 ** -24
    assert abs(row["mean"] - distance.mean()) <= bound and abs(row["max"] - distance.max()) <= bound
    assert abs(row["std"] - distance.mean(1).std()) <= bound


def test_error_matches_what_run_writes(dcloth, files, said, tmp_path):
    out = tmp_path / "x.safetensors"
    assert dcloth("run", files.model, files.walk, "-o", out).returncode == 0
    positions = safetensors_file.read(out)[0]["positions"].astype(float)
    truth = safetensors_file.read(files.walk)[0]["truth"].astype(float)
    mean = np.linalg.norm(positions - truth, axis=-1).mean() * 1000
    row = said["sequences"][0]["variants"][3]
    assert row["name"] == "fp32" and row["truth"]["position_mm"]["mean"] == pytest.approx(mean, rel=1e-6)


def test_chosen_precisions_in_their_order(dcloth, files):
    said = json.loads(dcloth("evaluate", files.bundle, files.bare, "--precision", "int8", "--precision", "fp16", "--json").stdout)
    assert [v["name"] for v in said["variants"]] == ["skinning", "fp16/static", "fp16/skeleton", "int8", "fp16",
                                                    "fp16/outside"]
    assert all(v["truth"] is None for v in said["variants"])
    assert said["variants"][3]["fp32"]["position_mm"]["mean"] > 0


def test_a_faster_sequence_is_read_at_the_tick_rate(dcloth, files, tmp_path):
    path = tmp_path / "fast.safetensors"
    small_garment.write_sequence(path, small_garment.motion(41, 60), fps=60)
    said = json.loads(dcloth("evaluate", files.bundle, path, "--precision", "fp32", "--json").stdout)
    assert said["sequences"][0]["ticks"] == 21


def test_table(dcloth, files):
    result = dcloth("evaluate", files.bundle, files.walk)
    lines = result.stdout.rstrip("\n").split("\n")
    assert len(lines) == 9 and len({len(line) for line in lines}) == 1, "columns are not aligned"
    for word in ("variant", "E_d mm", "E_n deg", "skinning", "int8/skeleton", "fp16"):
        assert word in result.stdout
