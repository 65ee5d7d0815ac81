# Made blender_cloth.abc with Blender 4.2 (the bpy package) and what Blender itself shows of it, as JSON.
import bpy
import json
import os
import numpy as np

bpy.ops.wm.read_factory_settings(use_empty=True)
s = bpy.context.scene
s.render.fps = 30
s.frame_start = 1
s.frame_end = 12
R, C = 5, 6
verts = [(0.1 * c, 0.02 * r * c, 1 - 0.1 * r) for r in range(R) for c in range(C)]
faces = [(r * C + c, (r + 1) * C + c, (r + 1) * C + c + 1, r * C + c + 1) for r in range(R - 1) for c in range(C - 1)]
m = bpy.data.meshes.new("Cloth")
m.from_pydata(verts, [], faces)
o = bpy.data.objects.new("Cloth", m)
s.collection.objects.link(o)
p = bpy.data.objects.new("Mover", None)
s.collection.objects.link(p)
o.parent = p
o.location = (0.1, 0.2, 0.3)
o.rotation_euler = (0.1, 0.2, 0.3)
o.scale = (1, 1.5, 2)
for f in range(1, 13):
    p.location = (0.1 * f, 0, 0.02 * f)
    p.rotation_euler = (0, 0, 0.1 * f)
    p.keyframe_insert("location", frame=f)
    p.keyframe_insert("rotation_euler", frame=f)
o.shape_key_add(name="Basis")
k = o.shape_key_add(name="A")
rng = np.random.default_rng(0)
for i, q in enumerate(rng.normal(0, 0.05, (len(verts), 3))):
    k.data[i].co = (np.array(verts[i]) + q).tolist()
for f in range(1, 13):
    k.value = (f - 1) / 11
    k.keyframe_insert("value", frame=f)
# a second, still mesh, and a moving one without deformation
m2 = bpy.data.meshes.new("Floor")
m2.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
o2 = bpy.data.objects.new("Floor", m2)
s.collection.objects.link(o2)
out = []
for f in range(1, 13):
    s.frame_set(f)
    d = bpy.context.evaluated_depsgraph_get()
    e = o.evaluated_get(d)
    me = e.to_mesh()
    w = np.array([list(e.matrix_world @ v.co) for v in me.vertices])
    e.to_mesh_clear()
    out.append(w.tolist())
json.dump({"faces": faces, "world": out}, open("blender_cloth.json", "w"))
bpy.ops.wm.alembic_export(filepath=os.path.abspath("blender_cloth.abc"), start=1, end=12, flatten=False)
print("DONE", len(verts))
