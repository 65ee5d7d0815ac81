"""What the tests share: the installed wheel, the bundled skirt converted by it, and the C++ host's vertices (`dcloth
run`).

scripts/test_python.sh runs them in an empty folder with the wheel in an environment of its own.
"""
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import dcloth
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

REPOSITORY = Path(__file__).parents[3]
SKIRT = REPOSITORY / "models/skirt"


@pytest.fixture(scope="session")
def command():
    """Calls the `dcloth` of the environment, the console script that pip has made."""
    program = Path(sys.prefix) / ("Scripts/dcloth.exe" if os.name == "nt" else "bin/dcloth")

    def call(*arguments):
        return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=600)
    return call


@pytest.fixture(scope="session")
def skirt(tmp_path_factory):
    """The bundle, its int8 model, and the conversion's report."""
    folder = tmp_path_factory.mktemp("skirt")
    model, bundle = folder / "skirt.dcloth", SKIRT / "skirt.safetensors"
    report = dcloth.convert(bundle, model, precision="int8")
    return SimpleNamespace(bundle=bundle, model=model, report=report,
                           sequence=SKIRT / "sequences/walk_turn.safetensors")


@pytest.fixture(scope="session")
def walk(skirt):
    """The sequence's joint names, [T, J, 4, 4] poses and rate."""
    with safe_open(skirt.sequence, "np") as file:
        metadata = file.metadata()
        return SimpleNamespace(names=json.loads(metadata["joint_names"]), fps=float(metadata["fps"]),
                               poses=file.get_tensor("joint_matrices"))


@pytest.fixture(scope="session")
def short(skirt, tmp_path_factory):
    """The path of the sequence's first 40 frames, with their truth."""
    path = tmp_path_factory.mktemp("short") / "short.safetensors"
    with safe_open(skirt.sequence, "np") as file:
        save_file({name: file.get_tensor(name)[:40].copy() for name in set(file.keys())}, path, file.metadata())
    return path


@pytest.fixture(scope="session")
def native(skirt, tmp_path_factory):
    """[T, n, 3] of the C++ host: DCLOTH_TOOL where it is set, else the wheel's own command."""
    tool, folder = os.environ.get("DCLOTH_TOOL") or dcloth.command_path(), tmp_path_factory.mktemp("native")

    def run(*options):
        out = folder / f"run{''.join(map(str, options))}.safetensors"
        subprocess.run([tool, "run", skirt.model, skirt.sequence, "-o", out, *map(str, options)], check=True,
                       timeout=600)
        with safe_open(out, "np") as file:
            return file.get_tensor("positions")
    return run
