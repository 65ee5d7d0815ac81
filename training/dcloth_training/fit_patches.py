"""Trains the patch stage on rollouts of its own cloth: streams of clips side by side, a window of ticks a step."""
import math
import time

import numpy as np
import torch

from . import features, patch_bptt, patches, sequence

EMBEDDING = 7           # numbers of its own that a patch learns; inputs are then a multiple of 64 for eight points
START_AT_REST = 0.35    # of streams
OFF, OFF_SPEED = 0.012, 0.003       # m: how far streams begin off the truth, and off its velocity
JITTER = 0.0005         # m a tick
IGNORED_REST, IGNORED = 10, 2       # ticks after a start that do not count
SHORTEST = 40           # ticks of a clip that is begun in its middle
LARGEST = 1.5           # m: a stream that is farther from rest begins anew
DECAY, CLIP, WARM_UP = 0.01, 0.5, 0.05
KEEP = 2.2              # logistic(KEEP) of the last displacement stays at first


class Clip:
    """A clip as the stage reads it. poses [2 + T, 12 J + 6]: two ticks of the first pose, at rest, come before it."""

    def __init__(self, name, poses, moved, mirrored=False):
        self.name, self.mirrored = name, mirrored
        first = poses[:1].copy()
        first[:, -6:-3] = 0
        self.poses = torch.from_numpy(np.concatenate([first, first, poses]))
        self.moved = moved      # [T, K, 3, R] float16, never mirrored itself

    def __len__(self):
        return len(self.moved)


def clips_of(path, layout, character, hips, both=True):
    """[Clip] of a sequence with truth, and of its mirror image."""
    item = sequence.read(path)
    matrices = item.joint_matrices.astype(np.float64)
    moved = None
    out = []
    for mirrored in (False, True)[:1 + both]:
        of = features.mirror_pose(matrices, character.joint_mirror) if mirrored else matrices
        relative = features.relative(of, character.bind)
        if moved is None:
            moved = patches.displacements(layout, relative, item.truth).astype(np.float16)
        wind = features.mirror_wind(item.wind) if mirrored else item.wind
        out.append(Clip(item.clip, patches.poses(relative, of[:, hips, :3, 3], wind), moved, mirrored))
    return out


def fresh_weights(native, seed):
    """Untrained weights of a Native, flat."""
    c, generator = native.counts, torch.Generator().manual_seed(seed)
    inputs, width, out = 19 * c["points"] + 33 + c["embedding"], c["width"], 3 * c["points"]

    def matrix(rows, columns, gain):
        return (torch.rand(rows * columns, generator=generator) * 2 - 1) * gain * (3 / columns) ** 0.5

    parts = [0.1 * torch.randn(c["patches"] * c["embedding"], generator=generator), matrix(width, inputs, 1),
             torch.zeros(width)]
    for _ in range(c["layers"]):
        parts += [matrix(width, (1 + c["neighbours"]) * width, 0.7), torch.zeros(width)]
    parts += [matrix(3 * width, width, 0.7), matrix(3 * width, width, 0.7), torch.zeros(3 * width),
              matrix(out, width, 0.1), torch.zeros(out), torch.zeros(out * inputs), torch.full((c["points"],), KEEP)]
    return torch.cat(parts)


class Streams:
    """`count` clips side by side, each wherever it is; a new one begins where one ended."""

    def __init__(self, clips, layout, count, ticks, width, seed):
        self.clips, self.layout, self.count, self.ticks = clips, layout, count, ticks
        self.generator = np.random.default_rng(seed)
        lengths = np.array([len(c) for c in clips], float)
        self.share = np.cumsum(lengths / lengths.sum())
        patches_, points = layout.sizes
        self.last, self.before = (torch.zeros(count, patches_, 3, points) for _ in range(2))
        self.hidden = torch.zeros(count, patches_, width)
        self.at, self.counts_from, self.clip = np.zeros(count, int), np.zeros(count, int), [None] * count
        for k in range(count):
            self.begin(k)

    def truth(self, k, ticks):
        """[t, K, 3, R] of stream k at some ticks."""
        clip = self.clip[k]
        moved = clip.moved[ticks].astype(np.float32)
        return torch.from_numpy(patches.mirrored(self.layout, moved) if clip.mirrored else moved)

    def smooth(self, size):
        """Noise [K, 3, R] alike in neighbours."""
        z = torch.from_numpy(self.generator.standard_normal(self.last.shape[1:], np.float32))
        near = self.layout.near[0]
        return size * (z[near[0]] + 2 * z + z[near[1]]) / 2.5

    def begin(self, k):
        g = self.generator
        self.clip[k] = clip = self.clips[min(np.searchsorted(self.share, g.random()), len(self.clips) - 1)]
        self.hidden[k] = 0
        if g.random() < START_AT_REST or len(clip) < SHORTEST:
            self.at[k], self.counts_from[k] = 0, IGNORED_REST
            self.last[k] = self.before[k] = 0
            return
        self.at[k] = at = int(g.integers(2, len(clip) - 30))
        self.counts_from[k] = at + IGNORED
        off = self.smooth(OFF * g.random())
        two = self.truth(k, slice(at - 2, at))
        self.last[k], self.before[k] = two[1] + off, two[0] + off + self.smooth(OFF_SPEED)

    def next(self):
        """(poses [B, T + 2, ...], truth [T, B, K, 3, R], counts [T, B]) of the next window."""
        for k in range(self.count):
            far = not torch.isfinite(self.last[k]).all() or self.last[k].abs().max() > LARGEST
            if self.at[k] >= len(self.clip[k]) - 2 or far:
                self.begin(k)
        poses, truth, counts = [], [], []
        for k in range(self.count):
            ticks = np.arange(self.at[k], self.at[k] + self.ticks)
            inside = np.minimum(ticks, len(self.clip[k]) - 1)
            window = self.clip[k].poses[np.r_[inside[0], inside[0] + 1, inside + 2]]
            poses.append(window)
            truth.append(self.truth(k, inside))
            counts.append((ticks < len(self.clip[k])) & (ticks >= self.counts_from[k]))
            self.at[k] += self.ticks
        return (torch.stack(poses), torch.stack(truth, 1),
                torch.from_numpy(np.stack(counts, 1).astype(np.float32)))

    def noise(self):
        """[T, B, K, 3, R] of a window."""
        z = torch.randn(self.ticks, *self.last.shape)
        near = torch.as_tensor(self.layout.near[0], dtype=torch.long)
        return JITTER * (z[:, :, near[0]] + 2 * z + z[:, :, near[1]]) / 2.5


def lengths(error):
    """[..., K, 3, R] -> [..., K, R]."""
    return (error.square().sum(-2) + 1e-8).sqrt()


def loss_of(moved, truth, counts, speed=0.0):
    """Mean distance of points, and `speed` times that of their ways a tick; m."""
    total = counts.sum().clamp(min=1)
    loss = (lengths(moved - truth).mean((-1, -2)) * counts).sum() / total
    if speed:
        way = (moved[1:] - moved[:-1]) - (truth[1:] - truth[:-1])
        loss = loss + speed * (lengths(way).mean((-1, -2)) * counts[1:] * counts[:-1]).sum() / total
    return loss


@torch.no_grad()
def play(native, weights, clips):
    """Rollouts [T, K, 3, R] of clips from rest, all side by side."""
    longest = max(len(c) for c in clips)
    poses = torch.stack([torch.cat([c.poses, c.poses[-1:].expand(longest - len(c), -1)]) for c in clips])
    c = native.counts
    last = torch.zeros(len(clips), c["patches"], 3, c["points"])
    out = native.forward(weights.detach(), poses, last, last.clone(),
                         torch.zeros(len(clips), c["patches"], c["width"]))
    return [out[:len(clip), k].numpy() for k, clip in enumerate(clips)]


WARM = 12


def errors(clips, played):
    """[(name, mean error, alive)] in mm over points."""
    rows = []
    for clip, moved in zip(clips, played):
        truth = clip.moved[WARM:].astype(np.float32)
        alive = np.linalg.norm(truth - truth.mean(0), axis=-2).mean()
        rows.append((clip.name, 1e3 * np.linalg.norm(moved[WARM:] - truth, axis=-2).mean(), 1e3 * alive))
    return rows


def relative(rows):
    return sum(r[1] for r in rows) / sum(r[2] for r in rows)


def train(native, layout, clips, frames, held, seen, streams=16, ticks=16, rate=2e-3, speed=0.0, seed=1, weights=None,
          log=print, every=60.0, more=None, keep=None):
    """Weights after `frames` frames. more(): further clips that have come since, or none."""
    torch.manual_seed(seed)
    weights = (fresh_weights(native, seed) if weights is None else weights).clone().requires_grad_()
    steps = max(1, round(frames / (streams * ticks)))
    optimiser = torch.optim.AdamW([weights], rate, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda k: min(
        (k + 1) / (WARM_UP * steps), 0.5 * (1 + math.cos(math.pi * min(1, k / steps)))))
    flow = Streams(clips, layout, streams, ticks, native.counts["width"], seed)
    began, told, total = time.time(), time.time(), 0.0
    for step in range(steps):
        poses, truth, counts = flow.next()
        moved = patch_bptt.window(weights, native, poses, flow.last, flow.before, flow.hidden, flow.noise())
        loss = loss_of(moved, truth, counts, speed)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_([weights], CLIP)
        optimiser.step()
        schedule.step()
        total = 0.99 * total + 0.01 * float(loss)
        if time.time() - told > every or step == steps - 1:
            told = time.time()
            mine = total / (1 - 0.99 ** (step + 1))
            log(f"{step + 1}/{steps} {time.time() - began:.0f} s loss {1e3 * mine:.2f} seen "
                f"{relative(errors(seen, play(native, weights, seen))):.3f} held "
                f"{relative(errors(held, play(native, weights, held))):.3f}")
            if keep:
                keep(weights.detach())
            if more:
                new = more()
                if new:
                    flow.clips = flow.clips + new
                    sizes = np.array([len(c) for c in flow.clips], float)
                    flow.share = np.cumsum(sizes / sizes.sum())
    return weights.detach()
