"""One garment and its motion, as every peer gets it: folded float32 weights, inputs tick by tick, the float64 truth.

The exact rewrites that dcloth's converter makes are made for the peers too: W^p folded into the gates' matrices,
residual skinning weights summed, S and M stacked into one basis. Pose features and the posed body points are computed
beforehand; dcloth computes its own in the frame it is timed for.
"""
from dataclasses import dataclass

import numpy as np
import torch

from dcloth_training import bundle, reference, sequence


@dataclass
class Layer:
    """One GSGRU layer; rows are inputs. a~ = mean of x over N(i); gates see a~ x + x_bias, order z, r, g."""
    x: np.ndarray         # [in, 3F]
    x_bias: np.ndarray    # [3F]
    u_zr: np.ndarray      # [F, 2F]
    u: np.ndarray         # [F, F]
    o: np.ndarray         # [F, F]
    o_bias: np.ndarray
    norm_weight: np.ndarray
    norm_bias: np.ndarray
    slope: float


@dataclass
class Weights:
    """Every matrix [in, out], float32."""
    static: list          # [(matrix, bias), (matrix, bias)]
    gru: tuple            # W [d, 3k], b [3k], U [k, 3k], c [3k]; order r, z, q
    layers: list
    embed: tuple          # [F, 1], [1]
    mlp: list             # as static
    basis: np.ndarray     # [k_S + k_M, 3n]
    columns: np.ndarray   # [n, K] neighbours, each vertex itself first; shorter rows repeat it
    padding: np.ndarray   # [n, 1] how often a row repeats its vertex beyond the first
    inverse_count: np.ndarray  # [n, 1] 1 / |N(i)|
    skin: np.ndarray      # [n, m]
    template: np.ndarray  # [n, 3]
    pivots: np.ndarray    # [m, 3]

    def matrices(self):
        """The weights that a tick reads, by stage."""
        static = [value for both in self.static for value in both]
        mesh = [getattr(layer, name) for layer in self.layers for name in ("x", "x_bias", "u_zr", "u", "o", "o_bias")]
        return {"static": static, "skeleton": list(self.gru),
                "mesh": mesh + [value for both in self.mlp for value in both] + list(self.embed),
                "displacement": [self.basis]}

    def multiply_adds(self):
        """Of one tick, by stage; of the mesh stage the part that is arithmetic, not one read per multiply, alone."""
        n = len(self.columns)
        per_vertex = sum(value.size for layer in self.layers for value in (layer.x, layer.u_zr, layer.u, layer.o))
        return {"layers": n * per_vertex, "vertex_mlp": sum(matrix.size for matrix, _ in self.mlp),
                "skeleton": self.gru[0].size + self.gru[2].size, "displacement": self.basis.size,
                "static": sum(matrix.size for matrix, _ in self.static)}


def _linear(module):
    return module.weight.detach().numpy().T, module.bias.detach().numpy()


def fold(net):
    """A float64 DCloth -> Weights."""
    def single(values):
        return tuple(np.ascontiguousarray(v, np.float32) for v in values)

    layers = []
    for layer in net.mesh.layers:
        p = {name: value.detach().numpy() for name, value in layer.named_parameters()}
        gates = np.concatenate([p["w_z"], p["w_r"], p["w"]], 1)
        folded = single((p["w_p"] @ gates, p["b"] @ gates, np.concatenate([p["u_z"], p["u_r"]], 1), p["u"], p["w_o"],
                         p["b_o"], p["norm.weight"], p["norm.bias"]))
        layers.append(Layer(*folded, float(p["prelu"][0])))
    gru = net.skeleton.gru
    gru = single(getattr(gru, f"{name}_l0").detach().numpy().T
                 for name in ("weight_ih", "bias_ih", "weight_hh", "bias_hh"))
    basis = torch.cat([net.skeleton.basis, net.mesh.basis]).detach().numpy()
    columns = net.mesh.graph.columns.numpy()
    repeats = (columns == columns[:, :1]).sum(1, keepdims=True) - 1
    basis, skin, template, pivots, padding, inverse = single(
        (basis.reshape(len(basis), -1), net.static.weights().detach().numpy(), net.static.template.numpy(),
         net.static.pivots.numpy(), repeats, 1.0 / (columns.shape[1] - repeats)))
    return Weights([single(_linear(net.static.mlp[i])) for i in (0, 2)], gru, layers, single(_linear(net.mesh.embed)),
                   [single(_linear(net.mesh.mlp[i])) for i in (0, 2)], basis, columns, padding, inverse, skin,
                   template, pivots)


class Case:
    """A bundle with a sequence. Inputs are float32: x [T, d], points [T, n, 3] standardised, linear [T, m, 3, 3] R_j,
    posed [T, m, 3] p_j. `truth` [T, n, 3]: where float64 PyTorch puts the vertices, world metres; `simulated` [T, n,
    3]: where the simulation had them, None where the sequence does not say."""

    def __init__(self, bundle_path, sequence_path):
        net, rig, _, _ = bundle.read(str(bundle_path))
        item = sequence.read(str(sequence_path))
        pose = reference.pose_for(item, rig, torch.float64, sequence_path)
        with torch.no_grad():
            self.truth = net.run(pose).numpy()
            points = (net.mesh.body_points(pose.body_frame).transpose(0, 1)
                      - net.mesh.input_mean) / net.mesh.input_deviation
            self.x = net.standardise(pose.x).float().numpy()
            self._skin_weights = net.static.weights()
            self.weights = fold(net)
        self.points = points.float().contiguous().numpy()
        self.linear, self.posed = pose.linear.float().numpy(), pose.posed.float().numpy()
        self._net, self._pose = net, pose
        self.frames = len(self.truth)
        self.simulated = item.truth

    def positions(self, frame, increments, displacement):
        """Vertices [n, 3] in float64 of one peer's D [m, 3] and delta [n, 3]."""
        static, pose = self._net.static, self._pose
        increments, displacement = (torch.from_numpy(np.asarray(v, np.float64).reshape(-1, 3))
                                    for v in (increments, displacement))
        with torch.no_grad():
            pivots = static.pivots + increments
            offset = pose.posed[frame] - (pose.linear[frame] @ pivots[..., None])[..., 0]
            bones = torch.cat([pose.linear[frame], offset[..., None]], -1)
            return static.skin(static.blend(bones, self._skin_weights), displacement).numpy()

    def displacement_mm(self):
        """How far the network moves vertices from plain skinning, on average: the scale for errors."""
        with torch.no_grad():
            static = self._net.run(self._pose, "static").numpy()
        return float(1e3 * np.linalg.norm(self.truth - static, axis=-1).mean())

    def sizes(self):
        """The garment's sizes, as NETWORK.md names them."""
        w = self.weights
        return {"n": len(w.columns), "m": len(w.pivots), "d": len(w.gru[0]), "k_S": len(w.gru[2]),
                "k_M": len(w.basis) - len(w.gru[2]), "F": len(w.layers[0].u), "L": len(w.layers),
                "h": w.mlp[0][0].shape[1], "parameters": sum(v.size for vs in w.matrices().values() for v in vs)}

    def error_mm(self, frame, positions):
        """Distances [n] to the truth."""
        return _distances_mm(positions, self.truth[frame])

    def simulation_error_mm(self, frame, positions):
        """Distances [n] to the simulation."""
        return _distances_mm(positions, self.simulated[frame])


def _distances_mm(positions, others):
    return 1e3 * np.linalg.norm(np.asarray(positions, np.float64) - others, axis=-1)
