"""Quality report: right numbers, wrong files found, every clip pictured."""
import hashlib
import json
import shutil

import numpy as np
import pytest

from dcloth_training import safetensors_io, sequence
from dcloth_training.simulate import clips, quality, quality_text


@pytest.fixture
def data(tiny, tmp_path):
    """The tiny ground truth with a manifest; its clips get real names, one of each group."""
    folder = tmp_path / "data"
    shutil.copytree(tiny, folder)
    names = {"a-one": "mocap/run", "a-two": "mocap/walk", "a-held": "mocap/jump~2"}
    lines = []
    for stem, name in names.items():
        clip = sequence.read(str(folder / "dynamic" / f"{stem}.safetensors"))
        (folder / "dynamic" / f"{stem}.safetensors").unlink()
        path = folder / "dynamic" / f"{clips.file_stem(name)}.safetensors"
        sequence.write(str(path), sequence.Sequence(clip.joint_matrices, clip.truth, clip.joint_names,
                                                    30.0, name, "dynamic"))
        lines.append({"clip": name, "kind": "dynamic", "root": "fixed", "penetration_max_mm": 1.25,
                      "sunken_share": 0.0, "seconds_per_frame": 0.02,
                      "sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
    lines += [{"clip": "mocap/punch", "kind": "dynamic", "refused": "stretch_p99 is 3, limit 1.6"},
              {"clip": "drapes-00", "kind": "static", "frames": 10}]
    stale = dict(lines[0], sha256="0" * 64)         # an older simulation: the last line counts
    (folder / "manifest.jsonl").write_text("".join(json.dumps(e) + "\n" for e in [stale, *lines]))
    return folder


def run(data, out, *more):
    status = quality.main(["--data", str(data), "-o", str(out), *more])
    return status, json.loads((out / "report.json").read_text()) if (out / "report.json").exists() else None


def by_name(found):
    return {row["clip"]: row for row in found["clips"]}


def test_numbers_are_those_of_the_files(data, tmp_path):
    status, found = run(data, tmp_path / "report", "--no-pictures")
    rows = by_name(found)
    assert status == 0 and [row["clip"] for row in found["clips"]] == ["mocap/run", "mocap/walk",
                                                                       "mocap/jump~2"]
    assert [row["group"] for row in found["clips"]] == ["held_out", "training", "variation"]
    character, _ = safetensors_io.read(str(data / "character.safetensors"))
    clip = sequence.read(str(data / "dynamic" / "mocap-run.safetensors"))
    rest, largest, fastest = character["cloth_template"], 0.0, 0.0
    for face in character["cloth_faces"]:           # plain loops, edge by edge
        for i in range(3):
            a, b = face[i], face[(i + 1) % 3]
            length = np.linalg.norm(clip.truth[:, a] - clip.truth[:, b], axis=-1)
            largest = max(largest, (length / np.linalg.norm(rest[a] - rest[b])).max())
    for before, after in zip(clip.truth, clip.truth[1:]):
        fastest = max(fastest, 30 * np.linalg.norm(after - before, axis=-1).max())
    row = rows["mocap/run"]
    assert row["frames"] == 40 and row["regime"] == "fixed" and row["penetration_max_mm"] == 1.25
    assert abs(row["stretch_max"] - largest) <= 0.0005 + 1e-6     # rounded to three digits
    assert abs(row["speed_max"] - fastest) <= 0.005 + 1e-5
    assert row["seed"] is None and rows["mocap/jump~2"]["seed"] == clips.seed("mocap/jump~2")
    assert found["refused"] == {"mocap/punch": "stretch_p99 is 3, limit 1.6"} and found["drapes"] == 10
    assert "mocap/punch" not in found["missing"] and "mocap/dance_a" in found["missing"]
    text = (tmp_path / "report" / "report.md").read_text()
    for needed in ("Held out", "mocap/jump~2", row["sha256"][:12], "mocap/punch", "upside down"):
        assert needed in text


def test_every_clip_is_pictured_and_sheets_are_split(data, tmp_path, monkeypatch):
    from matplotlib import image
    monkeypatch.setattr(quality, "ROWS_A_SHEET", 2)
    status, found = run(data, tmp_path / "report")
    assert status == 0 and found["sheets"] == ["sheet-01.png", "sheet-02.png"]
    shapes = [image.imread(str(tmp_path / "report" / name)).shape[:2] for name in found["sheets"]]
    size = quality.PICTURE_SIZE
    assert [s[0] for s in shapes] == [2 * size, size] and {s[1] for s in shapes} == {6 * size}
    picture = image.imread(str(tmp_path / "report" / "sheet-02.png"))[..., :3]
    blue = (picture[..., 2] > 1.3 * picture[..., 0]).reshape(size, 6, size).sum((0, 2))
    assert (blue > 50).all()                         # cloth in each of the six pictures


def test_floor_is_shown_beside_the_clip(data, tmp_path):
    path = tmp_path / "floor.json"
    path.write_text(json.dumps({"clips": [{"clip": "mocap/run", "mean_mm": 2.5, "end_mm": 4.0,
                                           "entered_mm": 1.5, "alive_mm": 50.0}]}))
    _, found = run(data, tmp_path / "report", "--no-pictures", "--floor", str(path))
    row = by_name(found)["mocap/run"]
    assert (row["floor_mean_mm"], row["floor_end_mm"], row["floor_entered_mm"], row["alive_mm"]) == (
        2.5, 4.0, 1.5, 50.0)
    line = next(line for line in quality_text.summary(found["clips"]) if "Held out" in line)
    assert "2.50 (1)" in line and line.rstrip(" |").endswith("20")


@pytest.mark.parametrize("seeded,expected", [
    ("swapped", "not the one the manifest"), ("unlisted", "not in the manifest"),
    ("torn", "stretch_p99 is"), ("sunken", "penetration_max_mm is")])
def test_a_seeded_fault_is_found(data, tmp_path, capsys, seeded, expected):
    path = data / "dynamic" / "mocap-walk.safetensors"
    lines = [json.loads(line) for line in (data / "manifest.jsonl").read_text().splitlines()]
    entry = next(line for line in lines if line["clip"] == "mocap/walk")
    clip = sequence.read(str(path))
    if seeded in ("swapped", "torn"):
        clip.truth[5:, :] *= 3.0 if seeded == "torn" else 1.0
        clip.truth[7, 0] += 1e-4
        sequence.write(str(path), clip)
    if seeded == "torn":
        entry["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    if seeded == "sunken":
        entry["penetration_max_mm"] = 200.0
    if seeded == "unlisted":
        lines.remove(entry)
    (data / "manifest.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    status, found = run(data, tmp_path / "report", "--no-pictures")
    assert status == 1 and expected in by_name(found)["mocap/walk"]["fault"]
    assert "mocap/walk: " in capsys.readouterr().out
    assert by_name(found)["mocap/run"]["fault"] is None


@pytest.mark.parametrize("broken,message", [
    ("no manifest", "manifest.jsonl"), ("bad line", "manifest.jsonl:1"), ("no clips", "no .safetensors"),
    ("other garment", "mixes two garments"), ("no truth", "no tensor 'truth'")])
def test_unusable_data_is_refused_with_the_place(data, tmp_path, capsys, broken, message):
    path = data / "dynamic" / "mocap-walk.safetensors"
    clip = sequence.read(str(path))
    if broken == "no manifest":
        (data / "manifest.jsonl").unlink()
    elif broken == "bad line":
        (data / "manifest.jsonl").write_text("[1]\n")
    elif broken == "no clips":
        shutil.rmtree(data / "dynamic")
        (data / "dynamic").mkdir()
    else:
        clip.truth = clip.truth[:, :-1] if broken == "other garment" else None
        sequence.write(str(path), clip)
    status, found = run(data, tmp_path / "report", "--no-pictures")
    assert status == 2 and found is None and message in capsys.readouterr().err


def test_seed_of_a_clip():
    assert clips.seed("procedural/random_17") == 17 and clips.seed("procedural/jumps") == 13
    assert clips.seed("mocap/walk") is None
    assert clips.seed("mocap/jump~1") != clips.seed("mocap/jump~2")
