"""The training loop shared by the stages: Adam, schedule, clipping, checkpoints, best epoch.

An epoch's random numbers depend on (seed, stage, epoch) alone, so a resumed run repeats an
uninterrupted one bit for bit (same machine, same thread count).
"""
import contextlib
import copy
import functools
import math
import os
import time

import torch

from . import checkpoint, shards as shared, workers

CLIP_NORM = 1.0
FINAL_RATE = 0.02     # of the first learning rate, at the end of the cosine
FOLLOW, HOLD = 0.1, 0.1


_limit_minutes = None


@contextlib.contextmanager
def limited(minutes):
    """Inside the block every fit() runs as many epochs as `minutes` pay for (None: all of them).

    minutes: of each fit(), or {stage: minutes} of those named there.

    The number is settled by the first epoch's time and kept in the checkpoint: the schedule still
    ends at FINAL_RATE, and a resumed run goes on with the same number. It depends on the machine's
    speed; where bits must repeat on another machine, limit the epochs instead.
    """
    global _limit_minutes
    before, _limit_minutes = _limit_minutes, minutes
    try:
        yield
    finally:
        _limit_minutes = before


def affordable(epochs, minutes, epoch_seconds, validation_seconds, validate_every):
    """How many of `epochs` fit into `minutes`; the first has been run already."""
    cost = epoch_seconds + validation_seconds / validate_every
    return max(1, min(epochs, int(60 * minutes / max(cost, 1e-9))))


def seed_epoch(seed, stage, epoch):
    """Seeds the global generator (dropout, noise) and returns one for drawing data."""
    number = (seed * 1_000_003 + sum(map(ord, stage)) * 10_007 + epoch) % (1 << 31)
    torch.manual_seed(number)
    return torch.Generator().manual_seed(number + 1)


def fit(stage, module, epochs, batches, validate, folder, *, seed=0, rate=1e-3, decay=0.0,
        patience=None, validate_every=1, keep_last=False, followers=(), shards=1, log=print):
    """Train `module` and leave it at its best validated epoch -> history (list of dicts).

    keep_last: leave it at the last epoch, where `batches` teach what validation does not measure.

    followers: parameters that learn at FOLLOW of the rate, and not at all in the first HOLD of the epochs: until what
    reads them has learned something their gradient is noise, which Adam would blow up to full steps.

    batches(generator): yields loss tensors, one a step; with several `shards` batches(generator, shard), see shards.py.
    validate(): error in metres.
    Resumes from folder/<stage>.safetensors and saves there after every validated epoch. A history
    entry's `minutes` are those of all epochs up to it, validation included, over all resumptions.
    """
    started = time.monotonic()
    path = os.path.join(folder, stage + ".safetensors")
    parameters = [p for p in module.parameters() if p.requires_grad]
    behind = {id(p) for p in followers}
    groups = [[p for p in parameters if (id(p) in behind) == late] for late in (False, True)]
    groups, shares = zip(*[(g, s) for g, s in zip(groups, (1.0, FOLLOW)) if g])
    optimiser = torch.optim.AdamW([{"params": g} for g in groups], lr=rate, weight_decay=decay)
    state = workers.from_first(lambda: checkpoint.load(path))
    if state:
        try:
            module.load_state_dict(state["module"])
            optimiser.load_state_dict(state["optimiser"])
        except (RuntimeError, ValueError):
            raise ValueError(f"{path}: a step of other sizes than asked for now; give the options it was begun with, "
                             f"or another --out") from None
        first, best, best_at, history = (state[k] for k in ("epoch", "best", "best_at", "history"))
        epochs = min(epochs, state.get("epochs", epochs))
        validation_seconds = 0.0
    else:
        module.eval()
        error = workers.from_first(validate)
        first, best, best_at = 0, copy.deepcopy(module.state_dict()), 0
        history = [{"epoch": 0, "validation_mm": 1e3 * error}]
        validation_seconds = time.monotonic() - started
        log(f"{stage}: before training {1e3 * error:.2f} mm on validation")
    spent = history[-1].get("minutes", 0.0)
    lowest = min(h["validation_mm"] for h in history)
    for epoch in range(first, epochs):
        if epoch >= epochs or patience and epoch - best_at > patience:
            break
        began = time.monotonic()
        workers.same(module)
        for group, share in zip(optimiser.param_groups, shares):
            held = share < 1 and epoch < HOLD * epochs
            cosine = 0.5 * (1 + math.cos(math.pi * epoch / epochs))
            group["lr"] = 0.0 if held else share * rate * (FINAL_RATE + (1 - FINAL_RATE) * cosine)
        module.train()
        total, steps = 0.0, 0
        for loss in shared.steps(batches, functools.partial(seed_epoch, seed, stage, epoch), parameters, shards):
            torch.nn.utils.clip_grad_norm_(parameters, CLIP_NORM)
            optimiser.step()
            total, steps = total + float(loss.detach()), steps + 1
        if not math.isfinite(total):
            raise FloatingPointError(f"{stage}: loss not finite in epoch {epoch + 1}; "
                                     f"lower --rate, or resume from an older checkpoint")
        minutes = _limit_minutes.get(stage) if isinstance(_limit_minutes, dict) else _limit_minutes
        if epoch == 0 and minutes is not None:
            # The schedule starts at `rate` whatever the number of epochs, so it may be set here.
            epochs = workers.from_first(functools.partial(
                affordable, epochs, minutes, time.monotonic() - began, validation_seconds, validate_every))
        if (epoch + 1) % validate_every and epoch + 1 != epochs:
            continue
        module.eval()
        error = 1e3 * workers.from_first(validate)
        history.append({"epoch": epoch + 1, "training_mm": 1e3 * total / max(steps, 1),
                        "validation_mm": error, "seconds": round(time.monotonic() - began, 2),
                        "minutes": round(spent + (time.monotonic() - started) / 60, 3)})
        if error < lowest:
            lowest, best_at, best = error, epoch + 1, copy.deepcopy(module.state_dict())
        if workers.first():
            checkpoint.save(path, {"module": module.state_dict(), "optimiser": optimiser.state_dict(),
                                   "epoch": epoch + 1, "epochs": epochs, "best": best, "best_at": best_at,
                                   "history": history})
        log(f"{stage}: epoch {epoch + 1}/{epochs} training {history[-1]['training_mm']:.2f} mm, "
            f"validation {error:.2f} mm (best {lowest:.2f} at {best_at}), "
            f"{history[-1]['seconds']:.1f} s")
    if keep_last:
        history[-1]["kept"] = True
    else:
        module.load_state_dict(best)
    module.eval()
    return history


def kept(history):
    """The entry of a fit's history whose weights it left: the best one, or the last where that was asked for."""
    return next((h for h in history if h.get("kept")), min(history, key=lambda h: h["validation_mm"]))
