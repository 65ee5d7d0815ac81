"""No command writes over what it reads, whatever name the file goes by, and no two outputs into one file."""
import os
import shutil
from pathlib import Path

import pytest

from checks import leftovers, refused

DATA = Path(__file__).parent / "data"


@pytest.fixture
def own(files, tmp_path):
    """Copies that a command at fault may destroy."""
    for path in (files.bundle, files.walk, files.run, files.bare, files.model):
        shutil.copy(path, tmp_path / path.name)
    for name in ("walker.bvh", "walker.glb"):
        shutil.copy(DATA / name, tmp_path / name)
    (tmp_path / "map.json").write_text("{}")
    return tmp_path


@pytest.mark.parametrize("arguments, lost", [
    ("run skirt.dcloth walk.safetensors -o walk.safetensors", "walk.safetensors"),
    ("run skirt.dcloth walk.safetensors -o x.pc2 --mesh skirt.dcloth", "skirt.dcloth"),
    ("convert skirt.safetensors -o skirt.safetensors", "skirt.safetensors"),
    ("convert skirt.safetensors -o walk.safetensors --motion walk.safetensors", "walk.safetensors"),
    ("convert skirt.safetensors -o x --report run.safetensors --motion walk.safetensors --calibrate run.safetensors",
     "run.safetensors"),
    ("profile skirt.dcloth walk.safetensors --trace walk.safetensors", "walk.safetensors"),
    ("profile skirt.dcloth walk.safetensors --trace skirt.dcloth", "skirt.dcloth"),
    ("evaluate skirt.safetensors walk.safetensors bare.safetensors --html bare.safetensors", "bare.safetensors"),
    ("evaluate skirt.safetensors walk.safetensors --html skirt.safetensors", "skirt.safetensors"),
    ("poses walker.bvh -o walker.bvh --up z", "walker.bvh"),
    ("poses walker.bvh -o skirt.safetensors --model skirt.safetensors", "skirt.safetensors"),
    ("body walker.glb -o map.json --map map.json", "map.json"),
])
def test_an_output_is_no_input(dcloth, own, monkeypatch, arguments, lost):
    monkeypatch.chdir(own)
    before = {p.name: p.read_bytes() for p in own.iterdir()}
    refused(dcloth(*arguments.split()), lost, "different name")
    assert {p.name: p.read_bytes() for p in own.iterdir()} == before


def test_links_and_other_spellings_are_the_same_file(dcloth, own, monkeypatch):
    monkeypatch.chdir(own)
    before = (own / "walk.safetensors").read_bytes()
    (own / "link.safetensors").symlink_to("walk.safetensors")
    os.link(own / "walk.safetensors", own / "hard.safetensors")
    for name in ("./walk.safetensors", own / "walk.safetensors", "link.safetensors", "hard.safetensors"):
        refused(dcloth("run", "skirt.dcloth", "walk.safetensors", "-o", name), name, "different name")
    assert (own / "walk.safetensors").read_bytes() == before


def test_two_outputs_are_two_files(dcloth, own, monkeypatch):
    """One of them not there yet, by two spellings."""
    monkeypatch.chdir(own)
    before = {p.name for p in own.iterdir()}
    refused(dcloth("run", "skirt.dcloth", "bare.safetensors", "-o", "new.pc2", "--mesh", own / "new.pc2"), "--mesh",
            "different name")
    refused(dcloth("convert", "skirt.safetensors", "-o", "new", "--report", own / "new"), "--report", "different name")
    assert leftovers(own, before) == []


def test_a_mesh_beside_an_output_that_fails_is_not_written(dcloth, files, tmp_path):
    """Both files or neither: the mesh of one motion does not stay beside the point cache of another."""
    mesh = tmp_path / "garment.obj"
    mesh.write_text("the old mesh")
    refused(dcloth("run", files.model, files.bare, "-o", tmp_path / "nowhere" / "x.pc2", "--mesh", mesh), "nowhere")
    assert mesh.read_text() == "the old mesh"
    assert leftovers(tmp_path, {"garment.obj"}) == []
