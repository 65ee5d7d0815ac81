"""The body beside the true cloth, and the loss that keeps predicted cloth on the right side of it."""
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from dcloth_training import body_planes, dataset, losses, mesh_head, rig, train
from conftest import rigid, rotation


def character_of(tiny):
    return rig.read_character(str(tiny / "character.safetensors"))


def posed(points, weights, matrices, bind):
    relative = matrices @ np.linalg.inv(bind)
    blended = np.einsum("vj,jab->vab", weights, relative)
    return np.einsum("vab,vb->va", blended[:, :3, :3], points) + blended[:, :3, 3]


def test_planes_touch_the_posed_body(tiny):
    character = character_of(tiny)
    matrices = np.stack([rigid(rotation([1, 2, 3], 0.7 * t), [3, -t, 2]) @ character.bind for t in range(7)])
    column = np.arange(16, 24)      # one ring of the body, away from its rims
    truth = np.zeros((7, len(column) + 1, 3))
    for t in range(7):
        body = posed(character.body_vertices, character.body_weights, matrices[t], character.bind)
        truth[t, :-1] = body[column] + 0.004 * (body[column] - body[column].mean(0)) / 0.12
        truth[t, -1] = body[column].mean(0) + [0, 0, 9]
    found = body_planes.planes(matrices, truth, character, np.arange(len(column) + 1)).astype(float)
    assert found.shape == (4, 9, 4)
    assert (found[:, -1] == 0).all()                        # out of reach
    assert np.abs(np.linalg.norm(found[:, :-1, 1:], axis=-1) - 1).max() < 2e-3
    for row, t in enumerate(range(0, 7, body_planes.EVERY)):
        outward = truth[t, :-1] - truth[t, :-1].mean(0)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        assert (found[row, :-1, 1:] * outward).sum(1).min() > 0.999
        assert np.abs(found[row, :-1, 0] - 0.004).max() < 1e-5


def test_parts_that_cloth_may_not_touch_have_no_planes(tiny):
    character = character_of(tiny)
    matrices = np.broadcast_to(character.bind, (2, *character.bind.shape))
    truth = np.broadcast_to(1.01 * character.body_vertices[16:24], (2, 8, 3)).astype(float)
    touching = body_planes.planes(matrices, truth, character, np.arange(8))
    assert (np.abs(touching[..., 1:]).max(-1) > 0.5).all()
    character.touches, character.body_parts = np.full(8, 1), np.full(len(character.body_vertices), 2)
    assert (body_planes.planes(matrices, truth, character, np.arange(8)) == 0).all()


def test_depth_below_the_plane():
    plane = torch.tensor([[0.03, 0, 0, 1], [0.001, 0, 0, 1], [0, 0, 0, 0], [-0.004, 0, 0, 1]])
    error = torch.tensor([[9, 9, -0.05], [0, 0, -0.003], [7.0, 7, 7], [0, 0, 0]])
    # 22 mm to the margin; 3 mm below where the truth has 1 mm of room; no plane; no worse than the truth.
    assert float(losses.below(plane, error)) == pytest.approx((0.022 + 0.003) / 4, rel=1e-5)
    assert float(losses.below(plane, torch.zeros(4, 3))) == 0
    assert float(losses.below(plane, torch.tensor([0, 0, 1.0]).expand(4, 3))) == 0


def test_windows_see_planes_of_their_own_frames_alone(tiny):
    character = character_of(tiny)
    clips = dataset.load(dataset.find(str(tiny), "dynamic"), rig.fit(character).rig, character)
    clip = max(clips, key=len)
    rows = np.array([2, 0])
    sampled = -(-len(character.template) // dataset.SAMPLE_EVERY)
    clip.planes = np.arange(-(-len(clip) // body_planes.EVERY) * sampled * 4, dtype=np.float32).reshape(-1, sampled, 4)
    got = clip.planes_at(slice(5, 9), rows)
    assert got.shape == (4, 2, 4) and (got[[0, 2]] == 0).all()
    assert np.array_equal(got[[1, 3]], clip.planes[[3, 4]][:, rows])
    held = clip.planes_at(np.full(3, 4), rows)              # a drape that is held
    assert np.array_equal(held, np.repeat(clip.planes[2:3, rows], 3, 0))
    # of drapes: one each
    clip.planes = np.arange(len(clip) * sampled * 4, dtype=np.float32).reshape(-1, sampled, 4)
    assert np.array_equal(clip.planes_at(np.full(2, 5), rows), np.repeat(clip.planes[5:6, rows], 2, 0))


def test_files_hold_planes_of_clip_and_mirror_image(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(body_planes, "REACH", 0.2)
    character = character_of(tiny)
    fitted = rig.fit(character)
    clips, again = (dataset.load(dataset.find(str(tiny), "dynamic")[:1], fitted.rig, character) for _ in range(2))
    dataset.add_planes(clips, character, str(tmp_path / "planes"))
    assert len(list((tmp_path / "planes").iterdir())) == len(clips) == 2
    assert not np.array_equal(clips[0].planes, clips[1].planes)
    monkeypatch.setattr(body_planes, "planes", None)        # found, not made again
    dataset.add_planes(again, character, str(tmp_path / "planes"))
    assert all(np.array_equal(a.planes, b.planes) for a, b in zip(clips, again))


@pytest.mark.parametrize("weight", [0, 10])
def test_stage_3_keeps_out_of_the_body_where_it_cannot_know_the_swing(tiny, tmp_path, weight):
    """Two clips whose poses say the same: cloth that lies on the body, 20 mm apart. The mean of the two is inside."""
    character = character_of(tiny)
    clips = dataset.load(dataset.find(str(tiny), "dynamic")[:1], rig.fit(character).rig, character)
    count, sides = len(character.template), (0.01, -0.01)
    for clip, side in zip(clips, sides):
        clip.pose.linear = torch.eye(3).expand(len(clip), 1, 3, 3)
        clip.residual = np.zeros((len(clip), count, 3), np.float16)
        clip.residual[..., 2] = side
        clip.planes = np.zeros((len(clip), -(-count // dataset.SAMPLE_EVERY), 4), np.float16)
        clip.planes[..., 3] = side > 0      # the body lies below the higher one; the other one is far from it
    options = train.arguments(["--data", str(tiny), "--out", str(tmp_path), "--validation", "a/held", "--collision",
                               str(weight), "--head-epochs", "60", "--head-rate", "0.01", "--head-noise", "0",
                               "--head-dropout", "0"])
    static = SimpleNamespace(template=torch.zeros(count, 3), weights=lambda: torch.ones(count, 1))
    along_z = np.zeros((1, 3 * count), np.float32)
    along_z[0, 2::3] = 1
    head = mesh_head.Head(1, 4, along_z, np.array([0.01]), options)
    u = [torch.ones(len(clip), 1) for clip in clips]
    mesh_head.fit_standing("mesh_head", head, u, u, static, clips, clips, options, str(tmp_path), lambda line: None,
                           keep_last=True)
    height = float(head.eval()(u[0][:1]).detach())
    assert height > 0.0095 if weight else abs(height) < 0.005
