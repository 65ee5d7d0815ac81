"""Solver settings of the ground truth, and why they are what they are.

They are chosen for repeatability, not for the prettiest single simulation: a network can only
learn what two nearly equal simulations agree on (README.md, predictability floor).
"""
import copy

GROUND_TRUTH = {
    "cloth": {
        "quality": 12,             # substeps a frame; 16 gave the same floor, at 1.2 times the cost
        "mass": 0.1,
        "air_damping": 1.5,         # terminal speed 2 m/s; at 3 a walk lifts the skirt 50 degrees
        "tension_stiffness": 15.0,
        "compression_stiffness": 15.0,
        "shear_stiffness": 10.0,
        "bending_stiffness": 8.0,  # 40 brought the chaos back
        "tension_damping": 10.0,
        "compression_damping": 10.0,
        "shear_damping": 8.0,
        "bending_damping": 2.0,
    },
    "collision": {
        "use_collision": True,
        "collision_quality": 1,
        "distance_min": 0.006,
        "use_self_collision": False,
    },
    "collider": {
        "thickness_outer": 0.012,  # a 4 mm shell is crossed in one substep and traps cloth
        "thickness_inner": 0.25,
        "cloth_friction": 0.0,     # friction sticks and slips: chaotic
        "damping": 0.5,
    },
}
REACH_FRAMES = 12                  # T-pose to the clip's first pose
HOLD_FRAMES = 12                   # first pose held until the garment rests
DRAPE_FRAMES = 60                  # bind pose, for the template


def with_changes(**changes):
    """A copy of GROUND_TRUTH with single settings changed, e.g. quality=20."""
    out = copy.deepcopy(GROUND_TRUTH)
    for name, value in changes.items():
        places = [group for group in out.values() if name in group]
        if len(places) != 1:
            raise ValueError(f"unknown setting '{name}'")
        places[0][name] = value
    return out
