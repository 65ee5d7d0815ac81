"""Stage 3: graph-recurrent layers and their head, stages 1 and 2 frozen.

Two ways, and the one with the lower validation error is kept: a head on the initial layers (random recurrent features
already tell poses and their recent past apart; minutes), and truncated back-propagation through time of layers and
head together, on windows of all clips. There the head reads means of s over patches of cloth: with n h weights of its
own it overfits in an epoch, and a patch keeps what a graph layer knows, which is local.
"""
import copy

import numpy as np
import torch
from torch import nn

from . import fit_skeleton, losses, loop, mesh_bptt, mesh_head, mesh_windows, shards, unskin, workers

# Its options of train: (default, least, what).
OPTIONS = {
    "mesh-size": (64, 1, "k_M"), "mesh-width": (8, 1, "F"), "mesh-layers": (3, 1, "L"), "mesh-hidden": (256, 1, "h"),
    "mesh-epochs": (10, 0, "of truncated back-propagation through time"),
    "mesh-windows": (256, 1, "windows of clips in one such epoch"),
    "mesh-patches": (192, 1, "of cloth, whose means the head reads then"), "mesh-rate": (1e-3, None, None),
    "chunk": (16, 1, "ticks that a gradient goes back, a step"),
    "head-clips": (10 ** 6, 1, "clips drawn for stage 3, at most"), "head-rank": (32, 1, None),
    "head-epochs": (40, 0, None), "head-rate": (3e-4, None, None), "head-dropout": (0.3, None, None),
    "head-noise": (0.5, None, None), "head-decay": (0.3, None, None)}
BASIS_EVERY = 2
VERTICES = 512


def draw(clips, options):
    """At most options.head_clips of `clips`: what stage 3's head learns from, residuals and embeddings in memory."""
    chosen = np.random.default_rng(options.seed).permutation(len(clips))[:options.head_clips]
    return [clips[i] for i in sorted(chosen)]


class Patches:
    """u [.., r] from s [.., n]: standardised means over r patches of cloth; as mesh_head.Embeddings, without a fit."""

    def __init__(self, template, rank, embedded):
        """template [n, 3], embedded: some s [T, n], which say what u's mean and deviation are."""
        points = np.asarray(template, np.float64)
        distance, centres = np.full(len(points), np.inf), []
        while len(centres) < min(rank, len(points)):   # each the farthest from all before it
            centres.append(int(distance.argmax()) if centres else 0)
            distance = np.minimum(distance, np.linalg.norm(points - points[centres[-1]], axis=1))
        owner = np.linalg.norm(points[:, None] - points[centres], axis=2).argmin(1)
        self.directions = (owner == np.arange(len(centres))[:, None]).astype(np.float32)
        self.directions /= self.directions.sum(1, keepdims=True)
        self.mean = np.mean([e.mean(0) for e in embedded], 0).astype(np.float32)
        rows = np.concatenate([(e - self.mean) @ self.directions.T for e in embedded])
        self.deviation = np.maximum(rows.std(0), 1e-3 * rows.std()).astype(np.float32)

    def reduce(self, s):
        """The same of a tensor, with gradient."""
        mean, directions, deviation = (torch.from_numpy(v).to(s.device)
                                       for v in (self.mean, self.directions, self.deviation))
        return (s - mean) @ directions.t() / deviation


class Learner(nn.Module):
    """What back-propagation through time trains: layers and embedding of the stage, and its head."""

    def __init__(self, mesh, head):
        super().__init__()
        self.layers, self.embed, self.head = mesh.layers, mesh.embed, head


def train_layers(mesh, body_points, static, components, deviations, everything, validation, options, folder, log=print):
    """Back-propagation through time -> ({step: history}, error in metres); leaves its best epoch in `mesh`."""
    count, every = len(static.template), 8
    weights = static.weights().detach()
    device = weights.device
    recurrence = mesh_bptt.recurrence(mesh, log)
    patches = Patches(static.template.cpu(), options.mesh_patches,
                      mesh_windows.embed(recurrence, body_points, validation))
    torch.manual_seed(options.seed)
    head = mesh_head.Head(len(patches.directions), mesh.mlp[0].out_features, components, deviations, options).to(device)

    def reduced(clips):
        return mesh_windows.embed(recurrence, body_points, clips, keep=lambda s: patches.reduce(torch.from_numpy(s)))

    # A head that asks the standing layers for something: from zero their gradient would be noise.
    histories = {"mesh_patches": mesh_head.fit_standing(
        "mesh_patches", head, reduced(everything), reduced(validation), static, everything, validation, options, folder,
        log, keep_last=True)[0]}
    learner = Learner(mesh, head)
    log(f"mesh_layers: {'C++' if isinstance(recurrence, mesh_bptt.Native) else 'PyTorch'}, {len(everything)} clips")
    coarse = head.components.reshape(-1, count, 3)[:, ::every].flatten(1)

    def batches(generator, shard=shards.WHOLE):
        for ticks, s, clips in mesh_windows.run(recurrence, body_points, everything, options, generator, shard):
            rows, planes = mesh_head.drawn(count, VERTICES, clips, ticks, generator)
            target = np.stack([c.remainder(t, rows.numpy()) for c, t in zip(clips, ticks)])
            columns = head.components.reshape(-1, count, 3)[:, rows].flatten(1)
            delta = (head(patches.reduce(s.transpose(0, 1))) @ columns).reshape(target.shape)
            linear = torch.stack([c.pose.linear[t] for c, t in zip(clips, ticks)]).to(device)
            error = losses.skinned(linear, weights[rows], delta - torch.from_numpy(target).to(device))
            yield losses.outside(error, None if planes is None else planes.to(device), options.collision)

    @torch.no_grad()
    def predicted():
        return [(head(u.to(device)) @ coarse).reshape(len(u), -1, 3) for u in reduced(validation)]

    def validate():
        return mesh_head.best_shrink(weights[::every], validation, predicted(), every)[1]

    layers = list(mesh.layers.parameters()) + list(mesh.embed.parameters())
    histories["mesh_layers"] = loop.fit("mesh_layers", learner, options.mesh_epochs, batches, validate, folder,
                                        seed=options.seed, rate=options.mesh_rate, followers=layers,
                                        shards=options.shards, log=log)
    shrink, error = mesh_head.best_shrink(weights[::every], validation, predicted(), every)
    log(f"mesh_layers: basis times {shrink:.1f}, {1e3 * error:.3f} mm on validation")
    head.unfold(mesh, patches, shrink)
    return histories, error


def train(mesh, body_points, static, drawn, everything, validation, options, folder, log=print):
    """-> {step: history}; leaves the better of the two steps in `mesh`.

    drawn: clips for the head and the basis, stage 2 subtracted; everything: clips for back-propagation through time.
    """
    count = len(static.template)
    components, deviations = workers.from_first(lambda: unskin.principal(
        lambda: (c.wanted(slice(None, None, BASIS_EVERY)).reshape(-1, 3 * count) for c in drawn),
        sum(-(-len(c) // BASIS_EVERY) for c in drawn), len(mesh.basis), options.seed))
    if len(components) < len(mesh.basis):
        raise ValueError(f"stage 3: {len(components)} frames for a basis of {len(mesh.basis)}; lower --mesh-size or "
                         f"give it more clips")
    initial = copy.deepcopy(mesh.state_dict())
    found, lowest = mesh_head.fit("mesh_head", mesh, body_points, static, components, deviations, drawn, validation,
                                  options, folder, log)
    histories = {"mesh_head": found}
    best = copy.deepcopy(mesh.state_dict())
    if options.mesh_epochs:
        mesh.load_state_dict(initial)
        found, reached = train_layers(mesh, body_points, static, components, deviations, everything, validation,
                                      options, folder, log)
        histories.update(found)
        if reached < lowest:
            lowest, best = reached, copy.deepcopy(mesh.state_dict())
    mesh.load_state_dict(best)
    mesh.eval()
    log(f"mesh: kept {1e3 * lowest:.2f} mm on validation")
    return histories


def train_stage(run):
    """Stage 3 of a training -> {step: history}; with --head-data on clips that stage 2 never saw."""
    options, seen = run.options, run.training
    if options.head_data:
        seen = run.unseen_clips()
        run.unskin(seen)
        run.log(f"stage 3: {len(seen)} {run.images} that stage 2 never saw")
    everything = (seen if options.head_data else []) + (run.training if options.mesh_epochs else [])
    seen = draw(seen, options)
    fit_skeleton.add_coarse(run.net.skeleton, run.net.standardise,
                            list({id(c): c for c in everything + seen + run.validation}.values()))
    fit_skeleton.subtract(seen + run.validation)
    run.stage_3_clips = seen + everything
    return train(run.net.mesh, run.net.mesh.body_points, run.net.static, seen, everything, run.validation, options,
                 options.out, run.log)
