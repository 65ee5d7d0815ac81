"""Windows of stage 3's training: what they cover, how states are carried, what they are learned against."""
import numpy as np
import pytest
import torch

from conftest import tube
from dcloth_training import dataset, fit_mesh, fit_skeleton, geometry, mesh_bptt, mesh_windows, rig
from dcloth_training.stages.mesh_stage import MeshStage
from dcloth_training.stages.skeleton_stage import SkeletonStage


class Options:
    chunk, mesh_windows = 8, 24


def clip(length, seed):
    """A clip whose pose says its tick: body_frame [T, 1, 3, 4]."""
    frames = torch.randn(length, 1, 3, 4, generator=torch.Generator().manual_seed(seed))
    pose = type("P", (), {"body_frame": frames, "__len__": lambda self: length})()
    return dataset.Clip(f"c{seed}", "", False, pose, 30.0)


def body_points(n):
    """Stands for network.BodyPoints: n points that differ, [B, 1, 3, 4] -> [n, B, 3]."""
    place = torch.linspace(0.5, 1.5, n)[:, None, None]
    return lambda frames: place * frames[:, 0, :, 3]


@pytest.fixture
def mesh():
    vertices, faces, _ = tube(0.2, 4, 6, 1.0, 0.5)
    torch.manual_seed(1)
    return MeshStage(*geometry.padded_neighbours(faces, len(vertices)), torch.zeros(3), torch.ones(3), 8, 2, 4, 2)


def test_an_epoch_repeats_with_its_seed_and_covers_long_clips_more():
    clips = [clip(length, i) for i, length in enumerate((7, 16, 40, 400))]
    first, again, other = (mesh_windows.groups(clips, 8, 200, torch.Generator().manual_seed(s)) for s in (1, 1, 2))
    assert [(f, s) for _, f, s in first] == [(f, s) for _, f, s in again] != [(f, s) for _, f, s in other]
    drawn = [c.name for some, _, _ in first for c in some]
    assert len(drawn) == 200 and "c0" not in drawn                 # too short for a warm-up and a step
    assert drawn.count("c3") > 5 * drawn.count("c2") > 0
    for some, firsts, steps in first:
        assert 2 <= steps <= mesh_windows.STEPS
        assert all(f >= 0 and f + 8 * steps <= len(c) for c, f in zip(some, firsts))
    late = [f for some, firsts, _ in first for c, f in zip(some, firsts) if len(c) == 400]
    assert 0.1 < np.mean([f == 0 for f in late]) < 0.4 and max(late) > 250
    with pytest.raises(ValueError, match="no clip of 16 ticks"):
        mesh_windows.groups(clips[:1], 8, 4, torch.Generator())


def test_states_are_carried_from_step_to_step(mesh):
    """s of every step is that of one long run from the window's first tick; only counted lanes are handed out."""
    clips = [clip(length, i) for i, length in enumerate((100, 90, 64, 130, 75, 80, 99, 120))]
    points, run = body_points(24), mesh_bptt.Torch(mesh)
    seen, starts = 0, {}
    # Every window begins where its first step says, so the first is told by the earliest tick of a lane's clip.
    for some, firsts, steps in mesh_windows.groups(clips, 8, 24, torch.Generator().manual_seed(5)):
        for c, f in zip(some, firsts):
            starts.setdefault(c.name, set()).add((f, steps))
    for ticks, s, of in mesh_windows.run(run, points, clips, Options, torch.Generator().manual_seed(5)):
        assert s.requires_grad and s.shape == (8, len(of), 24) and len(ticks) == len(of) > 0
        for lane, (c, t) in enumerate(zip(of, ticks)):
            matches = []
            for first, steps in starts[c.name]:
                step = (t.start - first) / 8
                if step in range(steps) and (step > 0 or first == 0):
                    with torch.no_grad():
                        frames = c.pose.body_frame[None, first:t.stop]
                        alone = run.run(mesh_bptt.window_points(points, frames), run.fresh(1))[-8:, 0]
                    matches.append(torch.allclose(alone, s[:, lane].detach(), atol=1e-5))
            assert any(matches)
            seen += 1
    assert seen > 100


def test_embedding_a_clip_does_not_depend_on_its_neighbours(mesh):
    clips = [clip(length, i) for i, length in enumerate((33, 70, 5, 64))]
    run, points = mesh_bptt.Torch(mesh), body_points(24)
    together = mesh_windows.embed(run, points, clips)
    for c, rows in zip(clips, together):
        assert rows.shape == (len(c), 24)
        assert np.allclose(rows, mesh_windows.embed(run, points, [c], ticks=7)[0], atol=1e-5)


def test_patches_are_means_over_near_vertices():
    vertices, _, _ = tube(0.2, 8, 12, 1.0, 0.5)
    embedded = [np.random.default_rng(i).standard_normal((30, 96)).astype(np.float32) + 3 for i in range(3)]
    patches = fit_mesh.Patches(vertices, 10, embedded)
    assert patches.directions.shape == (10, 96) and np.allclose(patches.directions.sum(1), 1)
    assert ((patches.directions > 0).sum(0) == 1).all()            # every vertex in one patch
    spread = [np.linalg.norm(vertices[d > 0] - vertices[d > 0].mean(0), axis=1).max() for d in patches.directions]
    assert max(spread) < 0.2
    u = patches.reduce(torch.from_numpy(np.concatenate(embedded)))
    assert torch.allclose(u.mean(0), torch.zeros(10), atol=1e-3) and torch.allclose(u.std(0), torch.ones(10), atol=0.02)


def test_what_stage_2_leaves_is_the_same_read_or_subtracted(tiny):
    character = rig.read_character(str(tiny / "character.safetensors"))
    fitted = rig.fit(character)
    clips = dataset.load(dataset.find(str(tiny), "dynamic"), fitted.rig, character)
    torch.manual_seed(2)
    n, d = len(character.template), clips[0].pose.x.shape[1]
    for low_rank in (True, False):
        stage = SkeletonStage(n, d, 12)
        with torch.no_grad():
            stage.basis.normal_()
            if low_rank:
                stage.basis.copy_((torch.randn(12, 3) @ torch.randn(3, 3 * n)).reshape(12, n, 3))
        generator = np.random.default_rng(4)
        for c in clips:
            c.residual = generator.standard_normal((len(c), n, 3)).astype(np.float16)
        fit_skeleton.add_coarse(stage, lambda x: x, clips)
        assert clips[0].coarse[1].shape == (3 if low_rank else 12, n, 3) and clips[0].coarse[1] is clips[1].coarse[1]
        ticks, rows = slice(4, 20), np.array([5, 0, 17])
        for c in clips:
            with torch.no_grad():
                coarse = stage.displacement(stage(c.pose.x[None])[0])[0].numpy()
            expected = (c.residual.astype(np.float32) - coarse)[ticks][:, rows]
            read = c.remainder(ticks, rows)
            assert np.abs(read - expected).max() < 1e-4 * np.abs(coarse).max()
            fit_skeleton.subtract([c])
            assert c.coarse is None
            assert np.abs(c.remainder(ticks, rows) - expected).max() < 2e-3 * np.abs(coarse).max()   # float16
