"""Stage 2: a gated recurrent unit on the pose features; its state is the coefficients P."""
import numpy as np
import torch
from torch import nn

# Directions below this share of a basis' strongest are rounding: they move no vertex by a micrometre.
_SMALLEST_DIRECTION = 1e-6
_GRU = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")


def factors(basis):
    """S [k, n, 3] of few directions as readout [k, R] x components [R, n, 3], or None where that saves nothing."""
    flat = np.asarray(basis, np.float64).reshape(len(basis), -1)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    kept = values > _SMALLEST_DIRECTION ** 2 * values[-1]
    rank = int(kept.sum())
    if rank == 0 or rank * sum(flat.shape) >= flat.size:
        return None
    readout = vectors[:, kept][:, ::-1]
    return readout, (readout.T @ flat).reshape(rank, *basis.shape[1:])


def multiplied(tensors):
    """skeleton.basis [k_S, n, 3] of a bundle's tensors, from its factors where they are stored, as the converter
    does."""
    readout, components, basis = (tensors.find(f"skeleton.{k}") for k in ("readout", "components", "basis"))
    if readout is None and components is None:
        return basis
    if readout is None or components is None or readout.ndim != 2 or components.ndim != 3 \
            or readout.shape[1] != len(components) or basis is not None:
        raise tensors.error("skeleton.readout and skeleton.components belong together, [k_S, R] and [R, n, 3], without "
                            "skeleton.basis")
    return np.tensordot(readout.astype(np.float64), components.astype(np.float64), 1)


class SkeletonStage(nn.Module):
    """P = h' (PyTorch's GRU convention), delta_S = sum_j P_j S_j."""
    NOTE = "h_S"

    def __init__(self, vertices, features, size=128):
        super().__init__()
        self.gru = nn.GRU(features, size, batch_first=True)
        self.basis = nn.Parameter(torch.zeros(size, vertices, 3))

    @classmethod
    def fresh(cls, parts, options):
        return cls(len(parts.template), parts.features, options.skeleton_size)

    @classmethod
    def of_bundle(cls, tensors, parts):
        basis = multiplied(tensors)
        if basis is None:
            return None
        stage = cls(len(parts.template), parts.features, len(basis)).double()
        return tensors.fill(stage, "skeleton.", lambda name: name.replace("_l0", ""), {"skeleton.basis": basis})

    def trained(self):
        """The basis as factors where that is smaller."""
        out = {f"gru.{name}": getattr(self.gru, name + "_l0") for name in _GRU}
        found = factors(self.basis.detach().cpu().numpy())
        return {**out, "basis": self.basis} if found is None else {**out, "readout": found[0], "components": found[1]}

    def given(self, fitted):
        return {}

    def forward(self, x, state=None):
        """x [B, T, d], state [1, B, k] or None after a reset -> (P [B, T, k], state)."""
        return self.gru(x, state)

    def play(self, x, pose):
        return iter(self(x[None])[0][0])

    def displacement(self, coefficients):
        """[..., k] -> [..., n, 3]."""
        flat = coefficients @ self.basis.reshape(len(self.basis), -1)
        return flat.reshape(*coefficients.shape[:-1], -1, 3)
