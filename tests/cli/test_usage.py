"""Bad usage: exit code 2, the reason on stderr, no output file. Files go by any name: other alphabets, blanks, a path
from the root, which is no option anywhere."""
import json
import os
import shutil
import subprocess

import pytest

import safetensors_file
from checks import leftovers, refused


@pytest.mark.parametrize("command", ["convert", "inspect", "run", "profile", "evaluate", "poses", "body"])
def test_help_of_every_command(dcloth, command):
    result = dcloth(command, "--help")
    assert result.returncode == 0 and command in result.stdout


def test_version(dcloth):
    assert dcloth("--version").stdout.strip().count(".") == 2


@pytest.mark.parametrize("arguments, word", [
    ([], "subcommand"), (["inspcet"], "inspcet"), (["inspect"], "MODEL"), (["convert", "x"], "--output"),
    (["convert", "x", "-o", "y", "--precision", "int4"], "int4"),
    (["convert", "x", "-o", "y", "--max-error-mm", "-1"], "-1"),
    (["run", "m", "s", "-o", "x.pc2", "--fps", "0"], "--fps"),
    (["run", "m", "s", "-o", "x.pc2", "--stages", "cloth"], "cloth"),
    (["profile", "m", "s", "--budget-ms", "fast"], "fast"), (["evaluate", "b"], "SEQ"),
    (["evaluate", "b", "s", "--precision", "auto"], "auto")])
def test_bad_arguments(dcloth, arguments, word):
    refused(dcloth(*arguments), word)


@pytest.mark.parametrize("number", ["nan", "-nan", "inf", "-inf", "1e400"])
@pytest.mark.parametrize("arguments", [
    ["convert", "b", "-o", "m", "--motion", "s", "--max-error-mm"], ["run", "m", "s", "-o", "x.pc2", "--fps"],
    ["profile", "m", "s", "--budget-ms"], ["profile", "m", "s", "--fps"], ["poses", "a.bvh", "-o", "s", "--fps"]])
def test_numbers_that_are_none(dcloth, arguments, number):
    """A bound of NaN would never be missed."""
    refused(dcloth(*arguments, number), arguments[-1])


@pytest.mark.parametrize("command", ["inspect", "profile", "run", "convert", "evaluate"])
def test_missing_file_is_named(dcloth, files, tmp_path, command):
    missing = tmp_path / "no_such_file"
    tail = {"inspect": [], "profile": [files.walk], "run": [files.walk, "-o", tmp_path / "x.pc2"],
            "convert": ["-o", tmp_path / "x.dcloth"], "evaluate": [files.walk]}[command]
    refused(dcloth(command, missing, *tail), missing)
    assert leftovers(tmp_path, set()) == []


def test_a_folder_is_not_a_file(dcloth, tmp_path):
    refused(dcloth("inspect", tmp_path), tmp_path)


def test_auto_needs_a_bound_and_motion(dcloth, files, tmp_path):
    out = tmp_path / "x.dcloth"
    refused(dcloth("convert", files.bundle, "-o", out, "--precision", "auto"), "--max-error-mm", "--motion")
    refused(dcloth("convert", files.bundle, "-o", out, "--max-error-mm", "1"), "--motion")
    assert not out.exists()


def test_an_empty_name_is_no_output(dcloth, files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(dcloth("convert", files.bundle, "-o", ""), "empty file name")
    assert leftovers(tmp_path, set()) == []


def test_ranges_are_said_in_few_digits(dcloth):
    for arguments in (["profile", "m", "s", "--core", "-1"], ["evaluate", "b", "s", "--pareto", "--rank", "0"]):
        result = dcloth(*arguments)
        refused(result, arguments[-2])
        assert len(result.stderr) < 200


def test_output_into_no_folder(dcloth, files, tmp_path):
    out = tmp_path / "nowhere" / "x.dcloth"
    refused(dcloth("convert", files.bundle, "-o", out), out)


def test_unknown_output_kind(dcloth, files, tmp_path):
    refused(dcloth("run", files.model, files.walk, "-o", tmp_path / "x.abc"), ".abc",
            ".safetensors, .pc2, .mdd or .html")
    assert leftovers(tmp_path, set()) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no full device")
def test_output_that_nobody_gets_is_an_error(binary, files):
    for arguments in (["inspect", files.model], ["inspect", files.model, "--json"], ["--version"], ["--help"]):
        with open("/dev/full", "w") as full:
            result = subprocess.run([binary, *map(str, arguments)], stdout=full, stderr=subprocess.PIPE, text=True,
                                    timeout=60)
        assert result.returncode == 2 and "stdout" in result.stderr, arguments


def test_core_that_does_not_exist(dcloth, files):
    refused(dcloth("profile", files.model, files.walk, "--core", "4095"), "4095", "--core")


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
