"""Pose of the humanoid from slowly changing gait parameters, for all frames at once.

The feet follow a stepping cycle (stance: straight back at walking speed; swing: a cubic that meets
it with equal slope), the pelvis bobs, tilts and twists on top, and two-bone inverse kinematics
joins them. Every ingredient is C1 in time, so joint velocities never jump.
"""
import numpy as np
from scipy.interpolate import PchipInterpolator

from . import retarget, rotations
from .skeleton import (ANKLE_HEIGHT, FPS, HIP_HEIGHT, INDEX, NAMES, OFFSETS, Motion,
                       SHIN_LENGTH, SPINE, THIGH_LENGTH)

HEEL = 0.045                   # metres from the ankle back to where the heel touches the ground
# Parameter tracks and their rest values. Speeds in m/s, turn in rad/s, lengths in m, angles rad.
PARAMETERS = {"forward": 0.0, "left": 0.0, "turn": 0.0, "crouch": 0.0, "lean": 0.0,
              "sway": 0.0, "sway_rate": 0.7, "circle": 0.0, "twist": 0.0, "arms": 0.0,
              "stride": 1.0, "width": 0.0}


def smooth_step(x):
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def soft_positive(x, width):
    """max(x, 0) with a rounded corner."""
    return 0.5 * (x + np.sqrt(x * x + width * width)) - 0.5 * width


def _foot_cycle(phase, duty):
    """Foot position along the step, -0.5..0.5, and lift 0..1, at `phase` in 0..1."""
    stance = 0.5 - phase / duty
    q = np.clip((phase - duty) / (1 - duty), 0.0, 1.0)
    slope = -(1 - duty) / duty
    swing = (-0.5 * (2 * q ** 3 - 3 * q ** 2 + 1) + slope * (q ** 3 - 2 * q ** 2 + q)
             + 0.5 * (-2 * q ** 3 + 3 * q ** 2) + slope * (q ** 3 - q ** 2))
    return np.where(phase < duty, stance, swing), np.sin(np.pi * q) ** 2


def _integral(rate):
    """Running sum over frames, trapezoid rule; starts at zero."""
    return np.concatenate([0 * rate[:1], np.cumsum(0.5 * (rate[1:] + rate[:-1]), 0)])


def _periodic(phase, keys):
    """C1 curve through (phase, value) keys, repeated."""
    x, y = np.array(keys).T
    return PchipInterpolator(np.concatenate([x - 1, x, x + 1]), np.tile(y, 3))(phase % 1.0)


def _ankle_over(pitch):
    """How much higher the ankle is over a foot that stands on its ball (pitch > 0) or its heel than over a flat one."""
    ball = OFFSETS[INDEX["LeftToeBase"]]
    on_ball = ball[1] * (1 - np.cos(pitch)) + ball[2] * np.sin(pitch)
    on_heel = -ANKLE_HEIGHT * (1 - np.cos(pitch)) - HEEL * np.sin(pitch)
    return np.maximum(np.maximum(on_ball, on_heel), 0)


def _leg(hips, hip_position, ankle, foot_world):
    """Two-bone inverse kinematics; the knee bends forward. -> thigh, shin, foot rotations."""
    reach = np.einsum("tij,ti->tj", hips, ankle - hip_position)  # world -> pelvis
    distance = np.linalg.norm(reach, axis=1)
    # Stretching towards a straight leg slows down smoothly instead of locking the knee.
    full, soft = THIGH_LENGTH + SHIN_LENGTH, 0.97 * (THIGH_LENGTH + SHIN_LENGTH)
    room = 0.997 * full - soft
    over = np.maximum(distance - soft, 0.0)
    length = np.where(over > 0, soft + room * (1 - np.exp(-over / room)), distance)
    length = np.maximum(length, 0.25)
    cosine = (length ** 2 - THIGH_LENGTH ** 2 - SHIN_LENGTH ** 2) / (2 * THIGH_LENGTH * SHIN_LENGTH)
    knee = np.arccos(np.clip(cosine, -1, 1))
    behind = rotations.arctan2(SHIN_LENGTH * np.sin(knee), THIGH_LENGTH + SHIN_LENGTH * np.cos(knee))
    # Swing first: a leg that is kicked over the hips' height turns on without a jump.
    outward = np.arcsin(np.clip(reach[:, 0] / np.maximum(distance, 1e-6), -0.999, 0.999))
    swing = rotations.arctan2(reach[:, 2], -reach[:, 1])
    thigh = (rotations.about_axis("X", -swing) @ rotations.about_axis("Z", outward)
             @ rotations.about_axis("X", -behind))
    shin = rotations.about_axis("X", knee)
    foot = (hips @ thigh @ shin).transpose(0, 2, 1) @ foot_world
    return thigh, shin, foot


def pose(tracks, phase_start=0.0, events=()):
    """tracks {name: [T]} (see PARAMETERS), events [(kind, seconds, size)] -> Motion.

    Events: ("jump", take-off time, height m), ("kick_left" | "kick_right", time, foot height m).
    """
    p = {name: np.asarray(tracks[name], dtype=np.float64) for name in PARAMETERS}
    frames, dt = len(p["forward"]), 1.0 / FPS
    time = np.arange(frames) * dt
    heading = dt * _integral(p["turn"])
    facing = rotations.about_axis("Y", heading)
    velocity = np.stack([p["left"], 0 * time, p["forward"]], -1)
    world_velocity = np.einsum("tij,tj->ti", facing, velocity)
    ground = dt * _integral(world_velocity)

    speed = np.sqrt(p["forward"] ** 2 + p["left"] ** 2 + 1e-4) - 0.01
    run = smooth_step((speed - 1.7) / 1.0)
    active = smooth_step(speed / 0.8 + np.abs(p["turn"]) / 2.5)
    cadence = (0.72 + 0.22 * np.minimum(speed, 4) + 0.10 * np.abs(p["turn"])) / p["stride"]
    duty = 0.62 - 0.25 * run
    phase = phase_start + dt * _integral(cadence)
    travel = np.minimum(speed * duty / cadence, 0.95) * 0.92  # slides a little, reaches less
    direction = velocity / np.maximum(speed, 0.05)[:, None] * smooth_step(speed / 0.1)[:, None]

    jump = np.zeros(frames)
    fold = np.zeros(frames)  # knees bent before take-off and after landing
    for kind, at, height in events:
        if kind == "jump":
            air = np.sqrt(8 * height / 9.81)
            u = (time - at) / air
            jump += soft_positive(4 * height * u * (1 - u), 0.04) * (np.abs(u - 0.5) < 1.0)
            for centre, width in ((at - 0.14, 0.30), (at + air + 0.12, 0.32)):
                fold += 0.16 * np.cos(np.clip((time - centre) / width, -1, 1) * np.pi / 2) ** 2

    wave = 2 * np.pi * phase
    beat = 2 * np.pi * dt * _integral(p["sway_rate"])
    bob = active * (0.017 + 0.023 * run) * -np.cos(2 * wave - 2.6 * run) - 0.07 * travel ** 2
    height = HIP_HEIGHT - 0.010 - p["crouch"] - 0.015 * run + bob - fold + jump
    aside = -0.022 * active * (1 - run) * np.sin(wave - 0.3) + p["sway"] * np.sin(beat)
    ahead = p["circle"] * np.cos(beat)
    root = ground + np.einsum("tij,tj->ti", facing, np.stack([aside, height, ahead], -1))
    stride = travel / 0.6
    yaw = -0.13 * stride * np.cos(wave) + p["twist"] * np.sin(beat + 0.6)
    roll = 0.055 * active * np.sin(wave - 0.4) - 1.3 * p["sway"] * np.sin(beat)
    pitch = 0.03 + 0.05 * run + 0.35 * p["crouch"] + p["lean"] + 0.6 * fold
    hips = (facing @ rotations.about_axis("Y", yaw) @ rotations.about_axis("Z", roll)
            @ rotations.about_axis("X", pitch))

    local = np.tile(np.eye(3), (frames, len(NAMES), 1, 1))
    local[:, 0] = hips
    for side, sign, own_phase in (("Left", 1.0, phase), ("Right", -1.0, phase + 0.5)):
        step, lift = _foot_cycle(own_phase % 1.0, duty)
        bend = stride * smooth_step(p["forward"] / 0.5) * _periodic(
            own_phase - duty + 0.62,
            ((0.0, -0.22), (0.14, 0.0), (0.36, 0.02), (0.62, 0.75), (0.86, 0.0)))
        up = active * (0.045 + 0.05 * np.minimum(speed, 1.5) + 0.12 * run) * lift
        up = up + _ankle_over(bend) + 0.85 * soft_positive(jump - 0.03, 0.04)
        side_ways = sign * (abs(OFFSETS[INDEX["LeftUpLeg"], 0]) - 0.018 + p["width"])
        place = direction * (travel * step)[:, None]
        place = place + np.stack([side_ways, ANKLE_HEIGHT + up, -0.01 - 0.06 * run], -1)
        bend = bend + 3.5 * soft_positive(jump - 0.03, 0.04)
        for kind, at, size in events:
            if kind == f"kick_{side.lower()}":
                raised = np.cos(np.clip((time - at) / 0.42, -1, 1) * np.pi / 2) ** 2
                place = place + raised[:, None] * np.array([0.0, size, min(0.75 * size + 0.1, 0.62)])
                bend = bend - 0.5 * raised
        ankle = ground + np.einsum("tij,tj->ti", facing, place)
        joint = INDEX[f"{side}UpLeg"]
        hip_position = root + hips @ OFFSETS[joint]
        out = 0.10 * sign
        foot_world = (facing @ rotations.about_axis("Y", out)
                      @ rotations.about_axis("X", np.minimum(bend, 1.0)))
        local[:, joint], local[:, joint + 1], local[:, joint + 2] = _leg(
            hips, hip_position, ankle, foot_world)
        local[:, joint + 3] = retarget.toes(foot_world)

        arm = INDEX[f"{side}Arm"]
        swing = -0.40 * np.minimum(stride, 1.3) * np.cos(2 * np.pi * own_phase) + 0.10
        swing = swing - 0.25 * run + 2.5 * p["sway"] * np.sin(beat + 0.9 * sign)
        raise_up = 1.36 - 1.05 * p["arms"] - 1.7 * soft_positive(jump, 0.04)
        whole = (rotations.about_axis("X", swing * (1 - 0.6 * p["arms"]))
                 @ rotations.about_axis("Z", -sign * raise_up))
        local[:, arm - 1] = retarget.shoulder(whole, sign)
        local[:, arm] = np.swapaxes(local[:, arm - 1], -1, -2) @ whole
        flex = 0.30 + 1.05 * run - 0.15 * p["arms"] + 0.15 * stride * np.cos(2 * np.pi * own_phase)
        local[:, arm + 1] = rotations.about_axis("Y", -sign * flex)
    chest = (rotations.about_axis("Y", -1.5 * yaw) @ rotations.about_axis("Z", -0.8 * roll)
             @ rotations.about_axis("X", 0.03 + 0.04 * run - 0.25 * p["crouch"]))
    neck = rotations.about_axis("Y", 0.5 * yaw) @ rotations.about_axis("X", -0.4 * pitch)
    local[:, [INDEX[name] for name in SPINE]] = retarget.split(chest, len(SPINE))[:, None]
    local[:, [INDEX["Neck"], INDEX["Head"]]] = retarget.split(neck, 2)[:, None]
    return Motion(root, local)
