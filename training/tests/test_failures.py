"""Failure cases: the worst frame of each clip is found, explained in figures and drawn."""
import json

import numpy as np
import pytest
import torch

from dcloth_training import (bundle, export, failure_pictures, failures, familiarity, metrics, network, reference,
                             sequence)

CLIPS = ("a-one", "a-two", "a-held")


@pytest.fixture(scope="module")
def made(tiny, trained, tmp_path_factory):
    """(bundle, [clips' paths]) of the tiny garment; its mesh stage and all."""
    path = str(tmp_path_factory.mktemp("failures") / "tiny.safetensors")
    net, fitted, character, provenance = export.load_trained(str(trained[1]), str(tiny))
    bundle.write(path, net, fitted, character, provenance)
    return path, [str(tiny / "dynamic" / f"{clip}.safetensors") for clip in CLIPS]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(failure_pictures, "SAMPLES", 1)


def errors(path, clip):
    """Vertex distances [T, n] of the network on a clip, in mm, by the reference."""
    net, rig, *_ = bundle.read(path, torch.float32)
    item = sequence.read(clip)
    positions = reference.run(net, rig, reference.matrices_for(item, rig)).double().numpy()
    return metrics.distances_mm(positions, item.truth)


def test_the_worst_frames_are_pictured_one_a_clip(made, tiny, tmp_path, capsys, monkeypatch):
    from matplotlib import image
    monkeypatch.setattr(familiarity, "KEPT_EVERY", 1)
    path, clips = made
    out = tmp_path / "out"
    assert failures.main([path, *clips, clips[0], "-o", str(out), "--count", "2", "--training", str(tiny)]) == 0
    rows = json.loads((out / "failures.json").read_text())
    measured = {name.replace("-", "/"): errors(path, clip)[12:] for name, clip in zip(CLIPS, clips)}
    order = sorted(measured, key=lambda name: -measured[name].mean(1).max())
    assert [row["clip"] for row in rows] == order[:2] and rows[0]["mean_mm"] >= rows[1]["mean_mm"]
    for row in rows:
        distance = measured[row["clip"]]
        frame = distance.mean(1).argmax()
        assert row["frame"] == 12 + frame and row["second"] == round((12 + frame) / 30, 2)
        assert row["clip_alive_mm"] > 1
        assert abs(row["mean_mm"] - distance[frame].mean()) < 0.051
        assert abs(row["max_mm"] - distance[frame].max()) < 0.051
        assert abs(row["clip_mean_mm"] - distance.mean()) < 0.051 and row["shift_mm"] <= row["mean_mm"] + 0.1
        assert row["motion_away"] == 0 and row["most_alike"] == row["clip"]       # the clip is in that folder
        picture = image.imread(str(out / row["picture"]))[..., :3]
        assert (out / row["picture"]).stat().st_size < 150_000 and picture.shape[0] > failure_pictures.SIZE
        assert (picture[..., 2] > 1.2 * picture[..., 0]).mean() > 0.01            # blue cloth
    assert sorted(p.name for p in out.iterdir()) == sorted(["failures.json", *(row["picture"] for row in rows)])
    assert capsys.readouterr().out.count("worst at") == 4


def test_words_written_by_hand_stay_and_old_pictures_go(made, tmp_path):
    path, clips = made
    failures.main([path, clips[0], clips[1], "-o", str(tmp_path)])
    rows = json.loads((tmp_path / "failures.json").read_text())
    rows[0]["why"] = "The left leg is late."
    (tmp_path / "failures.json").write_text(json.dumps(rows))
    (tmp_path / "notes.png").write_bytes(b"not ours")
    failures.main([path, clips[0], clips[1], "-o", str(tmp_path), "--count", "1"])
    again = json.loads((tmp_path / "failures.json").read_text())
    assert len(again) == 1 and again[0]["why"] == "The left leg is late."
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["failures.json", "notes.png", again[0]["picture"]])


def test_lag_finds_an_older_shape():
    truth = np.cumsum(np.random.default_rng(5).normal(size=(30, 8, 3)), 0)
    assert failures.lag(np.roll(truth, 3, 0), truth, 20) == (3, 0.0)       # three frames late
    assert failures.lag(np.roll(truth, -2, 0), truth, 20) == (-2, 0.0)
    assert failures.lag(truth, truth, 0) == (0, 0.0) and failures.lag(truth, truth, 29) == (0, 0.0)


def test_features_beyond_training_are_counted(made):
    path, clips = made
    net, rig, *_ = bundle.read(path, torch.float32)
    pose = network.pose_of(sequence.read(clips[0]).joint_matrices, rig, torch.float32)
    assert failures.beyond(net, pose, 5) == 0
    pose.x[5, :3] = net.standardise.mean[:3] + 1.1 * net.standardise.high[:3] * net.standardise.deviation[:3] + 1e-3
    assert failures.beyond(net, pose, 5) == 3 and failures.beyond(net, pose, 4) == 0


def test_distance_to_training_is_that_of_plain_loops(made, tiny, monkeypatch):
    path, clips = made
    net, rig, *_ = bundle.read(path, torch.float32)
    known = familiarity.Training(net, rig, [str(tiny)], {"held_out_clips": ["a/held"]})
    assert set(known.clips) == {"a/one", "a/two"}
    pose = network.pose_of(sequence.read(clips[2]).joint_matrices, rig, torch.float32)
    away, alike = known.distance(pose)
    asked = familiarity.windows(net, pose)
    wanted = [min((float(np.sqrt(np.mean((a - w) ** 2))), name) for w, name in zip(known.windows, known.clips))
              for a in asked]
    assert np.allclose(away, [w for w, _ in wanted], atol=2e-3) and alike[-1] == wanted[-1][1]
    with pytest.raises(ValueError, match="no clips but held-out"):
        familiarity.Training(net, rig, [str(tiny)],
                             {"held_out_clips": ["a/held", "a/one"], "validation_clips": ["a/two"]})
    monkeypatch.setattr(familiarity.dataset, "HELD_OUT", ("a/one",))
    assert set(familiarity.Training(net, rig, [str(tiny)], {}).clips) == {"a/held", "a/two"}    # it says nothing


def test_colours_and_scale():
    assert failure_pictures.limit_mm([np.full(100, 3.0)]) == 20
    assert failure_pictures.limit_mm([np.full(9, 41.0), np.ones(9)]) == 60
    colours = failure_pictures.colours([0, 30, 60, 500], 60)
    assert np.allclose(colours[0], failure_pictures.STOPS[0][1]) and np.allclose(colours[2], colours[3])
    assert np.allclose(colours[1], dict(failure_pictures.STOPS)[0.5])


def test_the_picture_looks_at_the_error():
    angle = 2 * np.pi * np.arange(24) / 24
    ring = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1)
    tube = np.concatenate([ring, ring - [0, 1, 0]])
    i, j = np.arange(24), (np.arange(24) + 1) % 24
    faces = np.concatenate([np.stack([i, i + 24, j], -1), np.stack([j, i + 24, j + 24], -1)])

    class Case:
        truth = predicted = tube
        distance_mm = np.tile(np.exp(-5 * (1 - np.cos(angle - 2.0))), 2)      # worst at the angle 2.0
    assert abs(failure_pictures.best_yaw(Case, faces) - 2.0) < 0.2


@pytest.mark.parametrize("broken,message", [("no truth", "no truth to compare"), ("no file", "gone.safetensors"),
                                            ("other garment", "the network makes"),
                                            ("no bundle", "expected 'dcloth-bundle'")])
def test_what_cannot_be_pictured_is_refused(made, tmp_path, capsys, broken, message):
    path, clips = made
    item = sequence.read(clips[0])
    item.truth = None if broken == "no truth" else item.truth[:, :-1]
    clip = str(tmp_path / ("gone.safetensors" if broken == "no file" else "clip.safetensors"))
    if broken != "no file":
        sequence.write(clip, item)
    bundle_path = clips[0] if broken == "no bundle" else path
    assert failures.main([bundle_path, clip, "-o", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err and not (tmp_path / "out").exists()
