"""Each stage against plain loops in float64, and the whole network tick by tick."""
import numpy as np
import pytest
import torch

from conftest import tube
from dcloth_training import geometry, losses, unskin
from dcloth_training.stages.mesh_stage import BodyPoints
from dcloth_training.stages.mesh_stage import Graph, GsgruLayer, MeshStage
from dcloth_training.stages.skeleton_stage import SkeletonStage
from dcloth_training.stages.static_stage import StaticStage

EPS = np.finfo(np.float64).eps
torch.manual_seed(0)


def orthonormal(count, generator, largest=1.0):
    turns = generator.standard_normal((count, 3, 3)) * largest
    return torch.from_numpy(np.stack([np.linalg.qr(np.eye(3) + t - t.T)[0] *
                                      np.sign(np.diag(np.linalg.qr(np.eye(3) + t - t.T)[1]))
                                      for t in turns]))


def static_stage(generator, n=20, m=3, d=7):
    weights = torch.from_numpy(generator.dirichlet(np.ones(m), n))
    stage = StaticStage(torch.from_numpy(generator.standard_normal((n, 3))),
                        torch.from_numpy(generator.standard_normal((m, 3))), weights, d, 8).double()
    torch.nn.init.normal_(stage.mlp[2].weight, std=0.1)
    torch.nn.init.normal_(stage.residual_weights, std=0.2)
    return stage


def test_static_stage_matches_loops():
    generator = np.random.default_rng(0)
    stage, x = static_stage(generator), torch.randn(7).double()
    linear = orthonormal(3, generator)
    posed = torch.from_numpy(generator.standard_normal((3, 3)))
    got = stage(x, linear, posed).detach().numpy()
    p = {k: v.detach().numpy() for k, v in stage.state_dict().items()}
    hidden = [max(0, r) for r in p["mlp.0.weight"] @ x.numpy() + p["mlp.0.bias"]]
    increments = (p["mlp.2.weight"] @ hidden + p["mlp.2.bias"]).reshape(3, 3)
    summed = np.maximum(p["initial_weights"] + p["residual_weights"].sum(0), 0)
    for i in range(20):
        expected = np.zeros(3)
        for j in range(3):
            turned = linear[j].numpy() @ (p["template"][i] - p["pivots"][j] - increments[j])
            expected += summed[i, j] / summed[i].sum() * (turned + posed[j].numpy())
        assert np.abs(got[i] - expected).max() < 500 * EPS


def test_a_fresh_static_stage_is_plain_skinning():
    generator = np.random.default_rng(1)
    n, m = 9, 3
    stage = StaticStage(torch.from_numpy(generator.standard_normal((n, 3))),
                        torch.from_numpy(generator.standard_normal((m, 3))),
                        torch.from_numpy(generator.dirichlet(np.ones(m), n)), 5).double()
    linear = torch.eye(3).double().expand(m, 3, 3)
    got = stage(torch.randn(5).double(), linear, stage.pivots).detach()
    assert torch.allclose(got, stage.template, atol=1e-14)


def test_unskin_then_skin_returns_the_truth():
    generator = np.random.default_rng(2)
    stage = static_stage(generator)

    class Pose:
        x = torch.randn(40, 7).double()
        linear = torch.stack([orthonormal(3, generator, 0.3) for _ in range(40)])
        posed = torch.from_numpy(generator.standard_normal((40, 3, 3)))

    truth = generator.standard_normal((40, 20, 3))
    delta = unskin.residual(stage, torch.nn.Identity(), Pose, truth, damping=0.0)
    back = stage(Pose.x, Pose.linear, Pose.posed, torch.from_numpy(delta).double()).detach().numpy()
    blended = stage.blend(stage.bone_matrices(Pose.x, Pose.linear, Pose.posed))[..., :3].detach()
    conditions = np.linalg.cond(blended.numpy())
    # delta is stored as float32; squaring in the normal equations costs the condition squared.
    bound = 4 * np.finfo(np.float32).eps * (np.abs(delta).max(-1) + 1) + 100 * EPS * conditions ** 2
    assert (np.abs(back - truth).max(-1) < bound).all()


def test_principal_components_are_those_of_the_svd():
    generator = np.random.default_rng(3)
    low = generator.standard_normal((200, 5)) @ generator.standard_normal((5, 60)) * 3
    data = low.astype(np.float32)
    vectors, values = unskin.principal(lambda: np.array_split(data, 7), 200, 5)
    exact = np.linalg.svd(data)[1][:5] / np.sqrt(200)
    assert np.allclose(values, exact, rtol=1e-4)
    assert np.allclose(vectors @ vectors.T, np.eye(5), atol=1e-5)
    assert np.abs(data @ vectors.T @ vectors - data).max() < 1e-3


def test_skeleton_stage_is_pytorchs_gru_cell_and_the_formulas():
    stage = SkeletonStage(4, 6, 5).double()
    cell = torch.nn.GRUCell(6, 5).double()
    cell.load_state_dict({k.replace("_l0", ""): v for k, v in stage.gru.state_dict().items()})
    x, h, plain = torch.randn(9, 6).double(), torch.zeros(1, 5).double(), np.zeros(5)
    got = stage(x[None])[0][0]
    w_i, w_h, b_i, b_h = (p.detach().numpy() for p in stage.gru.parameters())

    def logistic(v):
        return 1 / (1 + np.exp(-v))

    for t in range(9):
        h = cell(x[t:t + 1], h)
        a, u = w_i @ x[t].numpy() + b_i, w_h @ plain + b_h
        r, z = logistic(a[:5] + u[:5]), logistic(a[5:10] + u[5:10])
        plain = (1 - z) * np.tanh(a[10:] + r * u[10:]) + z * plain
        assert torch.allclose(got[t], h[0], atol=1e-14)
        assert np.abs(got[t].detach().numpy() - plain).max() < 1e3 * EPS
    torch.nn.init.normal_(stage.basis)
    assert torch.allclose(stage.displacement(got)[3, 2],
                          sum(got[3, j] * stage.basis[j, 2] for j in range(5)))


def test_graph_mean_and_its_gradient():
    _, faces, _ = tube(1, 4, 6, 1, 0)
    columns, present = geometry.padded_neighbours(faces, 24)
    assert len(set(present.sum(1))) > 1       # borders have fewer neighbours
    graph = Graph(columns, present)
    x = torch.randn(24, 2, 3, dtype=torch.float64, requires_grad=True)
    lists = geometry.neighbours(faces, 24)
    expected = torch.stack([x[torch.as_tensor(row)].mean(0) for row in lists])
    assert torch.allclose(graph(x), expected, atol=1e-14)
    assert torch.autograd.gradcheck(graph, (x,))


@pytest.mark.parametrize("inputs", [3, 8])
def test_layer_matches_loops_over_vertices(inputs):
    _, faces, _ = tube(1, 4, 6, 1, 0)
    lists = geometry.neighbours(faces, 24)
    layer = GsgruLayer(inputs, 8).double()
    for p in layer.parameters():
        torch.nn.init.normal_(p, std=0.5)
    p = {k: v.detach().numpy() for k, v in layer.state_dict().items()}
    graph = Graph(*geometry.padded_neighbours(faces, 24))
    x, h = np.random.default_rng(4).standard_normal((2, 24, 8))
    x = x[:, :inputs]
    got, state = (v.detach().numpy()[:, 0] for v in layer(
        torch.from_numpy(x)[:, None], torch.from_numpy(h)[:, None], graph))
    for i in range(24):
        a = sum(x[j] @ p["w_p"] for j in lists[i]) / len(lists[i]) + p["b"]
        z = 1 / (1 + np.exp(-(a @ p["w_z"] + h[i] @ p["u_z"])))
        r = 1 / (1 + np.exp(-(a @ p["w_r"] + h[i] @ p["u_r"])))
        g = np.tanh(a @ p["w"] + (r * h[i]) @ p["u"])
        new = (1 - z) * h[i] + z * g
        o = new @ p["w_o"] + p["b_o"]
        norm = (o - o.mean()) / np.sqrt(((o - o.mean()) ** 2).mean() + 1e-5)
        norm = norm * p["norm.weight"] + p["norm.bias"]
        out = np.where(norm >= 0, norm, p["prelu"][0] * norm)
        assert np.abs(state[i] - new).max() < 1e3 * EPS
        assert np.abs(got[i] - out).max() < 1e5 * EPS    # division by a deviation of order 0.1


def test_mesh_stage_couples_vertices_in_the_head_only():
    """What a vertex embeds depends, a tick, on vertices at most three edges away; Q on all; the head is plain
    algebra."""
    _, faces, _ = tube(1, 9, 6, 1, 0)
    torch.manual_seed(3)
    mesh = MeshStage(*geometry.padded_neighbours(faces, 54), torch.tensor([0.1, -0.2, 0.3]),
                     torch.tensor([2.0, 1.0, 0.5]), hidden=5, size=2).double()
    assert not mesh.coefficients(torch.randn(2, 54).double()).any()             # starts at stage 2's result
    points = torch.randn(54, 2, 3).double()
    first, states = mesh.embedded(points, mesh.reset(2, mesh.embed.weight))

    x = (points - torch.tensor([0.1, -0.2, 0.3])) / torch.tensor([2.0, 1.0, 0.5])
    for i, layer in enumerate(mesh.layers):
        x, expected = layer(x, torch.zeros(54, 2, 8).double(), mesh.graph)
        assert torch.equal(states[i], expected)
    by_hand = (x * mesh.embed.weight[0]).sum(-1) + mesh.embed.bias[0]
    assert torch.allclose(first, by_hand.t(), atol=1e-14)

    lists, reached = geometry.neighbours(faces, 54), {20}
    for _ in mesh.layers:
        reached = {j for i in reached for j in lists[i]}
    moved = points.clone()
    moved[20, 0] += 1.0
    second, _ = mesh.embedded(moved, mesh.reset(2, mesh.embed.weight))
    changed = (second != first)[0].nonzero().flatten().tolist()
    assert set(changed) == reached and len(reached) < 54
    assert torch.equal(second[1], first[1])                                     # the other clip of the batch

    torch.nn.init.normal_(mesh.mlp[2].weight)
    torch.nn.init.normal_(mesh.basis)
    hidden = torch.clamp(first @ mesh.mlp[0].weight.t() + mesh.mlp[0].bias, min=0)
    q = mesh.coefficients(first)
    assert torch.allclose(q, hidden @ mesh.mlp[2].weight.t(), atol=1e-14) and q.abs().min() > 0
    assert torch.allclose(mesh.displacement(q)[0], q[0, 0] * mesh.basis[0] + q[0, 1] * mesh.basis[1], atol=1e-14)


def test_body_points_are_skinned_points():
    generator = np.random.default_rng(6)
    points, weights = generator.standard_normal((7, 3)), generator.dirichlet(np.ones(4), 7)
    frame = generator.standard_normal((2, 4, 3, 4))
    got = BodyPoints(points, weights)(torch.from_numpy(frame))
    for i in range(7):
        for b in range(2):
            expected = sum(weights[i, j] * (frame[b, j, :, :3] @ points[i] + frame[b, j, :, 3])
                           for j in range(4))
            assert np.abs(got[i, b].numpy() - expected).max() < 200 * EPS


def test_skinned_distance_measures_after_the_blended_rotation():
    linear = torch.stack([torch.eye(3), 2 * torch.eye(3)])[None]     # one tick, two bones
    weights = torch.tensor([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    error = torch.tensor([[[3.0, 0, 4], [0, 3, 4], [0, 0, 2.0]]])
    assert float(losses.skinned_distance(linear, weights, error)) == pytest.approx(
        (5 + 10 + 3) / 3, rel=1e-6)


def test_pruned_weights_keep_the_strongest_and_stay_pruned():
    stage = static_stage(np.random.default_rng(8), m=6)
    before = stage.weights().detach()
    stage.prune(2)
    after = stage.weights()
    assert ((after > 0).sum(1) <= 2).all()
    top = before.topk(2).indices
    kept = before.gather(1, top)
    assert torch.allclose(after.gather(1, top), kept / kept.sum(1, keepdim=True))
    after.square().sum().backward()
    dropped = after == 0
    assert dropped.any() and not stage.residual_weights.grad[:, dropped].any()


def test_a_bundle_holds_the_sum_of_the_residual_weights_and_training_goes_on_from_it():
    generator = np.random.default_rng(4)
    stage, other, on = static_stage(generator), static_stage(generator), static_stage(generator)
    held = stage.trained()["residual_weights"]
    assert held.shape == (1, *stage.initial_weights.shape)
    assert torch.equal(held[0], stage.residual_weights.sum(0))
    other.residual_weights = torch.nn.Parameter(held.detach())    # as a bundle's stage comes
    other.load_state_dict({**stage.state_dict(), "residual_weights": held})
    on.take(other)
    assert on.residual_weights.shape == stage.residual_weights.shape and torch.equal(on.weights(), stage.weights())


def test_trained_pivots_are_blind_to_root_motion():
    from dcloth_training import fit_static
    torch.manual_seed(2)
    stage = StaticStage(torch.rand(5, 3), torch.rand(2, 3), torch.full((5, 2), 0.5), 22, width=8)
    torch.nn.init.normal_(stage.mlp[2].weight)
    x = torch.randn(6, 22)
    x[:, -4:] = torch.tensor([0.3, -1.0, 0.2, 0.7])
    before = stage.increments(x)
    fit_static.still(stage, x)
    assert torch.allclose(stage.increments(x), before, atol=1e-6)
    x[:, -4:] = 100.0
    assert torch.allclose(stage.increments(x), before, atol=1e-6)
