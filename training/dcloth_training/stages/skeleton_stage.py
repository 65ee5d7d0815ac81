"""Stage 2: a gated recurrent unit on the pose features; its state is the coefficients P."""
import torch
from torch import nn


class SkeletonStage(nn.Module):
    """P = h' (PyTorch's GRU convention), delta_S = sum_j P_j S_j."""

    def __init__(self, vertices, features, size=128):
        super().__init__()
        self.gru = nn.GRU(features, size, batch_first=True)
        self.basis = nn.Parameter(torch.zeros(size, vertices, 3))

    def forward(self, x, state=None):
        """x [B, T, d], state [1, B, k] or None after a reset -> (P [B, T, k], state)."""
        return self.gru(x, state)

    def displacement(self, coefficients):
        """[..., k] -> [..., n, 3]."""
        flat = coefficients @ self.basis.reshape(len(self.basis), -1)
        return flat.reshape(*coefficients.shape[:-1], -1, 3)
