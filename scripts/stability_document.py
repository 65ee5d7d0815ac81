#!/usr/bin/env python3
"""Writes models/STABILITY.md from the JSON of the stability tests.

Usage: stability_document.py STABILITY.json -o STABILITY.md
"""
import argparse
import json
import os
import sys

HEAD = """# Numerical stability on hard cases

The bundled garments, converted to fp32, fp16 and int8, driven through the public API on motion from their own
`sequences/`: looped with blends, sped up, turned, and with what goes wrong around a garment. Written by
`scripts/stability.sh` from the tests in `tests/stability`, which fail where a bound is missed. dcloth {version},
{isa}, one thread.

- **Time** is the median and 99th percentile of the case's own ticks, one after another: weights may stay in
  cache, and other work on the machine shows in the 99th percentile.
- **Farthest vertex**: over every drawn frame, from the hips, in units of the garment's size (its farthest vertex
  in the bind pose); allowed is 2. A position that is not finite counts as infinity.
- **Deviation** is the vertex distance to an undisturbed run, the mean over vertices. Allowed is a twentieth of its
  largest value, one second after the disturbance and for half a second. E_d cannot change by more.
- **p** of a slope: Student's t-test over 200 samples (20 for *old against fresh*); below 0.001 the test fails.
  *Old against fresh* compares a garment that never restarted with one that started three seconds before, on the
  same motion. *No growth* is tested on one side.
- Disturbances last half a second (15 ticks) in the middle of a clip. *Joints beyond training range*: each
  joint's angle multiplied so that features lie as far outside the trained range as they get (elements of a rotation
  end at 1; a range that spans them cannot be left). *Zero matrices*:
  every joint collapsed into the origin. |h| = 1 is a start state that no motion leads to: the worst there is.
"""


def number(value):
    return "not finite" if value is None else f"{value:.4g}"


def cell(row):
    return "" if row is None else number(row["value"]) + ("" if row["met"] else " **missed**")


def group(rows):
    """Rows of one garment by case, then figure, in the order in which they came."""
    cases = {}
    for row in rows:
        cases.setdefault(row["case"], {}).setdefault(row["figure"], {})[row["precision"]] = row
    return cases


def bound(rows):
    """One text for a figure's bounds in all precisions; measured bounds differ."""
    texts = [f"{row['allowed'].replace('at most', '≤').replace('at least', '≥')} {number(row['bound'])}"
             for row in rows if row["bound"] is not None]
    return " / ".join(dict.fromkeys(texts))


def document(report):
    if not report["rows"]:
        raise ValueError("no rows: did the tests run?")
    lines = [HEAD.format(**report)]
    missed = [row for row in report["rows"] if not row["met"]]
    bounded = sum(row["bound"] is not None for row in report["rows"])
    lines.append(f"{len(report['rows'])} figures, {bounded} with a bound, {len(missed)} missed.\n")
    for row in missed:
        lines.append(f"- **missed**: {row['garment']} {row['precision']}, {row['case']}: {row['figure']} "
                     f"{number(row['value'])} {row['unit']}, allowed {row['allowed']} {number(row['bound'])}")
    for name, garment in report["garments"].items():
        clips = ", ".join(f"{clip['name']} ({clip['frames']})" for clip in garment["clips"])
        lines.append(f"\n## {name}\n\n{garment['vertices']:,} vertices, size {garment['size_m']:.3f} m. "
                     f"Clips (ticks): {clips}.\n")
        precisions = list(dict.fromkeys(row["precision"] for row in report["rows"] if row["garment"] == name))
        lines.append("| case | figure | " + " | ".join(precisions) + " | bound |")
        lines.append("|---|---|" + "---|" * (len(precisions) + 1))
        for case, figures in group([row for row in report["rows"] if row["garment"] == name]).items():
            first, times = True, {}
            for figure, rows in figures.items():
                unit = next(iter(rows.values()))["unit"]
                cells = [cell(rows.get(p)) for p in precisions]
                lines.append(f"| {case if first else ''} | {figure}{', ' + unit if unit else ''} | "
                             + " | ".join(cells) + f" | {bound(rows.values())} |")
                first = False
                times.update({p: rows[p] for p in rows})
            cells = [" / ".join(number(times[p]["tick_ms"][q]) for q in ("p50", "p99")) if p in times else ""
                     for p in precisions]
            lines.append("| | *tick p50 / p99, ms* | " + " | ".join(cells) + " | |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", metavar="STABILITY.json")
    parser.add_argument("-o", "--output", required=True)
    arguments = parser.parse_args()
    try:
        with open(arguments.report, encoding="utf-8") as file:
            text = document(json.load(file))
    except (OSError, ValueError, KeyError) as error:
        print(f"{arguments.report}: {type(error).__name__}: {error}; write it with scripts/stability.sh",
              file=sys.stderr)
        return 2
    with open(arguments.output + ".part", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(arguments.output + ".part", arguments.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
