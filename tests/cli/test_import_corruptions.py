"""poses and body on named corruptions of glTF and BVH: refused by name without a file, or a sequence of finite matrices
and a body of shares; never a signal, also where the third-party reader crashes, and memory in proportion to the file,
whatever it claims to hold."""
import os
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import import_corruptions
import safetensors_file

DATA = Path(__file__).parent / "data"
# What a command may have in memory at most: itself, the reader's allowance (tools/character/memory_limit.cc) and room.
PEAK_BYTES, PEAK_BYTES_PER_BYTE = 512 << 20, 128


@pytest.fixture(scope="module")
def measured(binary):
    """As `dcloth`, with the most memory that the command or its child had, in bytes."""
    def call(*arguments):
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            process = subprocess.Popen([binary, *map(str, arguments)], stdout=out, stderr=err)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            assert process.returncode >= 0, f"killed by signal {-process.returncode}: {arguments}"
            out.seek(0), err.seek(0)
            result = subprocess.CompletedProcess(arguments, process.returncode, out.read(), err.read())
        result.peak_bytes = usage.ru_maxrss * 1024
        return result
    return call


def check_sequence(tensors):
    assert tensors["joint_matrices"].size > 0 and np.isfinite(tensors["joint_matrices"]).all()


def check_body(tensors):
    vertices, weights = tensors["body_vertices"], tensors["body_weights"]
    assert np.isfinite(vertices).all() and np.isfinite(tensors["joint_bind"]).all()
    assert weights.shape == (len(vertices), len(tensors["joint_bind"])) and weights.min() >= 0
    assert np.abs(weights.sum(1) - 1).max() < 1e-5
    faces = tensors["body_faces"]
    assert faces.size > 0 and 0 <= faces.min() <= faces.max() < len(vertices)


CHECKS = {"poses": check_sequence, "body": check_body}


def complaint(dcloth, command, folder, index, extension, blob):
    """None where `blob` is taken, the message where it is refused. What breaks a promise is raised."""
    file, out = folder / f"{index}.{extension}", folder / f"{index}.safetensors"
    file.write_bytes(blob)
    result = dcloth(command, file, "-o", out)  # fails by itself where a signal ends the command
    assert result.peak_bytes <= PEAK_BYTES + PEAK_BYTES_PER_BYTE * len(blob), f"{result.peak_bytes >> 20} MiB"
    if result.returncode == 0:
        CHECKS[command](safetensors_file.read(out)[0])
        return None
    assert result.returncode == 2 and result.stdout == "", (result.returncode, result.stdout)
    assert file.name in result.stderr and "found " in result.stderr and ", expected " in result.stderr, result.stderr
    assert not out.exists()
    return result.stderr


def complaints(dcloth, command, folder, extension, cases):
    def one(entry):
        index, (name, blob) = entry
        try:
            return complaint(dcloth, command, folder, index, extension, blob)
        except AssertionError as error:
            raise AssertionError(f"{command} {extension} {name}: {error}") from error
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(one, enumerate(cases)))


@pytest.mark.parametrize("command, extension, least",
                         [("poses", "glb", 200), ("poses", "bvh", 60), ("body", "glb", 180)])
def test_named_corruptions(command, extension, least, measured, importing, tmp_path):
    if command == "body":
        cases = list(import_corruptions.broken_skins())
    elif extension == "glb":
        cases = list(import_corruptions.broken_gltf())
    else:
        cases = list(import_corruptions.broken_bvh((DATA / "walker.bvh").read_text()))
    answers = complaints(measured, command, tmp_path, extension, cases)
    refused = [answer for answer in answers if answer is not None]
    crashes = sum("the reader crashed" in answer for answer in refused)
    print(f"{command} {extension}: {len(answers)} corruptions, {len(refused)} refused, {crashes} because the reader "
          "crashed")
    assert len(answers) == len(cases) >= least
    assert len(answers) // 2 < len(refused) < len(answers)    # neither everything nor little


def test_a_broken_promise_is_noticed(tmp_path):
    """The check against commands that end well without a file, badly with one, without a word, or take too much."""
    class Result:
        def __init__(self, returncode, stderr="", peak_bytes=0):
            self.returncode, self.stderr, self.stdout, self.peak_bytes = returncode, stderr, "", peak_bytes

    def leaves_a_file(*arguments):
        Path(arguments[-1]).write_bytes(b"half")
        return Result(2, "0.bvh: found a, expected b")
    words = "0.bvh: found a, expected b"
    for command in (lambda *a: Result(0), lambda *a: Result(1, words), lambda *a: Result(2, "no"), leaves_a_file,
                    lambda *a: Result(2, words, 2 * PEAK_BYTES)):
        with pytest.raises((AssertionError, OSError)):
            complaint(command, "poses", tmp_path, 0, "bvh", b"")
