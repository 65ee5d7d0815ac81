"""What the re-implemented families share: one interface, one regularisation, one kind of decoder.

A family maps standardised features to a displacement in template space, which the linear blend
skinning of its `BASE` then carries along: "plain" (nearest-point weights) or "hips" (rigid).
"""
import torch
from torch import nn

from .. import augment

READOUT_STATE = 0.3    # deviation of a code's entries that the readout's first values assume


class Family(nn.Module):
    """Base class. `sizes`: scalars that shape the parameters. `fixed`: tensors that do not train.

    A subclass gives BASE, learned(d, n, sizes), encode(x) and displacement(code, vertices).
    """
    BASE = "plain"
    STRIDE = 1    # the loss counts every STRIDE-th tick of a window, from a random one on

    def __init__(self, sizes, fixed, options):
        super().__init__()
        self.sizes, self.noise, self.dropout = sizes, options.noise, options.dropout
        for name, value in fixed.items():
            self.register_buffer(name, torch.as_tensor(value), persistent=False)
        self.fixed_names = tuple(fixed)

    def fixed(self):
        """{name: tensor} that rebuilds this family together with its state."""
        return {name: getattr(self, name) for name in self.fixed_names}

    def code(self, x):
        """x [B, T, d] -> code [B, T, k]; while training with stage 2's noise and dropout."""
        if self.training:
            x = augment.noisy(x, self.noise)
        code = self.encode(x)
        if self.training and self.dropout:
            code = nn.functional.dropout(code, self.dropout)
        return code


class Readout(nn.Module):
    """code [..., k] -> [..., columns] through S = C B as in stage 2: C [k, R] trains, B stands.

    B [R, columns] are the principal components of what training data asks for, `scale` [R] their
    deviations. A run stores S [k, columns] alone.
    """

    def __init__(self, size, rank):
        super().__init__()
        self.mix = nn.Parameter(torch.randn(size, rank) / (READOUT_STATE * size ** 0.5))

    def forward(self, code, components, scale):
        return (code @ self.mix * scale) @ components


def columns_of(components, vertices):
    """Components [R, 3 n] at some vertices: [R, 3 v]; all of them for None."""
    if vertices is None:
        return components
    return components.reshape(len(components), -1, 3)[:, vertices].flatten(1)


def as_vectors(flat):
    """[..., 3 v] -> [..., v, 3]."""
    return flat.reshape(*flat.shape[:-1], -1, 3)
