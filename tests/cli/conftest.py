"""The binary under test (environment variable DCLOTH_BIN) and a small garment that all tests share."""
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import small_garment


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
