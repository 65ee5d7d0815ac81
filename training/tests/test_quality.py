"""Quality report: right numbers, wrong files found, every clip pictured."""
import hashlib
import json
import re
import shutil

import numpy as np
import pytest

from dcloth_training import safetensors_io, sequence
from dcloth_training.simulate import checks, clips, quality, quality_clip, quality_text


@pytest.fixture
def data(tiny, tmp_path):
    """The tiny ground truth with a manifest; its clips get real names, one of each group."""
    folder = tmp_path / "data"
    shutil.copytree(tiny, folder)
    tensors, metadata = safetensors_io.read(str(folder / "character.safetensors"))
    tensors["body_vertices"][:, [0, 2]] *= 0.3        # clear of the made-up cloth, which takes no notice of it
    tensors["body_vertices"][:, 1] = np.maximum(tensors["body_vertices"][:, 1],
                                                0.7 + 0.1 * tensors["body_vertices"][:, 1])
    safetensors_io.write(str(folder / "character.safetensors"), tensors, metadata)
    names = {"a-one": "mocap/run", "a-two": "mocap/walk", "a-held": "mocap/jump~2"}
    lines = []
    for stem, name in names.items():
        clip = sequence.read(str(folder / "dynamic" / f"{stem}.safetensors"))
        (folder / "dynamic" / f"{stem}.safetensors").unlink()
        path = folder / "dynamic" / f"{clips.file_stem(name)}.safetensors"
        sequence.write(str(path), sequence.Sequence(clip.joint_matrices, clip.truth, clip.joint_names,
                                                    30.0, name, "dynamic"))
        lines.append({"clip": name, "kind": "dynamic", "root": "fixed", "seconds_per_frame": 0.02,
                      "sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
    lines += [{"clip": "mocap/punch", "kind": "dynamic", "refused": "stretch_p99 is 3, limit 1.6"},
              {"clip": "drapes-00", "kind": "static", "frames": 10,
               "sha256": hashlib.sha256((folder / "static" / "drapes-00.safetensors").read_bytes()).hexdigest()}]
    stale = dict(lines[0], sha256="0" * 64)         # an older simulation: the last line counts
    (folder / "manifest.jsonl").write_text("".join(json.dumps(e) + "\n" for e in [stale, *lines]))
    return folder


def run(data, out, *more):
    status = quality.main(["--data", str(data), "-o", str(out), *more])
    return status, json.loads((out / "report.json").read_text()) if (out / "report.json").exists() else None


def by_name(found):
    return {row["clip"]: row for row in found["clips"]}


def test_numbers_are_those_of_the_files(data, tmp_path):
    status, found = run(data, tmp_path / "report", "--pictures", "0")
    rows = by_name(found)
    assert status == 0
    assert [row["clip"] for row in found["clips"]] == ["mocap/run", "mocap/walk", "mocap/jump~2", "drapes-00"]
    assert [row["group"] for row in found["clips"]] == ["development_recorded", "validation_recorded",
                                                        "training_recorded", "drapes"]
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
    assert row["frames"] == 40 and row["regime"] == "fixed"
    for key in ("crossed_share", "tangled_share", "penetration_max_mm", "cloth_crossings_max"):
        assert row[key] == 0, key
    assert abs(row["stretch_max"] - largest) <= 0.0005 + 1e-6     # rounded to three digits
    assert abs(row["speed_max"] - fastest) <= 0.005 + 1e-5
    assert row["seed"] is None and rows["mocap/jump~2"]["seed"] == clips.seed("mocap/jump~2")
    assert found["refused"] == {"mocap/punch": "stretch_p99 is 3, limit 1.6"} and found["drapes"] == 10
    assert "mocap/punch" not in found["missing"] and "mocap/dance_a" in found["missing"]
    text = (tmp_path / "report" / "report.md").read_text()
    for needed in ("Development", "do not cross the body", "good.", "mocap/jump~2", row["sha256"][:12], "mocap/punch",
                   "upside down"):
        assert needed in text


def test_motion_against_the_hips_and_drapes(data, tmp_path):
    clip = sequence.read(str(data / "dynamic" / "mocap-run.safetensors"))
    local = []
    for pose, cloth in zip(clip.joint_matrices, clip.truth):      # plain loops, frame by frame
        local.append((cloth - pose[0, :3, 3]) @ pose[0, :3, :3])
    local = local[12:]
    wanted = 1e3 * np.mean([np.linalg.norm(frame - np.mean(local, 0), axis=-1) for frame in local])
    rows = by_name(run(data, tmp_path / "report", "--pictures", "0")[1])
    assert abs(rows["mocap/run"]["alive_mm"] - wanted) <= 0.05 + 1e-3 and wanted > 1
    drapes = rows["drapes-00"]
    assert drapes["frames"] == 10 and drapes["speed_max"] is None and drapes["alive_mm"] is None


def test_torn_frames_are_counted(data, tmp_path):
    path = data / "dynamic" / "mocap-walk.safetensors"
    clip = sequence.read(str(path))
    rest = safetensors_io.read(str(data / "character.safetensors"))[0]["cloth_template"]
    clip.truth[[3, 4, 20], 17] += 6 * (rest[0] - rest[10])        # one vertex six rings away from its neighbours
    sequence.write(str(path), clip)
    rows = by_name(run(data, tmp_path / "report", "--pictures", "0")[1])
    assert rows["mocap/walk"]["torn_share"] == round(3 / 44, 4) and rows["mocap/run"]["torn_share"] == 0
    text = (tmp_path / "report" / "report.md").read_text()
    line = next(line for line in text.splitlines() if "Validation" in line)
    assert f"{3 / 44:.2%} (1 files)" in line
    assert rows["mocap/walk"]["fault"].startswith("not in") or "not the one" in rows["mocap/walk"]["fault"]


def test_folds_are_found():
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]], float)
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]])
    pairs = quality_clip.hinges(faces)
    assert sorted(map(tuple, np.sort(pairs, 1).tolist())) == [(0, 1), (1, 2), (2, 3)]
    bent = []
    for angle in (0.0, 1.9, 2.4, 3.1):      # the upper half turned about the middle edge; 120 degrees are 2.09
        moved = flat.copy()
        moved[4:] = [[x, 1 + np.cos(angle), np.sin(angle)] for x in (0, 1)]
        bent.append(moved)
    assert quality_clip.folded(np.stack(bent), faces, pairs).tolist() == [0, 0, 1 / 3, 1 / 3]


def test_every_clip_is_pictured_on_the_page(data, tmp_path):
    from matplotlib import image
    status, found = run(data, tmp_path / "report")
    page = (tmp_path / "report" / "index.html").read_text()
    assert status == 0 and page.count("<article ") == 4 == page.count("<img ")
    for row in found["clips"]:
        assert f'data-name="{row["clip"]}"' in page and f'src="{row["picture"]}"' in page
        picture = image.imread(str(tmp_path / "report" / row["picture"]))[..., :3]
        size = quality_clip.PICTURE_SIZE
        count = len(quality_clip.pictured(row))
        assert 3 <= count <= 9 and picture.shape == (size, size * count, 3)
        blue = (picture[..., 2] > 1.3 * picture[..., 0]).reshape(size, count, size).sum((0, 2))
        assert (blue > 50).all()                         # cloth in each of the pictures
    assert not re.search(r'(src|href)="?(https?:)?//', page)     # nothing from elsewhere


def test_names_cannot_break_the_page(data, tmp_path):
    path = data / "dynamic" / "mocap-walk.safetensors"
    clip = sequence.read(str(path))
    clip.clip = '<b>"&'
    sequence.write(str(path), clip)
    status, found = run(data, tmp_path / "report", "--pictures", "0")
    page = (tmp_path / "report" / "index.html").read_text()
    assert status == 1 and "<b><b>" not in page and "&lt;b&gt;&quot;&amp;" in page


def test_an_interrupted_report_goes_on(data, tmp_path, monkeypatch):
    out, read = tmp_path / "report", []
    honest = sequence.read
    monkeypatch.setattr(sequence, "read", lambda path: read.append(path) or honest(path))
    _, first = run(data, out, "--pictures", "1")
    assert [bool(row["picture"]) for row in first["clips"]].count(True) == 1 and len(read) == 4 + 1
    assert (out / "index.html").read_text().count("<img ") == 1
    read.clear()
    _, second = run(data, out)
    assert all(row["picture"] for row in second["clips"]) and len(read) == 3      # what had no picture yet
    read.clear()
    _, third = run(data, out)
    assert third == second and not read
    clip = honest(str(data / "dynamic" / "mocap-run.safetensors"))
    clip.truth[3] *= 1.2
    sequence.write(str(data / "dynamic" / "mocap-run.safetensors"), clip)
    status, fourth = run(data, out)
    assert set(read) == {str(data / "dynamic" / "mocap-run.safetensors")}
    assert status == 1 and by_name(fourth)["mocap/run"]["stretch_max"] != by_name(third)["mocap/run"]["stretch_max"]
    read.clear()
    (out / "clips" / "mocap-walk.json").write_text("{")                          # torn: made anew
    assert by_name(run(data, out)[1]) == by_name(fourth) and len(read) == 2


def test_fewer_frames_and_more_workers(data, tmp_path):
    lines = [json.loads(line) for line in (data / "manifest.jsonl").read_text().splitlines()]
    for line in lines:
        if line["clip"] == "mocap/run":
            line.update(stretch_p99=1.55, speed_max=12.5, speed_mean=1.25, penetration_max_mm=3.5)
    (data / "manifest.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    _, whole = run(data, tmp_path / "whole", "--pictures", "0")
    _, some = run(data, tmp_path / "some", "--pictures", "0", "--every", "7", "--workers", "2")
    whole, some = by_name(whole)["mocap/run"], by_name(some)["mocap/run"]
    assert some["stretch_max"] <= whole["stretch_max"] and some["stretch_max_frame"] % 7 == 0
    assert some["stretch_p99"] == 1.55 == whole["stretch_p99"]    # the manifest knows of more frames
    assert some["penetration_max_mm"] == 3.5
    assert (some["speed_max"], some["speed_mean"]) == (12.5, 1.25) and whole["speed_max"] < 12.5


def test_what_stands_out_comes_first():
    plain = {"torn_share": 0.0, "through_share": 0.0, "crossed_share": 0.0, "body_crossings_max": 0,
             "cloth_crossings_max": 0, "stretch_max": 1.1, "stretch_p99": 1.0, "folded_max": 0.0, "speed_max": 1.0,
             "penetration_max_mm": 0.0, "fault": None}
    rows = [plain, {**plain, "stretch_max": 1.2}, {**plain, "folded_max": 0.1}, {**plain, "fault": "torn"},
            {**plain, "speed_max": None, "penetration_max_mm": None}]
    # A fault first, then whoever leads in a figure (row 0 in speed, before those as fast), then the rest.
    assert quality.standing_out(rows) == [3, 0, 1, 2, 4]


def test_floor_is_shown_beside_the_clip(data, tmp_path):
    path = tmp_path / "floor.json"
    path.write_text(json.dumps({"clips": [{"clip": "mocap/run", "mean_mm": 2.5, "end_mm": 4.0,
                                           "entered_mm": 1.5, "alive_mm": 50.0, "relative": 0.05}]}))
    _, found = run(data, tmp_path / "report", "--pictures", "0", "--floor", str(path))
    row = by_name(found)["mocap/run"]
    assert (row["floor_mean_mm"], row["floor_end_mm"], row["floor_entered_mm"]) == (2.5, 4.0, 1.5)
    line = next(line for line in quality_text.summary(found["clips"]) if "Development" in line)
    assert row["floor_relative"] == 0.05
    assert "2.50 (1)" in line and line.rstrip(" |").endswith(f"{2.5 / row['alive_mm']:.1%}")


def sink(clip, frames):
    """Flattens the cloth of some frames to a tenth of its depth, so that it lies inside the body."""
    some = slice(7, 7 + frames)
    hips = clip.joint_matrices[some, 0]
    local = np.einsum("tji,tnj->tni", hips[:, :3, :3], clip.truth[some] - hips[:, None, :3, 3])
    local[..., 2] *= 0.1
    clip.truth[some] = np.einsum("tij,tnj->tni", hips[:, :3, :3], local) + hips[:, None, :3, 3]


def test_cloth_inside_the_body_in_a_tenth_of_the_frames_is_kept(data, tmp_path):
    path, manifest = data / "dynamic" / "mocap-walk.safetensors", data / "manifest.jsonl"
    clip = sequence.read(str(path))
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    frames = int(checks.MAX_THROUGH_SHARE * len(clip.truth))
    sink(clip, frames)
    sequence.write(str(path), clip)
    manifest.write_text(manifest.read_text().replace(before, hashlib.sha256(path.read_bytes()).hexdigest()))
    status, found = run(data, tmp_path / "report", "--pictures", "0")
    assert frames > 0
    walk = by_name(found)["mocap/walk"]
    assert status == 0 and walk["fault"] is None
    assert walk["through_share"] == pytest.approx(frames / len(clip.truth), abs=1e-4)


@pytest.mark.parametrize("seeded,expected", [
    ("swapped", "not the one the manifest"), ("unlisted", "not in the manifest"),
    ("stretched", "stretch_p99 is"), ("torn", "torn_share is"), ("sunken", "through_share is")])
def test_a_seeded_fault_is_found(data, tmp_path, capsys, seeded, expected):
    path = data / "dynamic" / "mocap-walk.safetensors"
    lines = [json.loads(line) for line in (data / "manifest.jsonl").read_text().splitlines()]
    entry = next(line for line in lines if line["clip"] == "mocap/walk")
    clip = sequence.read(str(path))
    if seeded == "swapped":
        clip.truth[7, 0] += 1e-4
    if seeded == "stretched":
        clip.truth[5:, :] *= 2.0
    if seeded == "torn":
        clip.truth[7, 0] += 1.0
    if seeded == "sunken":      # one frame more than a clip may have
        sink(clip, int(checks.MAX_THROUGH_SHARE * len(clip.truth)) + 1)
    sequence.write(str(path), clip)
    if seeded != "swapped":
        entry["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    if seeded == "unlisted":
        lines.remove(entry)
    (data / "manifest.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    status, found = run(data, tmp_path / "report", "--pictures", "0")
    assert status == 1 and expected in by_name(found)["mocap/walk"]["fault"]
    assert "mocap/walk: " in capsys.readouterr().out
    assert by_name(found)["mocap/run"]["fault"] is None


@pytest.mark.parametrize("broken,message", [
    ("no body", "no tensor 'body_faces'"), ("no manifest", "manifest.jsonl"), ("bad line", "manifest.jsonl:1"),
    ("no clips", "no .safetensors"),
    ("other garment", "mixes two garments"), ("no truth", "no tensor 'truth'")])
def test_unusable_data_is_refused_with_the_place(data, tmp_path, capsys, broken, message):
    path = data / "dynamic" / "mocap-walk.safetensors"
    clip = sequence.read(str(path))
    if broken == "no body":
        tensors, metadata = safetensors_io.read(str(data / "character.safetensors"))
        del tensors["body_faces"]
        safetensors_io.write(str(data / "character.safetensors"), tensors, metadata)
    elif broken == "no manifest":
        (data / "manifest.jsonl").unlink()
    elif broken == "bad line":
        (data / "manifest.jsonl").write_text("[1]\n")
    elif broken == "no clips":
        shutil.rmtree(data / "dynamic")
        (data / "dynamic").mkdir()
    else:
        clip.truth = clip.truth[:, :-1] if broken == "other garment" else None
        sequence.write(str(path), clip)
    status, found = run(data, tmp_path / "report", "--pictures", "0")
    assert status == 2 and found is None and message in capsys.readouterr().err


def test_seed_of_a_clip():
    assert clips.seed("procedural/random_17") == 17 and clips.seed("procedural/jumps") == 13
    assert clips.seed("mocap/walk") is None
    assert clips.seed("mocap/jump~1") != clips.seed("mocap/jump~2")
