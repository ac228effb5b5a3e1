"""Stated sigma covers what is between targets, on families of machines; and laws of the prior behind it."""

from __future__ import annotations

import numpy as np
import pytest
from cases.coverage import Scores, lines_of
from cases.fast import some_fast, some_of_a_campaign
from judge import families

from olp.calibration.estimator.basis import RIPPLE, CurveSpace, Scales, Spline
from olp.calibration.estimator.character import (
    SIZES,
    USUAL,
    Evidence,
    candidates,
    class_of,
    expected,
    rms_of_processes,
)
from olp.calibration.estimator.character import characters as tables_of
from olp.calibration.estimator.normal import Normal

SPLINE = Spline(0.0, 900.0, 24)


@pytest.mark.parametrize("family", some_fast(("tables", "joints", "smooth"), 3))
def test_two_sigma_cover_what_five_targets_leave_open(family: str) -> None:
    scores = lines_of(family, 5, 1, against_best=False)
    assert scores.coverage > 0.91
    # not by bands that say nothing
    assert scores.stated < 4.0 * scores.rms


@pytest.mark.slow
@pytest.mark.parametrize("count", some_of_a_campaign([5, 3, 8, 20, 12], 5))
def test_two_sigma_cover_on_the_average_of_families(count: int) -> None:
    total = [Scores.of([lines_of(family, count, seed) for seed in (0, 1)]) for family in families.FAMILIES]
    assert np.mean([one.coverage for one in total]) > 0.90
    assert np.mean([one.rms for one in total]) < 1.25


@pytest.mark.parametrize("which", range(7))
def test_a_process_is_the_same_with_more_cells(which: int) -> None:
    """Variance of the second difference over thirds of the axis; ripple has no length."""
    scales = Scales.of(np.eye(7)[which])
    seconds = []
    for cells in (24, 48):
        space = CurveSpace.of(Spline(0.0, 900.0, cells), (), 0.0, "free")
        rows = np.array([1.0, -2.0, 1.0]) @ space.values(np.array([150.0, 450.0, 750.0]))
        seconds.append(rows @ np.linalg.inv(space.process(Scales.of(scales.values + 1e-6), 1.0)) @ rows)
    assert seconds[1] == pytest.approx(seconds[0], rel=0.1)


def test_a_curve_of_swings_alone_has_a_finite_precision() -> None:
    precision = CurveSpace.of(SPLINE, (), 0.0, "free").process(Scales.of(np.eye(7)[4]), 1.0)
    assert np.isfinite(precision).all()
    assert np.linalg.cond(precision) < 1e14


def test_scales_add_up_as_variances() -> None:
    space = CurveSpace.of(SPLINE, (), 0.0, "zero")

    def variance(*values: float) -> np.ndarray:
        return np.linalg.inv(space.process(Scales.of(values), 1e-3))

    rows = space.values(np.array([300.0, 600.0, 900.0]))
    parts = [rows @ variance(*part) @ rows.T for part in ((3e-2, 0, 1e-9, 1e-9), (1e-9, 0, 2e-2, 5e-3))]
    both = rows @ variance(3e-2, 0.0, 2e-2, 5e-3) @ rows.T
    assert both.trace() > parts[0].trace()
    assert both.trace() > parts[1].trace()


def readings(rng: np.random.Generator, curve: np.ndarray, at: np.ndarray) -> Normal:
    """Normal equations of a spline and one feature (a ramp) read at positions with unit noise."""
    normal = Normal.of(SPLINE.count + 1)
    rows = np.column_stack([SPLINE.values(at), at / 900.0])
    y = curve + rng.normal(size=len(at))
    normal.H[:], normal.g[:], normal.square = rows.T @ rows, rows.T @ y, float(y @ y)
    return normal


def test_the_evidence_is_that_of_the_dense_gaussian() -> None:
    rng = np.random.default_rng(4)
    at = np.linspace(0.0, 900.0, 9)
    normal = readings(rng, 40.0 * np.sin(at / 150.0), at)
    evidence = Evidence(normal, SPLINE, 50.0, 7.0)
    scales = np.array([
        [9.0, 4.0, 3.0, 2.0, 0.0, 0.0, 0.0], [200.0, 1.0, 30.0, 8.0, 5.0, 60.0, 2.0],
        [0.5, 60.0, 0.5, 0.5, 90.0, 0.0, 30.0],
    ])  # fmt: skip
    rows = SPLINE.values(at)
    # y that the normal equations hold: all of it, as there are fewer readings than unknowns
    full = np.column_stack([rows, at / 900.0])
    y = np.linalg.lstsq(full.T, normal.g, rcond=None)[0]
    for chosen in ([], [0]):
        found = evidence.values(evidence.covariance(scales, chosen))
        expected = []
        for one in scales:
            prior = np.linalg.inv(CurveSpace.of(SPLINE, (), 0.0, "free").process(Scales.of(one), 50.0))
            dense = np.eye(9) + rows @ prior @ rows.T + len(chosen) * np.outer(at, at) * (7.0 / 900.0) ** 2
            expected.append(-0.5 * (y @ np.linalg.solve(dense, y) + np.linalg.slogdet(dense)[1]))
        assert np.ptp(found - expected) < 1e-6
    gain = evidence.gains(scales[:1], [], [0])[0]
    pair = [evidence.values(evidence.covariance(scales[:1], chosen))[0] for chosen in ([0], [])]
    assert gain == pytest.approx(pair[0] - pair[1], abs=1e-8)


def characters(values: dict[str, np.ndarray]) -> dict[str, Scales]:
    return {name: expected(table, class_of(name)) for name, table in tables_of(values).items()}


@pytest.mark.parametrize("size", [1, 4])
def test_steps_and_ripple_before_any_reading_go_with_the_size_of_a_machine(size: int) -> None:
    """Lines show the size of the smooth part and nothing else: 16 times as large, 4 times the ripple."""
    table = candidates("angle")
    smooth = (table[:, [0, 1, 4, 5, 6]] * rms_of_processes()[[0, 1, 4, 5, 6]]).sum(axis=1)
    rows = []
    for one in (SIZES[size], 4.0 * SIZES[size], 16.0 * SIZES[size]):
        shown = np.where(np.isclose(smooth, one * USUAL["angle"]), 0.0, -1e3)
        rows.append(characters(dict.fromkeys(ANGLES, shown))["ECX"].values[2:4])
    both = np.array(rows)
    assert np.all(np.diff(both, axis=0) > 0.0)
    assert both[2, 1] / both[0, 1] == pytest.approx(4.0, rel=0.35)


#: All angles.
ANGLES = tuple(f"E{kind}{axis}" for kind in "ABC" for axis in "XYZ")


def test_curves_that_say_nothing_take_the_character_of_the_others() -> None:
    """Evidence of eight angles for little ripple, and of none: the ninth is expected as the eight."""
    flat = np.zeros(len(candidates("angle")))
    ripple = candidates("angle")[:, 3]
    quiet = {name: np.where(ripple < 2e-7, 0.0, -30.0) for name in ANGLES}
    told = characters({**quiet, "ECZ": flat})["ECZ"]
    alone = characters({"ECZ": flat})["ECZ"]
    assert told.ripple < 0.2 * alone.ripple
    # other classes say it less strictly
    related = characters({**quiet, "EXX": np.zeros(len(flat))})["EXX"]
    alone = characters({"EXX": np.zeros(len(flat))})["EXX"]
    assert told.ripple / 0.6e-3 < related.ripple < 0.8 * alone.ripple


def test_a_wave_that_targets_take_for_a_smooth_curve_stays_in_the_uncertainty() -> None:
    """Eight angles show ripple, or steps. The ninth denies that much of it, as where the period of its wave
    suits the targets: it has less of steps then, and ripple all the same."""
    table = candidates("angle")
    for row, least, most in ((RIPPLE, 0.9, 1.0), (2, 0.2, 0.7)):
        size = table[:, row]
        largest = np.abs(size - size.max()) < 1e-12
        shown = {name: np.where(largest, 0.0, -30.0) for name in ANGLES if name != "ECZ"}
        found = characters({**shown, "ECZ": np.where(largest, -6.0, 0.0)})["ECZ"].values[row]
        assert least * size.max() < found < 1.01 * most * size.max()


def test_the_kind_of_the_smooth_part_is_that_of_the_machine() -> None:
    """Curves of one class show slow swings; those of another, which say nothing, have hardly others."""
    table = candidates("angle")
    shown = {name: np.where(table[:, 4] > 0.0, 0.0, -10.0) for name in ANGLES}
    told = characters({**shown, "EXX": np.zeros(len(table))})["EXX"]
    assert told.slow > 0.0
    assert max(told.bows, told.bends, told.middle, told.quick) < 1e-6 * told.slow


@pytest.mark.parametrize(("row", "waves"), [(4, 2.5), (5, 4.0), (6, 5.5)])
def test_swings_hold_nothing_shorter_than_their_waves(row: int, waves: float) -> None:
    """Two polynomials' degrees for each half wave, and six, leave nothing of them; bends go on."""
    spline = Spline(0.0, 1.0, 96)
    at = np.linspace(0.0, 1.0, 501)
    low = np.polynomial.chebyshev.chebvander(2.0 * at - 1.0, int(6 + 2.0 * waves))
    left = []
    for process in (row, 1):
        values, vectors = np.linalg.eigh(spline.processes()[process])
        drawn = spline.values(at) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        rest = drawn - low @ np.linalg.lstsq(low, drawn)[0]
        left.append(np.sqrt(np.mean((rest**2).sum(axis=1)) / np.mean((drawn**2).sum(axis=1))))
    assert left[0] < 0.01
    assert left[1] > 3.0 * left[0]


@pytest.mark.parametrize("row", [4, 5, 6])
def test_swings_bend_at_the_ends_of_an_axis_as_in_its_middle(row: int) -> None:
    """Its ends are no ends of what bends it: the second difference has the same variance everywhere."""
    spline = Spline(0.0, 1.0, 48)
    apart = 0.04
    rows = [
        np.array([1.0, -2.0, 1.0]) @ spline.values(middle + np.array([-apart, 0.0, apart]))
        for middle in (apart, 0.5, 1.0 - apart)
    ]
    seconds = [one @ spline.processes()[row] @ one for one in rows]
    assert seconds == pytest.approx([seconds[1]] * 3, rel=0.15)


def test_five_targets_see_a_few_waves_as_such_and_not_as_ripple() -> None:
    """Waves of 1 to 4 half waves over the axis, of any phase, show as much third and fourth order against
    the second at five targets as swings do."""
    at = np.linspace(0.0, 1.0, 5)
    orders = np.linalg.qr(np.vander(at, increasing=True))[0][:, 2:]

    def shown(covariance: np.ndarray) -> np.ndarray:
        size = np.sqrt(np.diag(orders.T @ covariance @ orders))
        return np.asarray(size[1:] / size[0])

    apart = np.pi * np.subtract.outer(at, at)
    waves = shown(sum((m**-2.4 * np.cos(m * apart) for m in range(1, 5)), np.zeros((5, 5))))
    spline = Spline(0.0, 1.0, 24)
    assert shown(spline.values(at) @ spline.processes()[5] @ spline.values(at).T) == pytest.approx(
        waves, rel=0.15
    )
