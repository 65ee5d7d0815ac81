"""What of a crossing is seen: a limb through a sheet of cloth, with and without something before it."""
import json

import numpy as np
import pytest
from conftest import tube

from dcloth_training import safetensors_io, sequence, specks
from dcloth_training.motion import skeleton
from dcloth_training.simulate import crossings

COLUMNS = 41


def sheet(z):
    """A square of cloth across z, half a metre wide: vertices [n, 3], faces [f, 3]."""
    x, y = np.meshgrid(np.linspace(-0.25, 0.25, COLUMNS), np.linspace(-0.25, 0.25, COLUMNS))
    number = np.arange(COLUMNS * COLUMNS).reshape(COLUMNS, COLUMNS)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    return (np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], -1),
            np.concatenate([np.stack([a, b, c], -1), np.stack([b, d, c], -1)]))


def limb():
    """A tube along z, of 40 mm."""
    vertices, faces, _ = tube(0.04, 30, 40, 0.2, -0.2)
    return vertices[:, [0, 2, 1]] * [1, 1, -1], faces


def pixels(cloth, cloth_faces, body, body_faces):
    pairs = crossings.between(cloth, cloth_faces, body, body_faces)
    assert len(pairs)
    return specks.seen(cloth, cloth_faces, body, body_faces, pairs)


def test_a_limb_through_a_sheet_is_seen_along_its_outline():
    cloth, cloth_faces = sheet(0.013)
    around = 2 * np.pi * 0.04 / specks.PIXEL
    # From a corner half of the circle is seen, and each of its pixels has up to two neighbours across it.
    assert 0.3 * around < pixels(cloth, cloth_faces, *limb()) < around


def test_what_lies_behind_other_cloth_is_not_seen():
    (cloth, cloth_faces), (body, body_faces) = sheet(0.013), limb()
    box = np.concatenate([cloth] + [np.roll(sheet(z)[0], k, 1) for k in range(3) for z in (-0.24, 0.24)])
    boxes = np.concatenate([cloth_faces + k * len(cloth) for k in range(7)])
    assert pixels(box, boxes, body, body_faces) == 0


def test_lining_is_seen_where_layers_lie_at_one_height():
    cloth, faces = sheet(0.0)
    body, body_faces = limb()
    far, upright = np.float64([0, 0, 5]), faces[:, ::-1]
    waves = 0.001 * np.sin(40 * cloth[:, :1]) * [0, 0, 1]

    def shown(over, turned):
        layers = np.concatenate([cloth, cloth * [0.98, 0.98, 1] + waves + [0, 0, over]])
        both = np.concatenate([upright, (faces if turned else upright) + len(cloth)])
        own = crossings.within(layers, both)
        return specks.lining_seen(layers, both, body + far, body_faces, own) if len(own) else 0

    assert shown(0, True) > 100
    assert shown(0, False) == 0, "both layers show the same side"
    assert shown(0.01, True) == 0, "one layer lies over the other"


@pytest.fixture
def files(tmp_path):
    (cloth, cloth_faces), (body, body_faces) = sheet(0.013), limb()
    motion = skeleton.rest_motion(4)
    matrices = skeleton.joint_matrices(motion)
    clip = sequence.Sequence(matrices, None, skeleton.NAMES, 30.0, "a/b", "dynamic")
    sequence.write(tmp_path / "clip.safetensors", clip)
    weights = np.zeros((len(body), len(skeleton.NAMES)), np.float32)
    weights[:, 0] = 1
    safetensors_io.write(tmp_path / "bundle.safetensors", {
        "character.bind": skeleton.bind_matrices().astype(np.float32), "body.positions": body.astype(np.float32),
        "body.faces": body_faces.astype(np.int32), "body.joint_weights": weights,
        "template.positions": cloth.astype(np.float32), "template.faces": cloth_faces.astype(np.int32)}, {})
    posed = skeleton.skin(body, weights, skeleton.bind_matrices(), matrices)
    offset = (posed - body).mean(1)
    positions = (cloth[None] + offset[:, None]).astype(np.float32)
    positions[1:3] += np.float32([0, 0, 1])      # clear of the limb
    safetensors_io.write(tmp_path / "run.safetensors", {"positions": positions}, {})
    return tmp_path


def test_frames_are_counted_and_named(files, capsys):
    command = [f"{files}/clip.safetensors={files}/run.safetensors", "--bundle", f"{files}/bundle.safetensors"]
    assert specks.main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["frames"], found["crossing"], found["seen"]) == (4, 2, 2)
    assert sorted(frame for frame, _ in found["clips"][0]["worst"]) == [0, 3]
    assert specks.main([*command, "--every", "2"]) == 0
    assert "frames     2  crossing     1  seen     1" in capsys.readouterr().out
    assert specks.main([*command, "--lining"]) == 0
    assert "frames     4  crossing     2  seen     2  lining     0\n" in capsys.readouterr().out


@pytest.mark.parametrize("more, words", [(["--every", "0"], "--every 0: expected 1 or more"), ([], "the same frames")])
def test_what_does_not_fit_is_refused(files, capsys, more, words):
    if not more:
        safetensors_io.write(files / "run.safetensors", {"positions": np.zeros((3, 5, 3), np.float32)}, {})
    command = [f"{files}/clip.safetensors={files}/run.safetensors", "--bundle", f"{files}/bundle.safetensors"]
    assert specks.main([*command, *more]) == 2
    told = capsys.readouterr().err
    assert told.startswith("specks: error: ") and words in told and told.count("\n") == 1
