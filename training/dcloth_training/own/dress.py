"""A garment of the user's own as the solver takes it: pattern, pinned vertices, which parts of the body it touches."""
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .. import geometry
from ..simulate import body as parts, garment, settings
from ..simulate.solver import Fabric
from ..truth import checks
from ..truth.errors import refuse
from . import hero as heroes, mesh as meshes

WELD = 1e-5               # m
ISOMETRIC = 0.05          # a flat panel is as long as the cloth within this,
ISOMETRIC_SHARE = 0.9     # for so much of its area
TOP = 0.03                # m: border vertices this close to the skin hold a garment up
TOUCHING = 0.015          # m from the skin to what is pinned by a bone
ON_SLEEVE, SLEEVE_REACH = 0.6, 0.15     # of the distance to the rest of the body; m to the arm
ON_SHOULDER = 0.08        # m to the arm, where a vertex touches arm and trunk
COARSE = 0.025            # m between vertices
# to the body: of the distance between vertices, so that triangles clear it too; m at most
THICK, THICKEST = 0.3, 0.008
MOST = 20000              # vertices; a frame of 8,000 takes 0.1 s
COLOURS = {"red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "black": (0, 0, 0), "white": (1, 1, 1)}
COLOUR_REACH = 0.35       # of each channel


@dataclass
class Made:
    """worn: the garment; number [k]: the vertex that each of the file's vertices became; told: what was found, a line
    each; warnings: a line each."""
    worn: garment.Garment
    number: np.ndarray
    told: list
    warnings: list


# Pattern --------------------------------------------------------------------------------------------------------------

def _charts(faces, uv):
    """Number [c] of the flat panel that each face lies in: faces that share an edge, there and in the texture."""
    owner, root = {}, np.arange(len(faces))

    def find(i):
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for k in range(3):
        for f, (a, b, ua, ub) in enumerate(zip(faces[:, k], faces[:, (k + 1) % 3], uv[:, k], uv[:, (k + 1) % 3])):
            key = tuple(sorted([(int(a), *np.round(ua, 6)), (int(b), *np.round(ub, 6))]))
            if key in owner:
                root[find(f)] = find(owner[key])
            else:
                owner[key] = f
    return np.unique([find(f) for f in range(len(faces))], return_inverse=True)[1]


def _flat(corner, warp):
    """Corners [c, 3, 2] of each triangle laid flat, +y along `warp` [c, 3] as far as that lies in it."""
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-18)
    y = warp - (warp * normal).sum(1, keepdims=True) * normal
    weak = np.linalg.norm(y, axis=1) < 0.1
    other = np.cross(normal, [1.0, 0, 0])
    y[weak] = other[weak]
    weak = np.linalg.norm(y, axis=1) < 1e-6
    y[weak] = (b - a)[weak]
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    x = np.cross(y, normal)
    from_a = corner - a[:, None]
    return np.stack([np.einsum("ckj,cj->ck", from_a, x), np.einsum("ckj,cj->ck", from_a, y)], -1)


def _stretches(flat, pattern):
    """Singular values [c, 2] of the map from the pattern to the cloth as it is modelled."""
    def edges(corners):
        return np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], -1)
    inverse = edges(pattern)
    bad = np.abs(np.linalg.det(inverse)) < 1e-14
    inverse[bad] = np.eye(2)
    out = np.linalg.svd(edges(flat) @ np.linalg.inv(inverse), compute_uv=False)
    out[bad] = np.inf
    return out


def pattern(vertices, faces, uv):
    """(corners [c, 3, 2] m of the triangles in their flat panels, what they are in words).

    Texture coordinates are the pattern where they keep lengths, as those of garments made of panels do; otherwise each
    triangle's own shape is, and the texture says where the warp runs (+v; without one it runs down)."""
    corner = vertices[faces]
    down = np.tile([0.0, 1, 0], (len(faces), 1))
    flat = _flat(corner, down)
    if uv is None:
        return flat, "no texture coordinates: the mesh as it stands is the rest shape, the warp runs down"
    area = 0.5 * np.abs(geometry.doubled_areas(flat))
    turned = geometry.doubled_areas(uv)
    chart = _charts(faces, uv)
    whole = np.bincount(chart, 0.5 * np.abs(turned))
    scale = np.sqrt(np.bincount(chart, area) / np.maximum(whole, 1e-18))
    panels = scale[chart][:, None, None] * uv
    panels = panels - panels[:, :1]
    panels[(np.bincount(chart, turned) < 0)[chart]] *= [-1, 1]
    stretch = _stretches(flat, panels)
    good = (np.abs(stretch - 1) < ISOMETRIC).all(1)
    share = float(area[good].sum() / area.sum())
    if share >= ISOMETRIC_SHARE and np.isfinite(stretch).all():
        how = (f"texture coordinates are the pattern ({len(whole)} panels; {100 * share:.0f} % of the cloth as long as "
               f"its panel within {100 * ISOMETRIC:.0f} %)")
        return panels, how
    # Where v grows, in the cloth.
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    du1, du2 = (uv[:, k] - uv[:, 0] for k in (1, 2))
    determinant = np.where(np.abs(turned) > 1e-14, turned, 1)[:, None]
    warp = np.where(np.abs(turned)[:, None] > 1e-14, (-du2[:, :1] * e1 + du1[:, :1] * e2) / determinant, down)
    length = np.linalg.norm(warp, axis=1, keepdims=True)
    warp = np.where(length > 1e-12, warp / np.maximum(length, 1e-12), down)
    how = (f"texture coordinates do not keep lengths ({100 * share:.0f} % of the cloth within {100 * ISOMETRIC:.0f} "
           "%): the mesh as it stands is the rest shape, the warp runs along +v")
    return _flat(corner, warp), how


# Surface --------------------------------------------------------------------------------------------------------------

def _edge_uses(faces):
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(sides, 1), axis=0, return_counts=True)


def oriented(path, faces):
    """Faces whose neighbours agree on their right side, and the piece [c] each belongs to. Refuses what is no sheet."""
    edges, uses = _edge_uses(faces)
    if (uses > 2).any():
        a, b = edges[np.argmax(uses > 2)] + 1
        refuse(path, f"{(uses > 2).sum()} edges at which three faces or more meet, the first between vertices {a} and "
                     f"{b}",
               "one sheet of cloth", "delete doubled and inner faces (in Blender: Select Non Manifold)")
    of_edge = {}
    for f, face in enumerate(faces.tolist()):
        for k in range(3):
            of_edge.setdefault(frozenset((face[k], face[(k + 1) % 3])), []).append((f, face[k], face[(k + 1) % 3]))
    faces, piece = faces.copy(), np.full(len(faces), -1)
    turn = np.zeros(len(faces), bool)
    around = [[] for _ in faces]
    for sides in of_edge.values():
        if len(sides) == 2:
            (f, a, _), (g, c, _) = sides
            around[f].append((g, a == c))
            around[g].append((f, a == c))
    count = 0
    for start in range(len(faces)):
        if piece[start] >= 0:
            continue
        piece[start], waiting = count, [start]
        while waiting:
            f = waiting.pop()
            for g, same_way in around[f]:
                if piece[g] < 0:
                    piece[g], turn[g] = count, turn[f] ^ same_way
                    waiting.append(g)
                elif turn[g] != turn[f] ^ same_way:
                    refuse(path, "a surface with one side, as a Moebius strip has", "a sheet with two sides")
        count += 1
    faces[turn] = faces[turn][:, [0, 2, 1]]
    open_pieces = set(piece[[of[0][0] for of in of_edge.values() if len(of) == 1]].tolist())
    closed = sorted(set(range(count)) - open_pieces)
    if closed:
        refuse(path, f"{len(closed)} of {count} pieces without a border: a closed surface, or cloth with an inside and "
                     "an outside of its own", "one sheet without thickness, open at neck, hem and sleeves",
               "apply no thickness (Blender's Solidify), or delete the inner side")
    return faces, piece


def _outward(vertices, faces, piece, nearest):
    """Faces of each piece turned so that most look away from the body."""
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    away = (corner - nearest[faces]).mean(1)
    votes = np.bincount(piece, (normal * away).sum(1))
    faces = faces.copy()
    inward = votes[piece] < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return faces


def touches(vertices, hero):
    """Bit masks [n] of body.PARTS: trunk and legs; on a sleeve its arm; between them both."""
    limb = np.asarray(parts.LIMB)[hero.owner[np.argmax(hero.weights, 1)]]

    def distance(wanted):
        faces = hero.faces[wanted[limb[hero.faces]].any(1)]
        if not len(faces):
            return np.full(len(vertices), np.inf)
        corner = hero.vertices[faces]       # within a third of a triangle: enough to tell an arm from the trunk
        middles = [0.5 * (corner[:, k] + corner[:, (k + 1) % 3]) for k in range(3)]
        return cKDTree(np.concatenate([corner.reshape(-1, 3), corner.mean(1), *middles])).query(vertices)[0]

    rest = distance(np.array([True, True, True, False, False]))
    out = np.full(len(vertices), parts.TRUNK | parts.LEFT_LEG | parts.RIGHT_LEG, np.uint32)
    for number, mask in ((3, parts.LEFT_ARM), (4, parts.RIGHT_ARM)):
        arm = distance(np.arange(5) == number)
        sleeve = (arm < ON_SLEEVE * rest) & (arm < SLEEVE_REACH)
        shoulder = ~sleeve & (arm < rest / ON_SLEEVE) & (arm < ON_SHOULDER)
        out[sleeve] = mask
        out[shoulder] |= np.uint32(mask)
    # Trunk and sleeve share their border.
    sleeved = out & np.uint32(parts.TRUNK) == 0
    if sleeved.any() and not sleeved.all():
        near = cKDTree(vertices[~sleeved]).query(vertices[sleeved])[0] < ON_SHOULDER
        out[np.flatnonzero(sleeved)[near]] |= np.uint32(parts.TRUNK)
    return out


def _loops(faces, count):
    """Border loops of a surface: arrays of vertices, any order within."""
    edges, uses = _edge_uses(faces)
    border = edges[uses == 1]
    number = heroes._pieces(count, np.concatenate([border, border[:, :1]], 1)) if len(border) else np.zeros(0, int)
    on = np.unique(border)
    return [on[number[on] == k] for k in np.unique(number[on])]


def pins(path, wanted, mesh, hero, nearest, weights):
    """(pinned [n] bool, what was pinned in words).

    wanted: "colour:red", "bone:hips,spine" (roles or joints), "top", "none", or None: red vertices where there are any,
    otherwise the top."""
    count = len(mesh.vertices)

    def coloured(name):
        return (np.abs(mesh.colours - COLOURS[name]) < COLOUR_REACH).all(1)

    if wanted is None:
        wanted = "colour:red" if mesh.colours is not None and coloured("red").any() else "top"
    kind, _, value = wanted.partition(":")
    if wanted == "none":
        return np.zeros(count, bool), "nothing is pinned"
    if wanted == "top":
        gap = np.linalg.norm(mesh.vertices - nearest, axis=1)
        loops = [loop for loop in _loops(mesh.faces, count) if np.median(gap[loop]) < TOP]
        if not loops:
            refuse(path, "no border that lies on the skin", f"a waistband or neckline within {1e3 * TOP:.0f} mm of it",
                   "paint what is to be pinned red (vertex colours), or name a bone: --pin bone:hips; --pin none where "
                   "the garment hangs by itself")
        highest = max(loops, key=lambda loop: mesh.vertices[loop, 1].mean())
        pinned = np.zeros(count, bool)
        pinned[highest] = True
        return pinned, f"the top border is pinned ({len(highest)} vertices)"
    if kind == "colour":
        if value not in COLOURS:
            refuse(path, f"--pin {wanted}", f"colour:{', colour:'.join(COLOURS)}")
        if mesh.colours is None:
            refuse(path, "a mesh without vertex colours", f"vertices painted {value}",
                   "export with vertex colours (OBJ: six numbers behind v; glTF: COLOR_0)")
        pinned = coloured(value)
        if not pinned.any():
            refuse(path, f"no {value} vertices", f"some vertices painted {value}", "paint what is to be pinned")
        return pinned, f"{int(pinned.sum())} {value} vertices are pinned"
    if kind == "bone":
        joints = []
        for name in value.split(","):
            if name in hero.roles:
                joints.append(hero.roles[name])
            elif name in hero.names:
                joints.append(hero.names.index(name))
            else:
                refuse(path, f"--pin bone:{name}", f"a role ({', '.join(sorted(hero.roles))}) or a joint "
                       f"({', '.join(hero.names[:40])})")
        pinned = np.isin(np.argmax(weights, 1), joints) & (np.linalg.norm(mesh.vertices - nearest, axis=1) < TOUCHING)
        if not pinned.any():
            refuse(path, f"no vertex within {1e3 * TOUCHING:.0f} mm of the skin of {value}", "some that touch it",
                   "name another bone, or paint what is to be pinned red")
        return pinned, f"{int(pinned.sum())} vertices that touch {value} are pinned"
    refuse(path, f"--pin {wanted}", "top, none, colour:red (green, blue, black, white) or bone:ROLE,...")


def felt(hero, masks, vertices):
    """Joints whose motion the network reads."""
    roles = ["hips", "left upper leg", "right upper leg", "left lower leg", "right lower leg"]
    sleeves = bool((masks & np.uint32(parts.LEFT_ARM | parts.RIGHT_ARM)).any())
    chest = next((role for role in ("upper chest", "chest", "spine") if role in hero.roles), None)
    above = vertices[:, 1].max() > hero.joints[0, 1] + 0.2
    if chest and (sleeves or above):
        roles.append(chest)
    if sleeves:
        roles += [f"{side} {part}" for part in ("upper arm", "lower arm") for side in ("left", "right")
                  if f"{side} {part}" in hero.roles]
    return tuple(hero.names[hero.roles[role]] for role in roles)


def make(path, hero, fabric, pin=None, unit="m", up="y", refine=0):
    """The garment of a file, on the character in its bind pose -> Made."""
    read = meshes.read(path, unit, up)
    mesh, number = meshes.welded(read, WELD)
    mesh = meshes.refined(mesh, refine)
    told, warnings = [], []
    if not checks.FEWEST <= len(mesh.vertices) <= MOST:
        refuse(path, f"{len(mesh.vertices):,} vertices", f"{checks.FEWEST} to {MOST:,}",
               "simulate a coarser mesh" if len(mesh.vertices) > MOST else "export the whole garment")
    before = mesh.faces
    mesh.faces, piece = oriented(path, before)
    nearest, weights = geometry.nearest_weights(mesh.vertices, hero.vertices, hero.faces, hero.weights)
    away = float(np.median(np.linalg.norm(mesh.vertices - nearest, axis=1)))
    if away > checks.LOST:
        low, high = hero.vertices[:, 1].min(), hero.vertices[:, 1].max()
        refuse(path, f"a garment {away:.3g} m from the skin (median), between {mesh.vertices[:, 1].min():.3g} and "
               f"{mesh.vertices[:, 1].max():.3g} m high",
               f"{checks.LOST} m from the skin, which stands from {low:.3g} to "
               f"{high:.3g} m", "it must hang on the character in its bind pose; say --garment-unit or --garment-up")
    mesh.faces = _outward(mesh.vertices, mesh.faces, piece, nearest)
    turned = mesh.faces[:, 1] != before[:, 1]
    if mesh.uv is not None:
        mesh.uv = np.where(turned[:, None, None], mesh.uv[:, [0, 2, 1]], mesh.uv)
    corners, how = pattern(mesh.vertices, mesh.faces, mesh.uv)
    told.append(how)
    pinned, how = pins(path, pin, mesh, hero, nearest, weights)
    told.append(how)
    masks = touches(mesh.vertices, hero)
    names = [name for bit, name in zip((parts.TRUNK, parts.LEFT_LEG, parts.RIGHT_LEG, parts.LEFT_ARM, parts.RIGHT_ARM),
                                       heroes.part_names()) if (masks & np.uint32(bit)).any()]
    told.append(f"it touches {', '.join(names)}")
    loose = [k for k in range(piece.max() + 1) if not pinned[np.unique(mesh.faces[piece == k])].any()]
    if loose and piece.max() > 0:
        warnings.append(f"{len(loose)} of {piece.max() + 1} pieces have no pinned vertex and fall unless the body "
                        "holds them; join them to the garment, or pin them")
    edges = np.concatenate([mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, (k + 1) % 3]]
                            for k in range(3)])
    spacing = float(np.median(np.linalg.norm(edges, axis=1)))
    thickness = round(float(np.clip(THICK * spacing, settings.SOLVER["thickness"], THICKEST)), 4)
    told.append(f"{len(mesh.vertices):,} vertices, {1e3 * spacing:.0f} mm apart, kept {1e3 * thickness:.1f} mm from "
                "the skin")
    if spacing > COARSE:
        warnings.append(f"vertices are {1e3 * spacing:.0f} mm apart: folds need 10 to {1e3 * COARSE:.0f}; --refine 1 "
                        "cuts every triangle in four")
    texture = None if mesh.uv is None else mesh.uv.astype(np.float32)
    worn = garment.Garment(_name(path), fabric, mesh.vertices, Fabric(mesh.faces.astype(np.int32), corners), None,
                           pinned, masks, texture, felt(hero, masks, mesh.vertices), {"thickness": thickness})
    return Made(worn, number if refine == 0 else None, told, warnings)


def _name(path):
    stem = path.replace("\\", "/").rpartition("/")[2]
    name = stem.partition("#")[2] or stem.rpartition(".")[0]
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name) or "garment"
