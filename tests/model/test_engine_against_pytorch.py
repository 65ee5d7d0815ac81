"""The C++ engine against the PyTorch network in float64 on the same stored weights, stage by stage."""
import numpy as np
import pytest
import torch

from conftest import dcloth
from dcloth_training import bundle, reference, safetensors_io, sequence

MOST_MM = 0.05  # any vertex, any frame
FEWEST_FRAMES = 300


@pytest.fixture(scope="module")
def network(garment):
    net, rig, _, _ = bundle.read(str(garment.bundle), torch.float64)
    return net, rig


@pytest.mark.parametrize("stages", ["static", "skeleton", "mesh"])
def test_engine_matches_pytorch(garment, models, network, stages, tmp_path):
    net, rig = network
    frames, worst = 0, {}
    for path in garment.sequences:
        item = sequence.read(str(path))
        with torch.no_grad():
            last = "patch" if net.patch is not None and stages != "static" else stages
            expected = reference.run(net, rig, reference.matrices_for(item, rig), last, wind=item.wind).numpy()
        out = tmp_path / path.name
        dcloth("run", models["fp32"], path, "-o", out, "--stages", stages)
        found = safetensors_io.read(str(out))[0]["positions"]
        assert found.shape == expected.shape
        worst[path.stem] = 1e3 * float(np.linalg.norm(found - expected, axis=-1).max())
        frames += len(found)
    print(f"{stages}: largest vertex difference in mm over {frames} frames: {worst}")
    assert frames >= FEWEST_FRAMES
    assert max(worst.values()) <= MOST_MM
