"""The stages as TensorFlow Lite models, written with LiteRT's own schema: no converter, so no TensorFlow."""
import flatbuffers
import numpy as np
from ai_edge_litert import schema_py_generated as schema

_TYPES = {np.dtype(np.float32): schema.TensorType.FLOAT32, np.dtype(np.int32): schema.TensorType.INT32,
          np.dtype(np.int8): schema.TensorType.INT8}

# Options tables that are not named after their operator; "" for none.
_OPTIONS = {"SUM": "ReducerOptions", "MEAN": "ReducerOptions", "BATCH_MATMUL": "BatchMatMulOptions", "LOGISTIC": "",
            "TANH": "", "RSQRT": ""}


class Graph:
    """Builds one model; values are (index, shape). With `int8`, dense weights are int8 with a scale an output, and the
    runtime quantises their inputs tick by tick (dynamic range)."""

    def __init__(self, int8=False):
        self.int8, self.tensors, self.operators, self.codes = int8, [], [], {}
        self.buffers, self.inputs, self.outputs = [schema.BufferT()], [], []

    def _tensor(self, shape, dtype=np.float32, data=None, scales=None, name=None):
        tensor = schema.TensorT()
        tensor.name = (name or f"t{len(self.tensors)}").encode()
        tensor.shape, tensor.type, tensor.buffer = list(shape), _TYPES[np.dtype(dtype)], 0
        if data is not None:
            buffer = schema.BufferT()
            buffer.data = np.ascontiguousarray(data, dtype).view(np.uint8).ravel()
            self.buffers.append(buffer)
            tensor.buffer = len(self.buffers) - 1
        if scales is not None:
            tensor.quantization = schema.QuantizationParametersT()
            tensor.quantization.scale = scales.astype(np.float32)
            tensor.quantization.zeroPoint = np.zeros(len(scales), np.int64)
            tensor.quantization.quantizedDimension = 0
        self.tensors.append(tensor)
        return len(self.tensors) - 1, tuple(shape)

    def input(self, name, *shape):
        value = self._tensor(shape, name=name)
        self.inputs.append(value[0])
        return value

    def constant(self, data, dtype=np.float32):
        return self._tensor(np.shape(data), dtype, data)

    def output(self, value, name):
        self.tensors[value[0]].name = name.encode()
        self.outputs.append(value[0])

    def op(self, kind, inputs, *shapes, **fields):
        """An operator with outputs of `shapes`; `fields` are those of its options table."""
        code = getattr(schema.BuiltinOperator, kind)
        operator = schema.OperatorT()
        operator.opcodeIndex = self.codes.setdefault(code, len(self.codes))
        values = [self._tensor(shape) for shape in shapes]
        operator.inputs, operator.outputs = [i[0] for i in inputs], [v[0] for v in values]
        camel = "".join(part.capitalize() for part in kind.split("_"))
        name = _OPTIONS.get(kind, f"{camel}Options")
        if name:
            operator.builtinOptions = getattr(schema, name + "T")()
            operator.builtinOptionsType = getattr(schema.BuiltinOptions, name)
            for field, value in fields.items():
                setattr(operator.builtinOptions, field, value)
        self.operators.append(operator)
        return values[0] if len(values) == 1 else values

    def dense(self, x, matrix, bias=None, relu=False):
        """x [r, in] times matrix [in, out]."""
        weights, scales = np.ascontiguousarray(matrix.T), None
        if self.int8 and weights.size >= 1 << 16:
            scales = np.maximum(np.abs(weights).max(1), 1e-12) / 127
            weights = np.rint(weights / scales[:, None]).astype(np.int8)
        inputs = [x, self._tensor(weights.shape, weights.dtype, weights, scales)]
        inputs.append((-1, ()) if bias is None else self.constant(bias))
        return self.op("FULLY_CONNECTED", inputs, (x[1][0], len(weights)), fusedActivationFunction=int(relu))

    def binary(self, kind, a, b):
        return self.op(kind, [a, b], np.broadcast_shapes(a[1], b[1]))

    def unary(self, kind, a, **fields):
        return self.op(kind, [a], a[1], **fields)

    def split(self, a, count):
        part = (*a[1][:-1], a[1][-1] // count)
        return self.op("SPLIT", [self.constant(np.int32(1), np.int32), a], *[part] * count, numSplits=count)

    def concat(self, parts, axis):
        shape = list(parts[0][1])
        shape[axis] = sum(part[1][axis] for part in parts)
        return self.op("CONCATENATION", parts, tuple(shape), axis=axis)

    def reduce(self, kind, a, axis, keep=False):
        shape = tuple(1 if i == axis else s for i, s in enumerate(a[1]) if keep or i != axis)
        return self.op(kind, [a, self.constant([axis], np.int32)], shape, keepDims=keep)

    def reshape(self, a, *shape):
        return self.op("RESHAPE", [a, self.constant(shape, np.int32)], shape, newShape=list(shape))

    def save(self, path):
        graph, model = schema.SubGraphT(), schema.ModelT()
        graph.tensors, graph.operators, graph.inputs, graph.outputs = (self.tensors, self.operators, self.inputs,
                                                                       self.outputs)
        model.version, model.subgraphs, model.buffers, model.operatorCodes = 3, [graph], self.buffers, []
        for code in self.codes:    # in the order of their indices
            entry = schema.OperatorCodeT()
            entry.builtinCode, entry.version = code, 1
            entry.deprecatedBuiltinCode = min(code, 127)
            model.operatorCodes.append(entry)
        builder = flatbuffers.Builder(1 << 20)
        builder.Finish(model.Pack(builder), b"TFL3")
        with open(path, "wb") as file:
            file.write(builder.Output())
        return path


def static(w, g):
    x = g.input("x", 1, len(w.static[0][0]))
    g.output(g.dense(g.dense(x, *w.static[0], relu=True), *w.static[1]), "d")


def skeleton(w, g):
    matrix, bias, recurrent, recurrent_bias = w.gru
    h = g.input("h", 1, len(recurrent))
    i = g.split(g.dense(g.input("x", 1, len(matrix)), matrix, bias), 3)
    j = g.split(g.dense(h, recurrent, recurrent_bias), 3)
    r, z = (g.unary("LOGISTIC", g.binary("ADD", i[k], j[k])) for k in (0, 1))
    q = g.unary("TANH", g.binary("ADD", i[2], g.binary("MUL", r, j[2])))
    g.output(g.binary("ADD", q, g.binary("MUL", z, g.binary("SUB", h, q))), "p")


def gather_and_reduce(w, g, x):
    n, k = w.columns.shape
    rows = g.op("GATHER", [x, g.constant(w.columns, np.int32)], (n, k, x[1][1]), axis=0)
    return g.reduce("SUM", rows, 1)


def gather_each_neighbour(w, g, x):
    total = x
    for k in range(1, w.columns.shape[1]):
        total = g.binary("ADD", total, g.op("GATHER", [x, g.constant(w.columns[:, k], np.int32)], x[1], axis=0))
    return total


def mesh(w, g, aggregate):
    """Gates on [a | h] side by side; the mean of LayerNorm is taken out of W^o beforehand, which is exact."""
    n, f = len(w.columns), len(w.layers[0].u)
    padding, inverse = g.constant(w.padding), g.constant(w.inverse_count)
    x, states = g.input("points", n, 3), []
    for number, layer in enumerate(w.layers):
        h = g.input(f"h{number}", n, f)
        a = g.binary("MUL", g.binary("SUB", aggregate(w, g, x), g.binary("MUL", x, padding)), inverse)
        matrix = np.concatenate([layer.x[:, :2 * f], layer.u_zr])
        z, r = g.split(g.unary("LOGISTIC", g.dense(g.concat([a, h], 1), matrix, layer.x_bias[:2 * f])), 2)
        matrix = np.concatenate([layer.x[:, 2 * f:], layer.u])
        candidate = g.unary("TANH", g.dense(g.concat([a, g.binary("MUL", r, h)], 1), matrix, layer.x_bias[2 * f:]))
        h = g.binary("ADD", h, g.binary("MUL", z, g.binary("SUB", candidate, h)))
        states.append(h)
        centred = g.dense(h, layer.o - layer.o.mean(1, keepdims=True), layer.o_bias - layer.o_bias.mean())
        variance = g.reduce("MEAN", g.binary("MUL", centred, centred), 1, keep=True)
        scale = g.unary("RSQRT", g.binary("ADD", variance, g.constant(np.full((1, 1), 1e-5))))
        normed = g.binary("MUL", g.binary("MUL", centred, scale), g.constant(layer.norm_weight[None]))
        x = g.unary("LEAKY_RELU", g.binary("ADD", normed, g.constant(layer.norm_bias[None])), alpha=layer.slope)
    s = g.reshape(g.dense(x, *w.embed), 1, n)
    g.output(g.dense(g.dense(s, *w.mlp[0], relu=True), *w.mlp[1]), "q")
    for number, h in enumerate(states):
        g.output(h, f"next{number}")


def displacement(w, g):
    k_s = len(w.gru[2])
    both = g.concat([g.input("p", 1, k_s), g.input("q", 1, len(w.basis) - k_s)], 1)
    g.output(g.dense(both, w.basis), "delta")


def skinning(w, g):
    n, m = w.skin.shape
    d, linear = g.input("d", 1, 3 * m), g.input("linear", m, 3, 3)
    posed, delta = g.input("posed", m, 3), g.input("delta", 1, 3 * n)
    pivots = g.binary("ADD", g.reshape(d, m, 1, 3), g.constant(w.pivots[:, None]))
    offset = g.binary("SUB", posed, g.reduce("SUM", g.binary("MUL", linear, pivots), 2))
    bones = g.reshape(g.concat([linear, g.reshape(offset, m, 3, 1)], 2), m, 12)
    blended = g.reshape(g.op("BATCH_MATMUL", [g.constant(w.skin), bones], (n, 12)), n, 3, 4)
    point = g.binary("ADD", g.reshape(delta, n, 3), g.constant(w.template))
    point = g.reshape(g.concat([point, g.constant(np.ones((n, 1)))], 1), n, 1, 4)
    g.output(g.reduce("SUM", g.binary("MUL", blended, point), 2), "positions")


AGGREGATIONS = {"gather, sum": gather_and_reduce, "gather per neighbour, add": gather_each_neighbour}
STAGES = {"static": {"dense": static}, "skeleton": {"two products": skeleton},
          "mesh": {name: (lambda w, g, a=aggregate: mesh(w, g, a)) for name, aggregate in AGGREGATIONS.items()},
          "displacement": {"stacked basis": displacement}, "skinning": {"dense": skinning}}
