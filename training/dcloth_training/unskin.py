"""Ground truth to template space and back, and the principal components of what remains.

Skinning is v = L (T + delta) + t with L, t the blended 3x4 matrix of a vertex, so
delta = L^-1 (v - t) - T. Where joints turn against each other a blend of rotations loses rank;
damped least squares, delta = (L^T L + e)^-1 L^T (v - t - L T), keeps delta bounded there and
differs by a factor 1 / (1 + e) elsewhere.
"""
import numpy as np
import torch

DAMPING = 1e-4
CHUNK = 16


def _solve_damped(columns, wanted, damping):
    """(L^T L + damping)^-1 L^T e by cofactors: columns of L and e, each [3, ...] -> [3, ...].

    Whole planes at a time: torch's products of small matrices take ten times as long.
    """
    def dot(a, b):
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

    x, y, z = columns
    xx, yy, zz = (dot(c, c) + damping for c in columns)
    xy, xz, yz = dot(x, y), dot(x, z), dot(y, z)
    right = [dot(c, wanted) for c in columns]
    rows = [[yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz],
            [None, xx * zz - xz * xz, xy * xz - xx * yz],
            [None, None, xx * yy - xy * xy]]
    determinant = xx * rows[0][0] + xy * rows[0][1] + xz * rows[0][2]
    return torch.stack([dot([rows[min(i, j)][max(i, j)] for j in range(3)], right) / determinant
                        for i in range(3)])


@torch.no_grad()
def residual(static, standardise, pose, truth, damping=DAMPING):
    """delta [T, n, 3] float32 that makes the static stage reproduce `truth` [T, n, 3]."""
    weights = static.weights()
    x, linear, posed = (values.to(weights.device) for values in (pose.x, pose.linear, pose.posed))
    x = standardise(x)
    template = static.template.T[:, None]                                     # [3, 1, n]
    out = np.empty(truth.shape, np.float32)
    for at in range(0, len(truth), CHUNK):
        part = slice(at, at + CHUNK)
        bones = static.bone_matrices(x[part], linear[part], posed[part])
        # Bones' planes first, so that each plane of the blend is one product: [4, 3, t, n].
        planes = bones.permute(3, 2, 0, 1) @ weights.T
        place = (planes[:3] * template[:, None]).sum(0) + planes[3]
        target = torch.from_numpy(truth[part]).to(weights).permute(2, 0, 1)
        out[part] = _solve_damped(planes[:3], target - place, damping).permute(1, 2, 0).cpu().numpy()
    return out


def principal(rows_of, count, rank, seed=0, oversample=16, power=1):
    """Leading right singular vectors of a tall matrix that is met in blocks.

    rows_of(): yields blocks [t, columns] float32. Randomised range finder with power iterations
    (Halko, Martinsson and Tropp 2011, algorithm 4.4). Returns (vectors [rank, columns] float32,
    singular values [rank] divided by sqrt(rows)). No mean is removed: the network has no offset.
    """
    generator = np.random.default_rng(seed)
    sketch = min(rank + oversample, count)
    basis = None
    rows = 0
    for step in range(power + 1):
        total, rows = None, 0
        for block in rows_of():
            if step == 0:
                left = generator.standard_normal((len(block), sketch)).astype(np.float32)
            else:
                left = block @ basis
            part = block.T @ left
            total = part if total is None else total + part
            rows += len(block)
        basis = np.linalg.qr(total)[0].astype(np.float32)
    gram = np.zeros((basis.shape[1],) * 2)
    for block in rows_of():
        small = (block @ basis).astype(np.float64)
        gram += small.T @ small
    values, vectors = np.linalg.eigh(gram / max(rows, 1))
    order = np.argsort(values)[::-1][:rank]
    found = basis @ vectors[:, order].astype(np.float32)
    return np.ascontiguousarray(found.T), np.sqrt(np.maximum(values[order], 0))
