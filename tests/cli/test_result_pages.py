"""bench/pages, bench/results, bench/scaling: what their pages say of figures that were measured, on figures made up here."""
import copy
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "bench"))
from pages import chart, machine, steps  # noqa: E402
from results import goals, page as results_page, pareto  # noqa: E402
from scaling import bends, page as scaling_page  # noqa: E402

CACHES = [["L1", 32 << 10], ["L2", 1 << 20], ["L3", 32 << 20]]
QUIET = {"seconds": 9.0, "others_used_cores": 0.01, "steps": [["a", 5.0, 0.0], ["b", 4.0, 0.02]]}


def times(p50):
    return {"p50": p50, "p95": 1.1 * p50, "p99": 1.2 * p50, "max": 2 * p50}


def row(value, kernels_ms, frame_bytes=10e6, read_gbs=30):
    """One point of a scaling axis; cold takes twice as long."""
    made = {heat: {"frame_ms": times(factor * sum(kernels_ms.values())), "frames": 48, "read_gbs": read_gbs, "memory_gbs": 15,
                   "kernels_ms": {name: factor * ms for name, ms in kernels_ms.items()}}
            for heat, factor in (("warm", 1), ("cold", 2))}
    kernels = {name: {"flops": 1e6, "bytes": 1e6, "bound": "arithmetic" if name == "mesh layers" else "memory"}
               for name in kernels_ms}
    return {"value": value, **made, "kernels": kernels, "frame_bytes": frame_bytes, "model_bytes": frame_bytes / 2,
            "instance_bytes": frame_bytes / 4, "error_mm": {"mean": 0.1, "max": 0.5}}


def straight():
    return [row(v, {"mesh layers": v * 1e-4, "basis": v * 5e-5}, v * 1000.0) for v in (500, 1000, 2000, 4000)]


def test_a_straight_line_has_no_bend_and_no_fixed_cost():
    rows = straight()
    assert bends.exponents(rows, bends.p50) == pytest.approx([1, 1, 1])
    assert bends.bend_sentences(rows, CACHES) == [] and bends.fixed_sentence(rows) is None
    said = bends.reasons("vertices", rows, CACHES)
    assert said[0].startswith("From 500 to 4,000 (8 times) a warm frame grows 8.0 times") and "exponent 1.00" in said[0]
    # Cold adds 0.6 ms to 0.6; 4 MB take 0.267 ms from memory and 0.133 from where they were.
    assert "0.60 ms at 4,000 (its bytes alone: 0.13)" in said[-1]


def test_a_cache_is_outgrown_where_the_bytes_reach_its_size():
    rows = straight()    # 0.5, 1, 2, 4 MB
    (name, limit, at, beyond), = bends.crossings(rows, CACHES)
    assert (name, limit, beyond["value"]) == ("L2", 1 << 20, 2000) and at == pytest.approx(1048.576)
    assert "**L2** (1 MiB) is outgrown near 1,049" in bends.cache_sentences(rows, CACHES)[0]
    inside = [row(r["value"], r["warm"]["kernels_ms"], 2e6 + r["value"]) for r in rows]
    assert "past L2 and within L3" in bends.cache_sentences(inside, CACHES)[0]
    beyond_all = [row(r["value"], r["warm"]["kernels_ms"], 1e9) for r in rows]
    assert "stay past L3" in bends.cache_sentences(beyond_all, CACHES)[0]


def test_fixed_cost_is_told_with_where_it_is_overtaken():
    rows = [row(v, {"mesh layers": 0.5, "basis": v * 1e-3}) for v in (16, 64, 256, 1024)]
    said = bends.fixed_sentence(rows)
    assert "mesh layers" in said and "97% of the smallest frame and 33% of the largest" in said
    assert "near 500" in said, "basis is as long as the rest at 500 rows"


def test_a_bend_names_its_place_and_its_kernel():
    rows = [row(v, {"mesh layers": 0.01 * v * max(1, v / 16), "basis": 0.02 * v}) for v in (4, 8, 16, 32, 64)]
    said, = bends.bend_sentences(rows, CACHES)
    assert said.startswith("Bend at **16**, upward: exponent 1.00 before, 1.42 after.") and "mesh layers" in said
    # 1e6 operations in 0.08, 0.16 and 0.64 ms.
    assert "(12, 6, 2 GFLOP/s at 8, 16, 32)" in said and "outgrown" not in said
    for r, size in zip(rows, (1e5, 2e5, 9e5, 2e6, 4e6)):
        r["frame_bytes"] = size
    assert "where L2 is outgrown" in bends.bend_sentences(rows, CACHES)[0]


def test_a_bend_that_no_kernel_shows_is_not_pinned_on_one():
    rows = straight()
    rows[2]["warm"]["frame_ms"] = times(2 * bends.p50(rows[2]))    # interrupted
    said = bends.bend_sentences(rows, CACHES)
    assert len(said) == 2 and all("frames were interrupted" in sentence for sentence in said)


def test_kernels_that_bend_a_curve_together_are_all_named():
    rows = [row(v, {name: 0.01 * v * max(1, v / 16) for name in ("basis", "mesh hidden", "skinning")}) for v in (8, 16, 32)]
    said, = bends.bend_sentences(rows, CACHES)
    assert sum(name in said for name in ("basis", "mesh hidden", "skinning")) == 2, "two thirds are more than half"


def characters(each):
    return {"model_bytes": 500_000, "instance_bytes": 100_000, "error_mm": {"mean": 0.1, "max": 0.5},
            "rows": [{"characters": count, "ticks": 9, "ms": times(ms)} for count, ms in each.items()]}


def test_characters_outgrow_a_cache_together():
    said = bends.character_reasons(characters({1: 1.0, 2: 1.0, 4: 1.1, 8: 1.65}), CACHES)
    assert "0.6 to 1.3 MB" in said[0] and "(+65%)" in said[0]
    assert "**L2** (1 MiB)" in said[1] and "1.65 at 8 (+50%)" in said[1]
    assert "No cache is outgrown" in bends.character_reasons(characters({1: 1.0, 2: 1.0}), CACHES)[1]


def kernel(name, p50, size=1e6, int8=False):
    return {"name": name, "stage": "mesh", "flops": 2e6, "bytes": size, "int8": int8, "bound": "memory", "ms": times(p50),
            "fraction_of_limit": 0.5}


def profile(frame, draw, kernels):
    stages = {"skinning": times(draw / 2), "normals": times(draw / 2)}
    return {"frame_ms": times(frame), "tick_ms": times(frame - draw), "stages_ms": stages, "frames": 149, "model_bytes": 6e6,
            "instance_bytes": 1_800_000, "truth": {"position_mm": {"mean": 1.2, "std": 0.5, "p99": 5.0}}, "projection": None,
            "machine": {"gflops": 100.0, "unit": "AVX2 FMA", "read_gbs": 20.0, "memory_gbs": 10.0}, "kernels": kernels}


def variant(name, precision, stages, p50, mm, by=None):
    position = {"mean": mm, "std": 0.1, "p99": 3 * mm, "max": 9 * mm}
    timed = precision is not None
    spent = times(p50) if timed else None
    return {"name": name, "precision": precision, "stages": stages, "rank": 144 if timed else None, "tick_ms": spent,
            "tick_warm_ms": spent, "model_bytes": 6e6 if timed else None, "tick_count": {"cold": 60, "warm": 150},
            "truth": {"position_mm": position}, "fp32": {"position_mm": position},
            "dominated": by is not None if timed else None, "dominated_by": by}


def results(used=0.01, frame=0.9):
    kernels = [kernel("basis", 0.1), kernel("mesh hidden", 0.2), kernel("mesh layers", 0.5)]
    variants = [variant("skinning", None, "none", None, 66.0),
                variant("fp32", "fp32", "mesh", 2.4, 1.2, "int8@72/skeleton"),
                variant("int8", "int8", "mesh", 1.2, 1.2, "int8@72/skeleton"),
                variant("int8@72/skeleton", "int8", "skeleton", 0.4, 1.2), variant("int8/static", "int8", "static", 0.2, 5.2)]
    garment = {"products": 20_000_000, "motion": "walk", "calibration": "run", "open_ms": {"warm": 0.02, "cold": 0.05},
               "profiles": {"int8": {"warm": profile(frame, 0.1, kernels), "cold": profile(frame, 0.1, kernels)}},
               "evaluate": {"vertices": 7952, "tick_rate": 30.0, "pareto": {"front": ["int8@72/skeleton"], "step_mm": 0.01},
                            "variants": variants}}
    rows = straight()
    return {"date": "d", "version": "0", "quick": False, "caches": CACHES, "library_bytes": 370_000,
            "garments": {"skirt": garment}, "machine": {"cpu": "c", "core": 1, "cores": 2, "system": "s", "compiler": "g",
                                                        "python": "3", "isa": "avx2", "evicted_bytes": 1},
            "limits": {"read_gbps": 10.0, "fma_gmacs": {"256": 50.0, "512": 100.0}}, "run": {**QUIET, "others_used_cores": used},
            "scaling": {"precision": "int8", "error_frames": 10, "size": {"vertices": 8000},
                        "run": {**QUIET, "others_used_cores": used}, "axes": {"vertices": rows},
                        "characters": characters({1: 1.0, 2: 1.1})}}


def test_goals_are_met_and_missed_by_their_figures():
    made = {line["what"]: line for line in goals.goals(results(frame=1.01))}
    assert not made["skirt, int8: tick with skinning and normals, cold p50"]["met"]
    assert all(line["met"] for what, line in made.items() if "tick with" not in what) and len(made) == 7
    assert all(line["met"] for line in goals.goals(results()))


def test_kernels_are_held_against_what_the_core_can_do():
    found = {(r["group"], r["heat"]): r["reached"] for r in goals.kernel_groups(results())}
    # 1 MB in 0.1 ms is 10 GB/s, of 20 warm and 10 cold; 20 M multiply-adds at 100 G a second take 0.2 ms of 0.5.
    assert found["basis sum", "warm"] == pytest.approx(0.5) and found["basis sum", "cold"] == pytest.approx(1)
    assert found["vertex MLP", "cold"] == pytest.approx(0.5) and found["graph layers", "warm"] == pytest.approx(0.4)
    twice = results()
    for profiles in twice["garments"]["skirt"]["profiles"]["int8"].values():
        profiles["kernels"][2]["int8"] = True
    layers = [r["reached"] for r in goals.kernel_groups(twice) if r["group"] == "graph layers"]
    assert layers == pytest.approx([0.2, 0.2])


def test_losses_are_listed():
    said = goals.losses(results(frame=1.01))
    assert said[0] == "Missed: skirt, int8: tick with skinning and normals, cold p50: 1.01 ms, asked for 1."
    assert "basis sum below 80% of the bytes that the core can do in 1 of 2: skirt int8 warm 50%." in said
    assert ("graph layers below 60% of the multiply-adds that the core can do in 2 of 2: skirt int8 warm 40%, "
            "skirt int8 cold 40%.") in said
    assert "skirt int8 with all stages (1.20 ms, 1.20 mm) is dominated by int8@72/skeleton (0.40 ms, 1.20 mm)." in said


def test_a_busy_machine_is_no_result():
    quiet, busy = results(), results(used=0.9)
    for write in (results_page, scaling_page):
        assert "not quiet" not in write.markdown(quiet) and "Others used 0.01 of 2 cores" in write.markdown(quiet)
        assert "**The machine was not quiet: others used 0.9" in write.markdown(busy)
        assert not any("not quiet" in text for text in write.pictures(quiet).values())
        assert all("not quiet" in text for text in write.pictures(busy).values())
    assert "| met |" in results_page.goals_table(quiet)
    assert results_page.goals_table(busy).count("unproven") == 5, "what was timed; sizes stay what they are"
    assert "quick run" in results_page.markdown({**quiet, "quick": True}) and "quick run" not in results_page.markdown(quiet)
    hidden = copy.deepcopy(QUIET)
    hidden["steps"][0][2] = 0.5
    assert "in: a (0.5)" in steps.text(hidden, 2) and "in:" not in steps.text(QUIET, 2)
    assert machine.quiet(0.1) and not machine.quiet(0.11)


def test_every_time_stands_beside_an_error():
    text = results_page.markdown(results()) + scaling_page.markdown(results())
    for header in re.findall(r"^\|.*p50.*p95.*\|$", text, re.M):
        assert "mm" in header or "to fp32" in header, header


def test_pictures_are_whole_and_inside():
    made = {**results_page.pictures(results()), **scaling_page.pictures(results())}
    assert len(made) == 3
    for name, text in made.items():
        root = ElementTree.fromstring(text)
        width, height = float(root.get("width")), float(root.get("height"))
        for mark in root.iter():
            x, y = mark.get("x") or mark.get("cx"), mark.get("y") or mark.get("cy")
            assert x is None or 0 <= float(x) <= width and 0 <= float(y) <= height, (name, mark.attrib)
        assert "prefers-color-scheme:dark" in text and "nan" not in text
    marks = re.findall(r'<path class="l[abc] [fh]', pareto.picture("skirt", results()["garments"]["skirt"]["evaluate"], True))
    assert len(marks) == 4 + 2, "four timed variants, and two precisions in the key"


def test_axis_labels_cover_what_is_shown():
    for low, high in ((0.6, 2.4), (0.05, 20), (1000, 64000), (1e-3, 1e3)):
        found = chart.ticks(low, high)
        assert 2 <= len(found) <= 12 and found == sorted(found), (low, high, found)
        assert low * 0.99 <= found[0] <= found[-1] <= high * 1.01, (low, high, found)
    assert [chart.number(v) for v in (64082, 1512, 0.05)] == ["64k", "1.5k", "0.05"]


def test_names_of_lines_that_end_together_stay_apart():
    panel = chart.Panel((0, 0, 400, 400), [1, 10], [1, 100])
    named = panel.names({("upper", "a"): (10, 51), ("middle", "b"): (10, 50.5), ("lower", "c"): (10, 50), ("far", "d"): (10, 1)})
    places = {re.search(r">(\w+)<", text)[1]: float(re.search(r' y="([\d.]+)"', text)[1]) for text in named}
    apart = [places[b] - places[a] for a, b in (("upper", "middle"), ("middle", "lower"), ("lower", "far"))]
    assert min(apart) >= 15
    for name, value in (("far", 1), ("lower", 50)):
        assert places[name] == pytest.approx(panel.y(value) + 4, abs=0.1), "moved without need"
