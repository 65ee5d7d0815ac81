"""Fabric tests: the settings of the truth are cloth, whatever the size of the triangles; and the tests can fail."""
import numpy as np
import pytest

from dcloth_training.simulate import fabric, garment, settings, solver

try:
    solver.library()
except FileNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)


@pytest.mark.long
@pytest.mark.parametrize("name", garment.GARMENTS)
def test_every_number_lies_in_the_range_of_its_fabric(name):
    numbers = fabric.measure(name)
    assert fabric.outside(numbers) == [], numbers
    assert set(fabric.RANGES[numbers["fabric"]]) < set(numbers)


@pytest.mark.parametrize("changes, field", [({"bend": 3e-4}, "peirce_overhang_cm"), ({"bend": 3e-4}, "cusick_percent"),
                                            ({"drag_tangent": 0.8}, "drag_ratio")])
def test_what_is_no_cloth_leaves_its_range(changes, field):
    chosen = settings.of("wool", **changes)
    value = {"peirce_overhang_cm": lambda: fabric.peirce_overhang(chosen),
             "cusick_percent": lambda: fabric.cusick(chosen)[0],
             "drag_ratio": lambda: fabric.terminal_speed(chosen, False) / fabric.terminal_speed(chosen, True)}[field]()
    least, most = fabric.RANGES["wool"][field]
    assert not least <= value <= most


def test_the_size_of_triangles_does_not_change_the_fabric():
    """Overhang against theory: a strip of bending length c hangs 2 c over (Peirce); c^3 = B / (w g)."""
    chosen = settings.of("wool")
    theory = 200 * (chosen["bend"] / (chosen["density"] * 9.81)) ** (1 / 3)
    for spacing in (0.008, 0.0116, 0.016):
        overhang = np.mean([fabric.peirce_overhang(chosen, spacing, seed=seed) for seed in range(3)])
        assert overhang == pytest.approx(theory, rel=0.1), spacing


def test_folds_are_counted():
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    for count in (5, 7):
        assert fabric.folds(0.12 + 0.02 * np.cos(count * turn + 0.3)) == count
