"""How many learned numbers a model stores at run time, and sizes that give two models as many.

Learned numbers: everything that training moves, in the form a run needs (weight matrices folded to
one [n, m], bases multiplied out). Template, bind pose, nearest-point weights and the statistics of
features are given, not learned.
"""
from .. import stages


def of_network(net, last, frozen=None):
    """Learned numbers of `net` up to a stage; `frozen`: "pivots" or "weights" were not trained."""
    static, total = net.static, 0
    if frozen != "pivots":
        total += sum(p.numel() for p in static.mlp.parameters())
    if frozen != "weights":
        total += static.initial_weights.numel()
    return total + sum(p.numel() for stage in stages.up_to(last)[1:] for p in getattr(net, stage.name).parameters())


def matched(family, d, n, hidden, target, most=None):
    """{"hidden", "size"}: the size (>= 2) that brings family.learned nearest to `target`.

    learned() rises by the same amount with each unit of size, so two evaluations settle it.
    """
    def count(size):
        return family.learned(d, n, {"hidden": hidden, "size": size})
    size = max(2, round((target - count(0)) / (count(1) - count(0))))
    return {"hidden": hidden, "size": size if most is None else min(size, most)}
