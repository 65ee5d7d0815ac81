"""The generated parts of a model card, as Markdown: network, held-out errors, failure cases."""
import json

import numpy as np

# Behind the feature joints' names, by a bundle's metadata "root_motion".
_ROOT_MOTION = {"false": "", "true": " and root motion", "air": " and the air around the hips"}

LEVELS = ("rigid hips", "plain skinning", "stage 1", "stages 1-2", "stages 1-3")
COUNTS = ("no", "one", "two", "three", "four", "five", "six")
WIDTH = 125


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
    residuals = tensors["static.residual_weights"].astype(np.float64)
    weights = tensors["static.initial_weights"].astype(np.float64) + residuals.sum(0)
    text = (f"{n:,} vertices, {len(tensors['template.faces']):,} triangles, {metadata['tick_rate']} Hz; "
            f"{size_bytes / 1e6:.1f} MB. "
            f"Cloth bones: {', '.join(bones)} ({len(bones)}). Features: {', '.join(joints)}"
            f"{_ROOT_MOTION[metadata['root_motion']]} ({d}). "
            f"Static MLP {d}-{shape('static.mlp.0.bias')[0]}-{shape('static.mlp.2.bias')[0]}, {len(residuals)} "
            f"residual weight matrices, at most {int((weights > 0).sum(1).max())} bones a vertex")
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
    return wrapped(text + ".")


def errors(results, floors):
    """Table of evaluate.py's results, a row a clip; `floors` {clip: {mean_mm, entered_mm, alive_mm}} where known."""
    levels = [level for level in LEVELS if all(level in row for row in results.values())]
    if not levels:
        raise ValueError(f"none of the levels {', '.join(LEVELS)} in every clip")
    last = levels[-1]

    def mean(values, digits):
        known = [v for v in values if v is not None]
        return f"{np.mean(known):.{digits}f}" if known else "-"

    def of(name, key):
        return floors.get(name, {}).get(key)

    def row(name, names, digits):
        positions = {level: [results[n][level]["position_mm"] for n in names] for level in levels}
        cells = [f"{mean([of(n, 'mean_mm') for n in names], 1)} / {mean([of(n, 'entered_mm') for n in names], 1)}",
                 mean([of(n, "alive_mm") for n in names], 0)]
        cells += [mean([p["mean"] for p in positions[level]], digits) for level in levels[:-1]]
        final = mean([p["mean"] for p in positions[last]], digits)
        cells += [f"**{final} ± {positions[last][0]['std']:.1f}**" if len(names) == 1 else f"**{final}**",
                  mean([p["p99"] for p in positions[last]], 0),
                  mean([results[n][last]["normal_deg"]["mean"] for n in names], 1)]
        return f"| {name} | " + " | ".join(cells) + " |"

    return [f"| clip | floor | alive | {' | '.join(levels)} | p99 | E_n |", "|---" * (len(levels) + 5) + "|",
            *(row(f"`{name}`", [name], 1) for name in results), row("mean of the clips", list(results), 2)]


def _familiar(row):
    """How far a failure's motion is from training, where that was measured."""
    if "motion_away" not in row:
        return ""
    return (f" Its last third of a second is {row['motion_away']:.2f} deviations a feature away from the nearest in "
            f"training, `{row['most_alike']}` (over the clip {row['clip_motion_away']:.2f}).")


def failures(rows, folder):
    """Pictures of failures.json with what goes wrong, where somebody wrote it down."""
    out = []
    for row in rows:
        out += [f"**`{row['clip']}`, {row['second']:g} s**", "",
                f"![{row['clip']}, frame {row['frame']}: truth, prediction and error]({folder}/{row['picture']})", "",
                *wrapped(f"{row['mean_mm']:.1f} mm on average (the clip: {row['clip_mean_mm']:.1f} mm), "
                         f"{row['p99_mm']:.0f} mm at the 99th percentile, {row['max_mm']:.0f} mm at worst."
                         f"{_familiar(row)} {row.get('why', '')}"), ""]
    return out[:-1]
