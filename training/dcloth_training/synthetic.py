"""A garment of any size with seeded, untrained weights of trained scale, and motion: for benches and tests.

    python3 -m dcloth_training.synthetic -o FOLDER [--preset paper|small] [--frames 48] [--seed 1]

Writes FOLDER/bundle.safetensors (converter/BUNDLE.md, trained weights as F32) and FOLDER/sequence.safetensors.
`paper` has the sizes that reproduce the parameter table of the D-Cloth paper: 130.5 MB of float32. What stands for
training: bases of smooth fields whose amplitudes fall like principal components, as many of them as `modes`, so that
S and M share a part as they do when both start from the components of one residual; displacements of centimetres
(stage 2) and millimetres (stage 3); features standardised on motion other than the one that is written.
It says nothing about looks: an untrained garment swings wherever its weights happen to point.
"""
import argparse
import os
from dataclasses import dataclass

import numpy as np
import torch

from . import bundle, features, geometry, network, sequence, synthetic_body
from .rig import Character, Fit, Rig
from .stages.mesh_stage import BodyPoints, MeshStage
from .stages.skeleton_stage import SkeletonStage
from .stages.static_stage import StaticStage

RATE = 30.0
INFLUENCES = 8
SKELETON_MM, MESH_MM = 40.0, 6.0      # mean displacement of each stage
STATISTICS_FRAMES = 600


@dataclass(frozen=True)
class Sizes:
    """rings x columns vertices, m bones, k_S and k_M, rank of [S; M], F, L, h of the static and the vertex MLP."""
    rings: int
    columns: int
    bones: int
    skeleton: int
    mesh: int
    modes: int
    width: int
    layers: int
    static_hidden: int
    hidden: int


PRESETS = {"paper": Sizes(44, 181, 24, 384, 384, 400, 32, 3, 256, 1024),
           "small": Sizes(12, 20, 8, 12, 10, 16, 8, 2, 16, 24)}


def skirt(rings, columns):
    """A pleated cone from the waist to below the knees: vertices [rings columns, 3], faces [c, 3]."""
    way, angle = np.linspace(0, 1, rings), 2 * np.pi * np.arange(columns) / columns
    radius = (0.17 + 0.22 * way)[:, None] * (1 + 0.08 * (way ** 2)[:, None] * np.cos(14 * angle))
    height = np.broadcast_to((1.05 - 0.55 * way)[:, None], radius.shape)
    points = np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], -1)
    return points.reshape(-1, 3), synthetic_body.tube_faces(rings, columns)


def smooth_fields(sizes, generator):
    """[modes, 3 n] orthonormal rows: waves around and down the skirt in random directions, longest first."""
    angle = 2 * np.pi * np.arange(sizes.columns) / sizes.columns
    way = np.linspace(0, 1, sizes.rings)
    waves = sorted(((k, l) for k in range(24) for l in range(24)), key=lambda kl: kl[0] + 2 * kl[1])
    rows = []
    for k, l in waves:
        down = way * np.cos(np.pi * l * way)
        for phase in (0.0, np.pi / 2)[:2 if k else 1]:
            field = np.outer(down, np.cos(k * angle + phase)).reshape(-1, 1)
            rows += [(field * axis).ravel() for axis in np.linalg.qr(generator.standard_normal((3, 3)))[0]]
        if len(rows) >= sizes.modes:
            break
    if len(rows) < sizes.modes:
        raise ValueError(f"modes {sizes.modes}: at most {len(rows)}")
    return np.linalg.qr(np.stack(rows[:sizes.modes]).T)[0].T


def bases(sizes, generator):
    """S [k_S, n, 3] and M [k_M, n, 3], stacked rank `modes`; their scale is set later."""
    fields = smooth_fields(sizes, generator) / (1 + np.arange(sizes.modes))[:, None] ** 0.7
    mix = generator.standard_normal((sizes.skeleton + sizes.mesh, sizes.modes)) / sizes.modes ** 0.5
    stacked = (mix @ fields).reshape(len(mix), -1, 3)
    return stacked[:sizes.skeleton], stacked[sizes.skeleton:]


def character(sizes):
    """Body, skeleton and garment as the trainer's Character."""
    names, _, bind = synthetic_body.skeleton()
    body, body_faces, weights = synthetic_body.body(bind)
    template, faces = skirt(sizes.rings, sizes.columns)
    return Character(names, None, bind, body.astype(np.float32), body_faces, weights.astype(np.float32),
                     template.astype(np.float32), faces, None)


def fitted(whole, sizes, root="none"):
    """The first `bones` joints as cloth bones, all joints as features; root motion: features.ROOT_NUMBERS."""
    points, weights = geometry.nearest_weights(whole.template, whole.body_vertices, whole.body_faces,
                                               whole.body_weights)
    joints = list(range(len(whole.joint_names)))
    initial = weights[:, :sizes.bones] + 1e-4
    rig = Rig(whole.joint_names, whole.bind, 0, joints, joints[:sizes.bones], RATE, root)
    return Fit(rig, points.astype(np.float32), weights.astype(np.float32),
               (initial / initial.sum(1, keepdims=True)).astype(np.float32))


def _scaled(basis, stage_displacement, millimetres):
    """Scale `basis` so that the mean of what it displaces is `millimetres`."""
    with torch.no_grad():
        mean = stage_displacement().norm(dim=-1).mean()
        basis.mul_(millimetres * 1e-3 / mean)


def build(sizes, seed=1, root="none"):
    """(network in float32, Fit, Character) with every weight set."""
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    whole = character(sizes)
    fit = fitted(whole, sizes, root)
    rig, n = fit.rig, len(whole.template)
    pose = network.pose_of(synthetic_body.motion(STATISTICS_FRAMES, RATE, seed + 1000), rig, torch.float32)
    standard = features.fit_standard(pose.x.double().numpy())
    standardise = features.Standardise(**{k: v.astype(np.float32) for k, v in standard.items()})
    static = StaticStage(torch.from_numpy(whole.template), torch.from_numpy(
        rig.bind[rig.bones, :3, 3].astype(np.float32)), torch.from_numpy(fit.initial_weights), pose.x.shape[1],
        sizes.static_hidden, sizes.bones)
    skeleton = SkeletonStage(n, pose.x.shape[1], sizes.skeleton)
    body_points = BodyPoints(torch.from_numpy(fit.nearest_points), torch.from_numpy(fit.nearest_weights))
    some = body_points(pose.body_frame[::STATISTICS_FRAMES // 20])
    mesh = MeshStage(*geometry.padded_neighbours(whole.faces, n), some.mean((0, 1)), some.std((0, 1)), sizes.width,
                     sizes.layers, sizes.hidden, sizes.mesh, body_points)
    with torch.no_grad():
        torch.nn.init.normal_(static.mlp[2].weight, std=0.01 / sizes.static_hidden ** 0.5)    # pivots: centimetres
        for matrix in (skeleton.gru.weight_ih_l0, skeleton.gru.weight_hh_l0):    # gates open, whatever the size
            torch.nn.init.normal_(matrix, std=0.6 / matrix.shape[1] ** 0.5)
        static.residual_weights.copy_(torch.from_numpy(
            np.abs(generator.standard_normal(static.residual_weights.shape)) * 0.02 / sizes.bones))
        static.prune(INFLUENCES)
        torch.nn.init.normal_(mesh.mlp[2].weight, std=sizes.hidden ** -0.5)
        for basis, values in zip((skeleton.basis, mesh.basis), bases(sizes, generator)):
            basis.copy_(torch.from_numpy(values))
    net = network.DCloth(standardise, static, skeleton, mesh).eval()
    x = standardise(pose.x[:60])
    _scaled(skeleton.basis, lambda: skeleton.displacement(skeleton(x[None])[0][0]), SKELETON_MM)

    def wrinkles():
        states, out = mesh.reset(1, x), []
        for t in range(6):
            s, states = mesh.embedded(body_points(pose.body_frame[t:t + 1]), states)
            out.append(mesh.displacement(mesh.coefficients(s)))
        return torch.stack(out)
    _scaled(mesh.basis, wrinkles, MESH_MM)
    return net, fit, whole


def write(folder, sizes, frames=48, seed=1, root="none", wind=None):
    """FOLDER/bundle.safetensors and FOLDER/sequence.safetensors -> their paths. wind [frames, 3]: the sequence's."""
    os.makedirs(folder, exist_ok=True)
    paths = [os.path.join(folder, f"{name}.safetensors") for name in ("bundle", "sequence")]
    net, fit, whole = build(sizes, seed, root)
    bundle.write(paths[0], net, fit, whole, {"synthetic": vars(sizes), "seed": seed}, "synthetic skirt", half=False)
    sequence.write(paths[1], sequence.Sequence(synthetic_body.motion(frames, RATE, seed), None, whole.joint_names, RATE,
                                               "synthetic", "dynamic", wind))
    return paths


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--preset", choices=sorted(PRESETS), default="paper")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(argv)
    for path in write(options.output, PRESETS[options.preset], options.frames, options.seed):
        print(f"{path}: {os.path.getsize(path) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
