"""Random scripts for the procedural clips: what a person might do for ten seconds, by seed.

A script is a chain of segments (walk, run, turn, spin, sway, jump, kick, side step, dodge, crouch,
idle). Each segment draws its own targets; every parameter glides to its target no faster than
CHANGE allows, so speeds and accelerations stay those of a person.
"""
import numpy as np

from . import gait

SECONDS = 10.0
# Largest rate of change of a parameter: m/s^2, rad/s^2, m/s, rad/s, 1/s.
CHANGE = {"forward": 4.5, "left": 8.0, "turn": 9.0, "crouch": 0.7, "lean": 1.2, "sway": 0.12,
          "sway_rate": 1.0, "circle": 0.12, "twist": 0.6, "arms": 1.5, "stride": 0.5,
          "width": 0.3}
SHORTEST_GLIDE = 0.3          # seconds


class Draw:
    """Short names for what a segment draws."""

    def __init__(self, generator):
        self.generator = generator
        self.between = generator.uniform

    def sign(self):
        return self.generator.choice((-1.0, 1.0))

    def maybe(self, chance):
        return self.generator.random() < chance


# A segment: Draw -> (seconds it lasts, targets, events with times from when the glide is over).
def _walk(draw):
    targets = {"forward": draw.between(0.5, 1.8), "turn": draw.maybe(0.5) * draw.between(-1.6, 1.6),
               "stride": draw.between(0.9, 1.12)}
    if draw.maybe(0.3):
        targets.update(sway=draw.between(0.0, 0.04), sway_rate=draw.between(0.8, 1.0))
    return draw.between(0.8, 2.4), targets, ()


def _back(draw):
    return draw.between(0.8, 1.8), {"forward": draw.between(-1.1, -0.4),
                                    "turn": draw.maybe(0.3) * draw.between(-0.8, 0.8)}, ()


def _run(draw):
    events = (("jump", draw.between(0.2, 0.5), draw.between(0.06, 0.14)),) if draw.maybe(0.15) else ()
    return draw.between(1.0, 2.2), {"forward": draw.between(1.9, 3.7),
                                    "turn": draw.maybe(0.5) * draw.between(-1.4, 1.4)}, events


def _turn(draw):
    return draw.between(0.3, 1.2), {"turn": draw.sign() * draw.between(1.0, 3.0),
                                    "forward": draw.between(0.0, 0.9)}, ()


def _spin(draw):
    return draw.between(0.4, 1.4), {"turn": draw.sign() * draw.between(2.8, 5.2),
                                    "arms": draw.between(0.2, 0.7)}, ()


def _sway(draw):
    return draw.between(1.0, 2.6), {
        "sway": draw.between(0.02, 0.075), "sway_rate": draw.between(0.5, 1.15),
        "twist": draw.between(0.0, 0.35), "circle": draw.sign() * draw.between(0.0, 0.05),
        "arms": draw.between(0.0, 0.4)}, ()


def _jump(draw):
    events = [("jump", 0.35, draw.between(0.06, 0.26))]
    if draw.maybe(0.3):
        events.append(("jump", 1.5, draw.between(0.06, 0.2)))
    return 0.6 + 1.2 * len(events), {"forward": draw.maybe(0.4) * draw.between(0.2, 0.9),
                                     "turn": draw.maybe(0.3) * draw.between(-2.0, 2.0)}, events


def _kick(draw):
    side = draw.generator.choice(("kick_left", "kick_right"))
    return 1.2, {"lean": draw.between(-0.25, -0.05), "crouch": 0.03,
                 "turn": draw.maybe(0.3) * draw.between(-0.8, 0.8)}, (
                     (str(side), 0.5, draw.between(0.2, 0.65)),)


def _side_step(draw):
    return draw.between(0.6, 1.5), {"left": draw.sign() * draw.between(0.5, 1.2),
                                    "forward": draw.maybe(0.3) * draw.between(0.3, 0.9)}, ()


def _dodge(draw):
    return draw.between(0.1, 0.25), {"left": draw.sign() * draw.between(1.5, 2.4),
                                     "crouch": draw.between(0.05, 0.14)}, ()


def _crouch(draw):
    return draw.between(0.5, 1.8), {"crouch": draw.between(0.12, 0.28),
                                    "lean": draw.between(0.0, 0.15),
                                    "forward": draw.maybe(0.6) * draw.between(0.3, 1.0)}, ()


def _idle(draw):
    return draw.between(0.2, 0.9), {"width": draw.between(0.0, 0.06),
                                    "lean": draw.between(-0.03, 0.05)}, ()


SEGMENTS = ((_walk, 5), (_back, 1), (_run, 3), (_turn, 3), (_spin, 2), (_sway, 2), (_jump, 2),
            (_kick, 1), (_side_step, 2), (_dodge, 1), (_crouch, 1.5), (_idle, 1.5))


def script(seed, seconds=SECONDS):
    """-> (phase at the start, events, keys) as in procedural.SCRIPTS, `seconds` long or more."""
    generator = np.random.default_rng([0x5C, seed])
    draw = Draw(generator)
    weights = np.array([weight for _, weight in SEGMENTS], dtype=np.float64)
    now, last = generator.uniform(0.1, 0.4), None
    values = dict(gait.PARAMETERS)
    keys, events = [(0.0, dict(values)), (now, dict(values))], []
    while now < seconds:
        pick = generator.choice(len(SEGMENTS), p=weights / weights.sum())
        if pick == last:
            continue
        last = pick
        lasts, targets, own_events = SEGMENTS[pick][0](draw)
        wanted = {**gait.PARAMETERS, **targets}
        # A smooth step is at most 1.5 times as steep as a straight line.
        glide = max(SHORTEST_GLIDE, max(1.5 * abs(wanted[name] - values[name]) / CHANGE[name]
                                        for name in wanted))
        keys += [(now + glide, wanted), (now + glide + lasts, wanted)]
        events += [(kind, now + glide + at, size) for kind, at, size in own_events]
        now, values = now + glide + lasts, wanted
    return generator.uniform(0, 1), tuple(events), keys
