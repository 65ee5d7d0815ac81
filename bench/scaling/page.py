"""The measured curves as a Markdown page with a picture for every axis."""
from pages import chart, machine, steps
from pages.markdown import bullets, ms, table, wrapped

from .bends import character_reasons, crossings, exponent, p50, reasons, sized
from .measure import AXES

PAGE = """\
# How cost grows

Written by `bench/results/run.sh`, the one command that repeats it together with the [results](../results/RESULTS.md);
do not edit.

{machine}

Synthetic skirts with random weights, which cost what trained ones cost, in {precision}: {size}, unless the axis says
otherwise. A frame is one tick with skinning and normals on one core. **Warm**: frame after frame, {warm} of them;
**cold**: what it reads and writes is dropped from the caches before each, {cold} of them (the 99th percentile of so few
is their maximum). **Bytes of a frame**: weights and states that its kernels read and write, counted from the sizes.
**To fp32**: distance of vertices to the same garment in fp32, mean / max over {error_frames} ticks: what {precision}
costs. **Growth**: exponent of warm p50 from the row above (1: in proportion) and the cache that a frame's bytes have
outgrown since. The sentences below each table are written from its figures: an exponent that changes by 0.25 or more is
called a bend.

{sections}
"""
CHARACTERS = """\
## Against characters

![one character's time, and memory, against characters](characters.svg)

One model, shared; every character ticks and is drawn in turn. Times are of one of them.

{table}

{reasons}
"""
WIDTH, HEIGHT = 980, 360
LEFT, RIGHT = (64, 52, 430, 300), (560, 52, 905, 300)


def _picture(rows, title, lines, memory, caches, quiet):
    """`lines` {(name, colour): (p50s, p95s)}, `memory` {(name, colour): MB}; `caches` [(name, value)] on the axis."""
    xs = [row["value"] for row in rows]
    highest = max(v for p50s, _ in lines.values() for v in p50s)
    time = chart.Panel(LEFT, xs, [min(v, 2 * highest) for pair in lines.values() for values in pair for v in values],
                       xs)
    space = chart.Panel(RIGHT, xs, [v for values in memory.values() for v in values], xs)
    label = "p50, thin lines up to p95" if quiet else "the machine was not quiet: no result"
    parts = time.axes(f"time, ms ({label})", title) + space.axes("memory, MB", title)
    for name, value in caches:
        parts += time.mark_x(value, f"{name} full")
    for panel, columns in ((time, lines), (space, {name: (values, ()) for name, values in memory.items()})):
        ends = {}
        for (name, color), (values, tails) in columns.items():
            points = list(zip(xs, values))
            parts += panel.line(points, color, [min(tail, panel.y_high) for tail in tails])
            ends[name, color] = points[-1]
        parts += panel.names(ends)
    return chart.svg(WIDTH, HEIGHT, parts, f"{title}: time and memory")


def axis_picture(title, rows, caches, quiet):
    lines = {(heat, color): tuple([row[heat]["frame_ms"][q] for row in rows] for q in ("p50", "p95"))
             for heat, color in (("cold", "a"), ("warm", "b"))}
    memory = {(name, color): [row[f"{key}_bytes"] / 1e6 for row in rows]
              for name, key, color in (("a frame", "frame", "c"), ("model", "model", "d"),
                                       ("instance", "instance", "n"))}
    return _picture(rows, title, lines, memory, [(name, at) for name, _, at, _ in crossings(rows, caches)], quiet)


def characters_picture(said, caches, quiet):
    rows = [{"value": row["characters"], "bytes": said["model_bytes"] + row["characters"] * said["instance_bytes"]}
            for row in said["rows"]]
    lines = {("one", "b"): tuple([row["ms"][q] for row in said["rows"]] for q in ("p50", "p95"))}
    memory = {("together", "c"): [row["bytes"] / 1e6 for row in rows]}
    marks = [(name, at) for name, _, at, _ in crossings(rows, caches, lambda row: row["bytes"])]
    return _picture(rows, "characters", lines, memory, marks, quiet)


def _three(times):
    return " / ".join(ms(times[q]) for q in ("p50", "p95", "max"))


def axis_table(title, rows, caches):
    outgrown = {}
    for name, _, _, beyond in crossings(rows, caches):
        outgrown.setdefault(id(beyond), []).append(name)
    lines, before = [], None
    for row in rows:
        kernels = sorted(row["warm"]["kernels_ms"].items(), key=lambda pair: -pair[1])[:2]
        growth = f"{exponent(before, row, p50):.2f}" if before else "–"
        growth += "".join(f", past {name}" for name in outgrown.get(id(row), ()))
        lines.append([f"{row['value']:,}",
                      *(f"{row[key] / 1e6:.2f}" for key in ("model_bytes", "instance_bytes", "frame_bytes")),
                      _three(row["warm"]["frame_ms"]), _three(row["cold"]["frame_ms"]),
                      f"{row['error_mm']['mean']:.2f} / {row['error_mm']['max']:.2f} mm",
                      ", ".join(f"{name} {ms(spent)}" for name, spent in kernels), growth])
        before = row
    return table([title, "model, MB", "instance, MB", "bytes of a frame, MB", "warm p50 / p95 / max, ms",
                  "cold p50 / p95 / max, ms", "to fp32", "largest kernels, warm p50, ms", "growth"], lines)


def characters_table(said, caches):
    lines, error = [], said["error_mm"]
    for row in said["rows"]:
        count, together = row["characters"], said["model_bytes"] + row["characters"] * said["instance_bytes"]
        lines.append([count, f"{together / 1e6:.1f}",
                      next((name for name, size in caches if together <= size), "memory"),
                      " / ".join(ms(row["ms"][q]) for q in ("p50", "p95", "p99", "max")),
                      f"{count * row['ms']['p50']:.2f}", f"{error['mean']:.2f} / {error['max']:.2f} mm"])
    return table(["characters", "model and states, MB", "fit into", "one character p50 / p95 / p99 / max, ms",
                  "all, p50, ms", "to fp32"], lines)


def _machine(results):
    m, limits = results["machine"], results["limits"]
    rows = results["scaling"]["axes"]["vertices"]
    reads = ", ".join(f"{row['warm']['read_gbs']:.0f} for {row['frame_bytes'] / 1e6:.1f} MB" for row in rows)
    return "\n".join([
        machine.built(results),
        f"Data caches of a core: {', '.join(f'{n} {sized(s)}' for n, s in results['caches'])}. It reads from "
        f"memory at {limits['read_gbps']:.1f} GB/s and, the same bytes again and again, at (GB/s) {reads}.",
        steps.text(results["scaling"]["run"], m["cores"], results["quick"])])


def quiet(results):
    return machine.quiet(results["scaling"]["run"]["others_used_cores"])


def pictures(results):
    """{file name: SVG}."""
    scaling, caches = results["scaling"], results["caches"]
    made = {f"{axis}.svg": axis_picture(AXES[axis][0], rows, caches, quiet(results))
            for axis, rows in scaling["axes"].items()}
    return made | {"characters.svg": characters_picture(scaling["characters"], caches, quiet(results))}


def markdown(results):
    scaling, caches = results["scaling"], results["caches"]
    sections = []
    for axis, rows in scaling["axes"].items():
        title = AXES[axis][0]
        sections.append(f"## Against {title}\n\n![time and memory against {title}]({axis}.svg)\n\n"
                        f"{axis_table(title, rows, caches)}\n\n{bullets(reasons(title, rows, caches))}\n")
    said = scaling["characters"]
    sections.append(CHARACTERS.format(table=characters_table(said, caches),
                                      reasons=bullets(character_reasons(said, caches))))
    any_row = scaling["axes"]["vertices"][0]
    page = PAGE.format(machine=_machine(results), precision=scaling["precision"], error_frames=scaling["error_frames"],
                       size=", ".join(f"{name} {value:,}" for name, value in scaling["size"].items()),
                       warm=any_row["warm"]["frames"], cold=any_row["cold"]["frames"],
                       sections="\n".join(sections).rstrip("\n"))
    return wrapped(page)
