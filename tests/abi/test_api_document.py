"""docs/api.md is what the headers say, and the check of it notices when it is not."""
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts/api_document.py"
INCLUDE = ROOT / "engine/include/dcloth"


def run(*arguments):
    return subprocess.run([sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True, timeout=60)


def test_the_page_is_up_to_date():
    done = run("--check")
    assert done.returncode == 0, done.stderr
    assert int(re.search(r"(\d+) names", done.stdout)[1]) > 80


def test_every_link_goes_somewhere():
    page = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    headings = {re.sub(r"[^a-z0-9_]", "", line.lower()) for line in re.findall(r"^#+ (.*)$", page, re.MULTILINE)}
    links = set(re.findall(r"\]\(#([^)]*)\)", page))
    assert len(links) > 40 and links <= headings, links - headings
    for file in set(re.findall(r"\]\(([^#)]+)\)", page)):
        assert (ROOT / "docs" / file).exists(), file


# What is done to a header, and what is said.
@pytest.mark.parametrize("before, after, said", [
    (None, None, None),
    ("One frame of time.", "A frame of time.", "not what the headers say"),
    ("  uint32_t frozen;       /*", "  uint32_t stiff;       /*", "dcloth_cloth_info: fields"),
    ("  float tick_share; ", "", "dcloth_cloth_info: fields"),
    ("DCLOTH_API dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth);", "", "dcloth_cloth_reset: no section"),
    ("  DCLOTH_FRAME_HOLD = 8,", "", "DCLOTH_FRAME_HOLD: no section"),
    (" Cost: clears the state. */", " */", "dcloth_cloth_reset: the comment does not end in"),
])
def test_changed_headers_are_noticed(tmp_path, before, after, said):
    include = tmp_path / "dcloth"
    shutil.copytree(INCLUDE, include)
    if before is not None:
        text = (include / "dcloth.h").read_text(encoding="utf-8")
        assert text.count(before) == 1
        (include / "dcloth.h").write_text(text.replace(before, after), encoding="utf-8")
    done = run("--check", "--include", include)
    if said is None:
        assert done.returncode == 0, done.stderr
    else:
        assert done.returncode == 1 and said in done.stderr


def test_a_fault_writes_nothing(tmp_path):
    include = tmp_path / "dcloth"
    shutil.copytree(INCLUDE, include)
    text = (include / "dcloth.h").read_text(encoding="utf-8")
    (include / "dcloth.h").write_text(text.replace(" Cost: clears the state. */", " */"), encoding="utf-8")
    assert run("--include", include, "-o", tmp_path / "api.md").returncode == 1
    assert not (tmp_path / "api.md").exists()
