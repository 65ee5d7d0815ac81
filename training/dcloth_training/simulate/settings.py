"""What the ground truth's cloth is made of, and how it is simulated.

Fabrics are described by what a laboratory measures; `python3 -m dcloth_training.simulate.fabric` measures the simulated
cloth the same way (README.md, the fabric tests).
"""
from ..motion.skeleton import FPS

WOOL = {
    "density": 0.24,        # kg/m^2, a light suiting
    "stretch": 3000.0,      # N/m along the threads
    "bias": 40.0,           # N/m at 45 degrees: woven cloth shears
    "compression": 0.05,
    "bend": 1.85e-5,        # N m
    "damping": 25.0,        # 1/s
    "friction": 0.25,
}
COTTON = {**WOOL, "density": 0.13, "bend": 1.4e-5, "friction": 0.3}
SOLVER = {
    "steps": 30,
    "stretch_passes": 7,
    "frame_seconds": 1.0 / FPS,
    "gravity": 9.81,
    "drag_normal": 1.3,     # a flat plate across the flow: 1.1 to 2
    "drag_tangent": 0.03,   # skin friction
    "air_density": 1.2,
    "thickness": 0.004,
    "layer_thickness": 0.005,
    "max_speed": 30.0,
    "tether": 1.01,
}
FABRICS = {"wool": WOOL, "cotton": COTTON}
REACH_FRAMES = 20                  # T-pose to the clip's first pose
HOLD_FRAMES = 30                   # first pose held until the garment rests


def of(fabric, **changes):
    """All settings of a simulation of `fabric` (a name in FABRICS), with single ones changed, e.g. steps=20."""
    out = {**SOLVER, **FABRICS[fabric]}
    unknown = set(changes) - set(out)
    if unknown:
        raise ValueError(f"unknown settings {sorted(unknown)}; known: {', '.join(out)}")
    return {**out, **changes}
