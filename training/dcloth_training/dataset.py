"""Clips for training: poses of every clip and its mirror image, residuals in template space.

Layout of the folder: character.safetensors, dynamic/*.safetensors, static/*.safetensors. The
held-out clips are never read here. A clip and its mirror image have one float16 residual [T, n, 3] each
(48 kB a frame at n = 7,952; rounded by 0.1 mm at most where it is 0.4 m), in memory or in files.
"""
import glob
import os
import re
from dataclasses import dataclass
from typing import Optional

import numpy as np
import torch

from . import body_planes, features, network, sequence, unskin, unskinned

HELD_OUT = ("procedural/demo_walk_turn", "procedural/demo_sway_spin", "mocap/run",
            "game/game_walking_b", "mocap/dance_a", "mocap/long_walk1",
            "procedural/demo_run_stop", "procedural/demo_jump_spin")
# For the final figures alone: people of whom nothing is trained on and nothing is chosen with.
REPORTED = ("evaluation/dance", "evaluation/dance001", "evaluation/indian_dance_odissi005", "evaluation/heiansyodan",
            "evaluation/mawashigeri", "child/8_walk", "child/8_skipping", "child/8_silly_walk", "child/8_jumping",
            "child/8_belle_dance001")
# Taken from the training clips to choose when to stop; each has relatives left in training.
VALIDATION = ("mocap/walk", "procedural/hula_twist", "mocap/stealthy_walk")
# Takes of a person of whom nothing is trained on: they choose when to stop as well.
VALIDATION_TAKES = tuple(f"child/8_{name}" for name in (
    "belle002", "catch001", "dab", "mermaid", "pick_up", "robot", "wave_hello", "zombie"))
# Subjects of the CMU Graphics Lab motion capture database who validate; a file's name begins with its subject.
VALIDATION_SUBJECTS = ("002", "008", "061", "131")
_SUBJECT = re.compile(r"(?:cmu_db|validation)/cmu(\d{3}|[a-z])")


def subject(clip):
    """The CMU database's number of who moves in a clip, a letter where the database names nobody; None elsewhere."""
    found = _SUBJECT.match(clip)
    return found[1] if found else None


def source(clip):
    """"scripted" or "recorded": where a clip's motion is from. The two are never averaged together."""
    return "scripted" if clip.startswith("procedural/") else "recorded"


def role(clip):
    """"reported", "validation", "development" or "training": what a clip (or a variation or excerpt of it) is for."""
    name = clip.partition("~")[0].partition("@")[0]
    if name in REPORTED:
        return "reported"
    if name in VALIDATION or name.startswith(("child/8_", "validation/")) or subject(name) in VALIDATION_SUBJECTS:
        return "validation"
    return "development" if name in HELD_OUT or name.startswith("evaluation/") else "training"


def clip_names(text):
    """Those of a comma separated list."""
    return tuple(name for name in text.split(",") if name)


def held_out(provenance):
    """Clips that a network's training never read, as its provenance says; HELD_OUT where it says nothing."""
    return tuple(provenance.get("held_out_clips", HELD_OUT))


# What stage 2 reads every epoch is a quarter of the vertices, 12 kB a frame: 100,000 frames and their mirror images
# are 2.4 GB in memory, where all vertices would be read from disk again and again.
SAMPLE_EVERY = 4


@dataclass
class Clip:
    name: str
    path: str
    mirrored: bool
    pose: network.Pose                       # float32
    rate: float                              # Hz
    residual: Optional[np.ndarray] = None    # [T, n, 3] template space, float16, after unskin
    sample: Optional[np.ndarray] = None      # [T, n / SAMPLE_EVERY, 3] of it, in memory
    planes: Optional[np.ndarray] = None      # body_planes of sampled vertices
    coarse: Optional[tuple] = None           # stage 2: coefficients [T, R], basis [R, n, 3] shared by all clips

    def __len__(self):
        return len(self.pose)

    def wanted(self, ticks=slice(None), vertices=None):
        """Residual [t, v, 3] float32 of some ticks and vertices (slices or indices)."""
        part = self.residual[ticks]
        if vertices is not None:
            part = part[:, vertices] if isinstance(vertices, slice) else part.take(vertices, 1)
        return part.astype(np.float32)

    def remainder(self, ticks, vertices):
        """What stage 2 leaves of the residual, [t, v, 3] float32, or [v, 3] of one tick."""
        wanted = self.residual[ticks]
        wanted = wanted[..., vertices, :] if isinstance(vertices, slice) else wanted.take(vertices, -2)
        wanted = wanted.astype(np.float32)
        if self.coarse is None:     # fit_skeleton.subtract has been here
            return wanted
        coefficients, basis = self.coarse
        columns = basis[:, vertices].reshape(len(basis), -1)
        return wanted - (coefficients[ticks] @ columns).reshape(wanted.shape)

    def sampled(self, ticks, rows):
        """Residual [t, v, 3] float32 of sampled vertices: SAMPLE_EVERY * rows."""
        if self.sample is None:
            self.sample = np.ascontiguousarray(self.residual[:, ::SAMPLE_EVERY])
        return self.sample[ticks].take(rows, 1).astype(np.float32)


    def planes_at(self, ticks, rows):
        """Planes [t, v, 4] float32 of the sampled vertices `rows`, zero in frames and at vertices without one."""
        ticks, every = np.arange(len(self))[ticks], -(-len(self) // len(self.planes))
        found = self.planes[ticks // every].take(rows, 1).astype(np.float32)
        found[ticks % every != 0] = 0
        return found


def planes_of(clips, ticks, rows):
    """planes_at [B, t, v, 4] of some clips, each at its ticks; None where they have none."""
    if any(clip.planes is None for clip in clips):
        return None
    return torch.from_numpy(np.stack([clip.planes_at(of_clip, rows) for clip, of_clip in zip(clips, ticks)]))


def load_pose(item, rig, joint_mirror, mirrored):
    matrices, wind = item.joint_matrices.astype(np.float64), item.wind
    if mirrored:
        matrices, wind = features.mirror_pose(matrices, joint_mirror), features.mirror_wind(wind)
    return network.pose_of(matrices, rig, torch.float32, wind=wind)


def load_truth(path, mirrored, vertex_mirror):
    """World positions [T, n, 3] float32."""
    truth = sequence.read(path).truth.astype(np.float32)
    return features.mirror_cloth(truth, vertex_mirror) if mirrored else truth


def _stems(name):
    """File names of a clip: an import keeps a take's ~2, simulate/clips.py (file_stem) writes -take2."""
    stem = name.replace("/", "-").replace("@", "-from")
    return stem, stem.replace("~", "-take")


def path_of(folder, name):
    """Where a dynamic clip of that name lies."""
    paths = [os.path.join(folder, "dynamic", stem + ".safetensors") for stem in _stems(name)]
    return next((path for path in paths if os.path.exists(path)), paths[0])


def _apart(stem):
    """Is this the file of a clip that is for measuring alone: reported, or of people under unknown terms?"""
    whole = re.split("-from|-take|~", stem)[0]
    return stem.startswith("evaluation-") or whole in {_stems(name)[0] for name in REPORTED}


def find(folder, kind, exclude=()):
    """Paths to learn from and choose with, of a kind ("dynamic" or "static"), sorted, without excluded clip names.

    Clips for the final figures (REPORTED) and those in evaluation/ are never among them.
    """
    left_out = {stem for name in exclude for stem in _stems(name)}
    paths = sorted(glob.glob(os.path.join(folder, kind, "*.safetensors")))
    stems = [os.path.splitext(os.path.basename(path))[0] for path in paths]
    return [path for path, stem in zip(paths, stems) if stem not in left_out and not _apart(stem)]


def check(item, path, rig, character):
    """Refuses a clip of another character, garment or rate, or without its cloth."""
    if list(item.joint_names) != list(rig.joint_names):
        raise ValueError(f"{path}: joints {', '.join(item.joint_names)}; allowed are those of character.safetensors in "
                         f"its order, {', '.join(rig.joint_names)}")
    if item.truth is None:
        raise ValueError(f"{path}: no truth; a clip for training holds the cloth of every frame")
    if item.truth.shape[1] != len(character.template):
        raise ValueError(f"{path}: {item.truth.shape[1]} cloth vertices; the garment of character.safetensors has "
                         f"{len(character.template)}")
    if abs(item.fps - rig.rate) > 1e-6:
        raise ValueError(f"{path}: {item.fps} frames/s, expected {rig.rate}")


def load(paths, rig, character):
    """Every clip and, where the character has one, its mirror image, without residuals."""
    clips = []
    for path in paths:
        item = sequence.read(path)
        check(item, path, rig, character)
        for mirrored in (False, True) if character.mirror is not None else (False,):
            clips.append(Clip(item.clip, path, mirrored,
                              load_pose(item, rig, character.joint_mirror, mirrored), rig.rate))
    return clips


def add_residuals(clips, static, standardise, character, folder=None):
    """Fill clip.residual: the truth un-skinned by the frozen static stage, less the template.

    folder: keep residuals in files there and map them, for data larger than memory and for resumed runs.
    """
    store = unskinned.Store(folder, static, standardise) if folder else None
    for clip in clips:
        def unskin_clip(clip=clip):
            truth = load_truth(clip.path, clip.mirrored, character.mirror)
            return unskin.residual(static, standardise, clip.pose, truth)
        if clip.residual is None:
            clip.sample = None
            clip.residual = store.residual(clip, unskin_clip) if store else unskin_clip().astype(np.float16)


def add_planes(clips, character, folder):
    """Fill clip.planes, from files in `folder` where they are there."""
    vertices = np.arange(0, len(character.template), SAMPLE_EVERY)
    for clip in clips:
        def make(clip=clip):
            read = sequence.read(clip.path)
            matrices = read.joint_matrices.astype(np.float64)
            if clip.mirrored:
                matrices = features.mirror_pose(matrices, character.joint_mirror)
            every = 1 if read.kind == "static" else body_planes.EVERY       # drapes are single frames
            truth = load_truth(clip.path, clip.mirrored, character.mirror)
            return body_planes.planes(matrices, truth, character, vertices, every)
        if clip.planes is None:
            clip.planes = unskinned.kept(folder, clip, make)


def split(clips, validation):
    """(training, validation) clips by name; mirror images stay with their clip. A take's name means all its pieces.

    Clips of people who validate (role) are not trained on, whether they are named or not. A clip for the final figures
    alone is refused.
    """
    refuse_reported({c.name for c in clips} | set(validation))
    chosen = [c for c in clips if named(c.name, validation)]
    return [c for c in clips if not named(c.name, validation) and role(c.name) != "validation"], chosen


def named(clip, names):
    """Is a clip, the take that it is a piece of, or its whole group ("validation/") among the names?"""
    return clip in names or clip.partition("@")[0] in names or clip.partition("/")[0] + "/" in names


def refuse_reported(names):
    """Ends with an error if a clip for the final figures is to be learned from or chosen with."""
    found = sorted(name for name in names if role(name) == "reported")
    if found:
        raise ValueError(f"clip '{found[0]}' is for the final figures alone: no network is trained on it or chosen by "
                         f"it; allowed are all clips but {', '.join(REPORTED)}")


WARM_UP = 12    # ticks in which a state from elsewhere cannot know how the cloth was moving


STILL_SHARE = 0.15    # drapes among the windows of an epoch


@dataclass
class Window:
    """`frames` consecutive ticks of one clip."""
    clip: Clip
    first: int
    warm_up: int     # leading ticks that do not count, since the cloth was already moving

    @property
    def fresh(self):
        """Begins where a garment begins: at rest, with a state of zero."""
        return self.first == 0

    def raw(self, frames):
        return self.clip.pose.x[self.first:self.first + frames].clone()

    def linear(self, frames):
        """R_j [frames, m, 3, 3]."""
        return self.clip.pose.linear[self.first:self.first + frames]

    def ticks(self, frames):
        return slice(self.first, self.first + frames)

    def wanted(self, frames, vertices):
        """Residual [frames, v, 3]."""
        return self.clip.wanted(self.ticks(frames), vertices)

    def sampled(self, frames, rows):
        """Residual [frames, v, 3] of sampled vertices."""
        return self.clip.sampled(self.ticks(frames), rows)

    def x(self, frames, reset=True, velocity=None):
        """Raw features; after a reset the hips' motion is unknown. velocity [3]: features.carried, root motion
        "hips"."""
        x = self.raw(frames)
        if velocity is not None and x.shape[1] % 9 == features.ROOT_NUMBERS["hips"]:
            x = torch.from_numpy(features.carried(x.numpy(), velocity, self.clip.rate))
            x[0, -4:-1] += torch.as_tensor(velocity, dtype=x.dtype)
        if reset and not self.fresh:
            features.begin(x, self.first_wind())
        return x

    def first_wind(self):
        """[3] of the first tick, in its heading frame, m/s; None where the pose does not know it."""
        wind = self.clip.pose.wind
        return None if wind is None else wind[self.first]


class Still(Window):
    """Pose `first` of a file of drapes, held: the cloth hangs, whatever it did before."""
    fresh = False

    def raw(self, frames):
        return features.at_rest(self.clip.pose.x[self.first].repeat(frames, 1))

    def first_wind(self):
        return torch.zeros(3)

    def linear(self, frames):
        return self.clip.pose.linear[self.first].expand(frames, -1, -1, -1)

    def ticks(self, frames):
        return np.full(frames, self.first)


class Held(Still):
    """Pose `first` of a motion, held. Where its cloth comes to rest is not known, so no tick counts (warm_up)."""


def windows(clips, frames, generator, drapes=(), held=False):
    """A random epoch of windows of `frames` ticks, about one for every `frames` of data.

    Half of the windows start with the clip, where the cloth rests as the network's zero state says.
    drapes: (clip, pose number) of quasi-static drapes; STILL_SHARE of the windows hold one.
    held: as many windows again hold a pose of the clips (Held).
    """
    out = []
    for clip in clips:
        if len(clip) < frames:
            continue
        for _ in range(max(1, round(len(clip) / frames))):
            last = len(clip) - frames
            first = int(torch.randint(0, last + 1, (1,), generator=generator))
            if torch.rand(1, generator=generator) < 0.5:
                first = 0
            out.append(Window(clip, first, WARM_UP if first else 0))
    stills = round(len(out) * STILL_SHARE / (1 - STILL_SHARE)) if len(drapes) else 0
    for which in torch.randint(0, max(1, len(drapes)), (stills,), generator=generator).tolist():
        out.append(Still(*drapes[which], WARM_UP))
    for which in torch.randint(0, max(1, len(clips)), (len(out) if held else 0,), generator=generator).tolist():
        first = int(torch.randint(0, len(clips[which]), (1,), generator=generator))
        out.append(Held(clips[which], first, frames))
    order = torch.randperm(len(out), generator=generator)
    return [out[i] for i in order]
