"""A picture as a small PNG: 256 colours of its own, lines of text written into it.

Needs Pillow, which matplotlib brings along.
"""
import functools
import os

import numpy as np

TEXT_COLOUR = (70, 72, 76)


@functools.cache
def font(size, bold=False):
    from matplotlib import font_manager
    from PIL import ImageFont
    name = font_manager.FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    return ImageFont.truetype(font_manager.findfont(name), size)


def save(path, image, texts=(), colours=256):
    """Write image [h, w, 3], 0 to 1, with texts [(x, y, text, size)], y the top of the letters; size < 0: bold.

    The file appears whole or not at all.
    """
    from PIL import Image, ImageDraw
    pixels = Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8), "RGB")
    pen = ImageDraw.Draw(pixels)
    for x, y, text, size in texts:
        pen.text((x, y), text, fill=TEXT_COLOUR, font=font(abs(size), size < 0))
    few = pixels.quantize(colours, kmeans=2)     # median cut, then refined
    few.save(f"{path}.part", "PNG", optimize=True)
    os.replace(f"{path}.part", path)
