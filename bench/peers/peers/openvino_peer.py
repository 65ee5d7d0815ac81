"""OpenVINO's CPU plugin on the ONNX graphs, float32, one thread, one stream."""
import os

import numpy as np
import openvino

from . import onnx_graphs
from .peer import Peer, fastest


class OpenVinoPeer(Peer):
    name, precision = "OpenVINO", "fp32"
    version = openvino.get_version().split("-")[0]

    def __init__(self, case, folder):
        self.tried, self._case, self._core = [], case, openvino.Core()
        self._values, self._requests, self._paths = {}, {}, {}
        for stage, graphs in onnx_graphs.candidates(case.weights).items():
            (self._requests[stage], path), _ = fastest(
                stage, {name: (lambda s=stage, k=name, b=build: self._make(s, k, b, folder))
                        for name, build in graphs.items()}, self.tried)
            self.weight_bytes += os.path.getsize(path) if stage != "skinning" else 0
        self.reset()

    def _make(self, stage, name, build, folder):
        path = os.path.join(folder, f"{stage}-{name}".replace(",", "").replace(" ", "_") + ".onnx")
        if not os.path.exists(path):
            build().save(path)
        compiled = self._core.compile_model(path, "CPU", {
            "INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": "f32", "ENABLE_CPU_PINNING": False})
        request = compiled.create_infer_request()
        for port in (*compiled.inputs, *compiled.outputs):
            value = self._values.setdefault(port.any_name, np.zeros(tuple(port.shape), np.float32))
            request.set_tensor(port, openvino.Tensor(value, shared_memory=True))
        request.names = [port.any_name for port in compiled.inputs]
        return (request, path), request.infer

    def reset(self):
        for value in self._values.values():
            value[:] = 0

    def prepare(self, stage, frame):
        case = self._case
        given = {"x": case.x[frame:frame + 1], "points": case.points[frame], "linear": case.linear[frame],
                 "posed": case.posed[frame]}
        for name in self._requests[stage].names:
            if name in given:
                self._values[name][:] = given[name]

    def run(self, stage):
        self._requests[stage].infer()

    def finish(self, stage):
        if stage == "displacement":
            self._values["h"][:] = self._values["p"]
        elif stage == "mesh":
            for name in [name for name in self._values if name.startswith("next")]:
                self._values["h" + name[len("next"):]][:] = self._values[name]

    def network_output(self):
        return self._values["d"], self._values["delta"]

    def skinned(self):
        return self._values["positions"]
