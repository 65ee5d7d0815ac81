"""From an artist's files to what training reads: a character and its animation as Blender wrote them, the cloth on it
as point caches, one command."""
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import safetensors_file
import small_garment

DATA = Path(__file__).parent / "data"
TRAINING = Path(__file__).parents[2] / "training"
sys.path.insert(0, str(TRAINING / "tests"))
import cache_files

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
RINGS, COLUMNS = 9, 12


@pytest.fixture(scope="module")
def cloth():
    """A tube about the hips that goes where they go: template [n, 3], polygons, positions [20, n, 3]."""
    tensors, metadata = safetensors_file.read(DATA / "walker.safetensors")
    hips = json.loads(metadata["joint_names"]).index("Hips")
    template, _ = small_garment.tube(np.full(RINGS, 0.2), np.linspace(1.05, 0.6, RINGS), (0, 0), COLUMNS)
    polygons = [(r * COLUMNS + a, (r + 1) * COLUMNS + a, (r + 1) * COLUMNS + b, r * COLUMNS + b)
                for r in range(RINGS - 1) for a, b in zip(range(COLUMNS), [*range(1, COLUMNS), 0])]
    rest, frames = Z_UP @ tensors["rest"][hips].astype(float), Z_UP @ tensors["frames"][:, hips].astype(float)
    moves = frames @ np.linalg.inv(rest)
    positions = np.einsum("tij,nj->tni", moves[:, :3, :3], template) + moves[:, None, :3, 3]
    return template, polygons, positions.astype(np.float32)


def run(binary, project, out):
    command = [sys.executable, "-m", "dcloth_training.import_truth", str(project), "--out", str(out), "--dcloth",
               binary]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False,
                          env={**os.environ, "PYTHONPATH": str(TRAINING), "OMP_NUM_THREADS": "1"})


def test_one_command_makes_a_dataset(binary, cloth, tmp_path):
    template, polygons, positions = cloth
    cache_files.write_obj(tmp_path / "skirt.obj", template, polygons)
    cache_files.write_mdd(tmp_path / "a.mdd", positions)
    cache_files.write_alembic(tmp_path / "a.abc", positions * np.float32(100), polygons, first=1 / 30)
    cache_files.write_pc2(tmp_path / "a.pc2", positions)
    project = tmp_path / "skirt.json"
    project.write_text(json.dumps({
        "character": str(DATA / "walker.glb"), "garment": "skirt.obj", "defaults": {"animation_clip": "0"},
        "clips": [{"name": "gltf", "animation": str(DATA / "walker.glb"), "cache": "a.mdd"},
                  {"name": "fbx", "animation": str(DATA / "walker.fbx"), "cache": "a.abc", "unit": "cm"},
                  {"name": "bvh", "animation": str(DATA / "walker.bvh"), "animation_up": "z", "cache": "a.pc2",
                   "fps": 30}]}))
    result = run(binary, project, tmp_path / "out")
    if "built without assimp" in result.stderr:
        pytest.skip("dcloth was built without assimp: importing artists' files is not tested")
    assert result.returncode == 0, result.stderr
    read = {n: safetensors_file.read(tmp_path / "out" / "dynamic" / f"{n}.safetensors")[0]
            for n in ("gltf", "fbx", "bvh")}
    eps = np.finfo(np.float32).eps
    for name, tensors in read.items():
        assert tensors["joint_matrices"].shape == (20, 6, 4, 4), name
        # Ten float32 roundings of numbers below 2, as in test_poses.py; a unit rounds twice.
        assert np.abs(tensors["joint_matrices"] - read["gltf"]["joint_matrices"]).max() < 2 * 10 * 2 * eps, name
        assert np.abs(tensors["truth"] - positions).max() <= (2 * 2 * eps if name == "fbx" else 0), name
    assert (tmp_path / "out" / "static" / "drapes-of-clips.safetensors").exists()
    character = safetensors_file.read(tmp_path / "out" / "character.safetensors")[0]
    assert np.array_equal(character["cloth_template"], template.astype(np.float32))


def test_what_the_command_line_refuses_is_passed_on(binary, cloth, tmp_path):
    template, polygons, positions = cloth
    cache_files.write_obj(tmp_path / "skirt.obj", template, polygons)
    cache_files.write_mdd(tmp_path / "a.mdd", positions)
    (tmp_path / "skirt.json").write_text(json.dumps({
        "character": str(DATA / "walker.bvh"), "garment": "skirt.obj",
        "clips": [{"name": "walk", "animation": str(DATA / "walker.glb"), "cache": "a.mdd"}]}))
    result = run(binary, tmp_path / "skirt.json", tmp_path / "out")
    assert result.returncode == 2 and "Traceback" not in result.stderr, result.stderr
    assert "no skinned surface" in result.stderr or "built without assimp" in result.stderr
