"""The results as a Markdown page and as a table for the terminal."""
import json
import sys

from pages import machine
from pages.markdown import bullets, ms, table, wrapped

from .contestants import BASELINE
from .measure import FLOAT32_LIMIT_MM, INT8_LIMIT_SHARE
from .peer import NETWORK
from .verdicts import TRAINED_GOALS, best_peers, floor_ms, goals, losses

TEMPERATURES = ("warm", "cold")
PAGE = """\
# dcloth and general runtimes on the same network

Written by `bench/peers/run.sh`, the one command that repeats all of it; do not edit.

{machine}

## Network

{network}

{best}

**Network** is the static stage, the GRU, the graph layers with the vertex MLP, and the sum over the stacked basis.
dcloth's rows include more: checks of the pose, heading frame, features, and the posed body points that the graph
layers read; peers get both ready-made. A peer's stages are graphs of their own, inputs and outputs bound or copied
outside the timed part, each called from Python (2 to 10 us a call, more after the caches were emptied). dcloth is
timed in C++, through its C ABI.

**Warm**: a tick right after another of the same contestant. **Cold**: caches emptied before the tick by reading
{evicted:.0f} MB. All take turns tick by tick, in rotating order, on core {core}, one thread, batch 1; {warm_ticks}
timed ticks a row warm, {cold_ticks} cold. **Error**: distance of vertices to PyTorch in float64 on the same
weights, over {frames} ticks from a reset, compared before anything is timed. A float32 contestant more than {limit}
mm off anywhere is left out, and an int8 one whose mean error is above {share:.0%} of the mean displacement
({displacement:.0f} mm). **Ratio**: the network of {baseline} over the row's, p50 to p50. **Limit**: the share of
the core's limit that is reached cold: the row's weights read once from memory plus the multiply-adds of the graph
layers, in float32 at the widest vectors, over the network's p50.

"Exact rank": the stacked basis in as many rows as it has numerical rank, which the converter does by default where
that saves bytes, and which S and M that start from the components of one residual allow. The peers could be given
the same basis; their displacement stage would shrink in proportion.

## Whole frame

{frame}

With skinning and, for dcloth alone, normals; dcloth skins with 8 influences a vertex, peers with one dense product.
Ratios here: {baseline}'s network alone over dcloth's whole frame.

## Stage by stage

{stages}

## Where dcloth's time goes

{where}

Limit: that stage's weights read once from memory, and for the mesh stage the multiply-adds of its graph layers,
both at the rates above. {vectors}

## Against the goals

{goals}

Whole frames of dcloth against the peer's network. **At the limit**: the ratio if dcloth's network took no longer than
the core's limit above and its skinning and normals nothing: more cannot be had in float32 arithmetic without fewer
weights. The weights are seeded, not trained: what a bound in millimetres allows beyond exact rewrites shows on a
trained garment.

{trained}
## Losses

{losses}

## Versions

{versions}

## Graphs tried

The fastest of each stage runs; least of four calls, in cache.

{tried}

## Left out

{absent}
"""

TRAINED = """\
## A trained garment

`{bundle}` on `{sequence}`, {frames} frames that it was not trained on ({sizes};
{megabytes:.1f} MB of float32 weights in a tick). Compared, then timed as above, {warm_ticks} ticks a row warm,
{cold_ticks} cold.

{network}

{goals}

**E_d**: distance of vertices to the simulation, mean. Times of dcloth here are whole frames, with features, skinning
and normals; those of peers are their network alone. dcloth's models are what `dcloth convert` writes unasked: the basis
in as many rows as it has numerical rank. "Whole basis" keeps all of its rows (`--rank full`), as the peers do, which
could be given fewer; "two stages" is without the mesh stage (`--stages skeleton`), which this garment does without: all
that an error of 0.1 mm on average allows.

"""


def _three(timed, part):
    return " / ".join(ms(timed[part][q]) for q in ("p50", "p95", "p99")) if part in timed else "–"


def _ratio(results, row, temperature, part="network"):
    base = results["rows"].get(BASELINE)
    if base is None or part not in row[temperature]:
        return "–"
    return f"{base[temperature]['network']['p50'] / row[temperature][part]['p50']:.2f}x"


def network_rows(results):
    for name, row in results["rows"].items():
        error, floor = row["error_mm"], floor_ms(results, name)
        yield [name, f"{row['weight_bytes'] / 1e6:.1f}", f"{error['mean']:.4f}", f"{error['max']:.4f}",
               _three(row["warm"], "network"), _three(row["cold"], "network"),
               " / ".join(ms(row[t]["network"]["least"]) for t in TEMPERATURES), _ratio(results, row, "warm"),
               _ratio(results, row, "cold"), f"{floor / row['cold']['network']['p50']:.0%}" if floor else "–"]


GOALS_HEADER = ["goal", "asked for", "warm", "cold", "at the limit, cold", ""]
NETWORK_HEADER = ["", "MB", "mm mean", "mm max", "warm p50 / p95 / p99, ms", "cold p50 / p95 / p99, ms",
                  "least warm / cold", "ratio warm", "ratio cold", "limit"]


def _frames(results):
    rows = [[name, *(_three(row[t], "frame") for t in TEMPERATURES),
             *(_ratio(results, row, t, "frame") if row["engine"] else "–" for t in TEMPERATURES)]
            for name, row in results["rows"].items() if "frame" in row["warm"]]
    return table(["", "warm p50 / p95 / p99, ms", "cold p50 / p95 / p99, ms", "ratio warm", "ratio cold"], rows)


def _stages(results):
    stages = ("pose", *NETWORK, "skinning", "normals")
    rows = [[name, *(" / ".join(ms(row[t][s]["p50"]) if s in row[t] else "–" for t in TEMPERATURES) for s in stages)]
            for name, row in results["rows"].items()]
    return table(["p50 warm / cold, ms", *stages], rows)


def _where(results):
    """Each stage of the engine beside the least it could take, cold."""
    rows = []
    for name, row in results["rows"].items():
        if row["engine"] and "," not in name:
            cold, floors = row["cold"], results["floor_ms"][row["precision"]]
            cells = [f"{cold[s]['p50']:.2f} ({cold[s]['p50'] / cold['frame']['p50']:.0%} of the frame), limit "
                     f"{floors[s]:.2f} ({floors[s] / cold[s]['p50']:.0%})" for s in NETWORK[1:]]
            rows.append([name, f"{cold['frame']['p50']:.2f}", *cells])
    return table(["ms, cold p50", "frame", "skeleton", "mesh", "displacement"], rows)


def _vectors(results):
    """What the arithmetic of the graph layers takes in vectors of each width."""
    layers = results["multiply_adds"]["layers"]
    widths = ", ".join(f"{layers / rate * 1e-6:.2f} ms in {bits}-bit vectors"
                       for bits, rate in results["limits"]["fma_gmacs"].items())
    return (f"The {layers / 1e6:.0f} M multiply-adds of the graph layers take at least {widths}; dcloth's kernels "
            f"here: {results['machine']['isa']}.")


def _machine(results):
    m, limits, used = results["machine"], results["limits"], results["others_used_cores"]
    fma = ", ".join(f"{rate:.0f} GMAC/s in {bits}-bit vectors" for bits, rate in limits["fma_gmacs"].items())
    text = [f"{results['date']}, {m['cpu']}, core {m['core']} of {m['cores']}, {m['system']}; engine built by "
            f"{m['compiler']}, its kernels chose {m['isa']}; Python {m['python']}.",
            f"Limits of the core, measured in this run: {limits['read_gbps']:.1f} GB/s from memory, {fma}, float32.",
            f"Garment: preset '{results['preset']}' of `dcloth_training.synthetic` ({_sizes(results)}; "
            f"{_megabytes(results):.1f} MB of float32 weights in a tick), seeded weights, not trained: times and "
            "differences to float64 mean something, looks do not."]
    text.append(machine.busy_text(used, m["cores"], results["seconds"]))
    return "\n".join(text)


def _trained(results):
    if "trained" not in results:
        return ""
    trained = results["trained"]
    rows = []
    for name, row in trained["rows"].items():
        error, part = row["error_mm"], "frame" if row["engine"] else "network"
        rows.append([name, row["basis_rows"], f"{row['weight_bytes'] / 1e6:.1f}", f"{error['mean']:.4f}",
                     f"{error['max']:.4f}", f"{error['simulation_mean']:.2f}" if "simulation_mean" in error else "–",
                     *(_three(row[t], part) for t in TEMPERATURES),
                     *(_ratio(trained, row, t, part) for t in TEMPERATURES)])
    header = ["", "rows", "MB", "to float64: mm mean", "mm max", "E_d, mm",
              *(f"{t} p50 / p95 / p99, ms" for t in TEMPERATURES), "ratio warm", "ratio cold"]
    ticks = _ticks(trained["rows"])
    return TRAINED.format(
        bundle=trained["bundle"], sequence=trained["sequence"], frames=trained["frames"], sizes=_sizes(trained),
        megabytes=_megabytes(trained), network=table(header, rows), warm_ticks=ticks["warm"], cold_ticks=ticks["cold"],
        goals=table(GOALS_HEADER, goals(trained, TRAINED_GOALS)))


def _ticks(rows):
    return {t: min((row[t]["ticks"] for row in rows.values()), default=0) for t in TEMPERATURES}


def _sizes(results):
    return ", ".join(f"{k} {v}" for k, v in results["garment"].items() if k != "parameters")


def _megabytes(results):
    return 4e-6 * results["garment"]["parameters"]


def _tried(results):
    def outcome(spent):
        return f"{ms(spent)} ms" if isinstance(spent, float) else f"does not run: {spent}".replace("|", "/")

    rows = [[name, stage, graph, outcome(spent)]
            for name, row in results["rows"].items() for stage, graph, spent in row["tried"] if stage in NETWORK[1:3]]
    return table(["peer", "stage", "graph", "time"], rows)


def markdown(results):
    rows = results["rows"]
    ticks = _ticks(rows)
    versions = [f"{name}: {row['version']}" + (f"; {row['note']}" if row["note"] else "")
                for name, row in rows.items() if not row["engine"]]
    page = PAGE.format(
        machine=_machine(results), network=table(NETWORK_HEADER, network_rows(results)), frame=_frames(results),
        stages=_stages(results), where=_where(results), vectors=_vectors(results), best=best_peers(results),
        losses=losses(results),
        goals=table(GOALS_HEADER, goals(results)), trained=_trained(results), versions=bullets(versions),
        tried=_tried(results), absent=bullets(f"{name}: {why}" for name, why in results["absent"].items()),
        evicted=results["machine"]["evicted_bytes"] / 1e6, core=results["machine"]["core"], frames=results["frames"],
        warm_ticks=ticks["warm"], cold_ticks=ticks["cold"], limit=FLOAT32_LIMIT_MM, share=INT8_LIMIT_SHARE,
        displacement=results["displacement_mm"], baseline=BASELINE)
    return wrapped(page)


def terminal(results):
    rows = [NETWORK_HEADER, *network_rows(results)]
    widths = [max(len(str(row[i])) for row in rows) for i in range(len(NETWORK_HEADER))]
    lines = ["  ".join(str(cell).ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
    left_out = [f"left out: {name}: {why}" for name, why in results["absent"].items()]
    return "\n".join([_machine(results), "", *lines, *left_out])


if __name__ == "__main__":    # python3 -m peers.page results.json: the page of figures that were kept
    with open(sys.argv[1], encoding="utf-8") as kept:
        print(markdown(json.load(kept)), end="")
