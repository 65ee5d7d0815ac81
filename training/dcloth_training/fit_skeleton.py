"""Stage 2: the recurrent unit on dynamic clips, stage 1 frozen.

The basis is S = C B: B [R, n, 3] holds the principal components of the un-skinned residual and
C [k_S, R] is trained, so a state within (-1, 1) reaches any coefficient. The loss is the skinned
vertex distance on a random subset of vertices, which costs as little as regressing coefficients, and the depth to which
the predicted cloth lies below the body: as long as the swing is not known, the mean of several possible ones runs
through the thigh, and that is seen at once.

A window that begins in the middle of a clip starts at zero, at the state in which another window
ended, or anywhere in (-1, 1), a third each, and does not count until WARM_UP ticks later: whatever
a host does to a garment, half a second of good poses must be enough to forget it. Some windows hold a
drape's pose: clips never stand still, and a network that never saw it does not come to rest either.

Then it learns to settle: the same windows from a second state, any corner of [-1, 1]^k, and what the two
still disagree on after WARM_UP ticks is added to the loss. The truth alone cannot teach that: a millimetre
of drift drowns in the centimetre that is unpredictable anyway. Half of the windows hold a pose of a motion, whose
cloth at rest nobody simulated, or one farther from the mean pose than any: there the two have to agree, and that is
all. Where too few do, cloth swings forever on a character that stops in an uncommon pose; restless() counts such poses.
"""
import functools
import os

import numpy as np
import torch
from torch import nn

from . import augment, dataset, features, fit_static, losses, loop, shards, unskin, workers
from .stages.skeleton_stage import factors

# Its options of train: (default, least, what).
OPTIONS = {
    "skeleton-size": (128, 1, "k_S"), "skeleton-rank": (64, 1, "principal components below S"),
    "skeleton-epochs": (220, 0, None), "settle-epochs": (20, 0, "that also forget the state they began with"),
    "skeleton-rate": (3e-3, None, None), "window": (64, dataset.WARM_UP + 1, "ticks a training window"),
    "carried": (1.5, None, "m/s: deviation of windows' velocity, see augment.py"),
    "noise": (0.1, None, "deviation of standardised features, see augment.py"), "dropout": (0.1, None, None),
    "decay": (0.01, None, None),
    "collision": (3.0, 0.0, "weight of the depth below the body, beside the distance; in stage 3, too")}
BATCH = 16
VERTICES = 256
USUAL_STATE = 0.3   # deviation of a unit's state
BASIS_EVERY = 4     # every fourth frame is enough for the principal components
RIDGE = 1e-3        # of fitted_readout, beside the mean square of a state
HOLD = 180          # ticks that restless() holds a pose
RESTLESS = 1e-4     # metres a tick: cloth that still moves by more after HOLD does not come to rest


class Reduced(nn.Module):
    """The skeleton stage while it trains: GRU, readout C, fixed components."""

    def __init__(self, gru, components, deviations, options):
        super().__init__()
        self.gru, self.options = gru, options
        self.register_buffer("components", torch.from_numpy(components), persistent=False)
        scale = torch.from_numpy(deviations.astype(np.float32))
        self.register_buffer("scale", scale, persistent=False)
        size = gru.hidden_size
        # A state of usual deviation in every unit should give coefficients of theirs.
        self.readout = nn.Parameter(torch.randn(size, len(components)) / (USUAL_STATE * size ** 0.5))

    def forward(self, x, state=None):
        """x [B, T, d], state [1, B, k] or None -> coefficients [B, T, R], last state [1, B, k]."""
        if self.training:
            x = augment.noisy(x, self.options.noise)
        states, last = self.gru(x, state)
        return self.read(states), last

    def read(self, states):
        if self.training and self.options.dropout:
            states = nn.functional.dropout(states, self.options.dropout)
        return states @ self.readout * self.scale

    def apart(self, x, first, second):
        """Two states [1, B, k] on the same x: coefficients of the first, and by how much they differ
        from those of the second, [B, T, R] each, and the first's last state."""
        x = augment.noisy(x, self.options.noise)
        states, last = self.gru(torch.cat([x, x]), torch.cat([first, second], 1))
        one, two = states.chunk(2)
        return self.read(one), (one - two) @ self.readout * self.scale, last[:, :len(x)]

    def basis(self):
        """S [k, n, 3] of the finished stage."""
        flat = (self.readout * self.scale) @ self.components
        return flat.reshape(len(self.readout), -1, 3)


def linear_of(windows, frames):
    """R_j [B, T, m, 3, 3] of a batch of windows."""
    return torch.stack([w.linear(frames) for w in windows])


def draw(windows, count, frames, generator):
    """(rows [v] among `count` vertices, residual [B, T, v, 3], planes [B, T, v, 4] there) of a batch of windows.

    planes: the body's beside the true cloth (body_planes), None where the clips have none.
    """
    picked = losses.pick_vertices(-(-count // dataset.SAMPLE_EVERY), VERTICES, generator)
    rows = picked.numpy()
    target = torch.from_numpy(np.stack([w.sampled(frames, rows) for w in windows]))
    planes = dataset.planes_of([w.clip for w in windows], [w.ticks(frames) for w in windows], rows)
    return dataset.SAMPLE_EVERY * picked, target, planes


def counted(windows, frames):
    """[B, T] bool: ticks that count, past each window's warm-up."""
    return torch.arange(frames) >= torch.tensor([[w.warm_up] for w in windows])


def first_states(windows, ended, generator):
    """(state [1, B, k], reset [B] bool) to start windows from; ended [E, k]: where others ended."""
    count, size = len(windows), ended.shape[1]
    kind = torch.randint(0, 3, (count,), generator=generator)
    kind[torch.tensor([w.fresh for w in windows])] = 0
    others = ended[torch.randint(0, len(ended), (count,), generator=generator)]
    anywhere = 2 * torch.rand(count, size, generator=generator) - 1
    state = torch.where((kind == 1)[:, None], others, (kind == 2)[:, None] * anywhere)
    return state[None], kind == 0


@torch.no_grad()
def clip_errors(reduced, static, standardise, clips, every=8):
    """Mean skinned distance in metres over `clips`, on every eighth vertex."""
    rows = torch.arange(0, len(static.template), every)
    weights = static.weights()[rows]
    columns = reduced.components.reshape(len(reduced.components), -1, 3)[:, rows].flatten(1)
    total, ticks, device = 0.0, 0, weights.device
    for clip in clips:
        delta = reduced(standardise(clip.pose.x.to(device))[None])[0][0] @ columns
        wanted = torch.from_numpy(clip.wanted(vertices=slice(None, None, every))).to(device)
        error = delta.reshape(len(clip), -1, 3) - wanted
        total += float(losses.skinned_distance(clip.pose.linear.to(device), weights, error)) * len(clip)
        ticks += len(clip)
    return total / ticks


@torch.no_grad()
def restless(reduced, standardise, clips, every=10):
    """(share, metres): of every tenth pose of `clips`, held from the state that led there, the share in which cloth
    still moves by more than RESTLESS a tick after HOLD of them, and the most that any moves.

    Mean over every eighth vertex and the last quarter of a second, in template space. Takes 10 ms a pose at k = 512.
    """
    device, moved = reduced.components.device, []
    columns = reduced.components.reshape(len(reduced.components), -1, 3)[:, ::8].flatten(1)
    for clip in clips:
        states = reduced.gru(standardise(clip.pose.x.to(device))[None])[0][0]
        x = standardise(features.at_rest(clip.pose.x.clone()).to(device))
        for some in torch.arange(0, len(x), every, device=device).split(BATCH):
            state, held = states[some][None].contiguous(), x[some][:, None]
            for _ in range(HOLD // 10):
                last, state = reduced.gru(held.expand(-1, 10, -1).contiguous(), state)
            steps = reduced.read(last[:, 2:]).diff(dim=1) @ columns
            moved.append(steps.reshape(*steps.shape[:2], -1, 3).norm(dim=-1).mean((1, 2)))
    moved = torch.cat(moved)
    return float((moved > RESTLESS).float().mean()), float(moved.max())


@torch.no_grad()
def fitted_readout(gru, standardise, clips, components):
    """Readout [k, R] by least squares: from the states of a GRU that has learned to what `clips` ask of `components`
    [R, 3 n], past the first WARM_UP ticks."""
    gram, right = 0.0, 0.0
    for clip in clips:
        states = gru(standardise(clip.pose.x.to(gru.weight_hh_l0.device))[None])[0][0, dataset.WARM_UP:]
        states = states.double().cpu().numpy()
        wanted = clip.wanted(slice(dataset.WARM_UP, None)).reshape(len(states), -1) @ components.T
        gram, right = gram + states.T @ states, right + states.T @ wanted.astype(np.float64)
    return np.linalg.solve(gram + RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram)), right)


def train(skeleton, static, standardise, training, validation, drapes, options, folder, log=print, kept=False):
    """-> history; leaves the trained GRU and basis in `skeleton`. drapes: clips of still poses; kept: goes on with the
    basis that `skeleton` has, which is for this stage 1 and these clips.

    Windows are drawn on the CPU, the same on every device, and go to the device of the stages.
    """
    count, device = len(static.template), static.template.device
    known = factors(skeleton.basis.detach().cpu().numpy()) if kept else None
    if known:
        components = known[1].reshape(len(known[1]), -1).astype(np.float32)
        deviations = USUAL_STATE * np.linalg.norm(components, axis=1)
        components *= USUAL_STATE / deviations[:, None]
    else:
        components, deviations = workers.from_first(lambda: unskin.principal(
            lambda: (c.wanted(slice(None, None, BASIS_EVERY)).reshape(-1, 3 * count) for c in training),
            sum(-(-len(c) // BASIS_EVERY) for c in training), options.skeleton_rank, options.seed))
    torch.manual_seed(options.seed)
    reduced = Reduced(skeleton.gru, components, deviations, options).to(device)
    if known:
        with torch.no_grad():
            reduced.readout.copy_(torch.from_numpy(known[0] / USUAL_STATE))
    elif options.start:
        found = workers.from_first(lambda: fitted_readout(skeleton.gru, standardise, training, components))
        with torch.no_grad():
            reduced.readout.copy_(torch.from_numpy(found / deviations))
    weights, frames = static.weights().detach(), options.window
    stills = [(clip, t) for clip in drapes for t in range(len(clip))
              if t % fit_static.HELD_EVERY != fit_static.HELD_EVERY - 1]

    def batches(generator, shard=shards.WHOLE, settle=False):
        order = dataset.windows(training, frames, generator, stills, held=settle)
        ended = torch.zeros(1, reduced.gru.hidden_size)
        for some in shard.batches(order, BATCH, generator):
            linear, (rows, target, planes) = linear_of(some, frames), draw(some, count, frames, generator)
            columns = reduced.components.reshape(-1, count, 3)[:, rows].flatten(1)
            state, reset = first_states(some, ended, generator)
            velocity = augment.velocities(some, options.carried, generator).numpy()
            x = standardise(torch.stack([w.x(frames, zero, v) for w, zero, v in zip(some, reset, velocity)]).to(device))
            keep = counted(some, frames)
            linear, target, state = linear.to(device), target.to(device), state.to(device)
            if settle:
                held = torch.tensor([isinstance(w, dataset.Held) for w in some])
                x = augment.farther(x, held, standardise, generator)
                other = 2 * torch.rand(state.shape, generator=generator) - 1
                coefficients, apart, state = reduced.apart(x, state, torch.sign(other).to(device))
                left = (apart @ columns).reshape(target.shape)[:, dataset.WARM_UP:]
            else:
                coefficients, state = reduced(x, state)
            ended = state[0].detach().cpu()
            delta = (coefficients @ columns).reshape(target.shape)
            loss = losses.distance(left) if settle else 0.0
            if keep.any():                                        # all of a small batch may be held
                error = losses.skinned(linear[keep], weights[rows], (delta - target)[keep])
                planes = None if planes is None else planes.to(device)[keep]
                loss = loss + losses.outside(error, planes, options.collision)
            yield loss

    def validate():
        return clip_errors(reduced, static, standardise, validation)

    history = loop.fit("skeleton", reduced, options.skeleton_epochs, batches, validate, folder,
                       seed=options.seed, rate=options.skeleton_rate, decay=options.decay,
                       validate_every=options.validate_every, shards=options.shards, log=log)
    if options.settle_epochs:
        later = loop.fit("skeleton_settle", reduced, options.settle_epochs,
                         functools.partial(batches, settle=True), validate, folder,
                         seed=options.seed, rate=options.skeleton_rate / 3, decay=options.decay,
                         validate_every=options.validate_every, keep_last=True, shards=options.shards, log=log)
        history = history + [{**h, "epoch": h["epoch"] + options.skeleton_epochs} for h in later]
        reduced.eval()
        share, most = workers.from_first(lambda: restless(reduced, standardise, validation))
        log(f"skeleton_settle: of validation's poses, held for {HOLD} ticks, {100 * share:.1f} % do not come to rest; "
            f"cloth moves by at most {1e3 * most:.2f} mm a tick then")
    with torch.no_grad():
        skeleton.basis.copy_(reduced.basis())
    return history


@torch.no_grad()
def add_coarse(skeleton, standardise, clips):
    """Fill clip.coarse: what the stage gives, in its own directions, for clips too many to subtract it in memory."""
    found = factors(skeleton.basis.detach().cpu().numpy())
    readout = None if found is None else torch.from_numpy(np.ascontiguousarray(found[0], np.float32))
    basis = skeleton.basis.detach().cpu().numpy() if found is None else found[1].astype(np.float32)
    order = sorted(range(len(clips)), key=lambda i: len(clips[i]))
    for at in range(0, len(order), BATCH):
        some = [clips[i] for i in order[at:at + BATCH]]
        x = nn.utils.rnn.pad_sequence([standardise(c.pose.x.to(skeleton.basis.device)) for c in some], batch_first=True)
        states = skeleton(x)[0].cpu()
        for clip, rows in zip(some, states if readout is None else states @ readout):
            clip.coarse = rows[:len(clip)].numpy().copy(), basis


def subtract(clips):
    """Take the stage's displacement (clip.coarse) off every clip's residual, in place and in memory."""
    for clip in clips:
        clip.residual[:] = clip.remainder(slice(None), slice(None))
        clip.coarse = None


def train_stage(run):
    """Stage 2 of a training -> {step: history}; un-skins the truth on the way."""
    if run.before:
        run.net.skeleton.load_state_dict(run.before.skeleton.state_dict())
    run.unskin(run.training + run.validation + run.static_clips)
    run.log("ground truth un-skinned")
    if run.options.collision:
        workers.divided(run.training + run.static_clips, lambda clips: dataset.add_planes(
            clips, run.character, os.path.join(run.options.out, "planes")))
        run.log("body found beside the truth")
    new = {clip.name for clip in run.training} - run.known
    kept = bool(run.before) and not new and torch.equal(run.before.static.weights(), run.net.static.weights())
    return {"skeleton": train(run.net.skeleton, run.net.static, run.net.standardise, run.training, run.validation,
                              run.static_clips, run.options, run.options.out, run.log, kept)}
