"""What `run` writes is opened in Blender, where there is one, and what Blender writes is read. Debian: apt-get install
blender."""
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import safetensors_file

sys.path.insert(0, str(Path(__file__).parents[2] / "training"))
from dcloth_training.truth import cache

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
    result = subprocess.run([blender, "-b", "--factory-startup", "-noaudio", "-P", tmp_path / "play.py", "--", mesh,
                             cache, kind.upper(), "20", tmp_path / "seen.json"],
                            capture_output=True, text=True, timeout=600, check=False)
    assert (tmp_path / "seen.json").exists(), result.stdout + result.stderr
    seen = json.loads((tmp_path / "seen.json").read_text())
    tensors = safetensors_file.read(tmp_path / "cloth.safetensors")[0]
    wanted = tensors["positions"][..., [0, 2, 1]] * np.float32([1, -1, 1])     # our +Y up is Blender's +Z
    # Blender turns the object by 90 degrees in float32: three roundings of coordinates below 4 m.
    assert np.abs(np.array(seen["positions"]) - wanted).max() < 3 * 4 * np.finfo(np.float32).eps
    assert np.abs(np.diff(wanted, axis=0)).max() > 1e-3
    assert seen["faces"] == tensors["faces"].tolist()


WRITE = """
import bpy, json, math, sys
import numpy as np
out = sys.argv[sys.argv.index("--") + 1]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps, scene.frame_start, scene.frame_end = 30, 1, 9
points = [(0.1 * c, 0.02 * r * c, 1 - 0.1 * r) for r in range(5) for c in range(6)]
faces = [(r * 6 + c, r * 6 + 6 + c, r * 6 + 7 + c, r * 6 + c + 1) for r in range(4) for c in range(5)]
mesh = bpy.data.meshes.new("Cloth")
mesh.from_pydata(points, [], faces)
cloth = bpy.data.objects.new("Cloth", mesh)
scene.collection.objects.link(cloth)
cloth.shape_key_add(name="Basis")
key = cloth.shape_key_add(name="Moved")
for i, move in enumerate(np.random.default_rng(0).normal(0, 0.05, (30, 3))):
    key.data[i].co = (np.array(points[i]) + move).tolist()
for frame in range(1, 10):
    key.value = math.sin(0.2 * frame)
    key.keyframe_insert("value", frame=frame)
cloth.select_set(True)
bpy.context.view_layer.objects.active = cloth
seen = []
for frame in range(1, 10):
    scene.frame_set(frame)
    evaluated = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get())
    seen.append([list(v.co) for v in evaluated.to_mesh().vertices])
    evaluated.to_mesh_clear()
bpy.ops.preferences.addon_enable(module="io_export_pc2")
bpy.ops.preferences.addon_enable(module="io_shape_mdd")
bpy.ops.export_shape.pc2(filepath=out + "/a.pc2", rot_x90=False, world_space=True, apply_modifiers=True, range_start=1,
                         range_end=9)
bpy.ops.export_shape.mdd(filepath=out + "/a.mdd", fps=30, frame_start=1, frame_end=9, use_rest_frame=False)
json.dump(seen, open(out + "/seen.json", "w"))
"""


def test_caches_that_blender_writes_are_read(tmp_path):
    blender = shutil.which("blender")
    if blender is None:
        pytest.skip("Blender is not installed: its own PC2 and MDD files are not read")
    (tmp_path / "write.py").write_text(WRITE)
    result = subprocess.run([blender, "-b", "--factory-startup", "-noaudio", "-P", tmp_path / "write.py", "--",
                             tmp_path],
                            capture_output=True, text=True, timeout=600, check=False)
    assert (tmp_path / "seen.json").exists(), result.stdout + result.stderr
    seen = np.array(json.loads((tmp_path / "seen.json").read_text()), np.float32)
    pc2, mdd = cache.read_pc2(str(tmp_path / "a.pc2")), cache.read_mdd(str(tmp_path / "a.mdd"))
    assert np.array_equal(pc2.positions, seen) and pc2.frames == list(range(1, 10))
    assert np.array_equal(mdd.positions, seen) and np.abs(mdd.seconds - np.arange(9) / 30).max() < 1e-6
    assert np.abs(np.diff(seen, axis=0)).max() > 1e-3
