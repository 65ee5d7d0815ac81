"""The bench of peers, as far as it runs without them: what it compares is right, and what is wrong is left out."""
import sys

import numpy as np
import pytest

from conftest import ROOT
from dcloth_training import synthetic

sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "bench/peers")]
from peers import measure
from peers.case import Case
from peers.torch_peer import TorchPeer

FRAMES = 6


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return Case(*synthetic.write(tmp_path_factory.mktemp("peers"), synthetic.PRESETS["small"], FRAMES))


@pytest.fixture(scope="module")
def peer(case, tmp_path_factory):
    return TorchPeer(case, tmp_path_factory.mktemp("graphs"))


def test_folded_weights_compute_the_network(case, peer):
    error = measure.compare(peer, case)
    assert error["max"] < 1e-3 and error["skinned_max"] < 1e-3
    assert measure.refusal(error, "fp32", case.displacement_mm()) is None


@pytest.mark.parametrize("fault", ["a stale state", "weights off by 2 %", "weights off by 20 %", "NaN"])
def test_a_peer_that_computes_something_else_is_refused(case, peer, fault, monkeypatch):
    basis = case.weights.basis
    kept = basis.copy()
    if fault == "a stale state":
        monkeypatch.setattr(TorchPeer, "finish", lambda self, stage, right=TorchPeer.finish: (
            right(self, stage), setattr(self, "_p", self._zero[0]) if stage == "displacement" else None))
    elif fault == "NaN":
        basis[0] = np.nan
    else:
        basis *= 1.02 if fault == "weights off by 2 %" else 1.2
    try:
        error = measure.compare(peer, case)
    finally:
        basis[:] = kept
    assert measure.refusal(error, "fp32", case.displacement_mm()) is not None, error
    if fault != "weights off by 2 %":    # which int8 may be
        assert measure.refusal(error, "int8", case.displacement_mm()) is not None, error


def test_turns_reset_at_the_end_of_the_sequence(case, peer):
    timed = measure.interleaved({"a": peer, "b": peer}, FRAMES, None, 4, 60, lambda *_: None)
    assert timed["a"]["ticks"] == 4
    assert 0 < timed["a"]["network"]["p50"] <= timed["a"]["network"]["p99"]
