"""The chord bound of a function on a grid, worked by hand; `test_maps` shows that it is never exceeded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.grid_interpolation import Grid
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.grid_bound import GridBound
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.maps import DeviationMap

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])


def departure(bound: GridBound, *delta: float) -> list[float]:
    return bound.departure(np.array([delta])).ravel().tolist()


def test_a_polyline_over_one_axis_departs_by_its_kinks_its_slope_or_its_span() -> None:
    """Columns rise by 10 mm and stay, or stay and rise by 30 mm; a move along Y alone counts."""
    values = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 30.0]])
    bound = GridBound.of(Grid.through([np.array([0.0, 10.0, 40.0])], values, "linear"), ("Y",))
    assert departure(bound, 99.0, 4.0, 99.0) == pytest.approx([1.0, 1.0])
    assert departure(bound, 0.0, -4.0, 0.0) == pytest.approx([1.0, 1.0])
    assert departure(bound, 0.0, 100.0, 0.0) == pytest.approx([10.0, 25.0])
    assert departure(bound, 0.0, 130.0, 0.0) == pytest.approx([10.0, 30.0])
    assert bound.change(np.array([[9.0, 4.0, 9.0], [0.0, -400.0, 0.0]])).tolist() == [[4, 4], [10, 30]]
    # one cell has no kink: it does not depart
    line = GridBound.of(Grid.through([np.array([0.0, 10.0])], values[:2], "linear"), ("Y",))
    assert departure(line, 0.0, 8.0, 0.0) == [0.0, 0.0]


def test_a_window_holds_all_kinks_that_a_move_of_its_length_crosses() -> None:
    """Kinks of 1 and 2 at 10 and 18 mm; 7.5 to 8 mm is one bin."""
    grid = Grid.through(
        [np.array([0.0, 10.0, 18.0, 40.0])], np.array([[0.0], [0.0], [8.0], [-14.0]]), "linear"
    )
    bound = GridBound.of(grid, ("Z",))
    for length, jump in ((0.1, 2.0), (7.4, 2.0), (7.6, 3.0), (9.0, 3.0)):
        steep = 0.5 * length
        assert departure(bound, 0.0, 0.0, length) == pytest.approx([min(0.25 * length * jump, steep)])


def test_a_product_of_two_axes_departs_by_its_mixed_derivative() -> None:
    """f = x y over 10 x 20 mm: 2 dx dy / 8; it changes by 20 dx + 10 dy at most, and by no more than 200."""
    values = np.outer([0.0, 10.0], [0.0, 20.0])[..., None]
    bound = GridBound.of(
        Grid.through([np.array([0.0, 10.0]), np.array([0.0, 20.0])], values, "linear"), ("X", "Z")
    )
    assert departure(bound, 2.0, 7.0, 4.0) == pytest.approx([2.0])
    assert departure(bound, 2.0, 7.0, 0.0) == [0.0]
    assert departure(bound, 1.0, 0.0, 100.0) == pytest.approx([25.0])
    assert departure(bound, 40.0, 0.0, 80.0) == pytest.approx([200.0])
    assert bound.change(np.array([[2.0, 0.0, -4.0], [9.0, 0.0, 9.0]])).ravel().tolist() == [80.0, 200.0]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_parabola_departs_by_its_curvature_or_half_its_change(axis: int) -> None:
    """f = q^2 over 10 mm: 2 d^2 / 8, half of 20 d, and 100."""
    q = np.array([0.0, 5.0, 10.0])
    bound = GridBound.of(Grid.through([q], (q**2)[:, None], "cubic"), ("XYZ"[axis],))
    for length, by in ((3.0, 2.25), (8.0, 16.0), (50.0, 100.0)):
        delta = np.full(3, 99.0)
        delta[axis] = -length
        assert departure(bound, *delta) == pytest.approx([by])


def test_a_map_joins_the_bounds_of_its_three_deviations() -> None:
    """Kinks of 0.3, 0 and 0.4 mm per 100 mm along X."""
    values = np.zeros((3, 2, 2, 3))
    values[1] = 0.15, 0.0, 0.2
    levels = (np.array([0.0, 100.0, 200.0]), BOX[1], BOX[2])
    box = np.array([[0.0, 200.0], *BOX[1:]])
    model = build(Calibration("m", box, maps=(DeviationMap(levels, values),)), "FXYZ")
    bound = model.chord_bound(np.array([[50.0, 3.0, 4.0], [0.0, 9.0, 9.0]]), np.zeros(3))
    np.testing.assert_allclose(bound, [0.25 * 50.0 * 5e-3, 0.0], atol=1e-15)


def test_a_load_departs_with_its_mass_its_lever_arms_and_their_change() -> None:
    """EZX and EBX with one kink each, 20 kg beyond the calibration, on FXYZ."""
    table = ComponentTable(
        "X", ("X",), (np.array([0.0, 400.0, 800.0]),), {"EZX": [0.0, 4e-4, 0.0], "EBX": [0.0, 0.0, 8e-7]},
        (0.0, 50.0, -100.0), (0.0, 0.0, -60.0), interpolation="linear",
    )  # fmt: skip
    model = build(Calibration("m", BOX, compliance=(table,), payload_kg=5.0), "FXYZ")
    tool = np.array([30.0, 0.0, -150.0, 25.0])
    delta = np.array([[100.0, 40.0, -20.0], [0.0, 1.0, 1.0]])
    # jumps 2e-6 and 2e-9 per mm; arms: row X z + t_z + 160 = -390 to 10, row Z t_x = 30 without x
    of_x = 0.25 * 100.0 * 2e-9 * 390.0 + 0.25 * 100.0 * 2e-9 * 20.0
    of_z = 0.25 * 100.0 * 2e-6 + 0.25 * 100.0 * 2e-9 * 30.0
    expected = [20.0 * math.hypot(of_x, of_z), 0.0]
    np.testing.assert_allclose(model.chord_bound(delta, tool), expected, rtol=1e-12)
    # with less than while measuring it departs as far the other way
    lighter = np.array([30.0, 0.0, -150.0, -15.0])
    np.testing.assert_allclose(model.chord_bound(delta, lighter), expected, rtol=1e-12)
    # payload and tool of each move
    rows = np.array([[0.0, 0.0, -150.0, 15.0], [30.0, 0.0, -150.0, 25.0]])
    own = [10.0 * math.hypot(of_x, 0.25 * 100.0 * 2e-6), expected[0]]
    np.testing.assert_allclose(model.chord_bound(delta[[0, 0]], rows), own, rtol=1e-12)
    assert model.chord_bound(np.zeros((0, 3)), tool).shape == (0,)
