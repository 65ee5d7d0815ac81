"""The patch stage over a window of ticks, with its gradient (training/patch_bptt, C++).

The library is found at $DCLOTH_PATCH_BPTT or in build/training beside this checkout; `scripts/build.sh build` makes it.
"""
import ctypes
import functools

import numpy as np
import torch

from . import libraries

_INT = ctypes.POINTER(ctypes.c_int32)
_COUNTS = ("streams", "ticks", "joints", "patches", "points", "width", "embedding", "layers", "neighbours")
_ARRAYS = ("patch_joint", "point_joints", "limbs", "capsule_joints", "near")


class _Shape(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in _COUNTS] + [(name, _INT) for name in _ARRAYS]


@functools.cache
def library():
    """The loaded library, see libraries.load."""
    return libraries.load("patch_bptt", _Shape, ("weights", "tape"), {"forward": 9, "backward": 6})


def _data(tensor):
    return None if tensor is None else tensor.data_ptr()


class Native:
    """The patch stage of a layout. One window's gradient at a time: the next window overwrites what it needs."""

    def __init__(self, layout, joints, width, embedding, dtype=torch.float32):
        self.library, self.dtype = library(), dtype
        self.kind = "f32" if dtype == torch.float32 else "f64"
        patches, points = layout.sizes
        layers, neighbours = layout.near.shape[:2]
        self.counts = {"joints": joints, "patches": patches, "points": points, "width": width, "embedding": embedding,
                       "layers": layers, "neighbours": neighbours}
        self.arrays = {name: np.ascontiguousarray(getattr(layout, name), np.int32) for name in _ARRAYS}
        geometry = (layout.axes, layout.centres, layout.point_parts, layout.capsules)
        self.geometry = torch.as_tensor(np.concatenate([values.ravel() for values in geometry])).to(dtype)
        self.tape, self.ticket = None, 0
        self.size = self.library.patch_bptt_weights_size(ctypes.byref(self._shape(1, 1)))

    def _shape(self, streams, ticks):
        return _Shape(streams, ticks, *(self.counts[name] for name in _COUNTS[2:]),
                      *(self.arrays[name].ctypes.data_as(_INT) for name in _ARRAYS))

    def forward(self, weights, poses, last, before, hidden, noise=None, taped=False):
        """poses [B, T + 2, 12 J + 6]; last, before [B, K, 3, R] and hidden [B, K, W] advance in place ->
        displacements [T, B, K, 3, R]."""
        streams, ticks = poses.shape[0], poses.shape[1] - 2
        shape = self._shape(streams, ticks)
        for tensor in (weights, poses, last, before, hidden):
            if tensor.dtype != self.dtype or not tensor.is_contiguous():
                raise ValueError(f"patch_bptt: {tensor.dtype} {list(tensor.shape)}, needed is contiguous {self.dtype}")
        if len(weights) != self.size or poses.shape[2] != 12 * self.counts["joints"] + 6:
            raise ValueError(f"patch_bptt: {len(weights)} weights and poses of {poses.shape[2]} numbers; needed are "
                             f"{self.size} and {12 * self.counts['joints'] + 6}")
        out = torch.empty(ticks, *last.shape, dtype=self.dtype)
        if taped:
            size = self.library.patch_bptt_tape_size(ctypes.byref(shape))
            if self.tape is None or len(self.tape) < size:
                self.tape = torch.empty(size, dtype=self.dtype)
            self.ticket += 1
        getattr(self.library, f"patch_bptt_forward_{self.kind}")(
            ctypes.byref(shape), _data(self.geometry), _data(weights), _data(poses), _data(noise), _data(last),
            _data(before), _data(hidden), _data(self.tape if taped else None), _data(out))
        return out

    def backward(self, weights, poses, by_moved):
        """-> gradient [size] of the window that ran last with `taped`."""
        shape, out = self._shape(poses.shape[0], poses.shape[1] - 2), torch.empty(self.size, dtype=self.dtype)
        by_moved = by_moved.contiguous()
        getattr(self.library, f"patch_bptt_backward_{self.kind}")(
            ctypes.byref(shape), _data(self.geometry), _data(weights), _data(poses), _data(self.tape),
            _data(by_moved), _data(out))
        return out


class _Window(torch.autograd.Function):
    @staticmethod
    def forward(context, weights, native, poses, last, before, hidden, noise):
        out = native.forward(weights.detach(), poses, last, before, hidden, noise, taped=True)
        context.native, context.poses, context.ticket = native, poses, native.ticket
        context.save_for_backward(weights)
        return out

    @staticmethod
    def backward(context, by_moved):
        if context.ticket != context.native.ticket:
            raise RuntimeError("another window ran before this one's gradient was asked for")
        return (context.native.backward(context.saved_tensors[0].detach(), context.poses, by_moved),) + (None,) * 6


def window(weights, native, poses, last, before, hidden, noise=None):
    """Native.forward with a gradient by `weights`; none by the state before the window."""
    return _Window.apply(weights, native, poses, last, before, hidden, noise)
