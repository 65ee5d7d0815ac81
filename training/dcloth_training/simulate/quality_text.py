"""The quality report as text: Markdown tables, and files written whole."""
import os

import numpy as np

COLUMNS = (("clip", "clip"), ("frames", "frames"), ("seed", "seed"),
           ("crossed_share", "frames crossing the body"), ("body_crossings_max", "pairs, most"),
           ("body_crossings_frame", "at frame"), ("tangled_share", "tangled frames"),
           ("cloth_crossings_max", "pairs, most"), ("cloth_crossings_frame", "at frame"),
           ("penetration_area_share", "area under the body"), ("penetration_max_mm", "deepest mm"),
           ("strain_p99", "strain p99"), ("stretch_p99", "stretch p99"), ("stretch_max", "stretch max"),
           ("stretch_max_frame", "at frame"), ("torn_share", "torn frames"), ("folded_max", "folded edges"),
           ("folded_max_frame", "at frame"), ("speed_max", "speed max m/s"), ("speed_mean", "speed mean m/s"),
           ("alive_mm", "motion mm"), ("fine_motion_mm", "fine motion mm"), ("floor_mean_mm", "floor mm"),
           ("floor_relative", "floor / motion"), ("floor_entered_mm", "floor, entered late mm"), ("sha256", "SHA-256"),
           ("fault", "fault"))
ROLES = (("reported", "Reported: for the final figures alone"), ("development", "Development: never trained on"),
         ("validation", "Validation: chooses when training stops"), ("training", "Training"))
GROUPS = (*((f"{role}_{source}", f"{title} ({source})") for role, title in ROLES
            for source in ("recorded", "scripted")), ("drapes", "Quasi-static drapes"))
# Of the frames of clips that nobody trains on.
MOST_CROSSED, MOST_TANGLED = 0.01, 0.10
MEANING = (
    "A frame crosses the body where any triangle of the cloth intersects one of the body that it may touch; it is "
    "tangled where 10 pairs of cloth triangles or more intersect (pairs that share a vertex do not count). Both are "
    "exact. Area under the body is the share of the cloth's area more than 1 mm deep. Strain is edge length over rest "
    "length - 1, p99 over all edges and frames; stretch p99 and max are edge length over rest length in the worst "
    "frame. A frame is torn where an edge is four times its length: a limb went through the cloth. Folded edges are "
    "the share at which the cloth is bent by more than 120 degrees. Motion is the mean distance of the cloth from its "
    "mean shape in the hips' frame, fine motion that of its waves shorter than about six edges. The floor is the mean "
    "distance between two simulations of the clip that differ by 0.05 % of the garment's size: no network can be "
    "expected to do better.")


def _cell(row, key):
    value = row.get(key)
    if value is None:
        return ""
    return value[:12] if key == "sha256" else f"{value:g}" if isinstance(value, float) else str(value)


def table(rows):
    """Markdown table of `rows`; columns that no row fills are left out."""
    columns = [(key, title) for key, title in COLUMNS if any(r.get(key) is not None for r in rows)]
    lines = ["| " + " | ".join(title for _, title in columns) + " |", "|---" * len(columns) + "|"]
    return lines + ["| " + " | ".join(_cell(row, key) for key, _ in columns) + " |" for row in rows]


def _over_frames(rows, key):
    """Mean of a share or of pairs a frame, every measured frame counting the same."""
    counts = np.array([row["frames_measured"] for row in rows])
    return float((np.array([row[key] for row in rows]) * counts).sum() / counts.sum())


def verdict(rows):
    """Are clips that nobody trains on cloth? {"crossed_share", "tangled_share", "good"}; None without such clips."""
    own = [row for row in rows if row["group"] != "drapes" and not row["group"].startswith("training")]
    if not own:
        return None
    crossed, tangled = (_over_frames(own, key) for key in ("crossed_share", "tangled_share"))
    return {"crossed_share": crossed, "tangled_share": tangled,
            "good": crossed <= MOST_CROSSED and tangled <= MOST_TANGLED}


def verdict_line(rows):
    """The verdict as a sentence, or nothing."""
    found = verdict(rows)
    if not found:
        return []
    return [f"Of the frames that nobody trains on, {1 - found['crossed_share']:.2%} do not cross the body (wanted: "
            f"{1 - MOST_CROSSED:.0%}) and {1 - found['tangled_share']:.2%} have fewer than 10 crossing pairs of cloth "
            f"(wanted: {1 - MOST_TANGLED:.0%}): {'good' if found['good'] else 'not good enough'}."]


def summary(rows):
    """One row a group: how much there is, what is not cloth, the worst of everything and the floor."""
    lines = ["| group | files | frames | frames crossing the body | tangled frames | pairs of cloth a frame | area "
             "under the body | deepest mm | strain p99, mean | stretch max | torn frames | folded edges | speed max "
             "m/s | motion mm, mean | fine motion mm, mean | floor mm, mean (clips) | floor / motion |",
             "|---" * 17 + "|"]
    for group, title in GROUPS:
        own = [row for row in rows if row["group"] == group]
        if not own:
            continue

        def mean(key, form, among=own):
            known = [row[key] for row in among if row.get(key) is not None]
            return format(np.mean(known), form) if known else ""

        def worst(key):
            known = [row[key] for row in own if row.get(key) is not None]
            return f"{max(known):g}" if known else ""

        def share(key):
            return f"{_over_frames(own, key):.2%} ({sum(row[key] > 0 for row in own)} files)"

        floors = [row for row in own if row.get("floor_mean_mm") is not None and row["alive_mm"]]
        floor = ["", ""]
        if floors:
            sums = [sum(row[key] for row in floors) for key in ("floor_mean_mm", "alive_mm")]
            floor = [f"{sums[0] / len(floors):.2f} ({len(floors)})", f"{sums[0] / sums[1]:.1%}"]
        cells = [title, str(len(own)), str(sum(row["frames"] for row in own)), share("crossed_share"),
                 share("tangled_share"), f"{_over_frames(own, 'cloth_crossings'):.1f}",
                 f"{_over_frames(own, 'penetration_area_share'):.3%}", worst("penetration_max_mm"),
                 mean("strain_p99", ".1%"), worst("stretch_max"), share("torn_share"), worst("folded_max"),
                 worst("speed_max"), mean("alive_mm", ".1f"), mean("fine_motion_mm", ".1f"), *floor]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def markdown(found):
    """The report as Markdown text."""
    rows = found["clips"]
    regimes = sorted({row["regime"] or "unknown" for row in rows})
    seconds = sum(row["frames"] for row in rows) / 30.0
    out = [f"# Ground truth {found['data']}", "",
           f"{len(rows)} clips, {sum(row['frames'] for row in rows)} frames ({seconds / 60:.1f} minutes), "
           f"{found['drapes']} quasi-static drapes; {found['cloth_vertices']} cloth vertices, "
           f"{found['cloth_faces']} triangles. Root motion: {', '.join(regimes)}.", "",
           MEANING, "", *verdict_line(rows), "", *summary(rows), "", "Pictures of every clip: `index.html`.", ""]
    out += ["## Where to look first", "",
            "Faults, then the clips with the most frames that cross the body, then the most stretched edge.", "",
            *table(sorted(rows, key=lambda row: (not row["fault"], -row["crossed_share"],
                                                 -row["stretch_max"]))[:10]), ""]
    for group, title in GROUPS:
        own = [row for row in rows if row["group"] == group]
        if own:
            out += [f"## {title}", "", *table(own), ""]
    if found["refused"]:
        out += ["## Refused", "", "| clip | why |", "|---|---|",
                *(f"| {name} | {why} |" for name, why in found["refused"].items()), ""]
    if found["missing"]:
        out += ["## Not simulated yet", "", ", ".join(found["missing"]), ""]
    out += ["## Left out", "", "| clips | why |", "|---|---|",
            *(f"| {patterns.replace('*/', '').replace('*', '…').replace(' ', ', ')} | {why} |"
              for patterns, why in found["left_out"]), ""]
    return "\n".join(out)


def write(folder, texts):
    """{file name: text} into `folder`; each appears whole or not at all."""
    for name, text in texts.items():
        path = os.path.join(folder, name)
        with open(path + ".part", "w") as file:
            file.write(text + "\n")
        os.replace(path + ".part", path)
