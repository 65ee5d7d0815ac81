"""Sequences: a character's joint matrices a frame, and the cloth's true shape where known.

One safetensors file: joint_matrices [T, J, 4, 4] f32 world, optional truth [T, n, 3] f32 world
metres, optional wind [T, 3] f32 world metres a second, metadata joint_names (JSON list), fps, clip,
kind ("dynamic" or "static"). A compact file stores truth as f16 about truth_origin [T, 3] f32;
read() adds the origin.
"""
import json
from dataclasses import dataclass
from typing import Optional

import numpy as np

from . import safetensors_io

FASTEST_WIND = 100.0    # m/s, as dcloth.h allows


@dataclass
class Sequence:
    joint_matrices: np.ndarray
    truth: Optional[np.ndarray]
    joint_names: list
    fps: float
    clip: str
    kind: str
    wind: Optional[np.ndarray] = None   # [T, 3]; None: calm


def write(path, sequence):
    tensors = {"joint_matrices": sequence.joint_matrices.astype(np.float32)}
    if sequence.truth is not None:
        tensors["truth"] = sequence.truth.astype(np.float32)
    if sequence.wind is not None:
        tensors["wind"] = np.asarray(sequence.wind, np.float32)
    safetensors_io.write(path, tensors, {
        "joint_names": json.dumps(list(sequence.joint_names)), "fps": f"{sequence.fps:g}",
        "clip": sequence.clip, "kind": sequence.kind})


def read(path, truth=True):
    """A file's Sequence; `truth` False leaves that out, which is most of the bytes."""
    tensors, metadata = safetensors_io.read(path, without=() if truth else ("truth", "truth_origin"))

    def refuse(what):
        raise safetensors_io.SafetensorsError(f"{path}: {what}")

    matrices, truth, wind = (tensors.get(name) for name in ("joint_matrices", "truth", "wind"))
    try:
        names = json.loads(metadata["joint_names"])
        fps = float(metadata["fps"])
    except (KeyError, ValueError) as error:
        refuse(f"metadata joint_names or fps missing or malformed: {error}")
    if matrices is None or matrices.ndim != 4 or matrices.shape[1:] != (len(names), 4, 4):
        refuse(f"joint_matrices {None if matrices is None else matrices.shape}, "
               f"expected [T, {len(names)}, 4, 4]")
    if truth is not None and (truth.ndim != 3 or truth.shape[::2] != (len(matrices), 3)):
        refuse(f"truth {truth.shape}, expected [{len(matrices)}, n, 3]")
    if wind is not None and wind.shape != (len(matrices), 3):
        refuse(f"wind {wind.shape}, expected [{len(matrices)}, 3]")
    if truth is not None:
        truth = truth.astype(np.float32)
        origin = tensors.get("truth_origin")
        if origin is not None:
            if origin.shape != (len(matrices), 3):
                refuse(f"truth_origin {origin.shape}, expected [{len(matrices)}, 3]")
            truth += origin[:, None]
    if not all(np.isfinite(t).all() for t in (matrices, truth, wind) if t is not None):
        refuse("joint_matrices, truth or wind not finite")
    if wind is not None and np.linalg.norm(wind, axis=1).max(initial=0) > FASTEST_WIND:
        refuse(f"wind of {np.linalg.norm(wind, axis=1).max():.4g} m/s, allowed is at most {FASTEST_WIND:g}")
    return Sequence(matrices, truth, names, fps, metadata.get("clip", ""),
                    metadata.get("kind", "dynamic"), wind)
