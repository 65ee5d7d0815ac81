"""Stage 2: the recurrent unit on dynamic clips, stage 1 frozen.

The basis is S = C B: B [R, n, 3] holds the principal components of the un-skinned residual and
C [k_S, R] is trained, so a state within (-1, 1) reaches any coefficient. The loss is the skinned
vertex distance on a random subset of vertices, which costs as little as regressing coefficients.

First windows start from a state of zero; a network that has seen no more drifts in long runs (6.9 mm
in the first 64 ticks of training clips, 13.4 mm after). Then they go on from the state that a run of
the whole clip has there, computed anew every epoch.
"""
import numpy as np
import torch
from torch import nn

from . import dataset, losses, loop, unskin

BATCH = 16
VERTICES = 256
BASIS_EVERY = 2     # every second frame is enough for the principal components


class Reduced(nn.Module):
    """The skeleton stage while it trains: GRU, readout C, fixed components."""

    def __init__(self, gru, components, deviations, options):
        super().__init__()
        self.gru, self.options = gru, options
        self.register_buffer("components", torch.from_numpy(components), persistent=False)
        scale = torch.from_numpy(deviations.astype(np.float32))
        self.register_buffer("scale", scale, persistent=False)
        size = gru.hidden_size
        # A state of deviation about 0.3 in every unit should give coefficients of their deviation.
        self.readout = nn.Parameter(torch.randn(size, len(components)) / (0.3 * size ** 0.5))

    def coefficients(self, x, state=None):
        """x [B, T, d], state [1, B, k] to go on from -> coefficients [B, T, R]."""
        if self.training:
            noise = self.options.noise
            x = x + noise * torch.randn_like(x) + noise * torch.randn_like(x[:, :1])
        state = self.gru(x, state)[0]
        if self.training and self.options.dropout:
            state = nn.functional.dropout(state, self.options.dropout)
        return state @ self.readout * self.scale

    def basis(self):
        """S [k, n, 3] of the finished stage."""
        flat = (self.readout * self.scale) @ self.components
        return flat.reshape(len(self.readout), -1, 3)


def gather(windows, vertices, frames):
    """(linear [B, T, m, 3, 3], residual [B, T, v, 3]) of a batch of windows."""
    linear = torch.stack([w.clip.pose.linear[w.first:w.first + frames] for w in windows])
    rows = vertices.numpy()
    target = np.stack([w.clip.wanted(slice(w.first, w.first + frames), rows) for w in windows])
    return linear, torch.from_numpy(target)


def counted(windows, frames):
    """[B, T] bool: ticks that count, past each window's warm-up."""
    return torch.arange(frames) >= torch.tensor([[w.warm_up] for w in windows])


@torch.no_grad()
def whole_runs(reduced, standardise, clips, side_by_side=32):
    """{id(clip): state [T, k]} of every clip run from its reset to its end, without noise."""
    out, order = {}, sorted(clips, key=len)
    for at in range(0, len(order), side_by_side):
        some = order[at:at + side_by_side]
        x = nn.utils.rnn.pad_sequence([standardise(c.pose.x) for c in some], batch_first=True)
        for clip, state in zip(some, reduced.gru(x)[0]):
            out[id(clip)] = state[:len(clip)].clone()
    return out


@torch.no_grad()
def clip_errors(reduced, static, standardise, clips, every=8):
    """Mean skinned distance in metres over `clips`, on every eighth vertex."""
    rows = torch.arange(0, len(static.template), every)
    weights = static.weights()[rows]
    columns = reduced.components.reshape(len(reduced.components), -1, 3)[:, rows].flatten(1)
    total, ticks = 0.0, 0
    for clip in clips:
        delta = reduced.coefficients(standardise(clip.pose.x)[None])[0] @ columns
        error = delta.reshape(len(clip), -1, 3) - torch.from_numpy(clip.wanted(vertices=slice(None, None, every)))
        total += float(losses.skinned_distance(clip.pose.linear, weights, error)) * len(clip)
        ticks += len(clip)
    return total / ticks


def train(skeleton, static, standardise, training, validation, options, folder, log=print):
    """-> history; leaves the trained GRU and basis in `skeleton`."""
    count = len(static.template)
    components, deviations = unskin.principal(
        lambda: (c.wanted(slice(None, None, BASIS_EVERY)).reshape(-1, 3 * count) for c in training),
        sum(-(-len(c) // BASIS_EVERY) for c in training), options.skeleton_rank, options.seed)
    torch.manual_seed(options.seed)
    reduced = Reduced(skeleton.gru, components, deviations, options)
    weights, frames = static.weights().detach(), options.window

    def batches(generator, go_on=False):
        runs = whole_runs(reduced, standardise, training) if go_on else None
        order = dataset.windows(training, frames, generator, warm_up=0 if go_on else dataset.WARM_UP)
        for at in range(0, len(order), BATCH):
            some, state = order[at:at + BATCH], None
            rows = losses.pick_vertices(count, VERTICES, generator)
            linear, target = gather(some, rows, frames)
            columns = reduced.components.reshape(-1, count, 3)[:, rows].flatten(1)
            x = torch.stack([w.x(standardise, frames, go_on) for w in some])
            if go_on:
                state = torch.stack([runs[id(w.clip)][w.first - 1] if w.first
                                     else x.new_zeros(reduced.gru.hidden_size) for w in some])[None]
            delta = (reduced.coefficients(x, state) @ columns).reshape(target.shape)
            keep = counted(some, frames)
            yield losses.skinned_distance(linear[keep], weights[rows], (delta - target)[keep])

    def validate():
        return clip_errors(reduced, static, standardise, validation)

    history = loop.fit("skeleton", reduced, options.skeleton_epochs, batches, validate, folder,
                       seed=options.seed, rate=options.skeleton_rate, decay=options.decay,
                       validate_every=options.validate_every, log=log)
    if options.long_epochs:
        later = loop.fit("skeleton_long", reduced, options.long_epochs,
                         lambda generator: batches(generator, go_on=True), validate, folder,
                         seed=options.seed, rate=options.skeleton_rate / 2, decay=options.decay,
                         validate_every=options.validate_every, log=log)
        history = history + [{**h, "epoch": h["epoch"] + options.skeleton_epochs} for h in later]
    with torch.no_grad():
        skeleton.basis.copy_(reduced.basis())
    return history


@torch.no_grad()
def subtract(skeleton, standardise, clips):
    """Take the stage's displacement off every clip's residual, in place."""
    flat = skeleton.basis.reshape(len(skeleton.basis), -1)
    for clip in clips:
        state = skeleton(standardise(clip.pose.x)[None])[0][0]
        clip.residual[:] = clip.wanted() - (state @ flat).reshape(clip.residual.shape).numpy()
