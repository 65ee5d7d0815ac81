"""Clips for a character of the user's own: files that `dcloth` brings onto it, and what is scripted in
motion/procedural.py.

On the command line `procedural/NAME` is scripted; all else is a clip of the character's own file, by name or number, or
a file such as walk.fbx or clips.glb#Run. Its name is then `walk` or `clips-Run`; `<clip>@<frame>` is the piece from
that frame.
"""
import json
import os

import numpy as np

from .. import safetensors_io
from ..motion import bvh, clearance, retarget, rotations, skeleton, timing
from ..motion.skeleton import INDEX, Motion
from ..simulate import clips
from ..truth import animation
from ..truth.errors import refuse
from . import hero as heroes

MAX_FRAMES = 300
LOOP_FRAMES = 75          # shorter clips are repeated until they last so long
EASE_FRAMES = 12
SPINE = ("Spine", "Spine1", "Spine2")
# Roles that turn as the figure's joint of that name does; a limb's bone also comes to point where the figure's points.
_LIKE = {"neck": "Neck", "head": "Head"}
_LIMBS = {}
for _side in ("left", "right"):
    for _role, _name, _next in (("shoulder", "Shoulder", None), ("upper arm", "Arm", "lower arm"),
                                ("lower arm", "ForeArm", "hand"), ("hand", "Hand", None),
                                ("upper leg", "UpLeg", "lower leg"), ("lower leg", "Leg", "foot"),
                                ("foot", "Foot", None), ("toes", "ToeBase", None)):
        _LIKE[f"{_side} {_role}"] = _side.capitalize() + _name
        if _next:
            _LIMBS[f"{_side} {_role}"] = f"{_side} {_next}"


def _between(a, b):
    """Smallest rotation that turns direction a to b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine < 1e-9:
        return np.eye(3)
    return rotations.matrix_from_vector(axis / sine * np.arctan2(sine, a @ b))


def onto_hero(motion, hero):
    """A Motion of our figure as one of the character's joints: bones point where the figure's do, the trunk's turn is
    shared by the joints of its spine, the hips' way is scaled by the length of the legs."""
    world = skeleton.joint_matrices(motion)[:, :, :3, :3]
    back = hero.facing.T
    turned = {0: world[:, 0]}
    by_role = hero.roles
    top = next((by_role[role] for role in ("neck", "head", "left shoulder", "left upper arm") if role in by_role), 0)
    chain, at = [], hero.parents[top]
    while at > 0:
        chain.insert(0, at)
        at = hero.parents[at]
    if chain:
        whole = np.swapaxes(world[:, 0], 1, 2) @ world[:, INDEX[SPINE[-1]]]
        share = retarget.split(whole, len(chain))
        for above, joint in zip([0, *chain], chain):
            turned[joint] = turned[above] @ share
    figure_bones = {"left upper arm": [1, 0, 0], "left lower arm": [1, 0, 0], "right upper arm": [-1, 0, 0],
                    "right lower arm": [-1, 0, 0]}
    for role, name in _LIKE.items():
        if role not in by_role:
            continue
        joint, straight = by_role[role], np.eye(3)
        following = by_role.get(_LIMBS.get(role))
        if following is not None:
            own = back @ (hero.joints[following] - hero.joints[joint])
            straight = _between(own, np.array(figure_bones.get(role, [0, -1.0, 0]), float))
        elif role.endswith("hand"):
            lower = by_role[role.replace("hand", "lower arm")]
            straight = _between(back @ (hero.joints[joint] - hero.joints[lower]),
                                np.array(figure_bones[role.replace("hand", "lower arm")], float))
        turned[joint] = world[:, INDEX[name]] @ straight
    local = np.tile(np.eye(3), (len(motion), len(hero.names), 1, 1))
    absolute = np.empty_like(local)
    for joint, above in enumerate(hero.parents):
        mine = turned.get(joint)
        absolute[:, joint] = mine @ back if mine is not None else absolute[:, above] if above >= 0 else np.eye(3)
        own = absolute[:, joint]
        local[:, joint] = np.swapaxes(absolute[:, above], 1, 2) @ own if above >= 0 else own
    legs = [np.linalg.norm(hero.joints[by_role[f"{side} lower leg"]] - hero.joints[by_role[f"{side} upper leg"]])
            for side in ("left", "right")]
    scale = np.mean(legs) / skeleton.THIGH_LENGTH
    root = scale * (motion.root - [0, skeleton.HIP_HEIGHT, 0]) + [0, hero.joints[0, 1], 0]
    return Motion(root, local)


def label(word):
    """The name of a clip: "walk" of walk.fbx or of the character's own clip, "clips-Run" of clips.glb#Run."""
    path, _, inside = word.partition("#")
    stem = os.path.splitext(os.path.basename(path))[0] if os.path.splitext(path)[1] else os.path.basename(path)
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in stem + (f"-{inside}" if inside else ""))


class Clips:
    """What --clips may name for this character: loads Motions, each at the origin and eased in."""

    def __init__(self, options, hero, folder):
        self.options, self.hero, self.folder = options, hero, folder
        self.words = {}     # name of a clip -> what the command line calls it
        self.cut = {}       # that word -> names of its pieces
        names = json.loads(safetensors_io.read(os.path.join(folder, "hero.safetensors"))[1]["joint_names"])
        self.kept = np.array([names.index(name) for name in hero.names])

    def _sampled(self, name):
        """Motion of a file's clip, by way of `dcloth hero --animation`, kept in folder/poses. Recorded clips of 15
        joints (motion/retarget.py) come by way of our figure."""
        if self.words[name].lower().endswith(".bvh") and os.path.isfile(self.words[name]):
            try:
                return onto_hero(clearance.clear(bvh.read_motion(self.words[name])), self.hero)
            except bvh.BvhError:    # of another skeleton
                pass
        path = os.path.join(self.folder, "poses", name + ".safetensors")
        if not os.path.exists(path):
            os.makedirs(os.path.dirname(path), exist_ok=True)
            heroes.run_command(animation.find_command(self.options.dcloth), "hero", self.options.character, "-o", path,
                               "--animation", self.words[name], "--fps", f"{skeleton.FPS:g}",
                               *heroes.unit_options(self.options))
        matrices = safetensors_io.read(path)[0]["joint_matrices"].astype(np.float64)
        return self.hero.motion(matrices[:, self.kept])

    def pieces(self, word):
        """Names of the clips that a word of --clips stands for; long clips are cut into pieces, which may be named,
        too."""
        if word not in self.cut:
            self.cut[word] = self._pieces(word)
        return self.cut[word]

    def _pieces(self, word):
        if word.startswith("procedural/") or any(word in names for names in self.cut.values()):
            return [word]
        if word in ("procedural", "random"):
            return clips.group(word)
        name = label(word)
        if self.words.setdefault(name, word) != word:
            refuse(word, f"a second clip '{name}'", f"a name of its own beside {self.words[name]}", "rename the file")
        length = len(self._sampled(name))
        if length <= MAX_FRAMES + MAX_FRAMES // 3:
            return [name]
        return [f"{name}@{first}" if first else name
                for first in range(0, max(1, length - MAX_FRAMES // 3), MAX_FRAMES)]

    def load(self, name):
        if name.startswith("procedural/"):
            return onto_hero(clips.load(name), self.hero)
        base, mark, first = name.rpartition("@")
        base, first = (base, int(first)) if mark and first.isdigit() else (name, 0)
        motion = timing.to_origin(self._sampled(base)[first:first + MAX_FRAMES + MAX_FRAMES // 3])
        if len(motion) == MAX_FRAMES + MAX_FRAMES // 3:     # another piece follows
            motion = motion[:MAX_FRAMES]
        if 2 < len(motion) < LOOP_FRAMES:
            motion = timing.loop(motion, LOOP_FRAMES)
        return timing.ease_in(motion, EASE_FRAMES)
