"""A static pose-space network: MLP of this tick's features -> displacement basis -> skinning.

After the ideas of PBNS (Bertiche et al. 2021) and CTSN (Li et al. 2023): corrections in pose space
on top of linear blend skinning, no memory. Supervised by the simulated truth, where PBNS minimises
energies; fed the same features as every other row, root motion included.
"""
from torch import nn

from .family import Family, Readout, as_vectors, columns_of


class StaticPose(Family):
    """d -> hidden -> hidden (ReLU) -> size (tanh); the last activations weigh the basis.

    tanh, as stage 2's state has it: of the units of a last ReLU many slept on every pose.
    """

    def __init__(self, features, sizes, fixed, options):
        super().__init__(sizes, fixed, options)
        hidden, size = sizes["hidden"], sizes["size"]
        self.mlp = nn.Sequential(nn.Linear(features, hidden), nn.ReLU(),
                                 nn.Linear(hidden, hidden), nn.ReLU(),
                                 nn.Linear(hidden, size), nn.Tanh())
        self.readout = Readout(size, len(self.scale))

    @staticmethod
    def learned(d, n, sizes):
        """Learned numbers that a run of it stores."""
        h, k = sizes["hidden"], sizes["size"]
        return d * h + h + h * h + h + h * k + k + 3 * n * k

    def encode(self, x):
        return self.mlp(x)

    def displacement(self, code, vertices=None):
        """code [..., k] -> [..., v, 3] of `vertices`, or of all."""
        return as_vectors(self.readout(code, columns_of(self.components, vertices), self.scale))
