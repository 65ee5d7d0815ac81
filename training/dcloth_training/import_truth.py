"""Cloth that was simulated elsewhere, and the animated character under it, become a training dataset.

    python3 -m dcloth_training.import_truth PROJECT.json --out DIR [--dcloth PATH]

Caches: Alembic (Ogawa), PC2, MDD, OBJ sequences. Animations: glTF, FBX, BVH, or sequences (.safetensors). Writes what
training reads: DIR/character.safetensors, DIR/dynamic/*.safetensors, DIR/static/*.safetensors. The project file is
shown in docs/train_your_own.md. What does not fit is refused with file, frame, what is allowed and how to mend it;
clips written before stay.
"""
import argparse
import json
import os
import sys
import tempfile

import numpy as np

from . import body_limits, geometry, safetensors_io, sequence
from .motion import skeleton
from .truth import alembic, animation, cache, checks, mirror, obj, project, resample
from .truth.errors import TruthError, refuse

RATE = 30.0          # Hz, what training ticks at
DRAPE_EVERY = 10     # ticks between drapes taken from dynamic clips, where no clip is static
PLACED = 20          # ticks a clip whose place on the body is checked


def read_cache(clip):
    path = clip["cache"]
    if "*" in path:
        return obj.read_sequence(path)
    if not os.path.isfile(path):
        refuse(path, "no such file", "a cache (.abc, .pc2, .mdd) or a sequence such as cloth_*.obj")
    kind = os.path.splitext(path)[1].lower()
    if kind == ".abc":
        return alembic.read(path, clip.get("mesh"))
    if kind in (".pc2", ".mdd"):
        return (cache.read_pc2 if kind == ".pc2" else cache.read_mdd)(path)
    refuse(path, f"a name ending '{kind}'", ".abc, .pc2, .mdd, or a sequence such as cloth_*.obj")


def make_character(what, body_path, out):
    """Writes character.safetensors of body and garment -> (its tensors, joint names, polygons, skin weights [n, J])."""
    tensors, metadata = safetensors_io.read(body_path)
    missing = [k for k in ("joint_bind", "body_vertices", "body_faces", "body_weights") if k not in tensors]
    if missing or "joint_names" not in metadata:
        refuse(body_path, f"no {', '.join(missing) or 'joint_names'}", "a character or what `dcloth body` writes")
    names = json.loads(metadata["joint_names"])
    metres = checks.unit_of(what["garment"], what.get("garment_unit", "m"))
    axes = checks.axes_of(what["garment"], what.get("garment_up", "y"))
    points, polygons = obj.read_mesh(what["garment"])
    if not checks.FEWEST <= len(points) <= checks.MOST:
        refuse(what["garment"], f"{len(points)} vertices", f"{checks.FEWEST} to {checks.MOST}, what a model holds",
               "simulate a coarser mesh")
    template = checks.canonical(points, metres, axes)
    loose = np.setdiff1d(np.arange(len(template)), np.unique(np.concatenate([np.array(p) for p in polygons])))
    if len(loose):
        refuse(what["garment"], f"vertex {loose[0] + 1} in no face", "vertices of the surface alone",
               "delete loose vertices and simulate the mesh so")
    hips = what.get("hips", metadata.get("hips", "Hips"))
    feature_joints = what.get("feature_joints") or json.loads(metadata.get("feature_joints", "null")) or \
        list(skeleton.LOWER_BODY)
    absent = [j for j in (hips, *feature_joints) if j not in names]
    if absent:
        refuse(body_path, f"no joints {', '.join(absent)}", f"joints of the character, {', '.join(names)}",
               'name them with "map", or say which are meant with "hips" and "feature_joints"')
    collider = tensors.get("body_collider", np.ones(len(tensors["body_vertices"]), np.uint8))
    nearest, weights = geometry.nearest_weights(template, tensors["body_vertices"], tensors["body_faces"],
                                                tensors["body_weights"], collider)
    away = float(np.median(np.linalg.norm(template - nearest, axis=1)))
    if away > checks.LOST:
        refuse(what["garment"], f"a garment {away:.3g} m from the body in bind pose (median)", f"{checks.LOST} m",
               'it must hang on the character in its bind pose; set "garment_unit" or "garment_up"')
    pair, why = mirror.find(template, polygons, names, tensors["joint_bind"].astype(np.float64))
    out_tensors = {
        **{k: tensors[k] for k in ("joint_bind", "body_vertices", "body_faces", "body_weights")},
        "body_collider": collider.astype(np.uint8),
        "cloth_template": template.astype(np.float32), "cloth_rest": template.astype(np.float32),
        "cloth_faces": checks.triangles(polygons), "pinned": np.zeros(len(template), np.uint8)}
    kept = {"joint_names": json.dumps(names), "hips": hips, "feature_joints": json.dumps(feature_joints),
            **({"parents": metadata["parents"]} if "parents" in metadata else {})}
    if pair:
        out_tensors["mirror"] = pair[0]
        kept["joint_mirror"] = json.dumps(pair[1].tolist())
    os.makedirs(out, exist_ok=True)
    safetensors_io.write(os.path.join(out, "character.safetensors"), out_tensors, kept)
    print(f"character: {len(names)} joints, garment of {len(template)} vertices, "
          f"{'trained with its mirror image' if pair else f'no mirror image: {why}'}", flush=True)
    excess = body_limits.excess(tensors["body_vertices"], tensors["body_faces"], collider, template)
    if excess:
        print(f'body: {excess}; a coarser body, or fewer "body_meshes", would do', flush=True)
    return out_tensors, names, polygons, weights


def import_clip(clip, made, garment_path, poses_path):
    """One clip on what make_character made -> (Sequence, one line about it)."""
    character, names, polygons, weights = made
    item = sequence.read(poses_path)
    if list(item.joint_names) != names or abs(item.fps - RATE) > 1e-6:
        refuse(poses_path, f"{len(item.joint_names)} joints at {item.fps:g} Hz",
               f"the character's {len(names)} at {RATE:g}",
               "make it with `dcloth poses --model character.safetensors --fps 30`")
    metres, axes = checks.unit_of(clip["cache"], clip["unit"]), checks.axes_of(clip["cache"], clip["up"])
    read = read_cache(clip)
    checks.topology(read, garment_path, len(character["cloth_template"]), polygons)
    raw = read.positions
    template = character["cloth_template"].astype(np.float64)
    read.positions = checks.canonical(raw, metres, axes)
    checks.shape(read, read.positions, template, checks.edges(polygons))
    ticks, truth, between = resample.at_ticks(read, clip.get("fps"), len(item.joint_matrices), RATE,
                                              clip.get("offset_seconds"), clip.get("interpolate", False))
    matrices = item.joint_matrices[ticks]
    some = np.unique(np.linspace(0, len(ticks) - 1, PLACED).astype(int))
    skinned = skeleton.skin(template, weights, character["joint_bind"].astype(np.float64),
                            matrices[some].astype(np.float64))
    in_file_axes = truth[some].astype(np.float64) @ axes / metres
    distance = checks.place(read, truth[some], skinned, in_file_axes, metres)
    line = f"{clip['name']}: {len(ticks)} ticks, {1e3 * distance:.0f} mm from plain skinning" + \
        (f", {between} between two samples" if between else "")
    return sequence.Sequence(matrices, truth, names, RATE, clip["name"], clip["kind"]), line


def run(path, out, command=None):
    what = project.read(path)
    with tempfile.TemporaryDirectory() as folder:
        needs_command = not all(p.endswith(".safetensors") for p in
                                (what["character"], *(c["animation"] for c in what["clips"])))
        command = animation.find_command(command) if needs_command else None
        body_path = animation.body(command, what, folder)
        made = make_character(what, body_path, out)
        character_path = os.path.join(out, "character.safetensors")
        for kind in ("dynamic", "static"):
            os.makedirs(os.path.join(out, kind), exist_ok=True)
        drapes = []
        for clip in what["clips"]:
            poses_path = animation.poses(command, what, clip, character_path, f"{RATE:g}", folder)
            item, line = import_clip(clip, made, what["garment"], poses_path)
            sequence.write(os.path.join(out, clip["kind"], project.stem(clip) + ".safetensors"), item)
            print(line, flush=True)
            drapes.append((item.joint_matrices[::DRAPE_EVERY], item.truth[::DRAPE_EVERY]))
        stand_in = os.path.join(out, "static", "drapes-of-clips.safetensors")
        if any(c["kind"] == "static" for c in what["clips"]):
            if os.path.exists(stand_in):    # of an import before this one
                os.unlink(stand_in)
        else:
            sequence.write(stand_in, sequence.Sequence(
                np.concatenate([d[0] for d in drapes]), np.concatenate([d[1] for d in drapes]), made[1], RATE,
                "drapes-of-clips", "static"))
            print(f"no static clip: every {DRAPE_EVERY}th tick of the dynamic ones stands in, so stage 1 learns a "
                  "pose's mean shape; drapes at rest make it sharper", flush=True)
    print(f"{out}: {len(what['clips'])} clips; train with --data {out} --validation NAME,...", flush=True)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("project", help="JSON, see docs/train_your_own.md")
    parser.add_argument("--out", required=True, help="folder of the dataset")
    parser.add_argument("--dcloth", help="the built dcloth command; found in build/ and the PATH when not given")
    options = parser.parse_args(argv)
    try:
        run(options.project, options.out, options.dcloth)
    except (TruthError, safetensors_io.SafetensorsError, OSError) as error:
        print(f"import_truth: error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
