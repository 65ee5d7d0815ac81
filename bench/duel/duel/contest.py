"""Who takes part, with which settings; how a clip is played, and what a play is worth."""
import dataclasses
import json
import os
import subprocess

import numpy as np

from dcloth_training import evaluate, metrics, safetensors_io, sequence

BUDGETS = (0.1, 0.25, 0.5, 1.0)      # ms a frame at 60 Hz
SIZES = (250, 500, 1000, 2000)       # vertices of a proxy, about
HZ = 60
AFTER = 1.0                          # s after an event that count
TITLES = {"jolt": "Jolt soft body", "solver": "training solver, cut down", "springs": "spring bones",
          "dcloth": "dcloth, contact off", "contact": "dcloth, contact on"}
OURS = ("dcloth", "contact")
# A 60 Hz frame of the training solver: small steps, passes over the springs in each.
STEPS = ((1, 1), (2, 1), (2, 4), (4, 2), (8, 4))
TUNED = os.path.join(os.path.dirname(__file__), "..", "tuned.json")


@dataclasses.dataclass(frozen=True)
class Entry:
    """One contestant: its method, its file, its settings."""
    name: str
    method: str
    file: str
    settings: tuple = ()

    def play(self, **changed):
        values = {**dict(self.settings), **changed}
        return ",".join([self.name, self.method, str(self.file), *(f"{k}={v:g}" for k, v in values.items())])


def all_tuned(garment):
    """{"clips": names, method and size: settings} that tune.py chose; {} where it chose none."""
    with open(TUNED, encoding="utf-8") as file:
        return json.load(file).get(garment, {})


def tuned(garment, method):
    """The settings of one method."""
    return all_tuned(garment).get("settings", {}).get(method, {})


def entries(garment, cases, models, jolt, quick=False):
    """Every Entry. cases {size: file}, models {precision: file}; jolt: it was built."""
    out, sizes = [], SIZES[:1] if quick else SIZES
    for size in sizes:
        if jolt:
            out += [Entry(f"jolt-{size}-{count}", "jolt", cases[size],
                          (("iterations", count), *tuned(garment, "jolt").items()))
                    for count in ((2,) if quick else (1, 2, 4, 8))]
        out += [Entry(f"solver-{size}-{steps}x{passes}", "solver", cases[size],
                      (("steps", steps), ("passes", passes), *tuned(garment, "solver").items()))
                for steps, passes in (STEPS[:1] if quick else STEPS)]
    for chains, bones in ((16, 4),) if quick else ((8, 3), (16, 4), (24, 6)):
        out.append(Entry(f"springs-{chains}x{bones}", "springs", cases[sizes[0]],
                         (("chains", chains), ("bones", bones), *tuned(garment, "springs").items())))
    for precision, model in models.items():
        for contact in (0, 1):
            out += [Entry(f"dcloth-{precision}{'-contact' * contact}{'' if spread else '-whole'}", "dcloth", model,
                          (("contact", contact), ("spread", spread))) for spread in ((1,) if quick else (1, 0))]
    out += [Entry("dcloth-static", "dcloth", next(iter(models.values())), (("level", 0), ("contact", 0)))]
    return out


def play(program, clip, plays, folder=None, rounds=1, hz=HZ, event="none"):
    """What dcloth_duel says of a Clip: {name: row}; positions go to `folder`."""
    command = [str(program), str(clip.path), "--rounds", str(rounds), "--hz", str(hz), "--event", event]
    command += ["--seconds", str(clip.seconds)]
    command += [word for one in plays for word in ("--play", one)] + (["-o", str(folder)] if folder else [])
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"{clip.path}: {done.stderr.strip()}")
    said = json.loads(done.stdout)
    return {row["name"]: {**row, "isa": said["isa"]} for row in said["rows"]}


class Clip:
    """A clip with its truth, its first `frames` at most, and what plays of it are measured by."""

    def __init__(self, path, bundle, mesh, frames=None):
        item = sequence.read(path)
        self.path, self.name = path, item.clip or str(path)
        self.item = dataclasses.replace(item, joint_matrices=item.joint_matrices[:frames], truth=item.truth[:frames])
        self.seconds = (len(self.item.truth) - 1) / item.fps
        tensors, metadata = bundle
        names = json.loads(metadata["joint_names"])
        self.matrices = self.item.joint_matrices[:, [self.item.joint_names.index(name) for name in names]]
        self.hips = self.matrices[:, names.index(metadata["hips"])]
        if self.item.truth.shape[1] != len(tensors["template.positions"]):
            raise ValueError(f"{path}: truth of {self.item.truth.shape[1]} vertices, the garment has "
                             f"{len(tensors['template.positions'])}")
        self.mesh, self.truth = mesh, metrics.Truth(self.item.truth, self.hips, mesh)

    def _whole(self, folder, name):
        """The play's positions [T, n, 3]: frame 0, which is not drawn, is the truth's."""
        found = safetensors_io.read(os.path.join(folder, name + ".safetensors"))[0]
        return found["positions"], np.rint(found["times"] * self.item.fps).astype(int)

    def error_mm(self, folder, name):
        """E_d in mm, the clip's first frames left out: one number by which settings are chosen."""
        positions, at = self._whole(folder, name)
        counted = at >= self.truth.first
        return float(metrics.distances_mm(positions[counted], self.item.truth[at[counted]]).mean())

    def measures(self, folder, name, referee):
        positions, at = self._whole(folder, name)
        whole = self.item.truth.copy()
        whole[at] = positions
        out = metrics.clip(whole, self.truth)
        if referee:
            out.update(referee.measures(whole, self.matrices))
        return out

    def after(self, folder, plain, name, seconds=AFTER):
        """What an event half through the clip did: mm to the same contestant's play without it (folder `plain`), mean
        of the next `seconds` and in the worst frame; strain p99 in the worst frame."""
        positions, at = self._whole(folder, name)
        calm, calm_at = self._whole(plain, name)
        half = half_frame(self.seconds) / HZ * self.item.fps
        both = np.intersect1d(at[(at >= half) & (at <= half + seconds * self.item.fps)], calm_at)
        ours, theirs = positions[np.isin(at, both)], calm[np.isin(calm_at, both)]
        apart = metrics.distances_mm(ours, theirs).mean(1)
        strain = np.percentile(self.mesh.strain(ours), 99, axis=1)
        return {"mean_mm": float(apart.mean()), "max_mm": float(apart.max()), "strain": float(strain.max())}


def half_frame(seconds):
    """The frame of the event, as dcloth_duel has it."""
    return 2 * round(0.25 * seconds * HZ)


def hitch_ms(row, clip):
    """Thread time of the frame of the event."""
    return row["thread_ns"][min(half_frame(clip.seconds), len(row["thread_ns"]) - 1)] * 1e-6


def frames_ms(rows, key):
    """{p50, p99, max} in ms over the frames of plays [row of each clip]."""
    values = np.concatenate([np.asarray(row[key]) for row in rows]) * 1e-6
    p50, p99 = (float(np.percentile(values, q, method="inverted_cdf")) for q in (50, 99))
    return {"p50": p50, "p99": p99, "max": float(values.max())}


def mesh_of(bundle):
    """The metrics' Mesh of a bundle's garment."""
    tensors = bundle[0]
    return metrics.Mesh(tensors["template.faces"], tensors["template.positions"].astype(np.float64))


def referee_of(path):
    return evaluate.Referee(path)
