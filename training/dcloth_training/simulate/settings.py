"""Solver settings of the ground truth, and why they are what they are.

They are chosen for repeatability, not for the prettiest single simulation: a network can only
learn what two nearly equal simulations agree on (README.md, predictability floor).
"""
from ..motion.skeleton import FPS

GROUND_TRUTH = {
    "steps": 30,
    "frame_seconds": 1.0 / FPS,
    "density": 0.25,               # kg/m^2, a light wool
    "stretch_compliance": 1e-6,    # m/N: stiff; what stretch is left comes from two passes a step
    "bend_stiffness": 100.0,
    "brace_stiffness": 3.0,        # without it a pose has many drapes: dents stay where a leg once was (README.md)
    "drag_normal": 10.0,           # 1/s; at 5 a run's floor is three times as high
    "drag_tangent": 10.0,
    "air_follows": 1.0,            # with braces over four edges a run's floor was twice as high in still air
    "smoothing": 1000.0,           # 1/s: a full average with the neighbours every fourth step
    "thickness": 0.008,
    "contact_drag": 5.0,           # viscous: Coulomb friction sticks and slips
    "tether": 1.0,
}
REACH_FRAMES = 12                  # T-pose to the clip's first pose
HOLD_FRAMES = 18                   # first pose held until the garment rests
DRAPE_FRAMES = 60                  # bind pose, for the template


def with_changes(**changes):
    """A copy of GROUND_TRUTH with single settings changed, e.g. steps=20."""
    unknown = set(changes) - set(GROUND_TRUTH)
    if unknown:
        raise ValueError(f"unknown settings {sorted(unknown)}; known: {', '.join(GROUND_TRUTH)}")
    return {**GROUND_TRUTH, **changes}
