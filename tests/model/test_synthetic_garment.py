"""The generator of garments of any size: what it writes converts, and the engine computes on it what PyTorch does."""
import numpy as np
import pytest
import torch

from conftest import PRECISIONS, dcloth
from dcloth_training import bundle, reference, safetensors_io, sequence, synthetic

FRAMES = 30
MOST_MM = 0.01          # fp32, any vertex, any frame: rounding of metres, no trained weights that amplify it
MOST_MEAN_MM = {"fp32": 0.001, "fp16": 0.1, "int8": 1.0}   # of 40 mm that the network moves vertices


@pytest.fixture(scope="module")
def garment(tmp_path_factory):
    return synthetic.write(tmp_path_factory.mktemp("synthetic"), synthetic.PRESETS["small"], FRAMES)


@pytest.fixture(scope="module")
def expected(garment):
    net, rig, _, _ = bundle.read(garment[0], torch.float64)
    matrices = reference.matrices_for(sequence.read(garment[1]), rig)
    with torch.no_grad():
        return {stages: reference.run(net, rig, matrices, stages).numpy() for stages in ("static", "skeleton", "mesh")}


def distances_mm(path, truth):
    return 1e3 * np.linalg.norm(safetensors_io.read(str(path))[0]["positions"] - truth, axis=-1)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_engine_matches_the_reference(garment, expected, precision, tmp_path):
    model, out = tmp_path / "garment.dcloth", tmp_path / "out.safetensors"
    dcloth("convert", garment[0], "-o", model, "--precision", precision)
    for stages, truth in expected.items():
        dcloth("run", model, garment[1], "-o", out, "--stages", stages)
        found = distances_mm(out, truth)
        print(precision, stages, f"mean {found.mean():.5f} mm, max {found.max():.5f}")
        assert found.mean() <= MOST_MEAN_MM[precision]
        assert precision != "fp32" or found.max() <= MOST_MM


def test_each_stage_moves_the_garment_as_far_as_promised(expected):
    moved = [1e3 * np.linalg.norm(expected[a] - expected[b], axis=-1).mean()
             for a, b in (("skeleton", "static"), ("mesh", "skeleton"))]
    for found, promised in zip(moved, (synthetic.SKELETON_MM, synthetic.MESH_MM)):
        assert 0.3 * promised < found < 3 * promised


def test_the_paper_preset_has_the_sizes_of_the_paper():
    s = synthetic.PRESETS["paper"]
    n, d = s.rings * s.columns, 9 * 52
    dense = lambda *widths: sum(a * b + b for a, b in zip(widths, widths[1:]))  # noqa: E731
    static = s.bones ** 2 * n + dense(d, s.static_hidden, 3 * s.bones)
    skeleton = 3 * n * s.skeleton + 3 * s.skeleton * (d + s.skeleton + 2)
    mesh = 3 * n * s.mesh + dense(n, s.hidden, s.mesh)   # the layers' own weights are 0.1 MB
    found = [round(4e-6 * count, 1) for count in (static, skeleton, mesh)]
    assert n == 7964 and found == [18.9, 40.6, 70.9]
