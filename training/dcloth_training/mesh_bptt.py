"""Stage 3's graph layers and embedding over a window of ticks, with their gradient (training/mesh_bptt, C++).

The library is found at $DCLOTH_MESH_BPTT or in build/training beside this checkout; `scripts/build.sh build` makes it.
Without it the same runs in PyTorch, some thirty times as long.
"""
import ctypes
import functools

import torch

from . import libraries

_INT = ctypes.POINTER(ctypes.c_int32)
LANES = 8                    # clips side by side
WIDTHS = (4, 8, 16, 32)      # F that the library was built for


class _Shape(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in ("vertices", "ticks", "layers", "width")] + [
        ("start", _INT), ("column", _INT)]


@functools.cache
def library():
    """The loaded library, see libraries.load."""
    return libraries.load("mesh_bptt", _Shape, ("weights", "states", "tape", "scratch"), {"forward": 7, "backward": 6})


def flat_weights(mesh):
    """Layers and embedding as the library reads them, W^p and b folded into the gates; differentiable."""
    parts = []
    for layer in mesh.layers:
        gates = (layer.w_z, layer.w_r, layer.w)
        parts += [layer.w_p @ w for w in gates] + [layer.b @ w for w in gates]
        parts += [layer.u_z, layer.u_r, layer.u, layer.w_o, layer.b_o, layer.norm.weight, layer.norm.bias, layer.prelu]
    parts += [mesh.embed.weight, mesh.embed.bias]
    return torch.cat([p.reshape(-1) for p in parts])


class _Window(torch.autograd.Function):
    """s of a window from the flat weights; states advance in place, and the gradient stops at them."""

    @staticmethod
    def forward(context, weights, native, points, states, taped):
        context.native = native
        context.save_for_backward(weights)
        out, context.ticket = native.forward(weights, points, states, taped)
        context.ticks = len(points)
        return out

    @staticmethod
    def backward(context, gradient):
        weights, = context.saved_tensors
        return context.native.backward(weights, gradient, context.ticks, context.ticket), None, None, None, None


class Native:
    """The layers of `mesh` in C++. One window's gradient at a time: the next window overwrites what it needs."""
    device = torch.device("cpu")

    def __init__(self, mesh):
        self.library, self.mesh = library(), mesh
        graph, self.dtype = mesh.graph, mesh.embed.weight.dtype
        present = graph.weights > 0
        self.mean, self.back = (w[present].to(self.dtype).contiguous() for w in (graph.weights, graph.back))
        self.start = torch.cat([torch.zeros(1, dtype=torch.long), present.sum(1).cumsum(0)]).int()
        self.column = graph.columns[present].int().contiguous()
        self.width = mesh.embed.in_features
        if self.width not in WIDTHS or self.dtype not in (torch.float32, torch.float64):
            raise ValueError(f"mesh stage of width {self.width} in {self.dtype}; the library has widths "
                             f"{', '.join(map(str, WIDTHS))} in float32 and float64")
        self.kind = "f32" if self.dtype == torch.float32 else "f64"
        self.tape, self.scratch, self.ticket = None, None, 0

    def _shape(self, ticks):
        return _Shape(len(self.start) - 1, ticks, len(self.mesh.layers), self.width,
                      ctypes.cast(self.start.data_ptr(), _INT), ctypes.cast(self.column.data_ptr(), _INT))

    def _buffer(self, name, shape):
        """A buffer that is kept from window to window: fresh pages would cost as much as a tick each."""
        size = getattr(self.library, f"mesh_bptt_{name}_size")(ctypes.byref(shape))
        held = getattr(self, name)
        if held is None or len(held) < size:
            held = torch.empty(size, dtype=self.dtype)
            setattr(self, name, held)
        return held

    def forward(self, weights, points, states, taped):
        """points [T, n, 3, LANES], states [L, n, F, LANES] (advanced in place) -> (s [T, n, LANES], ticket)."""
        shape = self._shape(len(points))
        expected = self.library.mesh_bptt_weights_size(ctypes.byref(shape))
        out = torch.empty(*points.shape[:2], LANES, dtype=self.dtype)
        tape = self._buffer("tape", shape).data_ptr() if taped else None
        if taped:
            self.ticket += 1
        weights = weights.detach().contiguous()
        if len(weights) != expected or not getattr(self.library, f"mesh_bptt_forward_{self.kind}")(
                ctypes.byref(shape), self.mean.data_ptr(), weights.data_ptr(), points.data_ptr(),
                states.data_ptr(), tape, self._buffer("scratch", shape).data_ptr(), out.data_ptr()):
            raise ValueError(f"mesh_bptt refused {len(weights)} weights (expected {expected}), points "
                             f"{list(points.shape)}, states {list(states.shape)}")
        return out, self.ticket

    def backward(self, weights, gradient, ticks, ticket):
        if ticket != self.ticket:
            raise RuntimeError("another window ran before this one's gradient was asked for")
        shape, found = self._shape(ticks), torch.empty(len(weights), dtype=torch.float64)
        gradient, weights = gradient.contiguous(), weights.detach().contiguous()
        if not getattr(self.library, f"mesh_bptt_backward_{self.kind}")(
                ctypes.byref(shape), self.back.data_ptr(), weights.data_ptr(), self.tape.data_ptr(),
                gradient.data_ptr(), self._buffer("scratch", shape).data_ptr(), found.data_ptr()):
            raise ValueError(f"mesh_bptt refused a gradient of {list(gradient.shape)}")
        return found.to(self.dtype)

    def fresh(self, batch):
        """States of `batch` clips after a reset."""
        if batch > LANES:
            raise ValueError(f"{batch} clips side by side; the library has {LANES} lanes")
        return torch.zeros(len(self.mesh.layers), len(self.start) - 1, self.width, LANES, dtype=self.dtype)

    def run(self, points, states):
        """Body points [T, n, B, 3] -> s [T, B, n]; states advance in place, without gradient through them."""
        batch = points.shape[2]
        still = (points - self.mesh.input_mean) / self.mesh.input_deviation
        rows = torch.zeros(*points.shape[:2], 3, LANES, dtype=self.dtype)
        rows[..., :batch] = still.transpose(2, 3)
        out = _Window.apply(flat_weights(self.mesh), self, rows, states, torch.is_grad_enabled())
        return out[..., :batch].transpose(1, 2)


class Torch:
    """The same in PyTorch."""

    def __init__(self, mesh):
        self.mesh, self.device = mesh, mesh.embed.weight.device

    def fresh(self, batch):
        return self.mesh.reset(batch, self.mesh.embed.weight)

    def run(self, points, states):
        rows, now = [], list(states)
        for tick in points:
            s, now = self.mesh.embedded(tick, now)
            rows.append(s)
        states[:] = [s.detach() for s in now]
        return torch.stack(rows)


def recurrence(mesh, log=lambda text: None):
    """Native where it can be (on the CPU), else Torch."""
    if mesh.embed.weight.device.type != "cpu":
        return Torch(mesh)
    try:
        return Native(mesh)
    except (FileNotFoundError, ValueError) as error:
        log(f"stage 3 runs in PyTorch: {error}")
        return Torch(mesh)


def window_points(body_points, frames):
    """Body frames [B, T, J, 3, 4] of clips side by side -> body points [T, n, B, 3]."""
    batch, ticks = frames.shape[:2]
    points = body_points(frames.flatten(0, 1))
    return points.reshape(len(points), batch, ticks, 3).permute(2, 0, 1, 3)
