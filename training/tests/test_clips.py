"""Clip lists: the fixed split, variations, names and reasons."""
import string

import numpy as np
import pytest

from dcloth_training import dataset
from dcloth_training.simulate import clips


def test_the_split_is_the_promised_one_and_every_list_is_disjoint():
    assert len(clips.HELD_OUT) == 8 and len(clips.training()) >= 45
    assert sum(c.startswith("procedural/demo_") for c in clips.HELD_OUT) == 4
    assert {c for c in clips.HELD_OUT if not c.startswith("procedural/")} == {
        "mocap/dance_a", "mocap/run", "game/game_walking_b", "mocap/long_walk1"}
    assert set(dataset.HELD_OUT) == set(clips.HELD_OUT)
    assert set(dataset.VALIDATION) <= clips.NOT_VARIED
    everything = (clips.HELD_OUT + clips.training() + clips.RANDOM + clips.VARIATIONS + clips.WIDE
                  + clips.MIXED + clips.LEANING)
    assert len({clips.file_stem(c) for c in everything}) == len(everything)
    assert all(set(clips.file_stem(c)) <= set(string.ascii_letters + string.digits + "_-")
               for c in everything)
    bases = {c.partition("~")[0] for c in clips.VARIATIONS}
    assert len(bases) > 35 and bases <= set(clips.training()) - clips.NOT_VARIED


def test_variations_are_full_length_reproducible_and_never_of_a_held_out_clip():
    first, again = clips.load("procedural/spin_left~2"), clips.load("procedural/spin_left~2")
    assert len(first) == clips.LONG_FRAMES and np.array_equal(first.local, again.local)
    other = clips.load("procedural/spin_left~1")
    assert np.abs(first.local - other.local).max() > 0.1
    assert len(clips.load("procedural/random_3")) == clips.LONG_FRAMES
    for name in (*clips.HELD_OUT, *clips.NOT_VARIED, "mocap/long_walk1@200", "mocap/roll"):
        with pytest.raises(ValueError, match="only training clips"):
            clips.load(name + "~1", "unused")
    with pytest.raises(ValueError, match="only training clips"):
        clips.load("procedural/spin_left~x")


def test_takes_go_from_near_to_wide_to_mixed():
    base = "procedural/kicks"
    for kind in (clips.VARIATIONS, clips.WIDE, clips.MIXED, clips.LEANING):
        assert len(kind) == len(clips.VARIED) and len({c.partition("~")[2] for c in kind}) == 1
    near, wide, mixed = (clips.load(f"{base}~{take}") for take in (1, 2, 3))
    for take in (near, wide, mixed):
        assert len(take) == clips.LONG_FRAMES
        assert np.abs(np.diff(take.root, axis=0)).max() * 30 < 12
    assert np.abs(wide.local - near.local).max() > 0.1


def test_left_out_clips_have_a_reason_and_used_ones_have_none():
    assert "upside down" in clips.why_left_out("mocap/cartwheel")
    assert "ground" in clips.why_left_out("game/game_death_b")
    assert "snap" in clips.why_left_out("game/game_running_holdingbow")
    assert all(clips.why_left_out(c) is None for c in ("game/game_idle_b", "game/game_idle_a"))
    assert clips.why_left_out("mocap/long_walk2") is None and clips.why_left_out("a/unheard") is None
