"""Point caches: what is written is read; what is damaged is refused with file, frame and how to mend it."""
import os

import numpy as np
import pytest

import cache_files
from dcloth_training import safetensors_io
from dcloth_training.truth import alembic, cache, obj
from dcloth_training.truth.errors import TruthError

DATA = os.path.join(os.path.dirname(__file__), "data")
POLYGONS = [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6), (4, 5, 8), (4, 8, 7)]


@pytest.fixture
def positions():
    grid = np.array([[x, 0.0, y] for y in range(3) for x in range(3)])
    return (grid + np.random.default_rng(5).normal(0, 0.1, (7, 9, 3))).astype(np.float32)


def test_point_caches_come_back_to_the_bit(positions, tmp_path):
    cache_files.write_pc2(tmp_path / "a.pc2", positions, start=11)
    cache_files.write_mdd(tmp_path / "a.mdd", positions, fps=60, first=0.5)
    pc2, mdd = cache.read_pc2(str(tmp_path / "a.pc2")), cache.read_mdd(str(tmp_path / "a.mdd"))
    assert np.array_equal(pc2.positions, positions) and pc2.seconds is None and pc2.frames[0] == 11
    assert np.array_equal(mdd.positions, positions) and mdd.positions.dtype == np.float32
    assert np.abs(mdd.seconds - (0.5 + np.arange(7) / 60)).max() < 1e-6      # float32 seconds below 1


def test_obj_sequence(positions, tmp_path):
    pattern = cache_files.write_obj_sequence(tmp_path / "seq", positions, POLYGONS, first=98)   # past 100: not by text
    read = obj.read_sequence(pattern)
    assert np.array_equal(read.positions, positions) and read.polygons == POLYGONS and read.frames[-1] == 104


def test_alembic_of_our_own(positions, tmp_path):
    path = tmp_path / "a.abc"
    cache_files.write_alembic(path, positions, POLYGONS, fps=24, first=1 / 24)
    read = alembic.read(str(path))
    assert np.array_equal(read.positions, positions)
    assert np.allclose(read.seconds, np.arange(1, 8) / 24, rtol=0, atol=1e-12)
    assert [tuple(reversed(p)) for p in read.polygons] == POLYGONS


def test_alembic_that_blender_wrote():
    """Under a moving, turning, scaled parent, with vertices that move too; beside another mesh."""
    truth, _ = safetensors_io.read(os.path.join(DATA, "blender_cloth.safetensors"))
    read = alembic.read(os.path.join(DATA, "blender_cloth.abc"), "Cloth")
    wanted = truth["world"][..., [0, 2, 1]] * np.float32([1, 1, -1])          # Blender's axes to Alembic's
    assert read.positions.shape == (12, 30, 3)
    # Points of at most 4 m pass two float32 matrices and one product of them on the way: some 8 roundings.
    assert np.abs(read.positions - wanted).max() < 8 * 4 * np.finfo(np.float32).eps
    assert np.abs(np.diff(read.positions, axis=0)).max() > 0.05
    assert np.allclose(read.seconds, np.arange(1, 13) / 30, rtol=0, atol=1e-9)
    faces = [tuple(f.tolist()) for f in truth["faces"]]
    assert {_turned(tuple(reversed(p))) for p in read.polygons} == {_turned(f) for f in faces}


def _turned(polygon):
    at = polygon.index(min(polygon))
    return polygon[at:] + polygon[:at]


def test_alembic_asks_which_mesh():
    with pytest.raises(TruthError, match="/Floor/Floor, /Mover/Cloth/Cloth.*mesh"):
        alembic.read(os.path.join(DATA, "blender_cloth.abc"))
    with pytest.raises(TruthError, match="named 'Shirt'"):
        alembic.read(os.path.join(DATA, "blender_cloth.abc"), "Shirt")


@pytest.mark.parametrize("read, name", [(cache.read_pc2, "a.pc2"), (cache.read_mdd, "a.mdd"), (alembic.read, "a.abc")])
def test_every_cut_is_refused(read, name, positions, tmp_path):
    path = tmp_path / name
    {"a.pc2": lambda: cache_files.write_pc2(path, positions), "a.mdd": lambda: cache_files.write_mdd(path, positions),
     "a.abc": lambda: cache_files.write_alembic(path, positions, POLYGONS)}[name]()
    read(str(path))
    whole, short = path.read_bytes(), tmp_path / f"short{name[1:]}"
    for size in range(0, len(whole), 13):
        short.write_bytes(whole[:size])
        with pytest.raises(TruthError):
            read(str(short))


def test_damaged_alembic_is_refused_or_read_never_more(positions, tmp_path):
    """Every byte set to 255, one by one: an error of ours, or finite numbers in the right shape."""
    path, damaged = tmp_path / "a.abc", tmp_path / "b.abc"
    cache_files.write_alembic(path, positions[:2], POLYGONS)
    whole, refused = path.read_bytes(), 0
    for at in range(len(whole)):
        damaged.write_bytes(whole[:at] + b"\xff" + whole[at + 1:])
        try:
            read = alembic.read(str(damaged))
            assert read.positions.ndim == 3 and np.isfinite(read.positions).all()
        except TruthError:
            refused += 1
    assert refused > 100


def test_alembic_in_hdf5_is_named(tmp_path):
    path = tmp_path / "a.abc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    with pytest.raises(TruthError, match="HDF5.*Ogawa"):
        alembic.read(str(path))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e9])
def test_numbers_beyond_reason_name_frame_and_vertex(value, positions, tmp_path):
    positions[4, 7, 1] = value
    cache_files.write_pc2(tmp_path / "a.pc2", positions, start=100)
    with pytest.raises(TruthError, match="frame 104.*vertex 7"):
        cache.read_pc2(str(tmp_path / "a.pc2"))


def test_obj_sequence_faults(positions, tmp_path):
    pattern = cache_files.write_obj_sequence(tmp_path / "seq", positions, POLYGONS)
    cache_files.write_obj(tmp_path / "seq" / "cloth_0005.obj", positions[4], POLYGONS[::-1])
    with pytest.raises(TruthError, match="cloth_0005.obj: frame 5.*faces of other vertices.*order"):
        obj.read_sequence(pattern)
    os.unlink(tmp_path / "seq" / "cloth_0005.obj")
    with pytest.raises(TruthError, match="no file of frame 5"):
        obj.read_sequence(pattern)
    with pytest.raises(TruthError, match="0 files"):
        obj.read_sequence(str(tmp_path / "none_*.obj"))


@pytest.mark.parametrize("text, found", [
    ("v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n", ":3.*v x y z"), ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "vertex 4.*1 to 3"),
    ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n", ":4"), ("v 0 0 0\n", "0 faces"), ("v 0 0 x\n", ":1")])
def test_bad_meshes(text, found, tmp_path):
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(TruthError, match=found):
        obj.read_mesh(str(tmp_path / "a.obj"))


def test_mdd_whose_clock_runs_back(positions, tmp_path):
    cache_files.write_mdd(tmp_path / "a.mdd", positions)
    blob = bytearray((tmp_path / "a.mdd").read_bytes())
    blob[8 + 4 * 3:8 + 4 * 4] = bytes(4)
    (tmp_path / "a.mdd").write_bytes(bytes(blob))
    with pytest.raises(TruthError, match="times that ascend"):
        cache.read_mdd(str(tmp_path / "a.mdd"))
