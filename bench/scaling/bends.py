"""Where a measured curve bends and what the figures say of the reason: caches, fixed cost, a kernel that grows
otherwise."""
import math
from itertools import pairwise

BEND = 0.25     # change of the local exponent that is called a bend
GROWS = 0.1     # a kernel whose exponent over the whole axis is below this does not grow with it


def p50(row, heat="warm"):
    return row[heat]["frame_ms"]["p50"]


def exponent(before, now, of):
    """Of a quantity between two rows: 1 is in proportion to the axis."""
    return math.log(of(now) / of(before)) / math.log(now["value"] / before["value"])


def exponents(rows, of):
    return [exponent(a, b, of) for a, b in pairwise(rows)]


def crossings(rows, caches, size=lambda row: row["frame_bytes"]):
    """[(cache, its bytes, value at which `size` reaches it, first row beyond)], interpolated between the rows."""
    found = []
    for name, limit in caches:
        for before, now in pairwise(rows):
            if size(before) <= limit < size(now):
                way = math.log(limit / size(before)) / math.log(size(now) / size(before))
                found.append((name, limit, before["value"] * (now["value"] / before["value"]) ** way, now))
    return found


def sized(size):
    """48 KiB, 2 MiB."""
    return f"{size >> 20} MiB" if size >= 1 << 20 else f"{size >> 10} KiB"


def growing(rows):
    """(kernels that grow with the axis, kernels that do not), largest first at the end of the axis."""
    first, last = rows[0], rows[-1]
    names = sorted(last["warm"]["kernels_ms"], key=lambda name: -last["warm"]["kernels_ms"][name])
    names = [name for name in names if name in first["warm"]["kernels_ms"]]
    grows = [n for n in names if exponent(first, last, lambda row, n=n: row["warm"]["kernels_ms"][n]) >= GROWS]
    return grows, [name for name in names if name not in grows]


def total(row, names):
    return sum(row["warm"]["kernels_ms"].get(name, 0) for name in names)


def ms(value):
    return f"{value:.3f}" if value < 0.1 else f"{value:.2f}" if value < 10 else f"{value:.1f}"


def growth_sentence(title, rows):
    first, last = rows[0], rows[-1]
    steps = exponents(rows, p50)
    return (f"From {first['value']:,} to {last['value']:,} ({last['value'] / first['value']:.0f} times) a warm frame "
            f"grows {p50(last) / p50(first):.1f} times, {ms(p50(first))} to {ms(p50(last))} ms: exponent "
            f"{exponent(first, last, p50):.2f}, {min(steps):.2f} to {max(steps):.2f} between neighbours; a cold one "
            f"{p50(last, 'cold') / p50(first, 'cold'):.1f} times.")


def fixed_sentence(rows):
    """What does not grow with the axis, and where the rest overtakes it."""
    grows, stays = growing(rows)
    if not grows or not stays:
        return None
    first, last = rows[0], rows[-1]
    shares = [total(row, stays) / (total(row, stays) + total(row, grows)) for row in (first, last)]
    if max(shares) < 0.05:
        return None
    said = (f"What does not grow ({', '.join(stays[:4])}{' and others' if len(stays) > 4 else ''}) is {shares[0]:.0%} "
            f"of the smallest frame and {shares[1]:.0%} of the largest")
    for before, now in pairwise(rows):
        low, high = (total(row, grows) / total(row, stays) for row in (before, now))
        if low < 1 <= high:
            at = before["value"] * (now["value"] / before["value"]) ** (math.log(1 / low) / math.log(high / low))
            return f"{said}: the curve turns upward near {at:,.0f}, where what grows overtakes it."
    return said + (": it flattens the curve all along." if shares[1] >= 0.5 else ".")


def cache_sentences(rows, caches):
    said = []
    for name, limit, at, beyond in crossings(rows, caches):
        index = rows.index(beyond)
        before = rows[index - 1]
        steps = exponents(rows, p50)
        sides = [f"{steps[i]:.2f} {where}"
                 for i, where in ((index - 2, "before"), (index - 1, "there"), (index, "after"))
                 if 0 <= i < len(steps)]
        said.append(f"**{name}** ({sized(limit)}) is outgrown near {at:,.0f}: reading a frame's bytes again and again "
                    f"goes at {before['warm']['read_gbs']:.0f} GB/s for {before['frame_bytes'] / 1e6:.1f} MB and at "
                    f"{beyond['warm']['read_gbs']:.0f} for {beyond['frame_bytes'] / 1e6:.1f}; exponent "
                    f"{', '.join(sides)}.")
    if said:
        return said
    low, high = (rows[i]["frame_bytes"] for i in (0, -1))
    inside = [name for name, limit in caches if limit >= high]
    past = [name for name, limit in caches if limit < low]
    place = " and ".join([f"past {past[-1]}" if past else ""] * bool(past)
                         + ([f"within {inside[0]}"] if inside else []))
    return [f"No cache is outgrown on the way: a frame's bytes, {low / 1e6:.1f} to {high / 1e6:.1f} MB, stay "
            f"{place or 'in memory'}, read at {rows[0]['warm']['read_gbs']:.0f} to {rows[-1]['warm']['read_gbs']:.0f} "
            "GB/s."]


def slope_parts(before, now):
    """{kernel: its part of the frame's exponent between two rows}."""
    step = math.log(now["value"] / before["value"]) * math.sqrt(p50(before) * p50(now))
    a, b = (row["warm"]["kernels_ms"] for row in (before, now))
    return {name: (b.get(name, 0) - a.get(name, 0)) / step for name in {*a, *b}}


def kernels_of_bend(before, at, after, change):
    """The fewest kernels whose own change makes half of the frame's; none where all of them together do not."""
    low, high = slope_parts(before, at), slope_parts(at, after)
    parts = {name: math.copysign(1, change) * (high.get(name, 0) - low[name]) for name in low}
    if sum(parts.values()) < 0.5 * abs(change):
        return []
    names, made = [], 0.0
    for name in sorted(parts, key=parts.get, reverse=True):
        names.append(name)
        made += parts[name]
        if made >= 0.5 * abs(change):
            break
    return names


def rates(kernel, rows):
    """"mesh layers (81, 116, 55 GFLOP/s at 8, 16, 32)": by what the kernel is bound by."""
    key, unit = ("bytes", "GB/s") if rows[0]["kernels"][kernel]["bound"] == "memory" else ("flops", "GFLOP/s")
    found = [f"{row['kernels'][kernel][key] / row['warm']['kernels_ms'][kernel] * 1e-6:.0f}" for row in rows]
    return f"{kernel} ({', '.join(found)} {unit} at {', '.join(format(row['value'], ',') for row in rows)})"


def bend_sentences(rows, caches):
    """Points at which the local exponent changes, each with the kernels that change it."""
    said, steps = [], exponents(rows, p50)
    outgrown = {id(beyond): name for name, _, _, beyond in crossings(rows, caches)}
    for i in range(1, len(steps)):
        change = steps[i] - steps[i - 1]
        if abs(change) < BEND:
            continue
        around = rows[i - 1:i + 2]
        kernels = kernels_of_bend(*around, change)
        why = (f"At least half of it: {', '.join(rates(kernel, around) for kernel in kernels)}" if kernels else
               "The kernels' medians show less than half of it: frames were interrupted")
        caches_left = [outgrown[id(row)] for row in rows[i:i + 2] if id(row) in outgrown]
        where = f", where {' and '.join(caches_left)} is outgrown" if caches_left and kernels else ""
        said.append(f"Bend at **{rows[i]['value']:,}**, {'upward' if change > 0 else 'downward'}: exponent "
                    f"{steps[i - 1]:.2f} before, {steps[i]:.2f} after. {why}{where}.")
    return said


def largest_sentence(rows):
    last = rows[-1]
    name = max(last["warm"]["kernels_ms"], key=last["warm"]["kernels_ms"].get)
    share = last["warm"]["kernels_ms"][name] / p50(last)
    of_it = exponent(rows[-2], last, lambda row: row["warm"]["kernels_ms"][name])
    return f"At {last['value']:,} {name} is {share:.0%} of a warm frame and grows with exponent {of_it:.2f}."


def cold_sentence(rows):
    """Cold minus warm beside what the frame's bytes take from memory instead of from where they were."""
    parts = []
    for row in (rows[0], rows[-1]):
        extra = row["frame_bytes"] * 1e-6 * (1 / row["cold"]["memory_gbs"] - 1 / row["warm"]["read_gbs"])
        parts.append(f"{ms(max(0.0, p50(row, 'cold') - p50(row)))} ms at {row['value']:,} (its bytes alone: "
                     f"{ms(max(0.0, extra))})")
    return f"Emptied caches add {' and '.join(parts)}."


def reasons(title, rows, caches):
    """The sentences under a curve, every one of the measured figures."""
    said = [growth_sentence(title, rows), fixed_sentence(rows), *cache_sentences(rows, caches),
            *bend_sentences(rows, caches), largest_sentence(rows), cold_sentence(rows)]
    return [sentence for sentence in said if sentence]


def character_reasons(said, caches):
    """The same for characters that share a model: a row's bytes are the weights and all states."""
    rows = [{"value": row["characters"], "ms": row["ms"]["p50"],
             "bytes": said["model_bytes"] + row["characters"] * said["instance_bytes"]} for row in said["rows"]]
    first, last = rows[0], rows[-1]
    out = [f"From {first['value']} to {last['value']} characters the time of one goes from {ms(first['ms'])} to "
           f"{ms(last['ms'])} ms ({last['ms'] / first['ms'] - 1:+.0%}), model and states together from "
           f"{first['bytes'] / 1e6:.1f} to {last['bytes'] / 1e6:.1f} MB."]
    for name, limit, at, beyond in crossings(rows, caches, lambda row: row["bytes"]):
        before = rows[rows.index(beyond) - 1]
        out.append(f"**{name}** ({sized(limit)}) is outgrown near {at:.0f} characters: {ms(before['ms'])} ms at "
                   f"{before['value']}, {ms(beyond['ms'])} at {beyond['value']} "
                   f"({beyond['ms'] / before['ms'] - 1:+.0%}).")
    if len(out) == 1:
        holds = next((name for name, limit in caches if limit >= last["bytes"]), "memory")
        out.append(f"No cache is outgrown on the way: all of it stays in {holds}.")
    steepest = max(pairwise(rows), key=lambda pair: pair[1]["ms"] / pair[0]["ms"])
    out.append(f"The steepest step is from {steepest[0]['value']} to {steepest[1]['value']}: "
               f"{steepest[1]['ms'] / steepest[0]['ms'] - 1:+.0%}.")
    return out
