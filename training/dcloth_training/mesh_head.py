"""Stage 3's vertex-level MLP, fitted in a reduced space while the graph layers stand still.

The embedding s [n] of a tick follows a few joints, so its principal components u carry it. An MLP
on u is small, cheap and hard to overfit; W_1 = W_u diag(1 / deviation) V^T unfolds it to n inputs.
"""
import numpy as np
import torch
from torch import nn

from . import dataset, losses, loop, mesh_bptt, mesh_windows, shards, unskin, workers

BATCH = 256
EPOCH_TICKS = 20_000    # at most: an epoch over all clips would outlast the layers' own
VERTICES = 128


class Embeddings:
    """Mean, directions V [r, n] and deviations of training's s, and u of any clip."""

    def __init__(self, embedded, rank, seed):
        self.mean = np.mean([e.mean(0) for e in embedded], 0)
        self.directions, deviation = workers.from_first(lambda: unskin.principal(
            lambda: (e - self.mean for e in embedded), sum(map(len, embedded)), rank, seed))
        # Directions below a thousandth of the first are rounding: they must not be blown up.
        self.deviation = np.maximum(deviation, 1e-3 * deviation[0]).astype(np.float32)

    def reduce(self, s):
        return torch.from_numpy((s - self.mean) @ self.directions.T / self.deviation)


class Head(nn.Module):
    """u [N, r] -> displacement coefficients of the components [k, 3 n]."""

    def __init__(self, rank, hidden, components, deviations, options):
        super().__init__()
        self.mlp = nn.Sequential(nn.Linear(rank, hidden), nn.ReLU(),
                                 nn.Linear(hidden, len(components)))
        nn.init.zeros_(self.mlp[2].weight)
        nn.init.zeros_(self.mlp[2].bias)
        self.options = options
        self.register_buffer("components", torch.from_numpy(components), persistent=False)
        self.register_buffer("scale", torch.from_numpy(deviations.astype(np.float32)),
                             persistent=False)

    def forward(self, u):
        if self.training:
            u = u + self.options.head_noise * torch.randn_like(u)
        hidden = self.mlp[1](self.mlp[0](u))
        if self.training:
            hidden = nn.functional.dropout(hidden, self.options.head_dropout)
        return self.mlp[2](hidden) * self.scale

    @torch.no_grad()
    def unfold(self, mesh, embeddings, shrink=1.0):
        """Write the head into a MeshStage; `shrink` multiplies the basis."""
        deviation, directions, mean = (torch.from_numpy(v).to(self.scale.device) for v in (
            embeddings.deviation, embeddings.directions, embeddings.mean))
        mesh.mlp[0].weight.copy_(self.mlp[0].weight / deviation @ directions)
        mesh.mlp[0].bias.copy_(self.mlp[0].bias - mesh.mlp[0].weight @ mean)
        mesh.mlp[2].load_state_dict(self.mlp[2].state_dict())
        basis = shrink * self.scale[:, None] * self.components
        mesh.basis.copy_(basis.reshape(mesh.basis.shape))


@torch.no_grad()
def best_shrink(weights, clips, predicted, every=8):
    """(factor, error in metres) that makes `predicted` [T, v, 3] of each clip fit best."""
    best = (0.0, float("inf"))
    for factor in np.arange(0.0, 1.31, 0.1):
        error = typical(weights, clips, [float(factor) * delta for delta in predicted], every)
        if error < best[1]:
            best = (float(factor), error)
    return best


@torch.no_grad()
def typical(weights, clips, predicted, every=8):
    """Geometric mean over clips of the error in metres left by `predicted` [T, v, 3] of each.

    Clips differ ten times in how well stage 2 knows them; in their plain mean the least known one
    alone would decide what the wrinkles of all others are worth.
    """
    logs = [np.log(float(losses.skinned_distance(
        clip.pose.linear.to(weights.device), weights,
        delta - torch.from_numpy(clip.wanted(vertices=slice(None, None, every))).to(weights.device))))
        for clip, delta in zip(clips, predicted)]
    return float(np.exp(np.mean(logs)))


def drawn(count, size, clips, ticks, generator):
    """(rows [v] among `count` vertices, the body's planes [B, t, v, 4] there); planes are known for sampled ones."""
    every = dataset.SAMPLE_EVERY if all(clip.planes is not None for clip in clips) else 1
    picked = losses.pick_vertices(-(-count // every), size, generator)
    return every * picked, dataset.planes_of(clips, ticks, picked.numpy())


def fit_standing(stage, head, u, held, static, training, validation, options, folder, log=print, **more):
    """Fit `head` to standing u [T, r] of training clips -> (history, shrink, error in metres); held: of validation."""
    count, every, device = len(static.template), 8, static.template.device
    u, held = torch.cat(u).to(device), [v.to(device) for v in held]
    linear = torch.cat([c.pose.linear for c in training]).to(device)
    place = [(c, t) for c in training for t in range(len(c))]
    weights = static.weights().detach()
    coarse = head.components.reshape(-1, count, 3)[:, ::every].flatten(1)

    def batches(generator, shard=shards.WHOLE):
        order = torch.randperm(len(u), generator=generator)[:EPOCH_TICKS]
        for ticks in shard.batches(order, BATCH, generator):
            clips, at = zip(*(place[i] for i in ticks.tolist()))
            rows, planes = drawn(count, VERTICES, clips, [[t] for t in at], generator)
            target = np.stack([clip.remainder(t, rows.numpy()) for clip, t in zip(clips, at)])
            columns = head.components.reshape(-1, count, 3)[:, rows].flatten(1)
            delta = (head(u[ticks]) @ columns).reshape(target.shape)
            error = losses.skinned(linear[ticks], weights[rows], delta - torch.from_numpy(target).to(device))
            yield losses.outside(error, None if planes is None else planes[:, 0].to(device), options.collision)

    @torch.no_grad()
    def predicted():
        return [(head(v) @ coarse).reshape(len(v), -1, 3) for v in held]

    def validate():
        return best_shrink(weights[::every], validation, predicted())[1]

    history = loop.fit(stage, head, options.head_epochs, batches, validate, folder,
                       seed=options.seed, rate=options.head_rate, decay=options.head_decay,
                       validate_every=options.validate_every, shards=options.shards, log=log, **more)
    return (history, *best_shrink(weights[::every], validation, predicted()))


def fit(stage, mesh, body_points, static, components, deviations, training, validation, options,
        folder, log=print):
    """Fit a fresh head to the standing graph layers and unfold it into `mesh` -> (history, error in metres)."""
    recurrence = mesh_bptt.recurrence(mesh)
    embedded = mesh_windows.embed(recurrence, body_points, training)
    embeddings = Embeddings(embedded, options.head_rank, options.seed)
    u = [embeddings.reduce(s) for s in embedded]
    del embedded
    held = [embeddings.reduce(s) for s in mesh_windows.embed(recurrence, body_points, validation)]
    torch.manual_seed(options.seed)
    head = Head(len(embeddings.directions), mesh.mlp[0].out_features, components, deviations, options).to(
        static.template.device)
    history, shrink, error = fit_standing(stage, head, u, held, static, training, validation, options, folder, log)
    log(f"{stage}: basis times {shrink:.1f}, {1e3 * error:.2f} mm on validation")
    head.unfold(mesh, embeddings, shrink)
    return history, error
