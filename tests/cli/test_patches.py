"""A garment with a patch stage, through the commands that read its bundle or its model."""
import json

import pytest

import small_garment

PRECISIONS = ("fp32", "fp16", "int8")
OTHER_STAGES = ("skeleton.", "mesh.", "nearest.")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    path = tmp_path_factory.mktemp("patches") / "patches.safetensors"
    small_garment.write_bundle(path, drop=OTHER_STAGES, changes=small_garment.patch_tensors())
    return path


def run(dcloth, *arguments):
    result = dcloth(*arguments, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_every_precision_is_stored_and_measured(dcloth, files, bundle):
    sizes = []
    for precision in PRECISIONS:
        model = bundle.with_suffix(f".{precision}.dcloth")
        report = run(dcloth, "convert", bundle, "-o", model, "--precision", precision, "--motion", files.walk)
        stored = {t["name"]: t for t in report["tensors"]}
        layers = [n for n in stored if n.startswith("patch_stage.") and n.endswith(".weights")]
        assert len(layers) == 7
        dtype = {"fp32": "f32", "fp16": "f16", "int8": "i8"}[precision]
        # What reads and what moves the cloth stays in halves.
        first_and_last = {"patch_stage.enter.weights", "patch_stage.out.weights"}
        assert {n: stored[n]["dtype"] for n in layers} == {
            n: "f16" if dtype == "i8" and n in first_and_last else dtype for n in layers}
        assert not any(n.endswith("row_scales") for n in stored if n.startswith("patch_stage."))
        costs = [stored[n].get("cost_mm") for n in layers]
        assert all(c is None for c in costs) if precision == "fp32" else all(c["max"] > 0 for c in costs)
        seen = run(dcloth, "inspect", model)
        assert seen["format"] == "1.8" and seen["stages"] == ["static", "skeleton", "mesh"]
        found = seen["patches"]
        assert [found[key] for key in ("patches", "points", "width", "sources")] == [4, 3, 16, 4]
        assert 0 < found["weight_bytes"] < seen["model_bytes"] and seen["tick_multiply_adds"] > 4 * 16 * (16 + 6 * 16)
        text = dcloth("inspect", model).stdout
        assert "patches    4 of 3 points, 16 features; a vertex follows 4 points" in text
        sizes.append(seen["model_bytes"])
    assert sizes == sorted(set(sizes), reverse=True)


def test_formats_are_chosen_for_a_bound(dcloth, files, bundle):
    model = bundle.with_suffix(".auto.dcloth")
    report = run(dcloth, "convert", bundle, "-o", model, "--precision", "auto", "--max-error-mm", 2, "--motion",
                 files.walk)
    assert report["trials"][-1]["error"]["position_mm"]["max"] <= 2


# The stages' levels are one: it is measured once, and no basis is there to reduce.
def test_the_grid_has_what_differs(dcloth, files, bundle):
    table = run(dcloth, "evaluate", bundle, files.run, "--pareto", "--rank", 4, "--calibrate", files.walk)
    names = {v["name"] for v in table["variants"]} - {"rigid", "skinning", "int8/outside"}
    assert names == {*PRECISIONS, *(f"{p}/static" for p in PRECISIONS)}


def test_both_moving_levels_draw_the_same(dcloth, files, bundle, tmp_path):
    model = tmp_path / "m.dcloth"
    run(dcloth, "convert", bundle, "-o", model)
    drawn = {}
    for stages in ("static", "skeleton", "mesh"):
        drawn[stages] = tmp_path / f"{stages}.safetensors"
        result = dcloth("run", model, files.bare, "-o", drawn[stages], "--stages", stages)
        assert result.returncode == 0, result.stderr
    static, skeleton, mesh = (drawn[s].read_bytes() for s in ("static", "skeleton", "mesh"))
    assert skeleton == mesh and static != mesh
