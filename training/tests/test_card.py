"""Model cards: what is generated agrees with the figures beside it, and words written by hand stay."""
import json
import os
import shutil

import numpy as np
import pytest

from conftest import NAMES, hang, poses
from dcloth_training import bundle, card, card_text, export, failure_pictures, safetensors_io, sequence

MODELS = os.path.join(os.path.dirname(__file__), "..", "..", "models")
README = """# tiny
<!-- card: network -->
old
<!-- card end -->
By hand.
<!-- card: errors fixed hips -->
<!-- card end -->
<!-- card: failures -->
<!-- card end -->
The end.
"""


def figures(mean, level="stages 1-3"):
    return {level: {"position_mm": {"mean": mean, "std": 0.5, "p99": 10 * mean, "max": 20.0},
                    "normal_deg": {"mean": 2.0, "std": 1.0, "p99": 9.0}}}


@pytest.fixture(scope="module")
def held(tiny, tmp_path_factory):
    """Ground truth of the tiny garment with two held-out clips and the floor of one."""
    folder = tmp_path_factory.mktemp("held") / "data"
    shutil.copytree(tiny, folder)
    cloth = safetensors_io.read(str(folder / "character.safetensors"))[0]["cloth_template"]
    for name, seed in (("a/unseen", 11), ("a/later", 12)):
        matrices = poses(30, np.random.default_rng(seed)).astype(np.float32)
        sequence.write(folder / "dynamic" / f"{name.replace('/', '-')}.safetensors", sequence.Sequence(
            matrices, hang(matrices.astype(np.float64), cloth), NAMES, 30.0, name, "dynamic"))
    (folder / "floor.json").write_text(json.dumps({"clips": [
        {"clip": "a/later", "frames": 30, "mean_mm": 0.25, "end_mm": 0.5, "entered_mm": None, "alive_mm": 12.0,
         "per_frame_mm": [0.1]},
        {"clip": "a/one", "frames": 40, "mean_mm": 9.0, "end_mm": 9.0, "entered_mm": 9.0, "alive_mm": 9.0}]}))
    return folder


@pytest.fixture
def model(tiny, trained, tmp_path, monkeypatch):
    """models/tiny with its bundle and a card."""
    monkeypatch.setattr(failure_pictures, "SAMPLES", 1)
    folder = tmp_path / "tiny"
    folder.mkdir()
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
    bundle.write(folder / "tiny.safetensors", net, fitted, character, provenance)
    (folder / "README.md").write_text(README)
    return folder


def test_one_command_measures_draws_and_writes(model, held, capsys):
    assert card.main([str(model), "--fixed-hips", str(held), "--count", "1"]) == 0
    text = (model / "README.md").read_text()
    assert "old" not in text and "By hand." in text and text.endswith("<!-- card end -->\nThe end.\n")
    results = json.loads((model / "errors_fixed_hips.json").read_text())
    assert list(results) == ["a/unseen", "a/later"] and not (model / "errors.json").exists()
    mean = results["a/later"]["stages 1-3"]["position_mm"]
    alive = [results[clip]["truth"]["alive_mm"] for clip in results]
    assert f"**{mean['mean']:.1f}**" in text and f"| `a/later` | {alive[1]:.0f} | 0.2 / - | 2% |" in text
    assert f"| `a/unseen` | {alive[0]:.0f} | - / - | - |" in text and "Recorded clips:" in text
    last = [results[clip]["stages 1-3"] for clip in results]
    quotient = sum(row["position_mm"]["mean"] for row in last) / sum(alive)
    assert f" | {quotient:.2f} | " in next(line for line in text.splitlines() if line.startswith("| over the clips"))
    assert "| jitter | - | 0.00 | " in text and "| pairs body | " in text and "Scripted" not in text
    assert "a/one" not in (model / "floor_fixed_hips.json").read_text()
    flat = " ".join(text.split())
    assert "60 vertices, 100 triangles, 30 Hz" in flat and "k_S = 16 over 8 principal components" in flat
    assert "mesh stage three layers of width 8, MLP 60-16-4, k_M = 4" in flat and "at most 3 bones" in flat
    rows = json.loads((model / "failures" / "failures.json").read_text())
    assert len(rows) == 1 and f"](failures/{rows[0]['picture']})" in text
    assert (model / "failures" / rows[0]["picture"]).exists()
    rows[0]["why"] = "Because of the wind."
    (model / "failures" / "failures.json").write_text(json.dumps(rows))
    assert card.main([str(model), "--check"]) == 1 and (model / "README.md").read_text() == text
    assert "differs from the figures" in capsys.readouterr().err
    assert card.main([str(model)]) == 0 and "Because of the wind." in " ".join(
        (model / "README.md").read_text().split())
    assert card.main([str(model), "--check"]) == 0


def test_the_table_of_errors():
    results = {"a/one": {**figures(4.0, "stage 1"), **figures(1.0)},
               "a/two": {**figures(8.0, "stage 1"), **figures(2.5)},
               "procedural/hop": {**figures(60.0, "stage 1"), **figures(50.0)}}
    lines = card_text.errors(results, {"a/two": {"mean_mm": 0.4, "entered_mm": 0.2, "alive_mm": 31.0}})
    head = ["| clip | motion | floor | floor / motion | stage 1 | stages 1-3 | relative error | relative motion error "
            "| p99 | E_n |", "|---|---|---|---|---|---|---|---|---|---|"]
    # Scripted clips are not in the mean of the recorded ones.
    assert lines == ["Recorded clips:", "", *head,
                     "| `a/one` | - | - / - | - | 4.0 | **1.0** | - | - | 10 | 2.0 |",
                     "| `a/two` | 31 | 0.4 / 0.2 | 1% | 8.0 | **2.5** | 0.08 | - | 25 | 2.0 |",
                     "| over the clips | 31 | 0.4 / 0.2 | 1% | 6.0 | **1.75** | - | - | 18 | 2.0 |", "",
                     "Scripted clips:", "", *head,
                     "| `procedural/hop` | - | - / - | - | 60.0 | **50.0** | - | - | 500 | 2.0 |",
                     "| over the clips | - | - / - | - | 60.0 | **50.00** | - | - | 500 | 2.0 |"]


def test_reported_clips_are_a_table_of_their_own():
    results = {"mocap/run": figures(4.0), "child/8_walk": figures(9.0), "procedural/hop": figures(1.0)}
    text = "\n".join(card_text.errors(results, {}))
    parts = text.split("Reported clips:")[1].split("Recorded clips:")
    assert ["child/8_walk" in parts[0], "mocap/run" in parts[0]] == [True, False]
    recorded, scripted = parts[1].split("Scripted clips:")
    assert "mocap/run" in recorded and "procedural/hop" in scripted


def test_the_card_tells_whose_motion_it_was_and_from_where():
    before = {"training_clips": ["mocap/jump", "procedural/kicks"], "validation_clips": ["mocap/walk"]}
    lines = card_text.sources({
        "training_clips": ["cmu_db/cmu007_12_00@0", "cmu_db/cmu060_01_00@0~2", "snu/snubox_1_00@0"],
        "validation_clips": ["validation/cmu061_01_00@0"], "started_from": before})
    assert lines[:2] == ["| clips | for | people | from |", "|---|---|---|---|"]
    assert [line.split(" | ")[:3] for line in lines[2:]] == [
        ["| 2 of `cmu_db/`", "training", "2"], ["| 1 of `mocap/`", "training", "several"],
        ["| 1 of `procedural/`", "training", "-"], ["| 1 of `snu/`", "training", "1"],
        ["| 1 of `mocap/`", "validation", "several"], ["| 1 of `validation/`", "validation", "1"]]
    assert "NSF EIA-0196217" in lines[2] and "Apache-2.0" in lines[5] and "mocap.cs.cmu.edu" in lines[-1]


@pytest.mark.parametrize("text,message", [
    (README.replace("errors fixed hips", "speed"), "'<!-- card: speed -->': allowed are"),
    (README.replace("<!-- card end -->\nThe", "The"), "3 marks '<!-- card: PART -->' and 2"),
    ("# no marks", "0 marks"), (README.replace("<!-- card: failures -->", "<!-- card: failures-->"), "in 2 pairs"),
    (README, "errors_fixed_hips.json")])
def test_a_card_that_cannot_be_written_stays_as_it_was(model, capsys, text, message):
    (model / "README.md").write_text(text)
    assert card.main([str(model)]) == 2 and message in capsys.readouterr().err
    assert (model / "README.md").read_text() == text


def test_without_held_out_clips_nothing_is_measured(model, tiny, capsys):
    assert card.main([str(model), "--data", str(tiny)]) == 2
    said = capsys.readouterr().err
    assert "none of the held-out clips a/unseen, a/later" in said and "--held-out" in said
    assert not (model / "errors.json").exists()


@pytest.mark.parametrize("named,wanted", [(None, "mocap/run"), ([], "(none named)"), (["a/gone"], "a/gone")])
def test_held_out_clips_are_those_the_bundle_names(model, tiny, capsys, named, wanted):
    """And this project's where it names none, as bundles of other trainers."""
    path = model / "tiny.safetensors"
    tensors, metadata = safetensors_io.read(path)
    provenance = json.loads(metadata["training"])
    assert provenance.pop("held_out_clips") == ["a/unseen", "a/later"] and "held_out" not in provenance["command"]
    if named is not None:
        provenance["held_out_clips"] = named
    safetensors_io.write(path, tensors, {**metadata, "training": json.dumps(provenance)})
    assert card.main([str(model), "--data", str(tiny)]) == 2
    assert wanted in capsys.readouterr().err.partition("held-out clips ")[2]


@pytest.mark.parametrize("name", sorted(n for n in os.listdir(MODELS) if os.path.isdir(os.path.join(MODELS, n))))
def test_cards_of_bundled_models_agree_with_their_figures(name):
    assert card.main([os.path.join(MODELS, name), "--check"]) == 0
