"""The duel's figures as a Markdown page."""
from pages import machine, steps
from pages.markdown import bullets, ms, table, wrapped

from .contest import BUDGETS, OURS, TITLES

PAGE = """\
# The duel: {garment}

Written by `bench/duel/run.sh {garment}`, the one command that repeats it; do not edit.

{machine}

The same clips, host frames at {hz} Hz, one core, one thread, the contestants in turns; each figure of time is a frame's
least of {rounds} rounds. A frame is all in: network or simulation, contact, the drawn mesh of {vertices:,} vertices and
its normals. All of a contestant's data is warm. Truth: {truth}. **E_d**: mean distance of vertices to it; **relative**:
E_d over how far the truth moves; **motion error**: relative too, each cloth about its own mean shape. **Bands**: energy
of waves longer than about 6 edges / 3 to 6 / shorter, the truth's is 1. **Under skin**: share of the cloth's area more
than 1 mm under the body. Settings of rivals are those that did best on development clips (`tuned.json`).

## Who wins at which budget

{verdicts}

{budgets}

Of each method the contestant with the least E_d whose 99th percentile of frames (thread time) keeps the budget.
*Instance*: memory of one more character; *shared*: what all characters of a kind read; both from the sizes of arrays.

## Clip by clip

E_d in mm of the same contestants, the least in bold: where it is not dcloth's, simulation wins.

{clips}

## Every contestant

{everyone}

## Teleport, hitch, 24 Hz

On `{event_clip}`, of each method the contestant at {event_budget} ms a frame, else its cheapest. **Parted**: mm from
its own play without the event, the mean of the second after it and its worst frame; **strain**: p99 in the worst frame.
*Said*: the host says that it moved the character by 5 m. For a simulation it then moves the simulation's origin, so
nothing happens. *Unsaid*: it does not say. *Hitch*: one frame of 100 ms; a simulation takes six steps in it.

{events}

## How the rivals are set up

- Each proxy is the garment cut again from its pattern: the same panels, seams, pleats, hems, pins and fabric, with
  larger triangles. It starts from the true shape of the first frame, at rest, and holds the first pose for a second.
- The drawn mesh follows the proxy: a place on a triangle and a height along its vertices' mixed normals.
- Jolt ({jolt}): its soft body with geodesic long-range attachments, dihedral bending whose rest angles are those of the
  hung garment, {capsules} tapered capsules fitted to the skin (4 mm off on average), edges as long as in the pattern,
  AVX2. `jolt-SIZE-N` has N steps a frame. No contact between layers: it has none.
- Training solver: the truth's own method with less of all: `solver-SIZE-SxP` has S small steps of P passes a frame and
  a skin of {body:,} triangles.
- Spring bones: `springs-CxB` has C chains of B bones; the update of VRM 1.0, the same capsules.
- `dcloth-PRECISION[-contact]` spreads a tick over its frames; `-whole` runs it in one frame. dcloth draws its cloth
  late by part of a tick at this frame rate, and is measured so.

Chosen on {tuned_on}:

{settings}
"""


def spread(times):
    return " / ".join(ms(times[q]) for q in ("p50", "p99", "max"))


def share(value):
    return "–" if value is None else f"{value:.2f}"


def fitting(results, method, budget):
    """The method's row of least E_d that keeps the budget, or None."""
    rows = [row for row in results["rows"] if row["method"] == method and row["thread_ms"]["p99"] <= budget]
    return min(rows, key=lambda row: row["error_mm"], default=None)


def chosen(results):
    """Names of all rows that are the best of their method at a budget."""
    found = (fitting(results, method, budget) for method in TITLES for budget in BUDGETS)
    return {row["name"] for row in found if row}


def at_event(results, budget):
    """A row a method: the best at the budget, else the cheapest."""
    out = []
    for method in TITLES:
        rows = [row for row in results["rows"] if row["method"] == method]
        if rows:
            out.append(fitting(results, method, budget) or min(rows, key=lambda row: row["thread_ms"]["p99"]))
    return out


def measured(row, results):
    """Cells of all measures."""
    m = row["measures"]
    under = f"{100 * m['penetration']['area_share']:.2f}" if "penetration" in m else "–"
    return [f"{m['position_mm']['mean']:.1f}", share(m["relative_error"]), share(m["relative_motion_error"]),
            " / ".join(share(m["bands"][band]["energy_ratio"]) for band in ("coarse", "middle", "fine")),
            f"{100 * m['strain_p99']:.0f}", share(m["jitter"]["ratio"]), under]


def budgets_table(results):
    rows = []
    for budget in BUDGETS:
        for method, title in TITLES.items():
            row = fitting(results, method, budget)
            if row:
                rows.append([f"{budget:g}", title, row["name"], spread(row["thread_ms"]), *measured(row, results),
                             f"{row['instance_bytes'] / 1e6:.2f}", f"{row['shared_bytes'] / 1e6:.2f}"])
            elif any(r["method"] == method for r in results["rows"]):
                least = min(r["thread_ms"]["p99"] for r in results["rows"] if r["method"] == method)
                rows.append([f"{budget:g}", title, f"none: the cheapest takes {ms(least)} ms", *["–"] * 10])
    return table(["budget, ms", "method", "contestant", "p50 / p99 / worst, ms", "E_d, mm", "relative", "motion error",
                  "bands", "strain p99, %", "jitter", "under skin, %", "instance, MB", "shared, MB"], rows)


def verdicts(results):
    """A line a budget: who has the least error, and by how much."""
    out = []
    for budget in BUDGETS:
        rows = [row for row in (fitting(results, method, budget) for method in TITLES) if row]
        if not rows:
            out.append(f"{budget:g} ms: nobody keeps this budget.")
            continue
        rows.sort(key=lambda row: row["error_mm"])
        best = rows[0]
        ours = next((row for row in rows if row["method"] in OURS), None)
        second = f", then {rows[1]['name']} with {rows[1]['error_mm']:.1f}" if len(rows) > 1 else ""
        line = (f"{budget:g} ms: **{TITLES[best['method']]}** ({best['name']}) errs least: "
                f"{best['error_mm']:.1f} mm{second}.")
        if ours is None:
            line += " **Simulation wins: dcloth does not keep this budget.**"
        elif ours is not best:
            line += f" **Simulation wins: dcloth errs by {ours['error_mm']:.1f} mm.**"
        if ours and not fitting(results, "contact", budget):
            line += " dcloth keeps the budget only with contact off; simulations have theirs on."
        out.append(line)
    ours = min((row for row in results["rows"] if row["method"] in OURS), key=lambda row: row["error_mm"])
    better = [row for row in results["rows"] if row["method"] not in OURS and row["error_mm"] < ours["error_mm"]]
    better = ", ".join(f"{row['name']} ({row['error_mm']:.1f} mm, {ms(row['thread_ms']['p99'])} ms)" for row in better)
    out.append(f"At any cost dcloth errs by {ours['error_mm']:.1f} mm at least. Simulations that err less, with their "
               f"99th percentile of frames: {better or 'none here'}.")
    return bullets(out)


def clips_table(results):
    """E_d of each budget's contestants on each clip."""
    rows = []
    for budget in BUDGETS:
        found = {method: fitting(results, method, budget) for method in TITLES}
        for k, clip in enumerate(results["clips"]):
            errors = {method: row["errors_mm"][k] for method, row in found.items() if row}
            cells = [f"{errors[method]:.1f}" if method in errors else "–" for method in TITLES]
            if errors:
                least = list(TITLES).index(min(errors, key=errors.get))
                cells[least] = f"**{cells[least]}**"
            rows.append([f"{budget:g}", f"`{clip}`", *cells])
    return table(["budget, ms", "clip", *TITLES.values()], rows)


def everyone_table(results):
    rows = [[row["name"], spread(row["wall_ms"]), spread(row["thread_ms"]), f"{row['error_mm']:.1f}",
             f"{row['instance_bytes'] / 1e6:.2f}", f"{row['shared_bytes'] / 1e6:.2f}"] for row in results["rows"]]
    return table(["contestant", "wall p50 / p99 / worst, ms", "thread p50 / p99 / worst, ms", "E_d, mm", "instance, MB",
                  "shared, MB"], rows)


def events_table(results):
    def parted(found):
        return f"{found['mean_mm']:.1f}, {found['max_mm']:.0f} mm; {100 * found['strain']:.0f} %"

    rows = [[name, parted(found["teleport"]), parted(found["unsaid"]), parted(found["hitch"]),
             ms(found["hitch"]["worst_ms"]), f"{found['error_mm']:.1f}", f"{found['slow_mm']:.1f}",
             spread(found["slow_ms"])] for name, found in results["events"]["rows"].items()]
    return table(["contestant", "teleport, said: parted mean, worst; strain", "unsaid", "hitch",
                  "the hitch's frame, ms", "E_d at 60 Hz, mm", "at 24 Hz",
                  "frame at 24 Hz p50 / p99 / worst, ms"], rows)


def settings_text(tuned):
    return bullets(f"`{name}`: " + ", ".join(f"{key} {value:g}" for key, value in chosen.items())
                   for name, chosen in tuned.get("settings", {}).items())


def markdown(results):
    text = "\n".join([machine.built(results),
                      steps.text(results["run"], results["machine"]["cores"], results["quick"])])
    values = {key: results[key] for key in ("garment", "hz", "rounds", "vertices", "truth", "jolt", "capsules")}
    return wrapped(PAGE.format(
        **values, machine=text, verdicts=verdicts(results), budgets=budgets_table(results), clips=clips_table(results),
        everyone=everyone_table(results), event_clip=results["events"]["clip"],
        event_budget=results["events"]["budget"], events=events_table(results), body=results["body_faces"],
        tuned_on=", ".join(results["tuned"].get("clips", ["no clip: as they come"])),
        settings=settings_text(results["tuned"])).rstrip("\n") + "\n")
