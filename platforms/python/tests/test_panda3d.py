"""The Panda3D example: what is in Panda3D's vertex buffer is what a C++ host draws, and the pictures show the skirt."""
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("panda3d")
from panda3d import core

EXAMPLE = Path(__file__).parents[1] / "examples/panda3d_skirt.py"
EVERY = 39
ALLOWED_MM = 0.01


@pytest.fixture(scope="module")
def pictures(skirt, tmp_path_factory):
    folder = Path(os.environ.get("DCLOTH_PYTHON_PICTURES") or tmp_path_factory.mktemp("pictures"))
    subprocess.run([sys.executable, EXAMPLE, skirt.model, skirt.bundle, skirt.sequence, "-o", folder, "--every",
                    str(EVERY), "--vertices", folder / "vertices.npy"], check=True, timeout=900)
    return folder


def test_vertices_as_in_cpp(pictures, native):
    drawn, expected = np.load(pictures / "vertices.npy"), native("--outside-body")[::EVERY]
    distance = 1000 * float(np.linalg.norm(drawn.astype(np.float64) - expected, axis=-1).max())
    print(f"{len(drawn)} frames, largest distance of a vertex {distance:.6f} mm")
    assert drawn.shape == expected.shape and distance < ALLOWED_MM


def test_pictures_show_the_skirt(pictures):
    """The skirt is the one thing that is dark red: it takes its share of each picture, in the middle, and moves."""
    reds = []
    for path in sorted(pictures.glob("frame_*.png")):
        image, texture = core.PNMImage(), core.Texture()
        assert image.read(core.Filename.from_os_specific(str(path))) and texture.load(image)
        pixels = np.frombuffer(texture.get_ram_image(), np.uint8).reshape(image.get_y_size(), image.get_x_size(), -1)
        blue, green, red = (pixels[:, :, channel].astype(int) for channel in range(3))
        reds.append((red > 2 * green) & (red > 2 * blue) & (red > 40))
    assert len(reds) == 4
    for mask in reds:
        assert 0.01 < mask.mean() < 0.3
        rows, columns = np.nonzero(mask)
        assert 0.25 < rows.mean() / len(mask) < 0.75 and 0.25 < columns.mean() / len(mask) < 0.75
    assert all((a != b).mean() > 0.003 for a, b in zip(reds, reds[1:]))
