"""Contact sheet of a sequence: body and cloth, frame by frame.

    python3 -m dcloth_training.simulate.render SEQUENCE --character CHARACTER -o SHEET.png

Ground truth is looked at before it is trusted: tangled, exploded or sunken cloth shows here.
"""
import argparse
import sys

import numpy as np

from .. import command, picture_file, raster, safetensors_io, sequence
from ..motion import rotations, skeleton

BODY_COLOUR = (0.80, 0.68, 0.60)
CLOTH_COLOUR = (0.26, 0.41, 0.62)
LINING_COLOUR = (0.66, 0.34, 0.27)   # the inside, so that inverted cloth is seen
GROUND_COLOUR = (0.85, 0.85, 0.83)
GROUND_RADIUS = 0.75
MIDDLE = 0.82                        # metres above the ground: the picture's centre


def scene(canvas, body, body_faces, ground, colour=BODY_COLOUR):
    """Draw what is not cloth: the posed body [b, 3] and the ground at `ground` [3], or lower where feet are.

    colour: of the body, [3] or one a vertex."""
    lowest = np.array([ground[0], min(ground[1], body[:, 1].min()), ground[2]])
    canvas.draw(*raster.ground(lowest, GROUND_RADIUS, GROUND_COLOUR), lit=False)
    canvas.draw(body, body_faces, colour)


def picture(character, matrices, cloth, yaw, size=300, span=1.9, samples=2):
    """One frame: matrices [J, 4, 4], cloth [n, 3] -> [size, size, 3]."""
    bind = character["joint_bind"].astype(np.float64)
    body = skeleton.skin(character["body_vertices"], character["body_weights"], bind,
                         matrices[None].astype(np.float64))[0]
    ground = matrices[0, :3, 3] * np.array([1.0, 0.0, 1.0])
    canvas = raster.Canvas(size, span, ground + np.array([0.0, MIDDLE, 0.0]), yaw, samples=samples)
    scene(canvas, body, character["body_faces"], ground)
    canvas.draw(cloth, character["cloth_faces"], CLOTH_COLOUR, LINING_COLOUR)
    return canvas.image()


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


def captions(lines, columns, size):
    """[(x, y, text, size)] for picture_file: a line in the lower corner of each cell of a contact sheet."""
    return [(6 + size * (i % columns), size * (i // columns + 1) - 17, line, 11) for i, line in enumerate(lines)]


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequence")
    parser.add_argument("--character", required=True)
    parser.add_argument("-o", "--out", required=True)
    parser.add_argument("--count", type=int, default=18, help="pictures, evenly spaced")
    parser.add_argument("--frames", help="comma-separated frame numbers instead of --count")
    parser.add_argument("--columns", type=int, default=6)
    parser.add_argument("--size", type=int, default=300)
    parser.add_argument("--yaw", type=float, default=0.6, help="camera, radians from the front")
    return parser.parse_args(argv)


def chosen_frames(options, count):
    """Frame numbers of a sequence of `count` frames."""
    if not options.frames:
        return np.unique(np.linspace(0, count - 1, options.count).astype(int))
    try:
        frames = [int(f) for f in options.frames.split(",")]
    except ValueError:
        raise ValueError(f"--frames '{options.frames}': expected numbers with commas between, 0,12,40") from None
    for frame in frames:
        if not 0 <= frame < count:
            raise ValueError(f"{options.sequence}: frame {frame}: allowed are 0 to {count - 1}")
    return frames


def draw(options):
    character, _ = safetensors_io.read(options.character)
    data = sequence.read(options.sequence)
    if data.truth is None:
        raise ValueError(f"{options.sequence}: no truth, the cloth to draw")
    frames = chosen_frames(options, len(data.truth))
    picture_file.save(options.out,
                      contact_sheet(character, data.joint_matrices, data.truth, frames, options.columns,
                                    options.size, options.yaw),
                      captions([f"frame {f}" for f in frames], options.columns, options.size))


def main(argv=None):
    options = arguments(argv)
    return command.ended("render", lambda: draw(options))


if __name__ == "__main__":
    sys.exit(main())
