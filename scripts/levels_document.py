#!/usr/bin/env python3
"""Draws the levels of detail of a garment, cost beside error, and writes them into a page's table.

Usage: levels_document.py LEVELS.json --garment NAME --picture OUT.svg --page PAGE.md

LEVELS.json is what scene_garment_test writes into the file that DCLOTH_LEVELS_JSON names. In PAGE.md the rows between
"<!-- levels -->" and "<!-- /levels -->" are replaced.
"""
import argparse
import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "training"))
from dcloth_training import plots

BEGIN, END = "<!-- levels -->\n", "<!-- /levels -->\n"
# What runs, and which steps of a profile that is.
ROWS = {
    "frozen": ("drawing; the static stage once a second", "none"),
    "static": ("pivots follow the pose, no dynamics", "`pose` + `static` of a profile"),
    "skeleton": ("swing and drape", "+ `skeleton` + `displacement`"),
    "mesh": ("everything", "all"),
}
BY_LEVEL = [*list(ROWS)[:3], None, "mesh"]  # DCLOTH_LEVEL_*, one of which is unused


def read(path, garment):
    """The garment's levels, and its crowds."""
    reports = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    crowds = [report for report in reports if report.get("crowd_of") == garment]
    for report in reports:
        if report.get("garment") == garment:
            missing = set(ROWS) - {level["name"] for level in report["levels"]}
            if missing:
                raise ValueError(f"{path}: garment '{garment}' lacks the levels {', '.join(sorted(missing))}")
            return report, crowds
    found = ", ".join(report["garment"] for report in reports if "garment" in report)
    raise ValueError(f"{path}: no garment '{garment}'; found: {found or 'none'}")


def drawing_table(crowds):
    """What less drawing costs, and what crowds are given; `draws` and `drawing_us` by DCLOTH_DRAW_*."""
    nothing, coarse, positions, full = crowds[0]["drawing_us"]
    lines = ["", f"A frame without a tick costs {full:.0f} µs with positions and normals, {positions:.0f} with "
                 "positions "
             f"alone, {coarse:.0f} with the\ncoarse mesh and its normals, and {nothing:.0f} undrawn.", "",
             "| characters, budget | drawn in a mean frame | at each level | frame, of the budget: p50 / p99 / most | "
             "over by 5 % | same work, over by 20 % | error of the drawn |", "|---|---|---|---|---|---|---|"]
    for crowd in crowds:
        none, coarse, positions, full = crowd["draws"]
        drawn = f"{full:.0f} fully, {positions:.0f} without new normals, {coarse:.0f} coarse, {none:.0f} not"
        levels = ", ".join(f"{count:.0f} {name}" for count, name in zip(crowd["levels"], BY_LEVEL) if count >= 0.5)
        lines.append(f"| {crowd['characters']}, {crowd['budget_us'] / 1000:g} ms | {drawn} | {levels} | "
                     f"{crowd['p50']:.2f} / {crowd['p99']:.2f} / {crowd['largest']:.2f} | {crowd['over']} of "
                     f"{crowd['frames']:,} frames | {crowd['disturbed']} of 3,000 | {crowd['error_mm']:.1f} mm |")
    lines.append("")
    lines.append("Frames come at 60 Hz, importance falls with the square of the distance, and up to three frames in a "
                 "row may pass\nundrawn. *Same work* is a frame that only draws, repeated 3,000 times: so many of them "
                 "took 1.2 times their median\nor more. No plan can foresee what else a machine does.")
    return lines


def table(report, crowds):
    lines = ["| level | what runs | cost of a tick | error | distance to mesh | tick |", "|---|---|---|---|---|---|"]
    for level in report["levels"]:
        name = level["name"]
        what, cost = ROWS[name]
        tick = "0" if name == "frozen" else f"{level['tick_us']:.0f} µs"
        distance = "0" if name == "mesh" else f"{level['to_mesh_mm']:.2f} mm"
        lines.append(f"| {name} | {what} | {cost} | {level['error_mm']:.1f} mm | {distance} | {tick} |")
    lines.append(f"| idle, at any level | drawing, until the pose moves | none | {report['idle_mm']:.1f} mm where the "
                 "clips end | – | 0 |")
    lines.append("")
    lines.append(f"Drawing takes {report['draw_us']:.0f} µs more in each frame, at every level. int8, "
                 f"{report['isa']}, one thread, on the bundled sequences;\n"
                 "errors are mean vertex distances to the simulation.")
    if crowds:
        lines += drawing_table(crowds)
    return "\n".join(lines) + "\n"


def picture(report, path):
    """Milliseconds of a tick with its drawing, and millimetres, a row for each level."""
    rows = [("idle", report["draw_us"] * 1e-3, report["idle_mm"])]
    for level in report["levels"]:
        tick_us = 0 if level["name"] == "frozen" else level["tick_us"]
        rows.append((level["name"], (report["draw_us"] + tick_us) * 1e-3, level["error_mm"]))
    plots.levels(rows, path)


def replace(page, path, text):
    if page.count(BEGIN) != 1 or page.count(END) != 1 or page.index(BEGIN) > page.index(END):
        raise ValueError(f"{path}: needs one {BEGIN.strip()} and, after it, one {END.strip()}")
    return page[:page.index(BEGIN) + len(BEGIN)] + text + page[page.index(END):]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("levels", type=Path)
    parser.add_argument("--garment", required=True)
    parser.add_argument("--picture", type=Path, required=True)
    parser.add_argument("--page", type=Path, required=True)
    options = parser.parse_args()
    try:
        report, crowds = read(options.levels, options.garment)
        page = replace(options.page.read_text(encoding="utf-8"), options.page, table(report, crowds))
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    picture(report, options.picture)
    part = options.page.with_name(options.page.name + ".part")
    part.write_text(page, encoding="utf-8")
    os.replace(part, options.page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
