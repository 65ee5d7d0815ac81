"""What `run` writes for Blender is opened in Blender, where there is one: the mesh with a point cache on it moves as the
garment does. Debian: apt-get install blender."""
import json
import shutil
import subprocess

import numpy as np
import pytest

import safetensors_file

SCRIPT = """
import bpy, json, sys
mesh, cache, kind, frames, out = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.obj_import(filepath=mesh)
garment = bpy.context.selected_objects[0]
modifier = garment.modifiers.new("Cloth", "MESH_CACHE")
modifier.cache_format, modifier.filepath, modifier.frame_start = kind, cache, 0
scene, seen = bpy.context.scene, []
scene.render.fps = 30
for frame in range(int(frames)):
    scene.frame_set(frame)
    evaluated = garment.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = [list(evaluated.matrix_world @ v.co) for v in evaluated.to_mesh().vertices]
    seen.append(world)
    evaluated.to_mesh_clear()
json.dump({"positions": seen, "faces": [list(p.vertices) for p in garment.data.polygons]}, open(out, "w"))
"""


@pytest.mark.parametrize("kind", ["pc2", "mdd"])
def test_blender_plays_the_garment(kind, dcloth, files, tmp_path):
    blender = shutil.which("blender")
    if blender is None:
        pytest.skip("Blender is not installed: point caches are not opened in it")
    cache, mesh = tmp_path / f"cloth.{kind}", tmp_path / "cloth.obj"
    assert dcloth("run", files.model, files.bare, "-o", cache, "--mesh", mesh).returncode == 0
    assert dcloth("run", files.model, files.bare, "-o", tmp_path / "cloth.safetensors").returncode == 0
    (tmp_path / "play.py").write_text(SCRIPT)
    result = subprocess.run([blender, "-b", "--factory-startup", "-noaudio", "-P", tmp_path / "play.py", "--", mesh, cache,
                             kind.upper(), "20", tmp_path / "seen.json"], capture_output=True, text=True, timeout=600, check=False)
    assert (tmp_path / "seen.json").exists(), result.stdout + result.stderr
    seen = json.loads((tmp_path / "seen.json").read_text())
    tensors = safetensors_file.read(tmp_path / "cloth.safetensors")[0]
    wanted = tensors["positions"][..., [0, 2, 1]] * np.float32([1, -1, 1])     # our +Y up is Blender's +Z
    # Blender turns the object by 90 degrees in float32: three roundings of coordinates below 4 m.
    assert np.abs(np.array(seen["positions"]) - wanted).max() < 3 * 4 * np.finfo(np.float32).eps
    assert np.abs(np.diff(wanted, axis=0)).max() > 1e-3
    assert seen["faces"] == tensors["faces"].tolist()
