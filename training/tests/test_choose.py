"""Choosing clips by what their motion adds."""
import numpy as np
import pytest

from dcloth_training.motion import procedural, rotations, skeleton
from dcloth_training.simulate import choose
from test_clips import write_recording


def histories(name):
    motion = procedural.clip(name)
    return (choose.histories(motion, skeleton.LOWER_BODY), choose.histories(choose.mirrored(motion),
                                                                            skeleton.LOWER_BODY), len(motion))


def test_a_history_knows_neither_heading_nor_place():
    motion = procedural.clip("walk_start_stop")
    turn = rotations.about_axis("Y", np.array([1.1]))[0]
    local = motion.local.copy()
    local[:, 0] = turn @ local[:, 0]
    moved = skeleton.Motion(motion.root @ turn.T + [3, 0, -2], local)
    own, other = (choose.histories(m, skeleton.LOWER_BODY) for m in (motion, moved))
    assert np.allclose(own, other, atol=1e-4)
    assert choose.distances(own[10:11], own[:1])[0] > 0.3      # but stands or strides


def test_twins_and_mirror_images_add_nothing():
    pieces = {name: histories(name) for name in ("walk_start_stop", "kicks", "spin_left", "deep_squats")}
    walk = pieces["walk_start_stop"]
    pieces["twin"], pieces["mirror"] = walk, (walk[1], walk[0], walk[2])
    chosen = dict(choose.farthest_first(pieces))
    assert len(chosen) == len(pieces)
    assert sorted(chosen, key=chosen.get)[:2] == sorted(list(chosen)[-2:], key=chosen.get)   # two of the three, last
    assert max(list(chosen.values())[-2:]) < 1e-2 < min(list(chosen.values())[:-2])
    known = np.concatenate(walk[:2])
    first = next(choose.farthest_first(pieces, known))
    assert first[0] not in ("walk_start_stop", "twin", "mirror") and first[1] > 0.1


def test_kinds_get_as_many_frames_in_turn():
    walks = {f"walk{k}": histories("walk_start_stop") for k in range(3)}
    pieces = {**walks, "kicks": histories("kicks"), "front_kick": histories("front_kick")}
    kinds = {name: "walk" if name in walks else "kick" for name in pieces}
    longest = max(count for _, _, count in pieces.values())
    chosen = [name for name, _ in choose.farthest_first(pieces, kinds=kinds, frames=longest + 1)]
    assert {kinds[name] for name in chosen[:2]} == {"walk", "kick"}
    assert len([name for name, _ in choose.farthest_first(pieces, frames=1)]) == 1


def test_the_command_prints_pieces_and_leaves_out_who_lies(tmp_path, capsys):
    write_recording(tmp_path / "new" / "turn.bvh", 700)
    write_recording(tmp_path / "new" / "slow.bvh", 60, heading=0.001)
    write_recording(tmp_path / "other" / "turn.bvh", 60)
    (tmp_path / "index.tsv").write_text("file\tkind\nnew/turn.bvh\tturn\nnew/slow.bvh\tidle\n")
    index = ["--index", str(tmp_path / "index.tsv")]
    assert choose.main(["new/*", "--motion", str(tmp_path), *index]) == 0
    rows = [line.split("\t") for line in capsys.readouterr().out.splitlines()]
    assert {row[0] for row in rows} == {"new/turn@0", "new/turn@300", "new/slow@0"}
    assert sum(int(row[1]) for row in rows) == 760 and {row[3] for row in rows} == {"turn", "idle"}
    assert choose.main(["none/*", "--motion", str(tmp_path)]) == 2
    assert "no */*.bvh matches none/*" in capsys.readouterr().err
    (tmp_path / "index.tsv").write_text("name\tkind\n")
    assert choose.main(["new/*", "--motion", str(tmp_path), *index]) == 2
    assert "file and kind are needed" in capsys.readouterr().err


@pytest.mark.parametrize("change, hangs", [(None, True), ("lie", False), ("crawl", False)])
def test_cloth_has_to_hang(change, hangs):
    motion = procedural.clip("walk_start_stop")
    if change == "lie":
        motion.local[50, 0] = rotations.about_axis("X", np.array([np.pi / 2]))[0]
    if change == "crawl":
        motion.root[50, 1] = 0.3
    assert choose.upright(motion) == hangs
