"""Stage 3's window in C++ against the same in PyTorch: values, states and gradients."""
import pytest
import torch

from conftest import tube
from dcloth_training import geometry, mesh_bptt
from dcloth_training.stages.mesh_stage import MeshStage

try:
    mesh_bptt.library()
except FileNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)

NAMES = {"w_p", "b", "w_z", "w_r", "w", "u_z", "u_r", "u", "w_o", "b_o", "norm.weight", "norm.bias", "prelu"}


def stage(width=8, layers=3, dtype=torch.float64, seed=4):
    """A stage on an irregular graph (an open tube: 3 to 7 in N(i)), every parameter away from its start."""
    vertices, faces, _ = tube(0.2, 5, 9, 1.0, 0.5)
    torch.manual_seed(seed)
    mesh = MeshStage(*geometry.padded_neighbours(faces, len(vertices)), torch.zeros(3), torch.ones(3), width, layers,
                     hidden=4, size=2).double()
    with torch.no_grad():
        for parameter in list(mesh.layers.parameters()) + list(mesh.embed.parameters()):
            parameter += 0.2 * torch.randn_like(parameter)
    return mesh.to(dtype)


def window(mesh, ticks=5, batch=6, seed=5):
    generator = torch.Generator().manual_seed(seed)
    n = len(mesh.graph.columns)
    points = torch.randn(ticks, n, batch, 3, generator=generator, dtype=torch.float64)
    weights = torch.randn(2, ticks, batch, n, generator=generator, dtype=torch.float64)
    return points.to(mesh.embed.weight.dtype), weights.to(mesh.embed.weight.dtype)


def learn(kind, mesh, points, weights):
    """Two windows in a row, the second from the first's states -> (s of both, gradients by name)."""
    run, out = kind(mesh), []
    states = run.fresh(points.shape[2])
    mesh.zero_grad()
    for part in weights:
        s = run.run(points, states)
        ((s - part) ** 2).sum().backward()
        out.append(s.detach())
    names = [n for n, _ in mesh.named_parameters() if n.startswith(("layers", "embed"))]
    return torch.stack(out), {n: p.grad.clone() for n, p in mesh.named_parameters() if n in names}


@pytest.mark.parametrize("width,layers", [(4, 1), (4, 3), (8, 1), (8, 2), (8, 3), (16, 2), (32, 2)])
def test_values_and_gradients_are_pytorchs_in_float64(width, layers):
    mesh = stage(width, layers)
    points, weights = window(mesh)
    expected, by = learn(mesh_bptt.Torch, mesh, points, weights)
    got, found = learn(mesh_bptt.Native, mesh, points, weights)
    assert expected.std() > 0.02 and not torch.equal(expected[0], expected[1])
    # Both sum the same few hundred terms in another order; folding W^p adds one product.
    assert float((got - expected).abs().max()) < 1e-11 * float(expected.abs().max())
    assert {n.split(".", 2)[2] for n in by if n.startswith("layers")} == NAMES and len(by) == layers * len(NAMES) + 2
    for name, value in by.items():
        assert float(value.abs().max()) > 0, name
        assert float((found[name] - value).abs().max()) < 1e-10 * float(value.abs().max()), name


@pytest.mark.parametrize("width", mesh_bptt.WIDTHS)
def test_float32_is_as_close_to_float64_as_pytorchs(width):
    """Bound: 1e-5 of the largest value and of a gradient's norm. Some 40 roundings of 6e-8 and the rational tanh's 4e-7
    a tick, half of them in one direction, ten ticks."""
    mesh, single = stage(width), stage(width, dtype=torch.float32)
    single.load_state_dict(mesh.state_dict())
    points, weights = window(single)
    mesh.load_state_dict(single.state_dict())     # rounded weights, exactly
    expected, by = learn(mesh_bptt.Torch, mesh, points.double(), weights.double())
    got, found = learn(mesh_bptt.Native, single, points, weights)
    assert found["embed.weight"].dtype == torch.float32
    assert float((got.double() - expected).abs().max()) < 1e-5 * float(expected.abs().max())
    for name, value in by.items():
        assert float((found[name].double() - value).norm()) < 1e-5 * float(value.norm()), name


def test_gradient_is_the_slope_of_the_loss():
    """Independent of PyTorch's formulas: central differences, h = 1e-5, error h^2 and 1e-16 / h.

    PReLU at slope 1: of 10,000 kinks some lie within h, and each would cost h."""
    mesh = stage(8, 2)
    with torch.no_grad():
        for layer in mesh.layers:
            layer.prelu.fill_(1.0)
    points, weights = window(mesh, ticks=4, batch=8)
    run, flat = mesh_bptt.Native(mesh), mesh_bptt.flat_weights(mesh).detach()
    rows = points.transpose(2, 3).contiguous()

    def loss(values):
        s = mesh_bptt._Window.apply(values, run, rows, run.fresh(8), True)
        return ((s - weights[0].transpose(1, 2)) ** 2).sum()

    at = flat.clone().requires_grad_()
    loss(at).backward()
    generator = torch.Generator().manual_seed(6)
    for _ in range(5):
        along = torch.randn(len(flat), generator=generator, dtype=torch.float64)
        slope = (loss(flat + 1e-5 * along) - loss(flat - 1e-5 * along)) / 2e-5
        assert abs(float(slope) - float(at.grad @ along)) < 1e-6 * float(at.grad.norm() * along.norm())


def test_lanes_do_not_know_of_each_other():
    mesh = stage()
    points, weights = window(mesh, batch=8)
    together, _ = learn(mesh_bptt.Native, mesh, points, weights)
    for lane in (0, 7):
        alone, _ = learn(mesh_bptt.Native, mesh, points[:, :, lane:lane + 1].contiguous(), weights[:, :, lane:lane + 1])
        assert torch.equal(alone[:, :, 0], together[:, :, lane])
    again, _ = learn(mesh_bptt.Native, mesh, points, weights)
    assert torch.equal(again, together)


def test_without_gradient_the_values_are_the_same_and_nothing_is_taped():
    mesh = stage(dtype=torch.float32)
    points, _ = window(mesh)
    first, second = mesh_bptt.Native(mesh), mesh_bptt.Native(mesh)
    with torch.no_grad():
        plain = first.run(points, first.fresh(6))
    taped = second.run(points, second.fresh(6))
    assert torch.equal(plain, taped.detach()) and first.tape is None and second.tape is not None


def test_what_it_cannot_do_is_refused(monkeypatch):
    mesh = stage()
    points, _ = window(mesh)
    run = mesh_bptt.Native(mesh)
    with pytest.raises(ValueError, match="9 clips side by side; the library has 8"):
        run.fresh(9)
    first = run.run(points, run.fresh(6))
    run.run(points, run.fresh(6))
    with pytest.raises(RuntimeError, match="another window ran"):
        first.sum().backward()
    odd = stage(6)
    with pytest.raises(ValueError, match="width 6.*widths 4, 8, 16, 32"):
        mesh_bptt.Native(odd)
    told = []
    assert isinstance(mesh_bptt.recurrence(odd, told.append), mesh_bptt.Torch) and "width 6" in told[0]
    assert isinstance(mesh_bptt.recurrence(mesh), mesh_bptt.Native)
    # One element off the boundary: refused, not read.
    shape = run._shape(5)
    aligned = torch.zeros(10 ** 6, dtype=torch.float64)
    assert not run.library.mesh_bptt_forward_f64(shape, *[aligned.data_ptr()] * 3, aligned.data_ptr() + 8, None,
                                                 *[aligned.data_ptr()] * 2)
    assert run.library.mesh_bptt_tape_size(mesh_bptt._Shape(0, 1, 1, 8, None, None)) == 0


@pytest.mark.parametrize("width,layers", [(4, 1), (8, 3), (32, 2)])
def test_lent_memory_is_used_to_its_size_and_no_further(width, layers):
    mesh = stage(width, layers, torch.float32)
    points, weights = window(mesh)
    run, past = mesh_bptt.Native(mesh), 512
    for name in ("tape", "scratch"):
        size = getattr(run.library, f"mesh_bptt_{name}_size")(run._shape(len(points)))
        setattr(run, name, torch.full((size + past,), 12345.0))
    states = torch.full((run.fresh(1).numel() + past,), 12345.0)
    inside = states[:-past].view(run.fresh(1).shape).zero_()
    run.run(points, inside)[0].sum().backward()
    for held in (run.tape, run.scratch, states):
        assert (held[-past:] == 12345.0).all() and held[-past - 1] != 12345.0
