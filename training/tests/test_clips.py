"""Clip lists: the split by person, pieces of takes, variations, wind, names and reasons."""
import string

import numpy as np
import pytest

from dcloth_training import dataset
from dcloth_training.motion import procedural, rotations, skeleton, timing, wind
from dcloth_training.motion.skeleton import INDEX
from dcloth_training.simulate import clips

LEARNED = (clips.training() + clips.RANDOM + clips.VARIATIONS + clips.WIDE + clips.MIXED + clips.LEANING
           + clips.LIFTING)


def base(name):
    return name.partition("~")[0].partition("@")[0]


def test_nobody_who_validates_or_is_reported_is_trained_on():
    assert len(clips.training()) > 150 and len(clips.REPORTED) == 10
    learned = {clips.person(name) for name in LEARNED} - {None}
    assert learned == {"actors of DeepMimic's clips", "a stylised character", "adult a", "adult b", "child of five"}
    reported = {clips.person(name) for name in clips.REPORTED}
    assert reported == {"child of eight", "others"} and not reported & learned
    # Children of eight validate; two takes of people that training knows choose as well, and are not trained on.
    validating = {clips.person(name) for name in clips.VALIDATION} - {None}
    assert "child of eight" in validating
    assert not {base(name) for name in clips.VALIDATION} & {base(name) for name in LEARNED}
    assert not {base(name) for name in clips.REPORTED} & {base(name) for name in clips.VALIDATION}
    assert not {base(name) for name in clips.MEASURED_PIECES + clips.DEVELOPMENT} & {base(name) for name in LEARNED}


def test_a_subject_of_the_cmu_database_is_one_person_wherever_the_clip_lies():
    taught, chosen = "cmu_db/cmu007_12_00@0", "validation/cmu131_13a_00@300~2"
    assert [clips.person(name) for name in (taught, chosen)] == ["CMU subject 007", "CMU subject 131"]
    assert clips.person("cmu_db/cmuztrain-running-1_00") == "CMU subject z"     # nobody knows who that is
    assert [dataset.role(name) for name in (taught, chosen)] == ["training", "validation"]
    assert dataset.role("cmu_db/cmu131_14_00") == "validation" and dataset.subject("cmu/a_walking") is None
    assert {clips.person(name) for name in ("snu/snubox_001_00", "snu/snuwd2_092_00@0")} == \
        {"an actor of Seoul National University"}
    assert {dataset.role(name) for name in ("snu/snubox_001_00", "mesh2motion/m2m_Push-Loop_00")} == {"training"}


@pytest.mark.parametrize("group, role", [("REPORTED", "reported"), ("VALIDATION", "validation"),
                                         ("DEVELOPMENT", "development"), ("MEASURED_PIECES", "development")])
def test_the_data_set_knows_what_each_clip_is_for(group, role):
    names = getattr(clips, group)
    assert len(names) >= 7 and {dataset.role(name) for name in names} == {role}
    assert {dataset.role(name) for name in LEARNED} == {"training"}


def test_every_list_is_disjoint_and_every_file_name_plain():
    everything = LEARNED + clips.VALIDATION + clips.DEVELOPMENT + clips.MEASURED_PIECES + clips.REPORTED
    assert len({clips.file_stem(c) for c in everything}) == len(everything)
    assert all(set(clips.file_stem(c)) <= set(string.ascii_letters + string.digits + "_-") for c in everything)
    assert {name.partition("/")[2] for name in clips.PROCEDURAL} == set(procedural.TRAINING)
    for name in ("training", "validation", "development", "reported", "measured", "random", "wide"):
        assert len(clips.group(name)) > 5
    assert clips.group("mocap/walk") == ["mocap/walk"]


def test_pieces_cover_a_take_once():
    for name, (first, last) in clips.TAKES.items():
        starts = [int(piece.partition("@")[2]) for piece in clips.pieces({name: (first, last)})]
        assert starts[0] == first and last - starts[-1] <= clips.MAX_FRAMES + clips.MAX_FRAMES // 3
        assert (np.diff(starts) == clips.MAX_FRAMES).all() and last - starts[-1] >= 70


def write_recording(path, frames, heading=0.01):
    """A recording of 15 joints that turns on the spot: where a frame is from can be told by its heading."""
    from dcloth_training.motion import retarget
    parents = [-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 0, 12, 13]
    lines = []

    def joint(j, depth):
        pad = " " * depth
        x, y, z = retarget.OFFSETS[j]
        channels = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation" if j == 0 else \
            "3 Zrotation Xrotation Yrotation"
        lines.extend([f"{pad}{'ROOT' if j == 0 else 'JOINT'} {retarget.NAMES[j]}", pad + "{",
                      f"{pad}OFFSET {x} {y} {z}", f"{pad}CHANNELS {channels}"])
        below = [k for k, parent in enumerate(parents) if parent == j]
        for k in below:
            joint(k, depth + 1)
        if not below:
            lines.extend([pad + "End Site", pad + "{", pad + "OFFSET 0 0 0", pad + "}"])
        lines.append(pad + "}")

    joint(0, 0)
    rows = [" ".join(map(str, [0, 0.88, 0, 0, 0, np.degrees(heading * t)] + 42 * [0])) for t in range(frames)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("HIERARCHY\n" + "\n".join(lines) + f"\nMOTION\nFrames: {frames}\nFrame Time: 0.0333333\n"
                    + "\n".join(rows) + "\n")


def turned(motion):
    return np.unwrap(rotations.heading_of(motion.local[:, 0]))[-1]


def test_pieces_follow_on_each_other_and_a_reported_clip_is_whole(tmp_path):
    length = clips.PEOPLE["cmu/a_walking001"][1]
    write_recording(tmp_path / "cmu" / "a_walking001.bvh", length)
    write_recording(tmp_path / "child" / "8_walk.bvh", clips.TAKES["child/8_walk"][1] + 30)
    names = clips.pieces({"cmu/a_walking001": clips.TAKES["cmu/a_walking001"]})
    assert len(names) == 3
    frames = [len(clips.load(name, str(tmp_path))) for name in names]
    ease = clips.EASE_FRAMES // 2
    assert frames[0] == frames[1] == clips.MAX_FRAMES + ease
    assert sum(frames) == length - clips.TAKES["cmu/a_walking001"][0] + 3 * ease
    assert turned(clips.load(names[0], str(tmp_path))) == pytest.approx(0.01 * (clips.MAX_FRAMES - 1), abs=0.02)
    first, last = clips.TAKES["child/8_walk"]
    assert len(clips.load("child/8_walk", str(tmp_path))) == last - first + ease
    with pytest.raises(ValueError, match="needs --motion"):
        clips.load("cmu/a_walking001@27")


def test_a_take_is_cut_where_its_t_poses_end():
    motion = skeleton.rest_motion(100)
    down = np.clip(np.minimum(np.arange(100) - 20, 90 - np.arange(100)) / 10, 0, 1)
    for side, sign in (("Left", -1), ("Right", 1)):
        motion.local[:, INDEX[side + "Arm"]] = rotations.about_axis("Z", sign * 1.2 * down)
    first, last = timing.between_t_poses(timing.turn(motion, 2.0))
    assert 24 < first < 30 and 80 < last < 86
    assert timing.between_t_poses(skeleton.rest_motion(5)) == (0, 0)
    assert timing.between_t_poses(procedural.clip("jumps"))[0] == 0


def test_variations_are_full_length_reproducible_and_of_training_clips_alone():
    first, again = clips.load("procedural/spin_left~2"), clips.load("procedural/spin_left~2")
    assert len(first) == clips.LONG_FRAMES and np.array_equal(first.local, again.local)
    other = clips.load("procedural/spin_left~1")
    assert np.abs(first.local - other.local).max() > 0.1
    assert len(clips.load("procedural/random_3")) == clips.LONG_FRAMES
    for name in (*clips.DEVELOPMENT, *clips.NOT_VARIED, *clips.REPORTED, clips.VALIDATION[-1], "mocap/roll",
                 clips.MEASURED_PIECES[0]):
        with pytest.raises(ValueError, match="only training clips"):
            clips.load(name + "~1", "unused")
    with pytest.raises(ValueError, match="only training clips"):
        clips.load("procedural/spin_left~x")


def test_takes_go_from_near_to_wide_to_mixed():
    for kind in (clips.VARIATIONS, clips.WIDE, clips.MIXED, clips.LEANING, clips.LIFTING):
        assert len(kind) == len(clips.VARIED) and len({c.partition("~")[2] for c in kind}) == 1
    near, wide, mixed, lifting = (clips.load(f"procedural/kicks~{take}") for take in (1, 2, 3, 5))
    for take in (near, wide, mixed, lifting):
        assert len(take) == clips.LONG_FRAMES
        assert np.abs(np.diff(take.root, axis=0)).max() * 30 < 12
    assert np.abs(wide.local - near.local).max() > 0.1


def test_lifting_takes_hold_a_thigh_up_in_more_of_their_frames():
    def up(take):
        thighs = clips.load(f"procedural/walk_start_stop~{take}").local[:, [INDEX["LeftUpLeg"], INDEX["RightUpLeg"]]]
        return (thighs[..., 1, 1].min(1) < np.cos(np.radians(60))).mean()

    shares = [up(take) for take in (1, 2, 4, 5)]
    assert shares[3] > 0.1 > 2 * max(shares[:3]), shares


def test_left_out_clips_have_a_reason_and_used_ones_have_none():
    assert "upside down" in clips.why_left_out("mocap/cartwheel")
    assert "ground" in clips.why_left_out("game/game_death_b")
    for used in ("game/game_idle_b", "mocap/long_walk2", "mocap/spin", "mocap/spinkick", "game/game_running_holdingbow",
                 "evaluation/yokogeri001", "child/8_mermaid", "cmu/a_pick_something_up", "a/unheard"):
        assert clips.why_left_out(used) is None
    assert all(word in " ".join(reason for _, reason in clips.LEFT_OUT) for word in ("lying", "sitting", "upside down"))


def test_a_third_of_what_is_trained_on_is_in_wind_and_nothing_else():
    blown = [name for name in LEARNED if clips.wind(name, 30) is not None]
    assert 0.28 < len(blown) / len(LEARNED) < 0.39
    for name in clips.REPORTED + clips.VALIDATION + clips.DEVELOPMENT + clips.MEASURED_PIECES:
        assert clips.wind(name, 30) is None
    first, again = clips.wind(blown[0], 50), clips.wind(blown[0], 50)
    assert first.shape == (50, 3) and np.array_equal(first, again)
    assert not np.allclose(first, clips.wind(blown[1], 50))


def test_wind_is_steady_or_gusts_or_turns_and_never_a_storm():
    drawn = np.stack([wind.draw(seed, 300) for seed in range(120)])
    speed = np.linalg.norm(drawn, axis=-1)
    assert speed.max() <= wind.FASTEST + 1e-9 and (speed > 7.9).any() and speed.mean(1).min() < 2
    assert np.abs(drawn[..., 1]).max() < 0.5 * speed.max()                   # nearly level
    share = speed.std(1) / speed.mean(1)
    assert 0.15 < (share < 0.03).mean() < 0.5                                # a third is steady
    heading = np.unwrap(np.arctan2(drawn[..., 0], drawn[..., 2]), axis=1)
    assert 0.15 < (np.abs(heading[:, -1] - heading[:, 0]) > 2).mean() < 0.55   # a third turns
    calm_side = np.arctan2(*drawn[:, 0, [0, 2]].T)
    assert np.abs(np.mean(np.exp(1j * calm_side))) < 0.25                    # from all sides


def test_gusts_come_and_go_within_seconds():
    """Speeds half a second apart are alike, three seconds apart they are not."""
    speed = np.stack([np.linalg.norm(wind.draw(seed, 600), axis=-1) for seed in range(100)])
    gusty = speed[(speed.std(1) / speed.mean(1) > 0.2)]
    assert len(gusty) > 30
    change = gusty - gusty.mean(1, keepdims=True)

    def alike(frames):
        return (change[:, frames:] * change[:, :-frames]).mean() / (change ** 2).mean()
    assert alike(3) > 0.8 and 0.3 < alike(15) < 0.75 and abs(alike(90)) < 0.25


def test_no_network_learns_from_a_reported_clip_or_is_chosen_by_it(tmp_path):
    (tmp_path / "dynamic").mkdir()
    for stem in ("child-8_walk", "child-8_walk-from44", "child-8_dab-from45", "evaluation-dance",
                 "evaluation-bassai-from0", "mocap-jump", "cmu-a_dance-from34"):
        (tmp_path / "dynamic" / f"{stem}.safetensors").touch()
    found = [path.split("/")[-1].partition(".")[0] for path in dataset.find(str(tmp_path), "dynamic")]
    assert found == ["child-8_dab-from45", "cmu-a_dance-from34", "mocap-jump"]

    def clip(name):
        return dataset.Clip(name, name, False, None, None, None)
    training, validation = dataset.split([clip("child/8_dab@45"), clip("child/8_zombie@36"), clip("mocap/jump")],
                                         ["child/8_dab@45"])
    assert [c.name for c in training] == ["mocap/jump"] and [c.name for c in validation] == ["child/8_dab@45"]
    _, validation = dataset.split([clip("child/8_dab@45"), clip("mocap/jump")], dataset.VALIDATION_TAKES)
    both = [clip("validation/cmu061_01_00@0"), clip("cmu_db/cmu007_12_00@0")]
    assert [[c.name for c in part] for part in dataset.split(both, ["validation/"])] == [[c.name] for c in both[::-1]]
    assert [c.name for c in validation] == ["child/8_dab@45"]
    assert set(dataset.VALIDATION_TAKES) == {base(name) for name in clips.VALIDATION} - set(dataset.VALIDATION)
    for given, chosen in ((["child/8_walk@41", "mocap/jump"], []), (["mocap/jump"], ["evaluation/dance"])):
        with pytest.raises(ValueError, match=r"is for the final figures alone: no network is trained on it"):
            dataset.split([clip(name) for name in given], chosen)
