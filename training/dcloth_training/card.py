"""A model's card: its errors measured, its failures pictured, and what its README says of them written again.

    python3 -m dcloth_training.card FOLDER [--data DATA] [--fixed-hips DATA] [--failures DATA] [--bundle FILE]

FOLDER holds the bundle and README.md. --data and --fixed-hips name ground truth with root motion and with the hips
held; the held-out clips there (those the bundle names: train --held-out) give FOLDER/errors.json, .txt, .png and
errors_fixed_hips.json, .txt, and the figures of floor.json, if it lies in DATA, go to FOLDER/floor.json and
floor_fixed_hips.json. Pictures of the worst frames come from --failures (default: --fixed-hips, else --data) into
FOLDER/failures; the other clips of DATA tell how near training came to their motion. Without ground truth only
README.md is written, from those files. In it stands, for each part wanted,

    <!-- card: network -->           what the bundle holds        <!-- card: sources -->   whose motion it learned from
    <!-- card: errors -->            table with root motion       <!-- card: errors fixed hips -->    with the hips held
    <!-- card: failures -->          pictures of failures/failures.json, and the "why" written there by hand

and `<!-- card end -->` after each; what lies between is replaced, the rest stays. --check writes nothing and ends
with status 1 where README.md is not what it should be.
"""
import argparse
import json
import os
import re
import sys

import torch

from . import bundle, card_text, dataset, evaluate, failure_pictures, failures, familiarity, safetensors_io, sequence

PART = re.compile(r"(<!-- card: ([a-z ]+) -->\n).*?(<!-- card end -->)", re.DOTALL)
FLOOR_FIGURES = ("clip", "frames", "mean_mm", "end_mm", "entered_mm", "alive_mm")


def read_json(path):
    try:
        with open(path) as file:
            return json.load(file)
    except ValueError as error:
        raise ValueError(f"{path}: not JSON: {error}") from None


def replace(path, text):
    """Write a text file whole."""
    with open(path + ".part", "w") as file:
        file.write(text)
    os.replace(path + ".part", path)


def held_out(data, names):
    """Paths of the held-out clips in a folder of ground truth."""
    paths = [dataset.path_of(data, name) for name in names]
    there = [path for path in paths if os.path.exists(path)]
    if not there:
        raise ValueError(f"{os.path.join(data, 'dynamic')}: none of the held-out clips "
                         f"{', '.join(names) or '(none named)'}; add them (simulate.run --clips held_out, "
                         "import_truth), or train with other --held-out")
    return there


def measure(model, path, folder, data, names, suffix):
    """errors<suffix>.json, .txt and, with root motion, .png; floor<suffix>.json where DATA has one. path: the
    bundle."""
    net, rig, faces, _ = model
    referee, results = evaluate.Referee(path), {}
    for clip in held_out(data, names):
        item = sequence.read(clip)
        row = results[item.clip or clip] = evaluate.evaluate(net, rig, faces, item, clip, referee)
        print(f"{item.clip}: motion {row['truth']['alive_mm']:.1f} mm, "
              + ", ".join(f"{level} {row[level]['position_mm']['mean']:.1f} mm" for level in evaluate.level_names(row)),
              file=sys.stderr)
    evaluate.write(results, os.path.join(folder, "errors" + suffix), picture=not suffix)
    floor = os.path.join(data, "floor.json")
    if os.path.exists(floor):
        rows = [{key: row.get(key) for key in FLOOR_FIGURES} for row in read_json(floor)["clips"]
                if row["clip"] in results]
        replace(os.path.join(folder, f"floor{suffix}.json"), json.dumps({"clips": rows}, indent=1) + "\n")


def part(name, folder, bundle_path):
    """Lines of one part of the card."""
    if name in ("network", "sources"):
        tensors, metadata = safetensors_io.read(bundle_path)
        return card_text.network(tensors, metadata, os.path.getsize(bundle_path)) if name == "network" else \
            card_text.sources(json.loads(metadata.get("training", "{}")))
    if name in ("errors", "errors fixed hips"):
        suffix = name[len("errors"):].replace(" ", "_")
        floor = os.path.join(folder, f"floor{suffix}.json")
        rows = read_json(floor)["clips"] if os.path.exists(floor) else []
        return card_text.errors(read_json(os.path.join(folder, f"errors{suffix}.json")),
                                {row["clip"]: row for row in rows})
    if name == "failures":
        return card_text.failures(read_json(os.path.join(folder, "failures", "failures.json")), "failures")
    raise ValueError(f"{os.path.join(folder, 'README.md')}: '<!-- card: {name} -->': allowed are network, sources, "
                     f"errors, errors fixed hips, failures")


def written(text, folder, bundle_path):
    """README.md's text with its marked parts made anew."""
    starts, ends = text.count("<!-- card: "), text.count("<!-- card end -->")
    found = PART.findall(text)
    if not found or not len(found) == starts == ends:
        raise ValueError(f"{os.path.join(folder, 'README.md')}: {starts} marks '<!-- card: PART -->' and {ends} "
                         f"'<!-- card end -->' in {len(found)} pairs; expected a line of each around every part")
    return PART.sub(lambda m: m[1] + "\n".join(part(m[2], folder, bundle_path)) + "\n" + m[3], text)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", help="models/<garment>")
    parser.add_argument("--bundle", help="default: FOLDER/<its name>.safetensors")
    parser.add_argument("--data", help="ground truth with root motion")
    parser.add_argument("--fixed-hips", help="ground truth with the hips held")
    parser.add_argument("--failures", help="ground truth for the pictures")
    parser.add_argument("--count", type=int, default=5, help="pictures, at most")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    options = parser.parse_args(argv)
    folder, readme = options.folder, os.path.join(options.folder, "README.md")
    path = options.bundle or os.path.join(folder, os.path.basename(os.path.abspath(folder)) + ".safetensors")
    pictured = options.failures or options.fixed_hips or options.data
    if options.check and pictured:
        parser.error("--check compares with the files that are there; leave --data, --fixed-hips and --failures out")
    try:
        if pictured:
            model = bundle.read(path, torch.float32)
            provenance = json.loads(model[3].get("training", "{}"))
            names = dataset.held_out(provenance)
            for data, suffix in ((options.data, ""), (options.fixed_hips, "_fixed_hips")):
                if data:
                    measure(model, path, folder, data, names, suffix)
            folders = [data for data in (options.data, options.fixed_hips) if data] or [pictured]
            learned = familiarity.Training(model[0], model[1], folders, provenance)
            cases = failures.worst(model[0], model[1], held_out(pictured, names), options.count, training=learned,
                                   log=lambda t: print(t, file=sys.stderr))
            failures.write(cases, failure_pictures.read_body(path), model[2], os.path.join(folder, "failures"))
        with open(readme) as file:
            before = file.read()
        after = written(before, folder, path)
    except (OSError, ValueError, KeyError) as error:
        print(f"card: {error}", file=sys.stderr)
        return 2
    if options.check:
        if after != before:
            print(f"card: {readme} differs from the figures beside it; write it again: "
                  f"python3 -m dcloth_training.card {folder}", file=sys.stderr)
        return int(after != before)
    replace(readme, after)
    return 0


if __name__ == "__main__":
    sys.exit(main())
