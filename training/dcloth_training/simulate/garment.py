"""Garments cut from flat panels and sewn around the figure.

Each is symmetric in the plane x = 0: the left half is cut, the right half is its reflection. Panels are cut once and
kept (pattern.cut); after a change to a cut, `python3 -m dcloth_training.simulate.garment` keeps the new ones.
"""
import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .. import figure as figures, geometry
from ..motion.skeleton import LOWER_BODY, WHOLE_BODY
from . import body as parts
from . import pattern
from .solver import Fabric


@dataclass
class Garment:
    """vertices [n, 3] m where the simulation of the bind pose starts, cloth: faces, pattern, hems, creases,
    mirror [n] permutation or None, pinned [n] bool, touches [n] bit masks of body.PARTS, texture [c, 3, 2] u and v of
    the faces' corners, v down as in glTF, or None, fabric: its name in settings.FABRICS, felt: joints whose motion
    moves it (the network's features).
    """
    name: str
    fabric: str
    vertices: np.ndarray
    cloth: Fabric
    mirror: np.ndarray
    pinned: np.ndarray
    touches: np.ndarray
    texture: np.ndarray
    felt: tuple
    settings: dict = dataclasses.field(default_factory=dict)    # of the solver, where they are not the fabric's

    @property
    def faces(self):
        return self.cloth.faces


def _both_sides(panels, seams, folds):
    """Left panels [(points, faces, flipped)] and their reflections, sewn by `seams` and along x = 0 by `folds`.

    seams: ((panel, points), (panel, points)) of left panels; folds: (panel, points) that lie on x = 0.
    -> Sewn, mirror permutation."""
    count = len(panels)
    right = [(points * [-1, 1], faces, not flipped) for points, faces, flipped in panels]
    all_seams = list(seams) + [((a + count, i), (b + count, j)) for (a, i), (b, j) in seams]
    all_seams += [((p, own), (p + count, own)) for p, own in folds]
    sewn = pattern.sew(panels + right, all_seams)
    mirror = np.arange(sewn.count)
    for p in range(count):
        a, b = sewn.vertex[p], sewn.vertex[p + count]
        mirror[a[a >= 0]], mirror[b[b >= 0]] = b[a >= 0], a[b >= 0]
    return sewn, mirror


def _rounded(vertices):
    """Without what depends on the processor's sines, the sign of zero included."""
    return np.round(vertices, pattern.DIGITS) + 0.0


def _layout(sewn, gap=0.05):
    """[c, 3, 2] u right and v down of the faces' corners: each panel beside its reflection, joined where it is cut on
    the fold, and the pairs side by side; the cloth's right side up, with one scale for both, in the unit square."""
    placed, at = np.zeros(sewn.pattern.shape), 0.0
    count = (sewn.panel.max() + 1) // 2
    for panel in range(count):
        pair = sewn.panel % count == panel
        flat, right = sewn.pattern[pair], sewn.panel[pair] >= count
        if geometry.doubled_areas(flat).sum() < 0:    # cut with the wrong side up
            flat = flat * [-1, 1]
        left_low, left_high = flat[~right, :, 0].min(), flat[~right, :, 0].max()
        if left_low < -1e-9 < 1e-9 < left_high:    # they overlap where the garment opens
            flat[right, :, 0] += left_high - left_low + gap
        low, high = flat.min((0, 1)), flat.max((0, 1))
        placed[pair] = flat - low + [at, 0]
        at += high[0] - low[0] + gap
    scale = placed.max()
    return np.stack([placed[..., 0] / scale, 1 - placed[..., 1] / scale], -1).astype(np.float32)


# The skirt ----------------------------------------------------------------------------------------------------------

SKIRT = {
    "spacing": 0.0104,       # m between vertices
    "waist": 1.045,          # height of the waistband's upper edge on a figure of 1.68 m
    "length": 0.58,          # m along the cloth: ends below the knee
    "sector": 2.2,           # rad of a circle that front and back together are cut from (a half circle: 3.14)
    "band": 0.022,           # m of waistband
    "ease": 0.006,           # m between waist and waistband
    "hem": 0.025, "hem_layers": 2.2,
    "pleats": 16,            # sunray pleats, pressed: a line outward and one inward each
    "pressed": 90.0,         # degrees that a line folds by
    "opening": 0.10,         # m below the waistband over which it gets there
}


def skirt(figure, made=None, **changes):
    """A pleated skirt: front and back cut from circle sectors on the fold, side seams, waistband, turned-up hem; sunray
    pleats pressed along rays of the circle, a line on every fold and seam."""
    cut = {**SKIRT, **changes}
    outline = parts.section(figure, cut["waist"] - 0.5 * cut["band"])
    angles = np.linspace(0, 2 * np.pi, 2000)
    ring = (outline(angles) + cut["ease"])[:, None] * np.stack([np.sin(angles), np.cos(angles)], -1)
    arc = np.r_[0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
    sector, length, spacing = cut["sector"], cut["length"], cut["spacing"]
    inner = arc[-1] / sector
    quarter = sector / 4

    def corner(radius, turn):
        return np.array([radius * np.sin(turn), -radius * np.cos(turn)])

    def side(turn, first, last):
        return pattern.sample([corner(first, turn), corner(last, turn)], spacing)

    def round_(radius, first, last, multiple=1):
        count = multiple * max(2, round(radius * abs(last - first) / spacing / multiple))
        return np.array([corner(radius, t) for t in np.linspace(first, last, count + 1)])

    outer = inner + length
    if cut["pleats"] < 2 or cut["pleats"] % 2:
        raise ValueError(f"{cut['pleats']} pleats; allowed: 2, 4, 6 and so on, as folds and seams are pressed as well")
    lines = cut["pleats"] // 2         # of a quarter, the one on its seam included
    fold, hem = side(0.0, inner, outer), round_(outer, 0.0, quarter, lines)
    seam, waist = side(quarter, outer, inner), round_(inner, quarter, 0.0)
    border = np.concatenate([fold[:-1], hem[:-1], seam[:-1], waist[:-1]])
    band = round_(inner + cut["band"], quarter, 0.0)[1:-1]
    rays = [side(quarter * k / lines, inner + cut["band"] + spacing, outer - 0.8 * spacing) for k in range(1, lines)]
    panels = []
    for seed, name in ((1, "skirt-front"), (2, "skirt-back")):
        points, faces = pattern.cut(name, border, spacing, [band] + rays, seed, made)
        panels.append((points, faces, False))
    own_fold = np.arange(len(fold))
    own_seam = np.arange(len(fold) + len(hem) - 2, len(fold) + len(hem) + len(seam) - 2)
    panels[1] = (panels[1][0], panels[1][1], True)     # the back, seen from behind
    sewn, mirror = _both_sides(panels, [((0, own_seam), (1, own_seam))], [(0, own_fold), (1, own_fold)])

    start = np.zeros((sewn.count, 3))
    slant, crease = np.zeros(sewn.count), np.zeros(sewn.count)
    lean = np.arcsin(min(1.0, sector / (2 * np.pi)))   # a cone rolled from that sector
    for p in range(4):
        points = panels[p % 2][0]
        radius = np.linalg.norm(points, axis=1)
        turn = np.arctan2(points[:, 0], -points[:, 1]) / quarter * (np.pi / 2)     # 0 front or back, pi/2 left side
        turn = turn if p % 2 == 0 else np.pi - turn
        down = radius - inner
        # Even along the waist's outline, even in angle where the skirt is round.
        round_off = np.clip((down - cut["band"]) / (length - cut["band"]), 0, 1)
        phi = np.interp(turn / (2 * np.pi) * arc[-1], arc, angles) * (1 - round_off) + turn * round_off
        own = (outline(phi) + cut["ease"]) * (1 - round_off) + arc[-1] / (2 * np.pi) * round_off
        r = own + down * np.sin(lean)
        at = np.stack([r * np.sin(phi) * (1 if p < 2 else -1), cut["waist"] - down * np.cos(lean), r * np.cos(phi)], -1)
        keep = sewn.vertex[p] >= 0
        start[sewn.vertex[p][keep]], slant[sewn.vertex[p][keep]] = at[keep], down[keep]
        ray = np.abs(np.arctan2(points[:, 0], -points[:, 1])) / quarter * lines
        on = np.abs(ray - np.round(ray)) * quarter / lines * radius < 1e-4
        pressed = np.clip((down - cut["band"]) / cut["opening"], 0, 1) * np.radians(cut["pressed"])
        on &= keep & (down > cut["band"] + 1e-6)
        crease[sewn.vertex[p][on]] = (np.where(np.round(ray) % 2 == 0, 1, -1) * pressed)[on]
    factor = np.where(slant > length - cut["hem"], cut["hem_layers"], 1.0)
    cloth = Fabric(sewn.faces, sewn.pattern, factor, factor ** 1.5, crease)
    return Garment("skirt", "wool", _rounded(start), cloth, mirror, slant <= cut["band"] + 1e-6,
                   np.full(sewn.count, parts.TRUNK | parts.LEFT_LEG | parts.RIGHT_LEG, np.uint32),
                   _layout(sewn), LOWER_BODY)


# The robe ------------------------------------------------------------------------------------------------------------

ROBE = {
    "spacing": 0.0137,
    "neck": 0.115,            # half width of the neck opening
    "front_neck": 0.13, "back_neck": 0.06,
    "rise": 0.085,            # of the shoulder line above the figure's shoulders: cloth that blouses over the belt
    "sleeve": 0.11,           # half height of the sleeve's opening
    "wrist": 0.05,            # the sleeve ends that far from the wrist, towards the elbow
    "armpit": 0.29,          # half width of the body under the arms
    "armpit_drop": 0.25,      # below the shoulder line
    "waist": 0.192, "waist_height": 1.075,
    "hem": 0.38, "hem_height": 0.40, "flare": 2.4,
    "slit": 0.40,             # m from the hem that the front stays open
    "belt": 0.035,
    "ease": 0.0115,           # m between waist and belt
    "pressed": 100.0,         # degrees that a sleeve is folded by along its two seams, as an iron leaves it,
    "fading": 0.08,           # m beside the body over which it gets there
    "turned_up": 0.02, "hem_layers": 2.0,
    "clear": 0.006,           # m between skin and cloth: more than other garments', as its triangles are larger
}

BELT_SMOOTHED = 0.15     # rad: a belt is smoother than the mesh of the skin


def _smooth(a, b, t):
    return a + (b - a) * t * t * (3 - 2 * t)


def _robe_start(x, y, low, half, top, armpit, arm):
    """Where points of the left front panel stand before the first step, about the T-pose: the body an elliptic tube
    that closes on the shoulders, the sleeve a round one about the arm, whose axis is `arm` high. [n, 3] with z counted
    forward from the middle."""
    closing = 0.14
    up = np.clip((y - top + closing) / closing, 0, 1)
    dome = np.sqrt(1 - up ** 2)
    depth = 0.86 * half * 2 / np.pi
    width = np.sqrt(np.maximum(2 * (half * 2 / np.pi) ** 2 - depth ** 2, 1e-6))
    turn = 0.5 * np.pi * np.clip(x / half, 0, 1)
    trunk = np.stack([x + (width * np.sin(turn) - x) * dome, y, depth * np.cos(turn) * dome], -1)
    height = np.maximum(top - low, 1e-3)
    radius = height / np.pi
    round_ = np.pi * np.clip((top - y) / height, 0, 1)
    sleeve = np.stack([x, np.minimum(top - radius, arm) + radius * np.cos(round_), radius * np.sin(round_)], -1)
    share = np.clip((x - 0.55 * armpit) / (0.75 * armpit), 0, 1)[:, None] * (y >= low - 1e-6)[:, None]
    share = share * share * (3 - 2 * share)
    return trunk + share * (sleeve - trunk)


def robe(figure, made=None, **changes):
    """A belted robe: front and back cut in one with their sleeves on the fold, sewn along shoulder, sleeve and side;
    the front is open from the hem to above the knee."""
    cut = {**ROBE, **changes}
    joint = dict(zip(figure.names, figure.joints))
    spacing = cut["spacing"]
    arm = joint["LeftArm"][1]
    near = (np.abs(figure.vertices[:, 0] - joint["LeftArm"][0]) < 0.03) & (figure.vertices[:, 1] > arm)
    top = figure.vertices[near, 1].max() + cut["rise"]
    reach = joint["LeftHand"][0] - cut["wrist"]
    belt_low, belt_high = cut["waist_height"] - 0.5 * cut["belt"], cut["waist_height"] + 0.5 * cut["belt"]

    def side(y):      # half width of the body panel at a height
        y = np.asarray(y, float)
        above = np.clip((y - cut["waist_height"]) / (top - cut["armpit_drop"] - cut["waist_height"]), 0, 1)
        below = np.clip((cut["waist_height"] - y) / (cut["waist_height"] - cut["hem_height"]), 0, 1)
        return np.where(y >= cut["waist_height"], _smooth(cut["waist"], cut["armpit"], above),
                        cut["waist"] + (cut["hem"] - cut["waist"]) * (1 - (1 - below) ** cut["flare"]))

    underarm = np.array([cut["armpit"], top - cut["armpit_drop"]])
    sleeve_low = top - 2 * cut["sleeve"] * 0.9
    curve = np.array([[_smooth(underarm[0], underarm[0] + 0.09, t), _smooth(underarm[1], min(underarm[1], sleeve_low) +
                       0.0, t)] for t in np.linspace(0, 1, 12)])
    heights = np.linspace(cut["hem_height"], underarm[1], 60)
    shoulder = pattern.sample([(cut["neck"], top), (reach, top)], spacing)
    opening = pattern.sample([(reach, top), (reach, sleeve_low)], spacing)
    under = pattern.sample(np.concatenate([[(reach, sleeve_low)], curve[::-1],
                                           np.stack([side(heights[::-1]), heights[::-1]], -1)[1:]]), spacing)
    hem = pattern.sample([(cut["hem"], cut["hem_height"]), (0, cut["hem_height"])], spacing)
    bottom = np.r_[0, curve[:, 0], reach], np.r_[underarm[1], curve[:, 1], sleeve_low]   # of the sleeve, by x
    panels, rows = [], []
    for seed, name, drop in ((1, "robe-front", cut["front_neck"]), (2, "robe-back", cut["back_neck"])):
        turn = np.linspace(0, np.pi / 2, 30)
        fold = pattern.sample([(0, cut["hem_height"]), (0, top - drop)], spacing)
        neck = pattern.sample(np.stack([cut["neck"] * np.sin(turn), top - drop * np.cos(turn)], -1), spacing)
        border = np.concatenate([fold[:-1], neck[:-1], shoulder[:-1], opening[:-1], under[:-1], hem[:-1]])
        # The fold, neck, shoulder, ... are met clockwise or not; only their numbers matter.
        at = np.cumsum([0] + [len(part) - 1 for part in (fold, neck, shoulder, opening, under, hem)])
        rows.append([np.arange(at[k], at[k + 1] + 1) % len(border) for k in range(6)])
        lines = [np.stack([np.arange(spacing, side(y) - 0.5 * spacing, spacing), np.full(len(np.arange(
            spacing, side(y) - 0.5 * spacing, spacing)), y)], -1) for y in (belt_low, cut["waist_height"], belt_high)]
        points, faces = pattern.cut(name, border, spacing, lines, seed, made)
        panels.append((points, faces, False))
    panels[1] = (panels[1][0], panels[1][1], True)
    seams = [((0, rows[0][2]), (1, rows[1][2])), ((0, rows[0][4]), (1, rows[1][4]))]
    front_fold = rows[0][0]
    closed = panels[0][0][front_fold][:, 1] >= cut["hem_height"] + cut["slit"]
    sewn, mirror = _both_sides(panels, seams, [(0, front_fold[closed]), (1, rows[1][0])])

    start, height = np.zeros((sewn.count, 3)), np.zeros(sewn.count)
    outline = parts.section(figure, cut["waist_height"], half_width=0.2)
    belt_ring = np.linspace(0, 2 * np.pi, 2000)
    radius = gaussian_filter1d(outline(belt_ring), BELT_SMOOTHED / belt_ring[1], mode="wrap") + cut["ease"]
    ring = radius[:, None] * np.stack([np.sin(belt_ring), np.cos(belt_ring)], -1)
    arc = np.r_[0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
    pinned, crease = np.zeros(sewn.count, bool), np.zeros(sewn.count)
    sleeved = np.zeros(sewn.count, np.uint32)
    for p in range(4):
        points = panels[p % 2][0]
        own, sign, front = sewn.vertex[p], 1 if p < 2 else -1, 1 if p % 2 == 0 else -1
        keep = own >= 0
        x, y = points[:, 0], points[:, 1]
        at = _robe_start(x, y, np.interp(x, *bottom), side(y), top, cut["armpit"], arm)
        at *= [sign, 1, 1]
        at[:, 2] = joint["Spine2"][2] + front * at[:, 2]
        band = (np.abs(points[:, 1] - cut["waist_height"]) < 0.5 * cut["belt"] + 1e-6)
        share = np.clip(points[:, 0] / side(points[:, 1]), 0, 1)     # of the way from the fold to the side seam
        turn = 0.5 * np.pi * share if front > 0 else np.pi - 0.5 * np.pi * share
        phi = np.interp(turn / (2 * np.pi) * arc[-1], arc, belt_ring)
        away = np.interp(phi, belt_ring, radius)
        at[band] = np.stack([away * np.sin(phi) * sign, points[:, 1], away * np.cos(phi)], -1)[band]
        start[own[keep]], height[own[keep]] = at[keep], points[keep, 1]
        pinned[own[keep]] |= band[keep]
        arms = parts.LEFT_ARM if p < 2 else parts.RIGHT_ARM
        body_parts = parts.TRUNK | parts.LEFT_LEG | parts.RIGHT_LEG
        on_sleeve = (x > cut["armpit"] + 0.06) & (y > underarm[1] - 0.02)
        on_shoulder = (x > 0.5 * cut["armpit"]) & (y > underarm[1] - 0.02) & ~on_sleeve
        own_mask = np.where(on_sleeve, arms, np.where(on_shoulder, arms | parts.TRUNK, body_parts)).astype(np.uint32)
        sleeved[own[keep]] |= own_mask[keep]
        # Shoulder and under the arm, and the side seam where it is as wide: just above the hem. They fold outward.
        seam = np.r_[rows[p % 2][2], rows[p % 2][4]]
        pressed = np.clip((x[seam] - cut["armpit"] - 0.05) / cut["fading"], 0, 1)
        crease[own[seam]] = -np.radians(cut["pressed"]) * pressed
    factor = np.where(height < cut["hem_height"] + cut["turned_up"], cut["hem_layers"], 1.0)
    cloth = Fabric(sewn.faces, sewn.pattern, factor, factor ** 1.5, crease)
    return Garment("robe", "cotton", _rounded(start), cloth, mirror, pinned, sleeved, _layout(sewn), WHOLE_BODY,
                   {"thickness": cut["clear"]})


GARMENTS = {"skirt": skirt, "robe": robe}
FELT = {"skirt": LOWER_BODY, "robe": WHOLE_BODY}


def perturbed(garment, scale):
    """The same garment cut a little larger or smaller, for the predictability floor."""
    return dataclasses.replace(garment, cloth=dataclasses.replace(garment.cloth, pattern=garment.cloth.pattern * scale))


def main():
    panels = {}
    for cut in GARMENTS.values():
        cut(figures.load(), panels)
    pattern.keep(panels)


if __name__ == "__main__":
    main()
