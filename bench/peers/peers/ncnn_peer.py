"""ncnn, float32, one thread; without skinning, for which it has no product of two given matrices a vertex."""
import importlib.metadata
import os

import ncnn
import numpy as np

from . import ncnn_graphs
from .peer import NETWORK, Peer, fastest


class Model:
    def __init__(self, stem):
        self.stem, self.net = stem, ncnn.Net()
        options = self.net.opt
        options.num_threads = 1
        for name in ("use_fp16_packed", "use_fp16_storage", "use_fp16_arithmetic", "use_bf16_storage",
                     "use_vulkan_compute"):
            if hasattr(options, name):
                setattr(options, name, False)
        if self.net.load_param(f"{stem}.param") or self.net.load_model(f"{stem}.bin"):
            raise RuntimeError(f"{stem}: not loaded")

    def run(self, inputs, outputs):
        extractor = self.net.create_extractor()
        for name, value in inputs:
            extractor.input(name, value)
        results = {}
        for name in outputs:
            status, results[name] = extractor.extract(name)
            if status:
                raise RuntimeError(f"{self.stem}: '{name}' not computed ({status})")
        return results


class NcnnPeer(Peer):
    name, precision, stages = "ncnn", "fp32", NETWORK
    version = importlib.metadata.version("ncnn")

    def __init__(self, case, folder):
        self._case, self.tried = case, []
        w, f = case.weights, len(case.weights.layers[0].u)
        self._states = [f"h{k}" for k in range(len(w.layers))]
        self._inputs = {"static": ("x",), "skeleton": ("x", "h"), "mesh": ("points", *self._states),
                        "displacement": ("p", "q")}
        self._outputs = {"static": ("d",), "skeleton": ("p",), "displacement": ("delta",),
                         "mesh": ("q", *(f"next{k}" for k in range(len(w.layers))))}
        sizes = {"h": len(w.gru[2]), "p": len(w.gru[2]), "q": len(w.basis) - len(w.gru[2])}
        self._zero = {name: np.zeros(size, np.float32) for name, size in sizes.items()}
        self._zero.update({name: np.zeros((f, 1, len(w.columns)), np.float32) for name in self._states})
        self._values, self._models = dict(self._zero), {}
        for stage in NETWORK:
            self._models[stage], _ = fastest(stage, {"channels first" if stage == "mesh" else "dense":
                                                     lambda s=stage: self._make(s, folder)}, self.tried)
            self.weight_bytes += os.path.getsize(f"{self._models[stage].stem}.bin")

    def _make(self, stage, folder):
        stem = os.path.join(folder, f"{stage}-ncnn")
        if not os.path.exists(f"{stem}.bin"):
            graph = ncnn_graphs.Graph()
            ncnn_graphs.STAGES[stage](self._case.weights, graph)
            graph.save(stem)
        model = Model(stem)
        self._models[stage] = model
        self.prepare(stage, 0)
        return model, lambda: self.run(stage)

    def reset(self):
        self._values = dict(self._zero)

    def prepare(self, stage, frame):
        given = {"x": self._case.x[frame], "points": np.ascontiguousarray(self._case.points[frame].T[:, None])}
        self._given = [(name, ncnn.Mat(given[name] if name in given else self._values[name]).clone())
                       for name in self._inputs[stage]]    # a Mat of an array only points to it

    def run(self, stage):
        self._results = self._models[stage].run(self._given, self._outputs[stage])

    def finish(self, stage):
        for name, value in self._results.items():
            self._values[name.replace("next", "h")] = np.array(value)
        if stage == "skeleton":
            self._values["h"] = self._values["p"]

    def network_output(self):
        return self._values["d"], self._values["delta"]
