"""Command line: train what is missing, measure every row on held-out clips, write the table.

    python3 -m dcloth_training.compare --data DIR --full TRAINED --out DIR

May be stopped at any time and started again with the same arguments: finished rows are skipped, a
row in work goes on from its last checkpoint. Writes table.json, table.md and table.png.
"""
import argparse
import os
import sys

from .. import command, dataset, train, workers
from . import keep, table
from .rows import ROWS
from .scene import Scene


def arguments(argv=None):
    parser = argparse.ArgumentParser(prog="python3 -m dcloth_training.compare",
                                     description="The paper's ablation and comparison on our data.")
    add = parser.add_argument
    add("--data", required=True, help="what simulate/run.py made")
    add("--more-data", help="folder of more training clips, as for train")
    add("--full", required=True, help="the trained model: train.py's folder, or a bundle")
    add("--patches", help="a trained model with patches, as --full, to measure beside it (default: one is trained)")
    add("--out", required=True, help="weights, measurements and the table")
    add("--clips", type=dataset.clip_names,
        help="held-out clips, comma separated (default: those the full model's training was told, train --held-out)")
    add("--rows", type=dataset.clip_names, help="keys of rows, comma separated (default: all): "
        + ", ".join(row.key for row in ROWS))
    add("--minutes-per-model", type=float, metavar="M",
        help="limit of each fit; it lowers epochs by this machine's speed (default: no limit)")
    add("--epochs", type=int, help="limit of each fit in epochs; the same bits on every run")
    add("--seed", type=int, help="default: the full model's")
    add("--threads", type=int, default=1)
    add("--floor", help="JSON of simulate/floor.py: a column of what no network can learn")
    options = parser.parse_args(argv)
    unknown = set(options.rows or ()) - {row.key for row in ROWS}
    if unknown:
        parser.error(f"--rows: {sorted(unknown)} unknown; there are "
                     f"{', '.join(row.key for row in ROWS)}")
    for name in ("minutes_per_model", "epochs"):
        if getattr(options, name) is not None and getattr(options, name) <= 0:
            parser.error(f"--{name.replace('_', '-')}: {getattr(options, name)}, expected above 0")
    return options


def remarks(scene, records, wanted):
    """What a reader must know to judge the table."""
    out = [f"{row.title}: left out, {why}." for row in wanted if (why := row.lacks(scene))]
    trained = scene.training_names()
    known = scene.provenance.get("training_clips")
    if known is not None and set(known) != trained:
        out.append(f"The full model was trained on other clips than the rows trained here: only there "
                   f"{sorted(set(known) - trained)}, only here {sorted(trained - set(known))}.")
    asked = scene.provenance.get("command", {}).get("skeleton_epochs", scene.options.skeleton_epochs)
    for record in records:
        if record["group"] in ("control", "family"):
            epochs = list(record["fits"].values())[-1]["epochs"]
            if epochs < asked:
                out.append(f"{record['title']}: {epochs} epochs, the full model's stage 2 was given "
                           f"{asked}.")
    fits = {r["key"]: r["fits"] for r in records}
    whole = {name: fit for r in records if r["group"] == "ours" for name, fit in r["fits"].items()}
    short = [f"{name} {fit['epochs']} of {whole[name]['epochs']}"
             for name, fit in fits.get("full_fixed_weights", {}).items()
             if name in whole and fit["epochs"] < whole[name]["epochs"]]
    if short:
        out.append(f"full with fixed weights: fewer epochs than the full model, {', '.join(short)}.")
    return out


def run(options):
    """-> the table as table.json holds it."""
    os.makedirs(options.out, exist_ok=True)
    workers.use_threads(options.threads)
    log = train.Log(options.out)
    scene = Scene(options, log)
    floor = table.read_floor(options.floor, scene.clips)
    settings, scene.full_digest = keep.check(scene), keep.weights_digest(scene.full)
    wanted = [row for row in ROWS if options.rows is None or row.key in options.rows]
    records = []
    for number, row in enumerate(wanted, 1):
        log(f"row {number} of {len(wanted)}: {row.title}")
        record = keep.finish(scene, row)
        if record is not None:
            records.append(record)
    if not records:
        raise ValueError(f"--rows: the full model has none of the stages of {options.rows}")
    found = table.collect(records, scene.clips, floor, settings, remarks(scene, records, wanted))
    table.write(found, options.out)
    log(f"{os.path.join(options.out, 'table.md')} written")
    return found


def main(argv=None):
    options = arguments(argv)
    return command.ended("compare", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
