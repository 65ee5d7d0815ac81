"""Cuts a garment into patches (patches.Layout), from its bind pose and the skinning of stage 1."""
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from .patches import Layout

INFLUENCES = 4          # joints that a point follows at most
LIMBS = 2               # that a patch sees
BONES_A_LIMB = 2
DILATIONS = (1, 2, 4)   # patches between neighbours, a mixing layer each
SHORTEST_BONE = 0.05    # m
THICKEST = 0.35         # of its length: what is thicker is trunk
OWN_SKIN = 0.5          # weight of skin that shows how thick a bone's limb is
TOP = 0.98              # quantile of height above which a part's rim lies
MIDDLE = 1e-6           # m: a vertex nearer to the plane of symmetry counts to the left



def limbs_of(character):
    """[(joints [2], capsules [2, 8])] of every limb: two bones from hips or shoulder on, as tapered capsules."""
    bind, parents, weights = character.bind[:, :3, 3], character.parents, character.body_weights
    if parents is None:
        raise ValueError("the character has no parents of joints; the patch stage finds limbs by them")
    children = {j: [c for c, parent in enumerate(parents) if parent == j] for j in range(len(parents))}

    def bone(j):
        """(capsule, child), or None where it is no limb."""
        own = character.body_vertices[weights[:, j] > OWN_SKIN].astype(np.float64)
        if parents[j] < 0 or not children[j] or len(own) < 8:
            return None
        child = max(children[j], key=lambda c: np.linalg.norm(bind[c] - bind[j]))
        way = bind[child] - bind[j]
        length = np.linalg.norm(way)
        if length < SHORTEST_BONE:
            return None
        along = (own - bind[j]) @ way / length ** 2
        apart = np.linalg.norm(own - bind[j] - along[:, None] * way, axis=1)
        inside = (along > 0.1) & (along < 1)
        if inside.sum() < 8:
            return None
        slope, start = np.polyfit(along[inside], apart[inside], 1)
        if start + slope / 2 > THICKEST * length:
            return None
        return np.r_[bind[j], bind[child], start, start + slope], child

    found = {j: bone(j) for j in range(len(parents))}
    out = []
    for j, first in found.items():
        if first is None or found.get(parents[j]) is not None:
            continue
        second = found[first[1]]
        chain = [(j, first[0]), (first[1], second[0])] if second is not None else [(j, first[0])] * 2
        out.append((np.array([c[0] for c in chain]), np.stack([c[1] for c in chain])))
    if not out:
        raise ValueError(f"no limb among the joints {', '.join(character.joint_names)}: none is a bone longer than "
                         f"{SHORTEST_BONE} m whose skin is thinner than {THICKEST} of its length")
    return out


def _distance(points, capsule):
    a, way = capsule[:3], capsule[3:6] - capsule[:3]
    along = np.clip((points - a) @ way / (way @ way), 0, 1)
    return np.linalg.norm(points - a - along[:, None] * way, axis=1) - capsule[6] - along * (capsule[7] - capsule[6])


def _below(character, root):
    """Joints at and below `root`."""
    out, known = {root}, 0
    while len(out) > known:
        known = len(out)
        out |= {j for j, parent in enumerate(character.parents) if parent in out}
    return out


def _depth(vertices, faces, members, start):
    """[members] length of the way over the mesh from the vertices `start`."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    keep = np.unique(edges, axis=0, return_index=True)[1]
    graph = coo_matrix((length[keep], edges[keep].T), shape=(len(vertices),) * 2).tocsr()
    found = dijkstra(graph, directed=False, indices=start, min_only=True)[members]
    return np.where(np.isfinite(found), found, found[np.isfinite(found)].max(initial=0))


@dataclass
class Part:
    """What hangs around one axis: the trunk's, or a limb's. Directions are those of the bind pose."""
    members: np.ndarray     # vertices
    limb: int               # -1: the trunk
    origin: np.ndarray      # a point of the axis
    up: np.ndarray          # against the way that cloth hangs, or along a limb to its root
    ahead: np.ndarray       # from where angles count
    columns: int            # on each side


def _parts(vertices, skin, character, limbs, columns, sleeve_columns):
    """The trunk's part, where it has any, then one for each limb that cloth lies on."""
    main, on_limb = skin.argmax(1), np.full(len(vertices), -1)
    for number, (joints, _) in enumerate(limbs):
        on_limb[np.isin(main, list(_below(character, joints[0])))] = number
    parts = []
    for number in np.unique(on_limb):
        members = np.flatnonzero(on_limb == number)
        if number < 0:
            parts.append(Part(members, -1, vertices[members].mean(0) * [0, 1, 1], np.array([0, 1.0, 0]),
                              np.array([0, 0, 1.0]), columns))
            continue
        capsules = limbs[number][1]
        way = capsules[1, 3:6] - capsules[0, :3]
        up = -way / np.linalg.norm(way)
        ahead = np.array([0, 0, 1.0]) - up[2] * up
        parts.append(Part(members, int(number), capsules[0, :3], up, ahead / np.linalg.norm(ahead), sleeve_columns))
    return parts


def _opening(angle, edges):
    """How many of the members, in the order of their angles, lie before the place that fewest edges [e, 2] cross; of
    several the widest gap."""
    order = np.argsort(angle, kind="stable")
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    low, high = np.sort(place[edges], 1).T
    around = angle[order[high]] - angle[order[low]] > np.pi    # the short way leads over the end of the circle
    change = np.zeros(len(order) + 1, int)      # of the edges that cross the gap behind each place
    np.add.at(change, low, np.where(around, -1, 1))
    np.add.at(change, high, np.where(around, 1, -1))
    crossing = np.cumsum(change[:-1]) + around.sum()
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    return 1 + np.lexsort((-gaps, crossing))[0]


def _columns(angle, side, count, edges):
    """Column of each member, as many members in each, in the order around the axis: one side's outwards from ahead,
    then the other's back to it. side: 0 or 1; None: around from the opening."""
    if side is None:
        order = np.roll(np.argsort(angle, kind="stable"), -_opening(angle, edges))
        out = np.empty(len(angle), int)
        out[order] = np.arange(len(order)) * 2 * count // len(order)
        return out
    out = np.zeros(len(angle), int)
    for s in (0, 1):
        own = np.flatnonzero(side == s)
        order = own[np.argsort(np.abs(angle[own]), kind="stable")]
        column = np.arange(len(order)) * count // max(len(order), 1)
        out[order] = 2 * count - 1 - column if s else column
    return out


def _cut(part, vertices, faces, rows, symmetric):
    """(column and row of each member, the way out of each column)."""
    flat = vertices[part.members] - part.origin
    angle = np.arctan2(flat @ np.cross(part.up, part.ahead), flat @ part.ahead)    # rising to the left
    side = None
    if symmetric:
        x = vertices[part.members, 0]
        side = ((x < 0) & (np.abs(x) >= MIDDLE) if part.limb < 0 else angle < 0).astype(int)
    local = np.full(len(vertices), -1)
    local[part.members] = np.arange(len(part.members))
    edges = local[np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])]
    column = _columns(angle, side, part.columns, edges[(edges >= 0).all(1)])
    height = flat @ part.up
    depth = _depth(vertices, faces, part.members, part.members[height >= np.quantile(height, TOP)])
    row, out = np.zeros(len(column), int), []
    for c in range(2 * part.columns):
        own = np.flatnonzero(column == c)
        if len(own) < rows:
            raise ValueError(f"{len(own)} vertices in a patch of {rows} points; ask for fewer columns")
        row[own[np.argsort(depth[own], kind="stable")]] = np.arange(len(own)) * rows // len(own)
        radial = flat[own].mean(0) - (flat[own].mean(0) @ part.up) * part.up
        out.append(radial / np.linalg.norm(radial))
    return column, row, out


def _partners(parts, limbs):
    """[K] the patch that takes each one's place when left and right swap."""
    first = np.cumsum([0] + [2 * part.columns for part in parts])
    middle = [limbs[part.limb][1][:, :6].reshape(-1, 3).mean(0) for part in parts if part.limb >= 0]
    of_limbs = [i for i, part in enumerate(parts) if part.limb >= 0]
    partner = np.empty(first[-1], int)
    for i, part in enumerate(parts):
        other = i
        if part.limb >= 0:
            wanted = middle[of_limbs.index(i)] * [-1, 1, 1]
            other = of_limbs[int(np.argmin([np.linalg.norm(m - wanted) for m in middle]))]
        partner[first[i]:first[i + 1]] = np.arange(first[other], first[other + 1])[::-1]
    return partner


def _mirrored(patch, vertices, mirror, partner, rows):
    """Point of each vertex, the right side's from the left's."""
    column = patch // rows
    decides = (partner[column] == column) | (vertices[:, 0] >= 0)
    out = np.where(decides, patch, 0)
    take = ~decides & decides[mirror]
    wanted = patch[mirror[take]]
    out[take] = partner[wanted // rows] * rows + wanted % rows
    return out


def _near(parts, patch, faces, rows):
    """[L, S, K] neighbours at DILATIONS along the ring of each part, before and after; where a garment has several
    parts a third: the patch of another part that most edges lead to. What has no neighbour is its own."""
    total = sum(2 * part.columns for part in parts)
    edges = np.zeros((total, total), int)
    column = patch // rows
    for i in range(3):
        np.add.at(edges, (column[faces[:, i]], column[faces[:, (i + 1) % 3]]), 1)
    edges += edges.T
    part_of = np.repeat(np.arange(len(parts)), [2 * part.columns for part in parts])
    near = np.tile(np.arange(total), (len(DILATIONS), 2 + (len(parts) > 1), 1))
    for number in range(len(parts)):
        ring = np.flatnonzero(part_of == number)
        after = np.where(edges[ring, np.roll(ring, -1)] > 0, np.roll(ring, -1), -1)
        before = np.where(edges[ring, np.roll(ring, 1)] > 0, np.roll(ring, 1), -1)
        for slot, step in ((0, before), (1, after)):
            step = dict(zip(ring, step))
            for layer, ways in enumerate(DILATIONS):
                for k in ring:
                    at = k
                    for _ in range(ways):
                        at = step.get(at, -1)
                    near[layer, slot, k] = k if at < 0 else at
    if len(parts) > 1:
        outside = np.where(part_of[:, None] == part_of, 0, edges)
        near[:, 2] = np.where(outside.max(1) > 0, outside.argmax(1), np.arange(total))
    return near


def make(character, skin, columns=16, rows=8, sleeve_columns=4):
    """The Layout of a garment; skin [n, J]: weights of stage 1. If it has a mirror image, patches have theirs.

    columns: on each side of what hangs from the trunk; sleeve_columns: on each side of a limb.
    """
    vertices, faces, mirror = character.template.astype(np.float64), character.faces, character.mirror
    limbs = limbs_of(character)
    parts = _parts(vertices, skin, character, limbs, columns, sleeve_columns)
    patch, out, first = np.zeros(len(vertices), int), [], 0
    for part in parts:
        column, row, ways = _cut(part, vertices, faces, rows, mirror is not None)
        patch[part.members] = (first + column) * rows + row
        out += [(part.up, way) for way in ways]
        first += 2 * part.columns
    partner = None
    if mirror is not None:
        partner = _partners(parts, limbs)
        patch = _mirrored(patch, vertices, mirror, partner, rows)
    share = coo_matrix((np.ones(len(vertices)), (patch, np.arange(len(vertices)))), (first * rows, len(vertices)))
    share = share.tocsr()
    if mirror is not None:      # vertices in the middle belong to both sides
        share = 0.5 * (share + share[(partner[:, None] * rows + np.arange(rows)).ravel()][:, mirror])
    sums = np.asarray(share.sum(1)).ravel()
    if (sums == 0).any():
        raise ValueError(f"{int((sums == 0).sum())} points without a vertex; ask for fewer columns or rows")
    share = csr_matrix(share.multiply(1 / sums[:, None]))
    axes = np.stack([np.stack([way, up, np.cross(up, way)], -1) for up, way in out])
    for k, other in enumerate(partner if partner is not None else ()):      # mirror images exactly
        if other > k:
            axes[other] = axes[k] * [[-1], [1], [1]] * [1, 1, -1]
    joints, moments = _followed(share, skin, vertices)
    places = (share @ vertices).reshape(first, rows, 3)
    whole = np.asarray(share @ skin).reshape(first, rows, -1).sum(1)
    return Layout(share, whole.argmax(1).astype(np.int32), axes, places.mean(1), joints.reshape(first, rows, -1),
                  moments.reshape(first, rows, INFLUENCES, 4), _seen(places[:, rows // 2:], limbs),
                  np.concatenate([joints for joints, _ in limbs]).astype(np.int32),
                  np.concatenate([capsules for _, capsules in limbs]),
                  _near(parts, patch, faces, rows).astype(np.int32), partner)


def _followed(share, skin, vertices):
    """Joints [P, 4] that points follow most, and their parts [P, 4, 4]: mean of weight times place, mean weight."""
    weights = np.asarray(share @ skin)
    moments = np.stack([np.asarray(share @ (skin * vertices[:, i:i + 1])) for i in range(3)], -1)
    joints = np.argsort(-weights, 1, kind="stable")[:, :INFLUENCES]
    at = np.arange(len(joints))[:, None]
    parts = np.concatenate([moments[at, joints], weights[at, joints][..., None]], -1)
    return joints.astype(np.int32), parts / parts[..., 3].sum(1)[:, None, None]


def _seen(low, limbs):
    """[K, 2, 2] capsules of the two limbs that are nearest to patches' lower points [K, r, 3] in the bind pose."""
    out = np.zeros((len(low), LIMBS, BONES_A_LIMB), np.int32)
    for k, points in enumerate(low):
        away = [min(_distance(points, capsule).mean() for capsule in capsules) for _, capsules in limbs]
        nearest = np.resize(np.argsort(away, kind="stable")[:LIMBS], LIMBS)
        out[k] = BONES_A_LIMB * nearest[:, None] + np.arange(BONES_A_LIMB)
    return out
