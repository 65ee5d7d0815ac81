"""scripts/levels_document.py: the picture and the table of the levels, from what scene_garment_test measured."""
import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "scripts/levels_document.py"
NAMES = ["frozen", "static", "skeleton", "half rate mesh", "mesh"]


def report(names):
    levels = [{"name": name, "error_mm": 20.0 - 4 * i, "to_mesh_mm": 10.0 - 2.5 * i, "tick_us": 100.0 * i,
               "mean_tick_us": 110.0 * i} for i, name in enumerate(names)]
    return {"garment": "tube", "version": "0", "isa": "scalar", "draw_us": 50.0, "idle_mm": 1.25, "levels": levels}


def run(folder, reports, garment="tube", page="before\n<!-- levels -->\nold\n<!-- /levels -->\nafter\n"):
    (folder / "levels.json").write_text("".join(json.dumps(r) + "\n" for r in reports), encoding="utf-8")
    (folder / "page.md").write_text(page, encoding="utf-8")
    return subprocess.run([sys.executable, SCRIPT, folder / "levels.json", "--garment", garment, "--picture",
                           folder / "levels.svg", "--page", folder / "page.md"], capture_output=True, text=True, check=False)


def test_table_and_picture(tmp_path):
    done = run(tmp_path, [{**report(NAMES), "garment": "other"}, report(NAMES)])
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert page.startswith("before\n<!-- levels -->\n| level |") and page.endswith("<!-- /levels -->\nafter\n")
    assert "old" not in page
    assert "| 12.0 mm | 5.00 mm | 200 µs |" in page and "| 300 and 400 µs |" in page and "| 4.0 mm | 0 | 400 µs |" in page
    assert "Drawing takes 50 µs" in page and "1.2 mm where the clips end" in page
    first = (tmp_path / "levels.svg").read_bytes()
    assert b"<svg" in first and first.count(b"<!-- 0.49 -->") == 1  # the mesh's bar: 50 + 440 us
    assert run(tmp_path, [report(NAMES)]).returncode == 0
    assert (tmp_path / "levels.svg").read_bytes() == first


def test_what_is_missing_is_named_and_nothing_is_written(tmp_path):
    for reports, garment, page, said in (
            ([report(NAMES[:3])], "tube", "<!-- levels -->\n<!-- /levels -->\n", "half rate mesh, mesh"),
            ([report(NAMES)], "skirt", "<!-- levels -->\n<!-- /levels -->\n", "no garment 'skirt'; found: tube"),
            ([], "tube", "<!-- levels -->\n<!-- /levels -->\n", "found: none"),
            ([report(NAMES)], "tube", "<!-- /levels -->\n<!-- levels -->\n", "needs one <!-- levels -->")):
        done = run(tmp_path, reports, garment, page)
        assert done.returncode == 2 and said in done.stderr, done.stderr
        assert (tmp_path / "page.md").read_text(encoding="utf-8") == page
        assert not (tmp_path / "levels.svg").exists()
