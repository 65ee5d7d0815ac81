"""Files go by any name: other alphabets, blanks, a path from the root, which is no option anywhere."""
import json
import shutil

import pytest

import safetensors_file
from checks import leftovers, refused

NAMES = ["Röcke", "スカート", "юбка 1", "👗", "a b's"]


@pytest.mark.parametrize("name", NAMES)
def test_every_command_takes_any_name(dcloth, files, tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    bundle, clip, model, out, mesh, page = (folder / (name + end) for end in (
        ".safetensors", "-clip.safetensors", ".dcloth", "-out.safetensors", ".obj", ".html"))
    shutil.copy(files.bundle, bundle)
    shutil.copy(files.bare, clip)
    said = json.loads(dcloth("convert", bundle, "-o", model, "--motion", clip, "--json").stdout)
    assert said["bundle"] == str(bundle) and said["model"] == str(model)
    assert model.read_bytes() == files.model.read_bytes()
    assert json.loads(dcloth("inspect", model, "--json").stdout)["path"] == str(model)
    assert dcloth("run", model, clip, "-o", page).returncode == 0
    assert f"{name}-clip" in page.read_text("utf-8")
    ran = dcloth("run", model, clip, "-o", out, "--mesh", mesh)
    assert ran.returncode == 0 and str(out) in ran.stderr
    assert len(safetensors_file.read(out)[0]["positions"]) == 20
    assert leftovers(folder, {p.name for p in (bundle, clip, model, out, mesh, page)}) == []


@pytest.mark.parametrize("name", NAMES)
def test_what_is_missing_is_said_as_it_was_written(dcloth, tmp_path, name):
    refused(dcloth("inspect", tmp_path / name), f"{tmp_path / name}: found no such file")
