"""One simulation: motion in, cloth vertices out, with Blender as the solver."""
import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass

import numpy as np

from ..motion import skeleton
from . import mannequin, pc2, settings


class SimulationError(RuntimeError):
    """The solver failed, or what it returned is not cloth."""


@dataclass
class Result:
    cloth: np.ndarray       # [T, n, 3] m, the recorded frames
    matrices: np.ndarray    # [T, J, 4, 4] world matrices of those frames
    seconds: float          # solver wall time
    blender: str            # its version


def pin_to_hips(garment, matrices):
    """The garment moved rigidly with the hips: targets of the pinned rings. [T, n, 3]"""
    weights = np.zeros((len(garment.vertices), len(skeleton.NAMES)))
    weights[:, 0] = 1.0
    return skeleton.skin(garment.vertices, weights, skeleton.bind_matrices(), matrices)


def simulate(motion, body, garment, record, blender="blender", chosen=None,
             timeout_seconds=3600, log=None):
    """Simulate `garment` on `body` through `motion` and return the frames in `record` (0-based)."""
    matrices = skeleton.joint_matrices(motion)
    keep, faces = mannequin.collider_mesh(body)
    posed = skeleton.skin(body.vertices[keep], body.weights[keep], skeleton.bind_matrices(),
                          matrices)
    folder = tempfile.mkdtemp(prefix="dcloth-")
    try:
        pc2.write(os.path.join(folder, "collider.pc2"), posed)
        pins = pin_to_hips(garment, matrices)
        pc2.write(os.path.join(folder, "garment.pc2"), pins)
        np.savez(os.path.join(folder, "mesh.npz"), body_vertices=posed[0], body_faces=faces,
                 garment_vertices=pins[0], garment_faces=garment.faces, pinned=garment.pinned)
        job = {"folder": folder, "fps": int(skeleton.FPS), "frames": len(motion),
               "record": [int(f) + 1 for f in record],
               "settings": chosen or settings.GROUND_TRUTH}
        path = os.path.join(folder, "job.json")
        with open(path, "w") as file:
            json.dump(job, file)
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "blender_cloth.py")
        command = [blender, "-b", "--factory-startup", "-t", "1", "--python-exit-code", "3",
                   "--python", script, "--", path]
        # The solver's parallel loops spin while they wait: beside a second worker that made a frame
        # seven times slower (5.1 instead of 0.7 s). One thread a process, one process a core.
        environment = dict(os.environ, OMP_NUM_THREADS="1")
        done = subprocess.run(command, env=environment, stdout=log or subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=timeout_seconds, check=False)
        result = os.path.join(folder, "done.json")
        if not os.path.exists(result):
            tail = (done.stdout or b"").decode(errors="replace").strip().splitlines()[-3:]
            raise SimulationError(f"solver ended with status {done.returncode}: {' | '.join(tail)}")
        with open(result) as file:
            report = json.load(file)
        cloth = np.load(os.path.join(folder, "cloth.npy"))
        return Result(cloth, matrices[record], report["seconds"], report["blender"])
    finally:
        shutil.rmtree(folder, ignore_errors=True)
