# Blender: a small skinned character, animated, in every format; plus Blender's own bone matrices.
import bpy, json, math, sys
from mathutils import Matrix, Vector, Euler

out = sys.argv[sys.argv.index("--") + 1]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 30
scene.frame_start = 1
scene.frame_end = 20
arm = bpy.data.armatures.new("Rig")
rig = bpy.data.objects.new("Rig", arm)
scene.collection.objects.link(rig)
bpy.context.view_layer.objects.active = rig
bpy.ops.object.mode_set(mode="EDIT")


def bone(name, head, tail, parent=None, roll=0.0):
    b = arm.edit_bones.new(name)
    b.head = head
    b.tail = tail
    b.roll = roll
    if parent:
        b.parent = arm.edit_bones[parent]


# Blender: Z up, character faces -Y, its left is +X
bone("Hips", (0, 0, 1.0), (0, 0, 1.2))
bone("Chest", (0, 0, 1.2), (0, 0.02, 1.5), "Hips", 0.3)
for s, x in (("Left", 0.1), ("Right", -0.1)):
    bone(s + "UpLeg", (x, 0, 0.95), (x, -0.02, 0.5), "Hips", 0.2 * x)
    bone(s + "Leg", (x, -0.02, 0.5), (x, 0, 0.1), s + "UpLeg")
bpy.ops.object.mode_set(mode="OBJECT")
# body: a tube
verts, faces = [], []
R, C = 8, 10
for r in range(R):
    z = 1.5 - 1.4 * r / (R - 1)
    for c in range(C):
        a = 2 * math.pi * c / C
        verts.append((0.15 * math.cos(a), 0.15 * math.sin(a), z))
for r in range(R - 1):
    for c in range(C):
        faces.append((r * C + c, (r + 1) * C + c, (r + 1) * C + (c + 1) % C, r * C + (c + 1) % C))
mesh = bpy.data.meshes.new("Body")
mesh.from_pydata(verts, [], faces)
body = bpy.data.objects.new("Body", mesh)
scene.collection.objects.link(body)
for b in arm.bones:
    g = body.vertex_groups.new(name=b.name)
    mid = (b.head_local + b.tail_local) / 2
    for i, v in enumerate(verts):
        w = math.exp(-8 * (Vector(v) - mid).length)
        if w > 0.02:
            g.add([i], w, "REPLACE")
for i, v in enumerate(verts):
    pass
body.parent = rig
m = body.modifiers.new("Armature", "ARMATURE")
m.object = rig
for p in rig.pose.bones:
    p.rotation_mode = "QUATERNION"
for f in range(1, 21):
    t = (f - 1) / 30
    for name, e in (
        ("Hips", (0.1 * math.sin(5 * t), 0.8 * t, 0.05 * t)),
        ("Chest", (0.2 * math.sin(4 * t), 0.1, 0.3 * t)),
        ("LeftUpLeg", (0.6 * math.sin(6 * t), 0, 0.1)),
        ("RightUpLeg", (-0.6 * math.sin(6 * t), 0, 0)),
        ("LeftLeg", (0.4 + 0.3 * math.sin(6 * t), 0, 0)),
        ("RightLeg", (0.4 - 0.3 * math.sin(6 * t), 0, 0)),
    ):
        pb = rig.pose.bones[name]
        pb.rotation_quaternion = Euler(e).to_quaternion()
        pb.keyframe_insert("rotation_quaternion", frame=f)
    pb = rig.pose.bones["Hips"]
    pb.location = (0.05 * math.sin(3 * t), 0.03 * t, 0.5 * t)
    pb.keyframe_insert("location", frame=f)
rig.animation_data.action.name = "Walk"
names = [b.name for b in arm.bones]


def flat(m):
    return [list(r) for r in m]


truth = {
    "names": names,
    "rest": [flat(rig.matrix_world @ arm.bones[n].matrix_local) for n in names],
    "frames": [],
    "verts": verts,
}
for f in range(1, 21):
    scene.frame_set(f)
    bpy.context.view_layer.update()
    truth["frames"].append([flat(rig.matrix_world @ rig.pose.bones[n].matrix) for n in names])
json.dump(truth, open(out + "/truth.json", "w"))
for p in ("io_scene_gltf2", "io_scene_fbx", "io_anim_bvh"):
    try:
        bpy.ops.preferences.addon_enable(module=p)
    except Exception as e:
        print("ADDON", p, e)


def attempt(name, f):
    try:
        f()
        print("WROTE", name)
    except Exception as e:
        print("FAILED", name, repr(e)[:300])


attempt("glb", lambda: bpy.ops.export_scene.gltf(filepath=out + "/a.glb", export_format="GLB", export_animations=True))
attempt(
    "gltf",
    lambda: bpy.ops.export_scene.gltf(filepath=out + "/a.gltf", export_format="GLTF_SEPARATE", export_animations=True),
)
attempt(
    "fbx",
    lambda: bpy.ops.export_scene.fbx(
        filepath=out + "/a.fbx",
        add_leaf_bones=False,
        bake_anim_use_all_actions=False,
        bake_anim_use_nla_strips=False,
        bake_anim_simplify_factor=0.0,
    ),
)
attempt(
    "fbxz",
    lambda: bpy.ops.export_scene.fbx(
        filepath=out + "/z.fbx",
        axis_up="Z",
        axis_forward="Y",
        add_leaf_bones=False,
        bake_anim_use_all_actions=False,
        bake_anim_use_nla_strips=False,
        bake_anim_simplify_factor=0.0,
    ),
)
bpy.context.view_layer.objects.active = rig
rig.select_set(True)
attempt("bvh", lambda: bpy.ops.export_anim.bvh(filepath=out + "/a.bvh", frame_start=1, frame_end=20))
