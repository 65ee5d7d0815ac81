"""A fresh network from its parts: the garment on its body, the options' sizes, standardised features."""
import numpy as np
import torch

from . import features, network, stages


def parts_of(fitted, character, features_count, body_statistics=None):
    """stages.Parts of a character's garment; body_statistics (mean [3], deviation [3]): see train.body_statistics."""
    return stages.Parts(torch.from_numpy(np.asarray(character.template)), character.faces,
                        torch.from_numpy(character.bind[fitted.rig.bones, :3, 3]),
                        torch.from_numpy(fitted.initial_weights), features_count,
                        (fitted.nearest_points, fitted.nearest_weights), body_statistics)


def build(fitted, character, standard, options, body_statistics=None, last=stages.LAST.name):
    """A fresh network in float32 of the stages up to `last`."""
    torch.manual_seed(options.seed)
    parts = parts_of(fitted, character, len(standard["mean"]), body_statistics)
    modules = {stage.name: stage.kind.fresh(parts, options) for stage in stages.up_to(last)}
    return network.DCloth(features.Standardise(**standard), **modules).float()
