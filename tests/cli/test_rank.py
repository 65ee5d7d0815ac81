"""convert --rank and --calibrate: fewer rows of the displacement basis, and what they may cost."""
import json

import numpy as np
import pytest

import small_garment
from checks import leftovers, mesh_error, refused

FULL = small_garment.K_SKELETON + small_garment.K_MESH


def converted(dcloth, *arguments):
    result = dcloth("convert", *arguments, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def low_rank(files, tmp_path_factory):
    """The same garment with S and M mixed from four shapes."""
    random = np.random.default_rng(3)
    shapes = small_garment.bundle_tensors()["skeleton.basis"][:4]
    mixed = {name: np.einsum("jk,kna->jna", random.standard_normal((rows, 4)) / 2, shapes).astype("float32")
             for name, rows in (("skeleton.basis", small_garment.K_SKELETON), ("mesh.basis", small_garment.K_MESH))}
    path = tmp_path_factory.mktemp("low") / "low.safetensors"
    small_garment.write_bundle(path, changes=mixed)
    return path


def test_a_rank_that_is_there_is_used_unasked(dcloth, files, low_rank, tmp_path):
    out = tmp_path / "m.dcloth"
    said = converted(dcloth, low_rank, "-o", out, "--precision", "int8", "--motion", files.walk)
    whole = converted(dcloth, low_rank, "-o", out, "--precision", "int8", "--motion", files.walk, "--rank", "full")
    rows = said["basis"]["rank"]  # four and what int8 wants on top
    assert said["basis"] == {"full": FULL, "exact": 4, "rank": rows, "reduced": True} and 4 <= rows <= 8
    assert whole["basis"] == {"full": FULL, "exact": 4, "rank": FULL, "reduced": False}
    shapes = {t["name"]: t["shape"] for t in said["tensors"]}
    assert shapes["displacement.basis.weights"] == [rows, 3 * small_garment.VERTICES]
    assert shapes["displacement.head.weights"] == [small_garment.K_SKELETON, rows]
    assert shapes["mesh_stage.coefficients.weights"][1] == rows
    assert whole["model_bytes"] - said["model_bytes"] > 0.9 * (FULL - rows) * 3 * small_garment.VERTICES
    mesh_error(said["trials"][0]["error"])
    assert json.loads(dcloth("inspect", out, "--json").stdout)["format"] == "1.6"


def test_given_ranks_trade_millimetres(dcloth, files, tmp_path):
    errors, sizes = [], []
    for rank in (4, 10, 16):
        said = converted(dcloth, files.bundle, "-o", tmp_path / "m", "--rank", rank, "--calibrate", files.walk,
                         "--motion", files.run)
        assert said["basis"]["rank"] == rank and said["basis"]["exact"] == FULL
        trial, = said["trials"]
        mesh_error(trial["calibration"])
        assert trial["rank"] == rank and trial["error"]["frames"] == 30 and trial["calibration"]["frames"] == 40
        errors.append(trial["error"]["position_mm"]["mean"])
        sizes.append(said["model_bytes"])
    assert errors == sorted(errors, reverse=True) and sizes == sorted(sizes)
    assert errors[-1] < 0.2 * errors[0]


def test_a_rank_above_the_exact_one_is_the_exact_one(dcloth, files, tmp_path):
    for rank in (1000, 2 ** 32 - 1):
        assert converted(dcloth, files.bundle, "-o", tmp_path / "m", "--rank", rank)["basis"]["rank"] == FULL


@pytest.mark.parametrize("precision", ["fp32", "fp16", "int8"])
def test_the_smallest_rank_within_the_bound(dcloth, files, tmp_path, precision):
    out = tmp_path / "m.dcloth"
    common = (files.bundle, "-o", out, "--precision", precision, "--calibrate", files.walk)
    twelve = converted(dcloth, *common, "--rank", 12)["trials"][0]["calibration"]["position_mm"]["max"]
    said = converted(dcloth, *common, "--max-error-mm", 1.01 * twelve)
    assert said["basis"]["rank"] <= 12 and said["precision"] == precision
    kept = [t for t in said["trials"] if t["rank"] == said["basis"]["rank"]]
    assert kept and all(t["calibration"]["position_mm"]["max"] <= 1.01 * twelve for t in kept)
    assert any(t["calibration"]["position_mm"]["max"] > 1.01 * twelve for t in said["trials"])


def test_a_missed_bound_is_exit_1_and_writes_nothing(dcloth, files, tmp_path):
    out = tmp_path / "m.dcloth"
    out.write_bytes(b"kept")
    refused(dcloth("convert", files.bundle, "-o", out, "--rank", 4, "--calibrate", files.walk, "--max-error-mm", 1e-3),
            "rank 4", "at most", code=1)
    short = tmp_path / "short.safetensors"
    small_garment.write_sequence(short, small_garment.motion(2, 30), truth=False)
    refused(dcloth("convert", files.bundle, "-o", out, "--calibrate", short, "--motion", files.run, "--max-error-mm",
                   0.05), "not calibrated on", "calibrate on", code=1)
    assert out.read_bytes() == b"kept"
    assert leftovers(tmp_path, {"m.dcloth", "short.safetensors"}) == []


def test_reduced_models_play_every_level(dcloth, files, low_rank, tmp_path):
    import safetensors_file
    for stages in ("static", "skeleton", "mesh"):
        played = []
        for rank in ("exact", "full"):
            model, out = tmp_path / f"{rank}.dcloth", tmp_path / f"{rank}.safetensors"
            assert dcloth("convert", low_rank, "-o", model, "--rank", rank).returncode == 0
            assert dcloth("run", model, files.walk, "-o", out, "--stages", stages).returncode == 0
            played.append(safetensors_file.read(out)[0]["positions"])
        # A float of up to 2 m rounds by 1.2e-7; skinning adds a few such roundings.
        assert abs(played[0] - played[1]).max() < 2e-6


@pytest.mark.parametrize("arguments, words", [
    (("--rank", "0"), ("--rank 0",)), (("--rank", "half"), ("--rank half", "exact")), (("--rank", "12x"), ("12x",)),
    (("--rank", "4"), ("--calibrate",)), (("--rank", "auto"), ("--max-error-mm", "--calibrate"))])
def test_bad_ranks_are_refused(dcloth, files, tmp_path, arguments, words):
    refused(dcloth("convert", files.bundle, "-o", tmp_path / "m", *arguments), *words)
    assert leftovers(tmp_path, set()) == []
