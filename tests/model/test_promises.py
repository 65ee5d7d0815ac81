"""What the project promises of every bundled garment: the price of each precision, and stages that earn their time."""
import json

import pytest

from conftest import dcloth


@pytest.fixture(scope="module")
def variants(garment):
    report = json.loads(dcloth("evaluate", garment.bundle, *garment.sequences, "--json"))
    for variant in report["variants"]:
        print(variant["name"], variant["stages"], json.dumps({k: variant[k] for k in ("tick_ms", "truth", "fp32") if k in variant}))
    return {variant["name"]: variant for variant in report["variants"]}


def test_half_floats_cost_nothing_that_shows(variants):
    assert variants["fp16"]["fp32"]["position_mm"]["mean"] <= 0.05


def test_int8_stays_within_its_bound(variants):
    error = variants["int8"]["fp32"]["position_mm"]
    assert error["mean"] <= 0.3
    assert error["p99"] <= 1.5


def test_int8_is_small(variants):
    assert variants["int8"]["model_bytes"] <= 0.30 * variants["fp32"]["model_bytes"]


def test_a_tick_fits_a_frame(variants):
    assert variants["int8"]["tick_ms"]["p50"] <= 5.0


def test_every_stage_lowers_the_error_on_unseen_motion(variants):
    errors = [variants[name]["truth"]["position_mm"]["mean"] for name in ("skinning", "int8/static", "int8/skeleton", "int8")]
    assert errors == sorted(errors, reverse=True), errors
