"""The comparison on the tiny garment: each family learns, repeats its bits, and has its row."""
import shutil

import numpy as np
import pytest
import torch

from conftest import hang, poses, tube
from conftest import NAMES
from dcloth_training import dataset, sequence
from dcloth_training.compare import __main__ as command


@pytest.fixture(scope="module")
def data(tiny, tmp_path_factory):
    """The tiny folder with one clip more, which the patched HELD_OUT names."""
    folder = tmp_path_factory.mktemp("compare") / "data"
    shutil.copytree(tiny, folder)
    matrices = poses(30, np.random.default_rng(11)).astype(np.float32)
    truth = hang(matrices.astype(np.float64), tube(0.2, 6, 10, 1.0, 0.5)[0])
    sequence.write(folder / "dynamic" / "a-unseen.safetensors",
                   sequence.Sequence(matrices, truth, NAMES, 30.0, "a/unseen", "dynamic"))
    return folder


@pytest.fixture(autouse=True)
def held_out(monkeypatch):
    monkeypatch.setattr(dataset, "HELD_OUT", ("a/unseen",))


def run(data, full, out, *more):
    return command.run(command.arguments(["--data", str(data), "--full", str(full),
                                          "--out", str(out), *more]))


def test_smoke(data, trained, tmp_path):
    t = run(data, trained[1], tmp_path)
    print(open(tmp_path / "table.md").read())
    assert 0
