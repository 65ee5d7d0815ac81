"""The rows of the table: what each is, how it is trained, how it predicts.

A row's train() may be stopped and called again. Its load() gives a Model once training has ended,
None before. Rows that share a base of skinning stand together, so that clips are un-skinned once.
"""
import argparse
import copy
import json
import os
from dataclasses import dataclass
from typing import Callable, Optional

import torch

from .. import checkpoint, evaluate, export, fit_skeleton, loop, network, patch_cut, stages, train
from ..stages.skeleton_stage import SkeletonStage
from . import fit, sizes
from .recurrent_pose import RecurrentPose
from .static_pose import StaticPose
from .virtual_bones import VirtualBones


@dataclass
class Model:
    predict: Callable          # network.Pose -> positions [T, n, 3]
    parameters: int            # learned numbers that a run stores
    fits: dict                 # {fit: {"epochs", "best_epoch", "validation_mm", "minutes"}}
    minutes: Optional[float]   # of all fits; None where not recorded


def fits_of(histories, names):
    """What the histories of some fits say; a fit that was not run is left out."""
    out = {}
    for name in names:
        if name in histories:
            history = histories[name]
            best = loop.kept(history)
            out[name] = {"epochs": history[-1]["epoch"], "best_epoch": best["epoch"],
                         "validation_mm": round(best["validation_mm"], 3),
                         "minutes": history[-1].get("minutes")}
    return out


def total_minutes(fits):
    """Minutes of all fits, or None where one does not tell."""
    minutes = [f["minutes"] for f in fits.values()]
    return round(sum(minutes), 2) if minutes and None not in minutes else None


def names_up_to(last):
    return [step for stage in stages.up_to(last) for step in stage.steps]


@dataclass
class Row:
    key: str
    title: str
    group: str     # "scale", "ours", "patches", "ablation", "control" or "family"
    note: str

    def runs(self, scene):
        """The trained model, a path, whose weights the row runs; None where it trains its own."""

    def folder(self, scene):
        """Of its weights, below --out."""
        return self.key

    def lacks(self, scene):
        """Why there is no such row, in words; None where there is one."""

    def train(self, scene, folder):
        """Nothing to do unless a subclass says otherwise."""


@dataclass
class Skinned(Row):
    """The template by linear blend skinning, nothing learned."""
    base: str = "plain"

    def load(self, scene, folder):
        weights = scene.base(self.base).initial_weights
        return Model(lambda pose: evaluate.skinned(scene.net, scene.rig, pose, weights), 0, {}, 0.0)


@dataclass
class Full(Row):
    """The full model up to a stage."""
    stages: str = "mesh"

    def runs(self, scene):
        return scene.full

    def lacks(self, scene):
        return "the full model has no such stage" if getattr(scene.net, self.stages) is None else None

    def load(self, scene, folder):
        fits = fits_of(scene.histories, names_up_to(self.stages))
        minutes = total_minutes(fits)
        if minutes is None and self.stages == scene.net.last_stage():
            minutes = scene.provenance.get("minutes")
        return Model(lambda pose: scene.net.run(pose, self.stages),
                     sizes.of_network(scene.net, self.stages), fits, minutes)


@dataclass
class Frozen(Row):
    """Trained as the full model was, with a part of stage 1 left as it starts."""
    frozen: Optional[str] = "weights"
    stages: Optional[str] = "static"    # None: as many as the full model has

    def folder(self, scene):
        # Both rows of a part share one: the longer training goes on from the shorter one's.
        return f"{self.frozen}_frozen"

    def last(self, scene):
        return self.stages or scene.net.last_stage()

    def train(self, scene, folder):
        scene.release()
        options = argparse.Namespace(**vars(scene.options))
        options.out, options.freeze, options.stages = folder, self.frozen, self.last(scene)
        with loop.limited(scene.minutes):
            train.run(options)

    def load(self, scene, folder):
        saved = checkpoint.load(os.path.join(folder, fit.MODEL))
        last = self.last(scene)
        reached = json.loads(saved["options"])["stages"] if saved else stages.FIRST.name
        if not saved or stages.NAMES.index(reached) < stages.NAMES.index(last):
            return None
        net = export.load_trained(folder, scene.data)[0].float()
        with open(os.path.join(folder, "log.json")) as file:
            fits = fits_of(json.load(file)["histories"], names_up_to(last))
        return Model(lambda pose: net.run(pose, last), sizes.of_network(net, last, self.frozen),
                     fits, total_minutes(fits))


@dataclass
class Patches(Frozen):
    """Patches in place of stages 2 and 3: those of --patches, or trained here with the full model's options."""
    frozen: Optional[str] = None
    stages: Optional[str] = "patch"

    def folder(self, scene):
        return self.key

    def runs(self, scene):
        return scene.patches

    def lacks(self, scene):
        if scene.patches is None:
            try:
                patch_cut.limbs_of(scene.character)
            except ValueError as error:
                return str(error)
        return None

    def load(self, scene, folder):
        if scene.patches is None:
            return super().load(scene, folder)
        net, histories, provenance = scene.load_patches()
        fits = fits_of(histories, names_up_to("patch"))
        return Model(lambda pose: net.run(pose, "patch"), sizes.of_network(net, "patch"), fits,
                     total_minutes(fits) or provenance.get("minutes"))


@dataclass
class SameBudget(Row):
    """Stage 2 trained again on the full model's stage 1: the families' budget and windows (no drapes)."""

    def runs(self, scene):
        return scene.full

    def folder(self, scene):
        return f"{self.key}_{scene.full_digest[:8]}"

    def train(self, scene, folder):
        training, validation = scene.prepared("stage 1", scene.net.static)
        torch.manual_seed(scene.options.seed)
        skeleton = SkeletonStage(len(scene.net.static.template), len(scene.standardise.mean),
                                 scene.options.skeleton_size)
        plain = copy.copy(scene.options)
        plain.settle_epochs = 0      # families have no such phase
        with loop.limited(scene.minutes):
            history = fit_skeleton.train(skeleton, scene.net.static, scene.standardise, training,
                                         validation, [], plain, folder, scene.log)
        checkpoint.save(os.path.join(folder, fit.MODEL),
                        {"state": skeleton.state_dict(), "history": history})

    def load(self, scene, folder):
        saved = checkpoint.load(os.path.join(folder, fit.MODEL))
        if saved is None:
            return None
        skeleton = SkeletonStage(len(scene.net.static.template), len(scene.standardise.mean),
                                 scene.options.skeleton_size)
        skeleton.load_state_dict(saved["state"])
        net = network.DCloth(scene.standardise, scene.net.static, skeleton).eval()
        fits = {**fits_of(scene.histories, names_up_to("static")),
                **fits_of({"skeleton": saved["history"]}, ["skeleton"])}
        return Model(lambda pose: net.run(pose, "skeleton"), sizes.of_network(net, "skeleton"), fits,
                     total_minutes(fits))


@dataclass
class Other(Row):
    """One of the re-implemented families."""
    kind: type = None

    def train(self, scene, folder):
        fit.save(folder, *fit.train(self.kind, scene, folder, self.key))

    def load(self, scene, folder):
        d, n = len(scene.standardise.mean), len(scene.net.static.template)
        found = fit.restore(self.kind, folder, d, scene.options)
        if found is None:
            return None
        family, history = found
        base, fits = scene.base(self.kind.BASE), fits_of({self.key: history}, [self.key])
        return Model(lambda pose: fit.positions(family, base, scene.standardise, pose),
                     self.kind.learned(d, n, family.sizes), fits, total_minutes(fits))


ROWS = (
    Skinned("rigid_hips", "rigid hips", "scale", "the template fixed to the hips", "hips"),
    Skinned("plain", "plain skinning", "scale", "nearest-point weights, bound pivots"),
    Frozen("no_pivots", "stage 1 without pivot increments", "ablation",
           "weights learned, pivots where they were bound", "pivots"),
    Frozen("fixed_weights", "stage 1 with fixed weights", "ablation",
           "pivots learned, nearest-point weights", "weights"),
    *(Full(stage.title.replace(" ", "_").replace("-", "_"), stage.title, "ours", stage.note, stage.name)
      for stage in stages.up_to(stages.LAST.name)),
    Patches("patches", "stage 1 and patches", "patches", "strips of cloth that see themselves and the limbs"),
    Frozen("full_fixed_weights", "full with fixed weights", "ablation",
           "every stage trained on nearest-point weights", "weights", None),
    SameBudget("same_budget", "stages 1-2, budget of the families", "control",
               "stage 2 trained again beside them, on the full model's stage 1"),
    Other("static_pose", "static pose-space network", "family",
          "MLP to a displacement basis on plain skinning (PBNS, CTSN)", StaticPose),
    Other("recurrent_pose", "recurrent pose-space network", "family",
          "GRU to a displacement basis on plain skinning (NeuralClothSim, SNUG)", RecurrentPose),
    Other("virtual_bones", "virtual bones", "family",
          "GRU to rigid bones inside the cloth, learned skinning (Pan et al. 2022)", VirtualBones),
)
