"""Which clips become ground truth, which are held out, and which are left out and why.

A clip is named `<group>/<name>`: `procedural/...` comes from motion/procedural.py, every other
group is a folder of BVH files below the --motion folder. `<clip>@<frame>` starts at that frame;
`<clip>~<k>` is variation k of a training clip: another take of it (motion/variations.py), followed
by takes of other training clips until LONG_FRAMES are full.
"""
import fnmatch
import os
import zlib

import numpy as np

from .. import dataset
from ..motion import bvh, clearance, procedural, timing, variations, wind as winds

MAX_FRAMES = 300              # of a piece; a longer take is cut into several, but for those that are reported
LONG_FRAMES = 300             # random procedural clips and variations
LOOP_FRAMES = 75
EASE_FRAMES = 12

# The split, by person (dataset.role). Development clips: looked at while the garments were made, never trained on.
DEVELOPMENT = list(dataset.HELD_OUT)
# Who is recorded where, and what the recordings are for. Nobody is trained on of whom a clip validates or is reported.
PERSONS = (("mocap/", "actors of DeepMimic's clips", "training"), ("game/", "a stylised character", "training"),
           ("cmu/a_", "adult a", "training"), ("cmu/b_", "adult b", "training"),
           ("child/5_", "child of five", "training"),
           ("child/8_", "child of eight", "validation, reported"), ("evaluation/", "others", "measured, reported"),
           ("snu/", "an actor of Seoul National University", "training"),
           ("mesh2motion/", "an animated figure", "training"),
           ("cmu_db/", "CMU subject", "training"), ("validation/", "CMU subject", "validation"))
SEVERAL = {"actors of DeepMimic's clips", "others"}      # of PERSONS; nobody wrote down who is who
# First and last frame (exclusive) between the T-poses that takes begin and end in, as timing.between_t_poses finds
# them.
PEOPLE = {
    "child/5_catch": (43, 269), "child/5_dab": (20, 257), "child/5_glinda": (0, 205), "child/5_glinda001": (19, 281),
    "child/5_jumping": (50, 159), "child/5_mouse002": (32, 421), "child/5_mouse_2": (30, 596),
    "child/5_pick_up": (32, 227), "child/5_push_pull": (24, 324), "child/5_running": (42, 268),
    "child/5_skipping": (0, 302), "child/5_twirling": (24, 133), "child/5_walking": (29, 444),
    "child/5_wave_hello": (76, 210), "cmu/a_catch": (36, 351), "cmu/a_catch001": (25, 589), "cmu/a_dance": (34, 719),
    "cmu/a_jump_rope": (38, 543), "cmu/a_pick_something_up": (41, 415), "cmu/a_pulling": (37, 705),
    "cmu/a_pulling_1": (27, 421), "cmu/a_pushing": (21, 620), "cmu/a_pushing_1": (40, 445),
    "cmu/a_running": (33, 258), "cmu/a_skipping": (36, 323), "cmu/a_tantrum": (26, 778), "cmu/a_twirl": (40, 595),
    "cmu/a_walking": (36, 520), "cmu/a_walking001": (27, 847), "cmu/a_wave_hello_1": (26, 146),
    "cmu/a_wave_hello_2": (20, 138), "cmu/a_wave_hello_3": (0, 142), "cmu/b_walk_clap": (24, 269),
    "cmu/b_walk_clap001": (0, 257), "cmu/b_walk_point": (21, 234), "cmu/b_walk_point001": (12, 245),
    "cmu/b_walk_raise_the_roof": (43, 310), "cmu/b_walk_raise_the_roof001": (33, 318),
    "cmu/b_walk_side_point2_": (38, 286), "cmu/b_walk_side_point2_001": (36, 288), "cmu/b_walk_side_ponit": (21, 230),
    "cmu/b_walk_side_ponit001": (0, 248), "cmu/b_walk_side_punch": (28, 236), "cmu/b_walk_side_punch001": (25, 252),
    "cmu/b_walk_sway": (0, 261), "cmu/b_walk_swing_arms": (0, 225), "cmu/b_walk_swing_arms001": (28, 253),
}
CHILD_OF_EIGHT = {
    "child/8_belle002": (0, 434), "child/8_belle_dance001": (132, 896), "child/8_catch001": (80, 336),
    "child/8_dab": (45, 339), "child/8_jumping": (42, 164), "child/8_mermaid": (132, 806),
    "child/8_pick_up": (27, 459), "child/8_robot": (34, 697), "child/8_silly_walk": (39, 262),
    "child/8_skipping": (25, 263), "child/8_walk": (44, 447), "child/8_wave_hello": (38, 203),
    "child/8_zombie": (36, 779),
}
MEASURED = {
    "evaluation/bassai": (0, 1529), "evaluation/dance": (0, 432), "evaluation/dance001": (0, 376),
    "evaluation/empi001": (0, 1301), "evaluation/empi003": (0, 687), "evaluation/gedanbarai": (0, 615),
    "evaluation/heiansyodan": (0, 815), "evaluation/indian_dance_odissi005": (0, 1125),
    "evaluation/mawashigeri": (0, 368), "evaluation/oiduki001": (0, 538), "evaluation/syutouuke": (0, 500),
    "evaluation/yokogeri001": (0, 612),
}
TAKES = {**PEOPLE, **CHILD_OF_EIGHT, **MEASURED}


def pieces(takes):
    """Names of the pieces of takes, MAX_FRAMES each; the last of a take is a third shorter to a third longer."""
    out = []
    for name, (first, last) in takes.items():
        for at in range(first, max(first + 1, last - MAX_FRAMES // 3), MAX_FRAMES):
            out.append(f"{name}@{at}")
    return out


def person(name):
    """Who moves in a recorded clip; None for a scripted one."""
    who, number = next((who for prefix, who, _ in PERSONS if name.startswith(prefix)), None), dataset.subject(name)
    return f"{who} {number}" if number else who


# Ordered by how much a skirt's model needs them; a batch may be stopped anywhere.
PROCEDURAL = [f"procedural/{name}" for name in (
    "walk_start_stop", "spin_left", "sway_wide", "walk_left_turns", "jumps", "walk_weave",
    "run_start_stop", "hula_twist", "spin_both_ways", "jog_turns", "walk_slow_fast", "run_fast",
    "side_steps", "crouch_walk", "walk_about_turn", "dodges", "kicks", "walk_back_and_forth",
    "run_turn_walk", "walk_swagger", "front_kick", "deep_squats", "high_kick")]
RECORDED = [
    "mocap/walk", "game/game_running_a", "game/game_walking_a", "mocap/long_walk2",
    "mocap/dance_spin", "game/game_running_strafe_left", "game/game_dodge_right",
    "mocap/jump", "game/game_walking_backwards", "mocap/stealthy_walk", "game/game_sneaking",
    "game/game_dodge_forward", "game/game_melee_2h_attack_spinning", "mocap/punch",
    "game/game_jump_full_short", "mocap/spinkick", "game/game_melee_unarmed_attack_kick",
    "mocap/long_walk2@300", "game/game_idle_b",
    "game/game_dodge_backward", "game/game_melee_1h_attack_jump_chop",
    "game/game_melee_1h_attack_slice_horizontal", "game/game_skeletons_walking",
    "game/game_ranged_magic_summon", "game/game_melee_2h_attack_slice",
    "game/game_running_strafe_right", "game/game_throw", "game/game_hit_b",
    "game/game_melee_block_attack", "mocap/zombie_walk", "game/game_crouching",
    "game/game_skeletons_taunt", "game/game_pickup",
    "mocap/stealthy_walk0",
    "mocap/stealthy_walk0@300", "mocap/long_zombie", "mocap/long_zombie@300", "mocap/spin"]
RECORDED += pieces(PEOPLE)
VALIDATION = list(dataset.VALIDATION) + pieces({k: v for k, v in CHILD_OF_EIGHT.items() if k not in dataset.REPORTED})
MEASURED_PIECES = pieces({name: cut for name, cut in MEASURED.items() if name not in dataset.REPORTED})
REPORTED = list(dataset.REPORTED)
# Little happens to the legs here, but hips and thighs are held as other people hold them.
STANCES = [f"game/game_{name}" for name in (
    "idle_a", "hit_a", "interact", "use_item", "jump_idle", "jump_land", "jump_start",
    "melee_1h_attack_chop", "melee_1h_attack_slice_diagonal", "melee_1h_attack_stab",
    "melee_2h_attack_chop", "melee_2h_attack_stab", "melee_2h_idle", "melee_block",
    "melee_block_hit", "melee_blocking", "melee_dualwield_attack_chop",
    "melee_dualwield_attack_slice", "melee_dualwield_attack_stab", "melee_unarmed_attack_punch_a",
    "melee_unarmed_idle", "ranged_1h_aiming", "ranged_1h_reload", "ranged_1h_shoot",
    "ranged_1h_shooting", "ranged_2h_aiming", "ranged_2h_reload", "ranged_2h_shoot",
    "ranged_2h_shooting", "ranged_bow_aiming_idle", "ranged_bow_draw", "ranged_bow_draw_up",
    "ranged_bow_idle", "ranged_bow_release", "ranged_bow_release_up", "ranged_magic_raise",
    "ranged_magic_shoot", "ranged_magic_spellcasting", "ranged_magic_spellcasting_long",
    "skeletons_awaken_standing", "skeletons_idle", "running_holdingbow", "running_holdingrifle")]
# Cycles are repeated until they last LOOP_FRAMES.
CYCLES = {"mocap/walk", "mocap/run", "mocap/zombie_walk", "game/game_walking_a",
          "game/game_walking_b", "game/game_walking_backwards", "game/game_running_a",
          "game/game_running_strafe_left",
          "game/game_running_strafe_right", "game/game_skeletons_walking", "game/game_crouching",
          "game/game_sneaking", "game/game_dodge_right", "game/game_dodge_forward",
          "game/game_dodge_backward", "mocap/dance_spin", "mocap/dance_a"}
# Clips that choose the epoch to keep (dataset.VALIDATION): a variation of one among the training
# clips would make that choice blind to overfitting.
NOT_VARIED = set(dataset.VALIDATION)
RANDOM = [f"procedural/random_{seed}" for seed in range(64)]
# Take k of a clip is of kind (k - 1) % 5: near, another take by the same person; wide, by another person, three
# times as far from the recording; mixed, each leg and the arms from somewhere else: what hips and limbs do is no longer
# tied; leaning, the pelvis tilted above legs that go on as they did; lifting, a leg lifted now and then, above which
# half of the takes lean.
STRENGTHS = (1.0, 3.0, 2.0, 1.5, 1.5)
MIXED_KIND, LEANING_KIND, LIFTING_KIND = 2, 3, 4
VARIED = [clip for clip in RECORDED + STANCES + PROCEDURAL[::3] if clip not in NOT_VARIED]
VARIATIONS, WIDE, MIXED, LEANING, LIFTING = ([f"{clip}~{kind + 1}" for clip in VARIED] for kind in range(5))
# (patterns, reason): every recorded clip that is neither trained on nor held out.
LEFT_OUT = (
    ("*/roll */crawl */getup_* */game_crawling */game_push_ups */game_sit_ups */game_lie_* "
     "*/game_death_* */game_skeletons_awaken_floor* */game_skeletons_death* "
     "*/game_skeletons_spawn_ground */game_spawn_ground",
     "lying or on the ground: the garment would be crushed between body and floor, and there is "
     "no floor in the scene"),
    ("*/game_sit_*", "sitting: the garment is held by the thighs alone, without a seat"),
    ("*/backflip */cartwheel */sideflip */game_spawn_air",
     "upside down: a garment that falls over the head does not come back the same way"),
    ("*/*_mirror", "mirroring is done when training, for free"),
)


def training():
    """Procedural and recorded clips in turn: a batch stopped early still has both.

    The many random and varied clips are groups of their own: RANDOM, VARIATIONS, WIDE, MIXED, LEANING, LIFTING.
    """
    pairs = [clip for pair in zip(PROCEDURAL, RECORDED) for clip in pair]
    every = pairs + [c for c in PROCEDURAL + RECORDED + STANCES if c not in pairs]
    return [c for c in every if c not in dataset.VALIDATION]


def group(word):
    """Clips of a group's name, or the one clip of that name."""
    return {"validation": VALIDATION, "development": DEVELOPMENT, "reported": REPORTED, "measured": MEASURED_PIECES,
            "procedural": PROCEDURAL, "recorded": RECORDED, "training": training(), "random": RANDOM,
            "variations": VARIATIONS, "wide": WIDE, "mixed": MIXED, "leaning": LEANING,
            "lifting": LIFTING}.get(word, [word])


def wind(name, frames):
    """Wind [frames, 3] m/s in the world of a third of the clips that are trained on; None: calm."""
    if dataset.role(name) != "training" or zlib.crc32(b"wind" + name.encode()) % 3:
        return None
    return winds.draw(zlib.crc32(b"air" + name.encode()), frames)


def why_left_out(name):
    """The reason why a recorded clip is not used, or None if it is (or no reason is known)."""
    used = {clip.partition("@")[0] for clip in DEVELOPMENT + RECORDED + STANCES + VALIDATION + REPORTED + list(TAKES)}
    if name in used:
        return None
    return next((reason for patterns, reason in LEFT_OUT
                 if any(fnmatch.fnmatch(name, pattern) for pattern in patterns.split())), None)


def take(name, motion_folder):
    """The motion of a clip as recorded or scripted, looped, at the origin; not eased in."""
    group, _, stem = name.partition("/")
    if group == "procedural":
        motion = procedural.clip(stem)
    else:
        stem, _, first = stem.partition("@")
        if motion_folder is None:
            raise ValueError(f"clip '{name}' needs --motion, the folder that holds '{group}/'")
        motion = bvh.read_motion(os.path.join(motion_folder, group, stem + ".bvh"))
        begin, end = TAKES.get(f"{group}/{stem}", (0, len(motion)))
        whole = f"{group}/{stem}" in dataset.REPORTED
        motion = motion[max(begin, int(first or 0)):end]
        if not whole and len(motion) > MAX_FRAMES + MAX_FRAMES // 3:
            motion = motion[:MAX_FRAMES]
        if name in CYCLES:
            motion = timing.loop(motion, LOOP_FRAMES)
    return timing.to_origin(motion)


def _takes(first, pool, kind, generator, motion_folder):
    """A take of clip `first` (None: any), joined by takes of others until LONG_FRAMES are full."""
    motion = None
    while motion is None or len(motion) < LONG_FRAMES:
        chosen = first or pool[generator.integers(len(pool))]
        varied = variations.vary(take(chosen, motion_folder), int(generator.integers(1 << 31)), STRENGTHS[kind])
        if kind == LIFTING_KIND:
            varied = variations.lift_legs(varied, generator)
        if kind == LEANING_KIND or (kind == LIFTING_KIND and generator.integers(2)):
            varied = variations.lean(varied, generator)
        motion = variations.join(motion, varied) if motion else varied
        first = None
    return motion[:LONG_FRAMES]


def _variation(name, motion_folder):
    """The numbered take of the named clip: near, wide, mixed, leaning or lifting."""
    base, _, number = name.partition("~")
    if base not in training() or base in NOT_VARIED or not number.isdigit():
        raise ValueError(f"clip '{name}': only training clips that do not validate are varied, as "
                         f"<clip>~<number>, e.g. '{VARIATIONS[0]}'")
    generator, kind = np.random.default_rng(seed(name)), (int(number) - 1) % len(STRENGTHS)
    pool = [clip for clip in (RECORDED + STANCES if motion_folder else PROCEDURAL)
            if clip not in NOT_VARIED]
    motion = _takes(base, pool, kind, generator, motion_folder)
    if kind == MIXED_KIND:
        legs = [_takes(None, pool, kind, generator, motion_folder) for _ in range(2)]
        motion = variations.with_legs_of(motion, *legs)
        motion = variations.with_arms_of(motion, _takes(None, pool, kind, generator, motion_folder))
    return motion


def load(name, motion_folder=None):
    """The finished motion of a clip: at the origin, eased in, arms clear of the body.

    Pieces are of 400 frames at most, reported clips whole.
    """
    if "~" in name:
        motion, frames = _variation(name, motion_folder), LONG_FRAMES
    elif name.startswith("procedural/random_"):
        motion, frames = procedural.clip(name.partition("/")[2]), LONG_FRAMES
        generator = np.random.default_rng([0x6F, seed(name)])   # scripts neither lean nor turn their thighs
        motion = timing.to_origin(variations.offset_joints(motion, generator, max(STRENGTHS)))
    else:
        motion, frames = take(name, motion_folder), None
    return clearance.clear(timing.ease_in(motion, EASE_FRAMES)[:frames])


def seed(name):
    """The number a made-up or varied clip is drawn from; None for a recording as it is."""
    if "~" in name:
        return zlib.crc32(name.encode())
    stem = name.partition("/")[2]
    if stem in procedural.SCRIPTS:
        return procedural.SCRIPTS[stem][0]
    return int(stem[len("random_"):]) if name.startswith("procedural/random_") else None


def file_stem(name):
    return name.replace("/", "-").replace("@", "-from").replace("~", "-take")
