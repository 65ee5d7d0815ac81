"""Milliseconds against millimetres: every variant of one garment, the front joined, what others dominate hollow."""
from pages import chart

WIDTH, HEIGHT, BOX = 980, 430, (64, 74, 956, 372)
COLOR = {"fp32": "a", "fp16": "c", "int8": "b"}
STAGES = {"mesh": "all stages", "skeleton": "to the skeleton stage", "static": "static stage alone"}
SHAPES = {"mesh": "m-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0z", "skeleton": "m-5.2-5.2h10.4v10.4h-10.4z",
          "static": "m0-6.8l6.5 11.6h-13z"}


def compared(row):
    return (row["truth"] or row["fp32"])["position_mm"]["mean"]


def _mark(stages, x, y, color, hollow):
    return (f'<path class="l{color} {"h" if hollow else "f"}{color}" stroke-width="1.7" '
            f'd="M{x:.1f} {y:.1f}{SHAPES[stages]}"/>')


def _key(rows):
    parts, x, y = [], BOX[0] - 32, 50

    def entry(content, mark):
        nonlocal x
        parts.extend([mark, chart.text(x + 11, y, content, "s")])
        x += 34 + chart.CHARACTER * len(content)
    for precision, color in COLOR.items():
        if any(row["precision"] == precision for row in rows):
            entry(precision, _mark("mesh", x, y - 4, color, False))
    for stages, content in STAGES.items():
        if any(row["stages"] == stages for row in rows):
            entry(content, _mark(stages, x, y - 4, "n", False))
    if any(row["dominated"] for row in rows):
        entry("dominated", _mark("mesh", x, y - 4, "n", True))
    return parts


def picture(name, evaluated, quiet):
    rows = [row for row in evaluated["variants"] if row["dominated"] is not None]
    panel = chart.Panel(BOX, [row["tick_ms"]["p50"] for row in rows], [compared(row) for row in rows])
    truth = any(row["truth"] for row in rows)
    against = "mean error to the simulation" if truth else "mean difference to fp32"
    title = f"{name}: {against}, mm, against a cold tick" + ("" if quiet else " (the machine was not quiet: no result)")
    parts = panel.axes("", "tick with skinning and normals, caches emptied, p50, ms")
    parts += [chart.text(BOX[0] - 40, 28, title, "t", weight=600), *_key(rows)]
    base = next((row for row in evaluated["variants"] if row["name"] == "skinning" and row["truth"]), None)
    if base:
        parts.append(chart.text(BOX[2], 28, f"plain skinning: {compared(base):.1f} mm", "s", "end"))
    front = sorted((row for row in rows if not row["dominated"]), key=lambda row: row["tick_ms"]["p50"])
    places = {row["name"]: (panel.x(row["tick_ms"]["p50"]), panel.y(compared(row))) for row in rows}
    if front:
        way = f"M{places[front[0]['name']][0]:.1f} {panel.top}"
        way += "".join(f"V{places[row['name']][1]:.1f}H{places[after['name']][0]:.1f}"
                       for row, after in zip(front, front[1:]))
        parts.append(f'<path class="note" stroke-width="1.5" '
                     f'd="{way}V{places[front[-1]["name"]][1]:.1f}H{panel.right}"/>')
    for row in [row for row in rows if row["dominated"]] + front:
        parts.append(_mark(row["stages"], *places[row["name"]], COLOR[row["precision"]], row["dominated"]))
    labels = chart.Labels(panel, places.values())
    for row in front + [row for row in rows if row["dominated"] and row["name"] in COLOR]:
        x, y = places[row["name"]]
        place = labels.place(x, y, row["name"])
        if place is None:
            continue
        left, line, beside = place
        if not beside:
            middle = left + chart.BOLD * len(row["name"]) / 2
            parts.append(f'<path class="l{COLOR[row["precision"]]}" stroke-width=".8" '
                         f'd="M{x:.1f} {y:.1f}L{middle:.1f} {line - 4:.1f}"/>')
        parts.append(chart.text(left, line, row["name"], f"f{COLOR[row['precision']]} halo", weight=600))
    return chart.svg(WIDTH, HEIGHT, parts, title)
