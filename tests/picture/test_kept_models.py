"""A file of every format version that a release wrote opens and draws what it always drew, to the bit.

kept/ holds a small garment as the converter of that version wrote it, poses to play, and the hashes of what the engine
draws with the reproducible kernels. A new version adds a file; none is ever written anew. Hashes change only with
arithmetic that is better for every file: of the push-out (`--body`), and in 0.2.0 of the int8 recurrent product, whose
input is rounded less (0.002 mm on average, 0.04 at most, docs/compatibility.md, "Numbers"). Or with what is played: the
last quarter, since 0.2.0 without the half rate that is gone.
"""
import json
import os
import pathlib
import re
import subprocess

import pytest

KEPT = pathlib.Path(__file__).with_name("kept")
DRAWN = json.loads((KEPT / "kept.json").read_text())


def drawn(model, *how):
    said = subprocess.run([os.environ["DCLOTH_PICTURE"], model, KEPT / "poses.f32", "--isa", "reproducible", *how],
                          capture_output=True, text=True, check=True).stdout
    return re.search(r"hash (\w{16})", said)[1]


def test_every_kept_file_is_listed():
    assert {f"{name}.dcloth" for name in DRAWN} == {path.name for path in KEPT.glob("*.dcloth")}
    assert len({kept["format"] for kept in DRAWN.values()}) == len(DRAWN) >= 3
    assert sum(kept["outside"] != kept["picture"] for kept in DRAWN.values()) >= 3, "cloth that is under the skin"


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_kept_model(name):
    model, kept = KEPT / f"{name}.dcloth", DRAWN[name]
    printed = subprocess.run([os.environ["DCLOTH_BIN"], "inspect", model, "--json"], capture_output=True,
                             check=True).stdout
    said = json.loads(printed)
    assert said["format"] == kept["format"]
    assert drawn(model) == kept["picture"]
    assert drawn(model, "--body") == kept["outside"]
