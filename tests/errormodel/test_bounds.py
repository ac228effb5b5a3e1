"""The chord bound worked by hand: of a function of one axis, of a grid, and of a chain.

`test_chord`, `test_maps` and `test_payload` show that it is never exceeded.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from olp.core.grid_interpolation import Grid
from olp.core.interpolation import Interpolant
from olp.errormodel.bodies import build_bodies
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.errormodel.chain_bound import AxisBound, axis_bounds, chord_bound
from olp.errormodel.chord import LOWER_MM, UPPER_MM, Variation, bins
from olp.errormodel.grid_bound import GridBound
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.maps import DeviationMap

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
NO_TOOL = np.zeros((1, 3))


def at(values: np.ndarray, length_mm: float) -> float:
    return float(values[bins(np.array([length_mm]))[0]])


# -- bins of lengths ---------------------------------------------------------------------------------------


def test_bins_are_eighths_of_an_octave_from_a_millionth_to_a_million() -> None:
    assert len(LOWER_MM) == len(UPPER_MM) == 320
    assert (LOWER_MM[0], UPPER_MM[-1]) == (2.0**-20, 2.0**20)
    np.testing.assert_array_equal(LOWER_MM[1:], UPPER_MM[:-1])
    np.testing.assert_array_equal(LOWER_MM[8:], 2.0 * LOWER_MM[:-8])
    np.testing.assert_array_equal(LOWER_MM[160:168], 1.0 + np.arange(8) / 8.0)


def test_a_length_lies_in_its_bin_from_the_lower_edge_on() -> None:
    lengths = np.random.default_rng(1).uniform(-20.0, 20.0, 500)
    index = bins(2.0**lengths)
    assert np.all(LOWER_MM[index] <= 2.0**lengths) and np.all(2.0**lengths < UPPER_MM[index])
    np.testing.assert_array_equal(bins(LOWER_MM.copy()), np.arange(320))
    assert bins(np.array([2.0**-21]))[0] < 0 and bins(np.array([2.0**20]))[0] == 320


# -- a function of one axis --------------------------------------------------------------------------------


def test_a_sine_bends_by_its_curvature_and_by_no_more_than_twice_its_amplitude() -> None:
    wave = Variation.of_cyclic(Cyclic("EXX", 10.0, -3e-3))
    rate = 2.0 * math.pi / 10.0
    sizes = (wave.peak, wave.slope, wave.curvature)
    assert sizes == pytest.approx((3e-3, 3e-3 * rate, 3e-3 * rate**2))
    np.testing.assert_allclose(wave.smooth, np.minimum(3e-3 * rate**2 * UPPER_MM**2 / 8.0, 6e-3))
    np.testing.assert_allclose(wave.change, np.minimum(3e-3 * rate, 6e-3 / LOWER_MM))
    assert wave.kinks.shape == (320,) and not wave.kinks.any() and wave.varies
    assert not Variation.of_cyclic(Cyclic("EXX", 10.0, 0.0)).varies


def test_a_sine_times_a_linear_factor_by_the_product_rule() -> None:
    """(f g)' = f' g + f g', (f g)'' = f'' g + 2 f' g', with g at most 50 and g' = -0.5."""
    wave = Variation.of_cyclic(Cyclic("EAX", 4.0, 2e-5), 50.0, -0.5)
    rate = math.pi / 2.0
    sizes = (wave.peak, wave.slope, wave.curvature)
    expected = (1e-3, 2e-5 * (rate * 50.0 + 0.5), 2e-5 * (rate**2 * 50.0 + 2.0 * rate * 0.5))
    assert sizes == pytest.approx(expected)
    np.testing.assert_allclose(wave.smooth, np.minimum(expected[2] * UPPER_MM**2 / 8.0, 2e-3))
    np.testing.assert_allclose(wave.change, np.minimum(expected[1], 2e-3 / LOWER_MM))


#: Slopes 0.2, -0.1, 0.3, 0.3, 0: jumps 0.3, 0.4, 0, 0.3 at 10, 26, 30 and 90 mm.
KNOTS = np.array([0.0, 10.0, 26.0, 30.0, 90.0, 100.0])
VALUES = np.cumsum([-5.0, 2.0, -1.6, 1.2, 18.0, 0.0])


def test_a_polyline_bends_at_its_kinks() -> None:
    """A quarter of the jumps that one window of the length can hold, ends included, times the length."""
    other = np.zeros(6)
    curve = Interpolant.through(KNOTS, np.stack([other, VALUES], axis=1), "linear")
    bent = Variation.of_curve(curve, 1, 0.5)
    # from -5 to 14.6: the largest value, the range, and the steepest piece
    assert (bent.peak, bent.slope, bent.curvature) == pytest.approx((14.6, 0.3, 0.0))
    assert not bent.smooth.any() and bent.smooth.shape == (320,)
    np.testing.assert_allclose(bent.change, np.minimum(0.3, 19.6 / LOWER_MM))
    kinks, jumps = [10.0, 26.0, 90.0], [0.3, 0.4, 0.3]
    for bin_, upper in enumerate(UPPER_MM.tolist()):
        held = [
            sum(j for p, j in zip(kinks, jumps, strict=True) if start <= p <= start + upper)
            for start in kinks
        ]
        assert bent.kinks[bin_] == pytest.approx(0.25 * max(held)), upper
    # 16 mm is the upper edge of the bin from 15 mm on; 64 and 80 mm apart
    held_by = {14.9: 0.4, 15.1: 0.7, 63.0: 0.7, 65.0: 0.7, 79.0: 1.0, 81.0: 1.0}
    for length, jump in held_by.items():
        assert at(bent.kinks, length) == pytest.approx(0.25 * jump), length
    straight = Variation.of_curve(curve, 0, 0.5)
    assert not straight.varies and not straight.kinks.any() and straight.peak == 0.0
    line = Variation.of_curve(Interpolant.through(KNOTS[:2], VALUES[:2, None], "linear"), 0, 0.5)
    assert line.varies and not line.kinks.any() and line.kinks.shape == (320,)


def test_a_smooth_curve_bends_by_its_curvature_its_change_of_slope_or_its_range() -> None:
    """The least of the three, from the coefficients of scipy's pchip; and a quarter of the curvature times
    the square of the cell of the table."""
    spline, cell = PchipInterpolator(KNOTS, VALUES), 0.5
    curve = Interpolant.through(KNOTS, np.stack([np.zeros(6), VALUES], axis=1), "pchip")
    bent = Variation.of_curve(curve, 1, cell)
    dense = np.linspace(0.0, 100.0, 200001)
    assert bent.peak == pytest.approx(14.6)
    assert bent.slope == pytest.approx(np.abs(spline(dense, 1)).max(), rel=1e-6)
    second = [abs(2.0 * spline.c[1, i] + 6.0 * spline.c[0, i] * t * w)
              for i, w in enumerate(np.diff(KNOTS)) for t in (0.0, 1.0)]  # fmt: skip
    assert bent.curvature == pytest.approx(max(second))
    np.testing.assert_allclose(bent.change, np.minimum(bent.slope, 19.6 / LOWER_MM))
    assert not bent.kinks.any() and bent.kinks.shape == (320,)
    # change of slope: the trapezoid of |f''| over quarters of the pieces; a window begins anywhere in one
    starts, ends, areas = [], [], []
    for i, width in enumerate(np.diff(KNOTS).tolist()):
        size = [abs(2.0 * spline.c[1, i] + 6.0 * spline.c[0, i] * width * k / 4.0) for k in range(5)]
        starts += [KNOTS[i] + width / 4.0 * k for k in range(4)]
        ends += [KNOTS[i] + width / 4.0 * (k + 1) for k in range(4)]
        areas += [0.5 * (size[k] + size[k + 1]) * width / 4.0 for k in range(4)]
    for bin_, upper in enumerate(UPPER_MM.tolist()):
        windows = [
            sum(area for s, area in zip(starts, areas, strict=True) if start <= s < end + upper)
            for start, end in zip(starts, ends, strict=True)
        ]
        by = min(bent.curvature * upper**2 / 8.0, 0.25 * upper * max(windows), 19.6)
        assert bent.smooth[bin_] == pytest.approx(by + 0.25 * bent.curvature * cell**2, rel=1e-9), upper


def test_bounds_of_a_sum_add() -> None:
    one = Variation.of_cyclic(Cyclic("EXX", 10.0, 3e-3))
    two = Variation.of_curve(Interpolant.through(KNOTS, VALUES[:, None], "linear"), 0, 0.5)
    both = Variation.total([one, two, two])
    for name in ("peak", "slope", "curvature", "smooth", "kinks", "change"):
        expected = getattr(one, name) + 2.0 * getattr(two, name)
        np.testing.assert_allclose(getattr(both, name), expected, err_msg=name)
    nothing = Variation.total([])
    assert (nothing.peak, nothing.slope, nothing.curvature, nothing.varies) == (0.0, 0.0, 0.0, False)
    assert nothing.smooth.shape == nothing.kinks.shape == nothing.change.shape == (320,)


# -- a grid ------------------------------------------------------------------------------------------------


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
    # payloads per move, and the farthest of several tools
    rows = np.array([[0.0, 0.0, -150.0, 25.0], [30.0, 0.0, -150.0, 25.0]])
    np.testing.assert_allclose(model.chord_bound(delta, rows), expected, rtol=1e-12)
    rows[:, 3] = 15.0, 25.0
    np.testing.assert_allclose(model.chord_bound(delta[[0, 0]], rows)[0], 0.5 * expected[0], rtol=1e-12)
    assert model.chord_bound(np.zeros((0, 3)), tool).shape == (0,)


# -- a chain -----------------------------------------------------------------------------------------------


def test_the_bound_of_an_axis_is_read_off_its_tables() -> None:
    """min(curvature / 8 (d^2 + 2 h min(d, h)), smooth) + d (kinks + sum of change_k |delta_k|)."""
    smooth, kinks = 1e-2 * UPPER_MM, 1e-3 + 0.0 * UPPER_MM
    along_x, along_z = 2e-4 + 0.0 * UPPER_MM, np.where(UPPER_MM > 4.0, 3e-4, 7e-4)
    bound = AxisBound(1, 0.5, 8.0, smooth, kinks, (along_x, None, along_z))
    lengths = [np.array([10.0, 10.0, 10.0, 0.0]), np.array([0.25, 5.0, 1e-3, 0.0]), np.array([20.0] * 4)]
    # below the cell d^2 + 2 h d = 0.3125 exceeds what the table says, 2.8125e-3; 1e-3 mm does not: 1.001e-3
    small = 1e-6 + 2.0 * 0.5 * 1e-3
    table = [1e-2 * 0.28125, 1e-2 * 5.5, min(small, 1e-2 * float(at(UPPER_MM, 1e-3))), 0.0]
    cross = [
        0.25 * (1e-3 + 2e-4 * 10 + 7e-4 * 20),
        5 * (1e-3 + 2e-3 + 6e-3),
        1e-3 * (1e-3 + 2e-3 + 14e-3),
        0.0,
    ]
    np.testing.assert_allclose(bound.at(lengths), np.add(table, cross), rtol=1e-12)
    plain = AxisBound(1, 0.5, 1e-4, np.full(320, 9.0), None, (None, None, None))
    # d^2 + 2 h min(d, h): 0.0625 + 0.25, 25 + 0.5
    np.testing.assert_allclose(
        plain.at(lengths), np.array([0.3125, 25.5, small, 0.0]) * 1e-4 / 8.0, rtol=1e-12
    )
    np.testing.assert_allclose(
        chord_bound([plain, bound], np.array([[-10.0, -0.25, 20.0], [10.0, 5.0, -20.0]])),
        (bound.at(lengths) + plain.at(lengths))[:2], rtol=1e-12,
    )  # fmt: skip


def test_moves_beyond_one_block_are_bounded_too() -> None:
    bound = AxisBound(0, 1.0, 1e-3, np.full(320, 9.0), None, (None, None, None))
    delta = np.random.default_rng(2).normal(size=(20000, 3))
    d = np.abs(delta[:, 0])
    np.testing.assert_allclose(
        chord_bound([bound], delta), 1e-3 / 8.0 * (d * d + 2.0 * np.minimum(d, 1.0)), rtol=1e-12
    )


#: A kink of 4e-5 and of 5e-8 per mm at X 400; a turn about X of Z that does not change; backlash of Y.
def machine(angle: float = 1.0, **more: Any) -> Calibration:
    curves = (
        Curve(
            "X", [0.0, 400.0, 800.0],
            {"EXX": [0.0, 8e-3, 0.0], "EBX": [0.0, angle * 1e-5, 0.0]},
            line_mm=(0.0, 40.0, -100.0), tool_mm=(0.0, 0.0, -60.0), interpolation="linear",
        ),
        Curve("Z", [-400.0, 0.0], {"EAZ": [-3e-6 * angle] * 2}, tool_mm=(0.0, 7.0, -20.0)),
    )  # fmt: skip
    return Calibration("m", BOX, datum_mm=(100.0, -50.0, 0.0), curves=curves, **more)


TOOLS = np.array([[30.0, -5.0, -150.0], [-20.0, 15.0, -90.0]])
#: Arms of EBX: row X z + t_z + 160, row Z t_x (X does not move its own tip); of EAZ: t_z + 20 and t_y - 7.
REACH_X, REACH_Z = 390.0, 30.0


@pytest.mark.parametrize("chain", ["FXYZ", "XFYZ"])
def test_to_first_order_a_chain_departs_by_its_kinks_on_their_lever_arms(chain: str) -> None:
    bodies = build_bodies(machine(), chain, frozenset())
    bounds = axis_bounds(bodies, BOX, TOOLS, second_order=False)
    assert [bound.axis for bound in bounds] == [0]
    # what is tabled by X has no arm along X, whatever X carries
    rows = 4e-5 + 5e-8 * REACH_X, 5e-8 * REACH_Z
    kinks, change = 0.25 * math.hypot(*rows), 0.25 * 2.5e-8
    delta = np.array([[10.0, 7.0, -30.0], [0.0, 9.0, 9.0], [200.0, 0.0, 0.0]])
    expected = [10.0 * (kinks + change * 30.0), 0.0, 200.0 * kinks]
    np.testing.assert_allclose(chord_bound(bounds, delta), expected, rtol=1e-12)
    # from 400 mm on, EBX changes by no more than its range of 1e-5
    far = chord_bound(bounds, np.array([[512.0, 0.0, 1.0]]))
    np.testing.assert_allclose(far, 512.0 * (kinks + 0.25 * 1e-5 / 512.0), rtol=1e-12)


@pytest.mark.parametrize("angle", [1.0, 1000.0])
def test_second_order_terms_widen_arms_slopes_and_translations(angle: float) -> None:
    """By the formulas of `chain_bound`, with squareness and backlash as displacements."""
    calibration = machine(angle, squareness={"C0Y": -2e-4 * angle}, backlash_mm=(0.0, 0.05, 0.0))
    (bound,) = axis_bounds(build_bodies(calibration, "FXYZ", frozenset()), BOX, TOOLS, second_order=True)
    b, a, shear = 1e-5 * angle, 3e-6 * angle, 2e-4 * angle
    # (row, coordinate) of X: z and y (y + t_y - 40) move, x does not; of Z: the tool alone
    arms_x = np.array([[30.0, 345.0, 390.0]] * 3)
    arms_z = np.array([[30.0, 12.0, 130.0]] * 3)
    farthest = arms_x[0].sum() + arms_z[0].sum() + (30.0 + 15.0 + 550.0)
    total = a + b
    extra = 4.0 * total * (1.0 + total)
    slopes = 2e-5 + shear + (b / 400.0 * arms_x.sum() + b) + a
    displaced = 8e-3 + 0.05 + shear * 350.0 + b * arms_x.sum() + a * arms_z.sum()
    widened = displaced + extra * farthest
    jump_t, jump_b, change = 4e-5, 5e-8 * angle, 2.5e-8 * angle
    rows = jump_t * (1.0 + extra) + jump_b * (390.0 + widened), jump_b * widened, jump_b * (30.0 + widened)
    stretch = (extra + 2.0 * slopes) * change
    expected = 0.25 * (math.hypot(*rows) + stretch * (10.0 + 7.0) + (change + stretch) * 30.0)
    lengths = [np.array([10.0]), np.array([7.0]), np.array([30.0])]
    assert bound.at(lengths)[0] == pytest.approx(10.0 * expected, rel=1e-12)
    model = build(calibration, "FXYZ")
    np.testing.assert_allclose(model.chord_bound(np.array([[-10.0, 7.0, 30.0]] * 2), TOOLS), 10.0 * expected)


def test_two_turns_on_one_moving_arm_join_as_one_length() -> None:
    """EBX and EAX on the arm z: changes 2e-8 and 1.5e-8 per mm."""
    curve = Curve(
        "X", BOX[0], {"EAX": [0.0, 1.2e-5], "EBX": [0.0, 1.6e-5]}, line_mm=(0.0, 0.0, 0.0),
        interpolation="linear",
    )  # fmt: skip
    bodies = build_bodies(Calibration("m", BOX, curves=(curve,)), "FXYZ", frozenset())
    (bound,) = axis_bounds(bodies, BOX, NO_TOOL, second_order=False)
    assert bound.kinks is None
    # along Y the arm of EAX on row Z alone
    expected = 10.0 * 0.25 * (2.5e-8 * 30.0 + 1.5e-8 * 7.0)
    np.testing.assert_allclose(chord_bound([bound], np.array([[10.0, 7.0, 30.0]])), [expected], rtol=1e-12)


def test_smooth_errors_count_by_curvature_on_their_arms() -> None:
    """A sine of 2 um along X and one of 5 urad about Y, 390 and 30 mm long."""
    terms = (
        Cyclic("EXX", 10.0, 2e-3),
        Cyclic("EBX", 10.0, 5e-6, 0.3, (0.0, 40.0, -100.0), (0.0, 0.0, -60.0)),
    )
    line = Curve("X", BOX[0], {"EYX": [0.0, 0.0]}, line_mm=(0.0, 40.0, -100.0), tool_mm=(0.0, 0.0, -60.0))
    bodies = build_bodies(Calibration("m", BOX, cyclic=terms, curves=(line,)), "FXYZ", frozenset())
    (bound,) = axis_bounds(bodies, BOX, TOOLS, second_order=False)
    size, rate = math.hypot(2e-3 + 5e-6 * 390.0, 5e-6 * 30.0), 2.0 * math.pi / 10.0
    assert bound.curvature == pytest.approx(size * rate**2)
    np.testing.assert_allclose(bound.smooth, np.minimum(size * rate**2 * UPPER_MM**2 / 8.0, 2.0 * size))
    assert bound.kinks is None
    change = 0.25 * np.minimum(5e-6 * rate, 1e-5 / LOWER_MM)
    np.testing.assert_allclose(bound.change[2], change)
    assert bound.change[:2] == (None, None)


def test_axes_that_do_not_bend_have_no_bound() -> None:
    still = Curve("X", BOX[0], {"EXX": [1e-3, 1e-3], "EBX": [1e-5, 1e-5]})
    bodies = build_bodies(Calibration("m", BOX, curves=(still,)), "FXYZ", frozenset())
    assert axis_bounds(bodies, BOX, NO_TOOL, second_order=True) == []
