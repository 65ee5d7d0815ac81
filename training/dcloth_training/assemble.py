"""A fresh network from its parts: the garment on its body, the options' sizes, standardised features."""
import numpy as np
import torch

from . import features, geometry, network
from .stages.mesh_stage import MeshStage
from .stages.skeleton_stage import SkeletonStage
from .stages.static_stage import StaticStage


def build(fitted, character, standard, options, body_statistics=None, last="mesh"):
    """A fresh network in float32; body_statistics (mean, deviation) of the mesh stage's input."""
    n, d = len(character.template), len(standard["mean"])
    torch.manual_seed(options.seed)
    static = StaticStage(torch.from_numpy(np.asarray(character.template)),
                         torch.from_numpy(character.bind[fitted.rig.bones, :3, 3]),
                         torch.from_numpy(fitted.initial_weights), d, options.static_width)
    skeleton = body = mesh = None
    if last != "static":
        skeleton = SkeletonStage(n, d, options.skeleton_size)
    if last == "mesh":
        body = network.BodyPoints(fitted.nearest_points, fitted.nearest_weights)
        mean, deviation = body_statistics
        mesh = MeshStage(*geometry.padded_neighbours(character.faces, n), mean, deviation,
                         options.mesh_width, options.mesh_layers, options.mesh_hidden,
                         options.mesh_size)
    return network.DCloth(features.Standardise(**standard), static, skeleton, body, mesh).float()
