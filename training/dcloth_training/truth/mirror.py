"""The mirror image of a garment, where there is one: training then sees every clip twice."""
import numpy as np
from scipy.spatial import cKDTree

TOLERANCE = 5e-4      # metres between a vertex and the image of its partner
FRAMES = 1e-3         # of a joint's axes


def _swapped(name):
    for left, right in (("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT")):
        if left in name or right in name:
            return name.replace(left, "\0").replace(right, left).replace("\0", right)
    for mark in ("_", "."):
        for left, right in (("l", "r"), ("L", "R")):
            for one, other in ((left, right), (right, left)):
                if name.endswith(mark + one):
                    return name[:-1] + other
                if name.startswith(one + mark):
                    return other + name[1:]
    return name


def _turned(polygon):
    at = polygon.index(min(polygon))
    return polygon[at:] + polygon[:at]


def find(template, polygons, joint_names, bind):
    """((vertex permutation [n], joint permutation [J]), None), or (None, why there is none)."""
    joints = [joint_names.index(_swapped(n)) if _swapped(n) in joint_names else -1 for n in joint_names]
    if -1 in joints:
        return None, f"joint '{joint_names[joints.index(-1)]}' has no partner"
    reflection = np.diag([-1.0, 1, 1, 1])
    apart = np.abs(reflection @ bind[joints] @ reflection - bind).max((1, 2))
    if apart.max() > FRAMES:
        return None, f"the frame of joint '{joint_names[int(apart.argmax())]}' is not the image of its partner's"
    image = template * [-1, 1, 1]
    distance, partner = cKDTree(template).query(image)
    if distance.max() > TOLERANCE:
        return None, f"vertex {int(distance.argmax())} is {1e3 * distance.max():.1f} mm from its mirror image"
    if (np.sort(partner) != np.arange(len(template))).any() or (partner[partner] != np.arange(len(template))).any():
        return None, "two vertices share a mirror image"
    images = {_turned(tuple(int(partner[v]) for v in reversed(p))) for p in polygons}
    if images != {_turned(tuple(p)) for p in polygons}:
        return None, "the faces are not the image of one another"
    return (partner.astype(np.int32), np.array(joints, np.int32)), None
