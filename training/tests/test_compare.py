"""The comparison's command on the tiny garment: every row, resumed bits, refusals, the table."""
import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from conftest import NAMES, hang, poses, tube
from dcloth_training import bundle, checkpoint, evaluate, export, loop, sequence, train
from dcloth_training.compare import __main__ as command
from dcloth_training.compare import keep, rows, table

CLOTH = tube(0.2, 6, 10, 1.0, 0.5)[0]


def add_clip(folder, name, seed):
    matrices = poses(30, np.random.default_rng(seed)).astype(np.float32)
    truth = hang(matrices.astype(np.float64), CLOTH)
    sequence.write(folder / "dynamic" / f"{name.replace('/', '-')}.safetensors",
                   sequence.Sequence(matrices, truth, NAMES, 30.0, name, "dynamic"))


@pytest.fixture(scope="module")
def data(tiny, tmp_path_factory):
    """The tiny folder with the two clips more that its training held out."""
    folder = tmp_path_factory.mktemp("compare") / "data"
    shutil.copytree(tiny, folder)
    add_clip(folder, "a/unseen", 11)
    add_clip(folder, "a/later", 12)
    return folder


def run(data, full, out, *more):
    return command.run(command.arguments(["--data", str(data), "--full", str(full),
                                          "--out", str(out), *more]))


@pytest.fixture(scope="module")
def finished(data, trained, tmp_path_factory):
    """(table, folder) of all rows on one of the two held-out clips."""
    out = tmp_path_factory.mktemp("finished")
    return run(data, trained[1], out, "--clips", "a/unseen"), out


def by_key(found):
    return {row["key"]: row for row in found["rows"]}


def weights(folder):
    """Everything that a row's training left, as tensors in a fixed order."""
    saved, out = checkpoint.load(str(folder / "network.safetensors")), []
    for part in ("state", "fixed"):
        out += [saved[part][k] for k in sorted(saved.get(part, {}))]
    assert out
    return out


def test_the_table_has_every_row_and_every_number(finished):
    found, out = finished
    told = [row for row in rows.ROWS if row.key != "patches"]     # the tiny character has no limbs
    assert [r["key"] for r in found["rows"]] == [r.key for r in told]
    assert len({r.key for r in rows.ROWS}) == len(rows.ROWS) == 13
    assert any("patches: left out, the character has no parents" in remark for remark in found["remarks"])
    for row in found["rows"]:
        average = row["average"]["recorded"]
        assert average["position_mm"]["mean"] <= average["position_mm"]["p99"]
        assert average["relative_error"] == pytest.approx(average["position_mm"]["mean"] / average["alive_mm"])
        for band in ("coarse", "middle", "fine"):
            assert np.isfinite([average["bands"][band][key] for key in ("error_mm", "energy_ratio")]).all()
        assert (row["parameters"] == 0) == (row["group"] == "scale")
        assert row["minutes"] is not None
    text = (out / "table.md").read_text()
    assert all(f"| {row.title} | " in text and f"- {row.title}: " in text for row in told)
    assert json.loads((out / "table.json").read_text()) == found
    assert (out / "table.png").read_bytes()[:4] == b"\x89PNG"


def test_rows_of_the_full_model_are_those_of_evaluate(finished, data, trained):
    net, fitted, character, _ = export.load_trained(str(trained[1]), str(data))
    item = sequence.read(data / "dynamic" / "a-unseen.safetensors")
    expected = evaluate.evaluate(net.float(), fitted.rig, character.faces, item)
    found = by_key(finished[0])
    for key, level in (("rigid_hips", evaluate.SCALE), ("plain", evaluate.PLAIN),
                       *((f"stage{k}", v) for k, v in (("_1", "stage 1"), ("s_1_2", "stages 1-2"),
                                                       ("s_1_3", "stages 1-3")))):
        ours = found[key]["clips"]["a/unseen"]
        # A longer sequence, with its last pose held, is multiplied in other pieces: the last bits of float32.
        for metric in (*table.METRICS, *(("bands", band) for band in ("coarse", "middle", "fine"))):
            mine, theirs = (of[metric] if isinstance(metric, str) else of["bands"][metric[1]]
                            for of in (ours, expected[level]))
            assert mine == pytest.approx(theirs, rel=1e-4)
        assert ours["relative_error"] == pytest.approx(expected[level]["relative_error"], rel=1e-5)


def test_ablations_leave_the_frozen_part_as_it_starts(finished, data):
    def static(name):
        return export.load_trained(str(finished[1] / name), str(data))[0].static

    pivots, fixed = static("pivots_frozen"), static("weights_frozen")
    x = torch.randn(4, pivots.mlp[0].in_features)
    assert not pivots.increments(x).any() and fixed.increments(x).any()
    kept = torch.where(fixed.weights() > 0, fixed.initial_weights, torch.zeros(()))
    assert torch.allclose(fixed.weights(), kept / kept.sum(1, keepdim=True))
    assert (pivots.weights() - pivots.initial_weights).abs().max() > 1e-3
    found = by_key(finished[0])
    n, m = fixed.initial_weights.shape
    assert found["stage_1"]["parameters"] == (found["no_pivots"]["parameters"]
                                              + found["fixed_weights"]["parameters"])
    assert found["no_pivots"]["parameters"] == n * m
    assert found["full_fixed_weights"]["parameters"] == found["stages_1_3"]["parameters"] - n * m


def test_families_train_below_their_start_and_count_like_stages_1_2(finished, trained):
    found = by_key(finished[0])
    target = found["stages_1_2"]["parameters"]
    for key in ("static_pose", "recurrent_pose", "virtual_bones"):
        history = checkpoint.load(str(finished[1] / key / "network.safetensors"))["history"]
        assert min(h["validation_mm"] for h in history) < history[0]["validation_mm"]
        # One more unit of a basis costs 3 n = 180 numbers; bones are limited to a quarter of n = 60.
        assert key == "virtual_bones" or abs(found[key]["parameters"] - target) <= 100
    assert checkpoint.load(str(finished[1] / "virtual_bones" / "network.safetensors"))["sizes"][
        "size"] == 15


def test_more_data_trains_the_families_too_and_belongs_to_the_settings(data, trained, tmp_path):
    more = tmp_path / "more"
    shutil.copytree(data, more)
    for path in (more / "dynamic").glob("*.safetensors"):
        path.unlink()
    add_clip(more, "a/three", 21)
    found = run(data, trained[1], tmp_path / "out", "--clips", "a/unseen", "--rows", "static_pose",
                "--epochs", "1", "--more-data", str(more))
    assert any("'a/three'" in remark for remark in found["remarks"])    # the full model never saw it
    with pytest.raises(ValueError, match="other settings|settings"):
        run(data, trained[1], tmp_path / "out", "--clips", "a/unseen", "--rows", "static_pose", "--epochs", "1")


def test_a_finished_row_is_not_trained_again(finished, data, trained, monkeypatch):
    def never(*_):
        raise AssertionError("trained or measured again")

    for kind in (rows.Frozen, rows.SameBudget, rows.Other):
        monkeypatch.setattr(kind, "train", never)
    monkeypatch.setattr(keep, "measure", never)
    assert run(data, trained[1], finished[1], "--clips", "a/unseen") == finished[0]


def test_rows_measured_before_a_measure_was_added_are_measured_again(finished, data, trained, tmp_path, monkeypatch):
    shutil.copytree(finished[1], tmp_path / "out")
    path = tmp_path / "out" / "plain.json"
    old = json.loads(path.read_text())
    del old["version"]
    old["clips"]["a/unseen"] = {key: old["clips"]["a/unseen"][key] for key in ("file", "frames", *table.METRICS)}
    path.write_text(json.dumps(old))
    monkeypatch.setattr(loop, "fit", None)
    assert run(data, trained[1], tmp_path / "out", "--clips", "a/unseen") == finished[0]


def test_scripted_and_recorded_clips_are_apart(finished):
    found = by_key(finished[0])["plain"]["clips"]["a/unseen"]
    rows_ = {"clips": {"a/x": {**found, "alive_mm": 10.0}, "procedural/y": {**found, "alive_mm": 30.0}}}
    averages = table.averages(rows_, ["a/x", "procedural/y"])
    assert {source: value["alive_mm"] for source, value in averages.items()} == {"recorded": 10.0, "scripted": 30.0}


def test_a_new_clip_is_measured_without_training(finished, data, trained, tmp_path, monkeypatch):
    shutil.copytree(finished[1], tmp_path / "out")
    monkeypatch.setattr(train, "run", None)
    monkeypatch.setattr(loop, "fit", None)
    both = run(data, trained[1], tmp_path / "out")
    for key, row in by_key(both).items():
        old = by_key(finished[0])[key]["clips"]["a/unseen"]
        assert row["clips"]["a/unseen"] == old and set(row["clips"]) == {"a/unseen", "a/later"}
        mean = [row["clips"][c]["position_mm"]["mean"] for c in row["clips"]]
        assert row["average"]["recorded"]["position_mm"]["mean"] == pytest.approx(sum(mean) / 2, rel=1e-12)
        assert mean[0] != mean[1]


def test_a_newer_full_model_is_measured_and_the_families_stay(finished, data, trained, tmp_path,
                                                              monkeypatch):
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(data))
    bundle.write(tmp_path / "half", net, fitted, character, provenance)      # other weights: F16
    shutil.copytree(finished[1], tmp_path / "out")
    trained_now = []
    for kind in (rows.Frozen, rows.SameBudget, rows.Other):
        real = kind.train
        monkeypatch.setattr(kind, "train", lambda row, *a, real=real: (trained_now.append(row.key),
                                                                       real(row, *a)))
    found = by_key(run(data, tmp_path / "half", tmp_path / "out", "--clips", "a/unseen"))
    assert trained_now == ["same_budget"]
    changed = {key for key, row in by_key(finished[0]).items() if found[key]["clips"] != row["clips"]}
    assert changed == {"stage_1", "stages_1_2", "stages_1_3", "same_budget"}


@pytest.mark.parametrize("key,fit,folder", [
    ("static_pose", "static_pose", "static_pose"), ("virtual_bones", "virtual_bones", "virtual_bones"),
    ("recurrent_pose", "recurrent_pose", "recurrent_pose"), ("same_budget", "skeleton", "same_budget_"),
    ("full_fixed_weights", "skeleton", "weights_frozen")])
def test_resumes_bit_for_bit(finished, data, trained, tmp_path, monkeypatch, key, fit, folder):
    class Stop(Exception):
        pass

    real = checkpoint.save

    def save_then_stop(path, state):
        real(path, state)
        if path.endswith(f"{fit}.safetensors") and state["epoch"] == 10:
            raise Stop

    more = ("--clips", "a/unseen", "--rows", key)
    monkeypatch.setattr(checkpoint, "save", save_then_stop)
    with pytest.raises(Stop):
        run(data, trained[1], tmp_path, *more)
    monkeypatch.setattr(checkpoint, "save", real)
    row, = run(data, trained[1], tmp_path, *more)["rows"]
    unbroken = by_key(finished[0])[key]
    assert row["clips"] == unbroken["clips"] and row["parameters"] == unbroken["parameters"]
    here, there = (next(d for d in p.glob(folder + "*") if d.is_dir()) for p in (tmp_path, finished[1]))
    pairs = list(zip(weights(here), weights(there)))
    assert all(torch.equal(a, b) for a, b in pairs)


def test_the_seed_decides(finished, data, trained, tmp_path):
    row, = run(data, trained[1], tmp_path, "--clips", "a/unseen", "--rows", "static_pose",
               "--seed", "7")["rows"]
    assert row["clips"] != by_key(finished[0])["static_pose"]["clips"]


def test_a_bundle_serves_as_the_full_model(finished, data, trained, tmp_path):
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(data))
    bundle.write(tmp_path / "b", net, fitted, character, provenance, half=False)
    found = by_key(run(data, tmp_path / "b", tmp_path / "out", "--clips", "a/unseen",
                       "--rows", "stage_1,stages_1_3,static_pose"))
    same = by_key(finished[0])
    for key in ("stage_1", "stages_1_3"):
        assert found[key]["average"]["recorded"]["position_mm"]["mean"] == pytest.approx(
            same[key]["average"]["recorded"]["position_mm"]["mean"], abs=1e-3)    # float32 at 1 m: 1e-4 mm
    assert found["static_pose"]["clips"] == same["static_pose"]["clips"]
    assert found["stage_1"]["minutes"] is None and found["stages_1_3"]["minutes"] is not None


def test_the_limit_in_minutes_is_settled_once(finished, data, trained, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "affordable", lambda epochs, minutes, *_: 7)
    more = ("--clips", "a/unseen", "--rows", "static_pose", "--minutes-per-model", "1")
    row, = run(data, trained[1], tmp_path, *more)["rows"]
    assert row["fits"]["static_pose"]["epochs"] == 7
    assert "network: 7 epochs, the full model's stage 2 was given 20." in (
        tmp_path / "table.md").read_text()
    state = checkpoint.load(str(tmp_path / "static_pose" / "static_pose.safetensors"))
    assert state["epoch"] == state["epochs"] == 7 and "minutes" in state["history"][-1]


def test_what_minutes_pay_for():
    assert loop.affordable(100, 1, 2, 5, 5) == 20            # 2 s an epoch, 1 s of validation each
    assert loop.affordable(10, 1, 2, 5, 5) == 10
    assert loop.affordable(100, 0.01, 2, 5, 5) == 1
    with pytest.raises(ZeroDivisionError), loop.limited(3):
        raise ZeroDivisionError
    assert loop._limit_minutes is None


def test_floor_and_better_rows_are_told(finished, data, trained, tmp_path):
    (tmp_path / "floor.json").write_text(json.dumps({"clips": [
        {"clip": "a/unseen", "mean_mm": 3.25, "end_mm": 9}, {"clip": "a/other", "mean_mm": 1}]}))
    shutil.copytree(finished[1], tmp_path / "out")
    found = run(data, trained[1], tmp_path / "out", "--clips", "a/unseen", "--floor",
                str(tmp_path / "floor.json"))
    assert found["floor_mm"] == {"a/unseen": 3.25}
    text = (tmp_path / "out" / "table.md").read_text()
    assert "| floor, mm |" in text and text.count("| 3.25 |") == len(found["rows"]) + 1
    full = by_key(found)["stages_1_3"]["average"]["recorded"]["position_mm"]["mean"]
    better = {r["key"] for r in found["rows"] if r["group"] != "ours"
              and r["average"]["recorded"]["position_mm"]["mean"] < full}
    assert better == {b["row"] for b in found["better_than_full"]
                      if b["clip"] == "recorded" and b["metric"] == "position_mm"}
    assert better and all(f"- {by_key(found)[key]['title']}, recorded: by" in text for key in better)
    (tmp_path / "bad.json").write_text("[1]")
    with pytest.raises(ValueError, match="bad.json: not a floor file"):
        run(data, trained[1], tmp_path / "out", "--floor", str(tmp_path / "bad.json"))


@pytest.mark.parametrize("more,message", [
    (("--clips", "a/one"), "trained or validated on"), (("--clips", "a/held"), "trained or validated on"),
    (("--clips", "a/nowhere"), "held-out clips.*a/nowhere.*not found.*--clips")])
def test_clips_that_cannot_be_measured_are_refused(data, trained, tmp_path, more, message):
    with pytest.raises(ValueError, match=message):
        run(data, trained[1], tmp_path, *more)


def test_a_folder_of_other_settings_is_refused(finished, data, trained):
    with pytest.raises(ValueError, match="another minutes_per_model, seed; give another --out"):
        run(data, trained[1], finished[1], "--seed", "9", "--minutes-per-model", "2")


def test_another_garment_and_a_model_without_stage_2_are_refused(data, trained, tmp_path):
    shutil.copytree(trained[1], tmp_path / "full")
    arguments = SimpleNamespace(**json.loads(checkpoint.load(
        str(trained[1] / "network.safetensors"))["options"]))
    arguments.out, arguments.stages = str(tmp_path / "short"), "static"
    train.run(arguments)
    with pytest.raises(ValueError, match="has no stage 2"):
        run(data, tmp_path / "short", tmp_path / "out")
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(data))
    character.template = character.template + np.float32(0.01)
    net.static.template += 0.01
    bundle.write(tmp_path / "moved", net, fitted, character, provenance)
    with pytest.raises(ValueError, match="another character or garment"):
        run(data, tmp_path / "moved", tmp_path / "out")


@pytest.mark.parametrize("more", [("--rows", "stage_9"), ("--minutes-per-model", "0"),
                                  ("--epochs", "-1")])
def test_bad_usage_ends_with_two(more, capsys):
    with pytest.raises(SystemExit) as ended:
        command.arguments(["--data", "d", "--full", "f", "--out", "o", *more])
    assert ended.value.code == 2 and more[0] in capsys.readouterr().err
