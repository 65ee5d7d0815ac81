#!/usr/bin/env python3
"""Scaling curves: time and memory against vertices, feature width, layers, rank and characters, as one table and pictures.

  bench/scaling/scaling.py BUILD OUT [--precision int8] [--quick]

BUILD is a build folder with the tools and the benches (-DDCLOTH_BUILD_BENCH=ON). Writes OUT/scaling.md, OUT/scaling.json and
one SVG per axis. Everything but the axis stays at about the size of the bundled skirt. Run it on a machine that does nothing
else; it takes about ten minutes. scripts/test.sh does not run it: it measures.
"""
import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from curves import cache_note, write_svg
from garment import Size, skirt, write_bundle, write_motion

AXES = {
    "vertices": ("vertices", [1000, 2000, 4000, 8000, 16000, 32000, 64000]),
    "width": ("feature width F", [8, 16, 24, 32, 48, 64]),
    "layers": ("graph layers L", [1, 2, 3, 4, 6, 8]),
    "rank": ("rows of the basis", [16, 32, 64, 128, 256, 512, 768]),
}
CHARACTERS = [1, 2, 4, 8, 16, 32, 64]
QUICK = {"vertices": [1000, 4000], "width": [8, 16], "layers": [1, 2], "rank": [16, 64]}


def call(*command):
    result = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{result.stderr}")
    return json.loads(result.stdout)


def cache_sizes():
    """Bytes of the data caches that core 0 reaches, smallest first."""
    sizes = []
    for index in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        if (index / "type").read_text().strip() != "Instruction":
            sizes.append((f"L{(index / 'level').read_text().strip()}", int((index / "size").read_text().strip()[:-1]) << 10))
    return sizes


class Bench:
    def __init__(self, build, folder, precision):
        self.build, self.folder, self.precision = build, folder, precision
        self.motion = folder / "motion.safetensors"
        write_motion(self.motion)

    def model(self, size):
        bundle, model = self.folder / "bundle.safetensors", self.folder / "model.dcloth"
        write_bundle(bundle, size)
        call(self.build / "dcloth", "convert", bundle, "-o", model, "--precision", self.precision, "--rank", "full", "--json")
        bundle.unlink()
        return model

    def point(self, size):
        model = self.model(size)
        row = {}
        for name, flags in (("warm", []), ("cold", ["--cold"])):
            # One tick a frame: the tick rate is 30 Hz.
            said = call(self.build / "dcloth", "profile", model, self.motion, "--fps", 30, "--json", *flags)
            row[name] = said["frame_ms"]
            row[name + "_kernels"] = {k["name"]: k["ms"]["p50"] for k in said["kernels"] if k["ms"]}
        row |= {"model_bytes": said["model_bytes"], "instance_bytes": said["instance_bytes"],
                "frame_bytes": sum(k["bytes"] for k in said["kernels"]), "cpu": said["cpu"], "isa": said["isa"],
                "machine": said["machine"]}
        return row


def table(title, unit, rows, caches):
    lines = [f"## Against {title}", "", f"![time]({unit}.svg) ![memory]({unit}_memory.svg)", "",
             f"| {title} | model | instance | bytes of a frame | warm p50 / p99 | cold p50 / p99 | largest kernels, warm | growth |",
             "|---|---|---|---|---|---|---|---|"]
    before = None
    for value, row in rows:
        largest = sorted(row["warm_kernels"].items(), key=lambda k: -k[1])[:2]
        kernels = ", ".join(f"{name} {ms:.3f}" for name, ms in largest)
        lines.append(f"| {value} | {row['model_bytes'] / 1e6:.2f} MB | {row['instance_bytes'] / 1e6:.2f} MB | "
                     f"{row['frame_bytes'] / 1e6:.2f} MB | {row['warm']['p50']:.3f} / {row['warm']['p99']:.3f} ms | "
                     f"{row['cold']['p50']:.3f} / {row['cold']['p99']:.3f} ms | {kernels} | "
                     f"{cache_note(before, (value, row), caches)} |")
        before = (value, row)
    return lines + [""]


def characters(bench, counts, caches):
    model = bench.model(Size())
    flags = [flag for count in counts for flag in ("--characters", count)]
    said = call(bench.build / "bench" / "frame" / "bench_characters", model, bench.motion, *flags)
    lines = ["## Against characters", "", "![time](characters.svg) ![memory](characters_memory.svg)", "",
             "One model, shared; every character ticks and is drawn in turn. Times are for one of them.", "",
             "| characters | model and instances | p50 / p99 of a character | all of them | |", "|---|---|---|---|---|"]
    for row in said["rows"]:
        count, total = row["characters"], said["model_bytes"] + row["characters"] * said["instance_bytes"]
        fits = next((name for name, size in caches if total <= size), "memory")
        lines.append(f"| {count} | {total / 1e6:.1f} MB | {row['ms']['p50']:.3f} / {row['ms']['p99']:.3f} ms | "
                     f"{count * row['ms']['p50']:.2f} ms | fits {fits} |")
    curve = [(row["characters"], row["ms"]["p50"]) for row in said["rows"]]
    return said, lines + [""], curve


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--precision", default="int8", choices=("fp32", "fp16", "int8"))
    parser.add_argument("--quick", action="store_true", help="two points an axis: does it run at all")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    caches, results = cache_sizes(), {"precision": options.precision, "axes": {}}
    sections = []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options.build, Path(folder), options.precision)
        for axis, (title, values) in AXES.items():
            rows = []
            for value in QUICK[axis] if options.quick else values:
                print(f"{title}: {value}", file=sys.stderr)
                size = Size().changed(axis, value)
                rows.append((len(skirt(value)[0]) if axis == "vertices" else value, bench.point(size)))
            results["axes"][axis] = [{"value": value, **row} for value, row in rows]
            sections += table(title, axis, rows, caches)
            write_svg(options.out / f"{axis}.svg", title, "frame, ms",
                      {name: [(v, r[name]["p50"]) for v, r in rows] for name in ("warm", "cold")})
            write_svg(options.out / f"{axis}_memory.svg", title, "MB",
                      {name: [(v, r[f"{name}_bytes"] / 1e6) for v, r in rows] for name in ("model", "instance")})
        results["characters"], lines, curve = characters(bench, [1, 4] if options.quick else CHARACTERS, caches)
        sections += lines
        write_svg(options.out / "characters.svg", "characters", "one character, ms", {"in turn": curve})
        write_svg(options.out / "characters_memory.svg", "characters", "MB", {"together": [
            (c, (results["characters"]["model_bytes"] + c * results["characters"]["instance_bytes"]) / 1e6) for c, _ in curve]})
    first = rows[0][1]
    head = ["# How cost grows", "",
            f"`bench/scaling/scaling.py`, synthetic skirts, {options.precision}, {Size()} unless the axis says otherwise. A frame is "
            "one tick with skinning and normals on one core; cold: caches emptied before each.", "",
            f"{first['cpu']}, {first['isa']}, data caches {', '.join(f'{n} {s >> 10} KiB' for n, s in caches)}; "
            f"{first['machine']['gflops']:.0f} GFLOP/s, {first['machine']['memory_gbs']:.1f} GB/s from memory.", "",
            "Growth: the exponent between this point and the one before (1: in proportion), and where the frame's bytes leave "
            "a cache in between.", ""]
    (options.out / "scaling.json").write_text(json.dumps(results, indent=1) + "\n")
    (options.out / "scaling.md").write_text("\n".join(head + sections))


if __name__ == "__main__":
    main()
