"""Is it cloth? Laboratory tests of fabric, simulated with the very settings that make the ground truth.

    python3 -m dcloth_training.simulate.fabric [--garment skirt|robe] [--json]

Coupons have the mean spacing of the garment's own mesh, as the fabric must not depend on it. Exit code 1: a number left
the range of its fabric. Ranges: handbooks of textile testing give such figures for suiting and shirting; ASTM D1388 and
BS 5058 describe the tests.
"""
import argparse
import json
import sys

import numpy as np

from .. import command, figure, metrics
from . import cloth_job, garment, pattern, settings, solver

SPACING = {"skirt": garment.SKIRT["spacing"], "robe": garment.ROBE["spacing"]}     # m


def rectangle(width, length, spacing):
    ring = [(0, 0), (width, 0), (width, length), (0, length), (0, 0)]
    return np.concatenate([pattern.sample(ring[k:k + 2], spacing, closed=True) for k in range(4)])


def cantilever(chosen, spacing, overhang, warp=True, seed=0, seconds=2.5):
    """Angle in degrees by which the end of a strip that sticks out by `overhang` m hangs below its clamp."""
    width, held = 0.1, 3 * spacing    # the standard's strip is 25 mm wide, two triangles; width does not count
    ring = [(0, held), (0, 0), (width, 0), (width, held), (width, held + overhang), (0, held + overhang), (0, held)]
    outline = np.concatenate([pattern.sample(ring[k:k + 2], spacing, closed=True) for k in range(6)])
    clamp = pattern.sample([(0, held), (width, held)], spacing)[1:-1]  # mesh edges along the clamp
    points, faces = pattern.triangulate(outline, spacing, [clamp] if len(clamp) else (), seed)
    start = np.stack([points[:, 0], np.zeros(len(points)), points[:, 1] - held], -1)
    cut = points if warp else points[:, ::-1] * [1, 1]
    pins = np.flatnonzero(points[:, 1] <= held + 1e-6)
    frames = int(seconds * 30)
    path = np.repeat(start[None, pins], frames, 0)
    chosen = {**chosen, "damping": 5.0, "layer_thickness": 0.0, "tether": 2.0}
    out = solver.run(start, solver.Fabric(faces, cut[faces]), pins, path, solver.nothing(frames),
                     np.zeros((frames, 3)), chosen)[-6:].mean(0)
    end = out[points[:, 1] > overhang + held - 1e-6].mean(0)
    return float(np.degrees(np.arctan2(-end[1], end[2])))


def peirce_overhang(chosen, spacing=0.013, warp=True, seed=0):
    """ASTM D1388: overhang in cm at which the strip's end is 41.5 degrees down."""
    low, high = 0.01, 0.14
    for _ in range(7):
        middle = 0.5 * (low + high)
        if cantilever(chosen, spacing, middle, warp, seed) < 41.5:
            low = middle
        else:
            high = middle
    return 100 * 0.5 * (low + high)


def cusick(chosen, spacing=0.0125, seed=0, seconds=4.0):
    """BS 5058: a disc of 30 cm on a table of 18 cm. -> (drape coefficient in %, number of folds, positions, faces)."""
    angle = np.linspace(0, 2 * np.pi, round(2 * np.pi * 0.15 / spacing), endpoint=False)
    edge = 2 * np.pi * np.arange(round(2 * np.pi * 0.09 / spacing)) / round(2 * np.pi * 0.09 / spacing)
    table = 0.09 * np.stack([np.cos(edge), np.sin(edge)], -1)
    points, faces = pattern.triangulate(0.15 * np.stack([np.cos(angle), np.sin(angle)], -1), spacing, [table], seed)
    start = np.stack([points[:, 0], np.zeros(len(points)), -points[:, 1]], -1)
    pins = np.flatnonzero(np.linalg.norm(points, axis=1) < 0.09 + 1e-6)
    frames = int(seconds * 30)
    out = solver.run(start, solver.Fabric(faces, points[faces]), pins, np.repeat(start[None, pins], frames, 0),
                     solver.nothing(frames), np.zeros((frames, 3)), {**chosen, "tether": 1.02})[-1]
    cells = (np.indices((640, 640)).reshape(2, -1).T + 0.5) / 640 * 0.32 - 0.16
    shadow = _shadow(out[:, [0, 2]], faces, cells)
    inner = np.linalg.norm(cells, axis=1) < 0.09
    percent = 100 * (shadow & ~inner).sum() * 0.0005 ** 2 / (np.pi * (0.15 ** 2 - 0.09 ** 2))
    rim = np.flatnonzero(np.linalg.norm(points, axis=1) > 0.15 - 1e-6)
    rim = rim[np.argsort(np.arctan2(points[rim, 1], points[rim, 0]))]
    return float(percent), folds(np.linalg.norm(out[rim][:, [0, 2]], axis=1)), out, faces


def _shadow(flat, faces, cells):
    """[cells] bool: which square cells lie under a triangle seen from above."""
    side = int(np.sqrt(len(cells)))
    image = np.zeros((side, side), bool)
    low, size = cells[0], cells[-1] - cells[0]
    grid = (flat - low) / size * (side - 1)
    for a, b, c in grid[faces]:
        first = np.maximum(np.floor(np.minimum(np.minimum(a, b), c)).astype(int), 0)
        last = np.minimum(np.ceil(np.maximum(np.maximum(a, b), c)).astype(int), side - 1)
        xs, ys = np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1)
        x, y = np.meshgrid(xs, ys, indexing="ij")
        turned = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(turned) < 1e-9:
            continue
        u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / turned
        v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / turned
        image[first[0]:last[0] + 1, first[1]:last[1] + 1] |= (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6)
    return image.reshape(-1)


def folds(radius):
    """Number of maxima of a closed curve of radii that stand out by at least a fifth of its range."""
    least = 0.2 * (radius.max() - radius.min())
    start = int(np.argmin(radius))
    count, rising, extreme = 0, True, np.inf
    low = np.roll(radius, -start)[0]
    extreme = low
    for value in np.r_[np.roll(radius, -start), low]:
        if rising:
            extreme = max(extreme, value)
            if value < extreme - least:
                count, rising, extreme = count + 1, False, value
        else:
            extreme = min(extreme, value)
            if value > extreme + least:
                rising, extreme = True, value
    return count


def terminal_speed(chosen, flat_on, seconds=8.0):
    """m/s at which a stiffened square of 10 cm falls, flat or edge-on. The fabric's weight and drag, kept plane."""
    points, faces = pattern.triangulate(rectangle(0.1, 0.1, 0.0125), 0.0125)
    plane = np.stack([points[:, 0], np.zeros(len(points)), points[:, 1]] if flat_on else
                     [points[:, 0], points[:, 1], np.zeros(len(points))], -1)
    frames = int(seconds * 30)
    origin = np.zeros((frames, 3))
    out = solver.run(plane, solver.Fabric(faces, points[faces]), np.zeros(0, np.int32), np.zeros((frames, 0, 3)),
                     solver.nothing(frames), origin, {**chosen, "bend": 1.0, "layer_thickness": 0.0})
    height = out[:, :, 1].mean(1)
    return float((height[-2] - height[-1]) * 30)


def droop(worn, chosen, seconds=6.0):
    """Degrees by which the free hem sinks below level where the garment's band is held with its axis level, no body."""
    level = worn.vertices[:, [0, 2, 1]] * [1, 1, -1]         # lies on its back: what hung down points along +z
    frames, pins = int(seconds * 30), np.flatnonzero(worn.pinned)
    out = solver.run(level, worn.cloth, pins, np.repeat(level[None, pins], frames, 0), solver.nothing(frames),
                     np.repeat(level[pins].mean(0)[None], frames, 0), chosen)[-6:].mean(0)
    hem = worn.vertices[:, 1] < worn.vertices[:, 1].min() + 0.02
    along, sunk = out[hem].mean(0) - out[pins].mean(0), level[hem].mean(0) - level[pins].mean(0)
    flat = np.degrees(np.arctan2(-sunk[1], sunk[2]))
    return float(np.degrees(np.arctan2(-along[1], along[2])) - flat)


def self_weight_strain(worn):
    """99th percentile of the strain of a garment that hangs (cloth_job.hung), its pinned part left out."""
    edges = metrics.edges_of(worn.faces)
    length = np.linalg.norm(np.subtract(*worn.vertices[edges.T]), axis=1)
    free = ~worn.pinned[edges].any(1)
    return float(np.percentile((length / cloth_job.rest_lengths(worn) - 1)[free], 99))


# What laboratories measure of such cloth (least, most); a garment's settings must lie within.
RANGES = {
    "wool": {"peirce_overhang_cm": (4, 6), "cusick_percent": (45, 70), "cusick_folds": (5, 8),
             "weight_g_m2": (180, 280), "self_weight_strain": (0, 0.03), "droop_deg": (45, np.inf),
             "drag_ratio": (5, np.inf)},
    "cotton": {"peirce_overhang_cm": (3.5, 5), "cusick_percent": (50, 75), "cusick_folds": (5, 7),
               "weight_g_m2": (100, 150), "self_weight_strain": (0, 0.03), "droop_deg": (60, np.inf),
               "drag_ratio": (5, np.inf)},
}
SEEDS = 3       # meshes that a coupon's figures are the mean (folds: the median) of


def measure(name, worn=None):
    """All tests of garment `name` with the settings of the truth -> {field: number, "fabric", "garment"}. 40 s each.

    worn: the garment as it hangs, simulated when None."""
    if worn is None:
        worn, _, _ = cloth_job.hung(garment.GARMENTS[name](figure.load()), figure.load())
    chosen, spacing = settings.of(worn.fabric), SPACING[name]
    disc = [cusick(chosen, spacing, seed)[:2] for seed in range(SEEDS)]
    return {
        "garment": name, "fabric": worn.fabric, "weight_g_m2": round(1e3 * chosen["density"], 1),
        "peirce_overhang_cm": round(float(np.mean([peirce_overhang(chosen, spacing, warp, seed)
                                                   for warp in (True, False) for seed in range(SEEDS)])), 2),
        "cusick_percent": round(float(np.mean([percent for percent, _ in disc])), 1),
        "cusick_folds": int(np.median([count for _, count in disc])),
        "self_weight_strain": round(self_weight_strain(worn), 4), "droop_deg": round(droop(worn, chosen), 1),
        "drag_ratio": round(terminal_speed(chosen, False) / terminal_speed(chosen, True), 2)}


def outside(numbers):
    """[(field, number, least, most)] of a garment's tests that leave the range of its fabric."""
    return [(field, numbers[field], least, most) for field, (least, most) in RANGES[numbers["fabric"]].items()
            if not least <= numbers[field] <= most]


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--garment", choices=garment.GARMENTS, default="skirt")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(argv)
    missed = []

    def work():
        numbers = measure(options.garment)
        missed.extend(outside(numbers))
        if options.json:
            print(json.dumps(numbers))
        else:
            for field, value in numbers.items():
                least, most = RANGES[numbers["fabric"]].get(field, (None, None))
                print(f"{field:20} {value}" + (f"   ({least:g} to {most:g})" if least is not None else ""))
        for field, value, least, most in missed:
            print(f"fabric: {field} is {value}; {numbers['fabric']} lies between {least:g} and {most:g}",
                  file=sys.stderr)
    return command.ended("fabric", work) or int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
