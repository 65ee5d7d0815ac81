"""Bad input ends a command with 2 and one line that says what is wrong, before hours of training, not after."""
import json
import re
import shutil

import numpy as np
import pytest

from conftest import SMALL
from dcloth_training import evaluate, export, failures, reference, safetensors_io, train
from dcloth_training.compare import __main__ as compare


def train_command(data, out, *more):
    return train.main(["--data", str(data), "--out", str(out), *SMALL, *more])


def changed(tiny, folder, path, change):
    """A copy of the tiny garment with one file changed."""
    shutil.copytree(tiny, folder)
    tensors, metadata = safetensors_io.read(folder / path)
    change(tensors, metadata)
    safetensors_io.write(folder / path, tensors, metadata)
    return folder


def other_joint(tensors, metadata):
    metadata["joint_names"] = metadata["joint_names"].replace("LeftLeg", "LeftShin")


ONE, CHARACTER = "dynamic/a-one.safetensors", "character.safetensors"


@pytest.mark.parametrize("path, change, words", [
    (ONE, other_joint, "a-one.safetensors: joints.*LeftShin.*allowed.*LeftLeg"),
    (ONE, lambda t, m: t.pop("truth"), "a-one.safetensors: no truth"),
    (ONE, lambda t, m: t.update(truth=t["truth"][:, :59]), "59 cloth vertices.*character.safetensors.*60"),
    (ONE, lambda t, m: t["truth"].__setitem__((3, 5), np.nan), "a-one.safetensors.*not finite"),
    (ONE, lambda t, m: t.pop("joint_matrices"), "a-one.safetensors: joint_matrices None"),
    (ONE, lambda t, m: m.update(fps="60"), "60.0 frames/s"),
    (CHARACTER, lambda t, m: t.pop("body_weights"), "not a character: .*body_weights"),
    (CHARACTER, lambda t, m: t["cloth_faces"].__setitem__((3, 1), 60), "cloth_faces of vertex 60.*0 to 59"),
    (CHARACTER, lambda t, m: m.update(hips="pelvis"), "joints .*pelvis.*Hips, LeftUpLeg"),
])
def test_training_data_that_does_not_fit(tiny, tmp_path, capsys, path, change, words):
    assert train_command(changed(tiny, tmp_path / "data", path, change), tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert told.startswith("train: error: ") and told.count("\n") == 1
    assert re.search(words, told), told


@pytest.mark.parametrize("more, words", [
    (["--data", "nowhere"], "nowhere/character.safetensors: No such file"),
    (["--validation", "a/hold"], "no validation clips.*a/hold.*a/held, a/one, a/two"),
    (["--window", "64"], "no training clip of 64 ticks .*44.*--window"),
    (["--chunk", "32"], "no training clip of 64 ticks .*44.*--chunk"),
    (["--export", "nowhere/skirt.safetensors"], "nowhere.*folder"),
    (["--more-data", "nowhere"], "nowhere/dynamic: no clips; --more-data"),
    (["--mesh-size", "85"], "168 frames.*--mesh-size 85 wants 170"),
    (["--start", "nowhere"], "nowhere/network.safetensors: not found"),
])
def test_training_that_cannot_end_well_does_not_begin(tiny, tmp_path, monkeypatch, capsys, more, words):
    monkeypatch.chdir(tmp_path)
    assert train_command(tiny, "out", *more) == 2
    told = capsys.readouterr().err
    assert re.search(words, told), told
    assert not (tmp_path / "out" / "static.safetensors").exists()


@pytest.mark.parametrize("more", [["--influences", "0"], ["--threads", "0"], ["--window", "12"], ["--chunk", "0"],
                                  ["--skeleton-size", "-1"], ["--static-epochs", "-1"],
                                  ["--static-base", "soft"]])
def test_options_out_of_range_are_bad_usage(more, capsys):
    with pytest.raises(SystemExit) as ended:
        train.arguments(["--data", "d", "--out", "o", *more])
    assert ended.value.code == 2 and more[0] in capsys.readouterr().err


def test_clips_that_are_left_out_are_named(tiny, tmp_path, capsys):
    assert train_command(tiny, tmp_path, "--window", "42", "--stages", "skeleton", "--validation", "a/held,a/hold") == 0
    told = capsys.readouterr().out
    assert "no clip a/hold" in told and "a/one (40)" in told and "a/two (44)" not in told


def test_held_out_clips_are_named(tiny, tmp_path, capsys):
    shutil.copytree(tiny, tmp_path / "data")
    shutil.copy(tiny / ONE, tmp_path / "data" / "dynamic" / "mocap-run.safetensors")
    assert train_command(tmp_path / "data", tmp_path / "out", "--stages", "static") == 0
    assert "held out, never read: mocap/run\n" in capsys.readouterr().out


def test_without_static_clips_the_folder_is_named(tiny, tmp_path, capsys):
    shutil.copytree(tiny / "dynamic", tmp_path / "data" / "dynamic")
    shutil.copy(tiny / "character.safetensors", tmp_path / "data")
    assert train_command(tmp_path / "data", tmp_path / "out") == 2
    assert "data/static: no clips" in capsys.readouterr().err


def test_frames_of_a_garment_without_mirror_image_count_once(tiny, tmp_path, capsys):
    data = changed(tiny, tmp_path / "data", CHARACTER, lambda t, m: t.pop("mirror"))
    out = tmp_path / "out"
    assert train_command(data, out, "--stages", "static", "--export", str(tmp_path / "b.safetensors")) == 0
    assert "with mirror images" not in capsys.readouterr().out
    told = json.loads(safetensors_io.read(tmp_path / "b.safetensors")[1]["training"])
    assert told["frames"] == {"training": 84, "validation": 36, "static": 10}


def test_other_sizes_and_other_input_in_a_folder_that_was_begun(tiny, tmp_path, capsys):
    data = tmp_path / "data"
    shutil.copytree(tiny, data)
    assert train_command(data, tmp_path / "out", "--stages", "skeleton") == 0
    assert "another --out" not in capsys.readouterr().out
    assert train_command(data, tmp_path / "out", "--stages", "skeleton") == 0
    assert "another --out" not in capsys.readouterr().out
    assert train_command(data, tmp_path / "out", "--stages", "skeleton", "--skeleton-size", "12") == 2
    assert "out/skeleton.safetensors: " in (told := capsys.readouterr()).err and "another --out" in told.err
    (data / "dynamic" / "a-one.safetensors").rename(data / "dynamic" / "a-three.safetensors")
    assert train_command(data, tmp_path / "out", "--stages", "skeleton", "--skeleton-epochs", "25") == 0
    told = capsys.readouterr().out
    assert "another --out" in told and "--skeleton-epochs 20" in told
    assert "a-three.safetensors" in told and "a-one.safetensors" in told and "a-two.safetensors" not in told


def test_a_start_with_other_features_is_told_by_them(tiny, trained, tmp_path, capsys):
    assert train_command(tiny, tmp_path, "--start", str(trained[1]), "--root-motion", "none") == 2
    assert re.search(r"found k_S = 16 over Hips, .* and root motion; expected k_S = 16 over Hips, [^;]*RightLeg;",
                     told := capsys.readouterr().err), told


@pytest.fixture(scope="module")
def exported(tiny, trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "tiny.safetensors"
    assert export.main(["bundle", str(trained[1]), "--data", str(tiny), "-o", str(path)]) == 0
    return path


def test_commands_on_a_bundle(tiny, trained, exported, tmp_path, capsys):
    held = str(tiny / "dynamic" / "a-held.safetensors")
    cut = changed(tiny, tmp_path / "cut", "dynamic/a-held.safetensors", lambda t, m: t.update(truth=t["truth"][:, :59]))
    small = changed(tiny, tmp_path / "small", CHARACTER, lambda t, m: (
        t.update(cloth_template=t["cloth_template"][:50]), t.update(cloth_faces=t["cloth_faces"][:80]),
        t.pop("mirror")))
    for main, arguments, words in (
            (evaluate.main, ["nowhere", held], "evaluate: error: nowhere: No such file"),
            (evaluate.main, [str(exported), str(tiny / CHARACTER)], "character.safetensors: metadata"),
            (evaluate.main, [str(exported), str(cut / "dynamic" / "a-held.safetensors")],
             "a-held.safetensors: truth of 59"),
            (evaluate.main, [str(exported), held, "-o", "nowhere/e"], "nowhere: no such folder"),
            (reference.main, [str(exported), "nowhere", "-o", str(tmp_path / "p")], "reference: error: nowhere"),
            (export.main, ["sequence", str(exported), "-o", str(tmp_path / "c")], "export: error: "),
            (export.main, ["bundle", str(tmp_path), "--data", str(tiny), "-o", str(tmp_path / "b")], "not found"),
            (export.main, ["bundle", str(trained[1]), "--data", str(small), "-o", str(tmp_path / "b")],
             "a garment of 60 vertices"),
            (compare.main, ["--data", "nowhere", "--full", str(exported), "--out", str(tmp_path / "o")],
             "compare: error: nowhere")):
        assert main(arguments) == 2, arguments
        told = capsys.readouterr().err
        assert words in told and told.count("\n") == 1, told


def test_two_sequences_of_one_clip_are_two_rows(tiny, exported, tmp_path, capsys):
    """With root motion and with the hips held, a clip has the same name."""
    held = str(tiny / "dynamic" / "a-held.safetensors")
    shutil.copy(held, tmp_path / "again.safetensors")
    again = str(tmp_path / "again.safetensors")
    assert evaluate.main([str(exported), held, again, "-o", str(tmp_path / "e")]) == 0
    assert list(json.loads((tmp_path / "e.json").read_text())) == ["a/held", again]
    assert again in capsys.readouterr().out


def test_a_pictured_clip_is_not_its_own_training(tiny, exported, tmp_path):
    """Other garments' validation clips have names of their own."""
    held = str(tiny / "dynamic" / "a-held.safetensors")
    assert failures.main([str(exported), held, "-o", str(tmp_path), "--training", str(tiny)]) == 0
    (row,) = json.loads((tmp_path / "failures.json").read_text())
    assert row["motion_away"] > 0 and row["most_alike"] != "a/held"
