"""The patch stage: trained on rollouts that read their own cloth, stage 1 frozen.

Streams of clips play on side by side (patch_streams); a step is a window of ticks of all of them, and its gradient runs
back through the window. What a stage saw in the truth alone it could not use on its own cloth.
"""
import numpy as np
import torch
from torch import nn

from . import (bundle, dataset, loop, metrics, patch_bptt, patch_cut, patch_losses, patch_map, patch_streams, shards,
               unskin)
from .stages.patch_stage import GEOMETRY, INDICES, PatchStage, inputs_of

# Its options of train: (default, least, what).
OPTIONS = {
    "patch-columns": (16, 2, "patches on each side of what hangs from the trunk"),
    "patch-rows": (8, 1, "points a patch"), "patch-width": (128, 8, "a multiple of 8"),
    "patch-sources": (8, 2, "points that a vertex follows, an even number"),
    "patch-epochs": (40, 0, None), "patch-rate": (2e-3, None, None),
    "patch-streams": (16, 1, "clips side by side"), "patch-window": (16, 2, "ticks that a gradient runs back through"),
    "patch-way": (3.0, 0.0, "weight of the way that points go a tick, beside their places"),
    "patch-from": ("", None, "bundle of any garment of patches, whose shared weights learning begins with")}
EMBEDDING = 7           # numbers of its own that a patch learns; with eight points the inputs are a multiple of 64
DECAY = 0.01
KEEP = 2.2              # logistic(KEEP) of a displacement stays at first
WARM_UP = 12            # ticks of a rollout that are not measured
MAP_EVERY = 8           # frames
MAP_FRAMES = 6000       # at most
LIVELY_EVERY = 4        # frames
GAIN_STEPS = 2          # a map of few points gives less than it is asked for


class Learner(nn.Module):
    """The weights, flat, as training/patch_bptt reads them."""

    def __init__(self, native, seed):
        super().__init__()
        self.native = native
        self.weights = nn.Parameter(fresh_weights(native.counts, torch.Generator().manual_seed(seed)))


def fresh_weights(counts, generator):
    """Flat untrained weights of the sizes that a patch_bptt.Native counts."""
    inputs, width, out = inputs_of(counts["points"], counts["embedding"]), counts["width"], 3 * counts["points"]

    def matrix(rows, columns, gain):
        return (2 * torch.rand(rows * columns, generator=generator) - 1) * gain * (3 / columns) ** 0.5

    parts = [0.1 * torch.randn(counts["patches"] * counts["embedding"], generator=generator),
             matrix(width, inputs, 1), torch.zeros(width)]
    for _ in range(counts["layers"]):
        parts += [matrix(width, (1 + counts["neighbours"]) * width, 0.7), torch.zeros(width)]
    parts += [matrix(3 * width, width, 0.7), matrix(3 * width, width, 0.7), torch.zeros(3 * width),
              matrix(out, width, 0.1), torch.zeros(out), torch.zeros(out * inputs),
              torch.full((counts["points"],), KEEP)]
    return torch.cat(parts)


def shared(stage):
    """The parameters of a PatchStage that lie in flat weights as they are, in their order."""
    parts = [stage.embedding, stage.enter.weight, stage.enter.bias]
    parts += [p for layer in stage.mix for p in (layer.weight, layer.bias)]
    return parts + [stage.gates[name] for name in ("weight_ih", "weight_hh", "bias")]


@torch.no_grad()
def flat(stage):
    """The flat weights of a PatchStage: what fill puts into it."""
    of_state, of_inputs = stage.out.weight.split([stage.enter.out_features, stage.enter.in_features], 1)
    parts = [*shared(stage), of_state, stage.out.bias, of_inputs, torch.logit(stage.keep, 1e-6)]
    return torch.cat([part.flatten() for part in parts])


@torch.no_grad()
def fill(stage, weights):
    """Puts flat weights into a PatchStage of the same sizes."""
    width, out = stage.enter.out_features, stage.out.out_features
    at = 0
    for part in shared(stage):
        part.copy_(weights[at:at + part.numel()].reshape(part.shape))
        at += part.numel()
    inputs = stage.enter.in_features
    of_state, bias, of_inputs, keep = weights[at:].split([out * width, out, out * inputs, len(stage.keep)])
    stage.out.weight.copy_(torch.cat([of_state.reshape(out, width), of_inputs.reshape(out, inputs)], 1))
    stage.out.bias.copy_(bias)
    stage.keep.copy_(torch.sigmoid(keep))


@torch.no_grad()
def play(native, weights, clips):
    """Displacements [T, K, 3, R] of clips from a reset, all side by side."""
    longest, c = max(len(clip) for clip in clips), native.counts
    poses = torch.stack([torch.cat([clip.poses, clip.poses[-1:].expand(longest - len(clip), -1)]) for clip in clips])
    last = torch.zeros(len(clips), c["patches"], 3, c["points"])
    out = native.forward(weights, poses, last, last.clone(), torch.zeros(len(clips), c["patches"], c["width"]))
    return [out[:len(clip), k] for k, clip in enumerate(clips)]


def errors(layout, clips, played):
    """[(name, mean distance, how much the truth moves)] of each clip's points, m."""
    rows = []
    for clip, moved in zip(clips, played):
        truth = clip.truth(layout, slice(WARM_UP, None))
        off, motion = (float(patch_losses.lengths(v).mean()) for v in (moved[WARM_UP:] - truth, truth - truth.mean(0)))
        rows.append((clip.name, off, motion))
    return rows


def read(run, layout):
    """(training, validation) clips with mirror images as patch_streams.Clip; the moments that the map is fitted to."""
    net, character, rig = run.net, run.character, run.fitted.rig
    static, known = net.static, {}
    moments = patch_map.Moments(np.prod(layout.sizes), len(character.template))
    every = max(MAP_EVERY, sum(len(c) for c in run.training if not c.mirrored) // MAP_FRAMES)

    def converted(clip, training):
        moved = known.get(clip.path)
        if moved is None and not clip.mirrored:
            found = patch_streams.clip_of(clip, layout, character, rig)
            known[clip.path] = found.moved
            if training:
                frames = slice((len(clip) - 1) % every, None, every)
                truth = dataset.load_truth(clip.path, False, None)[frames]
                delta = unskin.residual(static, net.standardise, clip.pose.at(frames), truth)
                moments.add(found.moved[frames].astype(np.float32), delta)
            return found
        return patch_streams.clip_of(clip, layout, character, rig, moved)

    order = sorted(run.training, key=lambda c: (c.path, c.mirrored))
    return [converted(c, True) for c in order], [converted(c, False) for c in run.validation if not c.mirrored], moments


def stage_of(layout, width, vertices, sources):
    """An untrained PatchStage of a layout."""
    arrays = {**{name: getattr(layout, name) for name in GEOMETRY + INDICES if name != "joints"},
              "joints": layout.patch_joint}
    return PatchStage(arrays, width, EMBEDDING, vertices, sources)


def refuse_another_cut(run, layout):
    """A stage of --start that reads other patches, or other limbs."""
    stage, options = run.before.patch, run.options
    found = (*stage.sizes, stage.enter.out_features, stage.embedding.shape[1])
    wanted = (*layout.sizes, options.patch_width, EMBEDDING)
    alike = found == wanted and all(
        np.array_equal(getattr(stage, name), getattr(layout, "patch_joint" if name == "joints" else name))
        for name in INDICES)
    if not alike:
        raise ValueError(f"--start {options.start}: found patches, points, width and embedding {found}; expected "
                         f"{wanted} in this garment's cut; give the options and the data it was trained with")


@torch.no_grad()
def carried_over(path, stage):
    """Fills a fresh PatchStage with what all patches of another garment's bundle share: how cloth moves. What a patch
    learns of its own stays fresh; neighbours that patches there have not say nothing at first."""
    other = bundle.read(path, torch.float32)[0].patch
    found, wanted = ((s.sizes[1], s.enter.out_features, s.embedding.shape[1], len(s.mix)) if s else None
                     for s in (other, stage))
    if found != wanted:
        raise ValueError(f"--patch-from {path}: found points, width, embedding and layers {found}; expected {wanted}; "
                         f"give --patch-rows and --patch-width of that bundle, or leave it out")
    state = other.state_dict()
    for name, value in stage.named_parameters():
        if name.startswith("mix.") and name.endswith(".weight"):    # neighbours' columns come last
            both = min(value.shape[1], state[name].shape[1])
            value.zero_()[:, :both] = state[name][:, :both]
        elif not name.startswith("map.") and name != "embedding":
            value.copy_(state[name])
    return stage


def train_stage(run):
    """The patch stage of a training -> {"patch": history}."""
    options, character, static = run.options, run.character, run.net.static
    skin = np.zeros((len(character.template), len(character.joint_names)))
    skin[:, run.fitted.rig.bones] = static.weights().detach().cpu().numpy()
    layout = patch_cut.make(character, skin, options.patch_columns, options.patch_rows)
    native = patch_bptt.Native(layout, len(character.joint_names), options.patch_width, EMBEDDING)
    training, validation, moments = read(run, layout)
    if run.before:
        refuse_another_cut(run, layout)
    run.log(f"patch: {layout.sizes[0]} patches of {layout.sizes[1]} points, {native.size} weights")
    learner, body = Learner(native, options.seed), patch_losses.Body(layout)
    if run.before:
        learner.weights.data.copy_(flat(run.before.patch))
    elif options.patch_from:
        began = stage_of(layout, options.patch_width, len(character.template), options.patch_sources)
        fill(began, learner.weights.detach())
        learner.weights.data.copy_(flat(carried_over(options.patch_from, began)))
    window = options.patch_streams * options.patch_window
    steps = max(1, sum(map(len, training)) // window)

    def batches(generator, shard=shards.WHOLE):
        shard.part([], generator)
        numbers = np.random.default_rng(int(torch.randint(1 << 62, (1,), generator=generator)))
        streams = patch_streams.Streams(training, layout, -(-options.patch_streams // shard.count),
                                        options.patch_window, options.patch_width, numbers)
        for _ in range(steps):
            poses, truth, counts, rests = streams.next()
            last = streams.last.clone()
            moved = patch_bptt.window(learner.weights, native, poses, streams.last, streams.before, streams.hidden,
                                      streams.jitter(options.patch_window))
            yield patch_losses.loss_of(moved, truth, counts, options.patch_way, body, poses[:, 2:]) + \
                patch_losses.rest_of(moved, last, rests)

    def validate():
        rows = errors(layout, validation, play(native, learner.weights.detach(), validation))
        return sum(row[1] for row in rows) / len(rows)

    history = loop.fit("patch", learner, options.patch_epochs, batches, validate, options.out, seed=options.seed,
                       rate=options.patch_rate, decay=DECAY, validate_every=options.validate_every,
                       shards=options.shards, log=run.log)
    stage = stage_of(layout, options.patch_width, len(character.template), options.patch_sources)
    fill(stage, learner.weights.detach())
    stage.groups, stage.sources = (torch.from_numpy(v.astype(np.int64)) for v in (
        patch_map.groups_of(layout, character.template),
        patch_map.sources_of(layout, character.template, options.patch_sources)))
    played = play(native, learner.weights.detach(), validation)
    fit_map(run, stage, moments, metrics.Mesh(character.faces, character.template), played)
    run.net.patch = stage
    return {"patch": history}


@torch.no_grad()
def draw_with(stage, moments):
    """Fits the stage's map."""
    weights, offsets = patch_map.fit(moments, stage.groups.numpy(), stage.sources.numpy())
    stage.map["weights"].copy_(torch.from_numpy(weights))
    stage.map["offsets"].copy_(torch.from_numpy(offsets))


def fit_map(run, stage, moments, mesh, played):
    """The map whose wrinkles on validation clips, played [T, K, 3, R] each, are as large as the truth's as far as the
    stage knows them."""
    gains = np.ones(2)
    for _ in range(GAIN_STEPS):
        draw_with(stage, moments.livelier(mesh, gains))
        gains = np.maximum(gains * liveliness(run, stage, mesh, played).wanting(), 1)
    run.log(f"patch: wrinkles times {gains[0]:.2f} (middle) and {gains[1]:.2f} (fine)")
    draw_with(stage, moments.livelier(mesh, gains))


@torch.no_grad()
def liveliness(run, stage, mesh, played):
    """patch_map.Liveliness of what the stage draws on validation clips, every LIVELY_EVERY-th frame."""
    found, frames = patch_map.Liveliness(mesh), slice(WARM_UP, None, LIVELY_EVERY)
    for clip, moved in zip((c for c in run.validation if not c.mirrored), played):
        truth = dataset.load_truth(clip.path, False, None)[frames]
        wanted = unskin.residual(run.net.static, run.net.standardise, clip.pose.at(frames), truth)
        found.add(np.stack([stage.displacement(u.flatten()).numpy() for u in moved[frames]]), wanted)
    return found
