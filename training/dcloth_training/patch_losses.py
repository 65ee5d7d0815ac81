"""What the patch stage learns from: where its points are, the way they go, how far apart they are, the limbs, and that
cloth rests where a pose is held."""
import numpy as np
import torch

COLLISION = 8.0         # weight of a point's depth, beside its distance from the truth
MARGIN = 0.010          # m: a point is a mean of cloth, so it keeps this far off a limb if the truth does
STRETCH = 1.0           # weight of errors of distances between neighbouring points
REST = 30.0             # weight of the way a tick where cloth is to rest


def lengths(vectors, least=1e-4):
    """[..., K, 3, R] -> [..., K, R]; below `least` m the gradient fades."""
    return (vectors.square().sum(-2) + least * least).sqrt()


class Body:
    """Frames, bases and limbs of a layout in poses of patch_streams.Clip, many ticks at a time."""

    def __init__(self, layout):
        def real(values):
            return torch.as_tensor(np.asarray(values), dtype=torch.float32)

        def whole(values):
            return torch.as_tensor(np.asarray(values), dtype=torch.long)

        self.axes, self.capsules, self.parts = real(layout.axes), real(layout.capsules), real(layout.point_parts)
        self.joint, self.point_joints = whole(layout.patch_joint), whole(layout.point_joints)
        self.capsule_joints, self.limbs = whole(layout.capsule_joints), whole(layout.limbs).flatten(1)
        self.beside = whole(layout.near[0])                                        # [S, K]

    def places(self, poses):
        """poses [N, 12 J + 6] -> (axes [N, K, 3, 3], bases [N, K, 3, R], ends [N, c, 2, 3])."""
        m = poses[:, :-6].unflatten(1, (-1, 3, 4))
        bases = (m[:, self.point_joints] @ self.parts[..., None])[..., 0].sum(-2).transpose(-1, -2)
        own, at = m[:, self.capsule_joints], self.capsules[:, :6].unflatten(1, (2, 3))
        ends = torch.einsum("ncij,cej->ncei", own[..., :3], at) + own[:, :, None, :, 3]
        return m[:, self.joint, :, :3] @ self.axes, bases, ends

    def distances(self, at, ends):
        """How far points at [N, K, 3, R] are outside the limbs of their patches: [N, K, 4, R] m."""
        start = ends[:, self.limbs, 0][..., None]                                  # [N, K, 4, 3, 1]
        way = ends[:, self.limbs, 1][..., None] - start
        off = at[:, :, None] - start
        along = ((off * way).sum(-2) / way.square().sum(-2).clamp(min=1e-8)).clamp(0, 1)
        first, last = self.capsules[self.limbs][..., 6, None], self.capsules[self.limbs][..., 7, None]
        return lengths(off - along[..., None, :] * way) - (first + along * (last - first))

    def stretches(self, moved, axes, bases):
        """Distances between neighbours: (down the patches [N, K, R - 1], around [N, S, K, R]) m, and the places."""
        at = bases + axes @ moved
        around = torch.stack([lengths(at[:, near] - at) for near in self.beside], 1)
        return lengths(at[..., 1:] - at[..., :-1]), around, at


def loss_of(moved, truth, counts, way, body=None, poses=None):
    """Mean distance of points in m, `way` times that of their ways a tick, and what a body says of them.

    moved, truth [T, B, K, 3, R]; counts [T, B]; poses [B, T, 12 J + 6]."""
    total = counts.sum().clamp(min=1)
    loss = (lengths(moved - truth).mean((-1, -2)) * counts).sum() / total
    if way:
        off = (moved[1:] - moved[:-1]) - (truth[1:] - truth[:-1])
        loss = loss + way * (lengths(off).mean((-1, -2)) * counts[1:] * counts[:-1]).sum() / total
    some = counts.flatten() > 0
    if body is not None and some.any():
        axes, bases, ends = body.places(poses.transpose(0, 1).flatten(0, 1)[some])
        down, around, at = body.stretches(moved.flatten(0, 1)[some], axes, bases)
        with torch.no_grad():
            true_down, true_around, true_at = body.stretches(truth.flatten(0, 1)[some], axes, bases)
            kept = body.distances(true_at, ends).clamp(max=MARGIN)
        deep = torch.relu(kept - body.distances(at, ends)).sum(2)
        loss = loss + COLLISION * deep.mean() + STRETCH * ((down - true_down).abs().mean() +
                                                           (around - true_around).abs().mean())
    return loss


def rest_of(moved, last, rests):
    """REST times the mean way a tick of points where they are to rest. moved [T, B, K, 3, R] after last [B, K, 3, R];
    rests [T, B]."""
    way = lengths(moved - torch.cat([last[None], moved[:-1]]), 1e-6).mean((-1, -2))
    return REST * (way * rests).sum() / rests.sum().clamp(min=1)
