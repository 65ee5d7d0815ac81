"""The bundled skirt's own simulated walk, through every format: real cloth passes the checks and comes back."""
import json
import os

import numpy as np

import cache_files
from dcloth_training import dataset, import_truth, rig, safetensors_io, sequence

SKIRT = os.path.join(os.path.dirname(__file__), "..", "..", "models", "skirt")
FRAMES = 12


def test_a_simulated_clip_through_every_format(tmp_path):
    bundle, metadata = safetensors_io.read(os.path.join(SKIRT, "skirt.safetensors"))
    names = json.loads(metadata["joint_names"])
    safetensors_io.write(tmp_path / "body.safetensors", {
        "joint_bind": bundle["character.bind"], "body_vertices": bundle["body.positions"].astype(np.float32),
        "body_faces": bundle["body.faces"], "body_weights": bundle["body.joint_weights"].astype(np.float32)},
        {"joint_names": json.dumps(names)})
    template = bundle["template.positions"].astype(np.float32)
    polygons = [tuple(f) for f in bundle["template.faces"].tolist()]
    cache_files.write_obj(tmp_path / "skirt.obj", template, polygons)
    walk = sequence.read(os.path.join(SKIRT, "sequences", "run_stop.safetensors"))
    walk.joint_matrices, walk.truth = walk.joint_matrices[60:60 + FRAMES], walk.truth[60:60 + FRAMES]
    sequence.write(tmp_path / "walk.safetensors",
                   sequence.Sequence(walk.joint_matrices, None, names, 30.0, "walk", "dynamic"))
    assert walk.joint_names == names

    cache_files.write_pc2(tmp_path / "a.pc2", walk.truth)
    cache_files.write_mdd(tmp_path / "a.mdd", walk.truth)
    cache_files.write_obj_sequence(tmp_path / "obj", walk.truth, polygons)
    cache_files.write_alembic(tmp_path / "a.abc", walk.truth, polygons)
    caches = {"pc2": "a.pc2", "mdd": "a.mdd", "obj": "obj/cloth_*.obj", "abc": "a.abc"}
    (tmp_path / "project.json").write_text(json.dumps({
        "character": "body.safetensors", "garment": "skirt.obj", "defaults": {"fps": 30},
        "clips": [{"name": n, "animation": "walk.safetensors", "cache": c} for n, c in caches.items()]}))
    out = str(tmp_path / "out")
    import_truth.run(str(tmp_path / "project.json"), out)

    character = rig.read_character(os.path.join(out, "character.safetensors"))
    assert np.array_equal(character.template, template) and np.array_equal(character.faces, bundle["template.faces"])
    assert character.mirror is not None and character.joint_names == names
    paths = dataset.find(out, "dynamic")
    assert len(paths) == len(caches)
    for path in paths:
        found = sequence.read(path)
        assert np.array_equal(found.truth, walk.truth), path
        assert np.array_equal(found.joint_matrices, walk.joint_matrices), path
