"""The figure as cloth touches it: trunk and limbs as surfaces of their own.

Skin is one sheet; crossing legs or an arm at the side would make "inside" ambiguous. So each part is cut out of the
skin with a margin, and a cloth vertex is kept outside of each part by itself. Where a part is cut off, the part it was
cut from takes over.
"""
import numpy as np

from ..motion import skeleton

# Limbs are two parts each: cloth in the hollow of a bent knee or elbow is held between both.
PARTS = (("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "LeftShoulder", "RightShoulder"),
         ("LeftUpLeg",), ("LeftLeg", "LeftFoot", "LeftToeBase"),
         ("RightUpLeg",), ("RightLeg", "RightFoot", "RightToeBase"),
         ("LeftArm",), ("LeftForeArm", "LeftHand"), ("RightArm",), ("RightForeArm", "RightHand"))
LIMB = (0, 1, 1, 2, 2, 3, 3, 4, 4)      # which parts are one limb
TRUNK, LEFT_LEG, RIGHT_LEG, LEFT_ARM, RIGHT_ARM = (sum(1 << p for p, of in enumerate(LIMB) if of == limb)
                                                   for limb in range(5))
ALL = (1 << len(PARTS)) - 1
MARGIN = 3      # rings of faces beyond the part's own


def owners(figure):
    """The part [J] that each joint moves; a character of the user's own says it itself (own/hero.py)."""
    if hasattr(figure, "owner"):
        return figure.owner
    column = {name: k for k, name in enumerate(figure.names)}
    owner = np.full(len(figure.names), -1)
    for number, names in enumerate(PARTS):
        owner[[column[name] for name in names]] = number
    return owner


def bind_matrices(figure):
    """Matrices [J, 4, 4] of the pose that the skin is bound in."""
    return figure.bind if hasattr(figure, "bind") else skeleton.bind_matrices()


def joint_matrices(figure, motion):
    """World matrices [T, J, 4, 4] of a motion of the figure's joints."""
    return figure.matrices(motion) if hasattr(figure, "matrices") else skeleton.joint_matrices(motion)


def rest(figure, frames):
    """The bind pose, held."""
    return figure.rest(frames) if hasattr(figure, "rest") else skeleton.rest_motion(frames)


def thin_joints(figure):
    """Joints of feet and hands."""
    if hasattr(figure, "roles"):
        return [joint for role, joint in figure.roles.items() if role.endswith(("foot", "toes", "hand"))]
    return [k for k, name in enumerate(figure.names) if name.endswith(("Foot", "ToeBase", "Hand"))]


def cut_parts(figure):
    """faces [g, 3], part [g]: each part's own faces of the figure and a margin of its neighbours'."""
    nearest = np.argmax(figure.weights, axis=1)
    owner = owners(figure)
    faces, part = [], []
    for number in range(len(PARTS)):
        inside = owner[nearest] == number
        limb = np.asarray(LIMB)[owner[nearest]]
        other_limb = (limb != LIMB[number]) & (limb != 0) if number else np.zeros(len(nearest), bool)
        for _ in range(MARGIN):
            grown = inside.copy()
            grown[figure.faces[inside[figure.faces].any(1)]] = True
            inside = grown & ~other_limb
        own = figure.faces[inside[figure.faces].all(1)]
        faces.append(own)
        part.append(np.full(len(own), number, np.int32))
    return np.concatenate(faces).astype(np.int32), np.concatenate(part)


def section(figure, height, half_width=0.25):
    """The trunk's outline at a height: radius in m by angle about the y axis, as a function of angles (0 = front +z,
    growing towards +x). The arms are left out by `half_width`."""
    edges = np.unique(np.sort(np.concatenate([figure.faces[:, [0, 1]], figure.faces[:, [1, 2]],
                                              figure.faces[:, [2, 0]]]),
                              axis=1), axis=0)
    a, b = figure.vertices[edges[:, 0]], figure.vertices[edges[:, 1]]
    cut = (a[:, 1] - height) * (b[:, 1] - height) < 0
    t = ((height - a[:, 1]) / np.where(cut, b[:, 1] - a[:, 1], 1))[:, None]
    points = (a + t * (b - a))[cut][:, [0, 2]]
    points = points[np.abs(points[:, 0]) < half_width]
    angle = np.linspace(-np.pi, np.pi, 361)
    direction = np.stack([np.sin(angle), np.cos(angle)], -1)
    # The convex hull: cloth spans hollows. Without BLAS, whose last bits depend on the processor.
    support = (points[:, :1] * direction[:, 0] + points[:, 1:] * direction[:, 1]).max(0)
    normal = np.stack([np.cos(angle), -np.sin(angle)], -1)
    slope = np.gradient(support, angle)
    hull = support[:, None] * direction + slope[:, None] * normal
    at = np.unwrap(np.arctan2(hull[:, 0], hull[:, 1]))
    radius = np.linalg.norm(hull, axis=1)
    order = np.argsort(at)

    def outline(phi):
        return np.interp((np.asarray(phi) + np.pi) % (2 * np.pi) - np.pi, at[order], radius[order], period=2 * np.pi)
    return outline
