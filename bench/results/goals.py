"""What was asked for beside what was measured, and everything that fell short."""

# Kernel group -> its kernels, the share of the core's limit that is asked for, of what.
GROUPS = {"basis sum": (("basis",), 0.8, "bytes"),
          "vertex MLP": (("mesh hidden", "mesh coefficients"), 0.8, "bytes"),
          "GRU": (("skeleton input", "skeleton hidden", "skeleton gates"), 0.8, "bytes"),
          "graph layers": (("mesh layers",), 0.6, "multiply-adds")}
# Set for the skirt; the robe, a fifth larger, is held against the same.
COLD_TICK_MS, DRAW_MS, OPEN_MS, INSTANCE_BYTES, LIBRARY_BYTES = 1.0, 0.12, 0.1, 3_000_000, 400_000


def draw_ms(profile):
    return profile["stages_ms"]["skinning"]["p50"] + profile["stages_ms"]["normals"]["p50"]


def goals(results):
    """[{what, allowed, measured, unit, met, timed}]."""
    rows = []

    def add(what, allowed, measured, unit, timed=True):
        rows.append({"what": what, "allowed": allowed, "measured": measured, "unit": unit, "met": measured <= allowed,
                     "timed": timed})

    for name, garment in results["garments"].items():
        cold = garment["profiles"]["int8"]["cold"]
        add(f"{name}, int8: tick with skinning and normals, cold p50", COLD_TICK_MS, cold["frame_ms"]["p50"], "ms")
        for heat in ("warm", "cold"):
            add(f"{name}, int8: skinning and normals, {heat} p50", DRAW_MS, draw_ms(garment["profiles"]["int8"][heat]),
                "ms")
            add(f"{name}, int8: opening the model, {heat} p50", OPEN_MS, garment["open_ms"][heat], "ms")
        largest = max(said["cold"]["instance_bytes"] for said in garment["profiles"].values())
        add(f"{name}: an instance, largest precision", INSTANCE_BYTES / 1e6, largest / 1e6, "MB", timed=False)
    add("shared library, stripped", LIBRARY_BYTES / 1e3, results["library_bytes"] / 1e3, "KB", timed=False)
    return rows


def kernel_groups(results):
    """[{garment, precision, heat, group, ms, reached, asked, of}]: the share of what the core can read or multiply."""
    rows, peak = [], max(results["limits"]["fma_gmacs"].values(), default=0)
    for name, garment in results["garments"].items():
        for precision, profiles in garment["profiles"].items():
            for heat in ("warm", "cold"):
                machine = profiles[heat]["machine"]
                read = machine["memory_gbs"] if heat == "cold" else machine["read_gbs"]
                found = {k["name"]: k for k in profiles[heat]["kernels"] if k["ms"]}
                for group, (kernels, asked, of) in GROUPS.items():
                    parts = [found[kernel] for kernel in kernels if kernel in found]
                    spent = sum(part["ms"]["p50"] for part in parts)
                    if not spent or (of != "bytes" and not peak):
                        continue
                    if of == "bytes":
                        least = sum(part["bytes"] for part in parts) / read * 1e-6
                    else:    # int8 products: twice as many to an instruction
                        least = garment["products"] / (peak * (2 if parts[0]["int8"] else 1)) * 1e-6
                    rows.append({"garment": name, "precision": precision, "heat": heat, "group": group, "ms": spent,
                                 "reached": least / spent, "asked": asked, "of": of})
    return rows


def losses(results):
    """What fell short, in words: goals, kernels, variants that another one beats."""
    said = [f"Missed: {row['what']}: {row['measured']:.3g} {row['unit']}, asked for {row['allowed']:g}."
            for row in goals(results) if not row["met"]]
    groups = kernel_groups(results)
    for group, (_, asked, of) in GROUPS.items():
        mine = [row for row in groups if row["group"] == group]
        below = [f"{r['garment']} {r['precision']} {r['heat']} {r['reached']:.0%}"
                 for r in mine if r["reached"] < asked]
        if below:
            said.append(f"{group} below {asked:.0%} of the {of} that the core can do in {len(below)} of {len(mine)}: "
                        f"{', '.join(below)}.")
    for name, garment in results["garments"].items():
        rows = {row["name"]: row for row in garment["evaluate"]["variants"]}
        for precision in garment["profiles"]:
            row = rows.get(precision)
            if row is None or not row["dominated_by"]:
                continue
            better = rows[row["dominated_by"]]
            said.append(f"{name} {precision} with all stages ({describe(row)}) is dominated by {better['name']} "
                        f"({describe(better)}).")
    return said


def describe(row):
    compared = row["truth"] or row["fp32"]
    return f"{row['tick_ms']['p50']:.2f} ms, {compared['position_mm']['mean']:.2f} mm"
