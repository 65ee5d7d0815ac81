"""Training by several workers: the bits of one process, resumed too; how batches are cut and gradients summed."""
import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest
import torch

from conftest import SMALL
from dcloth_training import checkpoint, shards, workers

TRAINING = os.path.join(os.path.dirname(__file__), "..")
# Four shards: two of them give the same sum in any order. Enough windows for a group of stage 3 in each.
OPTIONS = [*SMALL, "--shards", "4", "--settle-epochs", "2", "--mesh-windows", "32"]
TRAIN = ["-m", "dcloth_training.train"]
# 9:1, about a worker that is not there: Python 3.11 finds no member for the default, 0, in PyTorch 1.13's enumeration.
TORCHRUN = ["-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2", "--redirects", "9:1", "--tee",
            "9:1"]
STOPPED = """
import sys
from dcloth_training import checkpoint, loop, train
real = checkpoint.save
def save(path, state):
    real(path, state)
    if path.endswith("skeleton.safetensors") and state["epoch"] == 10:
        raise ValueError("stopped by the test")
loop.checkpoint.save = save
sys.exit(train.main())
"""


def _python(*words, **more):
    environment = {k: v for k, v in os.environ.items() if k not in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    environment.update(more, PYTHONPATH=TRAINING)
    return subprocess.run([sys.executable, *map(str, words)], env=environment, capture_output=True, text=True,
                          check=False, timeout=600)


def _train(tiny, out, *how):
    ended = _python(*how, "--data", tiny, "--out", out, *OPTIONS)
    assert ended.returncode == 0, ended.stderr
    return ended


def _bits(value, name=""):
    """{place: bits} of all tensors and numbers of a checkpoint, but times."""
    if isinstance(value, (dict, list, tuple)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {k: v for key, item in items for k, v in _bits(item, f"{name}/{key}").items()}
    if name.endswith(("/seconds", "/minutes", "/options", "/provenance")):
        return {}
    return {name: value.numpy().tobytes() if isinstance(value, torch.Tensor) else value}


def _all_bits(folder):
    return {path.name: _bits(checkpoint.load(str(path))) for path in sorted(folder.glob("*.safetensors"))}


@pytest.mark.long
def test_two_workers_give_the_bits_of_one_and_go_on_where_one_or_two_stopped(tiny, tmp_path):
    _train(tiny, tmp_path / "one", *TRAIN)
    expected = _all_bits(tmp_path / "one")
    assert {f"{step}.safetensors" for step in ("static", "skeleton_settle", "mesh_layers", "network")} <= set(expected)

    (tmp_path / "stopped.py").write_text(STOPPED)
    ended = _python(*TORCHRUN, tmp_path / "stopped.py", "--data", tiny, "--out", tmp_path / "two", *OPTIONS)
    # and the other worker ended, too
    assert ended.returncode and "train: error: stopped by the test" in ended.stderr
    assert checkpoint.load(str(tmp_path / "two" / "skeleton.safetensors"))["epoch"] == 10
    shutil.copytree(tmp_path / "two", tmp_path / "then one")

    told = _train(tiny, tmp_path / "two", *TORCHRUN, *TRAIN).stdout
    assert told.count("skeleton: epoch 20/20") == 1 and "skeleton: epoch 10/20" not in told
    _train(tiny, tmp_path / "then one", *TRAIN)
    for folder in ("two", "then one"):
        found = _all_bits(tmp_path / folder)
        differ = [f"{file}{name}" for file, values in expected.items() for name in values
                  if found[file].get(name) != values[name]]
        assert found.keys() == expected.keys() and not differ, (folder, differ[:5])


def test_shards_part_each_batch_among_themselves():
    order, parts = torch.arange(21), []
    for number in range(4):
        generator = torch.Generator().manual_seed(5)
        shard, other = shards.Shard(number, 4), shards.Shard(number, 4)
        mine = [(rows.tolist(), shard.share) for rows in shard.batches(order, 8, generator)]
        assert other.part(list(range(21)), torch.Generator().manual_seed(5)) == list(range(number, 21, 4))
        parts.append((mine, torch.rand(1, generator=generator)))
    for batch in (0, 1):
        assert sorted(i for mine, _ in parts for i in mine[batch][0]) == list(range(8 * batch, 8 * batch + 8))
        assert [mine[batch][1] for mine, _ in parts] == [0.25] * 4
    assert [mine[2] for mine, _ in parts] == [([16, 20], 0.4), ([17], 0.2), ([18], 0.2), ([19], 0.2)]
    assert len({float(own) for _, own in parts}) == 4       # random numbers of their own
    assert [len(list(shards.Shard(i, 4).batches([1, 2], 8, torch.Generator()))) for i in range(4)] == [1, 1, 0, 0]
    generator = torch.Generator().manual_seed(5)
    assert [rows.tolist() for rows in shards.WHOLE.batches(order, 16, generator)] == [list(range(16)),
                                                                                      list(range(16, 21))]
    assert torch.equal(generator.get_state(), torch.Generator().manual_seed(5).get_state())


@pytest.mark.parametrize("count", shards.COUNTS)
def test_shards_sum_to_the_gradient_of_the_batch(count):
    """Of unequal shards too, where there are more shards than items, and with its mean loss."""
    torch.manual_seed(1)
    module, x = torch.nn.Linear(3, 2).double(), torch.randn(21, 3, dtype=torch.float64)
    parameters = list(module.parameters())

    def batches(generator, shard=shards.WHOLE):
        for rows in shard.batches(torch.randperm(21, generator=generator), 16, generator):
            yield module(x[rows]).square().sum(1).mean()

    def begin():
        return torch.Generator().manual_seed(7)

    found = [(float(loss), *(p.grad.clone() for p in parameters))
             for loss in shards.steps(batches, begin, parameters, count)]
    order = torch.randperm(21, generator=begin())
    assert len(found) == 2
    for rows, (loss, *gradient) in zip(order.split(16), found):
        module.zero_grad()
        expected = module(x[rows]).square().sum(1).mean()
        expected.backward()
        assert loss == pytest.approx(float(expected), rel=1e-12)
        assert all(torch.allclose(g, p.grad, rtol=1e-12) for g, p in zip(gradient, parameters))


def test_the_noise_of_a_shard_is_its_own_and_the_same_each_time():
    parameter = torch.zeros(1, requires_grad=True)

    def draws():
        out = {}

        def batches(_, shard):
            for _ in range(3):
                out.setdefault(shard.number, []).append(float(torch.rand(1)))
                yield parameter.sum()

        list(shards.steps(batches, lambda: torch.Generator().manual_seed(3), [parameter], 4))
        return out

    first = draws()
    assert len({number for numbers in first.values() for number in numbers}) == 12
    torch.rand(5)
    assert draws() == first


def test_workers_without_a_shard_or_a_gpu_are_refused(monkeypatch):
    for name, value in {"TORCHELASTIC_RUN_ID": "a", "WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2", "RANK": "1",
                        "LOCAL_RANK": "1"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    for options, told in ((SimpleNamespace(shards=1, device="cpu"), "--shards 1: found 2 workers"),
                          (SimpleNamespace(shards=2, device="cuda"), "2 workers and 1 GPUs")):
        with pytest.raises(ValueError, match=told), workers.joined(options):
            pass
    assert workers.called("train") == "train, worker 1"
    monkeypatch.setenv("WORLD_SIZE", "1")
    with workers.joined(SimpleNamespace(shards=1, device="cpu")):
        assert (workers.index(), workers.count()) == (0, 1)


def test_blas_sums_on_as_many_threads_as_asked_for():
    """OpenBLAS gives other bits on one thread, and torchrun sets OMP_NUM_THREADS=1."""
    program = """
import hashlib, numpy as np, torch
from dcloth_training import workers
a, b = (np.random.default_rng(0).standard_normal(s).astype(np.float32) for s in ((300, 6000), (6000, 40)))
print(hashlib.sha256((a @ b).tobytes()).hexdigest())
workers.use_threads(2)
print(hashlib.sha256((a @ b).tobytes()).hexdigest())
"""
    (as_one, one), (as_two, two) = (_python("-c", program, OMP_NUM_THREADS=n).stdout.split() for n in "12")
    if as_one == as_two:
        pytest.skip("the BLAS of numpy gives the same bits on any number of threads")
    assert one == two == as_two
