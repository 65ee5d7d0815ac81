"""Contact sheet of a sequence: body and cloth, a small z-buffer rasteriser in numpy.

    python3 -m dcloth_training.simulate.render SEQUENCE --character CHARACTER -o SHEET.png

Ground truth is looked at before it is trusted: tangled, exploded or sunken cloth shows here.
"""
import argparse

import numpy as np

from .. import safetensors_io, sequence
from ..motion import rotations, skeleton

BODY_COLOUR = (0.82, 0.70, 0.62)
CLOTH_COLOUR = (0.25, 0.42, 0.66)
LINING_COLOUR = (0.60, 0.30, 0.25)   # the inside, so that inverted cloth is seen
BACKGROUND = (0.96, 0.96, 0.95)
GROUND_COLOUR = (0.86, 0.86, 0.84)


def vertex_normals(vertices, faces):
    """Area-weighted unit normals [n, 3]."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for i in range(3):
        for axis in range(3):
            out[:, axis] += np.bincount(faces[:, i], face[:, axis], len(vertices))
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


class Canvas:
    """Orthographic picture, `size` pixels square, `span` metres wide."""

    def __init__(self, size, span, centre, yaw, pitch=0.12):
        self.size, self.scale = size, size / span
        self.view = rotations.about_axis("X", pitch) @ rotations.about_axis("Y", -yaw)
        self.centre = np.asarray(centre)
        self.colour = np.tile(np.array(BACKGROUND), (size, size, 1))
        self.depth = np.full((size, size), -np.inf)

    def draw(self, vertices, faces, front, back=None):
        """Rasterise triangles; nearer (larger view z) wins. front/back: colours of both sides."""
        seen = (vertices - self.centre) @ self.view.T
        normals = vertex_normals(vertices, faces) @ self.view.T
        x = self.size / 2 + seen[:, 0] * self.scale
        y = self.size / 2 - seen[:, 1] * self.scale
        px, py, pz = x[faces], y[faces], seen[:, 2][faces]
        low_x = np.clip(np.ceil(px.min(1)), 0, self.size).astype(int)
        low_y = np.clip(np.ceil(py.min(1)), 0, self.size).astype(int)
        wide = np.maximum(np.clip(np.floor(px.max(1)) + 1, 0, self.size).astype(int) - low_x, 0)
        tall = np.maximum(np.clip(np.floor(py.max(1)) + 1, 0, self.size).astype(int) - low_y, 0)
        area = ((px[:, 1] - px[:, 0]) * (py[:, 2] - py[:, 0])
                - (px[:, 2] - px[:, 0]) * (py[:, 1] - py[:, 0]))
        count = np.where(np.abs(area) > 1e-9, wide * tall, 0)
        face = np.repeat(np.arange(len(faces)), count)
        within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        column = low_x[face] + within % wide[face]
        row = low_y[face] + within // wide[face]

        def edge(i, j):
            return ((px[face, j] - column) * (py[face, i] - row)
                    - (px[face, i] - column) * (py[face, j] - row)) / -area[face]

        weight = np.stack([edge(1, 2), edge(2, 0), edge(0, 1)], -1)
        hit = (weight >= -1e-6).all(1)
        face, column, row, weight = face[hit], column[hit], row[hit], weight[hit]
        depth = (weight * pz[face]).sum(1)
        order = np.argsort(depth, kind="stable")  # far to near: the nearest is written last
        order = order[depth[order] > self.depth[row[order], column[order]]]
        face, column, row, weight = face[order], column[order], row[order], weight[order]
        normal = np.einsum("ki,kid->kd", weight, normals[faces[face]])
        facing = area[face] < 0  # screen y points down: outward faces turn negative
        normal *= np.where(facing, 1.0, -1.0)[:, None]
        light = np.array([0.35, 0.55, 0.76])
        shade = 0.38 + 0.62 * np.clip(normal @ light, 0, 1)
        colour = np.where(facing[:, None], front, front if back is None else back)
        self.colour[row, column] = colour * shade[:, None]
        self.depth[row, column] = depth[order]


def picture(character, matrices, cloth, yaw, size=300, span=1.9):
    """One frame: matrices [J, 4, 4], cloth [n, 3] -> [size, size, 3]."""
    bind = character["joint_bind"].astype(np.float64)
    body = skeleton.skin(character["body_vertices"], character["body_weights"], bind,
                         matrices[None].astype(np.float64))[0]
    ground = matrices[0, :3, 3] * np.array([1.0, 0.0, 1.0])
    canvas = Canvas(size, span, ground + np.array([0.0, 0.82, 0.0]), yaw)
    corner = np.array([[-0.6, 0, -0.6], [-0.6, 0, 0.6], [0.6, 0, 0.6], [0.6, 0, -0.6]]) + ground
    canvas.draw(corner - [0, 0.004, 0], np.array([[0, 1, 2], [0, 2, 3]]), GROUND_COLOUR)
    canvas.draw(body, character["body_faces"], BODY_COLOUR)
    canvas.draw(cloth.astype(np.float64), character["cloth_faces"], CLOTH_COLOUR, LINING_COLOUR)
    return canvas.colour


def contact_sheet(character, matrices, cloth, frames, columns=6, size=300, yaw=0.6, follow=True):
    """Pictures of `frames` in a grid. `follow` turns the camera with the hips' heading."""
    cells = []
    for frame in frames:
        heading = rotations.heading_of(matrices[frame, 0, :3, :3]) if follow else 0.0
        cells.append(picture(character, matrices[frame], cloth[frame], heading + yaw, size))
    while len(cells) % columns:
        cells.append(np.ones_like(cells[0]))
    rows = [np.concatenate(cells[i:i + columns], 1) for i in range(0, len(cells), columns)]
    return np.concatenate(rows, 0)


def save(path, image):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import image as writer
    writer.imsave(path, np.clip(image, 0, 1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequence")
    parser.add_argument("--character", required=True)
    parser.add_argument("-o", "--out", required=True)
    parser.add_argument("--count", type=int, default=18, help="pictures, evenly spaced")
    parser.add_argument("--frames", help="comma-separated frame numbers instead of --count")
    parser.add_argument("--columns", type=int, default=6)
    parser.add_argument("--size", type=int, default=300)
    parser.add_argument("--yaw", type=float, default=0.6, help="camera, radians from the front")
    options = parser.parse_args()
    character, _ = safetensors_io.read(options.character)
    data = sequence.read(options.sequence)
    if options.frames:
        frames = [int(f) for f in options.frames.split(",")]
    else:
        frames = np.unique(np.linspace(0, len(data.truth) - 1, options.count).astype(int))
    save(options.out, contact_sheet(character, data.joint_matrices, data.truth, frames,
                                    options.columns, options.size, options.yaw))


if __name__ == "__main__":
    main()
