"""Is this cache the garment, on this body, in this unit? Each refusal names what would mend it."""
import numpy as np

from .errors import refuse

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
# Rows: what becomes +X (left), +Y (up), +Z (front). z: Blender's axes, the character faces -Y.
AXES = {"y": np.eye(3), "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}

FEWEST, MOST = 3, 65535    # vertices of a garment in a model
TORN = 4.0       # times as long as at rest: no cloth stretches so far
ALIKE = 1.5      # in another unit all edges change alike: no cloth stretches a tenth of them by half of the others
LOST = 0.5       # m between the cloth and where plain skinning puts it, mean


def unit_of(path, text):
    try:
        metres = UNITS[text] if text in UNITS else float(text)
        if not 1e-6 <= metres <= 1e6:
            raise ValueError
        return metres
    except (TypeError, ValueError):
        refuse(path, f"unit {text!r}", f"one of {', '.join(UNITS)} or metres in a unit")


def axes_of(path, up):
    if up not in AXES:
        refuse(path, f"up axis {up!r}", "y or z")
    return AXES[up]


def canonical(points, metres, axes):
    """To metres, +Y up, +Z front; float64 inside, a frame at a time; the result keeps the input's type."""
    out = np.empty_like(points)
    for at, row in enumerate(points):
        out[at] = metres * (row.astype(np.float64) @ axes.T)
    return out


def triangles(polygons):
    """Polygons as fans [c, 3] int32."""
    return np.array([(p[0], a, b) for p in polygons for a, b in zip(p[1:], p[2:])], np.int32)


def edges(polygons):
    """Each edge of the polygons once [e, 2]."""
    pairs = np.array([(a, b) for p in polygons for a, b in zip(p, p[1:] + p[:1])])
    return np.unique(np.sort(pairs, 1), axis=0)


def _turned(polygon):
    """The same polygon wherever it begins."""
    at = polygon.index(min(polygon))
    return polygon[at:] + polygon[:at]


def topology(cache, garment_path, count, polygons):
    """Vertex count and, where the cache has faces, the faces themselves."""
    found = cache.positions.shape[1]
    if found != count:
        refuse(cache.path, f"{found} vertices", f"{count} as in {garment_path}",
               "export the garment and the cache from one mesh, before any subdivision or thickness modifier")
    if cache.polygons is None:
        return
    ours = [_turned(p) for p in polygons]
    theirs = [_turned(tuple(reversed(p)) if cache.inward else p) for p in cache.polygons]
    if len(ours) != len(theirs) or set(ours) != set(theirs):
        different = next((i for i, (a, b) in enumerate(zip(ours, theirs)) if a != b), min(len(ours), len(theirs)))
        refuse(cache.path, f"{len(theirs)} faces, number {different} of vertices "
               f"{theirs[different] if different < len(theirs) else '(none)'}",
               f"the {len(ours)} faces of {garment_path}"
               + (f", there {ours[different]}" if different < len(ours) else ""),
               "the vertex order differs: export both from one mesh, with vertex order kept and without triangulation")


def shape(cache, positions, template, pairs):
    """Edge lengths, frame by frame: unit, vertex order, explosions. positions [T, n, 3], metres."""
    rest = np.maximum(np.linalg.norm(template[pairs[:, 0]] - template[pairs[:, 1]], axis=1), 1e-6)
    frames = cache.frames or list(range(len(positions)))
    for at, points in enumerate(positions):
        ratio = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) / rest
        middle = float(np.median(ratio))
        if at == 0 and not 0.5 < middle < 2:
            low, high = np.percentile(ratio, [10, 90])
            if high < ALIKE * low:    # another unit lengthens all edges alike, another order does not
                refuse(cache.path, f"edges {middle:.4g} times as long as the garment's", "0.5 to 2 times",
                       'another unit: set "unit" of the cache', frames[at])
        torn = ratio > TORN
        if torn.mean() > 0.05:
            refuse(cache.path, f"{100 * torn.mean():.0f} % of the edges more than {TORN:g} times as long as at rest",
                   "the garment's own vertex order" if at == 0 else "cloth that holds together",
                   "the cache numbers vertices in another order: export both from one mesh" if at == 0 else
                   "the simulation blew up here: simulate again, or cut the clip", frames[at])


def place(cache, positions, skinned, raw, metres):
    """Cloth against plain skinning of the garment, both [t, n, 3] of the same ticks; raw as the file has it."""
    def away(points):
        return float(np.linalg.norm(points - skinned, axis=-1).mean())

    distance = away(positions)
    if distance <= LOST:
        return distance
    others = {up: away(canonical(raw, metres, axes)) for up, axes in AXES.items()}
    best = min(others, key=others.get)
    mend = f'set "up": "{best}" of the cache' if others[best] < LOST else \
        "check that animation and cache belong and begin together, the unit, and that the cache is in world space"
    refuse(cache.path, f"cloth {distance:.3g} m from the body it should hang on (mean over frames)", f"{LOST} m", mend)
