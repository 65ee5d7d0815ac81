"""Training, keeping and running of one family: stage 2's windows, loss and optimiser for all."""
import os

import numpy as np
import torch

from .. import augment, checkpoint, dataset, fit_skeleton, loop, losses, unskin
from . import sizes, virtual_bones

EVERY = 8               # validation looks at every eighth vertex, as stage 2's does
CHUNK = 16              # ticks skinned at once
DECOMPOSE_EVERY = 4     # frames that the bones' first motion is taken from
MODEL = "network.safetensors"
MOST_BONES = 0.25       # of the vertices: a bone needs a patch to have a rotation


def oriented(components):
    """Components [R, columns] with the largest entry of each positive: their sign means nothing,
    but the last bit of the data would decide it, and with it the network's first values."""
    largest = np.abs(components).argmax(1)[:, None]
    return components * np.where(np.take_along_axis(components, largest, 1) < 0, -1, 1).astype(np.float32)


def principal_start(training, n, options):
    """{components [R, 3 n], scale [R]}: the start of a displacement basis, as in stage 2."""
    components, deviations = unskin.principal(
        lambda: (c.wanted(slice(None, None, fit_skeleton.BASIS_EVERY)).reshape(-1, 3 * n) for c in training),
        sum(-(-len(c) // fit_skeleton.BASIS_EVERY) for c in training), options.skeleton_rank,
        options.seed)
    return {"components": oriented(components), "scale": deviations.astype(np.float32)}


def bones_start(training, template, count, options):
    """(fixed tensors of VirtualBones, radius in metres) from the clips' residuals."""
    centres = virtual_bones.place(template, count)
    logits, radius = virtual_bones.first_weights(template, centres)
    patch = virtual_bones.patches(template, centres)
    blocks = []
    for clip in training:
        frames = clip.wanted(slice(None, None, DECOMPOSE_EVERY))
        for at in range(0, len(frames), CHUNK):
            vectors, shifts = virtual_bones.decompose(np.asarray(frames[at:at + CHUNK], np.float32),
                                                      template, centres, patch)
            # Times the radius: an angle counts as what it moves at the edge of the patch.
            both = np.concatenate([radius * vectors, shifts], -1)
            blocks.append(both.reshape(len(both), -1).astype(np.float32))
    components, deviations = unskin.principal(lambda: iter(blocks), sum(map(len, blocks)),
                                              options.skeleton_rank, options.seed)
    return {"template": template.astype(np.float32), "centres": centres.astype(np.float32),
            "components": oriented(components), "scale": deviations.astype(np.float32),
            "first_logits": logits}, radius


def start(family, scene, training):
    """(sizes, fixed tensors) of a fresh family with as many learned numbers as stages 1-2."""
    options, template = scene.options, scene.net.static.template.numpy()
    n, d = len(template), len(scene.standardise.mean)
    target = sizes.of_network(scene.net, "skeleton")
    if family is virtual_bones.VirtualBones:
        shape = sizes.matched(family, d, n, options.skeleton_size, target,
                              max(2, int(MOST_BONES * n)))
        fixed, radius = bones_start(training, template, shape["size"], options)
        return {**shape, "radius": radius}, fixed
    return (sizes.matched(family, d, n, options.skeleton_size, target),
            principal_start(training, n, options))


@torch.no_grad()
def clip_errors(family, base, standardise, clips):
    """Mean skinned distance in metres over whole clips from a reset."""
    rows = torch.arange(0, len(base.template), EVERY)
    weights, total = base.weights()[rows], 0.0
    for clip in clips:
        code = family.code(standardise(clip.pose.x)[None])[0]
        error = family.displacement(code, rows) - torch.from_numpy(clip.wanted(vertices=slice(None, None, EVERY)))
        total += float(losses.skinned_distance(clip.pose.linear, weights, error)) * len(clip)
    return total / sum(map(len, clips))


def batches_of(family, base, standardise, clips, options):
    """A function of a generator that yields an epoch's losses, one a step."""
    weights, frames, count = base.weights(), options.window, len(base.template)

    def batches(generator):
        order = dataset.windows(clips, frames, generator)
        for at in range(0, len(order), fit_skeleton.BATCH):
            some = order[at:at + fit_skeleton.BATCH]
            # Of all vertices, not of stage 2's quarter: virtual bones learn weights of each.
            rows = losses.pick_vertices(count, fit_skeleton.VERTICES, generator)
            linear = fit_skeleton.linear_of(some, frames)
            target = torch.from_numpy(np.stack([w.wanted(frames, rows.numpy()) for w in some]))
            velocity = augment.velocities(some, options.carried, generator).numpy()
            x = standardise(torch.stack([w.x(frames, velocity=v) for w, v in zip(some, velocity)]))
            ticks = slice(int(torch.randint(0, family.STRIDE, (1,), generator=generator)), None,
                          family.STRIDE)
            error = family.displacement(family.code(x)[:, ticks], rows) - target[:, ticks]
            keep = fit_skeleton.counted(some, frames)[:, ticks]
            yield losses.skinned_distance(linear[:, ticks][keep], weights[rows], error[keep])

    return batches


def train(kind, scene, folder, name):
    """Train a family in `folder`, or go on where a stopped run left it -> (family, history).

    The start (principal components, bones) is kept beside the checkpoints, so that it costs once.
    """
    base, options = scene.base(kind.BASE), scene.options
    training, validation = scene.prepared(kind.BASE, base)
    if all(len(c) < options.window for c in training):
        raise ValueError(f"{scene.data}: no training clip has the {options.window} ticks of a window; "
                         f"train the full model with a shorter --window")
    path = os.path.join(folder, "start.safetensors")
    kept = checkpoint.load(path)
    if kept is None:
        shape, fixed = start(kind, scene, training)
        kept = {"sizes": shape, "fixed": {k: torch.as_tensor(v) for k, v in fixed.items()}}
        checkpoint.save(path, kept)
    torch.manual_seed(options.seed)
    family = kind(len(scene.standardise.mean), kept["sizes"], kept["fixed"], options)
    with loop.limited(scene.minutes):
        history = loop.fit(name, family, options.skeleton_epochs,
                           batches_of(family, base, scene.standardise, training, options),
                           lambda: clip_errors(family, base, scene.standardise, validation), folder,
                           seed=options.seed, rate=options.skeleton_rate, decay=options.decay,
                           validate_every=options.validate_every, log=scene.log)
    return family, history


def save(folder, family, history):
    checkpoint.save(os.path.join(folder, MODEL), {
        "state": family.state_dict(), "fixed": family.fixed(), "sizes": family.sizes,
        "history": history})


def restore(kind, folder, features, options):
    """What save() kept -> (family, history), or None where training has not ended."""
    saved = checkpoint.load(os.path.join(folder, MODEL))
    if saved is None:
        return None
    family = kind(features, saved["sizes"], saved["fixed"], options)
    family.load_state_dict(saved["state"])
    return family.eval(), saved["history"]


@torch.no_grad()
def positions(family, base, standardise, pose):
    """World positions [T, n, 3] of one sequence from a reset."""
    x = standardise(pose.x)
    code, weights, out = family.code(x[None])[0], base.weights(), []
    for at in range(0, len(pose), CHUNK):
        ticks = slice(at, at + CHUNK)
        bones = base.bone_matrices(x[ticks], pose.linear[ticks], pose.posed[ticks])
        out.append(base.skin(base.blend(bones, weights), family.displacement(code[ticks])))
    return torch.cat(out)
