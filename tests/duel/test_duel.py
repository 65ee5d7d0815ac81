"""The duel (bench/duel): every contestant that needs nothing fetched plays a bundled sequence and is measured."""
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("DCLOTH_BUILD", ROOT / "build"))
sys.path[:0] = [str(ROOT / "training"), str(ROOT / "bench"), str(ROOT / "bench" / "duel")]


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """(folder, figures, page) of a quick run on one sequence."""
    folder = tmp_path_factory.mktemp("duel")
    command = [sys.executable, "-m", "duel", "skirt", "--build", BUILD, "--work", folder, "--page", folder / "page.md",
               "--quick"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[:3])})
    assert done.returncode == 0, done.stderr
    return folder, json.loads((folder / "skirt.json").read_text()), (folder / "page.md").read_text()


def program(folder, *plays, options=()):
    clip = ROOT / "models" / "skirt" / "sequences" / "walk_turn.safetensors"
    command = [BUILD / "dcloth_duel", clip, *options]
    for play in plays:
        command += ["--play", play.format(folder=folder)]
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)


def test_every_method_plays_and_is_measured(played):
    rows = {row["name"]: row for row in played[1]["rows"]}
    assert {row["method"] for row in rows.values()} == {"solver", "springs", "dcloth", "contact"}
    for name, row in rows.items():
        # The truth moves by 30 mm, and a hem hangs half a metre below its pins.
        assert 1 < row["error_mm"] < 100, name
        assert 0 < row["thread_ms"]["p50"] <= row["thread_ms"]["p99"] <= row["thread_ms"]["max"], name
        assert row["instance_bytes"] > 1e5 and row["shared_bytes"] > 1e5, name
    assert rows["dcloth-int8"]["error_mm"] < rows["dcloth-static"]["error_mm"]


def test_a_said_teleport_is_nothing_to_a_simulation_and_an_unsaid_one_is_not(played):
    rows = {name: found for name, found in played[1]["events"]["rows"].items() if not name.startswith("dcloth")}
    assert len(rows) == 2
    for name, found in rows.items():
        assert found["teleport"]["max_mm"] == 0, name
        carried = name.startswith("springs")    # tuned.json: all of their chains' way is the hips'
        assert (found["unsaid"]["max_mm"] > 10) != carried, name


def test_the_page_names_all_and_says_who_wins(played):
    _, figures, page = played
    for row in figures["rows"]:
        assert f"| {row['name']} |" in page
    assert "errs least" in page or "nobody keeps this budget" in page


def test_a_play_does_not_depend_on_who_plays_before(played):
    plays = ["a,solver,{folder}/skirt-250.safetensors,steps=2", "b,springs,{folder}/skirt-250.safetensors",
             "c,solver,{folder}/skirt-250.safetensors,steps=2"]
    folder = played[0]
    done = program(folder, *plays, options=["--seconds", "0.5", "-o", folder])
    assert done.returncode == 0, done.stderr
    assert (folder / "a.safetensors").read_bytes() == (folder / "c.safetensors").read_bytes()


@pytest.mark.parametrize("play, told", [
    ("x,springs,{folder}/skirt-250.safetensors,stifness=1", "springs has no setting 'stifness'"),
    ("x,jelly,{folder}/skirt-250.safetensors", "method 'jelly'; allowed here"),
    ("x,solver,{folder}/absent.safetensors", "absent.safetensors"),
    ("x,solver,{folder}/skirt-250.safetensors,steps", "'steps' is no KEY=VALUE"),
])
def test_a_wrong_play_is_refused_by_name(played, play, told):
    done = program(played[0], play)
    assert done.returncode == 2 and told in done.stderr, done.stderr
