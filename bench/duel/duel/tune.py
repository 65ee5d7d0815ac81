"""Tunes the rivals' settings on development clips, never on reported ones, and writes tuned.json.

    python3 -m duel.tune --program dcloth_duel --garment skirt --cases DIR [--data DATA]

One setting after another takes the value with the least E_d, beginning from tuned.json: another run is another round.
Jolt and the training solver are tuned at SIZE vertices and a middling number of steps, and keep the settings at every
other size. Clips: the first seconds of the bundled sequences, and of those of DATA that dataset.py calls development.
"""
import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from dcloth_training import dataset, safetensors_io

from . import contest, garment

# Tried in this order; the first of each is where the search begins.
GRIDS = {
    "jolt": {"follow": (0.5, 0, 0.75, 1), "damping": (2, 0.1, 0.5, 1, 3, 5), "bend": (1e4, 1e3, 3e3, 3e4, 1e5, 1e6),
             "bias": (1e-3, 0, 1e-2, 0.1), "compliance": (0, 1e-5, 1e-4), "radius": (0.006, 0.003, 0.01, 0.014),
             "friction": (0.2, 0, 0.5), "tether": (1.02, 1, 1.05)},
    "solver": {"damping": (1, 0.03, 0.1, 0.3, 2, 4), "bend": (1, 0.3, 3, 10), "stretch": (1, 0.3, 3, 10, 30),
               "bias": (1, 0.3, 3, 10), "layers": (0, 1)},
    "springs": {"stiffness": (2, 0.5, 1, 4, 8), "drag": (0.3, 0.05, 0.1, 0.2, 0.5, 0.7),
                "gravity": (0.2, 0, 1, 2, 4, 8), "radius": (0.02, -0.01, 0.0, 0.01, 0.035),
                "follow": (1, 0, 0.5, 0.7, 0.8, 0.9)},
}
FIXED = {"jolt": {"iterations": 4}, "solver": {"steps": 4, "passes": 2}, "springs": {"chains": 16, "bones": 4}}
SIZE, FRAMES = 500, 100


def error(program, clips, method, case, several, folder):
    """E_d over the clips, each weighing the same, of several settings."""
    plays = [contest.Entry(str(k), method, case, tuple({**FIXED[method], **one}.items())).play()
             for k, one in enumerate(several)]
    total = np.zeros(len(plays))
    for clip in clips:
        contest.play(program, clip, plays, folder)
        total += [clip.error_mm(folder, str(k)) for k in range(len(plays))]
    return np.nan_to_num(total / len(clips), nan=np.inf)


def search(program, clips, method, case, start, folder):
    """The settings with the least E_d, beginning from `start`."""
    chosen = {key: values[0] for key, values in GRIDS[method].items()} | start
    for key, values in GRIDS[method].items():
        errors = error(program, clips, method, case, [{**chosen, key: value} for value in values], folder)
        chosen[key] = values[int(errors.argmin())]
        print(f"{method}: {key} {chosen[key]:g}, {errors.min():.1f} mm", file=sys.stderr, flush=True)
    return chosen


def development(bundled, data):
    """Paths of clips that settings may be chosen on."""
    paths = sorted(Path(bundled).glob("*.safetensors"))
    names = [name for name in dataset.HELD_OUT if data and not name.startswith("procedural/")]
    return paths + [path for path in (Path(dataset.path_of(data, name)) for name in names) if path.exists()]


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--garment", default="skirt")
    parser.add_argument("--cases", type=Path, required=True, help="folder of GARMENT-SIZE.safetensors")
    parser.add_argument("--data")
    parser.add_argument("--methods", default="springs,jolt,solver")
    options = parser.parse_args(argv)
    home = Path(__file__).resolve().parents[3] / "models" / options.garment
    bundle = safetensors_io.read(home / f"{options.garment}.safetensors")
    mesh = contest.mesh_of(bundle)
    clips = [contest.Clip(path, bundle, mesh, FRAMES) for path in development(home / "sequences", options.data)]
    with open(contest.TUNED, encoding="utf-8") as file:
        told = json.load(file)
    own = told.setdefault(options.garment, {"clips": [], "settings": {}})
    own["clips"] = [clip.name for clip in clips]
    with tempfile.TemporaryDirectory() as folder:
        for method in options.methods.split(","):
            case = options.cases / f"{options.garment}-{SIZE}.safetensors"
            if not case.exists():
                garment.write(case, options.garment, SIZE, home / f"{options.garment}.safetensors")
            own["settings"][method] = search(options.program, clips, method, case,
                                             own["settings"].get(method, {}), folder)
            Path(contest.TUNED).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
