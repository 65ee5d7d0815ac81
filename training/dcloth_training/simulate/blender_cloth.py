"""Simulate one clip in Blender's cloth solver. Runs inside Blender, one process a clip:

    blender -b --factory-startup --python blender_cloth.py -- JOB.json

The job (written by run.py) names a folder with collider.pc2, garment.pc2 and mesh.npz; this
script writes cloth.npy [T, n, 3]. Vertex positions come ready-made, so there is no armature, no
importer and no axis conversion: the scene itself is Y-up, with gravity along -Y.
"""
import json
import os
import sys
import time

import bpy
import numpy as np


def _mesh_object(name, vertices, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.update()
    made = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(made)
    return made


def _play(target, path):
    """Drive every vertex from a PC2 file; between frames the solver moves colliders linearly."""
    cache = target.modifiers.new("motion", "MESH_CACHE")
    cache.cache_format = "PC2"
    cache.filepath = path
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"  # the identity: no conversion
    cache.interpolation = "LINEAR"
    cache.frame_start = 1.0


def _apply(target, settings):
    for name, value in settings.items():
        if not hasattr(target, name):
            raise SystemExit(f"blender_cloth: unknown setting '{name}'")
        setattr(target, name, value)


def build(job):
    """The whole scene: collider, garment, cloth settings. Returns (scene, garment object)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = job["fps"]
    scene.use_gravity = True
    scene.gravity = (0.0, -9.81, 0.0)
    folder, frames = job["folder"], job["frames"]
    mesh = np.load(os.path.join(folder, "mesh.npz"))

    body = _mesh_object("body", mesh["body_vertices"], mesh["body_faces"])
    _play(body, os.path.join(folder, "collider.pc2"))
    body.modifiers.new("collision", "COLLISION")
    _apply(body.collision, job["settings"]["collider"])

    garment = _mesh_object("garment", mesh["garment_vertices"], mesh["garment_faces"])
    group = garment.vertex_groups.new(name="pin")
    group.add(np.flatnonzero(mesh["pinned"]).tolist(), 1.0, "REPLACE")
    _play(garment, os.path.join(folder, "garment.pc2"))
    cloth = garment.modifiers.new("cloth", "CLOTH")
    cloth.settings.vertex_group_mass = "pin"
    _apply(cloth.settings, job["settings"]["cloth"])
    _apply(cloth.collision_settings, job["settings"]["collision"])
    cloth.point_cache.frame_start, cloth.point_cache.frame_end = 1, frames
    scene.frame_start, scene.frame_end = 1, frames
    return scene, garment


def simulate(job):
    scene, garment = build(job)
    cloth, flat, began = [], None, time.time()
    for frame in range(1, job["frames"] + 1):
        scene.frame_set(frame)
        evaluated = garment.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        if flat is None:
            flat = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertices.foreach_get("co", flat)
        evaluated.to_mesh_clear()
        if not np.isfinite(flat).all() or np.abs(flat).max() > 1e3:
            raise SystemExit(f"blender_cloth: exploded at frame {frame}")
        if frame in job["record_set"]:
            cloth.append(flat.reshape(-1, 3).copy())
        if frame % 10 == 0:
            print(f"frame {frame}/{job['frames']} {time.time() - began:.1f} s", flush=True)
    np.save(os.path.join(job["folder"], "cloth.npy"), np.stack(cloth))
    with open(os.path.join(job["folder"], "done.json"), "w") as file:
        json.dump({"seconds": time.time() - began, "blender": bpy.app.version_string}, file)


if __name__ == "__main__":
    with open(sys.argv[sys.argv.index("--") + 1]) as file:
        described = json.load(file)
    described["record_set"] = set(described["record"])
    simulate(described)
