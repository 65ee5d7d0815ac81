"""profile: JSON, budget, trace."""
import json

from checks import STEPS, mesh_error, percentiles


def profile(dcloth, *arguments, code=0):
    result = dcloth("profile", *arguments, "--json")
    assert result.returncode == code, result.stderr
    return json.loads(result.stdout)


def test_json(dcloth, files):
    said = profile(dcloth, files.model, files.walk)
    for key in ("frame_ms", "tick_ms"):
        percentiles(said[key])
    assert set(said["stages_ms"]) == STEPS
    for step, value in said["stages_ms"].items():
        percentiles(value, positive=step != "penetration")  # not asked for
    assert said["cpu"] and said["isa"] and said["frames"] >= 600
    assert said["budget_ms"] is None and said["missed_frames"] is None
    assert said["model_bytes"] == files.model.stat().st_size and said["instance_bytes"] > 0
    mesh_error(said["truth"])
    assert said["frame_ms"]["max"] >= said["tick_ms"]["max"]


def test_a_sequence_without_truth_has_no_error(dcloth, files):
    assert profile(dcloth, files.model, files.bare)["truth"] is None


def test_budget_missed_and_kept(dcloth, files):
    missed = profile(dcloth, files.model, files.walk, "--budget-ms", "0.000001", code=1)
    assert missed["missed_frames"] == missed["frames"] and missed["budget_ms"] == 0.000001
    kept = profile(dcloth, files.model, files.walk, "--budget-ms", "60000")
    assert kept["missed_frames"] == 0


def test_cold_and_contended(dcloth, files):
    cold = profile(dcloth, files.model, files.bare, "--cold")
    warm = profile(dcloth, files.model, files.bare)
    assert cold["cold"] and not warm["cold"]
    # Every line of model and instance comes from memory instead of cache; the median cannot be the same.
    assert cold["frame_ms"]["p50"] > warm["frame_ms"]["p50"]


def test_pipelined(dcloth, files):
    whole = profile(dcloth, files.model, files.walk)
    spread = profile(dcloth, files.model, files.walk, "--pipelined")
    assert spread["pipelined"] and not whole["pipelined"]
    # At 60 Hz every other frame has a tick; spread, every frame has about half of one.
    assert spread["tick_ms"]["p50"] < whole["tick_ms"]["p50"]
    mesh_error(spread["truth"])


def test_trace(dcloth, files, tmp_path):
    path = tmp_path / "trace.json"
    said = profile(dcloth, files.model, files.walk, "--trace", path)
    events = json.loads(path.read_text())["traceEvents"]
    names = {e["name"] for e in events}
    assert STEPS - {"penetration"} | {"frame", "tick", "skin"} == names
    frames = [e for e in events if e["name"] == "frame"]
    assert len(frames) == said["frames"]
    assert all(e["ph"] == "X" and e["dur"] >= 0 and e["ts"] >= 0 for e in events)
    # Steps are parts of their call: together no longer than the frame.
    for index in (0, len(frames) // 2):
        steps = sum(e["dur"] for e in events if e["name"] in STEPS and e["args"]["frame"] == index)
        assert 0 < steps <= frames[index]["dur"]


def test_text(dcloth, files):
    result = dcloth("profile", files.model, files.walk, "--budget-ms", "60000")
    for word in ("p99", "skeleton", "error to the simulation", "frames missed", "MB"):
        assert word in result.stdout
