"""A failure as a picture: truth, prediction, and the prediction coloured by its distance from the truth."""
from dataclasses import dataclass

import numpy as np

from . import picture_file, raster, safetensors_io
from .motion import skeleton
from .simulate import render

SIZE = 400                    # pixels: height of a panel
SAMPLES = 3
YAWS = 24                     # directions tried
PITCH = 0.10
MARGIN = 0.05                 # metres around what is drawn
HEADER, FOOTER, GAP, SCALE_WIDTH = 52, 26, 10, 74
SHARE_SHOWN = 99              # percentile of the error that ends the colour scale
# Error from none to the end of the scale: pale, so that shading is seen, to dark.
STOPS = ((0.0, (0.86, 0.88, 0.90)), (0.25, (0.98, 0.86, 0.52)), (0.5, (0.96, 0.58, 0.25)), (0.75, (0.82, 0.22, 0.20)),
         (1.0, (0.42, 0.06, 0.28)))


@dataclass
class Body:
    bind: np.ndarray          # [J, 4, 4]
    vertices: np.ndarray      # [b, 3]
    weights: np.ndarray       # [b, J]
    faces: np.ndarray
    at: np.ndarray            # [d] vertex that each drawn one lies at; `faces` are into those
    colour: np.ndarray        # [d, 3], or [3] where the bundle says none


def read_body(path):
    """The body that a bundle carries."""
    names = ("character.bind", "body.positions", "body.joint_weights", "body.faces")
    tensors, _ = safetensors_io.read(path)
    missing = [name for name in names if name not in tensors]
    if missing:
        raise safetensors_io.SafetensorsError(f"{path}: no tensors {missing}: not a training bundle with its body")
    bind, vertices, weights = (tensors[name].astype(np.float64) for name in names[:3])
    faces, colours = tensors[names[3]], tensors.get("body.colours")
    if colours is None:
        return Body(bind, vertices, weights, faces, np.arange(len(vertices)), render.BODY_COLOUR)
    at, faces, colour = raster.painted(faces, colours.astype(np.float64))
    return Body(bind, vertices, weights, faces, at, colour)


def colours(distance_mm, limit):
    """Colours [n, 3] of errors in millimetres; beyond `limit` the last one."""
    at = np.clip(np.asarray(distance_mm) / limit, 0, 1)
    places, values = [s for s, _ in STOPS], np.array([c for _, c in STOPS])
    return np.stack([np.interp(at, places, values[:, k]) for k in range(3)], -1)


def limit_mm(distances):
    """End of one colour scale for several pictures: nearly all of the largest error, rounded up to 20 mm."""
    largest = max(np.percentile(d, SHARE_SHOWN) for d in distances)
    return float(20 * max(1, np.ceil(largest / 20)))


def best_yaw(case, faces):
    """The direction, of YAWS, from which most of the error is on the side that is seen."""
    normals = raster.vertex_normals(case.predicted, faces) + raster.vertex_normals(np.asarray(case.truth, float), faces)
    yaws = 2 * np.pi * np.arange(YAWS) / YAWS
    eyes = np.stack([np.sin(yaws), np.zeros(YAWS), np.cos(yaws)])
    return float(yaws[(case.distance_mm @ np.clip(normals @ eyes, 0, None)).argmax()])


def scale_bar(height, limit):
    """The colour scale [height, SCALE_WIDTH, 3] and its texts."""
    out = np.tile(np.array(raster.BACKGROUND), (height, SCALE_WIDTH, 1))
    low, high, left, right = 40, height - 40, 14, 30
    levels = np.linspace(limit, 0, high - low)
    out[low:high, left:right] = colours(levels, limit)[:, None]
    texts = [(right + 6, low + (high - low) * (1 - share) - 8, f"{share * limit:g}", 12)
             for share in (0, 0.25, 0.5, 0.75, 1)]
    return out, [(left, low - 24, "mm", 12)] + texts


def draw(path, case, body, faces, limit):
    """Write one picture; all its panels look at the same pose from the same side."""
    posed = skeleton.skin(body.vertices, body.weights, body.bind, np.asarray(case.matrices, np.float64)[None])[0]
    points = np.concatenate([posed, case.truth, case.predicted])
    yaw = best_yaw(case, faces)
    rotation = raster.about("X", PITCH) @ raster.about("Y", -yaw)
    seen = points @ rotation.T
    low, high = seen.min(0) - MARGIN, seen.max(0) + MARGIN
    span = (high - low)[:2].max()
    centre = rotation.T @ (0.5 * (low + high))
    lowest = posed[posed[:, 1].argmin()]
    foot = np.array([posed[:, 0].mean(), lowest[1], posed[:, 2].mean()])
    panels = []
    for cloth, front, back in ((case.truth, render.CLOTH_COLOUR, render.LINING_COLOUR),
                               (case.predicted, render.CLOTH_COLOUR, render.LINING_COLOUR),
                               (case.predicted, colours(case.distance_mm, limit), None)):
        canvas = raster.Canvas(SIZE, span, centre, yaw, PITCH, SAMPLES)
        render.scene(canvas, posed[body.at], body.faces, foot, body.colour)
        canvas.draw(cloth, faces, front, back)
        panels.append(canvas.image())
    width = min(SIZE, int(np.ceil(SIZE * (high - low)[0] / span)))
    left = (SIZE - width) // 2
    gap = np.tile(np.array(raster.BACKGROUND), (SIZE, GAP, 1))
    bar, texts = scale_bar(SIZE, limit)
    row = np.concatenate([x for panel in panels for x in (gap, panel[:, left:left + width])] + [bar], 1)
    edge = np.array(raster.BACKGROUND)
    image = np.concatenate([np.tile(edge, (HEADER, row.shape[1], 1)), row, np.tile(edge, (FOOTER, row.shape[1], 1))], 0)
    found, start = case.figures, row.shape[1] - SCALE_WIDTH
    texts = [(x + start, y + HEADER, text, size) for x, y, text, size in texts]
    texts += [(GAP, 8, f"{found['clip']}, {found['second']:.2f} s", -15),
              (GAP, 30, f"off by {found['mean_mm']:.0f} mm on average, by {found['p99_mm']:.0f} mm at the 99th "
                        f"percentile, by {found['max_mm']:.0f} mm at worst", 12)]
    texts += [(GAP + i * (GAP + width), HEADER + SIZE + 4, name, 12)
              for i, name in enumerate(("truth", "dcloth", "dcloth, coloured by error"))]
    picture_file.save(path, image, texts)
