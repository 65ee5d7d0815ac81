"""One model for every point of every axis, profiled warm and cold."""
from pathlib import Path

from .garment import Size, skirt, write_bundle, write_motion

# Axis -> title, values. Everything else stays at about the size of the bundled skirt.
AXES = {"vertices": ("vertices", [1000, 2000, 4000, 8000, 16000, 32000, 64000]),
        "width": ("feature width F", [8, 16, 24, 32, 48, 64]),
        "layers": ("graph layers L", [1, 2, 3, 4, 6, 8]),
        "rank": ("rows of the basis", [16, 32, 64, 128, 256, 512, 768])}
CHARACTERS = [1, 2, 4, 8, 16, 32, 64]
QUICK = {"vertices": [1000, 2000, 4000], "width": [8, 16, 32], "layers": [1, 3], "rank": [16, 64, 192]}
QUICK_CHARACTERS = [1, 2, 4]
PRECISION = "int8"
# Passes of 24 counted frames.
FRAMES = {"warm": 240, "cold": 48}
ERROR_FRAMES = 10


class Bench:
    def __init__(self, steps, build, folder):
        self.steps, self.build, self.folder, self._points = steps, build, folder, {}
        self.motion, self.short = folder / "motion.safetensors", folder / "short.safetensors"
        write_motion(self.motion)
        write_motion(self.short, ERROR_FRAMES)

    def model(self, name, size):
        """A model of the size, and its distance to the float32 model."""
        bundle, model = self.folder / "bundle.safetensors", self.folder / "model.dcloth"
        write_bundle(bundle, size)
        said = self.steps.json(f"{name}: convert", self.build / "dcloth", "convert", bundle, "-o", model, "--precision",
                               PRECISION, "--rank", "full", "--motion", self.short, "--json")
        bundle.unlink()
        return model, said["trials"][-1]["error"]["position_mm"]

    def point(self, axis, value, frames):
        """What a frame of one size costs; each size is measured once."""
        size = Size().changed(axis, value)
        if size not in self._points:
            name = f"{axis} {value}"
            model, error = self.model(name, size)
            row = {"error_mm": error}
            for heat, flags in (("warm", []), ("cold", ["--cold"])):
                # One tick a frame: the tick rate is 30 Hz.
                said = self.steps.json(f"{name}: {heat}", self.build / "dcloth", "profile", model, self.motion, "--fps",
                                       30, "--frames", frames[heat], "--json", *flags)
                row[heat] = {"frame_ms": said["frame_ms"], "frames": said["frames"],
                             "read_gbs": said["machine"]["read_gbs"],
                             "memory_gbs": said["machine"]["memory_gbs"],
                             "kernels_ms": {k["name"]: k["ms"]["p50"] for k in said["kernels"] if k["ms"]}}
            row |= {"model_bytes": said["model_bytes"], "instance_bytes": said["instance_bytes"],
                    "kernels": {k["name"]: {key: k[key] for key in ("flops", "bytes", "bound")}
                                for k in said["kernels"]},
                    "frame_bytes": sum(k["bytes"] for k in said["kernels"])}
            self._points[size] = row
        return {"value": len(skirt(value)[0]) if axis == "vertices" else value, **self._points[size]}

    def characters(self, counts):
        model, error = self.model("characters", Size())
        flags = [flag for count in counts for flag in ("--characters", count)]
        said = self.steps.json("characters", self.build / "bench_characters", model, self.motion, *flags)
        return {"model_bytes": said["model_bytes"], "instance_bytes": said["instance_bytes"], "error_mm": error,
                "rows": said["rows"]}


def run(steps, build, folder, quick=False):
    """All axes -> what the page writes."""
    bench = Bench(steps, Path(build), Path(folder))
    frames = {"warm": 24, "cold": 24} if quick else FRAMES
    axes = {axis: [bench.point(axis, value, frames) for value in (QUICK[axis] if quick else values)]
            for axis, (_, values) in AXES.items()}
    return {"precision": PRECISION, "size": vars(Size()), "error_frames": ERROR_FRAMES, "axes": axes,
            "characters": bench.characters(QUICK_CHARACTERS if quick else CHARACTERS)}
