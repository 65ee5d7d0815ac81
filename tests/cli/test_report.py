"""The report: one file, no network, decodes exactly, and draws in a real browser."""
import base64
import json
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest

import safetensors_file

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def page_parts(path):
    text = path.read_text()
    data = json.loads(re.search(r'id="report-data">(.*?)</script>', text, re.S).group(1))
    blobs = {int(i): zlib.decompress(base64.b64decode(b))
             for i, b in re.findall(r'id="blob-(\d+)">([^<]*)</script>', text)}
    return text, data, blobs


def parents_of(faces, count):
    parents = np.full(count, -1)
    for triangle in faces:
        for a, b in zip(triangle, np.roll(triangle, -1)):
            low, high = min(a, b), max(a, b)
            parents[high] = max(parents[high], low)
    parents[1:] = np.where(parents[1:] < 0, np.arange(count - 1), parents[1:])
    return parents


def decode(track, blobs, parents, tracks):
    """The documented rules of tools/track_codec.h, written a second time. -> [frames, xyz, n]"""
    out, first = [], 0
    for part in track["parts"]:
        last = first + part["frames"]
        reference = tracks[part["reference"]][first:last] if part["reference"] >= 0 else None
        out.append(decode_part(part, blobs[part["data"]], parents, reference))
        first = last
    return np.concatenate(out)


def decode_part(track, blob, parents, reference):
    frames = track["frames"]
    count = len(parents)
    half = len(blob) // 2
    zigzag = np.frombuffer(blob[:half],
                           np.uint8).astype(np.int64) + (np.frombuffer(blob[half:], np.uint8).astype(np.int64) << 8)
    residual = ((zigzag >> 1) ^ -(zigzag & 1)).reshape(frames, 3, count)
    for i in range(1, count):
        residual[:, :, i] += residual[:, :, parents[i]]
    out = np.zeros((frames, 3, count), np.int64)
    for f in range(frames):
        predicted = 0
        if track["predictor"] >= 3:
            predicted = reference[f] + (out[f - 1] - reference[f - 1] if track["predictor"] == 4 and f > 0 else 0)
        elif track["predictor"] > 0 and f > 0:
            predicted = out[f - 1] + (out[f - 1] - out[f - 2] if track["predictor"] == 2 and f > 1 else 0)
        out[f] = (residual[f] + predicted + 32768) % 65536 - 32768
    return out


def metres_of(data, blobs):
    """-> {track: [frames, n, 3]} of the page's first sequence."""
    faces = np.frombuffer(blobs[data["faces"]], np.uint16).reshape(-1, 3).astype(int)
    parents = parents_of(faces, data["vertex_count"])
    sequence = data["sequences"][0]
    origins = np.frombuffer(blobs[sequence["origins"]], np.int32).reshape(-1, 3)
    tracks, metres = [], {}
    for track in sequence["tracks"]:
        tracks.append(decode(track, blobs, parents, tracks))
        metres[track["name"]] = (tracks[-1].transpose(0, 2, 1) + origins[:, None]) * data["quantum_mm"] / 1000
    return metres


@pytest.fixture(scope="module")
def report(dcloth, files):
    path = files.folder / "report.html"
    result = dcloth("evaluate", files.bundle, files.walk, files.run, "--html", path, "--json")
    assert result.returncode == 0, result.stderr
    return path, json.loads(result.stdout)


def test_self_contained(report):
    text, data, _ = page_parts(report[0])
    outside = [u for u in re.findall(r'(?:src|href)\s*=\s*"([^"]+)"|url\(([^)]+)\)|(https?://[^\s"\'<]+)',
                                     text) if any(u)]
    assert [u for u in outside if "www.w3.org/2000/svg" not in "".join(u)] == []
    assert data["variants"] == report[1]["variants"]


def test_tracks_decode_to_what_was_simulated_and_run(report, files, dcloth, tmp_path):
    _, data, blobs = page_parts(report[0])
    metres = metres_of(data, blobs)
    assert list(metres) == ["truth", "skinning", "static", "skeleton", "fp32", "fp16", "int8", "outside"]
    out = tmp_path / "x.safetensors"
    assert dcloth("run", files.model, files.walk, "-o", out).returncode == 0
    half_quantum = data["quantum_mm"] / 2000 * (1 + 1e-6)
    assert np.abs(metres["truth"] - safetensors_file.read(files.walk)[0]["truth"]).max() <= half_quantum
    assert np.abs(metres["fp32"] - safetensors_file.read(out)[0]["positions"]).max() <= half_quantum


def test_names_cannot_break_the_page(dcloth, files, tmp_path):
    path = tmp_path / "a<script>alert(1)<.safetensors"
    shutil.copy(files.walk, path)
    html = tmp_path / "x.html"
    result = dcloth("run", files.model, path, "-o", html)
    assert result.returncode == 0, result.stderr
    assert "<script>alert" not in html.read_text()
    assert page_parts(html)[1]["sequences"][0]["name"] == "a<script>alert(1)<"


def picture(path, fragment, out):
    command = [CHROMIUM, "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
               "--hide-scrollbars", "--window-size=900,900", "--virtual-time-budget=15000",
               f"--user-data-dir={out.parent / 'profile'}",
               f"--screenshot={out}", f"file://{path}#{fragment}"]
    subprocess.run(command, capture_output=True, timeout=240)
    if not out.exists():
        pytest.skip("the browser made no picture on this machine")
    pytest.importorskip("matplotlib")
    from matplotlib import image
    return image.imread(out)[:, :, :3]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
@pytest.mark.parametrize("kind", ["evaluate", "run"])
def test_draws_in_a_browser(report, dcloth, files, tmp_path, kind):
    path = report[0]
    if kind == "run":
        path = tmp_path / "run.html"
        assert dcloth("run", files.model, files.walk, "-o", path).returncode == 0
    image = picture(path, "frame=20&theme=light&split=0", tmp_path / "picture.png")
    # the cloth's colour; nothing else is as large
    red = (image[:, :, 0] > image[:, :, 1] * 1.6) & (image[:, :, 0] > 0.25)
    assert red.sum() > 4000, "no garment in the picture"
    later = picture(path, "frame=35&theme=light&split=0", tmp_path / "later.png")
    assert (np.abs(image - later).max(-1) > 0.1).sum() > 1000, "another frame looks the same"
