"""Un-skinned truth on disk: training reads it every epoch, and a garment's clips do not fit in memory.

<folder>/<static stage>/<clip file>.npy, float16 [T, n, 3], both names digests of what the residual depends
on: a resumed run finds its files, another static stage finds none and removes what the last one left.
"""
import hashlib
import os
import shutil

import numpy as np


def _digest(*parts):
    sha = hashlib.sha256()
    for part in parts:
        sha.update(part if isinstance(part, bytes) else str(part).encode())
    return sha.hexdigest()[:16]


def kept(folder, clip, make):
    """float16 array of `clip`, from its file in `folder` or from make(), mapped; writing to it stays in memory."""
    told = os.stat(clip.path)
    name = _digest(os.path.abspath(clip.path), told.st_size, told.st_mtime_ns, clip.mirrored)
    path = os.path.join(folder, name + ".npy")
    if not os.path.exists(path):
        os.makedirs(folder, exist_ok=True)
        with open(path + ".part", "wb") as file:
            np.save(file, make().astype(np.float16))
        os.replace(path + ".part", path)
    return np.asarray(np.load(path, mmap_mode="c"))


class Store:
    """Residuals of one static stage in `folder`: 48 kB a frame at 7,952 vertices."""

    def __init__(self, folder, static, standardise):
        tensors = {**static.state_dict(), **{f"x.{k}": v for k, v in standardise.state_dict().items()}}
        name = _digest(*(part for k in sorted(tensors) for part in (k, tensors[k].cpu().numpy().tobytes())))
        os.makedirs(folder, exist_ok=True)
        for other in os.listdir(folder):
            if other != name:
                shutil.rmtree(os.path.join(folder, other))
        self._folder = os.path.join(folder, name)
        os.makedirs(self._folder, exist_ok=True)

    def residual(self, clip, make):
        """[T, n, 3] float16 of `clip`, from the file or from make(); writing to it stays in memory."""
        return kept(self._folder, clip, make)
