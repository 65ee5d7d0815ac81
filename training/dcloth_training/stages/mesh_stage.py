"""Stage 3: graph-recurrent layers over the cloth mesh, then a vertex-level MLP to Q.

Tensors are vertex-major, [n, B, F]: a neighbour is then one contiguous row of B F numbers and
the mean over N(i) is an embedding bag. N is symmetric, so its transpose is again such a bag. At
F = 8, 7,952 vertices, one core, B = 1 | 4: bag 0.21 | 0.26 ms, torch.sparse COO 1.0 | 1.1, CSR
1.1 | 1.3, gather and sum 0.7 | 2.7, SciPy's CSR 0.3 | 1.3 (no gradient).
"""
import torch
from torch import nn
from torch.nn import functional

from .. import geometry


class _Mean(torch.autograd.Function):
    """a_i = sum_j e_ij x_j and its transpose, both as bags over the padded neighbour table."""

    @staticmethod
    def forward(context, x, columns, weights, back):
        context.save_for_backward(columns, back)
        return _bag(x, columns, weights)

    @staticmethod
    def backward(context, gradient):
        columns, back = context.saved_tensors
        return _bag(gradient.contiguous(), columns, back), None, None, None


def _bag(x, columns, weights):
    flat = functional.embedding_bag(columns, x.reshape(len(x), -1), mode="sum",
                                    per_sample_weights=weights.to(x.dtype))
    return flat.reshape(x.shape)


class Graph(nn.Module):
    """N(i) and e_ij = 1 / |N(i)|; `columns`, `present` from geometry.padded_neighbours."""

    def __init__(self, columns, present):
        super().__init__()
        columns = torch.as_tensor(columns)
        present = torch.as_tensor(present).double()
        mean = present / present.sum(1, keepdim=True)
        self.register_buffer("columns", columns, persistent=False)
        self.register_buffer("weights", mean, persistent=False)
        # Transpose: row i gathers its neighbours j with e_ji = 1 / |N(j)|.
        self.register_buffer("back", present / present.sum(1)[columns], persistent=False)

    def forward(self, x):
        return _Mean.apply(x, self.columns, self.weights, self.back)


class GsgruLayer(nn.Module):
    """One layer of NETWORK.md; matrices are [in, out] and act as `x W`."""

    def __init__(self, inputs, width):
        super().__init__()

        def matrix(rows):
            return nn.Parameter(torch.empty(rows, width).uniform_(-1, 1) * (3.0 / rows) ** 0.5)

        self.w_p, self.b = matrix(inputs), nn.Parameter(torch.zeros(width))
        self.w_z, self.w_r, self.w = matrix(width), matrix(width), matrix(width)
        self.u_z, self.u_r, self.u = matrix(width), matrix(width), matrix(width)
        self.w_o, self.b_o = matrix(width), nn.Parameter(torch.zeros(width))
        self.norm = nn.LayerNorm(width, eps=1e-5)
        self.prelu = nn.Parameter(torch.full((1,), 0.25))

    def forward(self, x, state, graph):
        """x [n, B, in], state [n, B, F] -> (next x, next state)."""
        a = graph(x @ self.w_p) + self.b
        width = a.shape[-1]
        gates = torch.sigmoid(a @ torch.cat([self.w_z, self.w_r], 1)
                              + state @ torch.cat([self.u_z, self.u_r], 1))
        z, r = gates[..., :width], gates[..., width:]
        g = torch.tanh(a @ self.w + (r * state) @ self.u)
        state = state + z * (g - state)
        return functional.prelu(self.norm(state @ self.w_o + self.b_o), self.prelu), state


class BodyPoints(nn.Module):
    """The nearest body points of the garment, posed, in the heading frame: one matrix product."""

    def __init__(self, points, joint_weights):
        super().__init__()
        points, joint_weights = torch.as_tensor(points), torch.as_tensor(joint_weights)
        homogeneous = torch.cat([points, torch.ones_like(points[:, :1])], 1)
        self.register_buffer("mixing", (joint_weights[:, :, None] * homogeneous[:, None])
                             .reshape(len(points), -1), persistent=False)   # [n, 4 J]

    def forward(self, body_frame):
        """[B, J, 3, 4] -> [n, B, 3]."""
        columns = body_frame.permute(1, 3, 0, 2).reshape(self.mixing.shape[1], -1)
        return (self.mixing @ columns).reshape(len(self.mixing), -1, 3)


class MeshStage(nn.Module):
    """Body points in the heading frame [n, B, 3] -> Q [B, k]; delta_M = sum_j Q_j M_j."""
    NOTE = "Q"
    TRAINED = ("layers.", "embed.", "mlp.", "basis")

    def __init__(self, columns, present, input_mean, input_deviation, width=8, layers=3,
                 hidden=256, size=64, body_points=None):
        super().__init__()
        n = len(columns)
        self.body_points = body_points
        self.graph = Graph(columns, present)
        self.register_buffer("input_mean", torch.as_tensor(input_mean))
        self.register_buffer("input_deviation", torch.as_tensor(input_deviation))
        self.layers = nn.ModuleList(GsgruLayer(width if i else 3, width) for i in range(layers))
        self.embed = nn.Linear(width, 1)
        self.mlp = nn.Sequential(nn.Linear(n, hidden), nn.ReLU(), nn.Linear(hidden, size))
        self.basis = nn.Parameter(torch.zeros(size, n, 3))
        nn.init.zeros_(self.mlp[2].weight)   # Q = 0: training starts at stage 2's result
        nn.init.zeros_(self.mlp[2].bias)

    @classmethod
    def fresh(cls, parts, options):
        return cls(*geometry.padded_neighbours(parts.faces, len(parts.template)), *parts.body_statistics,
                   options.mesh_width,
                   options.mesh_layers, options.mesh_hidden, options.mesh_size, BodyPoints(*parts.nearest))

    @classmethod
    def of_bundle(cls, tensors, parts):
        if tensors.find("mesh.basis") is None:
            return None
        layers = len({name.split(".")[2] for name in tensors.names() if name.startswith("mesh.layers.")})
        stage = cls(*geometry.padded_neighbours(parts.faces, len(parts.template)), tensors.get("mesh.input_mean"),
                    tensors.get("mesh.input_deviation"), tensors.get("mesh.embed.weight").shape[1], layers,
                    len(tensors.get("mesh.mlp.0.bias")), len(tensors.get("mesh.basis")))
        stage = tensors.fill(stage.double(), "mesh.")
        stage.body_points = BodyPoints(tensors.get("nearest.points"), tensors.get("nearest.joint_weights"))
        return stage

    def trained(self):
        return {name: value for name, value in self.state_dict().items() if name.startswith(self.TRAINED)}

    def given(self, fitted):
        return {"nearest.points": fitted.nearest_points, "nearest.joint_weights": fitted.nearest_weights,
                "mesh.input_mean": self.input_mean, "mesh.input_deviation": self.input_deviation}

    def play(self, x, pose):
        states = self.reset(1, x)
        for frame in pose.body_frame:
            s, states = self.embedded(self.body_points(frame[None]), states)
            yield self.coefficients(s)[0]

    def reset(self, batch, like):
        shape = len(self.graph.columns), batch, self.embed.in_features
        return [torch.zeros(shape, dtype=like.dtype, device=like.device) for _ in self.layers]

    def embedded(self, points, states):
        """One tick: body points [n, B, 3] -> (s [B, n], next states)."""
        x, following = (points - self.input_mean) / self.input_deviation, []
        for layer, state in zip(self.layers, states):
            x, state = layer(x, state, self.graph)
            following.append(state)
        return self.embed(x).squeeze(-1).t(), following

    def coefficients(self, embedded):
        """Q [..., k] from s [..., n]."""
        return self.mlp(embedded)

    def displacement(self, coefficients):
        flat = coefficients @ self.basis.reshape(len(self.basis), -1)
        return flat.reshape(*coefficients.shape[:-1], -1, 3)
