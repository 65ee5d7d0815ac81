"""What simulate's commands refuse: with one line, before anything is simulated, drawn or written."""
import concurrent.futures
import re
import types

import numpy as np
import pytest

from dcloth_training import figure, safetensors_io, sequence
from dcloth_training.motion import skeleton
from dcloth_training.simulate import floor, garment, render, run


@pytest.fixture
def sheet(tmp_path):
    """A sequence of three frames and its character."""
    cloth = np.zeros((3, 4, 3), np.float32)
    matrices = np.tile(np.eye(4, dtype=np.float32), (3, len(skeleton.NAMES), 1, 1))
    sequence.write(tmp_path / "clip.safetensors",
                   sequence.Sequence(matrices, cloth, skeleton.NAMES, skeleton.FPS, "a/clip", "dynamic"))
    safetensors_io.write(tmp_path / "character.safetensors", {"cloth_faces": np.array([[0, 1, 2]], np.int32)}, {})
    return tmp_path


@pytest.mark.parametrize("words, more", [
    ("clip 'mocap/walk' needs --motion", ["--clips", "procedural/jumps,mocap/walk"]),
    ("no procedural clip 'jump', expected .*'jumps'", ["--clips", "procedural/jump"]),
    ("nowhere/mocap/walk.bvh: No such file", ["--clips", "mocap/walk", "--motion", "nowhere"]),
])
def test_run_begins_with_no_clip_where_one_cannot_be(tmp_path, capsys, words, more):
    assert run.main(["--out", str(tmp_path / "data"), *more]) == 2
    told = capsys.readouterr().err
    assert told.startswith("run: error: ") and told.count("\n") == 1
    assert re.search(words, told), told
    assert not list(tmp_path.rglob("*.safetensors"))


def test_a_clip_named_twice_is_simulated_once(tmp_path):
    options = run.arguments(["--out", str(tmp_path), "--clips",
                             "procedural/jumps,development,procedural/jumps,procedural/jumps",
                             "--motion", "unused"])
    options.clips = options.clips.replace("development,", "")
    assert [name for name, *_ in run.tasks(options, run.Ours(options))] == ["procedural/jumps"]


class Here:
    """A pool that simulates at once."""

    def __enter__(self):
        return self, None

    def __exit__(self, *_):
        pass

    def __call__(self, function, *arguments):
        future = concurrent.futures.Future()
        future.set_result(function(*arguments))
        return future


def test_what_was_not_cloth_is_not_tried_again(tmp_path, monkeypatch, capsys):
    """It is with another motion or other settings, and so is what failed before there was cloth."""
    tried, worn = [], types.SimpleNamespace(fabric=garment.GARMENTS["skirt"](figure.load()).fabric, settings={})

    def tear(name, kind, motion, record, wind, path, context):
        tried.append(name)
        simulated = {} if name == "procedural/jumps" else {"frames": 3, "seconds": 1.0}
        return {"clip": name, "kind": kind, "refused": "torn", **simulated}, 1.0

    monkeypatch.setattr(run, "run_clip", tear)
    monkeypatch.setattr(run, "pool_of", lambda options, context: Here())
    monkeypatch.setattr(run.Ours, "put_on", lambda self: (None, worn))

    def go(*more):
        tried.clear()
        options = run.arguments(["--out", str(tmp_path), "--clips", "procedural/jumps,procedural/kicks", *more])
        return run.run(options), list(tried)

    both = ["procedural/jumps", "procedural/kicks"]
    assert go() == (2, both)
    assert go() == (2, ["procedural/jumps"])
    assert "refused before: 1 of 2 clips" in capsys.readouterr().out
    assert go("--root", "fixed") == (2, both)
    worn.settings = {"friction": 0.9}
    assert go("--root", "fixed") == (2, both)
    (tmp_path / "manifest.jsonl").write_text('{"clip": "procedural/kicks"}\n{"cl')
    with pytest.raises(ValueError, match="manifest.jsonl:2: not a clip's line"):
        go()


def test_a_folder_begun_with_other_triangles_is_refused(tmp_path):
    """A change to the cut may leave as many vertices and other triangles."""
    worn = garment.GARMENTS["skirt"](figure.load())
    path = str(tmp_path / "character.safetensors")
    there = {"cloth_template": worn.vertices.astype(np.float32), "cloth_faces": worn.faces}
    safetensors_io.write(path, there, {})
    assert len(run.put_on(str(tmp_path), "skirt")[1].vertices) == len(worn.vertices)
    safetensors_io.write(path, {**there, "cloth_faces": np.roll(worn.faces, 1, 0)}, {})
    with pytest.raises(ValueError, match="character.safetensors: other triangles than the skirt cut here"):
        run.put_on(str(tmp_path), "skirt")


def test_floor_wants_a_clip_that_can_be(tmp_path, capsys):
    assert floor.main(["--data", str(tmp_path), "mocap/walk"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("floor: error: ") and "needs --motion" in told and told.count("\n") == 1


@pytest.mark.parametrize("words, more", [
    ("frame 3: allowed are 0 to 2", ["--frames", "1,3"]),
    ("frame -1: allowed are 0 to 2", ["--frames=-1"]),
    ("--frames 'x': ", ["--frames", "x"]),
])
def test_render_draws_frames_that_are_there(sheet, capsys, words, more):
    assert render.main([str(sheet / "clip.safetensors"), "--character", str(sheet / "character.safetensors"),
                        "-o", str(sheet / "out.png"), *more]) == 2
    told = capsys.readouterr().err
    assert told.startswith("render: error: ") and words in told and told.count("\n") == 1
    assert not (sheet / "out.png").exists()
