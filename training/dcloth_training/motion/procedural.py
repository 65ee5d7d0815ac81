"""Procedural clips: short scripts of gait parameters over time, seeded and reproducible.

A script lists (seconds, {parameter: value}) keys; values glide smoothly from key to key. The
seed varies speeds, step length and phase by a few per cent, so one script yields many clips.
Names starting with `demo_` are held out: never train on them. `random_<seed>` is a chain of random
segments (random_script.py), RANDOM_FRAMES long.
"""
import numpy as np

from . import gait, random_script
from .skeleton import FPS

# name -> (seed, phase at the start, events, keys). Speeds m/s, turn rad/s, lengths m.
SCRIPTS = {
    # Held out: what the public demo shows.
    "demo_walk_turn": (101, 0.10, (), [
        (0.0, {}), (0.4, {}), (1.1, {"forward": 1.25}), (1.9, {"forward": 1.3, "turn": 0.0}),
        (2.3, {"turn": 1.7}), (3.0, {"forward": 1.1, "turn": 1.7}),
        (3.4, {"forward": 1.35, "turn": -0.3}), (3.8, {"turn": -1.3}),
        (4.3, {"forward": 1.2, "turn": -1.3}), (4.7, {"forward": 0.0, "turn": 0.0})]),
    "demo_sway_spin": (102, 0.0, (("jump", 4.05, 0.10),), [
        (0.0, {"sway_rate": 0.85}), (0.5, {"sway": 0.055, "twist": 0.18, "arms": 0.25}),
        (1.5, {"sway": 0.055, "twist": 0.18, "turn": 0.0}),
        (2.1, {"sway": 0.0, "twist": 0.0, "turn": 4.5, "arms": 0.55}),
        (2.8, {"turn": 4.5, "arms": 0.55}), (3.4, {"turn": 0.0, "arms": 0.25}),
        (5.0, {"arms": 0.15})]),
    "demo_run_stop": (103, 0.55, (("jump", 2.0, 0.08),), [
        (0.0, {}), (0.35, {}), (1.3, {"forward": 2.7}), (2.5, {"forward": 3.1, "turn": 0.0}),
        (2.9, {"turn": -1.1, "forward": 2.6}), (3.3, {"turn": 0.0, "forward": 0.0, "lean": -0.04}),
        (3.8, {"lean": 0.0, "left": 0.0}), (4.3, {"left": 0.65})]),
    "demo_jump_spin": (104, 0.0, (("jump", 0.9, 0.17), ("jump", 3.1, 0.11)), [
        (0.0, {}), (1.3, {"turn": 0.0, "arms": 0.0}), (2.0, {"turn": -3.4, "arms": 0.45}),
        (2.5, {"turn": -3.4, "forward": 0.0}), (3.0, {"turn": 0.0, "arms": 0.3}),
        (3.5, {"forward": 0.9, "sway": 0.0}), (4.1, {"forward": 0.0, "sway": 0.045})]),
    # Training.
    "walk_start_stop": (1, 0.0, (), [
        (0.0, {}), (0.3, {}), (1.0, {"forward": 1.1}), (2.2, {"forward": 1.2}),
        (2.8, {"forward": 0.0}), (3.2, {"forward": 0.0}), (3.9, {"forward": 1.5}),
        (4.6, {"forward": 1.5})]),
    "walk_slow_fast": (2, 0.3, (), [
        (0.0, {"forward": 0.6}), (1.2, {"forward": 0.7}), (2.0, {"forward": 1.6}),
        (3.4, {"forward": 1.75}), (4.4, {"forward": 0.9, "stride": 1.1})]),
    "walk_left_turns": (3, 0.6, (), [
        (0.0, {"forward": 1.1}), (0.7, {"turn": 0.0}), (1.1, {"turn": 1.4}), (2.0, {"turn": 1.4}),
        (2.4, {"turn": 0.1, "forward": 1.3}), (3.0, {"turn": 2.2, "forward": 0.9}),
        (3.7, {"turn": 2.2}), (4.2, {"turn": 0.0, "forward": 1.2})]),
    "walk_weave": (4, 0.2, (), [
        (0.0, {"forward": 1.2}), (0.5, {"turn": 1.6}), (1.1, {"turn": 1.6}),
        (1.7, {"turn": -1.6}), (2.3, {"turn": -1.6}), (2.9, {"turn": 1.9}),
        (3.5, {"turn": 1.9, "forward": 1.5}), (4.1, {"turn": -2.0}), (4.6, {"turn": 0.0})]),
    "walk_about_turn": (5, 0.0, (), [
        (0.0, {}), (0.3, {"forward": 0.3}), (0.9, {"forward": 1.2}),
        (1.7, {"forward": 1.1, "turn": 0.0}), (2.1, {"forward": 0.2, "turn": 4.2}),
        (2.5, {"forward": 0.3, "turn": 4.0}), (2.9, {"forward": 1.2, "turn": 0.0}),
        (3.9, {"forward": 1.2}), (4.4, {"forward": 0.0})]),
    "jog_turns": (6, 0.1, (), [
        (0.0, {}), (0.8, {"forward": 2.0}), (1.6, {"forward": 2.4, "turn": 0.0}),
        (2.0, {"turn": 1.3}), (2.8, {"turn": 1.3}), (3.4, {"turn": -1.0, "forward": 2.1}),
        (4.2, {"turn": 0.0, "forward": 2.2})]),
    "run_start_stop": (7, 0.4, (), [
        (0.0, {}), (0.3, {}), (1.2, {"forward": 3.2}), (2.3, {"forward": 3.4}),
        (3.2, {"forward": 0.0}), (3.8, {"forward": 0.0})]),
    "run_fast": (8, 0.7, (), [
        (0.0, {"forward": 2.4}), (1.0, {"forward": 3.8}), (2.2, {"forward": 4.1, "turn": 0.0}),
        (2.7, {"turn": 0.9}), (3.4, {"turn": 0.0, "forward": 3.0})]),
    "spin_left": (9, 0.0, (), [
        (0.0, {}), (0.3, {"turn": 0.0}), (0.9, {"turn": 3.0, "arms": 0.4}),
        (1.8, {"turn": 4.8, "arms": 0.6}), (2.5, {"turn": 4.6}),
        (3.1, {"turn": 0.0, "arms": 0.2}), (3.6, {"turn": 0.0})]),
    "spin_both_ways": (10, 0.5, (), [
        (0.0, {}), (0.7, {"turn": 2.4, "arms": 0.5}), (1.3, {"turn": 2.4}), (2.1, {"turn": -3.8}),
        (2.9, {"turn": -4.2}), (3.5, {"turn": 0.6, "arms": 0.2}), (4.3, {"turn": 0.0})]),
    "sway_wide": (11, 0.0, (), [
        (0.0, {"sway_rate": 0.7}), (0.6, {"sway": 0.06, "twist": 0.15}),
        (2.4, {"sway": 0.075, "twist": 0.25}), (3.0, {"sway_rate": 1.1, "sway": 0.05}),
        (4.4, {"sway_rate": 1.1, "sway": 0.05, "twist": 0.1})]),
    "hula_twist": (12, 0.0, (), [
        (0.0, {"sway_rate": 0.9, "arms": 0.5}), (0.6, {"sway": 0.05, "circle": -0.05}),
        (1.9, {"sway": 0.06, "circle": -0.06, "twist": 0.0}),
        (2.5, {"sway": 0.01, "circle": 0.0, "twist": 0.45}),
        (3.8, {"twist": 0.5, "sway_rate": 1.15}), (4.3, {"twist": 0.0})]),
    "jumps": (13, 0.0, (("jump", 0.75, 0.12), ("jump", 1.95, 0.24), ("jump", 3.2, 0.08)), [
        (0.0, {}), (2.6, {"forward": 0.0}), (3.0, {"forward": 0.7}), (3.6, {"forward": 0.5}),
        (4.1, {"forward": 0.0})]),
    "crouch_walk": (14, 0.2, (), [
        (0.0, {}), (0.7, {"crouch": 0.22}), (1.1, {"crouch": 0.18, "forward": 0.0}),
        (1.6, {"forward": 0.8}), (2.8, {"crouch": 0.2, "forward": 0.9}),
        (3.3, {"crouch": 0.0, "forward": 1.2}), (4.1, {"crouch": 0.0}),
        (4.5, {"crouch": 0.3, "forward": 0.2, "lean": 0.15})]),
    "side_steps": (15, 0.0, (), [
        (0.0, {}), (0.7, {"left": 0.8}), (1.5, {"left": 0.9}), (2.3, {"left": -1.0}),
        (3.0, {"left": -1.0}), (3.5, {"left": 0.0}), (4.0, {"left": 0.7, "forward": 0.8}),
        (4.6, {"left": 0.0, "forward": 0.0})]),
    "dodges": (16, 0.3, (), [
        (0.0, {}), (0.4, {}), (0.65, {"left": 2.2, "crouch": 0.1}), (0.8, {"left": 2.2}),
        (1.1, {"left": 0.0, "crouch": 0.02}), (1.6, {"left": 0.0, "forward": 0.0}),
        (1.85, {"left": -2.4, "crouch": 0.12}), (2.05, {"left": -2.2}),
        (2.4, {"left": 0.0, "crouch": 0.0}), (2.8, {"forward": 0.0}),
        (3.05, {"forward": -2.0, "crouch": 0.1}), (3.2, {"forward": -1.8}),
        (3.6, {"forward": 0.0, "crouch": 0.0}), (4.0, {})]),
    "kicks": (17, 0.0, (("kick_left", 0.9, 0.45), ("kick_right", 2.1, 0.60),
                        ("kick_left", 3.3, 0.30)), [
        (0.0, {}), (0.5, {"lean": 0.0}), (0.9, {"lean": -0.2, "crouch": 0.03}),
        (1.4, {"lean": 0.0, "turn": 0.0}), (2.1, {"lean": -0.25, "crouch": 0.03, "turn": 0.8}),
        (2.7, {"lean": 0.0, "crouch": 0.0, "turn": 0.0}), (3.3, {"forward": 0.4, "lean": -0.1}),
        (3.9, {"lean": 0.0, "forward": 0.0})]),
    "deep_squats": (21, 0.0, (), [
        (0.0, {}), (0.4, {}), (1.3, {"crouch": 0.42, "lean": 0.12, "width": 0.05, "arms": 0.3}),
        (1.7, {"crouch": 0.42}), (2.5, {"crouch": 0.0, "lean": 0.0}), (2.7, {"crouch": 0.0}),
        (3.4, {"crouch": 0.50, "lean": 0.18, "width": 0.05, "arms": 0.3}), (3.7, {"crouch": 0.50, "lean": 0.18}),
        (4.4, {"crouch": 0.0, "lean": 0.0, "width": 0.0, "arms": 0.0})]),
    "front_kick": (22, 0.0, (("kick_right", 1.2, 0.85), ("kick_left", 2.9, 0.95)), [
        (0.0, {}), (0.8, {"lean": 0.0}), (1.2, {"lean": -0.12, "crouch": 0.02}), (1.7, {"lean": 0.0, "crouch": 0.0}),
        (2.5, {"lean": 0.0}), (2.9, {"lean": -0.15, "crouch": 0.02}), (3.4, {"lean": 0.0, "crouch": 0.0})]),
    "high_kick": (23, 0.0, (("kick_left", 1.2, 1.25), ("kick_right", 3.0, 1.4)), [
        (0.0, {}), (0.8, {"lean": 0.0}), (1.2, {"lean": -0.25, "crouch": 0.02, "arms": 0.4}),
        (1.7, {"lean": 0.0, "crouch": 0.0}), (2.6, {"lean": 0.0}), (3.0, {"lean": -0.3, "crouch": 0.02, "arms": 0.4}),
        (3.5, {"lean": 0.0, "crouch": 0.0, "arms": 0.1})]),
    "walk_back_and_forth": (18, 0.8, (), [
        (0.0, {"forward": -0.6}), (1.2, {"forward": -0.8}), (1.9, {"forward": 0.9}),
        (2.9, {"forward": 1.4}), (3.5, {"forward": 0.0}), (4.2, {"forward": -0.9})]),
    "walk_swagger": (19, 0.4, (), [
        (0.0, {"forward": 0.9, "sway_rate": 0.93}), (0.8, {"sway": 0.035, "forward": 1.0}),
        (2.4, {"sway": 0.04}), (3.0, {"turn": -0.8, "sway": 0.03}), (3.9, {"turn": 0.6}),
        (4.4, {"turn": 0.0})]),
    "run_turn_walk": (20, 0.2, (("jump", 3.5, 0.10),), [
        (0.0, {"forward": 1.0}), (0.9, {"forward": 2.9, "turn": 0.0}), (1.5, {"turn": -1.8}),
        (2.1, {"turn": -1.8}), (2.7, {"turn": 0.0, "forward": 1.4}),
        (3.6, {"forward": 1.2, "turn": 1.0}), (4.3, {"turn": 0.0})]),
}
HELD_OUT = tuple(name for name in SCRIPTS if name.startswith("demo_"))
TRAINING = tuple(name for name in SCRIPTS if not name.startswith("demo_"))


TAIL_FRAMES = 18              # after the last key: the garment swings out
SCRIPT_FRAMES = 150
RANDOM_FRAMES = 300
_RANDOM = "random_"


def tracks(keys, frames, generator):
    """Keyed parameters -> smooth tracks {name: [frames]}; each eases in and out at its keys."""
    time = np.arange(frames) / FPS
    out = {}
    for name, rest in gait.PARAMETERS.items():
        own = [(at, values[name]) for at, values in keys if name in values]
        scale = 1.0 + generator.uniform(-0.04, 0.04)
        if not own or own[0][0] > 0.0:
            own.insert(0, (0.0, rest))
        value = np.full(frames, own[0][1], dtype=np.float64)
        for (t0, v0), (t1, v1) in zip(own, own[1:]):
            value += (v1 - v0) * gait.smooth_step((time - t0) / (t1 - t0))
        out[name] = value * scale
    return out


def clip(name, frames=None, seed=None):
    """The scripted clip `name`, at most `frames` long; its own seed unless one is given.

    `random_<seed>` is made up on the spot and is exactly `frames` long (RANDOM_FRAMES).
    """
    number = name[len(_RANDOM):]
    if name.startswith(_RANDOM) and number.isdigit():
        own_seed, frames = int(number), frames or RANDOM_FRAMES
        phase, events, keys = random_script.script(own_seed, frames / FPS)
    elif name in SCRIPTS:
        own_seed, phase, events, keys = SCRIPTS[name]
        frames = min(frames or SCRIPT_FRAMES, int(keys[-1][0] * FPS) + TAIL_FRAMES)
    else:
        raise ValueError(f"no procedural clip '{name}', expected random_<seed> or one of "
                         f"{sorted(SCRIPTS)}")
    generator = np.random.default_rng(own_seed if seed is None else seed)
    made = tracks(keys, frames, generator)
    return gait.pose(made, phase + generator.uniform(0, 0.1), events)
