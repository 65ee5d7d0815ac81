"""Make the ground truth: one resumable, atomic file a clip.

    python3 -m dcloth_training.simulate.run --out DIR --motion CLIPS --workers 2
        [--clips held_out,static,training,random,variations,wide,mixed,leaning,lifting | --clips mocap/walk]
        [--root fixed]
    python3 -m dcloth_training.simulate.run --out DIR --character HERO.glb --garment DRESS.obj --clips static,walk.fbx

Writes DIR/character.safetensors, DIR/dynamic/<clip>.safetensors, DIR/static/drapes-XX.safetensors
and one JSON line a clip in DIR/manifest.jsonl. Finished files are skipped; a clip that fails or is
not cloth (checks.py) is reported and skipped, never half-written. One that was not cloth is not tried again
with the same motion and settings, as the same input gives the same bits.
"""
import argparse
import concurrent.futures
import contextlib
import dataclasses
import hashlib
import json
import os
import sys
import time

import numpy as np

from .. import command, figure, safetensors_io, sequence
from ..motion import skeleton, timing
from ..own import subject
from . import checks, clips, cloth_job, garment, settings, statics

CLUSTER_SECONDS = 20     # until its scheduler answers


def with_lead(motion):
    """Lead-in plus motion, and the frames to record: the last settled frame, then the clip."""
    lead = timing.approach(motion, settings.REACH_FRAMES, settings.HOLD_FRAMES)[:-1]
    joined = skeleton.Motion(np.concatenate([lead.root, motion.root]),
                             np.concatenate([lead.local, motion.local]))
    return joined, np.arange(len(lead), len(joined))


def put_on(folder, name):
    """(figure, garment as it hangs in bind pose), from `folder`/character.safetensors or simulated and written there.

    name: in garment.GARMENTS."""
    body, worn = figure.load(), garment.GARMENTS[name](figure.load())
    path = os.path.join(folder, "character.safetensors")
    if os.path.exists(path):
        there = safetensors_io.read(path)[0]
        hanging = there["cloth_template"].astype(np.float64)
        if hanging.shape != worn.vertices.shape:
            raise ValueError(f"{path}: {len(hanging)} cloth vertices, the {name} has {len(worn.vertices)}; take "
                             "a folder of its own for each garment")
        if not np.array_equal(there["cloth_faces"], worn.faces):
            raise ValueError(f"{path}: other triangles than the {name} cut here: its cut has changed since the folder "
                             "was begun. Simulate with the version that began it, or take another folder")
        return body, dataclasses.replace(worn, vertices=hanging)
    worn, moving, lopsided = cloth_job.hung(worn, body)
    print(f"{name}: hanging, it moves {1e3 * moving:.3f} mm a frame; left and right differed by "
          f"{1e3 * lopsided:.2f} mm (mean), made symmetric", flush=True)
    _, _, _, masks = cloth_job.collider(body, worn)
    safetensors_io.write(path, {
        "joint_bind": skeleton.bind_matrices().astype(np.float32),
        "body_vertices": body.vertices.astype(np.float32), "body_faces": body.faces_by_colour.astype(np.int32),
        "body_weights": body.weights.astype(np.float32), "body_colours": body.colours.astype(np.float32),
        "body_collider": (masks > 0).astype(np.uint8),
        "cloth_template": worn.vertices.astype(np.float32), "cloth_faces": worn.faces,
        "cloth_rest_length": cloth_job.rest_lengths(worn).astype(np.float32), "cloth_texture": worn.texture,
        "mirror": worn.mirror, "pinned": worn.pinned.astype(np.uint8), "cloth_touches": worn.touches.astype(np.int32),
        "body_parts": masks.astype(np.int32),
    }, {"joint_names": json.dumps(list(skeleton.NAMES)), "parents": json.dumps([int(p) for p in skeleton.PARENTS]),
        "joint_mirror": json.dumps(skeleton.MIRROR.tolist()), "feature_joints": json.dumps(list(worn.felt))})
    return body, dataclasses.replace(worn, vertices=worn.vertices.astype(np.float32).astype(np.float64))


def manifest_of(options):
    return os.path.join(options.out, "manifest.jsonl")


def manifest(options, entry):
    with open(manifest_of(options), "a") as file:
        file.write(json.dumps(entry) + "\n")


def input_of(motion, record, wind, chosen):
    """SHA-256 of what tells a clip's cloth from that of others in a folder: way, wind, recorded frames, settings."""
    found = hashlib.sha256(json.dumps(chosen, sort_keys=True).encode())
    for values in (motion.root, motion.local, record, wind):
        found.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


def refused_before(options):
    """{clip: input_of it} of clips that were simulated and refused, the last time that they were."""
    path, found = manifest_of(options), {}
    if not os.path.exists(path):
        return found
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            try:
                entry = json.loads(line)
                found[entry["clip"]] = entry.get("input") if "refused" in entry else None
            except (ValueError, TypeError, KeyError):
                raise ValueError(f"{path}:{number}: not a clip's line of JSON; delete it, and its clip is made again "
                                 f"if its file is not there") from None
    return found


def not_refused_before(options, chosen, worn):
    """(those of `chosen` that may still be cloth, {path: input_of} of all, how many are left out)."""
    today, known = settings.of(worn.fabric, **worn.settings), refused_before(options)
    inputs = {path: input_of(motion, record, wind, today) for _, _, motion, record, wind, path in chosen}
    left = [given for given in chosen if known.get(given[0]) != inputs[given[5]]]
    if len(left) < len(chosen):
        print(f"left out, refused before: {len(chosen) - len(left)} of {len(chosen)} clips; manifest.jsonl says why; "
              f"whatever line is deleted there is tried again", flush=True)
    return left, inputs, len(chosen) - len(left)


def run_clip(name, kind, motion, record, wind, path, context):
    """Simulate, check, write. Returns the manifest entry; raises nothing on a bad clip."""
    options, body, worn = context
    began = time.time()
    chosen = settings.of(worn.fabric, **worn.settings)
    entry = {"clip": name, "kind": kind, "root": options.root, "settings": chosen}
    try:
        if wind is not None:    # it rises while the cloth settles
            entry["wind_max"] = round(float(np.linalg.norm(wind, axis=1).max()), 2)
        result = cloth_job.simulate(motion, body, worn, record, chosen, wind)
        if kind == "static":
            result, good = checks.drapes(result, body, worn)
            if not good.any():
                raise ValueError("none of its drapes is cloth")
            entry["dropped_poses"] = np.flatnonzero(~good).tolist()
        entry.update(frames=len(result.cloth), simulated_frames=len(motion), fps=skeleton.FPS,
                     seconds=round(result.seconds, 1),
                     seconds_per_frame=round(result.seconds / len(motion), 4))
        entry.update(checks.measure(result, body, worn, every=3 if kind == "dynamic" else 1))
        if kind == "static":  # consecutive drapes are different poses: speed means nothing
            for key in [k for k in entry if k.startswith(("speed", "settled"))]:
                del entry[key]
        bad = checks.refuse({"speed_max": 0.0, **entry})
        if bad is None:
            sequence.write(path, sequence.Sequence(result.matrices, result.cloth, list(body.names),
                                                   skeleton.FPS, name, kind, result.wind))
            with open(path, "rb") as file:
                entry["sha256"] = hashlib.sha256(file.read()).hexdigest()
    except Exception as error:  # a bad clip must not stop the batch
        bad = f"{type(error).__name__}: {error}"
    if bad:
        entry["refused"] = bad
    return entry, time.time() - began


class Ours:
    """Our own figure in one of our garments."""
    windy = True

    def __init__(self, options):
        self.options, self.felt = options, garment.FELT[options.garment]

    def put_on(self):
        return put_on(self.options.out, self.options.garment)

    def group(self, word):
        return clips.group(word)

    def motion(self, name):
        return clips.load(name, self.options.motion)

    def drapes(self):
        """Poses of the quasi-static drapes; always the same ones, of training clips alone."""
        names = [name for name in clips.training() if name.startswith("procedural/") or self.options.motion]
        return statics.order(statics.select([self.motion(name) for name in names], self.options.poses, self.felt),
                             self.felt)


def prepare(name, options, chosen=None):
    motion = chosen.motion(name) if chosen else clips.load(name, options.motion)
    if options.root == "fixed":  # the paper's regime: no translation of the hips
        motion = skeleton.Motion(np.repeat(motion.root[:1], len(motion), 0), motion.local)
    return motion


def with_lead_wind(name, motion):
    """Wind [T, 3] of lead-in and clip: it rises while the lead is held. None where the clip is calm."""
    blowing = clips.wind(name, len(motion))
    if blowing is None:
        return None
    rise = np.r_[np.zeros(settings.REACH_FRAMES), np.linspace(0, 1, settings.HOLD_FRAMES)]
    return np.concatenate([rise[:, None] * blowing[0], blowing])


def static_tours(chosen):
    """[(file number, poses)] of the quasi-static drapes."""
    poses = chosen.drapes()
    size = statics.POSES_A_FILE
    return [(i // size, poses[i:i + size]) for i in range(0, len(poses), size)]


def tasks(options, chosen):
    """(name, kind, motion, frames to record, wind, path) of each file that is not there yet, once, in order of
    importance.

    chosen: Ours or subject.Own."""
    met = set()

    def wanted(path):
        new = path not in met and not os.path.exists(path)
        met.add(path)
        return new

    for word in options.clips.split(","):
        if word == "static":
            for number, poses in static_tours(chosen):
                name = f"drapes-{number:02d}"
                path = os.path.join(options.out, "static", name + ".safetensors")
                if wanted(path):
                    tour, rests = statics.tour(poses)
                    joined, frames = with_lead(tour)
                    yield name, "static", joined, frames[rests], None, path
            continue
        for name in chosen.group(word):
            path = os.path.join(options.out, "dynamic", clips.file_stem(name) + ".safetensors")
            if wanted(path):
                motion = prepare(name, options, chosen)
                joined, frames = with_lead(motion)
                yield name, "dynamic", joined, frames, with_lead_wind(name, motion) if chosen.windy else None, path


@contextlib.contextmanager
def pool_of(options, context):
    """Where clips are simulated: (submit(function, *arguments, context), the context to give it). Processes here
    (threads would wait for each other in Python for nearly half of the time), or the workers of a Dask cluster, which
    see --out at the same path and have this package and the solver."""
    if not options.cluster:
        with concurrent.futures.ProcessPoolExecutor(options.workers) as pool:
            yield pool.submit, context
        return
    try:
        import distributed
    except ImportError:
        raise ValueError("--cluster: found no Python package 'distributed'; install it (Debian: "
                         "python3-distributed)") from None
    try:
        client = distributed.Client(options.cluster, timeout=CLUSTER_SECONDS)
    except OSError as error:
        raise ValueError(f"--cluster {options.cluster}: no Dask scheduler answers there within {CLUSTER_SECONDS} s "
                         f"({error}); start one: dask scheduler, and on each machine: dask worker ADDRESS "
                         f"--nthreads 1") from None
    with client, client.get_executor(pure=False) as pool:
        yield pool.submit, client.scatter(context, broadcast=True, hash=False)


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True)
    parser.add_argument("--motion", help="folder of BVH folders (mocap/, game/)")
    parser.add_argument("--clips",
                        default="static,validation,development,training,random,variations,wide,mixed,leaning,lifting",
                        help="groups or single clips, in order of importance; 'reported' last, for the final figures")
    parser.add_argument("--workers", type=int, default=2, help="clips simulated side by side here")
    parser.add_argument("--cluster", metavar="ADDRESS",
                        help="of a Dask scheduler (tcp://host:8786): its workers simulate, and "
                        "see --out at the same path. The bits are those of one machine")
    parser.add_argument("--garment", default="skirt", help=f"{', '.join(garment.GARMENTS)}; with --character a mesh")
    parser.add_argument("--root", choices=("free", "fixed"), default="free")
    parser.add_argument("--poses", type=int, default=1200, help="quasi-static drapes")
    subject.add_arguments(parser.add_argument)
    options = parser.parse_args(argv)
    if options.character is None and options.garment not in garment.GARMENTS:
        parser.error(f"--garment {options.garment}: allowed without --character are {', '.join(garment.GARMENTS)}; "
                     "name the character that wears it")
    return options


def told_time(seconds):
    """"40 s", "12 min" or "3 h 05 min"."""
    minutes = round(seconds / 60)
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


class Drapes:
    """Counts drapes, and says once that the cloth catches on the body in most of them: training would learn little."""
    LOOK_AFTER = 60

    def __init__(self):
        self.tried = self.kept = 0
        self.told = False

    def add(self, tried, kept):
        """-> a warning, or None."""
        self.tried, self.kept = self.tried + tried, self.kept + kept
        if self.told or self.tried < self.LOOK_AFTER or 2 * self.kept >= self.tried:
            return None
        self.told = True
        return (f"warning: {self.kept} of {self.tried} drapes are cloth, the others catch on the body. This may happen "
                f"where the skin is open or in layers, such as shorts over legs: name closed meshes with "
                f"--body-meshes, or model the garment further away from the skin")


def run(options, subjects=None):
    """-> how many clips were refused, now or before. subjects: Ours or subject.Own; made here when None."""
    options.out = os.path.abspath(options.out) if options.cluster else options.out
    if subjects is None:
        subjects = subject.Own(options) if options.character else Ours(options)
    # All of them before the first is simulated: a clip that cannot be read must not stop a batch half way.
    chosen = list(tasks(options, subjects))
    for folder in ("dynamic", "static"):
        os.makedirs(os.path.join(options.out, folder), exist_ok=True)
    context = (options, *subjects.put_on())
    chosen, inputs, refused = not_refused_before(options, chosen, context[2])
    began, drapes = time.time(), Drapes()
    frames, done = sum(len(given[2]) for given in chosen), 0
    with pool_of(options, context) as (submit, shared):
        lengths, asked, read = {}, {}, {}
        for given in chosen:
            future = submit(run_clip, *given, shared)
            lengths[future], asked[future], read[future] = len(given[2]), len(given[3]), inputs[given[5]]
        waiting = list(lengths)
        for count, future in enumerate(concurrent.futures.as_completed(waiting), 1):
            entry, _ = future.result()
            if "seconds" in entry:      # not what failed before there was cloth
                entry["input"] = read[future]
            manifest(options, entry)
            refused += "refused" in entry
            done += lengths[future]
            left = told_time((time.time() - began) / done * (frames - done))
            numbers = {k: entry[k] for k in ("frames", "seconds_per_frame", "stretch_p99",
                                             "penetration_max_mm", "crossed_share", "through_share", "speed_max",
                                             "settled_mm_per_frame") if k in entry}
            print(f"[{count}/{len(waiting)} {(time.time() - began) / 60:.1f} min, {left} left] {entry['clip']} "
                  f"{'REFUSED: ' + entry['refused'] if 'refused' in entry else 'done'} {numbers}",
                  flush=True)
            warning = drapes.add(asked[future], numbers.get("frames", 0)) if entry["kind"] == "static" else None
            if warning:
                print(warning, flush=True)
    return refused


def main(argv=None):
    options, refused = arguments(argv), []
    return command.ended("run", lambda: refused.append(run(options))) or int(refused[0] > 0)


if __name__ == "__main__":
    sys.exit(main())
