"""The stages as ONNX graphs (opset 17), in every formulation that is tried."""
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

MEAN = "mean"    # name of the sparse input


class Graph:
    """Builds one graph; values are names."""

    def __init__(self, name):
        self.name, self.nodes, self.initializers = name, [], []
        self.inputs, self.outputs, self.count = [], [], 0

    def input(self, name, *shape):
        self.inputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, shape))
        return name

    def constant(self, value, dtype=np.float32):
        name = f"c{len(self.initializers)}"
        self.initializers.append(numpy_helper.from_array(np.ascontiguousarray(value, dtype), name))
        return name

    def indices(self, value):
        return self.constant(value, np.int64)

    def op(self, kind, *inputs, outputs=1, domain="", **attributes):
        names = [f"v{self.count + i}" for i in range(outputs)]
        self.count += outputs
        self.nodes.append(helper.make_node(kind, list(inputs), names, f"{kind}_{self.count}", domain=domain,
                                           **attributes))
        return names[0] if outputs == 1 else names

    def linear(self, x, matrix, bias):
        return self.op("Add", self.op("MatMul", x, self.constant(matrix)), self.constant(bias))

    def output(self, value, name, *shape):
        self.nodes.append(helper.make_node("Identity", [value], [name], f"out_{name}"))
        self.outputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, shape))

    def save(self, path):
        graph = helper.make_graph(self.nodes, self.name, self.inputs, self.outputs, self.initializers)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17),
                                                        helper.make_opsetid("com.microsoft", 1)], ir_version=8)
        onnx.save(model, str(path))
        return path


def static(w):
    g = Graph("static")
    hidden = g.op("Relu", g.linear(g.input("x", 1, w.static[0][0].shape[0]), *w.static[0]))
    g.output(g.linear(hidden, *w.static[1]), "d", 1, w.static[1][0].shape[1])
    return g


def skeleton_matrices(w):
    """The GRU as two products and elementwise steps."""
    matrix, bias, recurrent, recurrent_bias = w.gru
    size = len(recurrent)
    g = Graph("skeleton")
    x, h = g.input("x", 1, len(matrix)), g.input("h", 1, size)
    split = g.indices([size] * 3)
    i = g.op("Split", g.linear(x, matrix, bias), split, outputs=3, axis=1)
    j = g.op("Split", g.linear(h, recurrent, recurrent_bias), split, outputs=3, axis=1)
    r, z = (g.op("Sigmoid", g.op("Add", i[k], j[k])) for k in (0, 1))
    q = g.op("Tanh", g.op("Add", i[2], g.op("Mul", r, j[2])))
    g.output(g.op("Add", q, g.op("Mul", z, g.op("Sub", h, q))), "p", 1, size)
    return g


def skeleton_operator(w):
    """The GRU as ONNX's own operator, gates in its order z, r, q."""
    def order(value):
        r, z, q = np.split(value.T if value.ndim == 2 else value, 3)
        return np.concatenate([z, r, q])
    matrix, bias, recurrent, recurrent_bias = w.gru
    size = len(recurrent)
    g = Graph("skeleton")
    x, h = g.input("x", 1, len(matrix)), g.input("h", 1, size)
    both = np.concatenate([order(bias), order(recurrent_bias)])[None]
    shape = g.indices([1, 1, -1])
    _, state = g.op("GRU", g.op("Reshape", x, shape), g.constant(order(matrix)[None]),
                    g.constant(order(recurrent)[None]), g.constant(both), "", g.op("Reshape", h, shape), outputs=2,
                    hidden_size=size, linear_before_reset=1)
    g.output(g.op("Reshape", state, g.indices([1, size])), "p", 1, size)
    return g


def _without_padding(g, w, total, x):
    """Mean over N(i) from the sum over padded rows, which count vertex i too often."""
    return g.op("Mul", g.op("Sub", total, g.op("Mul", x, g.constant(w.padding))), g.constant(w.inverse_count))


def gather_and_reduce(g, w, x):
    rows = g.op("Gather", x, g.indices(w.columns), axis=0)
    return _without_padding(g, w, g.op("ReduceSum", rows, g.indices([1]), keepdims=0), x)


def gather_each_neighbour(g, w, x):
    rows = [g.op("Gather", x, g.indices(w.columns[:, k]), axis=0) for k in range(1, w.columns.shape[1])]
    return _without_padding(g, w, g.op("Sum", x, *rows), x)


def mean_entries(w):
    """The matrix of the mean over N(i) -> (row starts [n + 1], columns, values), rows in rising columns."""
    n, width = w.columns.shape
    present = np.ones_like(w.columns, bool)
    present[:, 1:] = w.columns[:, 1:] != w.columns[:, :1]
    row = np.repeat(np.arange(n), width)[present.ravel()]
    order = np.lexsort((w.columns[present], row))
    values = np.broadcast_to(w.inverse_count, (n, width))[present][order]
    return np.searchsorted(row, np.arange(n + 1)), w.columns[present][order], np.ascontiguousarray(values, np.float32)


def sparse_product(g, w, x):
    """ONNX Runtime's own operator; its matrix can only come as an input."""
    n = len(w.columns)
    if MEAN not in (i.name for i in g.inputs):
        g.inputs.append(helper.make_sparse_tensor_value_info(MEAN, TensorProto.FLOAT, [n, n]))
    return g.op("SparseToDenseMatMul", MEAN, x, domain="com.microsoft")


AGGREGATIONS = {"gather, reduce": gather_and_reduce, "gather per neighbour, sum": gather_each_neighbour,
                "sparse product": sparse_product}


def gates_apart(g, layer, a, h, width):
    """z, r and the candidate's function of r h, from products of a and h of their own."""
    a_zr, a_g = g.op("Split", g.linear(a, layer.x, layer.x_bias), g.indices([2 * width, width]), outputs=2, axis=1)
    zr = g.op("Sigmoid", g.op("Add", a_zr, g.op("MatMul", h, g.constant(layer.u_zr))))
    return zr, lambda rh: g.op("Add", a_g, g.op("MatMul", rh, g.constant(layer.u)))


def gates_side_by_side(g, layer, a, h, width):
    """The same from one product of [a | h]."""
    zr_matrix = np.concatenate([layer.x[:, :2 * width], layer.u_zr])
    matrix = np.concatenate([layer.x[:, 2 * width:], layer.u])
    zr = g.op("Sigmoid", g.linear(g.op("Concat", a, h, axis=1), zr_matrix, layer.x_bias[:2 * width]))
    return zr, lambda rh: g.linear(g.op("Concat", a, rh, axis=1), matrix, layer.x_bias[2 * width:])


def mesh(w, aggregate, gates):
    n, width = len(w.columns), len(w.layers[0].u)
    g = Graph("mesh")
    x = g.input("points", n, 3)
    for number, layer in enumerate(w.layers):
        h = g.input(f"h{number}", n, width)
        zr, candidate_of = gates(g, layer, aggregate(g, w, x), h, width)
        z, r = g.op("Split", zr, g.indices([width, width]), outputs=2, axis=1)
        candidate = g.op("Tanh", candidate_of(g.op("Mul", r, h)))
        h = g.op("Add", h, g.op("Mul", z, g.op("Sub", candidate, h)))
        g.output(h, f"next{number}", n, width)
        normed = g.op("LayerNormalization", g.linear(h, layer.o, layer.o_bias), g.constant(layer.norm_weight),
                      g.constant(layer.norm_bias), axis=-1, epsilon=1e-5)
        x = g.op("LeakyRelu", normed, alpha=layer.slope)
    s = g.op("Reshape", g.linear(x, *w.embed), g.indices([1, n]))
    g.output(g.linear(g.op("Relu", g.linear(s, *w.mlp[0])), *w.mlp[1]), "q", 1, w.mlp[1][0].shape[1])
    return g


def displacement(w):
    g = Graph("displacement")
    k_s = len(w.gru[2])
    both = g.op("Concat", g.input("p", 1, k_s), g.input("q", 1, len(w.basis) - k_s), axis=1)
    g.output(g.op("MatMul", both, g.constant(w.basis)), "delta", 1, w.basis.shape[1])
    return g


def skinning(w):
    """Blended bone matrices as one product with all m bones; the peers have no sparse influences."""
    n, m = w.skin.shape
    g = Graph("skinning")
    d, linear = g.input("d", 1, 3 * m), g.input("linear", m, 3, 3)
    posed, delta = g.input("posed", m, 3), g.input("delta", 1, 3 * n)
    pivots = g.op("Add", g.op("Reshape", d, g.indices([m, 3, 1])), g.constant(w.pivots[..., None]))
    offset = g.op("Sub", g.op("Reshape", posed, g.indices([m, 3, 1])), g.op("MatMul", linear, pivots))
    bones = g.op("Reshape", g.op("Concat", linear, offset, axis=2), g.indices([m, 12]))
    blended = g.op("Reshape", g.op("MatMul", g.constant(w.skin), bones), g.indices([n, 3, 4]))
    point = g.op("Add", g.op("Reshape", delta, g.indices([n, 3])), g.constant(w.template))
    point = g.op("Reshape", g.op("Concat", point, g.constant(np.ones((n, 1))), axis=1), g.indices([n, 1, 4]))
    g.output(g.op("ReduceSum", g.op("Mul", blended, point), g.indices([2]), keepdims=0), "positions", n, 3)
    return g


def candidates(w):
    """{stage: {formulation: function that builds it}}."""
    return {"static": {"dense": lambda: static(w)},
            "skeleton": {"two products": lambda: skeleton_matrices(w), "GRU operator": lambda: skeleton_operator(w)},
            "mesh": {f"{name}{suffix}": (lambda a=aggregate, b=gates: mesh(w, a, b))
                     for name, aggregate in AGGREGATIONS.items()
                     for suffix, gates in (("", gates_apart), (", gates side by side", gates_side_by_side))},
            "displacement": {"stacked basis": lambda: displacement(w)},
            "skinning": {"dense": lambda: skinning(w)}}
