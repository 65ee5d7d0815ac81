"""A made-up character for synthetic.py: 52 joints (22 of the body, 30 of the fingers), tubes for skin, motion."""
import numpy as np

# Name, parent, offset from it in metres; the left half, mirrored below.
_MIDDLE = [("Hips", None, (0, 0.98, 0)), ("Spine", "Hips", (0, 0.12, 0)), ("Spine1", "Spine", (0, 0.13, 0)),
           ("Spine2", "Spine1", (0, 0.06, 0)), ("Neck", "Spine2", (0, 0.2, 0)), ("Head", "Neck", (0, 0.1, 0))]
_LEFT = [("UpLeg", "Hips", (0.09, -0.06, 0)), ("Leg", "UpLeg", (0.01, -0.4, 0)), ("Foot", "Leg", (0, -0.42, 0)),
         ("Toe", "Foot", (0, -0.06, 0.13)), ("Shoulder", "Spine2", (0.07, 0.12, 0)), ("Arm", "Shoulder", (0.12, 0, 0)),
         ("ForeArm", "Arm", (0.18, -0.2, 0)), ("Hand", "ForeArm", (0.16, -0.18, 0))]
_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
_SIDES = (("Left", 1), ("Right", -1))
# Tubes of the skin: joints along it, radius, rings, columns.
_TUBES = [(("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"), 0.13, 24, 24)] + [
    ((f"{side}{a}", f"{side}{b}", f"{side}{c}"), radius, 20, 16) for side, _ in _SIDES
    for a, b, c, radius in (("UpLeg", "Leg", "Foot", 0.075), ("Arm", "ForeArm", "Hand", 0.04))]


def skeleton():
    """(names, parents as indices with -1 at the root, bind matrices [52, 4, 4])."""
    joints = list(_MIDDLE)
    for side, sign in _SIDES:
        for name, parent, (x, y, z) in _LEFT:
            joints.append((side + name, parent if parent in ("Hips", "Spine2") else side + parent, (sign * x, y, z)))
    for side, sign in _SIDES:
        for number, finger in enumerate(_FINGERS):
            for part in range(3):
                parent = f"{side}Hand" if part == 0 else f"{side}Hand{finger}{part}"
                offset = (sign * 0.03, -0.07, 0.02 * (number - 2)) if part == 0 else (sign * 0.01, -0.025, 0)
                joints.append((f"{side}Hand{finger}{part + 1}", parent, offset))
    names = [name for name, _, _ in joints]
    parents = [-1 if parent is None else names.index(parent) for _, parent, _ in joints]
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    for j, (_, _, offset) in enumerate(joints):
        bind[j, :3, 3] = offset if parents[j] < 0 else bind[parents[j], :3, 3] + offset
    return names, parents, bind


def tube_faces(rings, columns):
    """Two triangles for each cell of a tube, outward, [2 (rings - 1) columns, 3]; rings go down."""
    ring, column = (v.ravel() for v in np.meshgrid(np.arange(rings - 1), np.arange(columns), indexing="ij"))
    a, b = ring * columns + column, ring * columns + (column + 1) % columns
    return np.stack([np.stack([a, a + columns, b], 1), np.stack([b, a + columns, b + columns], 1)], 1) \
        .reshape(-1, 3).astype(np.int32)


def body(bind):
    """Skin (vertices [b, 3], faces, joint weights [b, 52] of at most four joints, rows sum to 1)."""
    names = skeleton()[0]
    points, faces = [], []
    for joints, radius, rings, columns in _TUBES:
        path = bind[[names.index(j) for j in joints], :3, 3]
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        at = np.linspace(along[-1], 0, rings) if path[-1, 1] > path[0, 1] else np.linspace(0, along[-1], rings)
        center = np.stack([np.interp(at, along, path[:, c]) for c in range(3)], -1)
        angle = 2 * np.pi * np.arange(columns) / columns
        ring = radius * np.stack([np.sin(angle), np.zeros(columns), np.cos(angle)], -1)
        faces.append(tube_faces(rings, columns) + sum(map(len, points)))
        points.append((center[:, None] + ring).reshape(-1, 3))
    points = np.concatenate(points)
    distance = np.linalg.norm(points[:, None] - bind[None, :, :3, 3], axis=-1)
    weights = 1 / (distance ** 4 + 1e-4)
    weights[weights < np.sort(weights, 1)[:, -4:-3]] = 0
    return points, np.concatenate(faces), weights / weights.sum(1, keepdims=True)


def _rotations(axis, angle):
    """Axes [J, 3] and angles [T, J] -> [T, J, 3, 3]."""
    cross = np.zeros((len(axis), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= cross.transpose(0, 2, 1)
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def motion(frames, rate, seed):
    """Every joint swings about an axis of its own, legs most; the hips walk and turn: [frames, 52, 4, 4] world."""
    generator = np.random.default_rng(seed)
    names, parents, bind = skeleton()
    seconds = np.arange(frames) / rate
    axis = generator.standard_normal((len(names), 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    swing = np.array([0.5 if "Leg" in n else 0.3 if "Arm" in n else 0.15 for n in names])
    axis[["Leg" in n for n in names]] = (1, 0, 0)
    hertz, phase = generator.uniform(0.5, 1.8, (2, len(names))), generator.uniform(0, 2 * np.pi, (2, len(names)))
    angle = sum(swing / 2 * np.sin(2 * np.pi * hertz[i] * seconds[:, None] + phase[i]) for i in range(2))
    local = np.tile(np.eye(4), (frames, len(names), 1, 1))
    local[:, :, :3, :3] = _rotations(axis, angle)
    for j, parent in enumerate(parents):
        local[:, j, :3, 3] = bind[j, :3, 3] - (bind[parent, :3, 3] if parent >= 0 else 0)
    turn = _rotations(np.array([[0.0, 1.0, 0.0]]), 0.8 * np.sin(0.7 * seconds + phase[0, 0])[:, None])[:, 0]
    local[:, 0, :3, :3] = turn @ local[:, 0, :3, :3]
    local[:, 0, :3, 3] += np.stack([0.3 * np.sin(seconds), 0.02 * np.cos(11 * seconds), 0.9 * seconds], -1)
    out = np.zeros_like(local)
    for j, parent in enumerate(parents):
        out[:, j] = local[:, j] if parent < 0 else out[:, parent] @ local[:, j]
    return out.astype(np.float32)
