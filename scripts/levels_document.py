#!/usr/bin/env python3
"""Draws the levels of detail of a garment, cost beside error, and writes them into a page's table.

Usage: levels_document.py LEVELS.json CROWDS.json --garment NAME --picture OUT.svg --page PAGE.md

LEVELS.json is what scene_garment_test writes into the file that DCLOTH_LEVELS_JSON names; CROWDS.json is what
`dcloth profile --characters` prints, one crowd after the other. In PAGE.md the rows between "<!-- levels -->" and
"<!-- /levels -->" are replaced. Ends with 1 where a crowd was late in more than one frame of a thousand.
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
DRAWN = {"full": "fully", "positions": "without new normals", "plain": "without contact", "coarse": "coarse",
         "nothing": "not"}
MOST_LATE = 1e-3    # of a crowd's frames


def read(path, garment):
    """The garment's levels."""
    reports = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    for report in reports:
        if report["garment"] == garment:
            missing = set(ROWS) - {level["name"] for level in report["levels"]}
            if missing:
                raise ValueError(f"{path}: garment '{garment}' lacks the levels {', '.join(sorted(missing))}")
            return report
    found = ", ".join(report["garment"] for report in reports)
    raise ValueError(f"{path}: no garment '{garment}'; found: {found or 'none'}")


def read_crowds(path):
    """Profiles of one worker each."""
    text, found, at = path.read_text(encoding="utf-8").strip(), [], 0
    while at < len(text):
        profile, at = json.JSONDecoder().raw_decode(text, at)
        at += len(text) - at - len(text[at:].lstrip())
        found.append(profile)
    return found


def frames(crowd):
    return crowd["workers"][0]["frames"]


def crowd_table(crowds):
    """What each crowd was given, and what it cost."""
    lines = ["| characters, budget | drawn in a mean frame | at each level | frame: p50 / p99 / most, ms | late | "
             "error of what is seen |", "|---|---|---|---|---|---|"]
    for crowd in crowds:
        worker = crowd["workers"][0]
        drawn = ", ".join(f"{worker['drawn'][name]:.1f} {word}" for name, word in DRAWN.items()
                          if name != "plain" or crowd["contact"])
        levels = ", ".join(f"{count:.1f} {name}" for name, count in worker["at_level"].items() if count >= 0.05)
        ms = worker["frame_ms"]
        contact = " with contact" if crowd["contact"] else ""
        lines.append(f"| {crowd['characters']}{contact}, {crowd['budget_ms']:g} ms | {drawn} | {levels} | "
                     f"{ms['p50']:.2f} / {ms['p99']:.2f} / {ms['max']:.2f} | {crowd['late_frames']} of "
                     f"{frames(crowd):,} | {crowd['error_mm']:.1f} mm |")
    lines += ["", "One core plays `walk_turn`, everyone at another place of it, at 60 Hz. Importance falls with the "
              "square of the distance,\nand up to three frames in a row may pass undrawn. *Late*: over the budget by "
              "more than 5 %; frames that the system\ninterrupted are not counted."]
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
    drawing = crowds[0]["workers"][0]["draw_ms"]
    full, positions, coarse, nothing = (1e3 * drawing[draw] for draw in ("full", "positions", "coarse", "nothing"))
    lines += ["", f"In a crowd of 16 a frame without a tick costs {full:.0f} µs with positions and normals, "
              f"{positions:.0f} with positions\nalone, {coarse:.0f} with the coarse mesh and its normals, and "
              f"{nothing:.0f} undrawn.", ""]
    lines += crowd_table(crowds)
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
    parser.add_argument("crowds", type=Path)
    parser.add_argument("--garment", required=True)
    parser.add_argument("--picture", type=Path, required=True)
    parser.add_argument("--page", type=Path, required=True)
    options = parser.parse_args()
    try:
        report, crowds = read(options.levels, options.garment), read_crowds(options.crowds)
        page = replace(options.page.read_text(encoding="utf-8"), options.page, table(report, crowds))
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    picture(report, options.picture)
    part = options.page.with_name(options.page.name + ".part")
    part.write_text(page, encoding="utf-8")
    os.replace(part, options.page)
    late = [crowd for crowd in crowds if crowd["late_frames"] > MOST_LATE * frames(crowd)]
    for crowd in late:
        print(f"{crowd['characters']} characters in {crowd['budget_ms']:g} ms: {crowd['late_frames']} of "
              f"{frames(crowd)} frames are late", file=sys.stderr)
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
