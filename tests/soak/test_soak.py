"""A short soak keeps every promise, draws the same with one thread and two, and notices each broken promise."""
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
import small_garment


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Model and poses of the small garment."""
    folder = tmp_path_factory.mktemp("soak")
    bundle, model, poses = folder / "bundle.safetensors", folder / "model.dcloth", folder / "poses.f32"
    small_garment.write_bundle(bundle)
    dcloth = os.environ["DCLOTH_BIN"]
    subprocess.run([dcloth, "convert", bundle, "-o", model, "--precision", "int8"], check=True,
                   stdout=subprocess.DEVNULL)
    inspected = json.loads(subprocess.run([dcloth, "inspect", model, "--json"], check=True, capture_output=True).stdout)
    order = [small_garment.JOINTS.index(name) for name in inspected["joints"]]
    small_garment.motion(300, 30)[:, order].astype(np.float32).tofile(poses)
    return model, poses


def soak(played, *more):
    return subprocess.run([os.environ["DCLOTH_SOAK"], *map(str, played), "--instances", "10", *more],
                          capture_output=True, text=True)


def test_promises_are_kept_whatever_the_threads(played):
    hashes = set()
    for threads in ("1", "2", "3"):
        done = soak(played, "--hours", "0.02", "--threads", threads)
        assert done.returncode == 0, done.stderr
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        assert len(lines) == 21 and sum(line.get("updates", 0) for line in lines) > 10000
        hashes.add(lines[-1]["hash"])
    assert len(hashes) == 1


@pytest.mark.parametrize("fault, word", [("leak", "the heap grew"), ("canary", "the canary drew"),
                                         ("reach", "left its character"), ("slow", "percentile")])
def test_broken_promises_are_noticed(played, fault, word):
    done = soak(played, "--hours", "0.005", "--strict", "--fault", fault)
    assert done.returncode == 1
    assert word in done.stderr


def test_a_busy_machine_breaks_no_promise(played):
    done = soak(played, "--hours", "0.005", "--strict", "--fault", "busy")
    assert done.returncode == 0, done.stderr
