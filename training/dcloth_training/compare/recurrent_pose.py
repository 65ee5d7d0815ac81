"""A recurrent pose-space network: dense encoder -> GRU -> dense decoder -> basis -> skinning.

After the ideas of NeuralClothSim (Bertiche et al. 2022) and SNUG (Santesteban et al. 2022): pose-space
corrections on top of linear blend skinning, with a recurrent unit for what the pose does not tell.
Both train without supervision on physical energies; here the simulated truth supervises.
"""
import torch
from torch import nn

from .family import Family, Readout, as_vectors, columns_of


class RecurrentPose(Family):
    """d -> hidden (ReLU) -> GRU of hidden -> size (tanh); the last activations weigh the basis."""

    def __init__(self, features, sizes, fixed, options):
        super().__init__(sizes, fixed, options)
        hidden, size = sizes["hidden"], sizes["size"]
        self.encoder = nn.Linear(features, hidden)
        self.gru = nn.GRU(hidden, hidden, batch_first=True)
        self.decoder = nn.Linear(hidden, size)
        self.readout = Readout(size, len(self.scale))

    @staticmethod
    def learned(d, n, sizes):
        """Learned numbers that a run of it stores."""
        h, k = sizes["hidden"], sizes["size"]
        return d * h + h + 6 * h * h + 6 * h + h * k + k + 3 * n * k

    def encode(self, x):
        state = self.gru(torch.relu(self.encoder(x)))[0]
        return torch.tanh(self.decoder(state))

    def displacement(self, code, vertices=None):
        """code [..., k] -> [..., v, 3] of `vertices`, or of all."""
        return as_vectors(self.readout(code, columns_of(self.components, vertices), self.scale))
