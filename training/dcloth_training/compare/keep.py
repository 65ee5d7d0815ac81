"""What stays in --out: the settings it was made with, and every finished row's measurements."""
import hashlib
import json
import os

from .. import dataset, metrics, reference, sequence
from . import sizes

VERSION = 2     # of what is measured: rows of another are measured again, not trained again


def digest(paths):
    """BLAKE2 of files, their names included."""
    total = hashlib.blake2b(digest_size=16)
    for path in paths:
        total.update(os.path.basename(path).encode() + b"\0")
        with open(path, "rb") as file:
            for block in iter(lambda: file.read(1 << 20), b""):
                total.update(block)
    return total.hexdigest()


def write_json(path, value):
    """Whole or not at all."""
    partial = path + ".part"
    with open(partial, "w") as file:
        json.dump(value, file, indent=1)
    os.replace(partial, path)


def weights_digest(path):
    """Of a trained model: rows that run its weights are measured again when they change."""
    return digest([os.path.join(path, "network.safetensors") if os.path.isdir(path) else path])


def settings(scene):
    """Everything that decides the weights of the rows trained here.

    Of the full model that is its options, statistics of features and size alone: a longer trained
    one of the same kind leaves the families' and most ablations' rows as they are.
    """
    net, statistics = scene.net, hashlib.blake2b(digest_size=16)
    for value in (net.static.template, net.static.initial_weights, *scene.standardise.buffers()):
        statistics.update(value.float().contiguous().numpy().tobytes())
    options = {k: v for k, v in vars(scene.options).items()
               if k not in ("data", "more_data", "out", "export", "threads", "device", "held_out")}   # see "data"
    training = [os.path.join(scene.data, "character.safetensors"),
                *dataset.find(scene.data, "static"),
                *dataset.find(scene.data, "dynamic", scene.held_out),
                *(dataset.find(scene.more_data, "dynamic", scene.held_out) if scene.more_data else [])]
    found = {"data": digest(training), "statistics": statistics.hexdigest(),
             "learned_numbers": sizes.of_network(net, "skeleton"), "options": options,
             "minutes_per_model": scene.minutes}
    return json.loads(json.dumps(found))


def check(scene):
    """Refuse a folder that was made with other settings; note them in a new one."""
    path, now = os.path.join(scene.folder, "settings.json"), settings(scene)
    if os.path.exists(path):
        with open(path) as file:
            before = json.load(file)
        other = [k for k in now if k != "options" and before.get(k) != now[k]]
        other += [k for k, v in now["options"].items() if before["options"].get(k) != v]
        if other:
            raise ValueError(f"{path}: rows there were made with another {', '.join(other)}; "
                             f"give another --out, or delete that folder")
    else:
        write_json(path, now)
    return now


def measure(scene, row, model, record):
    """Fill record["clips"] for every clip that is not yet measured against this very truth."""
    done, mesh = record.setdefault("clips", {}), metrics.Mesh(scene.faces, scene.net.static.template.double().numpy())
    for name in scene.clips:
        path = dataset.path_of(scene.data, name)
        stamp = digest([path])
        if name in done and done[name]["file"] == stamp:
            continue
        item = sequence.read(path)
        if item.truth is None:
            raise ValueError(f"{path}: no truth to compare with")
        found = model.predict(scene.pose(item, path)).double().numpy()
        hips = reference.matrices_for(item, scene.rig, path)[:, scene.rig.hips]
        done[name] = {"file": stamp, **metrics.clip(found, metrics.Truth(item.truth, hips, mesh))}
        scene.log(f"{row.title}: {name} {done[name]['position_mm']['mean']:.2f} mm "
                  f"of {done[name]['alive_mm']:.2f} motion, "
                  f"{done[name]['normal_deg']['mean']:.2f} deg")


def finish(scene, row):
    """Train the row if need be, measure what is missing, keep it -> its record, or None."""
    if row.lacks(scene):
        return None
    folder = os.path.join(scene.folder, row.folder(scene))
    path = os.path.join(scene.folder, row.key + ".json")
    runs = row.runs(scene)
    of_full = weights_digest(runs) if runs else None
    record = {}
    if os.path.exists(path):
        with open(path) as file:
            record = json.load(file)
        known = {name: clip["file"] for name, clip in record["clips"].items()}
        if record["full"] != of_full or record.get("version") != VERSION:
            record = {}
        elif all(known.get(c) == digest([dataset.path_of(scene.data, c)]) for c in scene.clips):
            return record
    model = row.load(scene, folder)
    if model is None:
        os.makedirs(folder, exist_ok=True)
        scene.log(f"{row.title}: training")
        row.train(scene, folder)
        model = row.load(scene, folder)
    record.update(version=VERSION, key=row.key, title=row.title, group=row.group, note=row.note, full=of_full,
                  parameters=model.parameters, minutes=model.minutes, fits=model.fits)
    measure(scene, row, model, record)
    write_json(path, record)
    return record
