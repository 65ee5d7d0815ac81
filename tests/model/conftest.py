"""The bundled garment, the built tool, and models converted once for all tests."""
import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUNDLE = ROOT / "models/skirt/skirt.safetensors"
SEQUENCES = sorted((ROOT / "models/skirt/sequences").glob("*.safetensors"))
PRECISIONS = ("fp32", "fp16", "int8")


def dcloth(*arguments):
    """Runs the tool; its standard output."""
    done = subprocess.run([os.environ["DCLOTH_BIN"], *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, f"dcloth {' '.join(map(str, arguments))}: {done.returncode}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="session")
def models(tmp_path_factory):
    """Path of the model in each precision."""
    folder = tmp_path_factory.mktemp("models")
    paths = {precision: folder / f"skirt-{precision}.dcloth" for precision in PRECISIONS}
    for precision, path in paths.items():
        dcloth("convert", BUNDLE, "-o", path, "--precision", precision)
    return paths
