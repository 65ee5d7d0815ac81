"""LiteRT (TensorFlow Lite) with its default XNNPACK delegate, float32 and dynamic-range int8, one thread."""
import importlib.metadata
import os

import numpy as np
from ai_edge_litert.interpreter import Interpreter

from . import tflite_graphs
from .peer import Peer, fastest


class Model:
    """One stage's interpreter, inputs and outputs by name. The interpreter copies in and out; that is not timed."""

    def __init__(self, path):
        self.path = path
        self._interpreter = Interpreter(model_path=str(path), num_threads=1)
        self._interpreter.allocate_tensors()
        self.inputs = {d["name"]: d["index"] for d in self._interpreter.get_input_details()}
        self.outputs = {d["name"]: d["index"] for d in self._interpreter.get_output_details()}
        self.shapes = {d["name"]: d["shape"] for d in self._interpreter.get_input_details()}
        self.invoke = self._interpreter.invoke

    def set(self, name, array):
        self._interpreter.set_tensor(self.inputs[name], array)

    def get(self, name):
        return self._interpreter.get_tensor(self.outputs[name])


class LiteRtPeer(Peer):
    name = "LiteRT, XNNPACK"
    version = importlib.metadata.version("ai-edge-litert")

    def __init__(self, case, folder, int8=False):
        self.precision, self.tried, self._case = "int8" if int8 else "fp32", [], case
        self.note = "dynamic range: int8 weights a column" if int8 else ""
        self._models = {stage: fastest(stage, {name: (lambda s=stage, k=name, b=build: self._make(s, k, b, folder))
                                               for name, build in graphs.items()}, self.tried)[0]
                        for stage, graphs in tflite_graphs.STAGES.items()}
        self.weight_bytes = sum(os.path.getsize(m.path) for s, m in self._models.items() if s != "skinning")
        self.reset()

    def _make(self, stage, name, build, folder):
        path = os.path.join(folder, f"{stage}-{name}-{self.precision}.tflite".replace(",", "").replace(" ", "_"))
        if not os.path.exists(path):
            graph = tflite_graphs.Graph(self.precision == "int8")
            build(self._case.weights, graph)
            graph.save(path)
        model = Model(path)
        for item, shape in model.shapes.items():
            model.set(item, np.zeros(shape, np.float32))
        return model, model.invoke

    def reset(self):
        self._values = {name: np.zeros(shape, np.float32) for model in self._models.values()
                        for name, shape in model.shapes.items()}

    def prepare(self, stage, frame):
        case, model = self._case, self._models[stage]
        given = {"x": case.x[frame:frame + 1], "points": case.points[frame], "linear": case.linear[frame],
                 "posed": case.posed[frame]}
        for name in model.inputs:
            model.set(name, given.get(name, self._values.get(name)))

    def run(self, stage):
        self._models[stage].invoke()

    def finish(self, stage):
        model = self._models[stage]
        for name in model.outputs:
            self._values[name.replace("next", "h")] = model.get(name)
        if stage == "skeleton":
            self._values["h"] = self._values["p"]

    def network_output(self):
        return self._values["d"], self._values["delta"]

    def skinned(self):
        return self._values["positions"]
