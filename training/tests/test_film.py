"""The animated picture: one image a drawn frame, both halves drawn, and what does not fit refused."""
import numpy as np
import pytest
from PIL import Image

from dcloth_training import film, safetensors_io, sequence
from dcloth_training.motion import skeleton

FRAMES = 8


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr(film, "HEIGHT", 72)
    monkeypatch.setattr(film, "WIDTH", 60)
    motion = skeleton.rest_motion(FRAMES)
    cloth = np.array([[-0.3, 0.6, 0.3], [0.3, 0.6, 0.3], [0, 1.0, 0.3]])[None].repeat(FRAMES, 0).astype(np.float32)
    clip = sequence.Sequence(skeleton.joint_matrices(motion), cloth, skeleton.NAMES, 30.0, "a/b", "dynamic")
    sequence.write(tmp_path / "clip.safetensors", clip)
    safetensors_io.write(tmp_path / "run.safetensors", {"positions": cloth + np.float32([0, -0.3, 0])}, {})
    safetensors_io.write(tmp_path / "bundle.safetensors", {"template.faces": np.array([[0, 1, 2]], np.int32)}, {})
    return tmp_path


def test_both_halves_are_drawn_for_every_second_frame(files):
    pair = f"{files}/clip.safetensors={files}/run.safetensors"
    assert film.main([pair, "--bundle", f"{files}/bundle.safetensors", "-o", f"{files}/out.webp", "--yaw", "0"]) == 0
    with Image.open(files / "out.webp") as picture:
        assert picture.n_frames == 1 and picture.size == (120, 72)    # still: equal images become one
    cloth = film.clip(pair, np.array([[0, 1, 2]]), "", 0.0, slice(None))
    assert len(cloth) == FRAMES // film.EVERY
    left, right = np.split(np.asarray(cloth[0]).astype(int), 2, axis=1)
    red = [(half[..., 0] - half[..., 1] > 60).nonzero()[0].mean() for half in (left, right)]
    assert red[1] - red[0] == pytest.approx(0.3 / film.SPAN * 72, abs=2)   # the network's hangs 30 cm lower


@pytest.mark.parametrize("frames, words", [("8:", "takes none"), ("a:b", "FIRST:LAST")])
def test_frames_that_are_not_there_are_refused(files, capsys, frames, words):
    pair = f"{files}/clip.safetensors={files}/run.safetensors"
    command = [pair, "--bundle", f"{files}/bundle.safetensors", "-o", f"{files}/out.webp", "--frames", frames]
    assert film.main(command) != 0
    assert words in capsys.readouterr().err and not (files / "out.webp").exists()


def test_positions_of_another_clip_are_refused(files, capsys):
    safetensors_io.write(files / "run.safetensors", {"positions": np.zeros((FRAMES - 1, 3, 3), np.float32)}, {})
    pair = f"{files}/clip.safetensors={files}/run.safetensors"
    assert film.main([pair, "--bundle", f"{files}/bundle.safetensors", "-o", f"{files}/out.webp"]) != 0
    assert "same frames" in capsys.readouterr().err and not (files / "out.webp").exists()
