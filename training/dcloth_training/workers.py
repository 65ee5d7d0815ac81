"""The processes of one training, where torchrun started several: worker 0 of 1 where it did not.

All run the same program on the same files. Worker 0 alone writes results, validates and prints.
"""
import contextlib
import ctypes
import datetime
import os

import torch
from torch import distributed

# the others wait while worker 0 validates; where one ends, the rest are told at once
PATIENCE = datetime.timedelta(days=7)
_SET_THREADS = [f"{prefix}openblas_set_num_threads{suffix}" for prefix in ("", "scipy_") for suffix in ("", "64_")]


def _together():
    return distributed.is_available() and distributed.is_initialized()


def index():
    return distributed.get_rank() if _together() else 0


def count():
    return distributed.get_world_size() if _together() else 1


def first():
    return index() == 0


def called(name):
    """How errors name this process."""
    number = os.environ.get("RANK", "0") if _started_by_torchrun() else "0"
    return name if number == "0" else f"{name}, worker {number}"


def _started_by_torchrun():
    return distributed.is_available() and distributed.is_torchelastic_launched()


def use_threads(wanted):
    """PyTorch and OpenBLAS on so many threads: both split sums by their number, so that torchrun's OMP_NUM_THREADS=1,
    or a training before this one in the same process, would give other bits."""
    torch.set_num_threads(wanted)
    try:
        with open("/proc/self/maps", encoding="utf-8") as file:
            paths = {line.split()[-1] for line in file if "blas" in line}
    except OSError:
        return
    for path in sorted(paths):
        with contextlib.suppress(OSError):
            loaded = ctypes.CDLL(path)
            for name in _SET_THREADS:
                if hasattr(loaded, name):
                    getattr(loaded, name)(wanted)


@contextlib.contextmanager
def joined(options):
    """Inside the block the processes that torchrun started work together."""
    if not _started_by_torchrun() or int(os.environ["WORLD_SIZE"]) == 1:
        yield
        return
    wanted = int(os.environ["WORLD_SIZE"])
    if wanted > options.shards:
        raise ValueError(f"--shards {options.shards}: found {wanted} workers; each needs a shard: give more shards, 8 "
                         "at most, or start fewer workers")
    if options.device == "cuda":
        here, gpus = int(os.environ["LOCAL_RANK"]), torch.cuda.device_count()
        if here >= gpus:
            raise ValueError(f"--device cuda: {os.environ['LOCAL_WORLD_SIZE']} workers and {gpus} GPUs on this "
                             f"machine; start --nproc_per_node {gpus}")
        torch.cuda.set_device(here)
    distributed.init_process_group("nccl" if options.device == "cuda" else "gloo", timeout=PATIENCE)
    try:
        yield
    finally:
        distributed.destroy_process_group()


@contextlib.contextmanager
def _meeting():
    try:
        yield
    except RuntimeError as error:
        raise ValueError(f"lost another worker; what ended it is told there ({str(error).splitlines()[0]})") from None


def _device():
    return torch.device("cuda",
                        torch.cuda.current_device()) if distributed.get_backend() == "nccl" else torch.device("cpu")


def from_first(make):
    """Worker 0's make(), given to all."""
    if count() == 1:
        return make()
    held = [make() if first() else None]
    with _meeting():
        distributed.broadcast_object_list(held, device=_device())
    return held[0]


@torch.no_grad()
def same(module):
    """Worker 0's parameters and buffers in every worker's module. They are the same already where all processors
    are."""
    if count() == 1:
        return
    for tensor in (*module.parameters(), *module.buffers()):
        sent = tensor.detach().contiguous()
        with _meeting():
            distributed.broadcast(sent, 0)
        tensor.copy_(sent)


def gathered(own):
    """[workers, ...]: own [...] of every worker."""
    if count() == 1:
        return own[None]
    found = [torch.empty_like(own) for _ in range(count())]
    with _meeting():
        distributed.all_gather(found, own)
    return torch.stack(found)


def divided(items, work):
    """work(items) in every worker, where it finds files in place of what another one did: each does a share first."""
    if count() > 1:
        for some in ([] if first() else None, items[index()::count()]):     # worker 0 makes the folder ready
            if some is not None:
                work(some)
            with _meeting():
                distributed.barrier()
    work(items)
