"""Point caches: vertex positions over time. PC2 and MDD, and what every format is read into."""
import os
import struct
from dataclasses import dataclass
from typing import Optional

import numpy as np

from .errors import refuse

MAX_BYTES = 64 << 30
MAX_COORDINATE = 1e7


@dataclass
class Cache:
    """Positions [T, n, 3] float32 in the file's own axes and unit, as they were sampled.

    seconds [T]: of each sample, None where the format has no clock. polygons: tuples of vertex indices, None where
    the format has no faces. frames [T]: the file's own numbers, for messages. inward: polygons run clockwise seen
    from outside.
    """
    path: str
    positions: np.ndarray
    seconds: Optional[np.ndarray] = None
    polygons: Optional[list] = None
    frames: Optional[list] = None
    inward: bool = False

    def __post_init__(self):
        frames = self.frames or range(len(self.positions))
        for frame, points in zip(frames, self.positions):
            if not np.isfinite(points).all() or np.abs(points).max(initial=0) > MAX_COORDINATE:
                bad = int(np.flatnonzero(~(np.abs(points) <= MAX_COORDINATE).all(1))[0])
                refuse(self.path, f"position {points[bad].tolist()} of vertex {bad}",
                       f"numbers within {MAX_COORDINATE:g}", "the simulation blew up or the file is damaged", frame)
        if self.seconds is not None and (np.diff(self.seconds) <= 0).any():
            at = int(np.flatnonzero(np.diff(self.seconds) <= 0)[0]) + 1
            refuse(self.path, f"time {self.seconds[at]:g} s after {self.seconds[at - 1]:g} s", "times that ascend",
                   "write the cache again", at)


def _body(path, header, count_bytes):
    """Refuses sizes before anything is read or allocated."""
    size = os.path.getsize(path)
    if count_bytes + header != size or size > MAX_BYTES:
        refuse(path, f"{size} bytes", f"{count_bytes + header} as its header says, {MAX_BYTES} at most",
               "the file is cut short or damaged; write it again")


def read_pc2(path):
    """Point cache 2: header of 32 bytes, then float32 [T, n, 3], little-endian. It counts frames, not seconds."""
    with open(path, "rb") as file:
        head = file.read(32)
        if len(head) < 32 or head[:12] != b"POINTCACHE2\0":
            refuse(path, f"{head[:12]!r}", "a PC2 file, which begins with POINTCACHE2")
        version, points, start, rate, samples = struct.unpack("<iiffi", head[12:])
        if version != 1 or points <= 0 or samples <= 0:
            refuse(path, f"version {version}, {points} points, {samples} samples", "version 1, counts of at least 1")
        if not (np.isfinite(start) and rate > 0 and rate == 1):
            refuse(path, f"a sample every {rate:g} frames", "a sample every frame", "write the cache with step 1")
        _body(path, 32, 12 * points * samples)
        positions = np.fromfile(file, "<f4", 3 * points * samples).reshape(samples, points, 3)
    first = int(start) if start == int(start) else start
    return Cache(path, positions, frames=[first + i for i in range(samples)])


def read_mdd(path):
    """MDD: big-endian counts, times float32 [T] in seconds, positions float32 [T, n, 3]."""
    with open(path, "rb") as file:
        head = file.read(8)
        if len(head) < 8:
            refuse(path, f"{len(head)} bytes", "an MDD file, at least 8")
        samples, points = struct.unpack(">ii", head)
        if samples <= 0 or points <= 0:
            refuse(path, f"{samples} samples of {points} points", "counts of at least 1", "is it an MDD file?")
        _body(path, 8, 4 * samples + 12 * points * samples)
        seconds = np.fromfile(file, ">f4", samples).astype(np.float64)
        if not np.isfinite(seconds).all():
            refuse(path, "times that are not numbers", "seconds", "write the cache again")
        positions = np.fromfile(file, ">f4", 3 * points * samples).astype(np.float32).reshape(samples, points, 3)
    return Cache(path, positions, seconds)
