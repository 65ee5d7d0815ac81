"""Cloth in motion, the simulation beside the network: an animated picture (WebP).

    python3 -m dcloth_training.film SEQUENCE=RUN ... -o OUT.webp [--title TEXT ...]
        --bundle BUNDLE

SEQUENCE: joint matrices and truth of a clip on the figure. RUN: what `dcloth run MODEL SEQUENCE -o RUN.safetensors`
wrote.
BUNDLE: the garment's triangles. Clips follow each other; --title names each. The file appears whole or not at all.
"""
import argparse
import os
import sys

import numpy as np
from PIL import Image, ImageDraw

from . import command, figure, picture_file, raster, safetensors_io, sequence
from .motion import skeleton
from .simulate import render

HEIGHT, WIDTH = 360, 300      # pixels of a panel
SPAN = 2.1                    # metres that a panel's height shows
SAMPLES = 2
EVERY = 2                     # frames of a clip to one of the picture
CLOTH, LINING = (0.55, 0.12, 0.16), (0.40, 0.10, 0.14)
CAPTION = (70, 70, 70)


def panel(body, drawn, faces, cloth, cloth_faces, centre, yaw):
    """One picture [HEIGHT, WIDTH, 3] uint8 of the posed figure [b, 3] and the cloth [n, 3]."""
    at, colours = drawn
    canvas = raster.Canvas(HEIGHT, SPAN, centre, yaw, samples=SAMPLES)
    ground = np.array([centre[0], min(0.0, body[:, 1].min()), centre[2]])
    canvas.draw(*raster.ground(ground, render.GROUND_RADIUS, render.GROUND_COLOUR), lit=False)
    canvas.draw(body[at], faces, colours)
    canvas.draw(cloth, cloth_faces, CLOTH, LINING)
    side = (HEIGHT - WIDTH) // 2
    return (canvas.image()[:, side:side + WIDTH] * 255 + 0.5).astype(np.uint8)


def clip(pair, cloth_faces, title, yaw, frames):
    """Pictures of a clip: simulation left, network right."""
    source, _, result = pair.partition("=")
    item, found = sequence.read(source), safetensors_io.read(result)[0]
    if "positions" not in found or item.truth is None or found["positions"].shape != item.truth.shape:
        raise ValueError(f"{pair}: expected a sequence with its truth and positions of the same frames and vertices")
    ours, skin = found["positions"], figure.load()
    at, faces, colours = skin.drawing()
    pictures = []
    for frame in range(*frames.indices(len(item.truth)))[::EVERY]:
        matrices = item.joint_matrices[frame].astype(np.float64)
        body = skeleton.skin(skin.vertices, skin.weights, skeleton.bind_matrices(), matrices[None])[0]
        hips = matrices[skeleton.INDEX["Hips"], :3, 3]
        centre = np.array([hips[0], render.MIDDLE + 0.06, hips[2]])
        halves = [panel(body, (at, colours), faces, cloth[frame].astype(np.float64), cloth_faces, centre, yaw)
                  for cloth in (item.truth, ours)]
        row = Image.fromarray(np.concatenate(halves, 1))
        draw = ImageDraw.Draw(row)
        for x, text in ((10, f"{title}simulated"), (WIDTH + 10, "dcloth")):
            draw.text((x, HEIGHT - 22), text, CAPTION, picture_file.font(13))
        pictures.append(row)
    return pictures


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="+", metavar="SEQUENCE=RUN")
    parser.add_argument("--bundle", required=True, help="training bundle of the garment")
    parser.add_argument("-o", "--out", required=True)
    parser.add_argument("--title", action="append", default=[], help="of each clip, in order")
    parser.add_argument("--frames", action="append", default=[],
                        help="FIRST:LAST of each clip, in order; all when not given")
    parser.add_argument("--yaw", type=float, default=0.6, help="camera, radians from the front")
    parser.add_argument("--quality", type=int, default=55, help="of the picture, 1 to 100")
    return parser.parse_args(argv)


def _frames(text):
    """slice of "FIRST:LAST", either left out; "" takes all."""
    first, _, last = text.partition(":")
    if not all(end == "" or end.isdigit() for end in (first, last)):
        raise ValueError(f"--frames '{text}': expected FIRST:LAST, such as 20:120")
    return slice(int(first or 0), int(last) if last else None)


def write(options):
    command.folder_of(options.out)
    faces = safetensors_io.read(options.bundle)[0]["template.faces"]
    pictures = []
    for k, pair in enumerate(options.clips):
        title = options.title[k] + ", " if k < len(options.title) else ""
        taken = clip(pair, faces, title, options.yaw, _frames(options.frames[k] if k < len(options.frames) else ""))
        if not taken:
            raise ValueError(f"{pair}: --frames '{options.frames[k]}' takes none of its frames")
        pictures += taken
    pictures[0].save(options.out + ".part", "WEBP", save_all=True, append_images=pictures[1:], loop=0,
                     duration=round(1000 * EVERY / skeleton.FPS), quality=options.quality, method=6)
    os.replace(options.out + ".part", options.out)


def main(argv=None):
    options = arguments(argv)
    return command.ended("film", lambda: write(options))


if __name__ == "__main__":
    sys.exit(main())
