"""The command line of another platform against this one's, on the bundled garments: the same model bytes, the same
cloth. DCLOTH_NATIVE names this machine's tool, DCLOTH_BIN the other's (scripts/test_platforms.sh)."""
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import safetensors_file

NATIVE = os.environ.get("DCLOTH_NATIVE")
pytestmark = pytest.mark.skipif(NATIVE is None, reason="DCLOTH_NATIVE names no tool to compare with")
MODELS = Path(__file__).resolve().parents[2] / "models"
# Between instruction sets, which need not be the same on both; those of one mode that is, by tests/picture.
ALLOWED_MM = 0.01


def native(*arguments):
    return subprocess.run([NATIVE, *map(str, arguments)], check=True, capture_output=True, text=True)


@pytest.mark.parametrize("garment, precision",
                         [("skirt", "fp32"), ("skirt", "fp16"), ("skirt", "int8"), ("robe", "int8")])
def test_models_are_the_same_bytes_and_play_the_same(dcloth, tmp_path, garment, precision):
    bundle, clip = MODELS / garment / f"{garment}.safetensors", MODELS / garment / "sequences" / "walk_turn.safetensors"
    models, drawn = [tmp_path / "other.dcloth", tmp_path / "native.dcloth"], []
    for call, model in zip((dcloth, native), models):
        said = call("convert", bundle, "-o", model, "--precision", precision)
        assert said.returncode == 0, said.stderr
        out = model.with_suffix(".safetensors")
        said = call("run", models[0], clip, "-o", out)
        assert said.returncode == 0, said.stderr
        drawn.append(safetensors_file.read(out)[0])
    assert models[0].read_bytes() == models[1].read_bytes()
    assert np.array_equal(drawn[0]["faces"], drawn[1]["faces"])
    off = 1000 * np.linalg.norm(drawn[0]["positions"].astype(float) - drawn[1]["positions"], axis=-1)
    print(f"{garment} {precision}: {len(off)} frames, at most {off.max():.6f} mm, mean {off.mean():.7f} mm from native")
    assert off.shape[0] >= 100 and off.max() <= ALLOWED_MM


def test_inspect_says_the_same(dcloth, files):
    assert json.loads(dcloth("inspect", files.model, "--json").stdout) == \
        json.loads(native("inspect", files.model, "--json").stdout)


def test_evaluate_measures_the_same(dcloth, files):
    """All but times; millimetres as far as instruction sets agree."""
    arguments = ("evaluate", files.bundle, files.walk, "--precision", "fp32", "--precision", "int8", "--json")
    other, here = (json.loads(call(*arguments).stdout)["variants"] for call in (dcloth, native))
    assert len(other) == len(here) > 3
    for a, b in zip(other, here):
        for key in ("name", "stages", "model_bytes", "instance_bytes"):
            assert a[key] == b[key]
        for against in ("truth", "fp32"):
            assert a[against]["position_mm"] == pytest.approx(b[against]["position_mm"], abs=ALLOWED_MM)
