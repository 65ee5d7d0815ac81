"""Wind from a sequence's file through training to a bundle that runs as the network did."""
import dataclasses
import shutil

import numpy as np
import pytest
import torch

from conftest import train_tiny
from dcloth_training import bundle, dataset, export, features, network, reference, safetensors_io, sequence

QUICK = ("--root-motion", "air", "--stages", "skeleton", "--static-epochs", "2", "--skeleton-epochs", "2")


@pytest.fixture(scope="module")
def windy(tiny, tmp_path_factory):
    """The tiny garment's clips with a wind of their own."""
    folder, generator = tmp_path_factory.mktemp("windy") / "data", np.random.default_rng(4)
    shutil.copytree(tiny, folder)
    for path in sorted((folder / "dynamic").glob("*.safetensors")):
        item = sequence.read(path)
        wind = generator.normal(0, 4, (len(item.joint_matrices), 3)).astype(np.float32)
        sequence.write(path, dataclasses.replace(item, wind=wind))
    return folder


@pytest.fixture(scope="module")
def blown(windy, tmp_path_factory):
    """(what train.run returns, its folder, a bundle of it)."""
    out = tmp_path_factory.mktemp("blown")
    result = train_tiny(windy, out, *QUICK)
    net, fitted, character, provenance = export.load_trained(str(out), str(windy))
    assert fitted.rig.root_motion == "air"
    bundle.write(out / "bundle.safetensors", net, fitted, character, provenance, half=False)
    return result, out, out / "bundle.safetensors"


def held(folder):
    return sequence.read(folder / "dynamic" / "a-held.safetensors")


def test_a_sequence_keeps_its_wind(windy, tmp_path):
    item = held(windy)
    assert item.wind.shape == (len(item.joint_matrices), 3) and np.abs(item.wind).max() > 4
    tensors, metadata = export.compact(item)
    safetensors_io.write(tmp_path / "compact.safetensors", tensors, metadata)
    assert np.array_equal(sequence.read(tmp_path / "compact.safetensors").wind, item.wind)
    assert sequence.read(tmp_path / "compact.safetensors", truth=False).truth is None
    for broken, text in ((item.wind[:-1], "expected"), (np.full_like(item.wind, np.inf), "finite"),
                         (item.wind * 0 + [90, 0, 50], "103 m/s, allowed is at most 100")):
        sequence.write(tmp_path / "broken.safetensors", dataclasses.replace(item, wind=broken))
        with pytest.raises(safetensors_io.SafetensorsError, match=text):
            sequence.read(tmp_path / "broken.safetensors")


def test_a_bundle_of_air_runs_as_the_network(windy, blown):
    (net, fitted, *_), _, path = blown
    read, rig, _, metadata = bundle.read(path)
    assert metadata["root_motion"] == "air" and rig.root_motion == "air"
    assert read.standardise.mean.shape[0] % 9 == 7
    item = held(windy)
    expected = net.double().run(reference.pose_for(item, fitted.rig, torch.float64))
    net.float()
    got = reference.run(read, rig, item.joint_matrices, wind=item.wind)
    assert (got - expected).abs().max() < 1e-6
    assert (got - reference.run(read, rig, item.joint_matrices)).norm(dim=-1).mean() > 1e-4    # metres: the wind counts


def test_windows_of_air_begin_with_the_wind_of_their_first_tick(windy, blown):
    _, fitted, character, _ = blown[0]
    paths = dataset.find(str(windy), "dynamic")
    clips = dataset.load(paths, fitted.rig, character)
    item = sequence.read(paths[0])
    plain, mirrored = clips[0], clips[1]
    assert mirrored.mirrored and torch.allclose(mirrored.pose.wind, plain.pose.wind * torch.tensor([-1, 1, 1]),
                                                atol=1e-5)
    window = dataset.Window(plain, 9, dataset.WARM_UP)
    later = network.pose_of(item.joint_matrices[9:29].astype(np.float64), fitted.rig, torch.float32,
                            wind=item.wind[9:29])
    assert torch.allclose(window.x(20), later.x, atol=1e-3)
    assert torch.equal(window.x(20, reset=False), plain.pose.x[9:29])
    still = dataset.Still(plain, 9, dataset.WARM_UP).x(5)
    assert torch.equal(still[:, -features.ROOT_NUMBERS["air"]:], torch.zeros(5, 7))


def test_a_bundle_of_an_unknown_kind_is_refused(blown, tmp_path):
    tensors, metadata = safetensors_io.read(blown[2])
    safetensors_io.write(tmp_path / "odd.safetensors", tensors, {**metadata, "root_motion": "water"})
    with pytest.raises(bundle.BundleError, match="'water', expected false, true, air"):
        bundle.read(tmp_path / "odd.safetensors")
