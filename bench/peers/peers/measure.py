"""Comparing first, then timing: interleaved, tick by tick, on one core."""
import math
import time

import numpy as np

from .engine_peer import NETWORK_STEPS, EnginePeer
from .peer import NETWORK, STAGES

FLOAT32_LIMIT_MM = 0.1     # largest difference of a float32 peer: rounding of metres is a thousandth of it
INT8_LIMIT_SHARE = 0.05    # largest mean difference of an int8 peer, as a share of the mean displacement
WARM_TICKS = 2             # timed ticks a turn, after one that is not


def compare(contestant, case):
    """From a reset through the sequence -> {"mean", "max"} mm to float64, with `skinned_max` where a peer skins too and
    `simulation_mean` where the sequence has the simulation."""
    contestant.reset()
    means, largest, skinned, simulation = [], [], [], []
    for frame in range(case.frames):
        contestant.tick(frame)
        if isinstance(contestant, EnginePeer):
            positions = contestant.positions()
        else:
            positions = case.positions(frame, *contestant.network_output())
            if "skinning" in contestant.stages:
                skinned.append(float(case.error_mm(frame, contestant.skinned()).max()))
        error = case.error_mm(frame, positions)
        means.append(float(error.mean()))
        largest.append(float(error.max()))
        if case.simulated is not None:
            simulation.append(float(case.simulation_error_mm(frame, positions).mean()))
    result = {"mean": float(np.mean(means)), "max": max(largest)}
    result |= {"skinned_max": max(skinned)} if skinned else {}
    return result | ({"simulation_mean": float(np.mean(simulation))} if simulation else {})


def refusal(error_mm, precision, displacement_mm):
    """Why a contestant with this error is none, or None. NaN is refused too."""
    if precision == "int8":
        most = INT8_LIMIT_SHARE * displacement_mm
        return None if error_mm["mean"] <= most else f"mean error {error_mm['mean']:.3g} mm, at most {most:.3g}"
    if error_mm["max"] <= FLOAT32_LIMIT_MM and error_mm.get("skinned_max", 0) <= FLOAT32_LIMIT_MM:
        return None
    return f"error {error_mm}, at most {FLOAT32_LIMIT_MM} mm"


def parts(contestant, times):
    """{what: ms} of one tick: `network`, `frame` and each stage. dcloth's network includes pose features and body
    points, which peers are given; its frame includes skinning and normals, a peer's skinning alone."""
    out = {stage: ns * 1e-6 for stage, ns in times.items() if stage != "whole"}
    if isinstance(contestant, EnginePeer):
        out["network"] = out["pose"] + sum(out[step] for step in NETWORK_STEPS)
        out["frame"] = times["whole"] * 1e-6
    else:
        out["network"] = sum(out[stage] for stage in NETWORK)
        if "skinning" in out:
            out["frame"] = out["network"] + out["skinning"]
    return out


def percentiles(samples):
    """Nearest rank, as the tools report, and the least."""
    ordered = sorted(samples)
    ranks = {f"p{q}": ordered[max(0, math.ceil(q / 100 * len(ordered)) - 1)] for q in (50, 95, 99)}
    return ranks | {"least": ordered[0]}


class Turns:
    """A contestant's place in the sequence; wraps with a reset, which is not timed."""

    def __init__(self, contestant, frames):
        self.contestant, self.frames, self.next = contestant, frames, 0

    def tick(self):
        if self.next == 0:
            self.contestant.reset()
        times = self.contestant.tick(self.next)
        self.next = (self.next + 1) % self.frames
        return parts(self.contestant, times)


def interleaved(contestants, frames, evict, samples, seconds, progress):
    """{name: {part: {"p50", "p95", "p99", "least"}, "ticks": count}}. With `evict` caches are emptied before each tick;
    without, a tick that is not timed comes first. Stops at `samples` a contestant or after `seconds`."""
    turns = {name: Turns(contestant, frames) for name, contestant in contestants.items()}
    names, taken, start, done = list(contestants), {name: [] for name in contestants}, time.monotonic(), 0
    while done < samples and (done < 3 or time.monotonic() - start < seconds):
        for place in range(len(names)):
            name = names[(place + done) % len(names)]
            if evict:
                evict()
                taken[name].append(turns[name].tick())
            else:
                turns[name].tick()
                taken[name] += [turns[name].tick() for _ in range(WARM_TICKS)]
        done += 1 if evict else WARM_TICKS
        progress(done, samples)
    return {name: {"ticks": len(rows), **{part: percentiles([row[part] for row in rows]) for part in rows[0]}}
            for name, rows in taken.items()}


def floor_ms(weights, bits, read_gbps, fma_gmacs):
    """The least a tick can take by stage: weights read once from memory, plus the arithmetic of the graph layers, whose
    weights stay in cache. Both at the rates measured in this run."""
    read = {stage: sum(v.size for v in values) * bits / 8 / read_gbps * 1e-6
            for stage, values in weights.matrices().items()}
    read["mesh"] += weights.multiply_adds()["layers"] / fma_gmacs * 1e-6
    return read


assert set(NETWORK) < set(STAGES) and set(NETWORK_STEPS) == set(NETWORK)
