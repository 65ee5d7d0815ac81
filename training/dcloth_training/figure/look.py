"""What the bake adds to MakeHuman's skin: a closed mouth, eyes, hair and a leotard, with their colours.

Lengths are metres in T-pose. Where a face is meant they start between the eyes of the body at hand.
"""
import numpy as np

from . import shape

REGIONS = ("skin", "hair", "eye", "iris", "pupil", "lips", "brow", "leotard")
REGION = {name: i for i, name in enumerate(REGIONS)}
COLOURS = np.array([(0.80, 0.62, 0.52), (0.20, 0.13, 0.10), (0.92, 0.90, 0.87), (0.35, 0.25, 0.17),
                    (0.05, 0.05, 0.05), (0.72, 0.47, 0.42), (0.33, 0.22, 0.17), (0.21, 0.24, 0.30)])
IRIS_ANGLE, PUPIL_ANGLE = 0.40, 0.17        # radians from the line of sight
HAIR_DEPTH = 0.010
# Where hair begins: angle about the head's axis from the front, height over the eyes.
HEAD_AXIS = -0.075
HAIRLINE = ((0, 0.066), (30, 0.063), (50, 0.052), (64, 0.030), (74, 0.008), (84, -0.004), (98, 0.004), (112, -0.010),
            (125, -0.028),
            (150, -0.044), (180, -0.050))
BUN_CENTRE, BUN_RADIUS, BUN_DEPTH = np.array([0.0, 0.045, -0.185]), 0.036, 0.030
# Left eyebrow from the eye's centre: x, y; half its height.
BROW = ((-0.017, 0.0175), (-0.006, 0.0215), (0.008, 0.0230), (0.020, 0.0180))
BROW_HALF_HEIGHT = 0.0028
# The leotard: above this height, behind a scooped neck, up to the shoulders.
LEG_HEIGHT, NECK_CENTRE, NECK_RADIUS, ARM_HOLE = 0.69, np.array([0.0, 1.455, 0.035]), 0.115, 0.148


def normals(points, quads):
    """Unit normals [n, 3] of a mesh of quads [q, 4]."""
    across = np.cross(points[quads[:, 2]] - points[quads[:, 0]], points[quads[:, 3]] - points[quads[:, 1]])
    out = np.zeros_like(points)
    for i in range(4):
        np.add.at(out, quads[:, i], across)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-18)


def _hits(start, direction, triangles, far):
    """Which rays [k] meet one of the triangles [f, 3, 3] nearer than `far` (Moeller and Trumbore 1997)."""
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(direction[:, None], ac)
    from_a = start[:, None] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (p * ab).sum(-1)
        u = scale * (from_a * p).sum(-1)
        q = np.cross(from_a, ab)
        v = scale * (direction[:, None] * q).sum(-1)
        t = scale * (q * ac).sum(-1)
        return ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4) & (t < far)).any(1)


def _smooth(x):
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


class Look:
    """Sets of the cage's vertices, found once on the average body; `dress` changes any shape by them."""

    def __init__(self, source, base, skin):
        """base [m, 3]: shaped base mesh in A-pose; skin [n, 3]: its skin in T-pose."""
        self.source, self.mirror = source, source.mirror
        self.graph = shape.neighbours(source.faces, source.count)
        self.mean = shape.mean_of_neighbours(self.graph)
        self.top = int(np.argmax(skin[:, 1]))
        self._ball = source.group("helper-l-eye")
        eye, _ = self.eye(base, skin)
        self.mouth = self._mouth(skin, eye)
        self.socket = self._socket(skin, eye)
        self.flat = self._moved("breast/nipple-size-incr", 0.02) | self._moved("breast/nipple-point-incr", 0.02)
        ear = self._moved("ears/l-ear-wing-incr", 0.05) | self._moved("ears/l-ear-flap-incr", 0.3)
        self.ears = ear | ear[self.mirror]

    def _moved(self, target, share):
        """Vertices that a target moves by more than `share` of its largest step; bool [n]."""
        length = np.linalg.norm(self.source.target(target)[:self.source.count], axis=1)
        return length > share * length.max()

    def _reached(self, seed, allowed):
        """Vertices reached from vertex `seed` by way of `allowed` ones; bool [n]."""
        found = np.zeros(len(allowed), bool)
        found[seed] = True
        while True:
            more = found | ((self.graph @ found > 0) & allowed)
            if (more == found).all():
                return found
            found = more

    def eye(self, base, skin):
        """Centre [3] and radius of the left eyeball in T-pose; the head does not turn between the poses."""
        ball = base[self._ball]
        return 0.5 * (ball.min(0) + ball.max(0)) + skin[self.top] - base[self.top], 0.5 * np.ptp(ball[:, 0])

    def _mouth(self, skin, eye):
        """The cavity behind the lips: what faces another wall there, and all that this cuts off from the head's top."""
        across = normals(skin, self.source.faces)
        d = skin - eye * [0, 1, 1]
        slit = np.zeros(len(skin), bool)
        near = (np.abs(d[:, 0]) < 0.03) & (np.abs(d[:, 1] + 0.064) < 0.009) & (d[:, 2] > 0.005)
        box = np.linalg.norm(d - [0, -0.06, 0], axis=1) < 0.12
        faces = self.source.faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        faces = faces[box[faces].all(1)]
        rays = np.flatnonzero(near)
        slit[rays] = _hits(skin[rays] + 2e-4 * across[rays], across[rays], skin[faces], 0.08)
        slit |= slit[self.mirror]
        return ~self._reached(self.top, ~slit)

    def _socket(self, skin, eye):
        """What lies round the left eyeball and faces it."""
        d = skin - eye
        length = np.linalg.norm(d, axis=1)
        inner = (length < 0.0178) & ((normals(skin, self.source.faces) * d).sum(1) < -0.3 * length)
        return self._reached(int(np.argmin(np.where(inner, length, np.inf))), inner)

    def hair_field(self, skin, eye):
        """Metres above the hairline, negative below; [n]."""
        d = skin - eye * [0, 1, 1]
        angle = np.degrees(np.arctan2(np.abs(d[:, 0]), d[:, 2] - HEAD_AXIS))
        return np.where(self.ears, -0.02, d[:, 1] - np.interp(angle, *zip(*HAIRLINE)))

    def dress(self, base, skin):
        """The skin [n, 3] with closed mouth, eyeballs, smooth chest and hair."""
        eye, radius = self.eye(base, skin)
        skin = shape.filled(skin, self.mouth, self.graph)
        skin = shape.filled(skin, self.flat, self.graph, smooth=True)
        for inner, centre in ((self.socket, eye), (self.socket[self.mirror], eye * [-1, 1, 1])):
            skin = shape.filled(skin, inner, self.graph)
            out = skin[inner] - centre
            skin[inner] = centre + 0.985 * radius * out / np.linalg.norm(out, axis=1, keepdims=True)
        field = self.hair_field(skin, eye)
        outward = normals(skin, self.source.faces)
        for _ in range(12):
            outward = self.mean @ outward
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        depth = HAIR_DEPTH * _smooth((field + 0.004) / 0.03)
        for _ in range(6):
            depth = self.mean @ depth
        skin = skin + depth[:, None] * outward
        return self._with_bun(skin, eye, field)

    def _with_bun(self, skin, eye, field):
        """A knot of hair: the skin pushed out onto a ball, seen from a point between the ball's centre and the head."""
        centre = eye * [0, 1, 1] + BUN_CENTRE
        inside = centre + [0, 0, BUN_DEPTH]
        d = skin - inside
        length = np.linalg.norm(d, axis=1)
        direction = d / length[:, None]
        along = direction[:, 2] * -BUN_DEPTH
        reach = along + np.sqrt(np.maximum(along ** 2 - BUN_DEPTH ** 2 + BUN_RADIUS ** 2, 0))
        pushed = (field > 0) & (direction[:, 2] < -0.1)
        return np.where(pushed[:, None], inside + direction * np.maximum(length, reach)[:, None], skin)

    def fields(self, base, skin):
        """{region: [n]}, positive inside, on the cage: hair, lips, brow, leotard, socket (positive: eyeball)."""
        eye, _ = self.eye(base, skin)
        lips = sum(np.linalg.norm(self.source.target(f"mouth/mouth-{lip}-volume-incr")[:self.source.count], axis=1)
                   / scale for lip, scale in (("lowerlip", 0.0048), ("upperlip", 0.0030)))
        d = np.abs(skin[:, :1]) * [1, 0] + skin[:, 1:2] * [0, 1] - eye[:2]
        x, y = np.array(BROW).T
        brow = np.where((d[:, 0] > x[0]) & (d[:, 0] < x[-1]) & (skin[:, 2] > eye[2] - 0.012),
                        BROW_HALF_HEIGHT - np.abs(d[:, 1] - np.interp(d[:, 0], x, y)), -0.01)
        neck = np.linalg.norm((skin - NECK_CENTRE) * [1, 0.9, 1], axis=1) - NECK_RADIUS
        leotard = np.minimum(np.minimum(skin[:, 1] - LEG_HEIGHT, neck), ARM_HOLE - np.abs(skin[:, 0]))
        # Arms hang level in T-pose: below them nothing but legs and trunk is farther out than the arm holes.
        leotard = np.where(skin[:, 1] < 1.22, skin[:, 1] - LEG_HEIGHT, leotard)
        leotard = np.where(skin[:, 1] > 1.45, -0.05, leotard)
        socket = (self.socket | self.socket[self.mirror]) - 0.5
        return {"hair": self.hair_field(skin, eye), "lips": lips - 0.22, "brow": brow, "leotard": leotard,
                "socket": socket}
