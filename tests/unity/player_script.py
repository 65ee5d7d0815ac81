"""What both players are given: poses of a sequence with times and flags, in one flat file; and what they give back.

Script, little-endian: int32 joints, int32 frames, int32 bytes of names and the names, one a line, int32 uv floats and
uv; per frame float seconds, uint32 flags, uint32 stages, uint32 output flags, uint32 draw, float [joints, 16] matrices,
rows contiguous. Flags are DCLOTH_FRAME_*, and RESET for a reset before the frame.
Result: per frame int32 status, float lag, float tick share, float [6] bounds, float [vertices, 6 or 10]; then the saved
state.
"""
import json
import struct
from array import array

PIPELINED, JUMPED, RESET = 1, 2, 4
STATIC, SKELETON, MESH = 1, 3, 7
OUTSIDE_BODY = 1


def read_sequence(path):
    """(names, frames) of a .safetensors sequence: each frame an array of joints * 16 floats."""
    with open(path, "rb") as file:
        data = file.read()
    size, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8:8 + size])
    names = json.loads(header["__metadata__"]["joint_names"])
    entry = header["joint_matrices"]
    assert entry["dtype"] == "F32" and entry["shape"][1:] == [len(names), 4, 4], entry
    begin, end = (8 + size + x for x in entry["data_offsets"])
    values, step = array("f", data[begin:end]), 16 * len(names)
    return names, [values[i:i + step] for i in range(0, len(values), step)]


def mirrored(matrices):
    """The same pose where x points the other way, joints' own axes too: S M S with S = diag(-1, 1, 1, 1)."""
    return array("f", (-x if (i % 16 // 4 == 0) != (i % 4 == 0) else x for i, x in enumerate(matrices)))


def write(path, names, uv, frames):
    """frames: (seconds, flags, stages, output flags, draw, matrices)."""
    text = "\n".join(names).encode()
    with open(path, "wb") as file:
        file.write(struct.pack("<3i", len(names), len(frames), len(text)) + text)
        file.write(struct.pack("<i", len(uv)) + array("f", uv).tobytes())
        for seconds, flags, stages, output_flags, draw, matrices in frames:
            file.write(struct.pack("<f4I", seconds, flags, stages, output_flags, draw) + matrices.tobytes())


class Result:
    """A player's frames, cut apart."""

    def __init__(self, data, frame_count, vertex_count, vertex_floats):
        self.status, self.lag, self.share, self.bounds, self.vertices = [], [], [], [], []
        step = 4 * (3 + 6 + vertex_count * vertex_floats)
        assert len(data) > frame_count * step, f"{len(data)} bytes for {frame_count} frames of {step}"
        for at in range(0, frame_count * step, step):
            status, lag, share = struct.unpack_from("<iff", data, at)
            self.status.append(status)
            self.lag.append(lag)
            self.share.append(share)
            self.bounds.append(array("f", data[at + 12:at + 36]))
            self.vertices.append(array("f", data[at + 36:at + step]))
        self.state = data[frame_count * step:]
