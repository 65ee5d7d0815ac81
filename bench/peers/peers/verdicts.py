"""What the measured times say: goals met or missed, and where a peer is faster."""
from .contestants import BASELINE, BASELINE_INT8
from .peer import NETWORK

# dcloth's row, the peer's row, how many times faster the whole frame is to be.
GOALS = (("dcloth fp32", BASELINE, 2.8), ("dcloth fp16", BASELINE, 4.0), ("dcloth int8", BASELINE, 6.0),
         ("dcloth int8", BASELINE_INT8, 2.5), ("dcloth int8, exact rank", BASELINE, 9.0))
# Of a trained garment, whose basis dcloth stores in as few rows as it needs unasked; the last with every rewrite that
# 0.1 mm allow on average.
TRAINED_GOALS = (*GOALS[:4], ("dcloth int8, two stages", BASELINE, 9.0))


def floor_ms(results, name):
    """The least that a row's network can take cold: what its precision's weights and arithmetic take, less the weights
    that a reduced basis ("fp32, exact rank" beside "fp32") does not store. None where that is not known."""
    rows = results["rows"]
    floor, whole = sum(results["floor_ms"][rows[name]["precision"]].values()), name.split(",")[0]
    if whole == name:
        return floor
    if whole not in rows:
        return None
    return floor - (rows[whole]["weight_bytes"] - rows[name]["weight_bytes"]) / results["limits"]["read_gbps"] * 1e-6


def goals(results, asked=GOALS):
    """Rows [goal, factor, warm, cold, at the core's limit, verdict]. Limits are those of the seeded garment."""
    table, rows = [], results["rows"]
    for ours, theirs, factor in asked:
        if ours not in rows or theirs not in rows:
            table.append([f"{ours} to {theirs}", f"{factor:g}x", "–", "–", "–", "not measured"])
            continue
        reached = [rows[theirs][t]["network"]["p50"] / rows[ours][t]["frame"]["p50"] for t in ("warm", "cold")]
        met = sum(value >= factor for value in reached)
        floor = floor_ms(results, ours) if "floor_ms" in results else None
        limit = rows[theirs]["cold"]["network"]["p50"] / floor if floor else None
        verdict = ("missed", "met in one", "met")[met]
        if met < 2 and limit is not None and limit < factor:
            verdict += ", beyond the limit"
        table.append([f"{ours} to {theirs}", f"{factor:g}x", *(f"{value:.2f}x" for value in reached),
                      "–" if limit is None else f"{limit:.2f}x", verdict])
    return table


def best_peers(results):
    """The fastest peer of each precision, and how many times faster dcloth's network of that precision is."""
    lines, rows = [], results["rows"]
    for precision in ("fp32", "int8"):
        ours = rows.get(f"dcloth {precision}")
        peers = {name: row for name, row in rows.items() if not row["engine"] and row["precision"] == precision}
        for temperature in ("warm", "cold") if ours and peers else ():
            spent = {name: row[temperature]["network"]["p50"] for name, row in peers.items()}
            best = min(spent, key=spent.get)
            lines.append(f"Fastest {precision} peer, {temperature}: {best}, {spent[best]:.2f} ms; dcloth {precision} "
                         f"is {spent[best] / ours[temperature]['network']['p50']:.2f}x as fast.")
    return "\n".join(lines)


def losses(results):
    """Where a peer's p50 is below dcloth's of the same precision on the same basis, as a list."""
    lines, rows = [], results["rows"]
    for name, row in rows.items():
        ours = rows.get(f"dcloth {row['precision']}")
        if row["engine"] or ours is None:
            continue
        for part in ("network", *NETWORK, "skinning"):
            for temperature in ("warm", "cold"):
                if part not in row[temperature]:
                    continue
                theirs_ms, ours_ms = (r[temperature][part]["p50"] for r in (row, ours))
                if theirs_ms < ours_ms:
                    lines.append(f"- {part}, {temperature}: {name} {theirs_ms:.3f} ms, "
                                 f"dcloth {row['precision']} {ours_ms:.3f} ms")
    return "\n".join(lines) or "No peer of the same precision was faster, in whole or in any stage."
