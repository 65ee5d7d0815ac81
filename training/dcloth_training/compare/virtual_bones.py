"""Virtual bones: GRU -> rigid transforms of K bones inside the cloth -> learned skinning.

After the ideas of Pan et al. 2022. They take bones and weights from a skinning decomposition (SSDR)
and regress them; here the decomposition is the start (bones on patches of the cloth, rotations by
Procrustes, principal components of their motion) and all of it trains on the vertex distance.
Bones move in the frame of the hips: with every bone at rest the garment is rigid to the hips.
"""
import numpy as np
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from torch import nn

from .family import Family, Readout

FARTHEST = -12.0      # first logits end here: a gradient still reaches bones far away
LLOYD_STEPS = 10
PATCH = 2.0           # vertices of a bone's patch, in units of n / K
SMALLEST_PATCH = 8


class VirtualBones(Family):
    """fixed: template [n, 3], centres [K, 3], components [R, 6 K], scale [R], first_logits [n, K]."""
    BASE = "hips"
    # A step at n = 7,952 and K = 358: 0.185 s with every tick, 0.066 s with every fourth (a basis 0.025
    # to 0.040 s, one core). The GRU still walks through all of them.
    STRIDE = 4

    def __init__(self, features, sizes, fixed, options):
        logits = torch.as_tensor(fixed["first_logits"])
        super().__init__(sizes, {k: v for k, v in fixed.items() if k != "first_logits"}, options)
        self.gru = nn.GRU(features, sizes["hidden"], batch_first=True)
        self.readout = Readout(sizes["hidden"], len(self.scale))
        self.logits = nn.Parameter(logits.clone())

    @staticmethod
    def learned(d, n, sizes):
        """Learned numbers that a run of it stores: GRU, readout, weights, centres."""
        h, k = sizes["hidden"], sizes["size"]
        return 3 * (d * h + h * h + 2 * h) + 6 * k * h + n * k + 3 * k

    def fixed(self):
        # The state holds the trained logits; these only give the shape when it is read back.
        return {**super().fixed(), "first_logits": self.logits.detach()}

    def encode(self, x):
        return self.gru(x)[0]

    def transforms(self, code):
        """code [..., k] -> [..., 3, 4 K]: rows of [R | s], a bone moves p to R p + s."""
        values = self.readout(code, self.components, self.scale)
        values = values.reshape(*code.shape[:-1], -1, 6)
        linear = rotations(values[..., :3] / self.sizes["radius"])
        shift = self.centres + values[..., 3:] - (linear @ self.centres.unsqueeze(-1)).squeeze(-1)
        rows = torch.cat([linear, shift.unsqueeze(-1)], -1).transpose(-3, -2)
        return rows.reshape(*rows.shape[:-2], -1)

    def displacement(self, code, vertices=None):
        """code [..., k] -> [..., v, 3]: sum_k w_vk (R_k T_v + s_k) - T_v, one matrix product."""
        template, logits = self.template, self.logits
        if vertices is not None:
            template, logits = template[vertices], logits[vertices]
        point = torch.cat([template, torch.ones_like(template[:, :1])], 1)
        weighted = torch.softmax(logits, 1).unsqueeze(-1) * point.unsqueeze(1)      # [v, K, 4]
        moved = self.transforms(code) @ weighted.flatten(1).t()                     # [..., 3, v]
        return moved.transpose(-1, -2) - template


def rotations(vectors):
    """Rotation vectors [..., 3] in radians -> matrices [..., 3, 3] (Rodrigues' formula)."""
    # The offset keeps the square root's gradient finite at rest; it turns nothing.
    angle = ((vectors * vectors).sum(-1) + 1e-12).sqrt()
    first = torch.sin(angle) / angle
    second = 0.5 * (torch.sin(0.5 * angle) / (0.5 * angle)) ** 2     # (1 - cos a) / a^2
    x, y, z = vectors.unbind(-1)
    a, b, c = first * x, first * y, first * z
    xx, yy, zz = second * x * x, second * y * y, second * z * z
    xy, xz, yz = second * x * y, second * x * z, second * y * z
    flat = torch.stack([1 - yy - zz, xy - c, xz + b, xy + c, 1 - xx - zz, yz - a,
                        xz - b, yz + a, 1 - xx - yy], -1)
    return flat.reshape(*vectors.shape, 3)


def place(template, count):
    """Centres [K, 3] spread over the vertices [n, 3]: farthest points, then Lloyd's iteration."""
    chosen, reach = [0], np.linalg.norm(template - template[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(reach.argmax()))
        reach = np.minimum(reach, np.linalg.norm(template - template[chosen[-1]], axis=1))
    centres = template[chosen].astype(np.float64)
    for _ in range(LLOYD_STEPS):
        owner = cKDTree(centres).query(template)[1]
        total = np.stack([np.bincount(owner, template[:, a], count) for a in range(3)], 1)
        size = np.bincount(owner, minlength=count)[:, None]
        centres = np.where(size > 0, total / np.maximum(size, 1), centres)
    return centres


def first_weights(template, centres):
    """(logits [n, K], radius in metres): Gaussians about the centres, as wide as they lie apart."""
    apart = cKDTree(centres).query(centres, min(2, len(centres)))[0]
    radius = float(apart.max(-1).mean()) if len(centres) > 1 else float(np.ptp(template, 0).max())
    square = ((template[:, None] - centres[None]) ** 2).sum(-1) / (2 * radius ** 2)
    nearest = square.min(1, keepdims=True)
    return np.maximum(nearest - square, FARTHEST).astype(np.float32), radius


def patches(template, centres):
    """The vertices nearest to each centre [K, M], whose motion is the bone's."""
    size = min(len(template), max(SMALLEST_PATCH, round(PATCH * len(template) / len(centres))))
    return cKDTree(template).query(centres, size)[1].reshape(len(centres), -1)


def decompose(residual, template, centres, patch):
    """Rigid motion of every bone: residual [t, n, 3] -> (rotation vectors, shifts), [t, K, 3] each.

    Least squares by the singular value decomposition (Kabsch), with det R = 1.
    """
    rest, moved = template[patch], (template + residual)[:, patch]
    at_rest, at = rest.mean(1), moved.mean(2)
    cross = np.einsum("kma,tkmb->tkab", rest - at_rest[:, None], moved - at[:, :, None])
    u, _, vt = np.linalg.svd(cross)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    u[..., :, 2] *= sign[..., None]
    turn = np.einsum("tkab,tkbc->tkca", u, vt)      # (U D V^T)^T = V D U^T
    centre = at + np.einsum("tkab,kb->tka", turn, centres - at_rest)
    vectors = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(*turn.shape[:2], 3), centre - centres
