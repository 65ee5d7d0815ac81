"""The robe's rest shape: a gown to below the knee with wide sleeves, in T-pose, pleated below a belt.

Cut like a kimono from two tubes on one regular grid: the upper tube runs from cuff to cuff with
the neck cut out of its top, and the body tube hangs from its open underside. Only four vertices,
front and back of each armpit, have an odd number of neighbours in the grid:

    cuff --- sleeve ---+-- chest --+--- sleeve --- cuff      U[column, row], row: front, over the
                       |           |                         shoulder, back; strip[side]: underside
                       |   body    |                         B[ring, column]
                       +---- hem --+

The grid is laid roughly and then relaxed on a smooth implicit surface: every vertex moves to the
mean of its neighbours and back onto the surface, which evens out all edges. A remesher would give
more equal triangles (here edges differ by 2:1), but no exact mirror image and no pleats that follow
the columns. Everything is exactly mirror symmetric in the plane x = 0.
"""
import functools

import numpy as np
from scipy import sparse
from scipy.interpolate import PchipInterpolator

from ..motion.skeleton import HIP_HEIGHT, INDEX, WHOLE_BODY
from .cloth_job import PARTS
from .garment import Garment

CHEST_COLUMNS = 15            # cells from the front centre to the armhole
SIDE_CELLS = 12               # under the arm, front to back: body side and sleeve underside
ROWS = 18                     # cells from the armpit's front over the chest to the shoulder line
SLEEVE_COLUMNS = 33           # armhole to cuff
RINGS = 63                    # armpit to hem
NECK_COLUMNS, NECK_ROWS = 7, 5  # half of the neck opening
YOKE_CELLS = 4                # pinned round the neck: this many cells wide
ARMPIT_COLUMNS = 4            # of the sleeve's underside that touch the trunk instead of the arm
ELBOW_COLUMN = 18             # columns outside the armhole: up to here sleeves touch the upper arm, then the forearm
SHOULDER_COLUMNS = 5          # on either side of the armhole, over the arm: they touch trunk and arm
TETHER_SLACK = 1.3            # yoke, belt and cuffs move apart when an arm is raised or the back bent
CUFF_CELLS = 2                # pinned to the forearms: this many cells wide
PLEATS = 10
PLEAT_DEPTH = 0.12            # of the radius at the hem; none at the belt
FLUTES = 6                    # of each sleeve
FLUTE_DEPTH = 0.08            # of the radius at the cuff
RELAX_STEPS = 90

# Metres, hips at the origin. Half width and half depth of the body tube by height.
ARMPIT, HEM, CUFF, TOP = 0.335, -0.47, 0.70, 0.542
ARMHOLE = 0.165               # x of the column between chest and sleeve
BELT = (0.095, 0.145)         # heights between which rings are pinned to the hips
_BODY = np.array([(-0.47, 0.318, 0.283), (-0.24, 0.264, 0.222), (-0.02, 0.222, 0.172),
                  (0.04, 0.200, 0.152), (0.095, 0.174, 0.138), (0.145, 0.168, 0.132),
                  (0.31, 0.206, 0.140), (0.44, 0.205, 0.114), (0.60, 0.200, 0.085)])
# The upper tube by |x|: underside, half depth. Its top is level, at TOP.
_SLEEVE = np.array([(0.0, 0.340, 0.086), (0.20, 0.345, 0.086), (0.45, 0.325, 0.090),
                    (0.70, 0.280, 0.100)])
_SLEEVE_Z = -0.022
_NECK = (0.094, 0.081, -0.002)  # half width, half depth, z of the centre of the neck opening
_BLEND = 0.018                # rounding where the tubes meet


def _tables():
    return [PchipInterpolator(table[:, 0], table[:, 1:], extrapolate=True)
            for table in (_BODY, _SLEEVE)]


_BODY_AT, _SLEEVE_AT = _tables()


def _field(points):
    """Negative inside the robe, zero on its cloth, about the distance near it. [n]"""
    x, y, z = points.T
    body = _BODY_AT(np.clip(y, HEM - 0.1, 0.6))
    angle = np.arctan2(x / body[:, 0], z / body[:, 1])
    way = np.clip((BELT[0] - y) / (BELT[0] - HEM), 0, 1.1)
    pleat = 1 + PLEAT_DEPTH * way ** 2 * np.cos(PLEATS * angle)
    radius = np.hypot(x / body[:, 0], z / body[:, 1])
    tube = (radius - pleat) * body.min(1)
    tube = _smooth_max(tube, y - TOP)
    across = np.abs(x)
    sleeve = _SLEEVE_AT(np.clip(across, 0, CUFF + 0.1))
    high, middle = 0.5 * (TOP - sleeve[:, 0]), 0.5 * (TOP + sleeve[:, 0])
    up, front = (y - middle) / high, (z - _SLEEVE_Z) / sleeve[:, 1]
    way = np.clip((across - 0.2) / (CUFF - 0.2), 0, 1.1)
    flute = 1 + FLUTE_DEPTH * way ** 2 * np.cos(FLUTES * np.arctan2(front, up))
    # A rounded box rather than an ellipse: the forearm lies near the sleeve's top.
    radius = (up ** 4 + front ** 4 + 2 * (up * front) ** 2 * 0.9) ** 0.25
    return -_smooth_max(-tube, -(radius - flute) * np.minimum(high, sleeve[:, 1]))


def _smooth_max(a, b):
    """max(a, b), rounded where they differ by less than _BLEND; a polynomial, C1."""
    h = np.maximum(_BLEND - np.abs(a - b), 0.0)
    return np.maximum(a, b) + h * h / (4 * _BLEND)


def _onto_surface(points, steps=1, allowed=(1.0, 1.0, 1.0)):
    """Newton steps along the gradient; `allowed` masks the axes that may move."""
    shift, allowed = 1e-5, np.asarray(allowed)
    for _ in range(steps):
        value = _field(points)
        slope = np.stack([(_field(points + shift * axis) - value) / shift
                          for axis in np.eye(3)], -1) * allowed
        length = np.maximum((slope ** 2).sum(1), 0.05)
        points = points - np.clip(value / length, -0.02, 0.02)[:, None] * slope
    return points


def _number():
    """Vertex numbers: U [columns, rows], strip [columns, side] and B [rings, ring columns]; count.

    Columns run from the right cuff to the left; -1 marks the neck opening and places that the
    chest has no strip. B[0] is the ring at the armpits, made of U and strip.
    """
    reach = CHEST_COLUMNS + SLEEVE_COLUMNS
    column = np.arange(-reach, reach + 1)
    row = np.arange(2 * ROWS + 1)
    there = ((np.abs(column)[:, None] >= NECK_COLUMNS) | (np.abs(row - ROWS)[None] >= NECK_ROWS))
    upper = np.full(there.shape, -1)
    upper[there] = np.arange(there.sum())
    count = int(there.sum())
    strip = np.full((len(column), SIDE_CELLS + 1), -1)
    sleeves = np.flatnonzero(np.abs(column) >= CHEST_COLUMNS)
    strip[sleeves, 0], strip[sleeves, -1] = upper[sleeves, 0], upper[sleeves, -1]
    inner = len(sleeves) * (SIDE_CELLS - 1)
    strip[np.ix_(sleeves, range(1, SIDE_CELLS))] = count + np.arange(inner).reshape(len(sleeves), -1)
    count += inner
    left, right = reach + CHEST_COLUMNS, reach - CHEST_COLUMNS
    first = np.concatenate([upper[reach:left + 1, 0], strip[left, 1:-1],
                            upper[right:left + 1, -1][::-1], strip[right, 1:-1][::-1],
                            upper[right:reach, 0]])
    body = count + np.arange(RINGS * len(first)).reshape(RINGS, -1)
    return upper, strip, np.concatenate([first[None], body]), count + body.size


def _lay(upper, strip, body, count):
    """Rough positions [n, 3] on plain ellipses."""
    points = np.zeros((count, 3))
    reach, around = len(upper) // 2, 2 * ROWS + SIDE_CELLS

    def sleeve(x, cell):                       # `cell` counts from the underside's middle, forwards
        under, deep = _SLEEVE_AT(np.abs(x)).T
        angle = 2 * np.pi * cell / around
        return np.stack([x + 0 * angle, 0.5 * (TOP + under) - 0.5 * (TOP - under) * np.cos(angle),
                         _SLEEVE_Z + deep * np.sin(angle)], -1)

    for c in range(-reach, reach + 1):
        far = max(abs(c) - CHEST_COLUMNS, 0) / SLEEVE_COLUMNS
        x = np.sign(c) * (ARMHOLE * min(abs(c) / CHEST_COLUMNS, 1.0) + (CUFF - ARMHOLE) * far)
        rows = np.flatnonzero(upper[c + reach] >= 0)
        points[upper[c + reach, rows]] = sleeve(x, SIDE_CELLS / 2 + rows)
        if abs(c) >= CHEST_COLUMNS:
            points[strip[c + reach]] = sleeve(x, SIDE_CELLS / 2 - np.arange(SIDE_CELLS + 1))
    columns = body.shape[1]
    angle = 2 * np.pi * np.arange(columns) / columns
    for ring in range(RINGS + 1):
        y = ARMPIT + (HEM - ARMPIT) * ring / RINGS
        wide, deep = _BODY_AT(y)
        points[body[ring]] = np.stack([wide * np.sin(angle), y + 0 * angle, deep * np.cos(angle)], -1)
    return points


def _quads(upper, strip, body):
    """All grid cells as quads, counter-clockwise from outside, and their checkerboard parity."""
    closed = np.concatenate([body, body[:, :1]], 1)
    out, parity = [], []
    for grid, flip in ((upper, False), (strip, True), (closed, True)):
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        quad = np.stack([a, d, c, b] if grid is closed else [a, b, c, d], -1)
        quad = quad[..., ::-1] if flip else quad
        odd = np.add.outer(np.arange(len(grid) - 1), np.arange(grid.shape[1] - 1)) % 2
        keep = (quad >= 0).all(-1)
        out.append(quad[keep])
        parity.append(odd[keep])
    return np.concatenate(out), np.concatenate(parity)


def _mirror(upper, strip, body, count):
    mirror = np.full(count, -1)
    for grid in (upper, strip):
        there = grid >= 0
        mirror[grid[there]] = grid[::-1][there]
    mirror[body] = body[:, (-np.arange(body.shape[1])) % body.shape[1]]
    return mirror


def _boundaries(upper, strip, body):
    """Vertex numbers of hem, left and right cuff, and neck opening, each in order round it."""
    reach = len(upper) // 2
    c, r = NECK_COLUMNS, NECK_ROWS
    neck = upper[reach - c:reach + c + 1, ROWS - r:ROWS + r + 1]
    neck = np.concatenate([neck[:-1, 0], neck[-1, :-1], neck[:0:-1, -1], neck[0, :0:-1]])
    cuffs = [np.concatenate([upper[end], strip[end, 1:-1][::-1]]) for end in (-1, 0)]
    return body[-1], cuffs[0], cuffs[1], neck


def _touches(upper, strip, body, count):
    """Bit masks [n] of the parts of the body each vertex touches (cloth_job.PARTS).

    A hanging arm sinks into the flank and takes the armpit with it. Cloth that touched both would be squeezed out of
    the fold, so the sleeve touches its arm alone and the body tube trunk and legs alone; a bent elbow is another such
    fold, so no vertex touches both upper arm and forearm. Over the shoulder, where skin stays outside in every pose,
    chest and sleeve touch both; the sleeve's underside next to the armpit touches the trunk, or an arm crossing the
    chest would draw it in and bare the flank.
    """
    bit = {part[0]: np.uint32(1 << p) for p, part in enumerate(PARTS)}
    reach = len(upper) // 2
    column = np.arange(-reach, reach + 1)
    beyond = np.abs(column) - CHEST_COLUMNS           # columns outside the armhole
    arm, fore = (np.where(column > 0, bit["Left" + name], bit["Right" + name]) for name in ("Arm", "ForeArm"))
    arm = np.where(beyond <= ELBOW_COLUMN, arm, fore)
    under = np.where(beyond > ARMPIT_COLUMNS, arm, bit["Hips"])
    over = np.where(beyond > 0, arm, bit["Hips"])
    over = np.where(np.abs(beyond) <= SHOULDER_COLUMNS, arm | bit["Hips"], over)
    out = np.zeros(count, np.uint32)
    for grid, mask in ((strip, under), (upper, over)):
        out[grid[grid >= 0]] = np.broadcast_to(mask[:, None], grid.shape)[grid >= 0]
    out[body] = bit["Hips"] | bit["LeftUpLeg"] | bit["RightUpLeg"]
    return out


@functools.lru_cache(maxsize=1)
def _build():
    upper, strip, body, count = _number()
    points = _lay(upper, strip, body, count)
    quads, parity = _quads(upper, strip, body)
    mirror = _mirror(upper, strip, body, count)
    hem, left, right, neck = borders = _boundaries(upper, strip, body)

    sides = np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)])
    graph = sparse.coo_matrix((np.ones(len(sides)), sides.T), (count, count)).tocsr()
    graph = ((graph + graph.T) > 0).astype(np.float64).tolil()
    for border in borders:                     # a border vertex follows its border alone
        graph[border] = 0
        for step in (-1, 1):
            graph[border, np.roll(border, step)] = 1
    graph = graph.tocsr()
    mean = sparse.diags(1 / np.asarray(graph.sum(1)).ravel()) @ graph
    flip = np.array([-1.0, 1.0, 1.0])
    for _ in range(RELAX_STEPS):
        points = _onto_surface(0.4 * points + 0.6 * (mean @ points))
        points[hem, 1], points[left, 0], points[right, 0] = HEM, CUFF, -CUFF
        flat = points[neck][:, [0, 2]] - [0, _NECK[2]]
        flat /= np.hypot(*(flat / _NECK[:2]).T)[:, None]
        points[neck, 0], points[neck, 2] = flat[:, 0], flat[:, 1] + _NECK[2]
        for border, allowed in ((hem, (1, 0, 1)), (left, (0, 1, 1)), (right, (0, 1, 1)),
                                (neck, (0, 1, 0))):
            points[border] = _onto_surface(points[border], 2, allowed)
        points = 0.5 * (points + points[mirror] * flip)
    return upper, strip, body, points, quads, parity, mirror, neck


def _triangles(points, quads, parity, mirror):
    """Left cells cut along checkerboard diagonals; right cells are their reflections."""
    on_left = points[quads, 0].mean(1) > 0
    quads, odd = quads[on_left], parity[on_left].astype(bool)
    a, b, c, d = quads.T
    halves = np.concatenate([np.stack([a, b, np.where(odd, c, d)], -1),
                             np.stack([np.where(odd, a, b), c, d], -1)])
    return np.concatenate([halves, mirror[halves][:, [0, 2, 1]]]).astype(np.int32)


def robe(radius_scale=1.0):
    """Build the robe in bind pose -> Garment. `radius_scale` perturbs it for the predictability floor.

    Pinned are a yoke round the neck, which follows the chest, a belt, which follows the hips, and stiff
    cuffs, which follow the forearms: hung from the yoke alone, the gown gathered where it liked and two
    nearly equal simulations of a run came 17 mm apart, and fast arms left the sleeves; with the cuffs'
    lower half hanging, an elbow drawn back still came through. The whole body is a collider.
    """
    upper, strip, body, points, quads, parity, mirror, neck = _build()
    vertices = points.copy()
    # Each tube is widened about its own axis; at the armholes both do.
    sleeve = (np.clip((np.abs(points[:, 0]) - 0.1) / 0.2, 0, 1)
              * np.clip((points[:, 1] - ARMPIT + 0.15) / 0.1, 0, 1))
    middle = 0.5 * (TOP + _SLEEVE_AT(np.abs(points[:, 0]))[:, 0])
    away = np.stack([(1 - sleeve) * points[:, 0], sleeve * (points[:, 1] - middle),
                     points[:, 2] - sleeve * _SLEEVE_Z], -1)
    vertices += (radius_scale - 1) * away
    vertices[:, 1] += HIP_HEIGHT
    reach = len(upper) // 2
    column = np.abs(np.arange(-reach, reach + 1))[:, None]
    row = np.abs(np.arange(2 * ROWS + 1) - ROWS)[None]
    yoke = np.maximum(column - NECK_COLUMNS, row - NECK_ROWS) <= YOKE_CELLS
    joints = np.full(len(points), -1)
    joints[upper[yoke & (upper >= 0)]] = INDEX["Chest"]
    for side, columns in (("Left", slice(-CUFF_CELLS - 1, None)), ("Right", slice(0, CUFF_CELLS + 1))):
        cuff = np.concatenate([upper[columns].ravel(), strip[columns].ravel()])
        joints[cuff] = INDEX[side + "ForeArm"]
    height = points[body, 1].mean(1)
    joints[body[(height > BELT[0]) & (height < BELT[1])]] = INDEX["Hips"]
    faces = _triangles(points, quads, parity, mirror)
    return Garment(vertices, faces, mirror.astype(np.int32), joints >= 0, joints, not_colliding=(),
                   touches=_touches(upper, strip, body, len(points)), slack=TETHER_SLACK, felt=WHOLE_BODY)
