"""Windows of clips, side by side, for truncated back-propagation through time.

A group of windows plays `chunk` ticks a step and hands its state to its next step, whose gradient stops there. Several
groups are under way at once and take turns at random, so that steps in a row see different motion. A window that begins
in the middle of a clip starts from zero, as the network does after a reset, and its first step only warms the state.
"""
from dataclasses import dataclass, field

import numpy as np
import torch

from . import mesh_bptt, shards

STEPS = 8            # of a window, at most
UNDER_WAY = 8        # groups taking turns
FROM_START = 0.25    # of the windows, where the clip is longer than a window


@dataclass
class Group:
    """Windows of equal length, one a lane."""
    clips: list
    firsts: list
    steps: int
    states: object
    done: int = field(default=0)


def groups(clips, chunk, windows, generator):
    """Random windows, (clips, first ticks, steps) of LANES of them at a time; clips by their length in ticks."""
    usable = [c for c in clips if len(c) >= 2 * chunk]
    if not usable:
        raise ValueError(f"no clip of {2 * chunk} ticks or more; lower --chunk (found {chunk})")
    share = torch.tensor([float(len(c)) for c in usable])
    found = torch.multinomial(share, windows, replacement=True, generator=generator).tolist()
    # Clips of like length side by side: a group is as long as its shortest window.
    found.sort(key=lambda i: (min(len(usable[i]) // chunk, STEPS), i))
    out = []
    for at in range(0, len(found), mesh_bptt.LANES):
        some = [usable[i] for i in found[at:at + mesh_bptt.LANES]]
        steps = min(STEPS, min(map(len, some)) // chunk)
        firsts = []
        for clip in some:
            last = len(clip) - steps * chunk
            first = int(torch.randint(0, last + 1, (1,), generator=generator))
            firsts.append(0 if torch.rand(1, generator=generator) < FROM_START else first)
        out.append((some, firsts, steps))
    return [out[i] for i in torch.randperm(len(out), generator=generator).tolist()]


def run(recurrence, body_points, clips, options, generator, shard=shards.WHOLE):
    """An epoch: yields (ticks of each lane, s [chunk, B, n] with gradient, clips of the lanes), one a step.

    A shard plays groups of its own: fewer lanes would cost as much. So a step has as many groups as there are shards.
    """
    waiting = shard.part(groups(clips, options.chunk, options.mesh_windows, generator), generator)
    under_way = []
    while waiting or under_way:
        while waiting and len(under_way) < UNDER_WAY:
            some, firsts, steps = waiting.pop()
            under_way.append(Group(some, firsts, steps, recurrence.fresh(len(some))))
        which = int(torch.randint(0, len(under_way), (1,), generator=generator))
        group = under_way[which]
        began = [first + group.done * options.chunk for first in group.firsts]
        ticks = [slice(b, b + options.chunk) for b in began]
        frames = torch.stack([c.pose.body_frame[t] for c, t in zip(group.clips, ticks)]).to(recurrence.device)
        # In the first step lanes in the middle of a clip warm up; the others are the first of their clip.
        counted = [i for i, first in enumerate(group.firsts) if group.done or first == 0]
        with torch.set_grad_enabled(bool(counted)):
            s = recurrence.run(mesh_bptt.window_points(body_points, frames), group.states)
        group.done += 1
        if group.done == group.steps:
            under_way.pop(which)
        if counted:
            yield [ticks[i] for i in counted], s[:, counted], [group.clips[i] for i in counted]


@torch.no_grad()
def embed(recurrence, body_points, clips, ticks=32, keep=lambda s: s):
    """keep(s [T, n] float32) of every clip from a reset, clips of like length side by side."""
    out = [None] * len(clips)
    order = sorted(range(len(clips)), key=lambda i: len(clips[i]))
    for at in range(0, len(order), mesh_bptt.LANES):
        some = [clips[i] for i in order[at:at + mesh_bptt.LANES]]
        states, rows = recurrence.fresh(len(some)), []
        for began in range(0, max(map(len, some)), ticks):
            frames = torch.stack([c.pose.body_frame[[min(t, len(c) - 1) for t in range(began, began + ticks)]]
                                  for c in some]).to(recurrence.device)
            rows.append(recurrence.run(mesh_bptt.window_points(body_points, frames), states).cpu().numpy())
        for lane, i in enumerate(order[at:at + mesh_bptt.LANES]):
            out[i] = keep(np.concatenate([r[:, lane] for r in rows])[:len(clips[i])])
    return out
