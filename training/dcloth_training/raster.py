"""Pictures of triangle meshes in numpy: orthographic z-buffer, smooth normals, shading of what is seen.

Surfaces are rasterised first and shaded afterwards, once a visible sample: a key light from the upper left with a
shadow map, light from the sky and from the ground, creases darkened where depth falls below its surroundings
(Luft, Colditz and Deussen 2006), linear light until the samples of a pixel are averaged.
"""
import numpy as np
from scipy import ndimage

BACKGROUND = (0.96, 0.96, 0.95)
KEY = np.array([-0.42, 0.68, 0.60])     # towards the light, view space (x right, y up, z to the eye)
KEY_LIGHT, SKY, GROUND = 0.82, 0.50, 0.25
SHADOW_SHARE = 0.70                     # of the key light that a shadow takes
SHADOW_TEXELS = 256                     # side of the shadow map, at most
SHADOW_BIAS = 0.012                     # metres: more than the facets of a limb stand out and a texel is wide
SHADOW_BLUR = 0.006                     # metres: half-width of a shadow's edge
CREASE_REACH = 0.02                     # metres over which depth is averaged
CREASE_STRENGTH = 9.0                   # darkening a metre of depth
CREASE_LIMIT = 0.45
GAMMA = 2.2


def vertex_normals(vertices, faces):
    """Area-weighted unit normals [n, 3]."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for i in range(3):
        for axis in range(3):
            out[:, axis] += np.bincount(faces[:, i], face[:, axis], len(vertices))
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


def painted(faces, colours):
    """A mesh whose faces have the colour of their last corner (converter/BUNDLE.md), colours [n, 3] a vertex.

    -> vertex [d] that each drawn one lies at, faces [f, 3] into those, colours [d, 3].
    """
    palette, of_vertex = np.unique(colours, axis=0, return_inverse=True)
    key = np.asarray(faces, np.int64) * len(palette) + of_vertex.reshape(-1)[faces[:, 2]][:, None]
    unique, split = np.unique(key, return_inverse=True)
    return unique // len(palette), split.reshape(-1, 3), palette[unique % len(palette)]


def about(axis, angle):
    """Rotation by `angle` about "X" or "Y"."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]] if axis == "X" else [[c, 0, s], [0, 1, 0], [-s, 0, c]])


def covered(points, faces, size):
    """Samples that triangles cover, the nearest alone -> (face, row, column, weight [k, 3], depth), one a sample.

    points [n, 3]: column, row, depth (larger is nearer); a sample lies at whole numbers.
    """
    px, py, pz = (points[:, i][faces] for i in range(3))
    low_x = np.clip(np.ceil(px.min(1)), 0, size).astype(int)
    low_y = np.clip(np.ceil(py.min(1)), 0, size).astype(int)
    wide = np.maximum(np.clip(np.floor(px.max(1)) + 1, 0, size).astype(int) - low_x, 0)
    tall = np.maximum(np.clip(np.floor(py.max(1)) + 1, 0, size).astype(int) - low_y, 0)
    area = (px[:, 1] - px[:, 0]) * (py[:, 2] - py[:, 0]) - (px[:, 2] - px[:, 0]) * (py[:, 1] - py[:, 0])
    count = np.where(np.abs(area) > 1e-9, wide * tall, 0)
    face = np.repeat(np.arange(len(faces)), count)
    within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    column = low_x[face] + within % wide[face]
    row = low_y[face] + within // wide[face]

    def side(i, j):
        """Barycentric coordinate of the corner opposite side ij: linear in column and row."""
        across, down = (py[:, j] - py[:, i]) / -area, (px[:, j] - px[:, i]) / area
        at = -(px[:, i] * across + py[:, i] * down)
        return across[face] * column + down[face] * row + at[face]

    with np.errstate(divide="ignore", invalid="ignore"):    # triangles seen from their edge cover nothing
        sides = side(1, 2), side(2, 0), side(0, 1)
    hit = np.flatnonzero((sides[0] >= -1e-6) & (sides[1] >= -1e-6) & (sides[2] >= -1e-6))
    face, column, row, weight = face[hit], column[hit], row[hit], np.stack([w[hit] for w in sides], -1)
    depth = (weight * pz[face]).sum(1)
    order = np.argsort(depth, kind="stable")
    nearest = np.full(size * size, -1)
    nearest[(row * size + column)[order]] = order       # far to near: the nearest is written last
    kept = nearest[nearest >= 0]
    return face[kept], row[kept], column[kept], weight[kept], depth[kept]


def blurred(picture, reach):
    """The mean over a soft neighbourhood of half-width `reach` samples: two box filters, as fast for any reach."""
    width = max(1, round(reach))
    return ndimage.uniform_filter(ndimage.uniform_filter(picture, 2 * width + 1, mode="nearest"), 2 * width + 1,
                                  mode="nearest")


class Canvas:
    """Orthographic picture, `size` pixels square, `span` metres wide, `samples` squared samples a pixel."""

    def __init__(self, size, span, centre, yaw, pitch=0.12, samples=2, shadows=True):
        self.size, self.samples, self.side, self.shadows = size, samples, size * samples, shadows
        self.scale = self.side / span                   # samples a metre
        self.view = about("X", pitch) @ about("Y", -yaw)
        self.centre = np.asarray(centre, float)
        self.depth = np.full((self.side, self.side), -np.inf)
        self.colour = np.tile(np.array(BACKGROUND), (self.side, self.side, 1))
        self.normal = np.zeros((self.side, self.side, 3))     # zero: not lit
        self.casters = []

    def seen(self, vertices):
        """World positions [n, 3] in view space, the picture's centre at its origin."""
        return (np.asarray(vertices, float) - self.centre) @ self.view.T

    def draw(self, vertices, faces, front, back=None, lit=True):
        """Add a mesh, outward faces counter-clockwise. front, back: colours of both sides, [3] or one a vertex [n, 3].

        `lit` false: a colour as it is, which casts no shadow but shows those of others; for the ground.
        """
        seen, faces = self.seen(vertices), np.asarray(faces)
        middle = (self.side - 1) / 2
        points = np.stack([middle + seen[:, 0] * self.scale, middle - seen[:, 1] * self.scale, seen[:, 2]], -1)
        face, row, column, weight, depth = covered(points, faces, self.side)
        near = depth > self.depth[row, column]
        face, row, column, weight, depth = (x[near] for x in (face, row, column, weight, depth))
        corner = faces[face]
        normal = np.einsum("ki,kid->kd", weight, vertex_normals(seen, faces)[corner])
        a, b, c = (points[corner[:, i], :2] for i in range(3))
        facing = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1]) < 0
        normal *= np.where(facing, 1.0, -1.0)[:, None]

        def paint(colour):
            colour = np.asarray(colour, float)
            return np.broadcast_to(colour, (len(face), 3)) if colour.ndim == 1 \
                else np.einsum("ki,kid->kd", weight, colour[corner])

        self.colour[row, column] = np.where(facing[:, None], paint(front), paint(front if back is None else back))
        self.normal[row, column] = normal if lit else 0.0
        self.depth[row, column] = depth
        if lit:
            self.casters.append((seen, faces))

    def _shadow(self):
        """Share of the key light [side, side] that other surfaces take, its edges softened."""
        out = np.zeros((self.side, self.side), np.float32)
        if not (self.shadows and self.casters):
            return out
        forward = KEY / np.linalg.norm(KEY)
        right = np.cross([0, 1, 0], forward)
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(forward, right), forward])
        vertices = np.concatenate([seen for seen, _ in self.casters]) @ frame.T
        starts = np.cumsum([0] + [len(seen) for seen, _ in self.casters])
        faces = np.concatenate([f + start for start, (_, f) in zip(starts, self.casters)])
        low = vertices.min(0)
        texels = min(self.side, SHADOW_TEXELS)
        scale = (texels - 3) / (vertices[:, :2].max(0) - low[:2]).max()

        def placed(points):
            return np.concatenate([(points[:, :2] - low[:2]) * scale + 1, points[:, 2:]], 1)

        _, row, column, _, depth = covered(placed(vertices), faces, texels)
        nearest = np.full((texels, texels), -np.inf)
        nearest[row, column] = depth
        row, column = np.nonzero(np.isfinite(self.depth))
        middle = (self.side - 1) / 2
        visible = np.stack([(column - middle) / self.scale, (middle - row) / self.scale, self.depth[row, column]], -1)
        there = placed(visible @ frame.T)
        at = np.round(there[:, :2]).astype(int)
        inside = ((at >= 0) & (at < texels)).all(1)
        hidden = np.zeros(len(row))
        hidden[inside] = nearest[at[inside, 1], at[inside, 0]] > there[inside, 2] + SHADOW_BIAS
        out[row, column] = hidden
        there = np.isfinite(self.depth).astype(np.float32)
        reach = SHADOW_BLUR * self.scale
        return there * blurred(out, reach) / np.maximum(blurred(there, reach), 1e-6)

    def _creases(self):
        """Darkening [side, side] of what lies deeper than its surroundings."""
        lit = self.normal.any(-1)
        depth = np.where(lit, self.depth, 0.0).astype(np.float32)
        reach = CREASE_REACH * self.scale
        around = blurred(depth, reach) / np.maximum(blurred(lit.astype(np.float32), reach), 1e-6)
        return np.where(lit, np.clip(CREASE_STRENGTH * (around - depth), 0, CREASE_LIMIT), 0.0)

    def image(self):
        """The picture [size, size, 3], 0 to 1."""
        lit = self.normal.any(-1)
        shadow = self._shadow()
        light = 1 - 0.45 * SHADOW_SHARE * shadow
        normal = self.normal[lit]
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
        key = normal @ (KEY / np.linalg.norm(KEY))
        direct = np.clip(0.85 * key + 0.15, 0, 1)     # wrapped a little: cloth scatters
        direct *= 1 - SHADOW_SHARE * shadow[lit]
        up = 0.5 + 0.5 * (normal @ self.view[:, 1])
        light[lit] = (KEY_LIGHT * direct + GROUND + (SKY - GROUND) * up) * (1 - self._creases()[lit])
        linear = np.clip(self.colour, 0, 1) ** GAMMA * light[..., None]
        cells = linear.reshape(self.size, self.samples, self.size, self.samples, 3)
        return np.clip(cells.mean((1, 3)), 0, 1) ** (1 / GAMMA)


def ground(centre, radius, colour, corners=48):
    """A disc on the ground that fades into the background -> (vertices, faces, colours)."""
    angle = 2 * np.pi * np.arange(corners) / corners
    rim = np.stack([np.sin(angle), np.zeros(corners), np.cos(angle)], -1)
    vertices = np.concatenate([[[0, 0, 0]], 0.55 * radius * rim, radius * rim]) + centre
    i, j = np.arange(corners), (np.arange(corners) + 1) % corners
    faces = np.concatenate([np.stack([0 * i, 1 + i, 1 + j], -1), np.stack([1 + i, 1 + corners + i, 1 + j], -1),
                            np.stack([1 + j, 1 + corners + i, 1 + corners + j], -1)])
    return vertices, faces, np.concatenate([np.tile(colour, (1 + corners, 1)), np.tile(BACKGROUND, (corners, 1))])
