"""The binary under test (environment variable DCLOTH_BIN), a small garment and a character that tests share."""
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import safetensors_file
import small_garment

DATA = Path(__file__).parent / "data"


@pytest.fixture(scope="session")
def binary():
    path = os.environ.get("DCLOTH_BIN")
    if not path or not os.access(path, os.X_OK):
        pytest.exit("set DCLOTH_BIN to the built dcloth executable", returncode=2)
    return path


@pytest.fixture(scope="session")
def dcloth(binary):
    def call(*arguments, timeout=300):
        result = subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True, timeout=timeout)
        assert result.returncode >= 0, f"killed by signal {-result.returncode}: {arguments}\n{result.stderr}"
        return result
    return call


@pytest.fixture(scope="session")
def files(tmp_path_factory, dcloth):
    """bundle, two sequences with truth, one without, and an fp32 model."""
    folder = tmp_path_factory.mktemp("garment")
    made = SimpleNamespace(folder=folder, bundle=folder / "skirt.safetensors", walk=folder / "walk.safetensors",
                           run=folder / "run.safetensors", bare=folder / "bare.safetensors",
                           model=folder / "skirt.dcloth")
    small_garment.write_bundle(made.bundle)
    small_garment.write_sequence(made.walk, small_garment.motion(40, 30))
    small_garment.write_sequence(made.run, small_garment.motion(30, 30, speed=1.6))
    small_garment.write_sequence(made.bare, small_garment.motion(20, 30), truth=False)
    result = dcloth("convert", made.bundle, "-o", made.model)
    assert result.returncode == 0, result.stderr
    return made


@pytest.fixture(scope="session")
def importing(dcloth, tmp_path_factory):
    """Skips where the command was built without assimp, and says so."""
    result = dcloth("body", DATA / "walker.fbx", "-o", tmp_path_factory.mktemp("probe") / "b.safetensors")
    if "built without assimp" in result.stderr:
        pytest.skip("dcloth was built without assimp: reading artists' files is not tested")


@pytest.fixture(scope="session")
def walker():
    """data/make_walker.py's joint names, rest [J, 4, 4], frames [20, J, 4, 4] in our axes, and the body's vertices, as
    Blender says them."""
    to_ours = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    tensors, metadata = safetensors_file.read(DATA / "walker.safetensors")
    return (json.loads(metadata["joint_names"]), to_ours @ tensors["rest"].astype(np.float64),
            to_ours @ tensors["frames"].astype(np.float64), tensors["vertices"] @ to_ours[:3, :3].T)
