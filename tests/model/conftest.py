"""The bundled garments, the built tool, and models converted once for all tests."""
import os
import pathlib
import subprocess
from types import SimpleNamespace

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
GARMENTS = sorted(path.parent for path in (ROOT / "models").glob("*/*.safetensors") if path.stem == path.parent.name)
assert GARMENTS, "models/ holds no garment"
PRECISIONS = ("fp32", "fp16", "int8")


def dcloth(*arguments):
    """Runs the tool; its standard output."""
    done = subprocess.run([os.environ["DCLOTH_BIN"], *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, f"dcloth {' '.join(map(str, arguments))}: {done.returncode}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="session", params=GARMENTS, ids=lambda folder: folder.name)
def garment(request):
    """name, bundle, and sequences with truth, none of which the garment was trained on."""
    folder = request.param
    return SimpleNamespace(name=folder.name, bundle=folder / f"{folder.name}.safetensors",
                           sequences=sorted((folder / "sequences").glob("*.safetensors")))


@pytest.fixture(scope="session")
def models(garment, tmp_path_factory):
    """Path of the model in each precision."""
    folder = tmp_path_factory.mktemp("models")
    paths = {precision: folder / f"{garment.name}-{precision}.dcloth" for precision in PRECISIONS}
    for precision, path in paths.items():
        dcloth("convert", garment.bundle, "-o", path, "--precision", precision)
    return paths
