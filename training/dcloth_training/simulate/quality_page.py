"""The quality report as one HTML page: every clip's pictures with its figures, sorted and filtered in place."""
import html

from . import quality_text

SORTED_BY = (("order", "listed order", None), ("crossed", "frames crossing the body", "crossed_share"),
             ("body", "pairs of cloth and body", "body_crossings_max"), ("tangled", "tangled frames", "tangled_share"),
             ("cloth", "pairs of cloth", "cloth_crossings_max"), ("penetration", "depth", "penetration_max_mm"),
             ("stretch_max", "stretch, largest", "stretch_max"),
             ("stretch_p99", "stretch, 99th percentile", "stretch_p99"), ("torn", "torn frames", "torn_share"),
             ("folded", "folds", "folded_max"), ("speed", "speed", "speed_max"),
             ("alive", "motion", "alive_mm"), ("fine", "fine motion", "fine_motion_mm"),
             ("floor", "floor", "floor_mean_mm"), ("relative", "floor / motion", "floor_relative"))
FIGURES = (("frames", "frames", "{:d}"), ("crossed_share", "crossing the body", "{:.1%} of frames"),
           ("body_crossings_max", "at most", "{:d} pairs"), ("tangled_share", "tangled", "{:.1%} of frames"),
           ("cloth_crossings_max", "at most", "{:d} pairs"),
           ("penetration_area_share", "area under the body", "{:.3%}"),
           ("penetration_max_mm", "deepest", "{:.1f} mm"), ("strain_p99", "strain p99", "{:.1%}"),
           ("stretch_p99", "stretch p99", "{:.2f}"), ("stretch_max", "max", "{:.2f}"),
           ("torn_share", "torn frames", "{:.0%}"), ("folded_max", "folded edges", "{:.2%}"),
           ("speed_max", "speed", "{:.1f} m/s"), ("alive_mm", "motion", "{:.0f} mm"),
           ("fine_motion_mm", "fine motion", "{:.1f} mm"), ("floor_mean_mm", "floor", "{:.2f} mm"),
           ("floor_relative", "of motion", "{:.1%}"), ("floor_entered_mm", "entered late", "{:.2f} mm"))
# Figures that say a clip is not cloth where they are above 0.
NOT_CLOTH = (("crossed_share", "crosses the body"), ("tangled_share", "tangled"), ("torn_share", "torn"))

STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; }
body { font: 14px/1.45 system-ui, sans-serif; margin: 1.5rem auto; max-width: 1640px; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0 0 .3rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
table { border-collapse: collapse; }
td, th { padding: .15rem .7rem .15rem 0; text-align: left; border-bottom: 1px solid var(--line); }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
nav { position: sticky; top: 0; background: Canvas; padding: .6rem 0; border-bottom: 1px solid var(--line);
  z-index: 1; display: flex; gap: .8rem; flex-wrap: wrap; align-items: center; }
article { margin: 0 0 1.1rem; } article p { margin: 0 0 .2rem; }
article img { display: block; max-width: 100%; height: auto; border-radius: 6px; background: #f5f5f2; }
b { font-weight: 600; } .f { margin-left: 1rem; white-space: nowrap; } .f i { font-style: normal; opacity: .65; }
.mark { background: #c0392b33; }
.fault { color: #c0392b; font-weight: 600; }
.tag { background: var(--soft); border-radius: 4px; white-space: nowrap; padding: 0 .4rem; margin-left: .5rem; }
"""
SCRIPT = """
const all = [...document.querySelectorAll("article")], list = document.getElementById("clips");
const pick = id => document.getElementById(id);
function show() {
  const key = pick("sort").value, group = pick("group").value, words = pick("find").value.toLowerCase();
  const value = a => a.dataset[key] === undefined ? -Infinity : Number(a.dataset[key]);
  all.sort((a, b) => key === "order" ? value(a) - value(b) : value(b) - value(a));
  let shown = 0;
  for (const a of all) {
    a.hidden = (group && a.dataset.group !== group) || !a.dataset.name.toLowerCase().includes(words);
    shown += !a.hidden;
    list.append(a);
  }
  pick("count").textContent = shown + " of " + all.length;
}
for (const id of ["sort", "group", "find"]) pick(id).addEventListener("input", show);
show();
"""


def figure_text(row):
    """The figures of one clip, as HTML."""
    return " ".join(f'<span class="f"><i>{title}</i> {form.format(row[key])}</span>' for key, title, form in FIGURES
                   if row.get(key) is not None)


def article(order, row):
    """One clip: name, figures, strip."""
    known = {"order": order, "group": row["group"], "name": row["clip"],
             **{word: row[key] for word, _, key in SORTED_BY if key and row.get(key) is not None}}
    data = " ".join(f'data-{word}="{html.escape(str(value))}"' for word, value in known.items())
    marks = " ".join(f'<span class="tag mark">{word}</span>' for key, word in NOT_CLOTH if row.get(key))
    fault = f'<span class="f fault">{html.escape(row["fault"])}</span>' if row["fault"] else ""
    strip = (f'<img src="{html.escape(row["picture"])}" loading="lazy" alt="frames of {html.escape(row["clip"])}">'
             if row["picture"] else "")
    return (f'<article {data}><p><b>{html.escape(row["clip"])}</b>'
            f'<span class="tag">{row["group"].replace("_", ", ")}</span> {marks} '
            f'{figure_text(row)} {fault}</p>{strip}</article>')


def markdown_table(lines):
    """A Markdown table's lines as an HTML table; figures stand to the right."""
    cells = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines
             if not line.startswith("|---")]
    head = "".join(f"<th>{html.escape(c)}</th>" for c in cells[0])
    body = "".join("<tr>" + "".join(f"<td{' class=n' if c[:1].isdigit() else ''}>{html.escape(c)}</td>" for c in row)
                   + "</tr>" for row in cells[1:])
    return f"<table><tr>{head}</tr>{body}</table>"


def page(found):
    """The whole page; pictures lie beside it in clips/."""
    rows = found["clips"]
    groups = [(key, title) for key, title in quality_text.GROUPS if any(row["group"] == key for row in rows)]
    frames = sum(row["frames"] for row in rows)
    regimes = ", ".join(sorted({row["regime"] or "unknown" for row in rows}))
    refused = [f"| {name} | {why} |" for name, why in found["refused"].items()]
    return "\n".join([
        "<!doctype html>", '<html lang="en"><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Ground truth {html.escape(found['data'])}</title>", f"<style>{STYLE}</style>",
        f"<h1>Ground truth {html.escape(found['data'])}</h1>",
        f"<p>{len(rows)} files, {frames:,} frames, {found['cloth_vertices']:,} cloth vertices, "
        f"{found['cloth_faces']:,} triangles; root motion: {html.escape(regimes)}. {quality_text.MEANING}</p>",
        *(f"<p><b>{html.escape(line)}</b></p>" for line in quality_text.verdict_line(rows)),
        markdown_table(quality_text.summary(rows)),
        "<nav><label>sort by <select id=sort>"
        + "".join(f"<option value={word}>{title}</option>" for word, title, key in SORTED_BY
                  if key is None or any(row.get(key) is not None for row in rows))
        + "</select></label><label>group <select id=group><option value=''>all</option>"
        + "".join(f"<option value={key}>{html.escape(title)}</option>" for key, title in groups)
        + "</select></label><label>name <input id=find type=search></label><span id=count></span></nav>",
        "<main id=clips>", *(article(order, row) for order, row in enumerate(rows)), "</main>",
        *(["<h2>Refused</h2>", markdown_table(["| clip | why |", *refused])] if refused else []),
        f"<script>{SCRIPT}</script>", "</html>"])
