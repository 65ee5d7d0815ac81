"""A garment cut into patches: strips that hang along the body, each with a few points, a frame and neighbours.

A patch is a column of cloth, such as a gore of a skirt, from its upper rim to its hem; a point is the mean of a piece of
the column. Weights of the patch stage are shared by all patches, so each sees its cloth and the body in its own frame
(columns out, up, along). Everything is made of the garment in its bind pose and the skinning of stage 1.
"""
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

INFLUENCES = 4          # joints that a point follows at most
LIMBS = 2               # that a patch looks at
BONES_A_LIMB = 2
DILATIONS = (1, 2, 4)   # patches between neighbours, a mixing layer each
SHORTEST_BONE = 0.05    # m
THICKEST = 0.35         # of its length: what is thicker is trunk
OWN_SKIN = 0.5          # weight of skin that shows how thick a bone's limb is


@dataclass
class Layout:
    """Sizes: K patches of R points, n vertices, L mixing layers with S neighbours each; bind pose, metres."""
    points_of: csr_matrix               # [K R, n] rows are means
    patch_joint: np.ndarray             # [K] joint whose frame a patch has
    axes: np.ndarray                    # [K, 3, 3]
    centres: np.ndarray                 # [K, 3]
    point_joints: np.ndarray            # [K, R, 4]
    point_parts: np.ndarray             # [K, R, 4, 4]: mean of weight times place, mean weight
    limbs: np.ndarray                   # [K, 2, 2] capsules
    capsule_joints: np.ndarray          # [c]
    capsules: np.ndarray                # [c, 8]: both ends, both radii
    near: np.ndarray                    # [L, S, K]
    mirror: np.ndarray = field(default=None)    # [K]; None: the garment has no mirror image

    @property
    def sizes(self):
        """(K, R)."""
        return self.point_joints.shape[:2]


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


def _columns(angle, side, count):
    """[members] column 0 to count - 1 of a side's vertices: as many vertices in each, by angle."""
    out = np.zeros(len(angle), int)
    for s in (0, 1):
        own = np.flatnonzero(side == s)
        order = own[np.argsort(angle[own], kind="stable")]
        out[order] = np.arange(len(order)) * count // max(len(order), 1)
    return out


def make(character, skin, columns=16, rows=8, sleeve_columns=4):
    """The Layout of a garment with a mirror image. skin [n, J]: weights of stage 1.

    columns: of each side of what hangs from the trunk; sleeve_columns: of each half of a limb's sleeve.
    """
    vertices, faces = character.template.astype(np.float64), character.faces
    mirror = character.mirror
    if mirror is None:
        raise ValueError("patches need a garment with a mirror image")
    limbs, main = limbs_of(character), skin.argmax(1)
    part = np.zeros(len(vertices), int)                 # 0: hangs from the trunk; 1 + l: lies on limb l
    for number, (joints, _) in enumerate(limbs):
        part[np.isin(main, list(_below(character, joints[0])))] = 1 + number
    used = [p for p in np.unique(part)]
    patch, rings, facing = np.zeros(len(vertices), int), [], []
    total = 0
    for p in used:
        members = np.flatnonzero(part == p)
        x = vertices[members]
        if p == 0:
            origin, up, ahead, count = x.mean(0) * [0, 1, 1], np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), columns
        else:
            joints, capsules = limbs[p - 1]
            way = capsules[1, 3:6] - capsules[0, :3]
            origin, up = capsules[0, :3], -way / np.linalg.norm(way)
            ahead = np.array([0, 0, 1.0]) - up[2] * up
            ahead, count = ahead / np.linalg.norm(ahead), sleeve_columns
        across = np.cross(up, ahead)
        flat = x - origin
        angle = np.arctan2(flat @ across, flat @ ahead)     # 0 ahead, rising to the left
        side = (angle < 0).astype(int)
        if p == 0:                                          # exactly symmetric: the other side's mirror image
            side = (x[:, 0] < 0).astype(int)
            on_middle = np.abs(x[:, 0]) < 1e-6
            side[on_middle] = 0
        column = _columns(np.abs(angle), side, count)
        height = flat @ up
        top = members[height >= np.quantile(height, 0.98)]
        depth = _depth(vertices, faces, members, top)
        ring = [(0, c) for c in range(count)] + [(1, c) for c in range(count - 1, -1, -1)]
        numbers = {}
        for s, c in ring:
            own = np.flatnonzero((side == s) & (column == c))
            if len(own) < rows:
                raise ValueError(f"{len(own)} vertices in a patch of {rows} points; ask for fewer columns")
            order = own[np.argsort(depth[own], kind="stable")]
            row = np.arange(len(order)) * rows // len(order)
            patch[members[order]] = (total + len(numbers)) * rows + row
            radial = flat[own].mean(0) - (flat[own].mean(0) @ up) * up
            facing.append((up, radial / np.linalg.norm(radial)))
            numbers[(s, c)] = total + len(numbers)
        rings.append((p, [numbers[key] for key in ring]))
        total += len(ring)
    # Right halves are mirror images of left ones, to the vertex.
    count_points = total * rows
    partner = _partners(rings, limbs, total)
    left = _left_points(patch, vertices, rows, partner)
    patch = np.where(left, patch, -1)
    wanted = patch[mirror]
    take = (patch < 0) & (wanted >= 0)
    patch[take] = partner[wanted[take] // rows] * rows + wanted[take] % rows
    patch[patch < 0] = 0
    share = coo_matrix((np.ones(len(vertices)), (patch, np.arange(len(vertices)))), (count_points, len(vertices))).tocsr()
    rows_of = (partner[:, None] * rows + np.arange(rows)).ravel()
    share = 0.5 * (share + share[rows_of][:, mirror])     # vertices in the middle belong to both sides
    sums = np.asarray(share.sum(1)).ravel()
    if (sums == 0).any():
        raise ValueError(f"{int((sums == 0).sum())} points without a vertex; ask for fewer columns or rows")
    share = csr_matrix(share.multiply(1 / sums[:, None]))
    return _finish(character, skin, share, rows, rings, facing, partner, limbs)


def _partners(rings, limbs, total):
    """[K] the patch that takes each one's place when left and right swap."""
    partner = np.arange(total)
    for p, ring in rings:
        if p == 0:
            partner[ring] = ring[::-1]
            continue
        centre = limbs[p - 1][1][:, :6].reshape(-1, 3).mean(0) * [-1, 1, 1]
        other = min((q for q, _ in rings if q), key=lambda q: np.linalg.norm(
            limbs[q - 1][1][:, :6].reshape(-1, 3).mean(0) - centre))
        partner[ring] = dict(rings)[other][::-1]
    return partner


def _left_points(patch, vertices, rows, partner):
    """[n] whether a vertex decides its own patch, and not its mirror image's."""
    column = patch // rows
    return np.where(partner[column] == column, True, vertices[:, 0] >= 0)


def _finish(character, skin, share, rows, rings, facing, partner, limbs):
    vertices, total = character.template.astype(np.float64), len(partner)
    weights = np.asarray(share @ skin)                                             # [K R, J]
    moments = np.stack([np.asarray(share @ (skin * vertices[:, i:i + 1])) for i in range(3)], -1)
    joints = np.argsort(-weights, 1, kind="stable")[:, :INFLUENCES]
    at = np.arange(len(joints))[:, None]
    parts = np.concatenate([moments[at, joints], weights[at, joints][..., None]], -1)
    kept = parts[..., 3].sum(1)
    parts /= kept[:, None, None]
    places = share @ vertices
    centres = places.reshape(total, rows, 3).mean(1)
    patch_joint = weights.reshape(total, rows, -1).sum(1).argmax(1)
    axes = np.stack([np.stack([out, up, np.cross(up, out)], -1) for up, out in facing])
    for k, other in enumerate(partner):     # mirror images exactly
        if other > k:
            axes[other] = axes[k] * [[-1], [1], [1]] * [1, 1, -1]
    capsule_joints = np.concatenate([joints_ for joints_, _ in limbs])
    capsules = np.concatenate([c for _, c in limbs])
    seen = np.zeros((total, LIMBS, BONES_A_LIMB), np.int32)
    low = places.reshape(total, rows, 3)[:, rows // 2:]
    for k in range(total):
        near = [min(_distance(low[k], c).mean() for c in of_limb) for _, of_limb in limbs]
        chosen = np.resize(np.argsort(near, kind="stable")[:LIMBS], LIMBS)
        seen[k] = [[2 * c, 2 * c + 1] for c in chosen]
    near = np.tile(np.arange(total), (len(DILATIONS), 2, 1))
    for _, ring in rings:
        for layer, step in enumerate(DILATIONS):
            near[layer, 0, ring], near[layer, 1, ring] = np.roll(ring, step), np.roll(ring, -step)
    return Layout(share, patch_joint.astype(np.int32), axes, centres, joints.reshape(total, rows, -1).astype(np.int32),
                  parts.reshape(total, rows, INFLUENCES, 4), seen, capsule_joints.astype(np.int32), capsules,
                  near.astype(np.int32), partner)


def base(layout, relative):
    """Places [..., K, R, 3] of the points without displacement, relative [..., J, 4, 4] skinning matrices."""
    m = relative[..., layout.point_joints, :3, :]                                  # [..., K, R, 4, 3, 4]
    return np.einsum("...krijc,kric->...krj", m, layout.point_parts)


def displacements(layout, relative, truth, ticks=64):
    """Points [T, K, 3, R] of true cloth [T, n, 3] in their patches' frames, less their base. m."""
    patches, points = layout.sizes
    out = np.empty((len(truth), patches, 3, points), np.float32)
    for at in range(0, len(truth), ticks):
        some = slice(at, at + ticks)
        part = truth[some].astype(np.float64)
        mean = (layout.points_of @ part.transpose(1, 0, 2).reshape(part.shape[1], -1)).reshape(-1, len(part), 3)
        mean = mean.transpose(1, 0, 2).reshape(len(part), patches, points, 3)
        turned = relative[some][:, layout.patch_joint, :3, :3] @ layout.axes
        out[some] = np.einsum("tkji,tkrj->tkir", turned, mean - base(layout, relative[some]))
    return out


def mirrored(layout, moved):
    """Displacements [..., K, 3, R] with left and right swapped."""
    return moved[..., layout.mirror, :, :] * np.array([1, 1, -1], np.float32)[:, None]


def poses(relative, hips, wind, rate=30.0):
    """What a tick reads of a pose [T, 12 J + 6] float32: skinning matrices from the hips, their way, wind a tick.

    relative [T, J, 4, 4]; hips [T, 3] m; wind [T, 3] m/s or None."""
    matrices = relative[:, :, :3].copy()
    matrices[..., 3] -= hips[:, None]
    way = np.diff(hips, axis=0, prepend=hips[:1])
    wind = np.zeros_like(hips) if wind is None else wind / rate
    return np.concatenate([matrices.reshape(len(hips), -1), way, wind], 1).astype(np.float32)
