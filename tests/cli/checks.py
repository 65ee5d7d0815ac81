"""Checks that several test files share."""
PERCENTILES = {"p50", "p95", "p99", "max"}
STEPS = {"pose", "static", "skeleton", "mesh", "displacement", "skinning", "normals", "penetration"}


def refused(result, *words, code=2):
    """The command failed as promised: exit code, nothing on stdout, and a message that says each of `words`."""
    assert result.returncode == code, (result.returncode, result.stdout, result.stderr)
    assert result.stdout == ""
    for word in words:
        assert str(word) in result.stderr, f"{word!r} not in {result.stderr!r}"


def percentiles(value, positive=True):
    assert set(value) == PERCENTILES
    assert 0 <= value["p50"] <= value["p95"] <= value["p99"] <= value["max"]
    if positive:
        assert value["max"] > 0


def mesh_error(value):
    position, normal = value["position_mm"], value["normal_deg"]
    assert {"mean", "std", "p99", "max"} <= set(position) and {"mean", "std"} <= set(normal)
    assert 0 <= position["mean"] <= position["max"] and position["p99"] <= position["max"]
    assert value["frames"] > 0


def leftovers(folder, before):
    """Files that a failed command must not leave behind, temporary ones included."""
    return sorted(p.name for p in folder.iterdir() if p.name not in before)
