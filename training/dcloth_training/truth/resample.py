"""Samples of a cache at the ticks of an animation."""
import numpy as np

from .errors import refuse

SAME_TIME = 1e-3      # of a tick
SLACK = 1.5           # ticks by which the two may differ in length


def seconds_of(cache, fps):
    """Time of each sample since the first; fps where the format has no clock."""
    if cache.seconds is not None:
        return cache.seconds - cache.seconds[0]
    if fps is None:
        refuse(cache.path, "no frame rate", "frames a second of the cache",
               'PC2 and OBJ sequences have no clock: set "fps" of the clip')
    return np.arange(len(cache.positions)) / fps


def at_ticks(cache, fps, tick_count, rate, offset=None, interpolate=False):
    """(indices of ticks [t], positions [t, n, 3] float32, how many lie between samples).

    offset: seconds by which the cache begins after the animation; None: together, and then both end together.
    """
    times = seconds_of(cache, fps)
    lasts, animation = times[-1], (tick_count - 1) / rate
    if offset is None and abs(lasts - animation) * rate > SLACK:
        refuse(cache.path, f"a cache of {lasts:.3f} s ({len(times)} samples) on an animation of {animation:.3f} s "
               f"({tick_count} ticks at {rate:g} Hz)", f"equal lengths within {SLACK} ticks",
               'correct "fps", or say with "offset_seconds" when the cache begins (what both have is taken)')
    ticks = np.arange(tick_count)
    wanted = (ticks / rate - (offset or 0.0))
    inside = (wanted >= -SAME_TIME / rate) & (wanted <= lasts + SAME_TIME / rate)
    ticks, wanted = ticks[inside], np.clip(wanted[inside], 0, lasts)
    if len(ticks) < 2:
        refuse(cache.path, f"{len(ticks)} ticks that cache and animation have in common", "at least 2",
               'correct "offset_seconds"')
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    before = after - 1
    share = (wanted - times[before]) / np.maximum(times[after] - times[before], 1e-12)
    for exact, value in ((before, 0.0), (after, 1.0)):
        share[np.abs(times[exact] - wanted) * rate < SAME_TIME] = value
    between = (share > 0) & (share < 1)
    step = float(np.median(np.diff(times)))
    if between.any() and step * rate > 1 + SAME_TIME and not interpolate:
        refuse(cache.path, f"{1 / step:.4g} samples a second", f"{rate:g}, a multiple of it, or any rate above it",
               f'simulate at {rate:g} or {2 * rate:g} frames a second; "interpolate": true takes what lies between '
               "from a straight line, which is not what cloth did")
    weight = share[:, None, None].astype(np.float32)
    positions = (1 - weight) * cache.positions[before] + weight * cache.positions[after]
    return ticks, positions.astype(np.float32), int(between.sum())
