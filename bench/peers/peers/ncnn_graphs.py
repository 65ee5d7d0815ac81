"""The stages as ncnn models, written directly: text layers and one weight file.

ncnn has no gather. GridSample with its nearest-neighbour mode is one: the grid holds the neighbours' places along a row
of n pixels. Features are channels, so that dense layers are 1 x 1 convolutions.
"""
import numpy as np

ADD, SUB, MUL = 0, 1, 2
RSQRT = 6
SUM, MEAN = 0, 3


class Graph:
    """Builds one model; values are names. A value with several readers gets the Split layer that ncnn asks for."""

    def __init__(self):
        self.layers, self.weights, self.outputs = [], [], []

    def op(self, kind, inputs, outputs=1, **parameters):
        names = [f"v{len(self.layers)}_{i}" for i in range(outputs)]
        # p0=, pm23300= for 0=, -23300=
        numbered = {k.lstrip("p").replace("m", "-"): v for k, v in parameters.items()}
        self.layers.append((kind, list(inputs), names, numbered))
        return names[0] if outputs == 1 else names

    def input(self, name):
        self.layers.append(("Input", [], [name], {}))
        return name

    def constant(self, value, w, h=0, c=0):
        self.weights.append(np.ascontiguousarray(value, np.float32).tobytes())
        return self.op("MemoryData", [], p0=w, p1=h, p2=c)

    def _weights(self, matrix, bias):
        self.weights += [b"\0\0\0\0", np.ascontiguousarray(matrix.T, np.float32).tobytes(),
                         np.ascontiguousarray(bias, np.float32).tobytes()]

    def dense(self, x, matrix, bias=None, relu=False):
        """Of a vector [in]."""
        self._weights(matrix, np.zeros(matrix.shape[1]) if bias is None else bias)
        return self.op("InnerProduct", [x], p0=matrix.shape[1], p1=1, p2=matrix.size, p9=int(relu))

    def pointwise(self, x, matrix, bias):
        """Of each vertex's features, [in, 1, n]."""
        self._weights(matrix, bias)
        return self.op("Convolution", [x], p0=matrix.shape[1], p1=1, p5=1, p6=matrix.size)

    def binary(self, kind, a, b):
        return self.op("BinaryOp", [a, b], p0=kind)

    def slice(self, x, sizes):
        return self.op("Slice", [x], outputs=len(sizes), pm23300=f"{len(sizes)}," + ",".join(map(str, sizes)), p1=0)

    def concat(self, *parts):
        return self.op("Concat", parts, p0=0)

    def reduce(self, kind, x, axis):
        return self.op("Reduction", [x], p0=kind, p1=0, pm23303=f"1,{axis}", p4=1, p5=1)

    def output(self, value, name):
        self.outputs.append((value, name))

    def save(self, stem):
        lines, readers = [], {}
        for _, inputs, _, _ in self.layers:
            for name in inputs:
                readers[name] = readers.get(name, 0) + 1
        named = dict(self.outputs)
        for name in named:
            readers[name] = readers.get(name, 0) + 1
        copies, blobs = {}, 0
        for number, (kind, inputs, outputs, parameters) in enumerate(self.layers):
            inputs = [copies[name].pop() if name in copies else name for name in inputs]
            words = [kind, f"l{number}", str(len(inputs)), str(len(outputs)), *inputs]
            final = [named[name] if name in named and readers[name] == 1 else name for name in outputs]
            lines.append(" ".join(words + final + [f"{k}={v}" for k, v in parameters.items()]))
            blobs += len(outputs)
            for name in outputs:
                count = readers.get(name, 0)
                if count > 1:
                    copies[name] = [f"{name}_{i}" for i in range(count)]
                    if name in named:
                        copies[name][0] = named[name]    # popped last, that is by no layer
                    lines.append(f"Split s{name} 1 {count} {name} {' '.join(copies[name])}")
                    blobs += count
        with open(f"{stem}.param", "w", encoding="ascii") as file:
            file.write(f"7767517\n{len(lines)} {blobs}\n" + "\n".join(lines) + "\n")
        with open(f"{stem}.bin", "wb") as file:
            file.write(b"".join(self.weights))
        return stem


def static(w, g):
    g.output(g.dense(g.dense(g.input("x"), *w.static[0], relu=True), *w.static[1]), "d")


def skeleton(w, g):
    matrix, bias, recurrent, recurrent_bias = w.gru
    x, h = g.input("x"), g.input("h")
    sizes = [len(recurrent)] * 3
    i, j = g.slice(g.dense(x, matrix, bias), sizes), g.slice(g.dense(h, recurrent, recurrent_bias), sizes)
    r, z = (g.op("Sigmoid", [g.binary(ADD, i[k], j[k])]) for k in (0, 1))
    q = g.op("TanH", [g.binary(ADD, i[2], g.binary(MUL, r, j[2]))])
    g.output(g.binary(ADD, q, g.binary(MUL, z, g.binary(SUB, h, q))), "p")


def mesh(w, g):
    """As tflite_graphs.mesh, features first."""
    n, f = len(w.columns), len(w.layers[0].u)
    neighbours = w.columns[:, 1:].T
    place = np.stack([2.0 * neighbours / (n - 1) - 1, np.zeros(neighbours.shape)])
    padding, inverse = w.padding.ravel(), w.inverse_count.ravel()
    x = g.input("points")
    states = [g.input(f"h{k}") for k in range(len(w.layers))]
    for number, (layer, h) in enumerate(zip(w.layers, states)):
        rows = g.op("GridSample", [x, g.constant(place, n, len(neighbours), 2)], p0=2, p1=2, p2=1, p3=1)
        total = g.binary(ADD, g.reduce(SUM, rows, 1), g.binary(MUL, x, g.constant(1 - padding, n, 1, 1)))
        a = g.binary(MUL, total, g.constant(inverse, n, 1, 1))
        matrix = np.concatenate([layer.x[:, :2 * f], layer.u_zr])
        z, r = g.slice(g.op("Sigmoid", [g.pointwise(g.concat(a, h), matrix, layer.x_bias[:2 * f])]), [f, f])
        matrix = np.concatenate([layer.x[:, 2 * f:], layer.u])
        candidate = g.op("TanH", [g.pointwise(g.concat(a, g.binary(MUL, r, h)), matrix, layer.x_bias[2 * f:])])
        h = g.binary(ADD, h, g.binary(MUL, z, g.binary(SUB, candidate, h)))
        g.output(h, f"next{number}")
        centred = g.pointwise(h, layer.o - layer.o.mean(1, keepdims=True), layer.o_bias - layer.o_bias.mean())
        variance = g.reduce(MEAN, g.binary(MUL, centred, centred), 0)
        scale = g.op("UnaryOp", [g.op("BinaryOp", [variance], p0=ADD, p1=1, p2=1e-5)], p0=RSQRT)
        g.weights += [layer.norm_weight.tobytes(), layer.norm_bias.tobytes()]
        normed = g.op("Scale", [g.binary(MUL, centred, scale)], p0=f, p1=1)
        x = g.op("ReLU", [normed], p0=layer.slope)
    s = g.op("Reshape", [g.pointwise(x, *w.embed)], p0=n)
    g.output(g.dense(g.dense(s, *w.mlp[0], relu=True), *w.mlp[1]), "q")


def displacement(w, g):
    g.output(g.dense(g.concat(g.input("p"), g.input("q")), w.basis), "delta")


STAGES = {"static": static, "skeleton": skeleton, "mesh": mesh, "displacement": displacement}
