#!/usr/bin/env python3
"""The bundled garment through C# under Mono and through C++: the same bits, in the model's space and in Unity's; and
Unity's space against a mirror made here.

Usage: check_output.py DCLOTH BUNDLE SEQUENCE REFERENCE MONO PLAY_EXE FOLDER
"""
import math
import re
import subprocess
import sys
from array import array
from pathlib import Path

import player_script as script

PRECISIONS = ("int8", "fp32")
FLOATS = 10  # position, normal, tangent


def frames_of(poses, undrawn=(40, 41)):
    """Every case of a frame: the model's own rate, then frames half as long, pipelined; jumps, a reset, a hitch, a
    pause, fewer stages, the body kept free, frames that are not drawn, and a pose with NaN, which both sides refuse."""
    frames = []
    for i, matrices in enumerate(poses):
        seconds, flags = (1 / 30, 0) if i < len(poses) // 2 else (1 / 60, script.PIPELINED)
        stages = script.SKELETON if 30 <= i < 34 else script.STATIC if 34 <= i < 36 else script.MESH
        if i in (20, 95):
            flags |= script.JUMPED
        if i == 60:
            flags |= script.RESET
        if i == 25:
            seconds = 0.21
        if i in (50, 110):
            seconds = 0.0
        if i == 70:
            matrices = array("f", matrices)
            matrices[3] = math.nan
        frames.append((seconds, flags, stages, script.OUTSIDE_BODY if i % 10 < 3 else 0, i not in undrawn, matrices))
    return frames


def without(frames, flag):
    return [(s, f & ~flag, st, o, d, m) for s, f, st, o, d, m in frames]


def distance_mm(a, b):
    """Largest distance of two frames' vertices, the second's x turned round."""
    worst = 0.0
    for i in range(0, len(a), FLOATS):
        worst = max(worst, math.dist((a[i], a[i + 1], a[i + 2]), (-b[i], b[i + 1], b[i + 2])))
    return 1e3 * worst


def outward_share(vertices, triangles):
    """Share of triangles whose front, in Unity the side from which they turn clockwise, is the side of their normals.
    In left-handed numbers cross(b - a, c - a) points there."""
    agreeing = 0
    for i in range(0, len(triangles), 3):
        a, b, c = (vertices[FLOATS * v:FLOATS * v + 6] for v in triangles[i:i + 3])
        u, v = [b[k] - a[k] for k in range(3)], [c[k] - a[k] for k in range(3)]
        cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        agreeing += sum(cross[k] * (a[3 + k] + b[3 + k] + c[3 + k]) for k in range(3)) > 0
    return agreeing / (len(triangles) // 3)


class Players:
    def __init__(self, reference, mono, play, folder, names, uv, vertex_count):
        self.commands = {"c++": [reference], "c#": [mono, play]}
        self.folder, self.names, self.uv, self.vertex_count = folder, names, uv, vertex_count

    def __call__(self, language, model, frames, space):
        """The bytes that a player makes of the frames."""
        path, result = self.folder / "script.bin", self.folder / "result.bin"
        script.write(path, self.names, self.uv, frames)
        result.unlink(missing_ok=True)
        subprocess.run([*self.commands[language], model, path, result, space], check=True, stdout=subprocess.DEVNULL)
        return result.read_bytes()

    def cut(self, data, frames):
        return script.Result(data, len(frames), self.vertex_count, FLOATS)


def check_moves(result, frames):
    """What is compared is not empty: a moving garment of finite numbers, one refused frame."""
    assert result.status == [7 if i == 70 else 0 for i in range(len(frames))], result.status
    assert all(math.isfinite(x) for frame in result.vertices for x in frame)
    moved = sum(a != b for a, b in zip(result.vertices, result.vertices[1:]))
    assert moved > 0.9 * len(frames), f"{moved} of {len(frames)} frames differ from the one before"
    assert result.vertices[40] == result.vertices[39], "a frame that is not drawn leaves the vertices alone"


def check_mirror(native, unity):
    """Equal numbers, x turned round: positions, normals, tangents, bounds; and w, as the bitangent's side changes."""
    sign = array("f", [-1, 1, 1, -1, 1, 1, -1, 1, 1, -1])
    for f, (a, b) in enumerate(zip(native.vertices, unity.vertices)):
        different = sum(x * sign[i % FLOATS] != y for i, (x, y) in enumerate(zip(a, b)))
        assert different == 0, f"frame {f}: {different} of {len(a)} numbers are not the mirrored ones"
        low, high = native.bounds[f], unity.bounds[f]
        turned = [-low[3], low[1], low[2], -low[0], low[4], low[5]]
        assert list(high) == turned, f"frame {f}: bounds {list(high)}, mirrored {turned}"


def check_convention(names, pose, unity, triangles):
    """What the words mean: the character faces +Z when the sequence starts, so in Unity its left arm is at x below
    zero; and outside is outside."""
    for left, right in (("LeftArm", "RightArm"), ("LeftUpLeg", "RightUpLeg")):
        x = [pose[16 * names.index(name) + 3] for name in (left, right)]
        assert x[0] < 0 < x[1], f"{left} at x {x[0]}, {right} at {x[1]}"
    share = outward_share(unity.vertices[1], triangles)
    assert share > 0.98, f"{share:.1%} of the triangles show their front on the side of their normals"
    return share


def main():
    if len(sys.argv) != 8:
        sys.exit(__doc__)
    tool, bundle, sequence, reference, mono, play, folder = sys.argv[1:]
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    names, poses = script.read_sequence(sequence)
    frames, mirrored = frames_of(poses), frames_of([script.mirrored(p) for p in poses])
    for precision in PRECISIONS:
        model = folder / f"skirt-{precision}.dcloth"
        subprocess.run([tool, "convert", bundle, "-o", model, "--precision", precision], check=True,
                       capture_output=True)
        listing = subprocess.run([mono, play, "--describe", model, folder / "triangles.bin"], check=True,
                                 capture_output=True, text=True).stdout
        vertex_count = int(listing.split()[0])
        triangles = array("H", (folder / "triangles.bin").read_bytes())
        uv = [x for i in range(vertex_count) for x in (i % 89 / 89, i // 89 / 89)]
        players = Players(reference, mono, play, folder, names, uv, vertex_count)

        native, unity = players("c#", model, frames, "model"), players("c#", model, mirrored, "unity")
        assert native == players("c++", model, frames, "model"), f"{precision}: C# and C++ differ in the model's space"
        assert unity == players("c++", model, mirrored, "unity"), f"{precision}: C# and C++ differ in Unity's space"
        cut, cut_unity = players.cut(native, frames), players.cut(unity, frames)
        check_moves(cut, frames)
        check_mirror(cut, cut_unity)
        share = check_convention(names, mirrored[0][-1], cut_unity, triangles)

        print(f"{precision}: {len(frames)} frames of {vertex_count} vertices: C# equals C++ to the bit in both spaces, "
              f"Unity's is the mirrored one; {share:.2%} of the triangles face out")
    # Each of these would go unseen if a flag, or the space, did not reach the engine.
    for what, other in (("jumps", without(frames, script.JUMPED)), ("resets", without(frames, script.RESET)),
                        ("pipelining", without(frames, script.PIPELINED)),
                        ("output flags", [(s, f, st, 0, d, m) for s, f, st, _, d, m in frames]),
                        ("stages", [(s, f, script.MESH, o, d, m) for s, f, _, o, d, m in frames])):
        assert players("c#", model, other, "model") != native, f"without {what} nothing changes"
    wrong = players.cut(players("c#", model, mirrored, "model"), frames)
    error = distance_mm(cut.vertices[-1], wrong.vertices[-1])
    assert error > 1, f"Unity's poses in the model's space are off by {error} mm only"
    fitted = subprocess.run([mono, play, "--fit", model], check=True, capture_output=True, text=True).stdout
    assert re.fullmatch(r"scale 1\.200, \d+ bones, off by 0\.0\d\d mm\n", fitted), fitted
    print(f"a character of other names and size: {fitted.strip()}")
    print(f"flags and stages arrive; in the wrong space {error:.0f} mm off")
    return 0


if __name__ == "__main__":
    sys.exit(main())
