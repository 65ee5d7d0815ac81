"""The stages of the network, in the order in which they run and are trained.

Assembly, bundles, playing, evaluation, cards, comparison and training read STAGES. A new stage is a module here whose
class has what is listed below, a module `fit_<name>` that trains it (OPTIONS and train_stage(run), see train.Run), and
one row.

    fresh(parts, options) -> module             untrained, of the options' sizes; None where its training makes it
    of_bundle(tensors, parts) -> module or None  from a bundle.Tensors; None where the bundle has no such stage
    trained() -> {name: array}                  what training moved, named below "<stage>." in a bundle
    given(fitted) -> {whole name: array}        what else a bundle must hold for it
    indices() -> {whole name: array}            of that what is integers; may be absent
    play(x, pose) -> iterator of [k] a tick's coefficients, from standardised features x [T, d] and network.Pose
    displacement([..., k]) -> [..., n, 3] NOTE what `reference --intermediates` calls the coefficients

The first stage skins instead of displacing: it has neither play, displacement nor NOTE.
"""
import importlib
from dataclasses import dataclass

import numpy as np
import torch

from .mesh_stage import MeshStage
from .patch_stage import PatchStage
from .skeleton_stage import SkeletonStage
from .static_stage import StaticStage


@dataclass(frozen=True)
class Stage:
    """A stage's row. title and note: what tables call the network up to it; steps: its training's, as histories name
    them."""
    name: str
    kind: type
    title: str
    note: str
    steps: tuple
    after: tuple = ()       # names of the stages that it goes on from

    @property
    def fit(self):
        """The module that trains it."""
        return importlib.import_module(f"..fit_{self.name}", __name__)


STAGES = (
    Stage("static", StaticStage, "stage 1", "static stage", ("static", "static_pruned")),
    Stage("skeleton", SkeletonStage, "stages 1-2", "static and skeleton stage", ("skeleton",), ("static",)),
    Stage("mesh", MeshStage, "stages 1-3", "the whole network", ("mesh_head", "mesh_patches", "mesh_layers"),
          ("static", "skeleton")),
    Stage("patch", PatchStage, "stage 1 and patches", "patches in place of stages 2 and 3", ("patch",), ("static",)),
)
NAMES = tuple(stage.name for stage in STAGES)
FIRST, LAST = STAGES[0], STAGES[2]      # of the paper's three, which a training ends with unless told


def up_to(name):
    """The stages that the named one goes on from, and itself."""
    return tuple(stage for stage in STAGES if stage.name in (*STAGES[NAMES.index(name)].after, name))


@dataclass
class Parts:
    """What stages are built from, besides sizes: the garment on its body. Tensors; n vertices, m bones, d features."""
    template: torch.Tensor          # [n, 3] m
    faces: np.ndarray               # [c, 3]
    pivots: torch.Tensor            # [m, 3] bind positions of the bones
    initial_weights: torch.Tensor   # [n, m] W_I
    features: int                   # d
    nearest: tuple = None           # (points [n, 3], joint weights [n, J]) on the body, read by stage 3
    body_statistics: tuple = None   # (mean [3], deviation [3]) of the posed nearest points, read by stage 3
