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


def _inverse3(a):
    """Inverse of [..., 3, 3] by cofactors (torch.inverse calls LAPACK once a matrix)."""
    r0, r1, r2 = a[..., 0, :], a[..., 1, :], a[..., 2, :]
    c0 = torch.cross(r1, r2, dim=-1)
    c1 = torch.cross(r2, r0, dim=-1)
    c2 = torch.cross(r0, r1, dim=-1)
    return torch.stack([c0, c1, c2], -1) / (r0 * c0).sum(-1)[..., None, None]


@torch.no_grad()
def residual(static, standardise, pose, truth, damping=DAMPING):
    """delta [T, n, 3] float32 that makes the static stage reproduce `truth` [T, n, 3]."""
    weights = static.weights()
    x = standardise(pose.x)
    identity = torch.eye(3, dtype=weights.dtype)
    out = np.empty(truth.shape, np.float32)
    for at in range(0, len(truth), CHUNK):
        part = slice(at, at + CHUNK)
        blended = static.blend(static.bone_matrices(x[part], pose.linear[part], pose.posed[part]),
                               weights)
        error = torch.from_numpy(truth[part]).to(weights.dtype) - static.skin(blended)
        linear = blended[..., :3]
        transposed = linear.transpose(-1, -2)
        solve = _inverse3(transposed @ linear + damping * identity) @ transposed
        out[part] = (solve @ error.unsqueeze(-1)).squeeze(-1).numpy()
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
