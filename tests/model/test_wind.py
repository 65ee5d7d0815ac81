"""A garment that reads the air, from its bundle to the vertices: the engine draws what PyTorch does, in any wind."""
import numpy as np
import pytest
import torch

from conftest import dcloth
from dcloth_training import bundle, reference, safetensors_io, sequence, synthetic

FRAMES = 40
MOST_MM = 0.02      # fp32, any vertex, any frame; accelerations carry 900 times the rounding of float positions


@pytest.fixture(scope="module")
def garment(tmp_path_factory):
    """(bundle, sequence) with a gust that turns."""
    t = np.arange(FRAMES)[:, None] / 10
    wind = np.concatenate([5 * np.sin(t), 0 * t + 0.5, 3 - 4 * np.cos(2 * t)], 1).astype(np.float32)
    return synthetic.write(tmp_path_factory.mktemp("air"), synthetic.PRESETS["small"], FRAMES, root="air", wind=wind)


@pytest.fixture(scope="module")
def model(garment, tmp_path_factory):
    path = tmp_path_factory.mktemp("air") / "garment.dcloth"
    dcloth("convert", garment[0], "-o", path, "--precision", "fp32")
    return path


def run(model, clip, folder, *arguments):
    dcloth("run", model, clip, "-o", folder / "out.safetensors", *arguments)
    return safetensors_io.read(str(folder / "out.safetensors"))[0]["positions"]


def test_engine_matches_the_reference_in_wind(garment, model, tmp_path):
    net, rig, _, _ = bundle.read(garment[0], torch.float64)
    assert rig.root_motion == "air"
    item = sequence.read(garment[1])
    calm = tmp_path / "calm.safetensors"
    sequence.write(calm, sequence.Sequence(item.joint_matrices, None, item.joint_names, item.fps, "calm", "dynamic"))
    steady = np.tile(np.float32([-4, 0, 2.5]), (FRAMES, 1))
    drawn = []
    for clip, wind, arguments in ((garment[1], item.wind, ()), (calm, None, ()), (calm, steady, ("--wind=-4,0,2.5",)),
                                  (garment[1], steady, ("--wind=-4,0,2.5",))):
        with torch.no_grad():
            expected = reference.run(net, rig, reference.matrices_for(item, rig), wind=wind).numpy()
        drawn.append(run(model, clip, tmp_path, *arguments))
        found = 1e3 * np.linalg.norm(drawn[-1] - expected, axis=-1)
        print(arguments, f"mean {found.mean():.5f} mm, max {found.max():.5f}")
        assert found.max() <= MOST_MM
    assert all(1e3 * np.linalg.norm(a - b, axis=-1).mean() > 1 for a, b in zip(drawn, drawn[1:3]))   # mm: it blows
    assert np.array_equal(drawn[2], drawn[3])
