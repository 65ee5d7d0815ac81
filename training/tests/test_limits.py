"""What a model cannot hold is told before training, not by the converter after it."""
import json
import re

import numpy as np
import pytest

from conftest import NAMES, bind_pose, tube
from test_import_truth import clip_of, project, write_cache
from dcloth_training import body_limits, bundle, import_truth, rig, safetensors_io, train
from dcloth_training.truth.errors import TruthError


def finely_meshed(tiny, path, rings, columns):
    """The tiny character with a body of rings x columns vertices."""
    tensors, metadata = safetensors_io.read(tiny / "character.safetensors")
    body, faces, _ = tube(0.12, rings, columns, 1.1, 0.2)
    weights = np.exp(-12 * np.linalg.norm(body[:, None] - bind_pose()[None, :, :3, 3], axis=-1))
    tensors.update(body_vertices=body.astype(np.float32), body_faces=faces, body_collider=np.ones(len(body), np.uint8),
                   body_weights=(weights / weights.sum(1, keepdims=True)).astype(np.float32))
    safetensors_io.write(path, tensors, {**metadata, "joint_names": json.dumps(NAMES)})


def test_skin_that_nothing_touches_does_not_count():
    body, faces, _ = tube(0.12, 66, 127, 1.1, 0.2)
    everywhere, parts = np.ones(len(body), np.uint8), np.where(body[:, 1] > 0.6, 2, 1)
    touches = np.ones(4, np.int32)
    assert body_limits.excess(body, faces, everywhere, body)
    assert body_limits.excess(body, faces, everywhere, body, touches, parts) is None
    assert body_limits.excess(body, faces, everywhere, body, touches | 2, parts)


@pytest.mark.parametrize("rings, columns, found", [(64, 128, None), (65, 128, "8,320 vertices and 16,384 faces"),
                                                   (66, 127, "8,382 vertices and 16,510 faces")])
def test_a_body_too_fine_to_stay_outside_of(rings, columns, found, tiny, trained, tmp_path, capsys):
    finely_meshed(tiny, tmp_path / "fine.safetensors", rings, columns)
    said = write_cache("pc2", tmp_path, clip_of(tiny).truth)
    import_truth.run(project(tmp_path, tiny, said, character=str(tmp_path / "fine.safetensors")), str(tmp_path / "out"))
    told = capsys.readouterr().out
    assert ("body: " in told) == bool(found)
    character = rig.read_character(tmp_path / "out" / "character.safetensors")
    net, fitted, _, _ = trained[0]
    bundle.write(tmp_path / "b", net, fitted, character, {})
    assert ("body.collides" in safetensors_io.read(tmp_path / "b")[0]) == (found is None)
    if found:
        assert re.search(f"{found}.*8,192.*16,384.*32.*DCLOTH_OUTPUT_OUTSIDE_BODY", told), told
        assert found in capsys.readouterr().err


def test_a_fan_of_faces_and_what_lies_far_away(tiny, tmp_path):
    """As the converter counts: 32 faces around a vertex; only faces that collide and reach to within half a metre."""
    from dcloth_training import body_limits
    corners = np.array([[0, 0, 0], *([np.cos(a), 0, np.sin(a)] for a in np.linspace(0, 6, 34))])
    fan = np.array([[0, i, i + 1] for i in range(1, 34)])
    colliding = np.ones(35, bool)
    assert "33 faces around vertex 0" in body_limits.excess(corners, fan, colliding, np.zeros((1, 3)))
    assert body_limits.excess(corners, fan[:32], colliding, np.zeros((1, 3))) is None
    assert body_limits.excess(corners, fan, colliding, np.array([[0, 0.6, 0]])) is None
    colliding[7] = False    # a corner of two faces
    assert body_limits.excess(corners, fan, colliding, np.zeros((1, 3))) is None


def test_more_vertices_than_a_model_holds(tiny, tmp_path):
    said = write_cache("pc2", tmp_path, clip_of(tiny).truth)
    path = project(tmp_path, tiny, said)
    points, faces, _ = tube(0.2, 200, 328, 1.0, 0.5)
    with open(tmp_path / "garment.obj", "w") as file:
        file.writelines("v {} {} {}\n".format(*p) for p in points)
        file.writelines("f {} {} {}\n".format(*f) for f in faces + 1)
    with pytest.raises(TruthError, match="65600 vertices, allowed 3 to 65535"):
        import_truth.run(path, str(tmp_path / "out"))


@pytest.mark.parametrize("option, value", [("--mesh-width", "12"), ("--mesh-width", "72"), ("--mesh-layers", "9")])
def test_networks_that_no_model_holds_are_bad_usage(option, value, capsys):
    with pytest.raises(SystemExit) as ended:
        train.arguments(["--data", "d", "--out", "o", option, value])
    assert ended.value.code == 2 and option in capsys.readouterr().err


def test_drapes_that_stood_in_go_when_others_come(tiny, tmp_path):
    said = write_cache("pc2", tmp_path, clip_of(tiny).truth)
    stand_in = tmp_path / "out" / "static" / "drapes-of-clips.safetensors"
    import_truth.run(project(tmp_path, tiny, said), str(tmp_path / "out"))
    assert stand_in.exists()
    import_truth.run(project(tmp_path, tiny, {**said, "kind": "static"}), str(tmp_path / "out"))
    assert not stand_in.exists() and (tmp_path / "out" / "static" / "a-one.safetensors").exists()
