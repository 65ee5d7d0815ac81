"""The bench of peers, as far as it runs without them: what it compares is right, and what is wrong is left out."""
import json
import sys

import numpy as np
import pytest

from conftest import ROOT
from dcloth_training import synthetic

sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "bench/peers")]
from peers import contestants, measure, page, verdicts  # noqa: E402
from peers.case import Case  # noqa: E402
from peers.torch_peer import TorchPeer  # noqa: E402

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


def row(precision, engine, network, frame):
    timed = {part: {q: ms for q in ("p50", "p95", "p99", "least")} for part, ms in
             {"network": network, "frame": frame, "static": 0.1, "skeleton": 1.0, "mesh": network - 2,
              "displacement": 0.9, "skinning": 0.2}.items()} | {"ticks": 9}
    return {"version": "1", "precision": precision, "note": "", "engine": engine, "weight_bytes": 10 ** 8, "tried": (),
            "instance_bytes": None, "error_mm": {"mean": 0.0, "max": 0.0}, "warm": timed, "cold": timed}


def test_the_page_names_goals_losses_and_a_busy_machine():
    rows = {"dcloth fp32": row("fp32", True, 8.0, 8.5), contestants.BASELINE: row("fp32", False, 28.0, 29.0),
            "Faster fp32": row("fp32", False, 7.0, 7.1)}
    results = {
        "date": "d", "seconds": 1.0, "limits": {"read_gbps": 20.0, "fma_gmacs": {"256": 50.0}}, "rows": rows,
        "preset": "p",
        "machine": {"cpu": "c", "core": 1, "cores": 2, "system": "s", "compiler": "g", "python": "3", "isa": "avx2",
                    "evicted_bytes": 1}, "others_used_cores": 1.9, "frames": 6, "displacement_mm": 40.0,
        "garment": {"n": 1, "parameters": 10 ** 7}, "multiply_adds": {"layers": 1.0},
        "absent": {"Other": "not installed"},
        "floor_ms": {"fp32": {"skeleton": 1.0, "mesh": 4.0, "displacement": 0.8, "static": 0.1}}}
    text = page.markdown(json.loads(json.dumps(results)))
    assert "not quiet: others used 1.9" in text
    # 28 ms over the floor of 1 + 4 + 0.8 + 0.1.
    assert "| dcloth fp32 to ONNX Runtime fp32 | 2.8x | 3.29x | 3.29x | 4.75x | met |" in text
    assert "| dcloth int8 to ONNX Runtime int8 | 2.5x | – | – | – | not measured |" in text
    assert "Fastest fp32 peer, cold: Faster fp32, 7.00 ms; dcloth fp32 is 0.88x as fast." in text
    assert "- network, cold: Faster fp32 7.000 ms, dcloth fp32 8.000 ms" in text
    assert "- Other: not installed" in text
    assert "A trained garment" not in text
    error = {"mean": 0.09, "max": 0.57, "simulation_mean": 1.204}
    results["trained"] = {
        "bundle": "b", "sequence": "s", "frames": 7, "garment": {"n": 2, "parameters": 10 ** 7}, "rows": {
            "dcloth int8": row("int8", True, 0.8, 1.0) | {"error_mm": error, "basis_rows": 12},
            "dcloth int8, two stages": row("int8", True, 0.9, 1.25) | {"basis_rows": 9},
            contestants.BASELINE: row("fp32", False, 10.0, 10.5) | {"basis_rows": 60}}}
    section = page.markdown(json.loads(json.dumps(results))).split("## A trained garment")[1].split("## Losses")[0]
    # dcloth's whole frame against the peer's network; both errors in the row.
    assert ("| dcloth int8 | 12 | 100.0 | 0.0900 | 0.5700 | 1.20 | 1.00 / 1.00 / 1.00 | 1.00 / 1.00 / 1.00 | 10.00x | 10.00x |"
            in section)
    assert "| ONNX Runtime fp32 | 60 | 100.0 | 0.0000 | 0.0000 | – | 10.00 / 10.00 / 10.00 |" in section
    assert "| dcloth int8, two stages to ONNX Runtime fp32 | 9x | 8.00x | 8.00x | – | missed |" in section
    assert "| dcloth int8 to ONNX Runtime fp32 | 6x | 10.00x | 10.00x | – | met |" in section


def test_a_goal_beyond_what_the_core_can_read_is_named():
    results = {"limits": {"read_gbps": 20.0}, "floor_ms": {"fp32": {"displacement": 12.0}, "int8": {"displacement": 5.0}},
               "rows": {"dcloth fp32": row("fp32", True, 14.0, 14.0), "dcloth int8": row("int8", True, 5.5, 6.0),
                        "dcloth int8, exact rank": row("int8", True, 3.5, 4.0),
                        contestants.BASELINE: row("fp32", False, 28.0, 29.0)}}
    results["rows"]["dcloth int8, exact rank"]["weight_bytes"] = 6 * 10 ** 7    # 40 MB less: 2 ms less
    table = {line[0]: line[1:] for line in verdicts.goals(results)}
    assert table["dcloth fp32 to ONNX Runtime fp32"] == ["2.8x", "2.00x", "2.00x", "2.33x", "missed, beyond the limit"]
    assert table["dcloth int8 to ONNX Runtime fp32"] == ["6x", "4.67x", "4.67x", "5.60x", "missed, beyond the limit"]
    assert table["dcloth int8, exact rank to ONNX Runtime fp32"] == ["9x", "7.00x", "7.00x", "9.33x", "missed"]
