"""The generated parts of a model card, as Markdown: network, motion, held-out errors, failure cases."""
import json
import re

import numpy as np

from . import evaluate, train
from .simulate import clips

# Behind the feature joints' names, by a bundle's metadata "root_motion".
_ROOT_MOTION = {"false": "", "true": " and root motion", "air": " and the air around the hips"}

_CMU = "the CMU Graphics Lab motion capture database, mocap.cs.cmu.edu, created with funding from NSF EIA-0196217"
# Where motion is from and what it may be used for, by the group that a clip's name begins with.
SOURCES = {
    "procedural": "scripted here",
    "mocap": "DeepMimic's motion files (MIT)",
    "game": "the KayKit animation pack (CC0)",
    "cmu": "the history of the AnimatedDrawings project (MIT)",
    "child": "the history of the AnimatedDrawings project (MIT)",
    "evaluation": "the history of the AnimatedDrawings project; measured on, never trained on",
    "cmu_db": _CMU,
    "validation": _CMU,
    "snu": "HumanFoot of Seoul National University (Apache-2.0)",
    "mesh2motion": "Mesh2Motion (CC0)"}

LEVELS = (evaluate.SCALE, evaluate.PLAIN, *evaluate.LEVELS.values())
COUNTS = ("no", "one", "two", "three", "four", "five", "six")
WIDTH = 120


def wrapped(text):
    """Lines of at most WIDTH columns."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > WIDTH:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + word
    return lines


def network(tensors, metadata, size_bytes):
    """What a bundle holds, from its tensors' shapes."""
    def shape(name):
        return tensors[name].shape

    bones, joints = json.loads(metadata["bones"]), json.loads(metadata["feature_joints"])
    n, d = len(tensors["template.positions"]), len(tensors["features.mean"])
    weights = tensors["static.initial_weights"] + tensors["static.residual_weights"].sum(0, dtype=np.float64)
    influences = int((weights > 0).sum(1).max())
    text = (f"{n:,} vertices, {len(tensors['template.faces']):,} triangles, {metadata['tick_rate']} Hz; "
            f"{size_bytes / 1e6:.1f} MB. "
            f"Cloth bones: {', '.join(bones)} ({len(bones)}). Features: {', '.join(joints)}"
            f"{_ROOT_MOTION[metadata['root_motion']]} ({d}). "
            f"Static MLP {d}-{shape('static.mlp.0.bias')[0]}-{shape('static.mlp.2.bias')[0]}, at most {influences} "
            f"bone{'s' if influences > 1 else ''} a vertex")
    units = tensors.get("skeleton.gru.weight_hh")
    if units is not None:
        text += f"; skeleton stage k_S = {units.shape[1]}"
        if "skeleton.components" in tensors:
            text += f" over {len(tensors['skeleton.components'])} principal components"
    if "mesh.basis" in tensors:
        layers = len({name.split(".")[2] for name in tensors if name.startswith("mesh.layers.")})
        k, hidden = len(tensors["mesh.basis"]), shape("mesh.mlp.0.bias")[0]
        text += (f"; mesh stage {COUNTS[layers] if layers < len(COUNTS) else layers} layers of width "
                 f"{shape('mesh.embed.weight')[1]}, MLP {n}-{hidden}-{k}, k_M = {k}")
    if "patch.joints" in tensors:
        patches, points = shape("patch.point_joints")[:2]
        layers, neighbours = shape("patch.near")[:2]
        count = sum(value.size for name, value in tensors.items()
                    if re.match(r"patch\.(enter|mix|gates|out|keep)", name))
        text += (f"; patch stage {patches} patches of {points} points, width {len(tensors['patch.enter.bias'])}, "
                 f"{COUNTS[layers] if layers < len(COUNTS) else layers} mixing layers with {neighbours} neighbours, "
                 f"{count:,} weights that all patches share, {shape('patch.map.sources')[1]} points a vertex")
    return wrapped(text + ".")


def sources(provenance):
    """A row for each group of clips that a network learned from or was chosen by: how many, of whom, from where."""
    rows = {}
    for role, names in (("training", train.learned(provenance)), ("validation", _chosen_by(provenance))):
        for name in names:
            rows.setdefault((role, name.partition("/")[0]), set()).add(name)
    out = ["| clips | for | people | from |", "|---|---|---|---|"]
    for (role, group), names in sorted(rows.items()):
        who = {clips.person(name) for name in names} - {None}
        people = "several" if who & clips.SEVERAL else len(who) or "-"
        out.append(f"| {len(names)} of `{group}/` | {role} | {people} | {SOURCES.get(group, 'not told')} |")
    return out


def _chosen_by(provenance):
    """Clips that chose epochs, also before the training that this one was started from."""
    return set() if not provenance else {*provenance.get("validation_clips", []),
                                         *_chosen_by(provenance.get("started_from"))}


def _row(name, row, levels, floor):
    """Cells of one clip, or of the mean over clips: E_d of each level, and what the last one leaves."""
    def cell(keys, form, of=row[levels[-1]]):
        value = evaluate.at(of, keys)
        return "-" if value is None else format(value, form)

    # Cards made before motion was measured with the errors have it with the floor.
    alive = evaluate.at(row[levels[-1]], ("alive_mm",)) or floor.get("alive_mm")
    perturbed, entered = floor.get("mean_mm"), floor.get("entered_mm")
    share = f"{perturbed / floor['alive_mm']:.0%}" if perturbed is not None and floor.get("alive_mm") else "-"
    relative = cell(("relative_error",), ".2f")
    if relative == "-" and floor.get("alive_mm") and floor.get("of_all", True):
        relative = f"{row[levels[-1]]['position_mm']['mean'] / floor['alive_mm']:.2f}"
    last = f"{cell(('position_mm', 'mean'), '.2f' if 'clips' in row[levels[-1]] else '.1f')}"
    cells = [name, "-" if alive is None else f"{alive:.0f}",
             " / ".join("-" if value is None else f"{value:.1f}" for value in (perturbed, entered)), share,
             *(cell(("position_mm", "mean"), ".1f", row[level]) for level in levels[:-1]), f"**{last}**",
             relative, cell(("relative_motion_error",), ".2f"),
             cell(("position_mm", "p99"), ".0f"), cell(("normal_deg", "mean"), ".1f")]
    return "| " + " | ".join(cells) + " |"


def errors(results, floors):
    """Tables of evaluate.py's results, one a source (evaluate.by_source): a row a clip, then every measure a level.

    floors: {clip: {mean_mm, entered_mm, alive_mm}} where known.
    """
    levels = [level for level in LEVELS if all(level in row for row in results.values())]
    if not levels:
        raise ValueError(f"none of the levels {', '.join(LEVELS)} in every clip")
    out = []
    for source, rows in evaluate.by_source(results):
        overall = evaluate.overall(rows)
        known = [floors[clip] for clip in rows if clip in floors]
        floor = {key: np.mean(values) for key in ("mean_mm", "entered_mm", "alive_mm")
                 if (values := [row[key] for row in known if row.get(key) is not None])}
        floor["of_all"] = len(known) == len(rows)
        out += [f"{source.capitalize()} clips:", "",
                f"| clip | motion | floor | floor / motion | {' | '.join(levels)} | relative error | relative motion "
                "error | p99 | E_n |", "|---" * (len(levels) + 8) + "|",
                *(_row(f"`{clip}`", row, levels, floors.get(clip, {})) for clip, row in rows.items()),
                _row("over the clips", overall, levels, floor), ""]
        if all("bands" in row[levels[-1]] for row in rows.values()):
            columns = [level for level in ("truth", *levels) if level in overall]
            texts = [evaluate.figures(overall[level]) for level in columns]
            out += [f"| over the {source} clips | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|",
                    *(f"| {title} | " + " | ".join(text[k] for text in texts) + " |"
                      for k, (title, _, _) in enumerate(evaluate.FIGURES) if any(text[k] != "-" for text in texts)), ""]
    return out[:-1]


def _familiar(row):
    """How far a failure's motion is from training, where that was measured."""
    if "motion_away" not in row:
        return ""
    return (f" Its last third of a second is {row['motion_away']:.2f} deviations a feature away from the nearest in "
            f"training, `{row['most_alike']}` (over the clip {row['clip_motion_away']:.2f}).")


def _of_alive(row):
    """How much the clip's truth moves, where that was measured."""
    return f", its truth moves by {row['clip_alive_mm']:.0f} mm" if "clip_alive_mm" in row else ""


def failures(rows, folder):
    """Pictures of failures.json with what goes wrong, where somebody wrote it down."""
    out = []
    for row in rows:
        out += [f"**`{row['clip']}`, {row['second']:g} s**", "",
                f"![{row['clip']}, frame {row['frame']}: truth, prediction and error]({folder}/{row['picture']})", "",
                *wrapped(f"{row['mean_mm']:.1f} mm on average (the clip: {row['clip_mean_mm']:.1f} mm"
                         f"{_of_alive(row)}), "
                         f"{row['p99_mm']:.0f} mm at the 99th percentile, {row['max_mm']:.0f} mm at worst."
                         f"{_familiar(row)} {row.get('why', '')}"), ""]
    return out[:-1]
