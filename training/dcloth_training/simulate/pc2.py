"""Point cache 2 (PC2) writer: vertex positions a frame, read by Blender's Mesh Cache modifier."""
import struct

import numpy as np


def write(path, positions):
    """positions [T, n, 3] metres, one sample a frame, starting at frame 1."""
    frames, count = positions.shape[:2]
    with open(path, "wb") as file:
        file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, count, 1.0, 1.0, frames))
        file.write(np.ascontiguousarray(positions, dtype="<f4").tobytes())
