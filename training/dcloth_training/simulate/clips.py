"""Which clips become ground truth, which are held out, and which are left out and why.

A clip is named `<group>/<name>`: `procedural/...` comes from motion/procedural.py, every other
group is a folder of BVH files below the --motion folder.
"""
import os

from ..motion import bvh, procedural, timing

MAX_FRAMES = 150
LOOP_FRAMES = 75
EASE_FRAMES = 12

HELD_OUT = ["procedural/demo_walk_turn", "procedural/demo_sway_spin", "mocap/run",
            "game/game_walking_b", "mocap/dance_a", "mocap/long_walk1"]
# Ordered by how much a skirt's model needs them; a batch may be stopped anywhere.
PROCEDURAL = [f"procedural/{name}" for name in (
    "walk_start_stop", "spin_left", "sway_wide", "walk_left_turns", "jumps", "walk_weave",
    "run_start_stop", "hula_twist", "spin_both_ways", "jog_turns", "walk_slow_fast", "run_fast",
    "side_steps", "crouch_walk", "walk_about_turn", "dodges", "kicks", "walk_back_and_forth",
    "run_turn_walk", "walk_swagger")]
RECORDED = [
    "mocap/walk", "game/game_running_a", "game/game_walking_a", "mocap/long_walk2",
    "mocap/dance_spin", "game/game_running_strafe_left", "mocap/spin", "game/game_dodge_right",
    "mocap/jump", "game/game_walking_backwards", "mocap/stealthy_walk", "game/game_sneaking",
    "game/game_dodge_forward", "game/game_melee_2h_attack_spinning", "mocap/punch",
    "game/game_jump_full_short", "mocap/spinkick", "game/game_melee_unarmed_attack_kick",
    "game/game_running_holdingrifle", "mocap/long_walk2@300", "game/game_idle_b",
    "game/game_dodge_backward", "game/game_melee_1h_attack_jump_chop",
    "game/game_melee_1h_attack_slice_horizontal", "game/game_skeletons_walking",
    "mocap/stealthy_walk0@200", "game/game_ranged_magic_summon", "game/game_melee_2h_attack_slice",
    "game/game_running_strafe_right", "game/game_throw", "game/game_hit_b",
    "game/game_melee_block_attack", "mocap/zombie_walk", "game/game_crouching",
    "game/game_skeletons_taunt", "game/game_pickup"]
# Cycles are repeated until they last LOOP_FRAMES.
CYCLES = {"mocap/walk", "mocap/run", "mocap/zombie_walk", "game/game_walking_a",
          "game/game_walking_b", "game/game_walking_backwards", "game/game_running_a",
          "game/game_running_holdingrifle", "game/game_running_strafe_left",
          "game/game_running_strafe_right", "game/game_skeletons_walking", "game/game_crouching",
          "game/game_sneaking", "game/game_dodge_right", "game/game_dodge_forward",
          "game/game_dodge_backward", "mocap/dance_spin", "mocap/dance_a"}
LEFT_OUT = {
    "long_walk1_mirror, long_walk2_mirror": "mirroring is done when training, for free",
    "roll, crawl, getup_facedown, getup_faceup, game_crawling, game_push_ups, game_sit_ups, "
    "game_lie_*, game_death_*, game_skeletons_awaken_floor*, game_skeletons_death*, "
    "game_skeletons_spawn_ground, game_spawn_ground": "lying or on the ground: the skirt would be "
    "crushed between body and floor, and there is no floor in the scene",
    "game_sit_*": "sitting: the skirt is held by the thighs alone, without a seat",
    "backflip, cartwheel, sideflip, game_spawn_air": "upside down: a skirt without "
    "self-collision turns inside out and does not come back the same way",
    "game_melee_block*, game_ranged_* (others), game_*_idle (others), game_interact, "
    "game_use_item, game_hit_a, stab, chop": "legs all but still or a near copy of a clip in the list",
    "long_zombie, rest of long_walk2 and stealthy_walk0": "more of what is already there",
}


def training():
    """Procedural and recorded clips in turn: a batch stopped early still has both."""
    pairs = [clip for pair in zip(PROCEDURAL, RECORDED) for clip in pair]
    return pairs + [c for c in PROCEDURAL + RECORDED if c not in pairs]


def load(name, motion_folder=None):
    """The finished motion of a clip: at the origin, looped, eased in, at most MAX_FRAMES.

    `name@frame` starts at that frame of the recording.
    """
    group, _, stem = name.partition("/")
    if group == "procedural":
        motion = procedural.clip(stem, MAX_FRAMES)
    else:
        stem, _, first = stem.partition("@")
        if motion_folder is None:
            raise ValueError(f"clip '{name}' needs --motion, the folder that holds '{group}/'")
        motion = bvh.read_motion(os.path.join(motion_folder, group, stem + ".bvh"))
        motion = motion[int(first or 0):]
        if name in CYCLES:
            motion = timing.loop(motion, LOOP_FRAMES)
    motion = timing.to_origin(motion[:MAX_FRAMES])
    return timing.ease_in(motion, EASE_FRAMES)[:MAX_FRAMES]


def file_stem(name):
    return name.replace("/", "-").replace("@", "-from")
