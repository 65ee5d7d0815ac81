"""The quality report as text: Markdown tables, and files written whole."""
import os

import numpy as np

COLUMNS = (("clip", "clip"), ("frames", "frames"), ("seed", "seed"), ("stretch_p99", "stretch p99"),
           ("stretch_max", "stretch max"), ("stretch_max_frame", "at frame"),
           ("torn_share", "torn frames"), ("folded_max", "folded edges"), ("folded_max_frame", "at frame"),
           ("penetration_max_mm", "penetration mm"),
           ("speed_max", "speed max m/s"), ("speed_mean", "speed mean m/s"), ("alive_mm", "against the hips mm"),
           ("floor_mean_mm", "floor mm"), ("floor_entered_mm", "floor, entered late mm"), ("sha256", "SHA-256"),
           ("fault", "fault"))
GROUPS = (("held_out", "Held out: never trained on"), ("training", "Training: scripted and recorded"),
          ("random", "Training: random procedural"), ("variation", "Training: variations"),
          ("drapes", "Quasi-static drapes"))
MEANING = ("Stretch is edge length over rest length; p99 and max are of the worst frame. A frame is torn where an edge "
           "is four times its length: a limb went through the cloth. Folded edges are the share at which the cloth is "
           "bent by more than 120 degrees. Against the hips is the mean distance of the cloth from its mean shape in "
           "the hips' frame. The floor is the mean distance between two simulations of the clip that differ by 0.05 % "
           "of the garment's radius: no network can be expected to do better.")


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


def summary(rows):
    """One row a group: how much there is, the worst of everything and the mean floor."""
    lines = ["| group | files | frames | stretch p99 | stretch max | torn frames | folded edges | penetration mm "
             "| speed max m/s | against the hips mm, mean | floor mm, mean (clips) | floor mm, worst clip "
             "| against the hips / floor |", "|---" * 13 + "|"]
    for group, title in GROUPS:
        own = [row for row in rows if row["group"] == group]
        if not own:
            continue
        worst = [max((row[key] for row in own if row[key] is not None), default=None) for key in (
            "stretch_p99", "stretch_max", "torn_share", "folded_max", "penetration_max_mm", "speed_max")]
        moving = [row["alive_mm"] for row in own if row["alive_mm"] is not None]
        floors = [row for row in own if row.get("floor_mean_mm") is not None]
        cells = ["", "", ""]
        if floors:
            mean = np.mean([row["floor_mean_mm"] for row in floors])
            highest = max(floors, key=lambda row: row["floor_mean_mm"])
            alive = np.mean([row["alive_mm"] or 0.0 for row in floors])
            cells = [f"{mean:.2f} ({len(floors)})",
                     f"{highest['floor_mean_mm']:g} {highest['clip']}", f"{alive / max(mean, 1e-9):.0f}"]
        frames, torn = sum(row["frames"] for row in own), [row["torn_share"] * row["frames"] for row in own]
        worst[2] = f"{sum(torn) / frames:.2%} ({np.count_nonzero(torn)} files)"
        lines.append(f"| {title} | {len(own)} | {frames} | "
                     + " | ".join("" if w is None else w if isinstance(w, str) else f"{w:g}" for w in worst)
                     + " | " + " | ".join([f"{np.mean(moving):.1f}" if moving else "", *cells]) + " |")
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
           MEANING, "", *summary(rows), "", "Pictures of every clip: `index.html`.", ""]
    out += ["## Where to look first", "",
            "The clips with the most stretched edge; p99 says whether it is one edge or the cloth. "
            "Faults would stand here too.", "",
            *table(sorted(rows, key=lambda row: (not row["fault"], -row["stretch_max"]))[:10]), ""]
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
