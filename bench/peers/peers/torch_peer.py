"""PyTorch on one thread: each stage traced and frozen, or as it is, whichever is faster."""
import re
import subprocess
import warnings

import torch
from torch.nn import functional

from .peer import Peer, fastest

warnings.filterwarnings("ignore", message="Sparse CSR tensor support is in beta")


def blas():
    """The BLAS library this process really loaded."""
    with open("/proc/self/maps", encoding="ascii", errors="replace") as maps:
        paths = sorted({line.split()[-1] for line in maps if re.search(r"blas|libmkl", line)})
    for path in paths:
        owner = subprocess.run(["dpkg", "-S", path], capture_output=True, text=True, check=False).stdout
        for package in re.findall(r"^(lib[a-z0-9-]*(?:blas|mkl)[a-z0-9-]*)", owner, re.MULTILINE):
            found = subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version}", package], capture_output=True,
                                   text=True, check=False).stdout
            if found:
                return found
    return ", ".join(path.rsplit("/", 1)[-1] for path in paths) or "its own BLAS"


def tensors(values):
    return [torch.from_numpy(v) for v in values]


class Static(torch.nn.Module):
    def __init__(self, w):
        super().__init__()
        (self.a, self.b), (self.c, self.d) = (tensors((m.T.copy(), b)) for m, b in w.static)

    def forward(self, x):
        return functional.linear(functional.relu(functional.linear(x, self.a, self.b)), self.c, self.d)


class Skeleton(torch.nn.Module):
    def __init__(self, w):
        super().__init__()
        self.cell = torch.nn.GRUCell(len(w.gru[0]), len(w.gru[2]))
        with torch.no_grad():
            for name, value in zip(("weight_ih", "bias_ih", "weight_hh", "bias_hh"), tensors(w.gru)):
                getattr(self.cell, name).copy_(value.T if value.dim() == 2 else value)

    def forward(self, x, h):
        return self.cell(x, h)


class Mean(torch.nn.Module):
    """The mean over N(i), in one of three formulations."""

    def __init__(self, w, kind):
        super().__init__()
        self.kind = kind
        self.columns, self.padding, self.inverse = tensors((w.columns, w.padding, w.inverse_count))
        self.n, self.k = w.columns.shape
        present = torch.ones(self.n, self.k)
        present[:, 1:] = (self.columns[:, 1:] != self.columns[:, :1]).float()
        self.weights = present * self.inverse
        if kind == "sparse CSR product":
            kept = present.ravel() > 0
            rows = torch.arange(self.n)[:, None].expand(self.n, self.k).ravel()[kept]
            self.matrix = torch.sparse_coo_tensor(torch.stack([rows, self.columns.ravel()[kept]]),
                                                  self.weights.ravel()[kept], (self.n, self.n)).to_sparse_csr()

    def forward(self, x):
        if self.kind == "embedding bag":
            return functional.embedding_bag(self.columns, x, mode="sum", per_sample_weights=self.weights)
        if self.kind == "sparse CSR product":
            return self.matrix @ x
        total = x.index_select(0, self.columns.ravel()).reshape(self.n, self.k, -1).sum(1)
        return (total - x * self.padding) * self.inverse


class Mesh(torch.nn.Module):
    def __init__(self, w, kind):
        super().__init__()
        self.mean, self.width = Mean(w, kind), len(w.layers[0].u)
        self.layers = [tensors((y.x, y.x_bias, y.u_zr, y.u, y.o, y.o_bias, y.norm_weight, y.norm_bias))
                       for y in w.layers]
        self.slopes = [y.slope for y in w.layers]
        self.embed, self.shift = tensors(w.embed)
        (self.a, self.b), (self.c, self.d) = (tensors((m.T.copy(), b)) for m, b in w.mlp)

    def forward(self, x, *states):
        following, f = [], self.width
        for (matrix, bias, u_zr, u, o, o_bias, gain, offset), slope, h in zip(self.layers, self.slopes, states):
            gates = torch.addmm(bias, self.mean(x), matrix)
            zr = torch.sigmoid(torch.addmm(gates[:, :2 * f], h, u_zr))
            candidate = torch.tanh(torch.addmm(gates[:, 2 * f:], zr[:, f:] * h, u))
            h = torch.lerp(h, candidate, zr[:, :f])
            following.append(h)
            x = functional.leaky_relu(functional.layer_norm(torch.addmm(o_bias, h, o), (f,), gain, offset, 1e-5), slope)
        s = torch.addmm(self.shift, x, self.embed).reshape(1, -1)
        q = functional.linear(functional.relu(functional.linear(s, self.a, self.b)), self.c, self.d)
        return (q, *following)


class Displacement(torch.nn.Module):
    def __init__(self, w):
        super().__init__()
        self.basis, = tensors((w.basis,))

    def forward(self, p, q):
        return torch.cat([p, q], 1) @ self.basis


class Skinning(torch.nn.Module):
    def __init__(self, w):
        super().__init__()
        self.weights, self.template, self.pivots = tensors((w.skin, w.template, w.pivots))

    def forward(self, d, linear, posed, delta):
        pivots = (self.pivots + d.reshape(-1, 3)).unsqueeze(2)
        bones = torch.cat([linear, posed.unsqueeze(2) - linear @ pivots], 2)
        blended = (self.weights @ bones.reshape(-1, 12)).reshape(-1, 3, 4)
        point = self.template + delta.reshape(-1, 3)
        return torch.baddbmm(blended[:, :, 3:], blended[:, :, :3], point.unsqueeze(2)).squeeze(2)


class TorchPeer(Peer):
    name, precision = "PyTorch", "fp32"

    def __init__(self, case, folder):
        del folder
        torch.set_num_threads(1)
        self.version, self.tried = f"{torch.__version__.split('+')[0]}, {blas()}", []
        w = case.weights
        self._case, n, width = case, len(w.columns), len(w.layers[0].u)
        self._zero = torch.zeros(1, len(w.gru[2])), [torch.zeros(n, width) for _ in w.layers]
        self._given = {"static": (torch.from_numpy(case.x[:1]),),
                       "skeleton": (torch.from_numpy(case.x[:1]), self._zero[0]),
                       "mesh": (torch.from_numpy(case.points[0]), *self._zero[1]),
                       "displacement": (self._zero[0], torch.zeros(1, w.mlp[1][0].shape[1])),
                       "skinning": (torch.zeros(1, w.static[1][0].shape[1]), torch.from_numpy(case.linear[0]),
                                    torch.from_numpy(case.posed[0]), torch.zeros(1, 3 * n))}
        means = ("embedding bag", "gather, sum", "sparse CSR product")
        graphs = {"static": {"dense": lambda: Static(w)}, "skeleton": {"GRU cell": lambda: Skeleton(w)},
                  "mesh": {kind: (lambda k=kind: Mesh(w, k)) for kind in means},
                  "displacement": {"stacked basis": lambda: Displacement(w)},
                  "skinning": {"dense": lambda: Skinning(w)}}
        self._modules = {}
        for stage, kinds in graphs.items():
            self._modules[stage], _ = fastest(stage, {
                f"{kind}, {way}": (lambda b=build, g=way, s=stage: self._make(s, b, g))
                for kind, build in kinds.items() for way in ("eager", "traced")}, self.tried)
        self.weight_bytes = sum(v.nbytes for stage in w.matrices().values() for v in stage)
        self.reset()

    def _make(self, stage, build, way):
        module = build().eval()
        if way == "traced":
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                module = torch.jit.freeze(torch.jit.trace(module, self._given[stage], check_trace=False))

        def call():
            with torch.inference_mode():
                return module(*self._given[stage])
        for _ in range(3):    # the tracer's executor optimises on its first calls
            call()
        return module, call

    def reset(self):
        self._p, self._states = self._zero[0], list(self._zero[1])

    def prepare(self, stage, frame):
        case = self._case
        if stage == "static":
            self._input = (torch.from_numpy(case.x[frame:frame + 1]),)
        elif stage == "skeleton":
            self._input = (torch.from_numpy(case.x[frame:frame + 1]), self._p)
        elif stage == "mesh":
            self._input = (torch.from_numpy(case.points[frame]), *self._states)
        elif stage == "displacement":
            self._input = (self._p, self._q)
        else:
            self._input = (self._d, torch.from_numpy(case.linear[frame]), torch.from_numpy(case.posed[frame]),
                           self._delta)

    def run(self, stage):
        with torch.inference_mode():
            self._output = self._modules[stage](*self._input)

    def finish(self, stage):
        if stage == "mesh":
            self._q, *self._states = self._output
        else:
            setattr(self, {"static": "_d", "skeleton": "_p", "displacement": "_delta", "skinning": "_positions"}[stage],
                    self._output)

    def network_output(self):
        return self._d.numpy(), self._delta.numpy()

    def skinned(self):
        return self._positions.numpy()
