"""Stage 1: the static stage on quasi-static drapes and their mirror images.

First with every bone free, then with the strongest few of each vertex, so that an engine that
stores a few influences a vertex loses nothing.
"""
import numpy as np
import torch

from . import dataset, features, losses, loop, shards

# Its options of train: (default, least, what).
OPTIONS = {
    "static-base": ("learned", None, "learned from drapes; rigid: the garment bolted to the hips, all of its motion "
                    "left to stage 2, with which loose skirts generalise better; or hung: what lies on the legs bolted "
                    "to the hips, trunk and sleeves skinned as they lie on the body, for robes and coats"),
    "static-width": (256, 1, None), "static-epochs": (60, 0, None), "influences": (4, 1, "bones a vertex, at most")}
BASES = ("learned", "rigid", "hung")
BATCH = 8
HELD_EVERY = 7    # one drape in seven validates, together with its mirror image


class Drapes:
    """Poses and truths of all static files as tensors."""

    def __init__(self, clips, character, device="cpu"):
        self.x = torch.cat([c.pose.x for c in clips])
        self.linear = torch.cat([c.pose.linear for c in clips])
        self.posed = torch.cat([c.pose.posed for c in clips])
        self.truth = torch.cat([torch.from_numpy(dataset.load_truth(c.path, c.mirrored,
                                                                    character.mirror))
                                for c in clips])
        features.at_rest(self.x)    # each drape is a pose of its own
        self.x, self.linear, self.posed, self.truth = (v.to(device)
                                                       for v in (self.x, self.linear, self.posed, self.truth))
        number = torch.cat([torch.arange(len(c)) for c in clips])
        self.held = number % HELD_EVERY == HELD_EVERY - 1


@torch.no_grad()
def still(static, x):
    """Make pivots blind to root motion: in drapes x [N, d] its features never change.

    Their weights stay as they were drawn, and a run would read them: on mocap/run stage 1 was 173 mm
    off, plain skinning 120. What the constant columns added moves into the bias.
    """
    numbers = x.shape[1] % 9
    if numbers:
        first = static.mlp[0]
        first.bias += first.weight[:, -numbers:] @ x[0, -numbers:]
        first.weight[:, -numbers:] = 0


def train(static, standardise, drapes, options, folder, log=print):
    """-> {step: history}. Loss: mean vertex distance of the skinned, undisplaced garment."""
    free, held = torch.nonzero(~drapes.held)[:, 0], torch.nonzero(drapes.held)[:, 0]
    x = standardise(drapes.x)

    def predict(rows):
        return static(x[rows], drapes.linear[rows], drapes.posed[rows])

    def batches(generator, shard=shards.WHOLE):
        order = free[torch.randperm(len(free), generator=generator)]
        for rows in shard.batches(order, BATCH, generator):
            yield losses.distance(predict(rows) - drapes.truth[rows])

    @torch.no_grad()
    def validate():
        rows = held if len(held) else free
        parts = [losses.distance(predict(r) - drapes.truth[r]) * len(r) for r in rows.split(BATCH)]
        return float(sum(parts)) / len(rows)

    histories = {"static": loop.fit(
        "static", static, options.static_epochs, batches, validate, folder, seed=options.seed,
        rate=options.rate, validate_every=5, patience=60, shards=options.shards, log=log)}
    if options.influences < static.initial_weights.shape[1]:
        static.prune(options.influences)
        histories["static_pruned"] = loop.fit(
            "static_pruned", static, max(1, options.static_epochs // 3), batches, validate, folder,
            seed=options.seed, rate=options.rate / 2, validate_every=5, shards=options.shards, log=log)
    still(static, x)
    return histories


def fixed_weights(base, rig, parents, initial):
    """Skinning weights [n, m] of the bases that are not learned, from those of the nearest points, `initial` [n, m].

    Legs are what hangs from the hips: joints below hips that begin lower in the bind pose, and all that follow them.
    """
    if rig.hips not in rig.bones:
        names = ", ".join(rig.joint_names[b] for b in rig.bones)
        raise ValueError(f"--static-base {base}: the garment lies on {names}, not on the hips "
                         f"({rig.joint_names[rig.hips]}); train with --static-base learned")
    if base == "rigid":
        moved = range(len(rig.bones))
    elif parents is None:
        raise ValueError("--static-base hung: character.safetensors does not say which joint is above which "
                         "(\"parents\"); add them, or train with --static-base learned or rigid")
    else:
        heights = rig.bind[:, 1, 3]
        legs = {j for j, p in enumerate(parents) if p == rig.hips and heights[j] < heights[rig.hips]}
        while below := {j for j, p in enumerate(parents) if p in legs} - legs:
            legs |= below
        moved = [i for i, bone in enumerate(rig.bones) if bone in legs]
    out, moved = np.array(initial), list(moved)
    onto_hips = out[:, moved].sum(1)
    out[:, moved] = 0
    out[:, rig.bones.index(rig.hips)] += onto_hips
    return torch.from_numpy(out)


def train_stage(run):
    """Stage 1 of a training -> {step: history}; {} where it goes on from a finished one, or is not learned."""
    if run.before:
        run.net.static.take(run.before.static)
    base, fitted = run.options.static_base, run.fitted
    if base != "learned":
        run.net.static.lay(fixed_weights(base, fitted.rig, run.character.parents, fitted.initial_weights),
                           run.options.influences)
    if run.before or base != "learned":
        return {}
    drapes = Drapes(run.static_clips, run.character, run.options.device)
    return train(run.net.static, run.net.standardise, drapes, run.options, run.options.out, run.log)
