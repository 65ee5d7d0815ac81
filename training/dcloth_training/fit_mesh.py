"""Stage 3: graph-recurrent layers and their head, stages 1 and 2 frozen.

Three steps, each kept only where it lowers the validation error: a head on the initial layers
(random recurrent features already tell poses and their recent past apart), truncated
back-propagation through time of the layers below that head, a fresh head on the trained layers.
The head stands still in the second step: with its n h weights free, the first epoch overfits.
"""
import copy

import numpy as np
import torch

from . import losses, loop, mesh_head, unskin

BASIS_EVERY = 2
SEQUENCES = 4      # side by side; more only costs memory once a layer's rows fill the cache
VERTICES = 512


@torch.no_grad()
def _errors(mesh, static, clips, embedded, every=8):
    """Typical error in metres of the whole stage over clips, on every eighth vertex."""
    basis = mesh.basis[:, ::every].flatten(1)
    predicted = [(mesh.coefficients(torch.from_numpy(s)) @ basis).reshape(len(clip), -1, 3)
                 for clip, s in zip(clips, embedded)]
    return mesh_head.typical(static.weights()[::every], clips, predicted, every)


def _chunks(mesh, body_points, static, clips, options, generator):
    """Losses of truncated back-propagation: one a chunk of `options.chunk` ticks."""
    count = len(static.template)
    weights = static.weights().detach()
    order = torch.randperm(len(clips), generator=generator).tolist()[:options.mesh_clips]
    order.sort(key=lambda i: len(clips[i]))
    for at in range(0, len(order), SEQUENCES):
        some = [clips[i] for i in order[at:at + SEQUENCES]]
        shortest = min(map(len, some))
        states = mesh.reset(len(some), mesh.embed.weight)
        for first in range(0, shortest - options.chunk + 1, options.chunk):
            ticks = slice(first, first + options.chunk)
            frames = torch.stack([c.pose.body_frame[ticks] for c in some])
            embedded = []
            for t in range(options.chunk):
                s, states = mesh.embedded(body_points(frames[:, t]), states)
                embedded.append(s)
            rows = losses.pick_vertices(count, VERTICES, generator)
            target = np.stack([c.wanted(ticks, rows.numpy()) for c in some])
            q = mesh.coefficients(torch.stack(embedded, 1))
            delta = (q @ mesh.basis[:, rows].flatten(1)).reshape(target.shape)
            linear = torch.stack([c.pose.linear[ticks] for c in some])
            yield losses.skinned_distance(linear, weights[rows], delta - torch.from_numpy(target))
            states = [s.detach() for s in states]


def draw(clips, options):
    """At most options.head_clips of `clips`: what stage 3 learns from, residuals and embeddings in memory."""
    chosen = np.random.default_rng(options.seed).permutation(len(clips))[:options.head_clips]
    return [clips[i] for i in sorted(chosen)]


def train(mesh, body_points, static, training, validation, options, folder, log=print):
    """-> {step: history}; leaves the best of the three steps in `mesh`."""
    count = len(static.template)
    components, deviations = unskin.principal(
        lambda: (c.wanted(slice(None, None, BASIS_EVERY)).reshape(-1, 3 * count) for c in training),
        sum(-(-len(c) // BASIS_EVERY) for c in training), len(mesh.basis), options.seed)
    mesh.basis.requires_grad_(False)

    def head(stage):
        return mesh_head.fit(stage, mesh, body_points, static, components, deviations, training, validation,
                             options, folder, log)

    histories = {}
    histories["mesh_head"], lowest = head("mesh_head")
    best = copy.deepcopy(mesh.state_dict())
    if options.mesh_epochs:
        def validate():
            return _errors(mesh, static, validation,
                           mesh_head.embed(mesh, body_points, validation))

        mesh.mlp.requires_grad_(False)
        histories["mesh_layers"] = loop.fit(
            "mesh_layers", mesh, options.mesh_epochs,
            lambda generator: _chunks(mesh, body_points, static, training, options, generator),
            validate, folder, seed=options.seed, rate=options.mesh_rate,
            log=log)
        reached = min(h["validation_mm"] for h in histories["mesh_layers"]) / 1e3
        if reached < lowest:
            lowest, best = reached, copy.deepcopy(mesh.state_dict())
        histories["mesh_refit"], reached = head("mesh_refit")
        if reached < lowest:
            lowest, best = reached, copy.deepcopy(mesh.state_dict())
    mesh.load_state_dict(best)
    mesh.eval()
    log(f"mesh: kept {1e3 * lowest:.2f} mm on validation")
    return histories
