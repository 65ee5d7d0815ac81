"""The measured garments as a Markdown page with a picture for each."""
from pages import machine, steps
from pages.markdown import bullets, ms, table, wrapped

from . import pareto
from .goals import draw_ms, goals, kernel_groups, losses
from .measure import FLAGS

PAGE = """\
# Results

Written by `bench/results/run.sh`, the one command that repeats it together with the [scaling
curves](../scaling/SCALING.md); do not edit. Beside general runtimes: [peers](../peers/RESULTS.md).

{machine}

**Warm**: tick after tick. **Cold**: before each tick the model, the instance, the pose and what is drawn are dropped
from all caches, and 8 MB of other things are read. **Contended**: cold, with a thread on another core that wants memory
and arithmetic. One thread, one tick a frame. **E_d**: distance of vertices to the simulation on motion that was not
trained on, mean ± deviation over frames; **to fp32**: to the same network in float32.

## Against the goals

{goals}

Goals were set for the skirt; the robe is held against the same. Of kernels:

{groups}

Share of what this core reads (basis sum, vertex MLP, GRU: their bytes from memory when cold, a working set of the
frame's size again and again when warm) or multiplies (graph layers: the multiply-adds of their matrices alone, at
{peak:.0f} GMAC/s in its widest vectors; gates and norms, which the kernel tables below count too, are of the same order
in narrow layers); **bold** where it falls short. Times of a group are sums of its kernels' medians. Graph layers ask
for weights of the vertex MLP and the GRU meanwhile, so those two may pass what memory gives.

## Losses

{losses}

{garments}

{projection}
"""
GARMENT = """\
## {name}

{facts}

![{name}: error against a cold tick](pareto_{name}.svg)

{variants}

The front, fastest first: {front}.

`int8@72/skeleton` is a basis of 72 rows, stopped after the skeleton stage (its model holds all stages still). Rows are
fitted to `{calibration}`, all is measured on `{motion}`: {cold_ticks} cold ticks and {warm_ticks} warm ones a variant,
in turns. *Dominated*: another variant is neither slower cold nor less exact (steps of {step:g} mm).

### Where a frame goes

{frames}

{kernels}

Models as `dcloth convert` makes them unasked, fitted to no motion. Kernels: p50 in ms, then the share reached of the
core's limit: a kernel's operations at {gflops:.0f} GFLOP/s ({unit}) or its bytes at {read:.0f} GB/s warm and
{memory:.1f} GB/s cold, whichever takes longer.
"""


def spread(times):
    return " / ".join(ms(times[q]) for q in ("p50", "p95", "p99", "max"))


def error(mesh_error):
    """mean ± deviation, p99."""
    if mesh_error is None:
        return "–"
    position = mesh_error["position_mm"]
    return f"{position['mean']:.2f} ± {position['std']:.2f}, {position['p99']:.1f}"


def goals_table(results):
    quiet = machine.quiet(results["run"]["others_used_cores"])
    rows = []
    for row in goals(results):
        verdict = "met" if row["met"] else "**missed**"
        rows.append([row["what"], f"{row['allowed']:g} {row['unit']}", f"{row['measured']:.3g} {row['unit']}",
                     verdict if quiet or not row["timed"] else "unproven: the machine was not quiet"])
    return table(["goal", "at most", "measured", ""], rows)


def groups_table(results):
    groups, cells = kernel_groups(results), {}
    asked = {row["group"]: f"{row['group']}: {row['asked']:.0%} of {row['of']}" for row in groups}
    for row in groups:
        share = f"{row['reached']:.0%}"
        share = share if row["reached"] >= row["asked"] else f"**{share}**"
        found = cells.setdefault((row["garment"], row["precision"]), {}).setdefault(row["group"], [])
        found.append(f"{ms(row['ms'])} ms, {share}")    # warm, then cold
    return table(["warm; cold", *asked.values()],
                 [[" ".join(key), *("; ".join(found.get(group, ["–"])) for group in asked)]
                  for key, found in cells.items()])


def variants_table(evaluated):
    lines = []
    for v in evaluated["variants"]:
        to_fp32 = v["fp32"]["position_mm"]
        place = v["dominated_by"] or ("–" if v["dominated"] is None else "front")
        timed = ["–"] * 3
        if v["tick_ms"]:
            timed = [f"{v['model_bytes'] / 1e6:.2f}", spread(v["tick_ms"]), ms(v["tick_warm_ms"]["p50"])]
        lines.append([v["name"], v["rank"] or "–", *timed, error(v["truth"]),
                      f"{to_fp32['mean']:.3f}, {to_fp32['max']:.2f}",
                      place])
    return table(["variant", "rows", "model, MB", "cold p50 / p95 / p99 / max, ms", "warm p50, ms",
                  "E_d mean ± std, p99, mm", "to fp32 mean, max, mm", "dominated by"], lines)


def frames_table(profiles):
    rows = [[f"{precision}, {heat}", spread(said["frame_ms"]), ms(said["tick_ms"]["p50"]), ms(draw_ms(said)),
             error(said["truth"]), f"{said['model_bytes'] / 1e6:.2f}", f"{said['instance_bytes'] / 1e6:.2f}",
             said["frames"]]
            for precision, by_heat in profiles.items() for heat, said in by_heat.items()]
    return table(["", "frame p50 / p95 / p99 / max, ms", "tick p50, ms", "skinning and normals p50, ms",
                  "E_d mean ± std, p99, mm", "model, MB", "instance, MB", "frames"], rows)


def kernels_table(profiles):
    """Kernels down, precisions across: warm and cold."""
    by_name = {}
    for precision, by_heat in profiles.items():
        for heat in ("warm", "cold"):
            for kernel in by_heat[heat]["kernels"]:
                if kernel["ms"]:
                    by_name.setdefault(kernel["name"], {})[precision, heat] = kernel
    columns = [(precision, heat) for precision in profiles for heat in ("warm", "cold")]

    def cell(kernel):
        if kernel is None:
            return "–"
        return f"{ms(kernel['ms']['p50'])}, {kernel['fraction_of_limit']:.0%} of {kernel['bound']}"
    return table(["kernel", *(f"{precision} {heat}" for precision, heat in columns)],
                 [[name, *(cell(found.get(column)) for column in columns)] for name, found in by_name.items()])


def garment_section(name, garment):
    evaluated, profiles = garment["evaluate"], garment["profiles"]
    last = profiles["int8"]
    counts = next(v["tick_count"] for v in evaluated["variants"] if v["tick_ms"])
    facts = (f"{evaluated['vertices']:,} vertices, ticks at {evaluated['tick_rate']:g} Hz. Opening the int8 model "
             f"takes {1e3 * garment['open_ms']['warm']:.0f} µs, with emptied caches "
             f"{1e3 * garment['open_ms']['cold']:.0f}.")
    return GARMENT.format(
        name=name, facts=facts, variants=variants_table(evaluated), front=", ".join(evaluated["pareto"]["front"]),
        calibration=garment["calibration"], motion=garment["motion"], cold_ticks=counts["cold"],
        warm_ticks=counts["warm"],
        step=evaluated["pareto"]["step_mm"], frames=frames_table(profiles), kernels=kernels_table(profiles),
        gflops=last["warm"]["machine"]["gflops"], unit=last["warm"]["machine"]["unit"],
        read=last["warm"]["machine"]["read_gbs"],
        memory=last["cold"]["machine"]["memory_gbs"])


def projection_section(results):
    """The skirt's, or nothing."""
    name, garment = next(iter(results["garments"].items()))
    said = garment["profiles"]["int8"]["cold"]["projection"]
    if said is None:
        return ""
    assumed = bullets([*said["assumptions"], *(f"{device['name']}: {device['source']}" for device in said["devices"])])
    devices = table(["device", "one core", "limit of a tick, ms", "tick, ms", "skinning and normals, ms"],
                    [[d["name"], d["core"], f"{d['limit_tick_ms']:.2f}", f"{d['tick_ms']:.2f}", f"{d['draw_ms']:.2f}"]
                     for d in said["devices"]])
    return (f"## Projection for devices not at hand\n\n**{said['label']}**: {name}, int8.\n\n{devices}\n\n"
            f"Assumed:\n\n{assumed}")


def machine_text(results):
    limits, fma = results["limits"], results["limits"]["fma_gmacs"]
    peaks = ", ".join(f"{rate:.0f} GMAC/s in {bits}-bit vectors" for bits, rate in fma.items())
    return "\n".join([machine.built(results),
                      f"Limits of the core, measured in this run: {limits['read_gbps']:.1f} GB/s from memory, "
                      f"{peaks}, float32.",
                      steps.text(results["run"], results["machine"]["cores"], results["quick"])])


def pictures(results):
    """{file name: SVG}."""
    quiet = machine.quiet(results["run"]["others_used_cores"])
    return {f"pareto_{name}.svg": pareto.picture(name, garment["evaluate"], quiet)
            for name, garment in results["garments"].items()}


def markdown(results):
    page = PAGE.format(
        machine=machine_text(results), goals=goals_table(results),
        groups=groups_table(results), peak=max(results["limits"]["fma_gmacs"].values(), default=0),
        losses=bullets(losses(results)),
        garments="\n".join(garment_section(name, garment)
                           for name, garment in results["garments"].items()).rstrip("\n"),
        projection=projection_section(results))
    return wrapped(page.rstrip("\n") + "\n")


assert set(FLAGS) == {"warm", "cold", "contended"}    # as the page explains them
