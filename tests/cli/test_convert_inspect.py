"""convert and inspect: what they write and say."""
import json

import numpy as np
import pytest

import safetensors_file
import small_garment
from checks import leftovers, mesh_error, refused


@pytest.mark.parametrize("precision", ["fp32", "fp16", "int8"])
def test_convert_then_inspect(dcloth, files, tmp_path, precision):
    out = tmp_path / "m.dcloth"
    result = dcloth("convert", files.bundle, "-o", out, "--precision", precision, "--json")
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert said["precision"] == precision and said["model_bytes"] == out.stat().st_size
    assert sum(t["size_bytes"] for t in said["tensors"]) <= said["model_bytes"]
    names = {t["name"]: t for t in said["tensors"]}
    assert len(names) == len(said["tensors"]) > 10
    wanted = {"fp32": "f32", "fp16": "f16", "int8": "i8"}[precision]
    assert wanted in {t["dtype"] for t in said["tensors"]}
    worst = max(t["relative_max"] for t in said["tensors"])
    assert (worst < 1e-6) == (precision == "fp32")

    seen = json.loads(dcloth("inspect", out, "--json").stdout)
    assert seen["garment"] == "cone skirt" and seen["precision"] == precision
    assert seen["model_bytes"] == said["model_bytes"] and seen["instance_bytes"] == said["instance_bytes"]
    assert seen["vertices"] == small_garment.VERTICES and seen["stages"] == ["static", "skeleton", "mesh"]
    assert seen["patches"] is None and seen["tick_multiply_adds"] > 0
    assert seen["tick_rate"] == 30 and set(seen["joints"]) <= set(small_garment.JOINTS)
    names = dict(enumerate(seen["joints"]))
    above = {j: small_garment.JOINTS[p] for j, p in zip(small_garment.JOINTS, small_garment.PARENTS) if p >= 0}
    # No joint of this garment stands between two others and is not read.
    assert {names[j]: names[p] for j, p in enumerate(seen["joint_parents"]) if p >= 0} == \
        {j: p for j, p in above.items() if j in seen["joints"]}
    assert sum(p < 0 for p in seen["joint_parents"]) == 1 and len(seen["joint_parents"]) == len(names)
    assert out.read_bytes()[4:8] == b"DCLO"


def test_a_bundle_without_parents(dcloth, files, tmp_path):
    tensors, metadata = safetensors_file.read(files.bundle)
    del metadata["parents"]
    safetensors_file.write(tmp_path / "bundle.safetensors", tensors, metadata)
    assert dcloth("convert", tmp_path / "bundle.safetensors", "-o", tmp_path / "model.dcloth").returncode == 0
    assert json.loads(dcloth("inspect", tmp_path / "model.dcloth", "--json").stdout)["joint_parents"] is None


def test_auto_says_what_it_chose_and_why(dcloth, files, tmp_path):
    out = tmp_path / "m.dcloth"
    arguments = ["convert", files.bundle, "-o", out, "--calibrate", files.walk, "--rank", "full"]
    int8 = json.loads(dcloth(*arguments, "--precision", "int8", "--json").stdout)
    bound = 0.4 * int8["trials"][0]["calibration"]["position_mm"]["max"]
    arguments += ["--precision", "auto", "--max-error-mm", bound]
    alone = json.loads(dcloth(*arguments, "--json").stdout)["auto"]
    assert alone["chosen_on"] == "calibration" and alone["checked_mm"] is None
    assert alone["bound_mm"] == pytest.approx(bound) and 0 < alone["error_mm"] <= bound
    raised = [t for t in alone["tensors"] if t["cheaper"]]
    assert raised and all(t["cheaper_mm"] > bound for t in raised)
    for t in alone["tensors"]:
        assert (t["cheaper"], t["format"]) in {(None, "int8"), (None, "fp16"), ("int8", "fp16"), ("fp16", "fp32")}
    # On other motion it costs something else; without a check nobody would know.
    checked = dcloth(*arguments, "--motion", files.run, "--json")
    if checked.returncode == 0:
        assert 0 < json.loads(checked.stdout)["auto"]["checked_mm"] <= bound
    else:
        refused(checked, "not calibrated on", code=1)
    text = dcloth(*arguments, "--verbose").stdout
    for word in ("as int8 would make it", "the cheapest there is", "not checked on other motion"):
        assert word in text
    assert int8["auto"] is None


def test_missed_bound_is_exit_1_and_writes_nothing(dcloth, files, tmp_path):
    out = tmp_path / "m.dcloth"
    result = dcloth("convert", files.bundle, "-o", out, "--precision", "int8", "--max-error-mm", "1e-6", "--motion",
                    files.walk)
    refused(result, "int8", code=1)
    assert not out.exists()


def test_tables_for_people(dcloth, files, tmp_path):
    text = dcloth("convert", files.bundle, "-o", tmp_path / "m", "--precision", "int8").stdout
    assert len(text.splitlines()) <= 5 and "basis" in text and "i8" not in text
    text = dcloth("convert", files.bundle, "-o", tmp_path / "m", "--precision", "int8", "--verbose").stdout
    assert "basis" in text and "i8" in text
    assert "MB" in text and "per instance" in text
    text = dcloth("inspect", files.model).stdout
    for word in ("cone skirt", "fp32", "30 Hz", "thigh_l", "static skeleton mesh"):
        assert word in text


def test_report_ranks_tensors_by_what_they_cost(dcloth, files, tmp_path):
    """Weights below the smallest half, made up for by the layers around them (biases are zero): the same network in
    fp32; in fp16 this one tensor loses the whole mesh stage."""
    tensors = small_garment.bundle_tensors()
    hidden, coefficients, basis = (tensors[f"mesh.{name}"] for name in ("mlp.0.weight", "mlp.2.weight", "basis"))
    shrink = 2e-8 / abs(coefficients).max()
    bundle, out, report = tmp_path / "b.safetensors", tmp_path / "m.dcloth", tmp_path / "report.json"
    small_garment.write_bundle(bundle, changes={"mesh.mlp.0.weight": 1000 * hidden,
                                                "mesh.mlp.2.weight": (shrink * coefficients).astype("float32"),
                                                "mesh.basis": (basis / (1000 * shrink)).astype("float32")})
    result = dcloth("convert", bundle, "-o", out, "--precision", "fp16", "--calibrate", files.walk, "--report", report,
                    "--verbose")
    assert result.returncode == 0, result.stderr
    said = json.loads(report.read_text())
    named = {t["name"]: t for t in said["tensors"]}
    first, second = (named[name] for name in said["ranking"][:2])
    assert first["name"] == "mesh_stage.coefficients.weights"
    assert first["rounded_to_zero"] == coefficients.size and first["clipped"] == 0 and first["snr_db"] == 0
    assert first["cost_mm"]["mean"] > 10 * second["cost_mm"]["mean"]
    assert first["range"][1] == pytest.approx(shrink * coefficients.max(), rel=1e-6)
    assert named["static_stage.pivots"]["snr_db"] is None and named["static_stage.pivots"]["cost_mm"] is None
    lines = result.stdout.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("costliest tensors"))
    assert [line.split()[0] for line in lines[start + 1:]] == said["ranking"]
    again = dcloth("convert", bundle, "-o", out, "--precision", "fp16", "--motion", files.walk, "--json")
    measured = json.loads(again.stdout)
    assert said["trials"][0].pop("calibration") == said["trials"][0]["error"]
    assert measured["trials"][0].pop("calibration") is None
    assert measured == said


@pytest.fixture
def outlier(tmp_path):
    """One element of a component at 1e5, far past all others (centimetres), in every row of the basis."""
    components = small_garment.bundle_tensors()["skeleton.basis"].astype("float32")
    readout = np.random.default_rng(5).standard_normal((len(components), len(components))).astype("float32")
    components[3, 100, 1] = 1e5
    path = tmp_path / "outlier.safetensors"
    small_garment.write_bundle(path)
    tensors, metadata = safetensors_file.read(path)
    del tensors["skeleton.basis"]
    safetensors_file.write(path, {**tensors, "skeleton.readout": readout, "skeleton.components": components}, metadata)
    return path


def test_rows_that_an_outlier_takes_are_told(dcloth, files, outlier, tmp_path):
    convert = ["-o", tmp_path / "m.dcloth", "--precision", "int8", "--rank", "full", "--json"]
    result = dcloth("convert", outlier, *convert)
    said = json.loads(result.stdout)
    basis = next(t for t in said["tensors"] if t["name"] == "displacement.basis.weights")
    assert basis["snr_db"] > 60 and basis["rounded_to_zero"] > 1000  # all is well, says the sum over all elements
    assert basis["worst_row"]["snr_db"] < 6 and basis["worst_row"]["low_count"] > 5
    warning, = said["warnings"]
    for word in ("displacement.basis.weights", f"row {basis['worst_row']['row']} ",
                 "skeleton.components[3, 100, 1] = 100000:", "clip it", "--precision auto"):
        assert word in warning
    assert result.stderr == f"warning: {warning}\n"
    for precision in ("int8", "fp16", "fp32"):
        sound = dcloth("convert", files.bundle, "-o", tmp_path / "m.dcloth", "--precision", precision, "--json")
        assert sound.stderr == "" and json.loads(sound.stdout)["warnings"] == []


def test_auto_stores_an_outlier_where_it_fits(dcloth, files, outlier, tmp_path):
    """No half float holds it: int8 loses the rest, so float32 is what is left for this tensor."""
    result = dcloth("convert", outlier, "-o", tmp_path / "m.dcloth", "--precision", "auto", "--max-error-mm", 5,
                    "--motion", files.walk, "--rank", "full", "--json")
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    warning, = said["warnings"]
    assert "displacement.basis.weights: stored as fp32" in warning and "components[3, 100, 1] = 100000" in warning
    assert said["trials"][-1]["error"]["position_mm"]["max"] <= 5
    basis = next(t for t in said["auto"]["tensors"] if t["name"] == "displacement.basis.weights")
    assert basis["format"] == "fp32" and basis["cheaper"] == "int8" and basis["cheaper_mm"] > 5


@pytest.mark.parametrize("name, matrix, at, precision", [
    ("skeleton.gru.weight_hh", "skeleton_stage", (7, 9), "int8"),
    ("skeleton.basis", "displacement", (2, 77, 1), "int8"),
    ("mesh.basis", "displacement", (4, 300, 2), "fp16"), ("mesh.mlp.2.weight", "mesh_stage", (8, 3), "fp16"),
    ("static.mlp.2.weight", "static_stage", (2, 5), "int8"), ("mesh.layers.0.w_o", "mesh_stage", (1, 2), "int8")])
def test_weights_beyond_a_format_are_named_as_the_bundle_does(dcloth, tmp_path, name, matrix, at, precision):
    weights = small_garment.bundle_tensors(width=16)[name].astype("float32")
    weights[at] = -3e38
    path = tmp_path / "b.safetensors"
    small_garment.write_bundle(path, width=16, changes={name: weights})
    result = dcloth("convert", path, "-o", tmp_path / "m.dcloth", "--precision", precision)
    refused(result, path, f"tensor {name}: found the weight", f"element {list(at)} is the largest, -3e+38")
    assert matrix not in result.stderr and "000000" not in result.stderr
    result = dcloth("convert", path, "-o", tmp_path / "m.dcloth", "--rank", "full")
    assert result.returncode == 0 and len(result.stderr.splitlines()) == 1
    for word in (matrix, "stored as fp32", f"{name}{list(at)} = -3e+38: check whether training diverged"):
        assert word in result.stderr


def test_a_model_without_its_last_stages(dcloth, files, tmp_path):
    out = tmp_path / "m.dcloth"
    convert = ["convert", files.bundle, "-o", out, "--precision", "int8", "--motion", files.walk, "--json"]
    whole = json.loads(dcloth(*convert).stdout)
    assert whole["stages"] == "mesh"
    for stages, held in (("skeleton", ["static", "skeleton"]), ("static", ["static"])):
        said = json.loads(dcloth(*convert, "--stages", stages).stdout)
        assert said["stages"] == stages and said["model_bytes"] < whole["model_bytes"]
        assert json.loads(dcloth("inspect", out, "--json").stdout)["stages"] == held
        error = said["trials"][0]["error"]["position_mm"]["max"]
        assert error > whole["trials"][0]["error"]["position_mm"]["max"]
        before = out.read_bytes()
        refused(dcloth(*convert, "--stages", stages, "--max-error-mm", 0.9 * error), "keep all stages", code=1)
        assert out.read_bytes() == before
        refused(dcloth("run", out, files.walk, "-o", tmp_path / "x.pc2", "--stages", "mesh"), "'mesh'", f"'{stages}'")
    refused(dcloth(*convert, "--stages", "last"), "'last'", "static, skeleton or mesh")


def test_without_motion_millimetres_are_not_invented(dcloth, files, tmp_path):
    result = dcloth("convert", files.bundle, "-o", tmp_path / "m", "--precision", "int8", "--report", tmp_path / "r",
                    "--verbose")
    assert "not measured" in result.stdout and "--motion" in result.stdout
    said = json.loads((tmp_path / "r").read_text())
    assert said["ranking"] is None and all(t["cost_mm"] is None for t in said["tensors"])
    assert any(t["snr_db"] is not None and 20 < t["snr_db"] < 80 for t in said["tensors"])


def test_motion_to_check_on_is_not_what_was_calibrated_on(dcloth, files, tmp_path):
    out = tmp_path / "m.dcloth"
    for more in ([], ["--precision", "auto", "--max-error-mm", "2"]):
        refused(dcloth("convert", files.bundle, "-o", out, "--motion", files.run, "--motion", files.walk, "--calibrate",
                       files.walk, *more), files.walk, "--calibrate", "--motion")
    assert not out.exists()


def test_a_bundle_for_a_model_and_a_model_for_a_bundle_are_told(dcloth, files, tmp_path):
    for command in (["inspect", files.bundle], ["run", files.bundle, files.walk, "-o", tmp_path / "x.pc2"],
                    ["profile", files.bundle, files.walk]):
        refused(dcloth(*command), files.bundle, "a safetensors file", "a .dcloth model", "dcloth convert")
    for command in (["convert", files.model, "-o", tmp_path / "m"], ["evaluate", files.model, files.walk],
                    ["run", files.model, files.model, "-o", tmp_path / "x.pc2"]):
        refused(dcloth(*command), files.model, "a .dcloth model", "a safetensors file", "bundle")
    refused(dcloth("run", files.model, files.bundle, "-o", tmp_path / "x.pc2"), files.bundle, "fps")
    assert leftovers(tmp_path, set()) == []


# --rank and --calibrate: fewer rows of the displacement basis, and what they may cost.
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


@pytest.mark.parametrize("arguments, words", [
    (("--rank", "0"), ("--rank 0",)), (("--rank", "half"), ("--rank half", "exact")), (("--rank", "12x"), ("12x",)),
    (("--rank", "4"), ("--calibrate",)), (("--rank", "auto"), ("--max-error-mm", "--calibrate"))])
def test_bad_ranks_are_refused(dcloth, files, tmp_path, arguments, words):
    refused(dcloth("convert", files.bundle, "-o", tmp_path / "m", *arguments), *words)
    assert leftovers(tmp_path, set()) == []
