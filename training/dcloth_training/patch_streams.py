"""Clips side by side for the patch stage: each stream plays a clip on with its own cloth, a window of ticks a step."""
import numpy as np
import torch

from . import features, patches, sequence

AT_REST = 0.35                      # of streams begin with a clip, at rest; the others in its middle, near the truth
OFF, OFF_WAY = 0.012, 0.003         # m: how far these begin off the truth, and off its way a tick
JITTER = 0.0005                     # m a tick
IGNORED_AT_REST, IGNORED = 10, 2    # ticks after a start that do not count
HELD, HELD_TICKS = 0.3, 160         # of streams hold a pose of a clip, so long, in still air. How cloth falls is not
SWINGS, SETTLES = 45, 30            # known there, but after so many ticks it rests; after so many more that counts full
ROOM = 30                           # ticks that a stream begun in the middle has at least
FARTHEST = 1.5                      # m: a stream whose cloth is farther from its base begins anew


class Clip:
    """A clip as the stage reads it. poses [2 + T, 12 J + 6]: before it come two ticks of the first pose, at rest.

    moved [T, K, 3, R] float16 m, the truth; of a mirror image that of the clip itself."""

    def __init__(self, name, poses, moved, mirrored=False):
        self.name, self.moved, self.mirrored = name, moved, mirrored
        first = poses[:1].copy()
        first[:, -6:-3] = 0
        self.poses = torch.from_numpy(np.concatenate([first, first, poses]))

    def __len__(self):
        return len(self.moved)

    def truth(self, layout, ticks):
        """[t, K, 3, R] float32."""
        moved = self.moved[ticks].astype(np.float32)
        return torch.from_numpy(patches.mirrored(layout, moved) if self.mirrored else moved)


def clip_of(clip, layout, character, rig, moved=None):
    """Clip of a dataset.Clip; moved: that of the clip itself, computed where it is None."""
    item = sequence.read(clip.path, truth=moved is None)
    matrices, wind = item.joint_matrices.astype(np.float64), item.wind
    if moved is None:
        relative = features.relative(matrices, character.bind)
        moved = patches.displacements(layout, relative, item.truth).astype(np.float16)
    if clip.mirrored:
        matrices, wind = features.mirror_pose(matrices, character.joint_mirror), features.mirror_wind(wind)
    poses = patches.poses(features.relative(matrices, character.bind), matrices[:, rig.hips, :3, 3], wind, rig.rate)
    return Clip(clip.name, poses, moved, clip.mirrored)


def smooth(layout, noise):
    """Noise [..., K, 3, R] alike in neighbours."""
    near = torch.as_tensor(layout.near[0], dtype=torch.long)
    return (noise[..., near[0], :, :] + 2 * noise + noise[..., near[1], :, :]) / 6 ** 0.5


class Streams:
    """`count` streams over clips drawn by their lengths. generator: numpy's."""

    def __init__(self, clips, layout, count, ticks, width, generator):
        self.clips, self.layout, self.count, self.ticks, self.generator = clips, layout, count, ticks, generator
        lengths = np.array([len(c) for c in clips], float)
        self.share = np.cumsum(lengths / lengths.sum())
        number, points = layout.sizes
        self.last, self.before = (torch.zeros(count, number, 3, points) for _ in range(2))
        self.hidden = torch.zeros(count, number, width)
        self.at, self.counts_from, self.clip = np.zeros(count, int), np.zeros(count, int), [None] * count
        self.held = [None] * count      # poses [2, ...] before a hold, and in it
        for k in range(count):
            self.begin(k)

    def jitter(self, ticks):
        """Noise on the cloth of each tick [t, B, K, 3, R]; none where a pose is held."""
        moving = torch.tensor([held is None for held in self.held], dtype=torch.float32)
        return JITTER * moving[:, None, None, None] * self.noise(ticks, self.count)

    def noise(self, *shape):
        return smooth(self.layout, torch.from_numpy(
            self.generator.standard_normal((*shape, *self.last.shape[1:]), np.float32)))

    def begin(self, k):
        g = self.generator
        self.clip[k] = clip = self.clips[min(np.searchsorted(self.share, g.random()), len(self.clips) - 1)]
        self.hidden[k], self.held[k] = 0, None
        if g.random() < HELD:
            frame = int(g.integers(1, len(clip)))
            two = clip.truth(self.layout, slice(frame - 1, frame + 1))
            self.at[k], self.last[k], self.before[k] = 0, two[1], two[0]
            self.held[k] = clip.poses[frame + 1:frame + 3].clone()
            self.held[k][1, -6:] = 0
            return
        if g.random() < AT_REST or len(clip) < ROOM + 10:
            self.at[k], self.counts_from[k] = 0, IGNORED_AT_REST
            self.last[k] = self.before[k] = 0
            return
        self.at[k] = at = int(g.integers(2, len(clip) - ROOM))
        self.counts_from[k] = at + IGNORED
        off = OFF * g.random() * self.noise()
        two = clip.truth(self.layout, slice(at - 2, at))
        self.last[k], self.before[k] = two[1] + off, two[0] + off + OFF_WAY * self.noise()

    def next(self):
        """The next window: poses [B, T + 2, ...], truth [T, B, K, 3, R], counts [T, B] of it, 0 or 1, and rests [T, B],
        how much it counts that the cloth does not move, 0 to 1."""
        for k in range(self.count):
            ends = len(self.clip[k]) - 2 if self.held[k] is None else HELD_TICKS
            far = not self.last[k].isfinite().all() or self.last[k].abs().max() > FARTHEST
            if self.at[k] >= ends or far:
                self.begin(k)
        poses, truth, counts, rests = [], [], [], []
        for k, clip in enumerate(self.clip):
            ticks = np.arange(self.at[k], self.at[k] + self.ticks)
            if self.held[k] is None:
                inside = np.minimum(ticks, len(clip) - 1)
                poses.append(clip.poses[np.r_[inside[0], inside[0] + 1, inside + 2]])
                truth.append(clip.truth(self.layout, inside))
                counts.append((ticks < len(clip)) & (ticks >= self.counts_from[k]))
                rests.append(np.zeros(self.ticks))
            else:
                before, own = self.held[k]
                first = before if self.at[k] == 0 else own
                poses.append(torch.stack([first, first, *[own] * self.ticks]))
                truth.append(torch.zeros(self.ticks, *self.last.shape[1:]))
                counts.append(np.zeros(self.ticks))
                rests.append(((ticks - SWINGS) / SETTLES).clip(0, 1))
            self.at[k] += self.ticks
        return (torch.stack(poses), torch.stack(truth, 1),
                *(torch.from_numpy(np.stack(rows, 1).astype(np.float32)) for rows in (counts, rests)))
