"""run: outputs parse, frame rates agree by the documented rule, stages differ as they should."""
import struct

import numpy as np
import pytest

import safetensors_file
import small_garment
from checks import refused


def positions(dcloth, tmp_path, model, sequence, *arguments):
    out = tmp_path / "out.safetensors"
    result = dcloth("run", model, sequence, "-o", out, *arguments)
    assert result.returncode == 0, result.stderr
    tensors, metadata = safetensors_file.read(out)
    return tensors["positions"], metadata


def test_safetensors_output(dcloth, files, tmp_path):
    values, metadata = positions(dcloth, tmp_path, files.model, files.walk)
    assert values.shape == (40, small_garment.VERTICES, 3) and values.dtype == np.float32
    assert np.isfinite(values).all() and float(metadata["fps"]) == 30
    truth = safetensors_file.read(files.walk)[0]["truth"]
    assert np.linalg.norm(values - truth, axis=-1).mean() < 0.2  # metres: on the character, not at the origin


def test_pc2_output(dcloth, files, tmp_path):
    values, _ = positions(dcloth, tmp_path, files.model, files.walk)
    out = tmp_path / "out.pc2"
    assert dcloth("run", files.model, files.walk, "-o", out).returncode == 0
    data = out.read_bytes()
    signature, version, points, start, rate, samples = struct.unpack("<12siiffi", data[:32])
    assert signature == b"POINTCACHE2\0" and version == 1 and start == 0 and rate == 1
    assert (samples, points) == values.shape[:2] and len(data) == 32 + 12 * points * samples
    assert np.array_equal(np.frombuffer(data[32:], np.float32).reshape(values.shape), values)


def test_mdd_output_and_its_mesh(dcloth, files, tmp_path):
    values, _ = positions(dcloth, tmp_path, files.model, files.walk, "--fps", "60")
    out, mesh = tmp_path / "out.mdd", tmp_path / "out.obj"
    assert dcloth("run", files.model, files.walk, "-o", out, "--mesh", mesh, "--fps", "60").returncode == 0
    data = out.read_bytes()
    samples, points = struct.unpack(">ii", data[:8])
    assert (samples, points) == values.shape[:2] and len(data) == 8 + 4 * samples + 12 * points * samples
    assert np.array_equal(np.frombuffer(data[8:8 + 4 * samples], ">f4"), (np.arange(samples) / 60).astype(np.float32))
    assert np.array_equal(np.frombuffer(data[8 + 4 * samples:], ">f4").reshape(values.shape), values)
    lines = [line.split() for line in mesh.read_text().split("\n")]
    bind_pose = safetensors_file.read(files.bundle)[0]["template.positions"]    # which no clip decides
    assert np.array_equal(np.array([w[1:] for w in lines if w[:1] == ["v"]], np.float32), bind_pose)
    faces = safetensors_file.read(tmp_path / "out.safetensors")[0]["faces"]
    assert np.array_equal(np.array([w[1:] for w in lines if w[:1] == ["f"]], int) - 1, faces)


def test_outside_body_pushes_vertices_out(dcloth, files, tmp_path):
    wide = safetensors_file.read(files.bundle)[0]["body.positions"] * np.array([1.6, 1, 1.6], np.float32)
    small_garment.write_bundle(tmp_path / "wide.safetensors", changes={"body.positions": wide})
    assert dcloth("convert", tmp_path / "wide.safetensors", "-o", tmp_path / "wide.dcloth").returncode == 0
    plain, kept = (positions(dcloth, tmp_path, tmp_path / "wide.dcloth", files.walk, *flag)[0]
                   for flag in ((), ("--outside-body",)))
    moved = np.linalg.norm(kept - plain, axis=-1) > 1e-4
    assert 0.01 < moved.mean() < 0.9
    at = plain[moved] - np.repeat(plain.mean(1), moved.sum(1), 0)
    assert ((kept - plain)[moved] * at)[:, [0, 2]].sum(1).mean() > 0, "outwards, from the middle of the skirt"


def test_wind_is_three_numbers_and_moves_no_garment_that_does_not_read_it(dcloth, files, tmp_path):
    calm, _ = positions(dcloth, tmp_path, files.model, files.walk)
    blown, _ = positions(dcloth, tmp_path, files.model, files.walk, "--wind=-3,0.5,4e0")
    assert np.array_equal(calm, blown)
    for text in ("1,2", "1,2,3,", "1,2,x", "nan,0,0", "80,80,0", "1 2 3"):
        result = dcloth("run", files.model, files.walk, "-o", tmp_path / "out.pc2", f"--wind={text}")
        assert result.returncode == 2 and f"--wind '{text}'" in result.stderr and "X,Y,Z" in result.stderr


def test_wind_of_a_sequence_is_checked(dcloth, files, tmp_path):
    poses = safetensors_file.read(files.walk)[0]["joint_matrices"]
    path = tmp_path / "windy.safetensors"
    for wind, found in ((np.zeros((39, 3)), "[39, 3]"), (np.full((40, 3), np.nan), "NaN"),
                        (np.full((40, 3), 60), "in frame 0")):
        small_garment.write_sequence(path, poses, changes={"wind": wind.astype(np.float32)})
        result = dcloth("run", files.model, path, "-o", tmp_path / "out.pc2")
        assert result.returncode == 2 and "wind" in result.stderr and found in result.stderr, result.stderr
    small_garment.write_sequence(path, poses, changes={"wind": np.full((40, 3), 5, np.float32)})
    assert dcloth("run", files.model, path, "-o", tmp_path / "out.pc2").returncode == 0


def test_repeatable(dcloth, files, tmp_path):
    first, _ = positions(dcloth, tmp_path, files.model, files.run)
    second, _ = positions(dcloth, tmp_path, files.model, files.run)
    assert np.array_equal(first, second)


def test_stages_build_on_each_other(dcloth, files, tmp_path):
    stages = [positions(dcloth, tmp_path, files.model, files.walk, "--stages", s)[0]
              for s in ("static", "skeleton", "mesh")]
    full, _ = positions(dcloth, tmp_path, files.model, files.walk)
    assert np.array_equal(stages[2], full)
    for a, b in zip(stages, stages[1:]):
        assert np.abs(a - b).max() > 1e-4


@pytest.mark.parametrize("stages", ["static", "mesh"])
def test_60_hz_agrees_with_30_hz_at_rest(dcloth, files, tmp_path, stages):
    """With a pose that stands still only the displacement changes, and skinning is linear in it. Frame 2k is drawn as
    tick k starts, half a tick late (between ticks k - 1 and k), frame 2k + 1 half a tick later, at tick k; between two
    frames the lag leaks by a thousandth of the time (engine/src/time/frame_clock.h)."""
    still = np.repeat(small_garment.motion(1, 30), 12, axis=0)
    path = tmp_path / "still.safetensors"
    small_garment.write_sequence(path, still, truth=False)
    slow, _ = positions(dcloth, tmp_path, files.model, path, "--stages", stages)
    fast, metadata = positions(dcloth, tmp_path, files.model, path, "--stages", stages, "--fps", "60")
    assert float(metadata["fps"]) == 60 and len(fast) == 2 * len(slow) - 1
    # A coordinate of at most 2 m passes about 50 float roundings on the way (blend, 4 influences of 4 products).
    bound = 50 * 2.0 * np.finfo(np.float32).eps
    assert np.abs(fast[1::2] - slow[:-1]).max() <= bound
    leaked = 0.5e-3 * np.abs(slow[1:] - slow[:-1]).max()
    assert np.abs(fast[2::2] - (slow[1:] + slow[:-1]) / 2).max() <= bound + 1.01 * leaked
    if stages == "mesh":
        assert np.abs(np.diff(slow, axis=0)).max() > 1e-4, "the network stands still: the test shows nothing"


def test_skinning_agrees_at_tick_times_in_motion(dcloth, files, tmp_path):
    """A static stage that increments nothing has nothing to blend: frame 2k at 60 Hz is frame k at 30 Hz."""
    bundle, model = tmp_path / "b.safetensors", tmp_path / "m.dcloth"
    weight = small_garment.bundle_tensors()["static.mlp.2.weight"]
    small_garment.write_bundle(bundle, changes={"static.mlp.2.weight": 0 * weight})
    assert dcloth("convert", bundle, "-o", model).returncode == 0
    slow, _ = positions(dcloth, tmp_path, model, files.walk, "--stages", "static")
    fast, _ = positions(dcloth, tmp_path, model, files.walk, "--stages", "static", "--fps", "60")
    assert len(fast) == 2 * len(slow) - 1
    assert np.array_equal(fast[::2], slow)


def test_between_two_frames_rotations_turn_on_the_arc(dcloth, files, tmp_path):
    """The whole character turns by 90 degrees in one frame: half-way it stands at 45 and keeps its size."""
    poses = np.repeat(small_garment.motion(1, 30), 2, axis=0)
    turn = np.eye(4)
    turn[:3, :3] = small_garment.rotation([0, 1, 0], np.pi / 2)
    poses[1] = turn @ poses[0]
    path = tmp_path / "turn.safetensors"
    small_garment.write_sequence(path, poses, truth=False)
    fast, _ = positions(dcloth, tmp_path, files.model, path, "--stages", "static", "--fps", "60")
    hips = poses[0, 0, :3, 3]
    radius = [np.linalg.norm((frame - hips)[:, ::2], axis=1).mean() for frame in fast]
    # Joints off the axis move on the chord: thighs 0.1 m out lose 0.1 (1 - cos 45) = 29 mm of their place, not of their
    # size.
    assert abs(radius[1] - radius[0]) < 0.03


def test_frames_slower_than_ticks_run_every_tick(dcloth, files, tmp_path):
    fast, _ = positions(dcloth, tmp_path, files.model, files.walk)
    slow, _ = positions(dcloth, tmp_path, files.model, files.walk, "--fps", "10")
    assert np.array_equal(slow, fast[::3][:len(slow)])
    assert len(slow) == 14


def test_an_animation_is_no_sequence(dcloth, files, tmp_path):
    for name in ("walk.glb", "walk.FBX", "walk.bvh", "walk.vrm"):
        (tmp_path / name).write_bytes(b"glTF")
        refused(dcloth("run", files.model, tmp_path / name, "-o", tmp_path / "o.html"), "dcloth poses",
                "walk.safetensors", "dcloth dress")
