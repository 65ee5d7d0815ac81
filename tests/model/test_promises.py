"""What the project promises of every bundled garment: the price of each precision, and stages that earn their time."""
import json

import pytest

from conftest import dcloth


@pytest.fixture(scope="module")
def variants(garment):
    report = json.loads(dcloth("evaluate", garment.bundle, garment.sequences[0], "--json"))    # the run: the harder
    for variant in report["variants"]:
        figures = {k: variant[k] for k in ("tick_ms", "truth", "fp32") if k in variant}
        print(variant["name"], variant["stages"], json.dumps(figures))
    return {variant["name"]: variant for variant in report["variants"]}


def test_half_floats_cost_nothing_that_shows(variants):
    assert variants["fp16"]["fp32"]["position_mm"]["mean"] <= 0.05


def test_int8_stays_within_its_bound(variants):
    """Of the error to the truth, 0.05 mm; of the way to fp32, shares of all motion, which int8 rounds with the rest.
    Patches read what they have rounded before, so half as much again."""
    more = 1.5 if "int8/skeleton" not in variants else 1
    raised = variants["int8"]["truth"]["position_mm"]["mean"] - variants["fp32"]["truth"]["position_mm"]["mean"]
    assert raised <= 0.05
    error, alive = variants["int8"]["fp32"]["position_mm"], variants["int8"]["truth"]["alive_mm"]
    assert error["mean"] <= more * 0.01 * alive
    assert error["p99"] <= more * 0.05 * alive


def test_int8_is_small(variants):
    """Of weights: half floats tell how much of a model they are; geometry and indices are alike in each precision. A
    model with patches is a fifth geometry, and two of its matrices are halves in int8."""
    patches = "int8/skeleton" not in variants
    size = {name: variants[name]["model_bytes"] for name in ("fp32", "fp16", "int8")}
    weights = 2 * (size["fp32"] - size["fp16"])
    rest = size["fp32"] - weights
    assert 0 < rest < (0.25 if patches else 0.1) * size["fp32"]
    assert size["int8"] - rest <= (0.3 if patches else 0.28) * weights


def test_a_tick_fits_a_frame(variants):
    assert variants["int8"]["tick_ms"]["p50"] <= 5.0


WORTH = 0.01  # of the error before it: what a stage must take off to be worth its time and bytes


def test_every_stage_earns_its_time_or_the_card_says_that_it_does_not(variants, garment):
    """On a bundled sequence, which was not trained on. The card's sentence goes when the stage earns its
    time."""
    card = (garment.bundle.parent / "README.md").read_text()
    before = variants["skinning"]["truth"]["position_mm"]["mean"]
    moving = [("skeleton", "int8/skeleton"), ("mesh", "int8")] if "int8/skeleton" in variants else [("patch", "int8")]
    for stage, name in [("static", "int8/static"), *moving]:
        error = variants[name]["truth"]["position_mm"]["mean"]
        gain = 1 - error / before
        print(f"{garment.name}: the {stage} stage takes {100 * gain:.2f} % off {before:.3f} mm")
        assert gain > -WORTH, f"the {stage} stage raises the error from {before} to {error} mm"
        worthless = f"The {stage} stage is worth nothing on this garment" in card
        assert (gain < WORTH) == worthless, (
            f"the {stage} stage takes {100 * gain:.2f} % off {before:.3f} mm; the card says worth nothing: {worthless}")
        before = error
