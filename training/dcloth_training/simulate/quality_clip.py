"""One file of ground truth: its figures and its strip of pictures, kept until the file changes."""
import hashlib
import json
import os

import numpy as np

from .. import metrics, picture_file, safetensors_io, sequence
from ..motion import skeleton
from . import checks, render

VERSION = 2                   # of what is measured and drawn: older results are made anew
EVEN_PICTURES = 4
PICTURE_SIZE = 200
HIPS = "Hips"
# Pictured where there are any.
CROSSED = (("body_crossings_frame", "most crossings of the body"), ("cloth_crossings_frame", "most crossings of cloth"))
FOLDED = -0.5                 # cosine between neighbouring triangles' normals: bent by more than 120 degrees


def hinges(faces):
    """Pairs of triangles [h, 2] that share an edge."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(pairs.T)
    same = (pairs[order][1:] == pairs[order][:-1]).all(1)
    return np.stack([owner[order][:-1][same], owner[order][1:][same]], -1)


def folded(cloth, faces, pairs):
    """Share [T] of the edges at which the cloth is folded onto itself: crumpled or tangled cloth has many."""
    out = np.empty(len(cloth))
    for t, points in enumerate(cloth):
        a, b, c = (points[faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        out[t] = (np.einsum("ij,ij->i", normal[pairs[:, 0]], normal[pairs[:, 1]]) < FOLDED).mean()
    return out


def digest(path):
    """SHA-256 of a file, in pieces: a clip is 30 MB."""
    total = hashlib.sha256()
    with open(path, "rb") as file:
        for piece in iter(lambda: file.read(1 << 20), b""):
            total.update(piece)
    return total.hexdigest()


def measure(path, data, referee, every=1):
    """Figures of a file, its clip's name first, from every `every`-th frame; speed is None unless that is all of them.

    Between drapes, which are poses of their own, speed and motion mean nothing: None.
    """
    faces, count = referee.mesh.faces, len(referee.areas)
    if data.truth is None:
        raise ValueError(f"{path}: no tensor 'truth': not a file of ground truth")
    if data.truth.shape[1] != count:
        raise ValueError(f"{path}: {data.truth.shape[1]} cloth vertices, the character beside it has "
                         f"{count}: --data mixes two garments")
    dynamic = data.kind == "dynamic"
    at = np.arange(0, len(data.truth), every if dynamic else 1)
    cloth = data.truth[at]
    folds = folded(cloth, faces, hinges(faces))
    out = {"clip": data.clip, "frames": len(data.truth), **referee.clip(data.truth, data.joint_matrices, at),
           "folded_max": round(float(folds.max()), 5), "folded_max_frame": int(at[folds.argmax()]),
           "speed_max": None, "speed_mean": None, "speed_max_frame": None, "alive_mm": None, "fine_motion_mm": None}
    if dynamic:
        moving = at[at >= metrics.counted(len(data.truth))]
        hips = data.joint_matrices[moving, data.joint_names.index(HIPS) if HIPS in data.joint_names else 0]
        cloth = data.truth[moving].astype(np.float64)
        out.update(alive_mm=round(metrics.alive_mm(cloth, hips), 1),
                   fine_motion_mm=round(metrics.fine_motion_mm(cloth, hips, referee.mesh), 2))
    if dynamic and every == 1:
        speed = np.linalg.norm(np.diff(data.truth, axis=0), axis=-1) * skeleton.FPS
        out.update(speed_max=round(float(speed.max(initial=0)), 2),
                   speed_mean=round(float(speed.mean()) if speed.size else 0.0, 3),
                   speed_max_frame=int(speed.max(1).argmax()) + 1 if speed.size else 0)
    return {**out, "sha256": digest(path)}


def pictured(figures):
    """[(frame, what it shows)] of a clip's strip: evenly spaced frames, then those that stand out."""
    out = {int(f): "" for f in np.linspace(0, figures["frames"] - 1, EVEN_PICTURES)}
    for key, word in (("stretch_max_frame", "most stretched"), ("folded_max_frame", "most folded"),
                      ("speed_max_frame", "fastest"), *CROSSED):
        if figures.get(key) is not None and figures.get(key.replace("_frame", "_max"), 1):
            before = out.pop(figures[key], "")
            out[figures[key]] = f"{before}, {word}" if before else word
    return list(out.items())


class Work:
    """What is made of one file of ground truth, kept in `folder` until the file or the character changes.

    Called with a path it measures; draw() adds the strip of pictures. Goes to worker processes: keep it small.
    """

    def __init__(self, character_path, folder, every):
        self.character_path, self.folder, self.every = character_path, folder, every
        self._character = self._referee = None

    def __getstate__(self):
        return {**self.__dict__, "_character": None, "_referee": None}

    def character(self):
        if self._character is None:
            self._character, _ = safetensors_io.read(self.character_path)
        return self._character

    def referee(self):
        if self._referee is None:
            try:
                self._referee = checks.Referee.of_character(self.character())
            except KeyError as error:
                raise ValueError(f"{self.character_path}: no tensor {error}: not a character with its body") from None
        return self._referee

    def stem(self, path):
        """Where the results of a file lie, without their suffix."""
        return os.path.join(self.folder, os.path.splitext(os.path.basename(path))[0])

    def _source(self, path):
        stamps = [os.stat(p) for p in (path, self.character_path)]
        return {"version": VERSION, "files": [[s.st_size, s.st_mtime_ns] for s in stamps]}

    def _kept(self, path):
        """The results of an earlier run, or {}: not measured yet, or since then changed."""
        try:
            with open(self.stem(path) + ".json") as file:
                kept = json.load(file)
            return kept if kept["source"] == self._source(path) and kept["every"] <= self.every else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def _keep(self, path, kept):
        part = self.stem(path) + ".json.part"
        with open(part, "w") as file:
            json.dump({**kept, "source": self._source(path)}, file)
        os.replace(part, part[:-len(".part")])

    def __call__(self, path):
        kept = self._kept(path)
        if not kept:
            kept = {"every": self.every, "drawn": False,
                    "figures": measure(path, sequence.read(path), self.referee(), self.every)}
            self._keep(path, kept)
        return kept["figures"]

    def drawn(self, path):
        """Whether a file's strip is there and shows the file as it is."""
        return bool(self._kept(path).get("drawn")) and os.path.exists(self.stem(path) + ".png")

    def draw(self, path):
        """The strip of a measured file."""
        if self.drawn(path):
            return
        kept, data = self._kept(path), sequence.read(path)
        frames = pictured(kept["figures"])
        image = render.contact_sheet(self.character(), data.joint_matrices, data.truth, [f for f, _ in frames],
                                     len(frames), PICTURE_SIZE)
        picture_file.save(self.stem(path) + ".png", image,
                          render.captions([f"{f} {what}" for f, what in frames], len(frames), PICTURE_SIZE))
        self._keep(path, {**kept, "drawn": True})
