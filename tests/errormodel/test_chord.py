"""The chord bound is never exceeded, is not far above what happens, and vanishes where nothing bends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from olp.core.interpolation import Interpolant
from olp.core.machine import CHAINS, SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.chord import LOWER_MM, UPPER_MM, Variation, bins, distinct_bins, in_all_bins

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
TOOL = np.array([10.0, -30.0, -150.0])


def calibration(seed: int, interpolation: str, angle: float, length: float, cyclic: bool) -> Calibration:
    rng = np.random.default_rng(seed)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        knots = np.concatenate([[low], np.sort(rng.uniform(low, high, 7)), [high]])
        columns = {f"E{d}{axis}": rng.normal(size=9) * (length if d in "XYZ" else angle) for d in "XYZABC"}
        curves.append(
            Curve(
                axis,
                knots,
                columns,
                line_mm=tuple(BOX.mean(axis=1)),
                interpolation=interpolation,
                reference=str(rng.choice(["table", "functional-point"])),
            )
        )
    terms = (
        Cyclic("EXX", 10.0, length / 4),
        Cyclic("EBY", 2.0, angle / 4, 0.7),
        Cyclic("EAZ", 0.02, angle / 9),
    )
    return Calibration(
        "m",
        BOX,
        datum_mm=(1.0, 2.0, 3.0),
        curves=tuple(curves),
        cyclic=terms if cyclic else (),
        squareness=dict(zip(SQUARENESS, rng.normal(size=3) * angle, strict=True)),
    )


def departures(model, start: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """(n,) greatest departure from the chord, densely sampled."""
    share = np.linspace(0.0, 1.0, 129)
    points = start[:, None, :] + share[None, :, None] * delta[:, None, :]
    error = model.error(points.reshape(-1, 3), TOOL).reshape(points.shape)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    return np.linalg.norm(error - chord, axis=2).max(axis=1)


def random_moves(seed: int, n: int, axes: str) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, n, 3))
    scale = 10.0 ** rng.uniform(-3.0, 0.0, (n, 1))
    moving = np.array([a in axes for a in "XYZ"])
    return start, (end - start) * scale * moving


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    chain=st.sampled_from(sorted(CHAINS)),
    interpolation=st.sampled_from(["linear", "pchip"]),
    angle=st.sampled_from([0.0, 40e-6, 5e-3]),
    length=st.sampled_from([0.0, 20e-3, 2.0]),
    cyclic=st.booleans(),
    axes=st.sampled_from(["X", "Y", "Z", "XY", "XYZ"]),
)
def test_no_chord_departs_by_more(
    seed: int, chain: str, interpolation: str, angle: float, length: float, cyclic: bool, axes: str
) -> None:
    model = build(calibration(seed, interpolation, angle, length, cyclic), chain)
    start, delta = random_moves(seed, 60, axes)
    bound = model.chord_bound(delta, TOOL)
    rounding = 1e-12 + 1e-15 * length
    assert np.all(departures(model, start, delta) <= bound * (1 + 1e-9) + rounding)


@pytest.mark.parametrize("interpolation", ["linear", "pchip"])
def test_a_move_over_the_worst_place_comes_near_the_bound(interpolation: str) -> None:
    """For one curve and single-axis moves the worst of many moves reaches half the bound at every length."""
    knots = np.linspace(0.0, 800.0, 9)
    wave = np.array([0, 1, 0, -1, 0, 1, 0, -1, 0]) * 0.01
    model = build(
        Calibration("m", BOX, curves=(Curve("X", knots, {"EXX": wave}, interpolation=interpolation),)), "FXYZ"
    )
    for length in (5.0, 20.0, 100.0):
        start = np.zeros((3000, 3))
        start[:, 0] = np.linspace(0.0, 800.0 - length, 3000)
        delta = np.tile([length, 0.0, 0.0], (3000, 1))
        assert departures(model, start, delta).max() > 0.5 * model.chord_bound(delta[:1], TOOL)[0]


def test_straight_errors_need_no_bound() -> None:
    scale = Curve("X", BOX[0], {"EXX": [0.0, 0.05]}, interpolation="linear")
    thermal = Thermal((1e-5, 1e-5, 1e-5), scale_degC=(25.0, 25.0, 25.0))
    square = {"C0Y": 1e-4, "B0Z": 1e-4}
    model = build(Calibration("m", BOX, curves=(scale,), squareness=square, thermal=thermal), "FXYZ")
    _, delta = random_moves(1, 100, "XYZ")
    assert not model.chord_bound(delta, TOOL).any()


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ"])
def test_a_still_axis_adds_nothing(chain: str) -> None:
    model = build(calibration(3, "linear", 40e-6, 0.02, True), chain)
    assert not model.chord_bound(np.zeros((4, 3)), TOOL).any()


def test_of_many_tools_that_of_the_move_counts() -> None:
    model = build(calibration(4, "pchip", 40e-6, 0.02, False), "FXYZ")
    _, delta = random_moves(2, 50, "XYZ")
    tools = np.vstack([np.zeros((25, 3)), np.tile(TOOL, (25, 1))])
    own = np.concatenate((model.chord_bound(delta[:25], tools[0]), model.chord_bound(delta[25:], TOOL)))
    np.testing.assert_array_equal(model.chord_bound(delta, tools), own)
    assert not np.array_equal(own, model.chord_bound(delta, TOOL))


@pytest.mark.parametrize("direction", [-1.0, 0.5, 1.0])
def test_the_bound_holds_in_either_direction(direction: float) -> None:
    rng = np.random.default_rng(8)
    knots = np.linspace(0.0, 800.0, 17)
    forward, backward = ({n: rng.normal(size=17) * 0.01 for n in ("EXX", "EYX")} for _ in range(2))
    curve = Curve("X", knots, forward=forward, backward=backward, interpolation="linear")
    model = build(Calibration("m", BOX, curves=(curve,)), "FXYZ")
    start, delta = random_moves(9, 500, "X")
    share = np.linspace(0.0, 1.0, 65)
    points = (start[:, None, :] + share[None, :, None] * delta[:, None, :]).reshape(-1, 3)
    error = model.error(points, TOOL, np.full(points.shape, direction)).reshape(500, 65, 3)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    departure = np.linalg.norm(error - chord, axis=2).max(axis=1)
    assert np.all(departure <= model.chord_bound(delta, TOOL) * (1 + 1e-9) + 1e-12)
    assert departure.max() > 1e-3


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
    bent = Variation.of_curve(curve, 0.5)[1]
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
    straight = Variation.of_curve(curve, 0.5)[0]
    assert not straight.varies and not straight.kinks.any() and straight.peak == 0.0
    line = Variation.of_curve(Interpolant.through(KNOTS[:2], VALUES[:2, None], "linear"), 0.5)[0]
    assert line.varies and not line.kinks.any() and line.kinks.shape == (320,)


def test_a_smooth_curve_bends_by_its_curvature_its_change_of_slope_or_its_range() -> None:
    """The least of the three, from the coefficients of scipy's pchip; and a quarter of the curvature times
    the square of the cell of the table."""
    spline, cell = PchipInterpolator(KNOTS, VALUES), 0.5
    curve = Interpolant.through(KNOTS, np.stack([np.zeros(6), VALUES], axis=1), "pchip")
    bent = Variation.of_curve(curve, cell)[1]
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
    two = Variation.of_curve(Interpolant.through(KNOTS, VALUES[:, None], "linear"), 0.5)[0]
    both = Variation.total([one, two, two])
    for name in ("peak", "slope", "curvature", "smooth", "kinks", "change"):
        expected = getattr(one, name) + 2.0 * getattr(two, name)
        np.testing.assert_allclose(getattr(both, name), expected, err_msg=name)
    nothing = Variation.total([])
    assert (nothing.peak, nothing.slope, nothing.curvature, nothing.varies) == (0.0, 0.0, 0.0, False)
    assert nothing.smooth.shape == nothing.kinks.shape == nothing.change.shape == (320,)


positions = st.lists(st.integers(0, 4000), min_size=2, max_size=40, unique=True).map(sorted)


@given(positions, st.sampled_from([2.0**-9, 0.001, 0.1, 1.0, 25.4]), st.floats(-1e3, 1e3))
def test_the_distinct_bins_hold_what_every_bin_holds(steps: list[int], unit: float, begin: float) -> None:
    ends = begin + unit * np.array(steps, float)
    some = distinct_bins(ends)
    for side in ("left", "right"):
        every = np.searchsorted(ends, ends + UPPER_MM[:, None], side)  # type: ignore[call-overload]
        held = np.searchsorted(ends, ends + UPPER_MM[some, None], side)  # type: ignore[call-overload]
        assert np.array_equal(in_all_bins(held, some), every)


def test_a_curve_of_equal_pieces_is_searched_in_the_octaves_between_piece_and_whole() -> None:
    # 128 pieces are 7 octaves of 8 bins; one bin more at either end, and those that the ends fall in
    some = distinct_bins(np.linspace(0.0, 1280.0, 129))
    assert some.stop - some.start <= 7 * 8 + 3
    assert UPPER_MM[some.start] < 10.0
    assert UPPER_MM[some.stop - 1] >= 1280.0


def test_a_single_end_has_one_bin() -> None:
    assert distinct_bins(np.zeros(1)) == slice(0, 1)
