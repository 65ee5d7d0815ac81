"""Wind for a clip: steady, gusts, turning; up to 8 m/s.

Gusts are random and slow, as turbulence near the ground is: a first-order process with a time scale of about a second
on the speed, and a slower one on the direction.
"""
import numpy as np

from .skeleton import FPS

FASTEST = 8.0        # m/s
GUST_SECONDS, TURN_SECONDS = 0.8, 2.5
KINDS = ("steady", "gusts", "turning")


def _wandering(generator, frames, seconds):
    """[frames] of a first-order random process of deviation 1."""
    keep = np.exp(-1 / (seconds * FPS))
    noise = generator.standard_normal(frames) * np.sqrt(1 - keep ** 2)
    out, at = np.empty(frames), generator.standard_normal()
    for k in range(frames):
        at = keep * at + noise[k]
        out[k] = at
    return out


def draw(seed, frames):
    """The seed's wind [frames, 3], world m/s, nearly level, no faster than FASTEST."""
    generator = np.random.default_rng([0x3D, seed])
    kind = KINDS[generator.integers(len(KINDS))]
    mean, heading = generator.uniform(1.0, 6.0), generator.uniform(-np.pi, np.pi)
    speed, turn = np.full(frames, mean), np.full(frames, heading)
    if kind != "steady":
        speed = mean * np.maximum(0, 1 + 0.45 * _wandering(generator, frames, GUST_SECONDS))
        turn = turn + 0.25 * _wandering(generator, frames, TURN_SECONDS)
    if kind == "turning":
        turn = turn + generator.choice([-1, 1]) * generator.uniform(0.3, 1.5) * np.arange(frames) / FPS
    rise = 0.1 * _wandering(generator, frames, GUST_SECONDS)
    wind = speed[:, None] * np.stack([np.sin(turn), rise, np.cos(turn)], -1)
    fastest = np.linalg.norm(wind, axis=1, keepdims=True)
    return wind * np.minimum(1, FASTEST / np.maximum(fastest, 1e-9))
