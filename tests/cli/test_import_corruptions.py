"""poses on named corruptions of glTF and BVH: refused by name without a file, or a sequence of finite matrices; never a
signal, also where the third-party reader crashes."""
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import import_corruptions
import safetensors_file
from test_poses import importing  # noqa: F401

DATA = Path(__file__).parent / "data"


def complaint(dcloth, folder, index, extension, blob):
    """None where `blob` is taken, the message where it is refused. What breaks a promise is raised."""
    file, out = folder / f"{index}.{extension}", folder / f"{index}.safetensors"
    file.write_bytes(blob)
    result = dcloth("poses", file, "-o", out)  # fails by itself where a signal ends the command
    if result.returncode == 0:
        matrices = safetensors_file.read(out)[0]["joint_matrices"]
        assert matrices.size > 0 and np.isfinite(matrices).all()
        return None
    assert result.returncode == 2 and result.stdout == "", (result.returncode, result.stdout)
    assert file.name in result.stderr and "found " in result.stderr and ", expected " in result.stderr, result.stderr
    assert not out.exists()
    return result.stderr


def complaints(dcloth, folder, extension, cases):
    def one(entry):
        index, (name, blob) = entry
        try:
            return complaint(dcloth, folder, index, extension, blob)
        except AssertionError as error:
            raise AssertionError(f"{extension} {name}: {error}") from error
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(one, enumerate(cases)))


@pytest.mark.parametrize("extension", ["glb", "bvh"])
def test_named_corruptions(extension, dcloth, importing, tmp_path):  # noqa: F811
    text = (DATA / "walker.bvh").read_text()
    cases = list(import_corruptions.broken_gltf() if extension == "glb" else import_corruptions.broken_bvh(text))
    answers = complaints(dcloth, tmp_path, extension, cases)
    refused = [answer for answer in answers if answer is not None]
    crashes = sum("the reader crashed" in answer for answer in refused)
    print(f"{extension}: {len(answers)} corruptions, {len(refused)} refused, {crashes} because the reader crashed")
    assert len(answers) == len(cases) >= {"glb": 200, "bvh": 60}[extension]
    assert len(answers) // 2 < len(refused) < len(answers)    # neither everything nor little


def test_a_broken_promise_is_noticed(tmp_path):
    """The check against commands that end well without a file, badly with one, or without a word."""
    class Result:
        def __init__(self, returncode, stderr=""):
            self.returncode, self.stderr, self.stdout = returncode, stderr, ""

    def leaves_a_file(*arguments):
        Path(arguments[-1]).write_bytes(b"half")
        return Result(2, "0.bvh: found a, expected b")
    words = "0.bvh: found a, expected b"
    for command in (lambda *a: Result(0), lambda *a: Result(1, words), lambda *a: Result(2, "no"), leaves_a_file):
        with pytest.raises((AssertionError, OSError)):
            complaint(command, tmp_path, 0, "bvh", b"")
