"""Batches in shards: how several workers share a step, with the same bits however many they are.

Every batch is cut into --shards parts. A shard has random numbers of its own and gives a gradient of its own; worker i
has the shards i, i + workers, ... All workers then sum the gradients of all shards in the shards' order: the order of
an all-reduce depends on how many workers there are.
"""
import torch

from . import workers

COUNTS = (1, 2, 4, 8)       # 8: the smallest batch, fit_static.BATCH
_DRAWS, _NOISE = 7_919, 104_729     # apart from all that loop.seed_epoch gives in an epoch


class Shard:
    """One part of each batch. share: how much of the last batch it was."""

    def __init__(self, number=0, count=1):
        self.number, self.count, self.share = number, count, 1 / count

    def part(self, items, generator):
        """The shard's part of an epoch's items. What `generator`, the same for all until now, draws next is its own."""
        if self.count > 1:
            generator.manual_seed(generator.initial_seed() + _DRAWS * (1 + self.number))
        return items[self.number::self.count]

    def batches(self, order, size, generator):
        """The shard's part of every `size` of an epoch's order; of the last it may have none."""
        self.part(order, generator)
        for at in range(0, len(order), size):
            batch = order[at:at + size]
            mine = batch[self.number::self.count]
            self.share = len(mine) / len(batch)
            if len(mine):
                yield mine


WHOLE = Shard()


def steps(batches, begin, parameters, count):
    """Yields an epoch's losses, each when its gradient is in `parameters`.

    batches(generator), or with several shards batches(generator, shard), yields a shard's losses; begin() seeds the
    epoch and returns its generator.
    """
    return _several(batches, begin, parameters, count) if count > 1 else _one(batches, begin, parameters)


def _one(batches, begin, parameters):
    for loss in batches(begin()):
        for parameter in parameters:
            parameter.grad = None
        loss.backward()
        yield loss


class _Stream:
    """A shard's losses through an epoch."""

    def __init__(self, batches, generator, shard):
        self.shard, self.losses = shard, batches(generator, shard)
        self.noise = torch.Generator().manual_seed(generator.initial_seed() + _NOISE * (1 + shard.number))

    def step(self, parameters, row):
        """Fills row with share times (gradient, loss, 1); leaves it where the shard has no more batches."""
        torch.manual_seed(int(torch.randint(1 << 62, (1,), generator=self.noise)))      # of noise and dropout
        loss = next(self.losses, None)
        if loss is None:
            return
        for parameter in parameters:
            parameter.grad = None
        loss.backward()
        parts = [torch.zeros_like(p) if p.grad is None else p.grad for p in parameters]
        torch.cat([*(p.reshape(-1) for p in parts), loss.detach().reshape(1), torch.ones_like(row[:1])], out=row)
        row *= self.shard.share


def _several(batches, begin, parameters, count):
    mine = [_Stream(batches, begin(), Shard(i, count)) for i in range(workers.index(), count, workers.count())]
    sizes = [p.numel() for p in parameters]
    while True:
        own = parameters[0].new_zeros(-(-count // workers.count()), sum(sizes) + 2)
        for stream, row in zip(mine, own):
            stream.step(parameters, row)
        # Shard i is row i // workers of worker i % workers.
        rows = workers.gathered(own).transpose(0, 1).flatten(0, 1)
        total = rows[0].clone()
        for row in rows[1:count]:
            total += row
        if not total[-1]:
            return
        total /= total[-1].clone()
        for parameter, gradient in zip(parameters, total.split([*sizes, 2])):
            parameter.grad = gradient.view_as(parameter)
        yield total[-2]
