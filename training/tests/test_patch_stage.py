"""Patches of a garment, and the patch stage: PyTorch, C++ and its gradient, and a whole training of it."""
import json

import numpy as np
import pytest
import torch

from dcloth_training import (bundle, features, fit_patch, make, metrics, network, patch_bptt, patch_cut, patch_losses,
                             patch_map, patch_streams, patches, reference, safetensors_io, sequence, synthetic,
                             synthetic_body, train)
from dcloth_training.compare import __main__ as compare
from dcloth_training.rig import Character, mirrored_joints
from dcloth_training.truth.errors import TruthError

RINGS, COLUMNS = 12, 40
WIDTH = 16


def character():
    """A skirt of 480 vertices with a mirror image on the synthetic body."""
    names, parents, bind = synthetic_body.skeleton()
    body, faces, weights = synthetic_body.body(bind)
    template, cloth_faces = synthetic.skirt(RINGS, COLUMNS)
    template[np.abs(template) < 1e-9] = 0
    ring, column = np.divmod(np.arange(RINGS * COLUMNS), COLUMNS)
    return Character(names, mirrored_joints(names), bind, body.astype(np.float32), faces, weights.astype(np.float32),
                     template.astype(np.float32), cloth_faces, (ring * COLUMNS + (-column) % COLUMNS).astype(np.int32),
                     np.ones(len(body), bool), parents)


@pytest.fixture(scope="module")
def worn():
    return character()


def on_hips(whole):
    skin = np.zeros((len(whole.template), len(whole.joint_names)))
    skin[:, 0] = 1
    return skin


@pytest.fixture(scope="module")
def layout(worn):
    return patch_cut.make(worn, on_hips(worn), columns=4, rows=3)


def cloth(whole, matrices):
    """A made-up garment that trails behind the hips' turns: [T, n, 3]."""
    relative, lag, out = features.relative(matrices, whole.bind)[:, 0], None, []
    for pose in relative:
        lag = pose if lag is None else lag + 0.3 * (pose - lag)
        share = ((1.05 - whole.template[:, 1:2]) / 0.55).clip(0, 1)
        near, far = (whole.template @ m[:3, :3].T + m[:3, 3] for m in (pose, lag))
        out.append((1 - share) * near + share * far)
    return np.stack(out)


def test_every_vertex_is_in_the_patches_and_mirror_images_are_exact(worn, layout):
    share = layout.points_of.toarray()
    assert layout.sizes == (8, 3)
    assert (share > 0).any(0).all() and np.allclose(share.sum(1), 1)
    assert sorted(layout.mirror[layout.mirror]) == list(range(8)) and (layout.mirror != np.arange(8)).all()
    matrices = synthetic_body.motion(12, 30.0, 3)
    truth = cloth(worn, matrices)
    found = patches.displacements(layout, features.relative(matrices, worn.bind), truth)
    swapped = features.mirror_pose(matrices, worn.joint_mirror)
    other = patches.displacements(layout, features.relative(swapped, worn.bind),
                                  features.mirror_cloth(truth, worn.mirror))
    assert np.abs(found).max() > 0.02
    np.testing.assert_allclose(other, patches.mirrored(layout, found), atol=1e-6)


def test_patches_see_the_legs_of_their_side_first(worn, layout):
    names = np.array(worn.joint_names)[layout.capsule_joints]
    for k in range(8):
        sides = [names[c][0] for c in layout.limbs[k, :, 0]]
        assert all("UpLeg" in names[c] for c in layout.limbs[k, :, 0])
        assert sides == (["L", "R"] if layout.centres[k, 0] > 0 else ["R", "L"])


def test_neighbours_go_around_the_skirt(layout):
    first, seen = 0, []
    for _ in range(8):
        seen.append(first)
        first = layout.near[0, 1, first]
    assert first == 0 and sorted(seen) == list(range(8))
    assert (layout.near[0, 0][layout.near[0, 1]] == np.arange(8)).all()


def test_a_garment_without_a_mirror_image_and_open_in_front_is_cut_from_its_opening():
    whole = character()
    whole.mirror = None
    faces = whole.faces.reshape(RINGS - 1, COLUMNS, 2, 3)
    whole.faces = np.ascontiguousarray(faces[:, 1:].reshape(-1, 3))     # without the cells left of the middle
    kept = np.unique(whole.faces)
    whole.template, whole.faces = whole.template[kept], np.searchsorted(kept, whole.faces)
    found = patch_cut.make(whole, on_hips(whole), columns=4, rows=3)
    assert found.mirror is None and found.sizes == (8, 3)
    ends = [k for k in range(8) if k in (found.near[0, 0, k], found.near[0, 1, k])]
    assert len(ends) == 2 and (np.abs(found.centres[ends, 0]) < 0.15).all() and (found.centres[ends, 2] > 0.15).all()


def test_sleeves_have_patches_of_their_own_that_see_their_arm():
    whole = character()
    names = whole.joint_names
    skin = on_hips(whole)
    arm, heights = names.index("LeftArm"), whole.template[:, 1]
    lower = heights < np.median(heights)
    skin[lower, 0], skin[lower, arm] = 0, 1     # a strange garment: what hangs low lies on the left arm
    whole.mirror = None
    found = patch_cut.make(whole, skin, columns=4, rows=2, sleeve_columns=2)
    assert found.sizes == (12, 2) and found.near.shape == (3, 3, 12)
    sleeve = np.flatnonzero(found.patch_joint == arm)
    assert len(sleeve) == 4
    across = found.near[0, 2]
    assert set(across[sleeve]) <= set(range(12)) - set(sleeve) and set(across[np.arange(8)]) <= {*sleeve, *range(8)}
    assert (across[across[sleeve]] != across[sleeve]).all()


def test_garments_and_characters_that_cannot_be_cut_are_told(worn):
    with pytest.raises(ValueError, match="fewer columns"):
        patch_cut.make(worn, on_hips(worn), columns=100)
    bare = character()
    bare.parents = None
    with pytest.raises(ValueError, match="no parents of joints"):
        patch_cut.make(bare, on_hips(bare))


def test_wrinkles_that_are_known_in_part_are_drawn_in_full_size(worn, layout):
    """Truth: what points tell, and as much again that they do not tell."""
    numbers, points, n = np.random.default_rng(3), int(np.prod(layout.sizes)), len(worn.template)
    mesh = metrics.Mesh(worn.faces, worn.template)
    told = numbers.standard_normal((3 * points, 3 * n)).astype(np.float32) * 0.02

    def frames(count):
        moved = 0.05 * numbers.standard_normal((count, layout.sizes[0], 3, layout.sizes[1])).astype(np.float32)
        rows = moved.transpose(0, 1, 3, 2).reshape(count, -1)
        own = rows @ told
        return moved, (0.1 + own + own.std() * numbers.standard_normal(own.shape)).reshape(count, n, 3)

    groups = patch_map.groups_of(layout, worn.template)
    sources = patch_map.sources_of(layout, worn.template, points)
    moments, (moved, truth) = patch_map.Moments(points, n), frames(2000)
    moments.add(moved, truth.astype(np.float32))
    moved, truth = frames(200)
    made = fit_patch.stage_of(layout, WIDTH, n, points)
    made.groups, made.sources = torch.from_numpy(groups.astype(np.int64)), torch.from_numpy(sources.astype(np.int64))

    def drawn(of):
        fit_patch.draw_with(made, of)
        shapes = torch.stack([made.displacement(torch.from_numpy(u).flatten()) for u in moved]).detach().numpy()
        found = patch_map.Liveliness(mesh)
        found.add(shapes, truth)
        return found, np.linalg.norm(shapes - truth, axis=-1).mean(), shapes

    flat, error, still = drawn(moments)
    assert (flat.drawn < 0.7 * flat.wanted).all() and (flat.wanting() > 1.05).all()
    lively, more, shapes = drawn(moments.livelier(mesh, flat.wanting()))
    assert np.sqrt(lively.drawn / lively.wanted) == pytest.approx(patch_map.LIVELY, abs=0.05)
    assert more < 1.15 * error
    assert np.abs(shapes.mean(0) - still.mean(0)).max() < 0.02     # the mean shape is that of the truth
    made_up = patch_map.Liveliness(mesh)
    made_up.add(0.01 * numbers.standard_normal(truth.shape), truth)
    assert (made_up.wanting() < 0.2).all()                          # wrinkles that have nothing to do with it


def stage(layout, vertices, seed=2):
    """(PatchStage in float64, flat weights) with every weight away from its start."""
    native = patch_bptt.Native(layout, 52, WIDTH, fit_patch.EMBEDDING, torch.float64)
    generator = torch.Generator().manual_seed(seed)
    weights = 0.3 * torch.randn(native.size, generator=generator, dtype=torch.float64)
    made = fit_patch.stage_of(layout, WIDTH, vertices, 4).double()
    for name in ("axes", "centres", "point_parts", "capsules"):
        setattr(made, name, torch.as_tensor(getattr(layout, name)))
    return made, native, weights


def poses_of(worn, frames, seed=5):
    matrices = synthetic_body.motion(frames, 30.0, seed)
    wind = np.tile([1.0, 0.0, 2.0], (frames, 1))
    relative = features.relative(matrices, worn.bind)
    return torch.from_numpy(patches.poses(relative, matrices[:, 0, :3, 3], wind)).double()


def test_the_window_in_cpp_is_the_stage_tick_by_tick(worn, layout):
    """Values; the gradient is checked against differences of the same window, below."""
    made, native, weights = stage(layout, len(worn.template))
    fit_patch.fill(made, weights)
    poses = poses_of(worn, 9)
    start = torch.zeros(1, *layout.sizes[:1], 3, layout.sizes[1], dtype=torch.float64)
    first = torch.cat([poses[:1], poses[:1], poses])
    first[:3, -6:-3] = 0
    moved = native.forward(weights, first[None].contiguous(), start.clone(), start.clone(),
                           torch.zeros(1, layout.sizes[0], WIDTH, dtype=torch.float64))
    state, rows = None, []
    for pose in first[2:]:
        matrices = pose[:-6].reshape(-1, 3, 4)
        state = state or made.fresh_state(matrices)
        rows.append(made.tick(matrices, pose[-6:-3], pose[-3:], state).detach())
    expected = torch.stack(rows)
    assert expected.abs().max() > 0.05
    assert float((moved[:, 0] - expected).abs().max()) < 1e-10


def test_the_gradient_is_that_of_the_loss(worn, layout):
    """Central differences, with the weights that read the distance to the body at zero: it has no gradient."""
    _, native, weights = stage(layout, len(worn.template))
    c = native.counts
    inputs, points = 19 * c["points"] + 33 + c["embedding"], c["points"]
    first, last = 9 * points, 19 * points
    enter = weights[c["patches"] * c["embedding"]:][:WIDTH * inputs].view(WIDTH, inputs)
    skip = weights[-(3 * points * inputs + points):-points].view(3 * points, inputs)
    enter[:, first:last] = 0
    skip[:, first:last] = 0
    poses = torch.stack([poses_of(worn, 6, seed) for seed in (5, 6)]).contiguous()
    generator = torch.Generator().manual_seed(3)

    def random(*shape):
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    size = (2, layout.sizes[0], 3, points)
    last_, before, hidden = 0.05 * random(*size), 0.05 * random(*size), 0.3 * random(2, layout.sizes[0], WIDTH)
    noise, by = 0.01 * random(4, *size), random(4, *size)

    def loss(w):
        return (by * patch_bptt.window(w, native, poses, last_.clone(), before.clone(), hidden.clone(), noise)).sum()

    asked = weights.clone().requires_grad_()
    loss(asked).backward()
    step = 1e-6
    picked = torch.randperm(native.size, generator=generator)[:150].tolist()
    for i in picked + list(range(native.size - points, native.size)):
        if weights[i] == 0:
            continue
        off = torch.zeros_like(weights)
        off[i] = step
        with torch.no_grad():
            expected = float(loss(weights + off) - loss(weights - off)) / (2 * step)
        assert float(asked.grad[i]) == pytest.approx(expected, rel=1e-4, abs=1e-5 * float(asked.grad.abs().max()))


def test_another_window_between_forward_and_backward_is_refused(worn, layout):
    _, native, weights = stage(layout, len(worn.template))
    poses = poses_of(worn, 4)[None].contiguous()
    start = [torch.zeros(1, layout.sizes[0], 3, layout.sizes[1], dtype=torch.float64) for _ in range(2)]
    hidden = torch.zeros(1, layout.sizes[0], WIDTH, dtype=torch.float64)
    asked = weights.requires_grad_()
    first = patch_bptt.window(asked, native, poses, *start, hidden)
    patch_bptt.window(asked, native, poses, *start, hidden)
    with pytest.raises(RuntimeError, match="another window"):
        first.sum().backward()


@pytest.fixture(scope="module")
def data(worn, tmp_path_factory):
    folder = tmp_path_factory.mktemp("patches")
    (folder / "dynamic").mkdir()
    safetensors_io.write(folder / "character.safetensors", {
        "joint_bind": worn.bind.astype(np.float32), "body_vertices": worn.body_vertices, "body_faces": worn.body_faces,
        "body_weights": worn.body_weights, "body_collider": np.ones(len(worn.body_vertices), np.uint8),
        "cloth_template": worn.template, "cloth_faces": worn.faces, "mirror": worn.mirror},
        {"joint_names": json.dumps(worn.joint_names), "parents": json.dumps([int(p) for p in worn.parents]),
         "joint_mirror": json.dumps(worn.joint_mirror),
         "feature_joints": json.dumps(["Hips", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg"])})
    # One clip is shorter than the way from frame to frame that the map is fitted to.
    for seed, (name, ticks) in enumerate({"a/one": 60, "a/two": 60, "a/held": 60, "a/short": 5}.items()):
        matrices = synthetic_body.motion(ticks, 30.0, seed)
        sequence.write(folder / "dynamic" / f"{name.replace('/', '-')}.safetensors", sequence.Sequence(
            matrices, cloth(worn, matrices), worn.joint_names, 30.0, name, "dynamic"))
    return folder


def trained(data, out, *more):
    return train.run(train.arguments([
        "--data", str(data), "--out", str(out), "--validation", "a/held", "--stages", "patch", "--static-base", "rigid",
        "--root-motion", "air", "--threads", "1", "--patch-columns", "4", "--patch-rows", "3", "--patch-width", "16",
        "--patch-streams", "4", "--patch-window", "8", "--static-width", "8", *more]))


def test_make_cuts_what_the_garment_has_vertices_for_and_trains_patches(data, tmp_path):
    path = data / "character.safetensors"
    tensors, metadata = safetensors_io.read(path)
    assert make.columns_of(str(path)) == 4      # 480 vertices
    (tmp_path / "lost").mkdir()
    lost = str(tmp_path / "lost" / "character.safetensors")
    of_hips = np.zeros_like(tensors["body_weights"])
    of_hips[:, 0] = 1
    safetensors_io.write(lost, {**tensors, "body_weights": of_hips}, metadata)
    with pytest.raises(TruthError, match="no limb among the joints.*--stages mesh"):
        make.columns_of(lost)
    words = ["--character", "h.glb", "--garment", "d.obj", "--out", str(tmp_path)]
    assert make.arguments(words).stages == "mesh"
    options = make.arguments([*words, "--stages", "patch"])
    asked = train.arguments(["--data", "d", "--out", "o", *make.of_stages(options, {"columns": 2})])
    assert (asked.stages, asked.static_base, asked.root_motion, asked.patch_columns) == ("patch", "hung", "air", 2)
    known = bundle.read(asked.patch_from)[0].patch      # the bundled skirt's
    assert known.sizes[1] == asked.patch_rows and known.enter.out_features == asked.patch_width


def test_training_learns_and_its_bundle_plays_the_same(data, tmp_path):
    net, fitted, whole, provenance = trained(data, tmp_path / "run", "--patch-epochs", "60", "--patch-sources", "4")
    with open(tmp_path / "run" / "log.json") as file:
        history = json.load(file)["histories"]["patch"]
    assert history[-1]["validation_mm"] < 0.7 * history[0]["validation_mm"]
    path = tmp_path / "skirt.safetensors"
    bundle.write(path, net, fitted, whole, provenance, half=False)
    again, rig, _, _ = bundle.read(path)
    assert again.last_stage() == "patch" and again.skeleton is None
    item = sequence.read(data / "dynamic" / "a-held.safetensors")
    played = reference.run(again, rig, item.joint_matrices)
    alone = net.run(network.pose_of(item.joint_matrices, fitted.rig, torch.float32))
    assert float((played - alone).norm(dim=-1).max()) < 2e-4
    bolted = reference.run(again, rig, item.joint_matrices, "static")
    off = [float((v - torch.from_numpy(item.truth)).norm(dim=-1)[12:].mean()) for v in (played, bolted)]
    assert off[0] < 0.8 * off[1]

    on = trained(data, tmp_path / "on", "--start", str(path), "--patch-epochs", "0", "--patch-sources", "4")[0]
    for name, value in net.patch.named_parameters():
        assert torch.allclose(value, on.patch.state_dict()[name], atol=1e-6), name
    with pytest.raises(ValueError, match=r"--start.*found patches.*\(8, 3, 16, 7\); expected \(8, 2, 16, 7\)"):
        trained(data, tmp_path / "other", "--start", str(path), "--patch-epochs", "0", "--patch-rows", "2")
    with pytest.raises(ValueError, match="--start.*found patches; it goes on with --stages patch"):
        trained(data, tmp_path / "third", "--start", str(path), "--stages", "skeleton", "--window", "32")

    def errors(name, *more):    # of a garment cut in another way, before training and after an epoch
        trained(data, tmp_path / name, "--patch-columns", "2", "--patch-epochs", "1", "--validate-every", "1", *more)
        with open(tmp_path / name / "log.json") as file:
            return [entry["validation_mm"] for entry in json.load(file)["histories"]["patch"]]
    fresh, carried = errors("fresh"), errors("carried", "--patch-from", str(path))
    assert carried[0] < 0.9 * fresh[0] and carried[1] < fresh[1]
    with pytest.raises(ValueError, match=r"--patch-from.*found points.*\(3, 16, 7, 3\); expected \(2, 16, 7, 3\)"):
        trained(data, tmp_path / "rows", "--patch-from", str(path), "--patch-rows", "2")


def test_the_comparison_names_patches_beside_the_stages(data, tmp_path):
    full, given = tmp_path / "full", tmp_path / "given.safetensors"
    small = ["--data", str(data), "--validation", "a/two", "--held-out", "a/held", "--root-motion", "air",
             "--static-base", "rigid", "--static-width", "8", "--threads", "1"]
    train.run(train.arguments([*small, "--out", str(full), "--stages", "skeleton", "--skeleton-epochs", "1",
                               "--settle-epochs", "0", "--skeleton-size", "8", "--skeleton-rank", "4", "--window", "30",
                               "--patch-columns", "4", "--patch-rows", "3", "--patch-width", "16"]))
    of_patches = train.run(train.arguments([
        *small, "--out", str(tmp_path / "given"), "--stages", "patch", "--patch-columns", "4", "--patch-rows", "3",
        "--patch-width", "16", "--patch-epochs", "1", "--patch-sources", "4"]))
    bundle.write(given, *of_patches, half=False)

    def compared(out, rows, *more):
        found = compare.run(compare.arguments(["--data", str(data), "--full", str(full), "--out", str(tmp_path / out),
                                               "--rows", rows, "--epochs", "1", *more]))
        return {row["key"]: row for row in found["rows"]}

    here = compared("here", "stages_1_2,patches")
    assert list(here) == ["stages_1_2", "patches"] and here["patches"]["fits"]["patch"]["epochs"] == 1
    assert here["patches"]["group"] == "patches" and here["patches"]["parameters"] > 10000
    there = compared("there", "patches", "--patches", str(given))["patches"]
    item = sequence.read(data / "dynamic" / "a-held.safetensors")
    played = of_patches[0].run(network.pose_of(item.joint_matrices, of_patches[1].rig, torch.float32)).numpy()
    off = float(np.linalg.norm(played - item.truth, axis=-1)[12:].mean())     # from a reset, metrics skip them
    assert there["clips"]["a/held"]["position_mm"]["mean"] == pytest.approx(1e3 * off, rel=1e-3)
    with pytest.raises(ValueError, match="--patches .*no patches; expected patches over Hips"):
        compared("wrong", "patches", "--patches", str(full))


def test_where_a_pose_is_held_cloth_is_to_rest(worn, layout):
    item = sequence.Sequence(synthetic_body.motion(60, 30.0, 3), None, worn.joint_names, 30.0, "a/one", "dynamic")
    relative = features.relative(item.joint_matrices, worn.bind)
    truth = patches.displacements(layout, relative, cloth(worn, item.joint_matrices)).astype(np.float16)
    clip = patch_streams.Clip("a/one", patches.poses(relative, item.joint_matrices[:, 0, :3, 3], None), truth)
    streams = patch_streams.Streams([clip], layout, 6, 16, WIDTH, np.random.default_rng(4))
    seen = []
    for window in range(20):
        poses, _, counts, rests = streams.next()
        noise = streams.jitter(16)
        for k in range(6):
            if streams.held[k] is None:
                assert not rests[:, k].any() and counts[:, k].any() and noise[:, k].any()
                continue
            assert not counts[:, k].any() and not noise[:, k].any()
            assert (poses[k, 2:] == poses[k, 2]).all() and not poses[k, 2, -6:].any()
            seen.append((int(streams.at[k]), rests[:, k].tolist()))
    assert seen
    for end, rests in seen:
        ticks = np.arange(end - 16, end)
        assert end <= patch_streams.HELD_TICKS
        np.testing.assert_allclose(rests, ((ticks - 45) / 30).clip(0, 1), atol=1e-6)

    still, moving = torch.zeros(16, 2, *layout.sizes[:1], 3, layout.sizes[1]), torch.zeros(16, 2)
    moving[:, 1] = 1
    swinging = still + 0.001 * torch.arange(1.0, 17.0)[:, None, None, None, None]
    assert float(patch_losses.rest_of(still, still[0], moving)) < 1e-4
    assert float(patch_losses.rest_of(swinging, still[0], moving)) == pytest.approx(30 * 0.001 * 3 ** 0.5, rel=1e-3)
    assert float(patch_losses.rest_of(swinging, still[0], torch.zeros(16, 2))) == 0
    alone = patch_losses.loss_of(still, still, torch.zeros(16, 2), 3.0, patch_losses.Body(layout),
                                 torch.zeros(2, 16, 12 * 52 + 6))
    assert float(alone) == 0                            # a window in which all poses are held


def test_a_stopped_training_goes_on_to_the_same_bits(data, tmp_path):
    whole = trained(data, tmp_path / "whole", "--patch-epochs", "4", "--validate-every", "2")[0]
    calls = []

    def stop(text):
        calls.append(text)
        if "epoch 2/4" in text:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train.Log, "__call__", lambda self, text: stop(text))
        with pytest.raises(KeyboardInterrupt):
            trained(data, tmp_path / "stopped", "--patch-epochs", "4", "--validate-every", "2")
    again = trained(data, tmp_path / "stopped", "--patch-epochs", "4", "--validate-every", "2")[0]
    for name, value in whole.patch.state_dict().items():
        assert torch.equal(value, again.patch.state_dict()[name]), name


def test_the_losses_see_the_limbs_where_the_stage_sees_them(worn, layout):
    made, _, _ = stage(layout, len(worn.template))
    poses, body = poses_of(worn, 5), patch_losses.Body(layout)
    moved = 0.05 * torch.randn(5, layout.sizes[0], 3, layout.sizes[1], generator=torch.Generator().manual_seed(4))
    axes, bases, ends = body.places(poses.float())
    at = bases + axes @ moved
    # The stage tells of the nearer capsule of each limb; limbs are [K, 2, 2] there.
    found = body.distances(at, ends).unflatten(2, (2, 2)).amin(3)
    for t, pose in enumerate(poses):
        matrices = pose[:-6].reshape(-1, 3, 4)
        frames, _, rest = made.frames(matrices)
        there = rest + (frames @ moved[t].double()).transpose(1, 2)
        told = made.beside(frames, there, made.ends(matrices), made.ends(matrices))[:, :, 3]
        expected = (10 * found[t]).clamp(-1.0, 3.0).double()
        assert float((at[t].transpose(1, 2) - there).abs().max()) < 1e-5
        assert float((told - expected).abs().max()) < 1e-4


def test_a_point_in_a_limb_costs_what_it_is_deeper_than_the_truth(worn, layout):
    poses, body = poses_of(worn, 2).float(), patch_losses.Body(layout)
    axes, bases, ends = body.places(poses)
    truth = torch.zeros(2, 1, layout.sizes[0], 3, layout.sizes[1])
    counts = torch.ones(2, 1)
    # The point that is nearest to a limb, moved to that limb's axis and as far the other way.
    distances = body.distances(bases, ends)[0]
    k, limb, r = (int(i) for i in np.unravel_index(int(distances.argmin()), distances.shape))
    start, end = ends[0, body.limbs[k, limb]]
    along = ((bases[0, k, :, r] - start) @ (end - start) / (end - start).square().sum()).clamp(0, 1)
    step = axes[0, k].T @ (start + along * (end - start) - bases[0, k, :, r])

    def cost(moved, of):
        return float(patch_losses.loss_of(moved, truth, counts, 0.0, of, None if of is None else poses[None]))

    def apart(way):
        moved = truth.clone()
        moved[:, 0, k, :, r] = way * step
        return cost(moved, body) - cost(moved, None)

    assert cost(truth, body) == pytest.approx(cost(truth, None), abs=1e-7)
    with pytest.MonkeyPatch.context() as only:
        only.setattr(patch_losses, "STRETCH", 0.0)
        assert apart(-1.0) == pytest.approx(0, abs=1e-7)
        kept = min(float(distances[k, limb, r]), patch_losses.MARGIN)
        radius = float(distances[k, limb, r] - step.norm())     # of the limb there, negative
        expected = patch_losses.COLLISION * (kept - radius) / (2 * layout.sizes[0] * layout.sizes[1])
        assert apart(1.0) >= 0.9 * expected > 0
