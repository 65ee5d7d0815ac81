"""evaluate --pareto: precision x rank x stages in one table, with what others dominate marked."""
import json
import re
import subprocess

import pytest

import small_garment
from checks import leftovers, percentiles, refused
from test_report import CHROMIUM, page_parts

FULL = small_garment.K_SKELETON + small_garment.K_MESH
PRECISIONS = ("fp32", "fp16", "int8")


@pytest.fixture(scope="module")
def grid(dcloth, files):
    page = files.folder / "pareto.html"
    result = dcloth("evaluate", files.bundle, files.run, "--pareto", "--rank", 7, "--rank", 16, "--rank", 8, "--rank",
                    1000, "--calibrate", files.walk, "--json", "--html", page)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout), page


def dominated(rows, mm):
    """The definition, by brute force over all pairs."""
    step = 0.01
    key = {name: (row["tick_ms"]["p50"], round(mm(row) / step)) for name, row in rows.items()}
    return {a: {b for b in key if key[b][0] <= key[a][0] and key[b][1] <= key[a][1] and key[b] != key[a]} for a in key}


def test_every_combination_is_measured_once(grid):
    rows = {v["name"]: v for v in grid[0]["variants"]}
    assert len(rows) == len(grid[0]["variants"])
    # What evaluate always measures comes first, in its order.
    assert list(rows)[:7] == ["rigid", "skinning", "int8/static", "int8/skeleton", "fp32", "fp16", "int8"]
    wanted = {"rigid", "skinning", "int8/outside"}
    for p in PRECISIONS:
        # Ranks are even; one that is no smaller than the basis is the basis.
        wanted |= {p, f"{p}/static", f"{p}/skeleton"} | {f"{p}@{r}{s}" for r in (8, 16) for s in ("", "/skeleton")}
    assert set(rows) == wanted
    for name, row in rows.items():
        if name in ("rigid", "skinning"):
            assert row["rank"] is None and row["precision"] is None and row["dominated"] is None
            continue
        percentiles(row["tick_ms"])
        assert row["precision"] == name.split("@")[0].split("/")[0]
        asked = int(name.split("@")[1].split("/")[0]) if "@" in name else None
        stages = row["stages"]
        full = {"static": None, "skeleton": small_garment.K_SKELETON, "mesh": FULL}[stages]
        assert row["rank"] == (asked or full), name


def test_fewer_rows_are_smaller_and_further_from_fp32(grid):
    rows = {v["name"]: v for v in grid[0]["variants"]}
    for p in PRECISIONS:
        sizes = [rows[n]["model_bytes"] for n in (f"{p}@8", f"{p}@16", p)]
        errors = [rows[n]["fp32"]["position_mm"]["mean"] for n in (f"{p}@8", f"{p}@16", p)]
        assert sizes == sorted(set(sizes)) and errors == sorted(errors, reverse=True)
        assert rows[f"{p}@8/skeleton"]["model_bytes"] == rows[f"{p}@8"]["model_bytes"]


def test_a_rank_is_what_convert_makes_of_it(dcloth, files, grid, tmp_path):
    rows = {v["name"]: v for v in grid[0]["variants"]}
    out = tmp_path / "m.dcloth"
    said = dcloth("convert", files.bundle, "-o", out, "--precision", "int8", "--rank", 8, "--calibrate", files.walk,
                  "--motion", files.run, "--json")
    assert said.returncode == 0, said.stderr
    trial, = json.loads(said.stdout)["trials"]
    assert rows["int8@8"]["model_bytes"] == out.stat().st_size
    assert rows["int8@8"]["fp32"]["position_mm"] == trial["error"]["position_mm"]


def test_dominated_is_what_the_figures_say(grid):
    rows = {v["name"]: v for v in grid[0]["variants"] if v["name"] not in ("rigid", "skinning", "int8/outside")}
    assert grid[0]["pareto"]["mm"] == "truth.position_mm.mean" and grid[0]["pareto"]["step_mm"] == 0.01
    by = dominated(rows, lambda r: r["truth"]["position_mm"]["mean"])
    for name, row in rows.items():
        assert row["dominated"] == bool(by[name]), name
        assert (row["dominated_by"] in by[name]) if by[name] else row["dominated_by"] is None
    front = [n for n in rows if not by[n]]
    assert grid[0]["pareto"]["front"] == sorted(front, key=lambda n: rows[n]["tick_ms"]["p50"])
    outside = [v for v in grid[0]["variants"] if v["name"] == "int8/outside"]
    assert outside[0]["dominated"] is None and outside[0]["dominated_by"] is None


def test_without_truth_the_difference_to_fp32_counts(dcloth, files):
    said = json.loads(dcloth("evaluate", files.bundle, files.bare, "--precision", "int8", "--json").stdout)
    assert said["pareto"]["mm"] == "fp32.position_mm.mean"
    rows = {v["name"]: v for v in said["variants"] if v["name"] not in ("rigid", "skinning", "int8/outside")}
    by = dominated(rows, lambda r: r["fp32"]["position_mm"]["mean"])
    assert all(row["dominated"] == bool(by[name]) for name, row in rows.items())


def test_ranks_unasked_are_halves_of_the_basis(dcloth, files):
    said = json.loads(dcloth("evaluate", files.bundle, files.bare, "--precision", "fp16", "--pareto", "--calibrate",
                             files.walk, "--json").stdout)
    ranks = [v["rank"] for v in said["variants"] if "@" in v["name"] and v["stages"] == "mesh"]
    assert ranks == [12, 6, 2]  # of 22, stored in pairs


def test_table_names_the_dominators(dcloth, files):
    result = dcloth("evaluate", files.bundle, files.walk, "--precision", "int8", "--pareto")
    lines = result.stdout.rstrip("\n").split("\n")[1:]
    assert len({len(line) for line in lines}) == 1, "columns are not aligned"
    assert len(lines) == 8 and "dominated" in lines[0] and any(line.endswith("front") for line in lines)


def test_the_report_holds_all_figures_and_few_tracks(grid):
    said, page = grid
    _, data, _ = page_parts(page)
    assert data["variants"] == said["variants"]
    assert [t["name"] for t in data["sequences"][0]["tracks"]] == [
        "truth", "skinning", "static", "skeleton", "fp32", "fp16", "int8", "outside"]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
def test_the_picture_marks_what_is_dominated(grid, tmp_path):
    said, page = grid
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=3000",
               f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", f"file://{page}#play=0"]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=240).stdout
    if 'id="speed-error"' not in dom:
        pytest.skip("the browser drew nothing on this machine")
    chart = dom[dom.index('id="speed-error"'):dom.index('id="stages"')]
    titles = re.findall(r'<path [^>]*fill="([^"]+)"[^>]*class="mark"[^>]*><title>([^<]+)</title>', chart)
    timed = {v["name"]: v for v in said["variants"] if v["tick_ms"]}
    assert len(titles) == len(timed)
    for fill, title in titles:
        variant = timed.pop(title.split(" · ")[0])
        assert (fill == "var(--card)") == (variant["dominated"] is not False), title
        assert ("dominated by " + str(variant["dominated_by"]) in title) == bool(variant["dominated"])
    assert chart.count('class="front"') == 1
    labels = re.findall(r'<text [^>]*class="note"[^>]*>([^<]+)</text>', chart)
    assert set(said["pareto"]["front"]) <= set(labels)


@pytest.mark.parametrize("arguments, words", [
    (("--rank", "8"), ("--pareto",)), (("--pareto", "--rank", "8"), ("--calibrate",)),
    (("--pareto", "--rank", "0"), ("--rank",)), (("--calibrate", "x"), ("--pareto",))])
def test_incomplete_grids_are_refused(dcloth, files, tmp_path, arguments, words):
    result = dcloth("evaluate", files.bundle, files.walk, *arguments, "--html", tmp_path / "x.html")
    refused(result, *words)
    assert leftovers(tmp_path, set()) == []


def test_motion_to_fit_is_no_motion_to_judge(dcloth, files):
    refused(dcloth("evaluate", files.bundle, files.walk, "--pareto", "--calibrate", files.walk), "walk.safetensors",
            "both to calibrate and to evaluate")
