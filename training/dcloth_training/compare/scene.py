"""What every row shares: the full model, its training options, the clips and their residuals."""
import json
import os

import numpy as np
import torch

from .. import bundle, dataset, export, reference, rig, safetensors_io, train
from ..stages.static_stage import StaticStage

NOT_OPTIONS = ("data", "more_data", "out", "export", "threads", "device", "freeze")


def load_full(path, data):
    """A training folder or a bundle -> (network in float32, rig, faces, provenance, histories).

    `histories` is empty where only a bundle is given: it does not keep them.
    """
    if not os.path.isdir(path):
        net, found, faces, metadata = bundle.read(path, torch.float32)
        return net.eval(), found, faces, json.loads(metadata.get("training", "{}")), {}
    net, fitted, character, provenance = export.load_trained(path, data)
    log = os.path.join(path, "log.json")
    histories = {}
    if os.path.exists(log):
        with open(log) as file:
            histories = json.load(file)["histories"]
    return net.float(), fitted.rig, character.faces, provenance, histories


def options_of(provenance, arguments, log):
    """The full model's training options, with this run's folders, seed, threads and epochs."""
    options = train.arguments(["--data", arguments.data, "--out", arguments.out])
    options.more_data = arguments.more_data
    command = provenance.get("command", {})
    if not command:
        log("the full model does not tell its training options: the trainer's defaults are used")
    for name, value in command.items():
        if name not in NOT_OPTIONS and hasattr(options, name):
            setattr(options, name, value)
    options.threads = arguments.threads
    if arguments.seed is not None:
        options.seed = arguments.seed
    if arguments.epochs is not None:
        for name in ("static_epochs", "skeleton_epochs", "head_epochs", "mesh_epochs", "patch_epochs"):
            setattr(options, name, min(getattr(options, name), arguments.epochs))
    return options


class Scene:
    """Reads clips when a row needs them; one set of residuals is kept at a time."""

    def __init__(self, arguments, log):
        self.data, self.more_data = arguments.data, arguments.more_data
        self.folder, self.log = arguments.out, log
        self.minutes, self.full, self.patches = arguments.minutes_per_model, arguments.full, arguments.patches
        loaded = load_full(arguments.full, arguments.data)
        self.net, self.rig, self.faces, self.provenance, self.histories = loaded
        if self.net.skeleton is None:
            raise ValueError(f"{arguments.full}: has no stage 2; the comparison needs stages 1-2 at least: train it "
                             f"with --stages skeleton or mesh, and name a network of patches with --patches")
        self.options = options_of(self.provenance, arguments, log)
        self.held_out = dataset.held_out(self.provenance)
        self.options.held_out = ",".join(self.held_out)
        self.options.stages = self.net.last_stage()
        self.standardise = self.net.standardise
        self._training = self._validation = self._base = None
        self._check_character()
        self._check_clips(arguments.clips)

    def _check_character(self):
        path = os.path.join(self.data, "character.safetensors")
        character = self.character = rig.read_character(path)
        template = self.net.static.template.numpy()
        if list(character.joint_names) != list(self.rig.joint_names) or \
                character.template.shape != template.shape or \
                np.abs(character.template - template).max() > 1e-4:
            raise ValueError(f"{path}: another character or garment than that of {self.full} "
                             f"({len(character.template)} and {len(template)} vertices, "
                             f"{len(character.joint_names)} and {len(self.rig.joint_names)} joints)")

    def _check_clips(self, names):
        """Settle which clips are measured; none may have been trained or chosen on."""
        self.clips = list(self.held_out if names is None else names)
        missing = [c for c in self.clips if not os.path.exists(dataset.path_of(self.data, c))]
        if missing:
            raise ValueError(f"{os.path.join(self.data, 'dynamic')}: held-out clips {missing} not found; "
                             f"simulate them, or name those that are there with --clips")
        known = set(dataset.find(self.data, "dynamic", self.held_out))
        used = {dataset.path_of(self.data, c) for c in self.provenance.get("training_clips", [])
                + self.provenance.get("validation_clips", [])}
        seen = [c for c in self.clips if dataset.path_of(self.data, c) in known | used]
        if seen:
            raise ValueError(f"--clips: {seen} are trained or validated on; only clips that training "
                             f"never saw can be measured: {', '.join(self.held_out) or 'none (train --held-out)'}")

    def load_patches(self):
        """(network, histories, provenance) of --patches, which must read what the full model reads."""
        net, found, _, provenance, histories = load_full(self.patches, self.data)
        asked = [(list(rig.joint_names), list(rig.feature_joints), list(rig.bones), rig.root_motion)
                 for rig in (found, self.rig)]
        if net.patch is None or asked[0] != asked[1]:
            raise ValueError(f"--patches {self.patches}: {'no patches' if net.patch is None else 'other features'}; "
                             f"expected patches over {train.told(self.rig)}, as {self.full}")
        seen = sorted(train.learned(provenance) & set(self.clips))
        if seen:
            raise ValueError(f"--patches {self.patches}: learned from {', '.join(seen[:3])}, which the table measures")
        return net, histories, provenance

    def training_names(self):
        """Clip names that the data folder gives to training, without reading the clips' frames."""
        folders = [self.data] + ([self.more_data] if self.more_data else [])
        paths = [p for folder in folders for p in dataset.find(folder, "dynamic", self.held_out)]
        found = {safetensors_io.read(p, ())[1].get("clip", "") for p in paths}
        chosen = self.options.validation.split(",")
        return {name for name in found if not dataset.named(name, chosen) and dataset.role(name) != "validation"}

    def pose(self, item, path):
        """What a tick reads of a sequence, in float32."""
        return reference.pose_for(item, self.rig, torch.float32, path)

    def base(self, name):
        """A static stage that is linear blend skinning alone: "plain" or "hips" weights, D = 0."""
        static = self.net.static
        weights = static.initial_weights.contiguous()    # a bundle's and a fit's differ in their order
        if name == "hips":
            weights = torch.zeros_like(weights)
            weights[:, self.anchor()] = 1
        return StaticStage(static.template, static.pivots, weights, len(self.standardise.mean), 1, 1) \
            .requires_grad_(False)

    def anchor(self):
        """Column of the bone that carries the garment: the hips, or else the heaviest."""
        if self.rig.hips in self.rig.bones:
            return self.rig.bones.index(self.rig.hips)
        return int(self.net.static.initial_weights.sum(0).argmax())

    def prepared(self, name, static):
        """(training, validation) clips with residuals against `static`, remembered as `name`."""
        if self._training is None:
            _, fitted, _, self._training, self._validation = train.prepare(self.options, self.log)
            same = (list(fitted.rig.bones) == list(self.rig.bones)
                    and list(fitted.rig.feature_joints) == list(self.rig.feature_joints)
                    and fitted.rig.root_motion == self.rig.root_motion)
            if not same:
                raise ValueError(f"{self.full}: trained with other bones or features than this trainer "
                                 f"gives {self.data}; train the full model again")
        if self._base != name:
            for clip in self._training + self._validation:
                clip.residual = None
            dataset.add_residuals(self._training + self._validation, static, self.standardise,
                                  self.character, os.path.join(self.folder, "unskinned"))
            self._base = name
            self.log(f"ground truth un-skinned by {name} skinning")
        return self._training, self._validation

    def release(self):
        """Forget clips and residuals, before train.run loads its own."""
        self._training = self._validation = self._base = None
