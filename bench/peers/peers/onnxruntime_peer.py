"""ONNX Runtime, float32 and dynamic int8: a session a stage, inputs and outputs bound once, one thread."""
import logging
import os

import numpy as np
import onnxruntime
from onnxruntime.quantization import QuantType, quantize_dynamic

from . import onnx_graphs
from .peer import Peer, fastest

onnxruntime.set_default_logger_severity(4)
logging.getLogger().setLevel(logging.ERROR)    # quantize_dynamic warns through the root logger
CPU = "CPUExecutionProvider"
DEVICE = onnxruntime.OrtDevice.make("cpu", 0)


def session(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    return onnxruntime.InferenceSession(str(path), options, providers=[CPU])


def value(array):
    return onnxruntime.OrtValue.ortvalue_from_numpy(np.ascontiguousarray(array, np.float32))


def quantized(path, out, layers_too):
    """Dynamic int8 of every product, or of those whose weights a tick reads once: not the small ones of the layers."""
    import onnx
    names = []
    if not layers_too:
        model = onnx.load(str(path))
        small = {i.name for i in model.graph.initializer if i.dims and np.prod(i.dims) < 1 << 16}
        names = [node.name for node in model.graph.node if node.op_type == "MatMul" and small & set(node.input)]
    quantize_dynamic(str(path), str(out), per_channel=True, weight_type=QuantType.QInt8, nodes_to_exclude=names,
                     op_types_to_quantize=["MatMul"], extra_options={"MatMulConstBOnly": True})
    return out


class OnnxRuntimePeer(Peer):
    name = "ONNX Runtime"
    version = onnxruntime.__version__

    def __init__(self, case, folder, int8=False):
        self.precision, self.tried = "int8" if int8 else "fp32", []
        self.note = "dynamic int8: weights a column, activations a tensor" if int8 else ""
        w = case.weights
        n, width, m = len(w.columns), len(w.layers[0].u), len(w.pivots)
        self._frames = [{"x": value(case.x[t:t + 1]), "points": value(case.points[t]), "linear": value(case.linear[t]),
                         "posed": value(case.posed[t])} for t in range(case.frames)]
        self._values = {"d": value(np.zeros((1, 3 * m))), "p": value(np.zeros((1, len(w.gru[2])))),
                        "h": value(np.zeros((1, len(w.gru[2])))), "q": value(np.zeros((1, w.mlp[1][0].shape[1]))),
                        "delta": value(np.zeros((1, 3 * n))), "positions": value(np.zeros((n, 3)))}
        starts, columns, means = onnx_graphs.mean_entries(w)
        self._mean = onnxruntime.OrtValue.ort_value_from_sparse_tensor(onnxruntime.SparseTensor.sparse_csr_from_numpy(
            np.array([n, n], np.int64), means, columns.astype(np.int64), starts.astype(np.int64), DEVICE))
        for k in range(len(w.layers)):
            self._values[f"h{k}"], self._values[f"next{k}"] = value(np.zeros((n, width))), value(np.zeros((n, width)))
        self._sessions, self._bindings = {}, {}
        for stage, graphs in onnx_graphs.candidates(w).items():
            self._sessions[stage], _ = fastest(stage, {
                name: (lambda b=build, f=formulation, s=stage: self._candidate(s, b, f, folder))
                for formulation, build in graphs.items()
                for name, build, formulation in self._variants(stage, formulation, build, int8)}, self.tried)
            self.weight_bytes += os.path.getsize(self._sessions[stage].path) if stage != "skinning" else 0
        self.reset()

    @staticmethod
    def _variants(stage, formulation, build, int8):
        """(name, how to build it, (formulation, int8 in the layers too or None for float32))."""
        if not int8 or stage in ("static", "skinning"):
            yield formulation, build, (formulation, None)
        elif not formulation.startswith(("GRU operator", "sparse product")):    # dynamic quantisation knows neither
            yield f"{formulation}, int8", build, (formulation, False)
            if stage == "mesh" and not formulation.startswith("gather, reduce"):
                yield f"{formulation}, int8 in the layers too", build, (formulation, True)

    def _candidate(self, stage, build, formulation, folder):
        stem = os.path.join(folder, f"{stage}-{formulation[0]}".replace(",", "").replace(" ", "_"))
        path = f"{stem}.onnx"
        if not os.path.exists(path):
            build().save(path)
        if formulation[1] is not None:
            small, path = path, f"{stem}-int8{'-all' if formulation[1] else ''}.onnx"
            if not os.path.exists(path):
                quantized(small, path, formulation[1])
        made = session(path)
        made.path = path
        binding = self._bind(made, self._frames[0])
        return made, lambda: made.run_with_iobinding(binding)

    def _bind(self, made, frame):
        binding = made.io_binding()
        for item in made.get_inputs():
            binding.bind_ortvalue_input(item.name, self._mean if item.name == onnx_graphs.MEAN else
                                        frame.get(item.name) or self._values[item.name])
        for item in made.get_outputs():
            binding.bind_ortvalue_output(item.name, self._values[item.name])
        return binding

    def reset(self):
        for name, kept in self._values.items():
            kept.update_inplace(np.zeros(kept.shape(), np.float32))

    def prepare(self, stage, frame):
        self._binding = self._bind(self._sessions[stage], self._frames[frame])

    def run(self, stage):
        self._sessions[stage].run_with_iobinding(self._binding)

    def finish(self, stage):
        values = self._values
        if stage == "mesh":
            for name in [name for name in values if name.startswith("next")]:
                state = "h" + name[len("next"):]
                values[name], values[state] = values[state], values[name]
        elif stage == "displacement":    # p was read as P; now it is the state
            values["p"], values["h"] = values["h"], values["p"]

    def network_output(self):
        return self._values["d"].numpy(), self._values["delta"].numpy()

    def skinned(self):
        return self._values["positions"].numpy()
