"""A character of the user's own: its skeleton by roles, its skin as a surface that cloth is kept out of.

`dcloth hero` reads the file (glTF, VRM, FBX) and names the joints' roles, as `dcloth dress` does. Here joints that no
garment needs (fingers, face) are merged into hand and head, and the skin of all meshes becomes one welded surface
without what is hidden inside of it. Motion is that of motion/skeleton.py: local rotations in frames that are aligned
with the world in the bind pose, here of the character's own joints, the hips first.
"""
import json
import os
import subprocess
from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from .. import safetensors_io
from ..figure import decimate
from ..motion.skeleton import Motion
from ..simulate import body as parts
from ..truth import animation
from ..truth.errors import TruthError, refuse

# Vertices of the skin; a model keeps cloth out of 8,192 near the garment.
MOST_VERTICES = 6000
WELD = 1e-5             # m between vertices that are one: a seam of the texture
HIDDEN = 0.001          # m outside of a face, from where it is looked whether the face lies inside of the body
_TRUNK = ("hips", "spine", "chest", "upper chest", "neck", "head", "left shoulder", "right shoulder")
# The role that moves each of body.PARTS, and its kin further down.
_PART_OF_ROLE = {**dict.fromkeys(_TRUNK, 0), **{
    f"{side} {role}": first + further
    for side, leg, arm in (("left", 1, 5), ("right", 3, 7))
    for first, roles in ((leg, (("upper leg", 0), ("lower leg", 1), ("foot", 1), ("toes", 1))),
                         (arm, (("upper arm", 0), ("lower arm", 1), ("hand", 1))))
    for role, further in roles}}
NEEDED = ("hips", "left upper leg", "right upper leg", "left lower leg", "right lower leg")
_ENDS = ("head", "left hand", "right hand", "left toes", "right toes")     # what is below is merged into them


@dataclass(frozen=True)
class Hero:
    """Metres, +Y up. vertices [b, 3], faces [f, 3] outward, weights [b, J] (rows sum to 1), names [J], parents [J] (-1:
    the hips, which are first), bind [J, 4, 4] with axes of length 1, roles {name of a role: joint}, owner [J]: the
    number of body.PARTS that each joint moves, path: its file."""
    path: str
    vertices: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    names: tuple
    parents: np.ndarray
    bind: np.ndarray
    roles: dict
    owner: np.ndarray

    @property
    def joints(self):
        return self.bind[:, :3, 3]

    @property
    def colours(self):
        return None

    @property
    def facing(self):
        """Rotation about +Y that turns +Z to where the character faces in its bind pose."""
        left = self.joints[self.roles["left upper leg"]] - self.joints[self.roles["right upper leg"]]
        angle = np.arctan2(-left[2], left[0])
        return np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])

    def matrices(self, motion):
        """World matrices [T, J, 4, 4], with the joints' own axes, of a Motion of these joints."""
        out = np.zeros((len(motion), len(self.names), 4, 4))
        out[..., 3, 3] = 1
        for j, above in enumerate(self.parents):
            if above < 0:
                out[:, j, :3, :3], out[:, j, :3, 3] = motion.local[:, j], motion.root
            else:
                out[:, j, :3, :3] = out[:, above, :3, :3] @ motion.local[:, j]
                out[:, j, :3, 3] = out[:, above, :3, 3] + out[:, above, :3, :3] @ (self.joints[j] - self.joints[above])
        out[..., :3, :3] = out[..., :3, :3] @ self.bind[:, :3, :3]
        return out

    def motion(self, world):
        """Motion of world matrices [T, J, 4, 4] of these joints: lengths of bones stay those of the bind pose."""
        turned = np.asarray(world, np.float64)[..., :3, :3] @ np.swapaxes(self.bind[:, :3, :3], 1, 2)
        left, _, right = np.linalg.svd(turned)
        turned = left @ right
        local = turned.copy()
        below = np.flatnonzero(self.parents >= 0)
        local[:, below] = np.swapaxes(turned[:, self.parents[below]], -1, -2) @ turned[:, below]
        return Motion(np.asarray(world[:, 0, :3, 3], np.float64), local)

    def rest(self, frames=1):
        """The bind pose as a Motion."""
        return Motion(np.repeat(self.joints[:1], frames, 0), np.tile(np.eye(3), (frames, len(self.names), 1, 1)))


def run_command(command, *arguments):
    result = subprocess.run([command, *map(str, arguments)], capture_output=True, text=True, check=False)
    if result.returncode:
        raise TruthError(result.stderr.strip().replace("dcloth: error: ", "") or f"{command} failed")
    return result


def _skeleton(path, names, parents, roles):
    """(columns kept, hips first; column of the file that each joint of the file is merged into; {role: joint of the
    file})."""
    depth = np.zeros(len(names), int)
    for j, above in enumerate(parents):
        depth[j] = depth[above] + 1 if above >= 0 else 0

    def ancestors(j):
        while j >= 0:
            yield j
            j = parents[j]

    found = {}
    for j in sorted(range(len(names)), key=lambda j: (depth[j], j)):
        if roles[j] != "none":
            found.setdefault(roles[j], j)
    missing = [role for role in NEEDED if role not in found]
    if missing:
        refuse(path, f"no joint of the name of {', '.join(missing)}", "a skeleton with hips and two legs",
               f"name them in a file, {{\"{missing[0]}\": \"node of the file\", ...}}, and give it with --map; the "
               f"file's joints are {', '.join(names[:80])}")
    legs = [set(ancestors(found[f"{side} upper leg"])) for side in ("left", "right")]
    of_hips = [j for j in legs[0] & legs[1] if roles[j] == "hips"]
    if not of_hips:
        refuse(path, f"hips '{names[found['hips']]}' that are not above both legs", "legs below the hips",
               'name the joint above both legs in the file of --map, {"hips": "..."}')
    found["hips"] = max(of_hips, key=lambda j: depth[j])
    ends = {found[role] for role in _ENDS if role in found}
    kept, into = [], np.full(len(names), -1)
    for j in sorted(range(len(names)), key=lambda j: (depth[j], j)):
        chain = list(ancestors(j))
        under_end = next((a for a in chain[1:] if a in ends), None)
        if found["hips"] not in chain:
            into[j] = found["hips"]
        elif under_end is not None:
            into[j] = under_end
        else:
            into[j] = j
            kept.append(j)
    return kept, into, {role: j for role, j in found.items() if into[j] == j}


def _pieces(count, faces):
    """Number [count] of the connected piece of each vertex."""
    a, b = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    links = scipy.sparse.csr_matrix((np.ones(len(a), bool), (a, b)), (count, count))
    return scipy.sparse.csgraph.connected_components(links, directed=False)[1]


def surface(vertices, faces, weights, most=MOST_VERTICES):
    """One surface out of a character's meshes: seams welded, pieces turned outward, faces that lie inside of the body
    left out, at most about `most` vertices. -> vertices, faces, weights, what was done in words. libigl finds what is
    inside."""
    import igl

    _, first, number = np.unique(np.round(vertices / WELD).astype(np.int64), axis=0, return_index=True,
                                 return_inverse=True)
    vertices, weights = vertices[first], weights[first]
    faces = number.reshape(-1)[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    faces = faces[np.sort(np.unique(np.sort(faces, 1), axis=0, return_index=True)[1])]
    piece = _pieces(len(vertices), faces)[faces[:, 0]]
    corner = vertices[faces]
    volume = np.bincount(piece, np.einsum("ij,ij->i", corner[:, 0] - corner.mean((0, 1)),
                                          np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])))
    inward = volume[piece] < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    faces, corner, normal = (a[length[:, 0] > 1e-12] for a in (faces, corner, normal / np.maximum(length, 1e-12)))
    outside = corner.mean(1) + HIDDEN * normal
    winding = igl.fast_winding_number(vertices, np.ascontiguousarray(faces, np.int64), np.ascontiguousarray(outside))
    hidden = winding > 0.5
    faces = faces[~hidden]
    used, faces = np.unique(faces, return_inverse=True)
    vertices, weights, faces = vertices[used], weights[used], faces.reshape(-1, 3)
    told = f"{len(vertices):,} vertices when welded, {hidden.sum():,} hidden faces left out"
    if len(vertices) > most:
        vertices, faces, weights = _coarser(vertices, faces, weights, most)
        told += f", {len(vertices):,} when made coarser"
    return vertices, faces.astype(np.int32), weights, told


def _coarser(vertices, faces, weights, most):
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    border = np.zeros(len(vertices), bool)
    border[edges[uses != 2]] = True
    corner = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    size = np.full(len(vertices), 1.07 * np.sqrt(area / most))
    kept, faces = decimate.collapse(vertices, faces, size, 0.25 * size, border, np.zeros(len(vertices), int), most,
                                    strictly=False)
    number = np.full(len(vertices), -1)
    number[kept] = np.arange(len(kept))
    return vertices[kept], number[faces], weights[kept]


def of_tensors(path, tensors, metadata, meshes=(), most=MOST_VERTICES):
    """Hero of what `dcloth hero` writes, and what was done to it in words. meshes: names of those that make the body;
    all when none."""
    names, parents, roles = (json.loads(metadata[key]) for key in ("joint_names", "parents", "roles"))
    held = json.loads(metadata["meshes"])
    absent = [mesh for mesh in meshes if mesh not in held]
    if absent:
        refuse(path, f"no skinned mesh '{absent[0]}'", f"some of {', '.join(held)}")
    kept, into, found = _skeleton(path, names, parents, roles)
    column = {j: k for k, j in enumerate(kept)}
    above = []
    for j in kept:
        a = parents[j]
        above.append(column.get(a, -1) if column[j] else -1)
    vertices, faces = tensors["body_vertices"].astype(np.float64), tensors["body_faces"].astype(np.int64)
    weights = np.zeros((len(vertices), len(kept)))
    joint_of = np.array([column[j] for j in into])
    for k in range(tensors["body_joints"].shape[1]):
        np.add.at(weights, (np.arange(len(vertices)), joint_of[tensors["body_joints"][:, k]]),
                  tensors["body_weights"][:, k].astype(np.float64))
    if meshes:
        chosen = np.isin(tensors["body_mesh"], [held.index(mesh) for mesh in meshes])
        faces = faces[chosen[faces].all(1)]
        used, faces = np.unique(faces, return_inverse=True)
        vertices, weights, faces = vertices[used], weights[used], faces.reshape(-1, 3)
    vertices, faces, weights, told = surface(vertices, faces, weights, most)
    bind = tensors["joint_bind"].astype(np.float64)[kept]
    bind[:, :3, :3] /= np.linalg.norm(bind[:, :3, :3], axis=1, keepdims=True)
    by_role = {role: column[j] for role, j in found.items()}
    owner, role_of = np.zeros(len(kept), int), {j: role for role, j in by_role.items()}
    for j in range(len(kept)):
        own = _PART_OF_ROLE.get(role_of.get(j))
        owner[j] = own if own is not None else owner[above[j]] if above[j] >= 0 else 0
    hero = Hero(path, vertices, faces, weights / weights.sum(1, keepdims=True), tuple(names[j] for j in kept),
                np.array(above), bind, by_role, owner)
    height = np.ptp(hero.vertices[:, 1])
    if not 0.5 < height < 4:
        refuse(path, f"a character {height:.3g} m tall", "0.5 to 4 m", "say the file's unit with --unit")
    return hero, f"{len(kept)} of {len(names)} joints, skin of {told}"


def unit_options(options):
    return [word for key in ("map", "unit", "up") if getattr(options, key, None)
            for word in (f"--{key}", getattr(options, key))]


def read(options, folder):
    """The Hero of options.character, read again where the file is newer: `folder`/hero.safetensors is what `dcloth
    hero` wrote of it."""
    if not os.path.isfile(options.character):
        refuse(options.character, "no such file", "a character: .glb, .gltf, .vrm or .fbx")
    path = os.path.join(folder, "hero.safetensors")
    if not os.path.exists(path) or os.path.getmtime(path) < os.path.getmtime(options.character):
        run_command(animation.find_command(options.dcloth), "hero", options.character, "-o", path,
                    *unit_options(options))
    return of_tensors(options.character, *safetensors_io.read(path), tuple(options.body_meshes or ()))


def part_names():
    """The parts of the body that cloth may touch, in the order of body.LIMB's numbers."""
    return ("trunk", "left leg", "right leg", "left arm", "right arm")


assert len(set(_PART_OF_ROLE.values())) == len(parts.PARTS)
