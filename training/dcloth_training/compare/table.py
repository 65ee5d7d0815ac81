"""The finished rows as table.json, table.md and table.png."""
import json
import os

import numpy as np

from .. import dataset, evaluate, metrics
from .keep import write_json

METRICS = ("position_mm", "normal_deg")
# Of evaluate.FIGURES, the columns that the table has.
COLUMNS = ("E_d mm", "relative error", "motion error mm", "E_n deg", "coarse mm", "middle mm", "fine mm",
           "energy coarse", "middle", "fine")
COLOURS = {"scale": "#9a9a9a", "ours": "#1f6fb4", "patches": "#6a4fa3", "ablation": "#8fbbe0", "control": "#5f9e6e",
           "family": "#d98b3a"}


def averages(record, clips):
    """{source (evaluate.by_source): measures over those clips, every clip counting the same}."""
    chosen = {clip: record["clips"][clip] for clip in clips}
    return {source: metrics.over_clips(rows.values()) for source, rows in evaluate.by_source(chosen)}


def read_floor(path, clips):
    """{clip: floor in mm} of simulate/floor.py's file, for those of `clips` that it has."""
    if path is None:
        return {}
    with open(path) as file:
        try:
            found = {row["clip"]: float(row["mean_mm"]) for row in json.load(file)["clips"]}
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path}: not a floor file ({error!r}); expected what "
                             f"simulate/floor.py --out writes") from None
    return {c: found[c] for c in clips if c in found}


def collect(records, clips, floor, settings, remarks):
    """The whole table as one JSON value."""
    rows = [{**r, "average": averages(r, clips), "clips": {c: r["clips"][c] for c in clips}}
            for r in records]
    return {"clips": clips, "frames": {c: rows[0]["clips"][c]["frames"] for c in clips},
            "floor_mm": floor, "settings": settings, "remarks": remarks, "rows": rows,
            "better_than_full": better(rows, clips)}


def better(rows, clips):
    """Where a row outside ours beats the deepest of ours: [{row, clip (or source), metric, by}]."""
    ours = [r for r in rows if r["group"] == "ours"]
    if not ours:
        return []
    full, out = ours[-1], []
    for row in rows:
        if row["group"] == "ours":
            continue
        for place in [*full["average"], *clips]:
            mine, other = (r["average"].get(place) or r["clips"][place] for r in (full, row))
            for metric in METRICS:
                gain = mine[metric]["mean"] - other[metric]["mean"]
                if gain > 0:
                    out.append({"row": row["key"], "clip": place, "metric": metric, "by": gain})
    return out


def _grid(head, lines):
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, rule, *lines])


def _mean_floor(floor, clips):
    return f"{np.mean([floor[c] for c in clips]):.2f}" if all(c in floor for c in clips) else "-"


def _of_source(clips, source):
    return [clip for clip in clips if dataset.source(clip) == source]


def _main_grid(table, source):
    """Every row's measures over the clips of a source."""
    floor, clips = table["floor_mm"], _of_source(table["clips"], source)
    at = [[title for title, _, _ in evaluate.FIGURES].index(column) for column in COLUMNS]
    head = ["model", *COLUMNS, "p99 mm", "learned numbers", "training, min"] + (["floor, mm"] if floor else [])
    lines = []
    for row in table["rows"]:
        found = row["average"][source]
        texts = evaluate.figures(found)
        minutes = "-" if row["minutes"] is None else f"{row['minutes']:.1f}"
        lines.append([row["title"], *(texts[k] for k in at), f"{found['position_mm']['p99']:.1f}",
                      f"{row['parameters']:,}", minutes] + ([_mean_floor(floor, clips)] if floor else []))
    return _grid(head, lines)


def _clip_grid(table, metric):
    floor = table["floor_mm"] if metric == "position_mm" else {}
    head = ["clip"] + (["floor"] if floor else []) + [r["title"] for r in table["rows"]]
    lines = []
    for clip in table["clips"]:
        cells = [f"`{clip}` ({table['frames'][clip]})"]
        if floor:
            cells.append(f"{floor[clip]:.2f}" if clip in floor else "-")
        values = [r["clips"][clip][metric] for r in table["rows"]]
        lowest = min(v["mean"] for v in values)
        for v in values:
            text = f"{v['mean']:.2f} ± {v['std']:.2f}"
            cells.append(f"**{text}**" if v["mean"] == lowest else text)
        lines.append(cells)
    return _grid(head, lines)


def _better_text(table):
    titles = {r["key"]: r["title"] for r in table["rows"]}
    units = {"position_mm": "mm of E_d", "normal_deg": "degrees of E_n"}
    if not any(r["group"] == "ours" for r in table["rows"]):
        return ["None of ours was asked for."]
    if not table["better_than_full"]:
        return ["None, on no clip."]
    return [f"- {titles[b['row']]}, {b['clip']}: by {b['by']:.2f} {units[b['metric']]}"
            for b in table["better_than_full"]]


def markdown(table):
    fits = [f"- {r['title']}: {r['note']}." + "".join(
        f" {name} {f['epochs']} epochs, best at {f['best_epoch']}"
        f" ({f['validation_mm']:.2f} mm on validation);" for name, f in r["fits"].items()).rstrip(";")
        for r in table["rows"]]
    mains = []
    for source in table["rows"][0]["average"]:
        alive = table["rows"][0]["average"][source]["alive_mm"]
        mains += [f"## {source.capitalize()} clips (the truth moves by {alive:.1f} mm)", "",
                  _main_grid(table, source), ""]
    return "\n".join([
        "# Ablation and comparison", "",
        f"Held-out clips: {len(table['clips'])}, with {sum(table['frames'].values())} frames that count. E_d: mean "
        "vertex distance. Motion: mean distance of the truth from its own mean shape; relative error: E_d / motion. "
        "E_n: mean angle between vertex normals. Coarse, middle, fine: error within waves longer than about 6 edges, "
        "between, and shorter than about 3; energy: how much the prediction moves there, as a share of the truth. "
        "Every clip counts the same; recorded and scripted clips are never averaged together. Learned numbers: what "
        "training moved and a run stores, weight matrices folded. Training minutes: in the loops of optimisation, "
        "validation included, all stages of the row together."
        + (" Floor: what two simulations of a clip disagree on." if table["floor_mm"] else ""), "",
        *mains, "## E_d per clip, mm (frames in brackets; lowest in bold)", "",
        _clip_grid(table, "position_mm"), "", "## E_n per clip, degrees", "",
        _clip_grid(table, "normal_deg"), "", "## Rows better than the deepest of ours", "",
        *_better_text(table), "", "## What the rows are", "", *fits, "",
        *(["## Remarks", "", *(f"- {r}" for r in table["remarks"]), ""] if table["remarks"] else [])])


def picture(table, path):
    """Bars of E_d and E_n with their deviation over frames, a row of panels a source; the floor as a line."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    rows, sources = table["rows"], list(table["rows"][0]["average"])
    figure, grid = pyplot.subplots(len(sources), 2, sharey=True, squeeze=False,
                                   figsize=(10, len(sources) * (0.9 + 0.34 * len(rows))))
    for axes, source in zip(grid, sources):
        for axis, (metric, label) in zip(axes, (("position_mm", "$E_d$, mm"), ("normal_deg", "$E_n$, degrees"))):
            values = [row["average"][source][metric] for row in rows]
            for at, (row, value) in enumerate(zip(rows, values)):
                axis.barh(at, value["mean"], xerr=value["std"], color=COLOURS[row["group"]],
                          error_kw={"elinewidth": 0.8, "capsize": 2})
                axis.text(value["mean"] + value["std"], at, f"  {value['mean']:.1f}", va="center", fontsize=7)
            axis.set(xlabel=f"{label} ({source} clips held out; mean, deviation over frames)",
                     xlim=(0, 1.1 * max(value["mean"] + value["std"] for value in values)))
            axis.grid(axis="x", alpha=0.3)
        axes[0].set_yticks(range(len(rows)))
        axes[0].set_yticklabels([row["title"] for row in rows], fontsize=8)
        floor, clips = table["floor_mm"], _of_source(table["clips"], source)
        if floor and all(clip in floor for clip in clips):
            axes[0].axvline(np.mean([floor[clip] for clip in clips]), color="black", linewidth=0.8, linestyle="--")
    grid[0][0].invert_yaxis()
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def write(table, folder):
    write_json(os.path.join(folder, "table.json"), table)
    with open(os.path.join(folder, "table.md"), "w") as file:
        file.write(markdown(table))
    picture(table, os.path.join(folder, "table.png"))
