"""Numbers of a covariance: which entries fit, how their values are made, and what they do to the tip."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Thermal
from olp.errormodel.entry import AxisState, Entry, alone
from olp.errormodel.sensitivity import Expansion, Sensitivity, value_rows
from olp.errormodel.sources.curves import CELLS
from olp.errormodel.sources.registry import NUMBERS
from olp.errormodel.uncertainty import EXPANSION_PER_K, Uncertainty, fingerprint, of_sigmas

NAN = float("nan")
X = np.array([0.0, 10.0, 40.0])
MEAN = Entry("mean", "EXX", np.array([[1.0, 0.0], [2.0, 5.0], [4.0, 0.0]]), np.zeros(3), X)
HALF = replace(MEAN, kind="half")
WAVE = Entry("wave", "EXX", np.array([[3.0], [4.0]]), np.array([0.3, 0.4]), period_mm=8.0)
TILT = Entry("squareness", "B0Z", np.array([[2.0]]), np.array([0.5]))
LOST = Entry("backlash", "Y", np.array([[2.0]]), np.array([0.5]))
ALL = (MEAN, HALF, WAVE, TILT, LOST)
BOX = np.array([[0.0, 40.0], [0.0, 300.0], [-200.0, 0.0]])


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.kind)
def test_a_right_entry_fits(entry: Entry) -> None:
    assert NUMBERS[entry.kind].fits(entry)
    assert NUMBERS[entry.kind].fits(replace(entry, rest=np.zeros(len(entry.rest))))
    assert NUMBERS[entry.kind].fits(replace(entry, factor=np.zeros((len(entry.rest), 0))))
    assert NUMBERS[entry.kind].count(entry) == len(entry.rest)
    assert Uncertainty((entry,), "", "").entries == (entry,)


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.kind)
@pytest.mark.parametrize(
    "change",
    [
        {"name": "EXW"},
        {"factor": np.zeros((4, 2))},
        {"factor": np.zeros(3)},
        {"factor": np.zeros((3, 2, 1))},
        {"factor": "nan"},
        {"rest": np.zeros(4)},
        {"rest": np.zeros((3, 1))},
        {"rest": "nan"},
        {"rest": "inf"},
        {"rest": "below"},
    ],
    ids=str,
)
def test_a_wrong_entry_does_not_fit(entry: Entry, change: dict[str, Any]) -> None:
    ((key, value),) = change.items()
    if isinstance(value, str) and key != "name":
        value = getattr(entry, key).copy()
        value[-1] = {"nan": NAN, "inf": np.inf, "below": -1e-12}[change[key]]
    wrong = replace(entry, **{key: value})
    assert not NUMBERS[entry.kind].fits(wrong)
    with pytest.raises(ConfigError, match=f"covariance of {wrong.kind} {wrong.name}: expected finite"):
        Uncertainty((wrong,), "", "")


@pytest.mark.parametrize("kind", ["mean", "half"])
@pytest.mark.parametrize("position", [[], [0.0], [0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, 1.0, NAN]])
def test_positions_ascend(kind: str, position: list[float]) -> None:
    n = len(position)
    entry = Entry(kind, "EXX", np.zeros((n, 1)), np.zeros(n), np.array(position))
    assert NUMBERS[kind].count(entry) == 0
    assert not NUMBERS[kind].fits(entry)


def test_two_positions_are_enough_and_a_wave_has_a_period() -> None:
    two = Entry("mean", "EXX", np.zeros((2, 1)), np.zeros(2), np.array([0.0, 1.0]))
    assert NUMBERS["mean"].count(two) == 2
    assert NUMBERS["wave"].count(replace(WAVE, period_mm=0.0)) == 0
    assert NUMBERS["wave"].count(replace(WAVE, period_mm=0.5)) == 2
    assert {kind: numbers.names for kind, numbers in NUMBERS.items()} == {
        "mean": COMPONENTS, "half": COMPONENTS, "wave": COMPONENTS, "squareness": SQUARENESS,
        "backlash": ("X", "Y", "Z"),
    }  # fmt: skip


def test_an_unknown_kind_and_a_second_entry_are_refused() -> None:
    with pytest.raises(ConfigError, match="covariance of mood EXX: expected finite numbers"):
        Uncertainty((replace(MEAN, kind="mood"),), "", "")
    with pytest.raises(ConfigError, match="covariance of mean EXX is defined twice; expected once"):
        Uncertainty((MEAN, replace(HALF, name="EYX"), MEAN), "", "")
    # of another kind, component or period it is another one
    wave = replace(WAVE, factor=np.zeros((2, 2)))
    others = (HALF, replace(MEAN, name="EYX"), wave, replace(wave, period_mm=4.0))
    known = Uncertainty((MEAN, *others), "", "")
    assert known.rank == 2
    assert known.find("half", "EXX") is HALF and known.find("mean", "EYX") is others[1]
    assert known.find("half", "EYX") is None and known.find("mean", "EZX") is None
    with pytest.raises(ConfigError, match="wave EXX: its factor has 1 columns; expected 2, as in the other"):
        Uncertainty((MEAN, WAVE), "", "")
    assert Uncertainty((), "", "").rank == 0


def test_uncertainties_scale_and_grow() -> None:
    known = Uncertainty((MEAN, replace(HALF, rest=np.full(3, 2.0))), "f", "s", 0.1, (1.0, 2.0, 3.0), 0.5)
    twice = known.scaled(2.0)
    np.testing.assert_array_equal(twice.entries[0].factor, 2.0 * MEAN.factor)
    np.testing.assert_array_equal(twice.entries[1].rest, np.full(3, 4.0))
    assert (twice.fingerprint, twice.source, twice.dropped) == ("f", "s", 0.1)
    assert twice.repeatability_mm == (1.0, 2.0, 3.0)
    # sqrt(2^2 + 5^2 + 2^2)
    np.testing.assert_allclose(known.entries[1].sigma, [5.0**0.5, 33.0**0.5, 20.0**0.5])
    assert known.growth(365.25) == 1.5 and known.growth(-1.0) == known.growth(0.0) == known.growth(None) == 1
    assert known.growth(1.0) == pytest.approx(1.0 + 0.5 / 365.25)
    plain = Uncertainty((), "", "")
    assert (plain.dropped, plain.growth_per_year, plain.temperature_K) == (0.0, 0.0, 0.0)
    assert plain.repeatability_mm == (0.0, 0.0, 0.0)


def test_entries_of_standard_uncertainties_alone() -> None:
    one = alone("squareness", "C0Y", 4e-6)
    assert (one.kind, one.name, one.factor.shape, one.rest.tolist()) == ("squareness", "C0Y", (1, 0), [4e-6])
    assert one.position_mm.shape == (0,) and one.period_mm == 0.0
    many = alone("mean", "EXX", np.array([1.0, 2.0, 3.0]), X)
    assert many.factor.shape == (3, 0) and many.rest.tolist() == [1.0, 2.0, 3.0]
    assert many.position_mm is X
    whole = alone("mean", "EXX", np.array([1, 2, 3]), X)
    assert whole.rest.dtype == np.float64
    # of a factor in single precision as well
    single = replace(MEAN, factor=MEAN.factor.astype(np.float32))
    assert single.sigma.dtype == np.float64


# -- values ------------------------------------------------------------------------------------------------


def value(entry: Entry, q: list[float]) -> np.ndarray:
    """(n, columns) what the numbers of the factor make at q."""
    points = np.array(q)
    rows = np.zeros((len(q), entry.factor.shape[1]))
    for number, weight in NUMBERS[entry.kind].weights(entry, points):
        rows += weight[:, None] * entry.factor[number]
    return rows


def test_between_its_positions_a_component_is_straight_and_beyond_them_constant() -> None:
    q = [-5.0, 0.0, 2.5, 10.0, 25.0, 40.0, 99.0]
    first, second = [1.0, 1.0, 1.25, 2.0, 3.0, 4.0, 4.0], [0.0, 0.0, 1.25, 5.0, 2.5, 0.0, 0.0]
    for entry in (MEAN, HALF):
        np.testing.assert_allclose(value(entry, q), np.stack([first, second], axis=1), atol=1e-15)


def test_a_wave_is_its_sine_and_its_cosine_part() -> None:
    """An eighth of a period of 8 mm each: 3 sin + 4 cos."""
    half = 0.5**0.5
    np.testing.assert_allclose(
        value(WAVE, [0.0, 1.0, 2.0, 3.0, 4.0, 6.0])[:, 0],
        [4.0, 7 * half, 3.0, -half, -4.0, -3.0], atol=1e-12,
    )  # fmt: skip
    rows = value_rows(WAVE, np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(
        rows, [[4.0, 0.0, 0.4], [7 * half, 0.3 * half, 0.4 * half], [3.0, 0.3, 0.0]], atol=1e-12
    )


def test_one_number_is_the_same_everywhere() -> None:
    for entry in (TILT, LOST):
        np.testing.assert_array_equal(value(entry, [-7.0, 0.0, 3.0]), [[2.0]] * 3)
        np.testing.assert_array_equal(value_rows(entry, np.array([-7.0, 3.0])), [[2.0, 0.5]] * 2)
        assert NUMBERS[entry.kind].parts(entry) == 1


def test_independent_parts_of_a_curve_hold_the_stated_uncertainty_everywhere() -> None:
    """Two cells of 20 mm: (1 - t, t) of the two ends of a cell, over their length."""
    entry = replace(MEAN, factor=np.zeros((3, 0)), rest=np.array([1.0, 2.0, 8.0]))
    assert NUMBERS["mean"].parts(entry) == 3
    q = np.array([-5.0, 0.0, 5.0, 10.0, 20.0, 25.0, 40.0, 50.0])
    sigma = [1.0, 1.0, 1.5, 2.0, 4.0, 5.0, 8.0, 8.0]
    share = [(0, 0.0), (0, 0.0), (0, 0.25), (0, 0.5), (1, 0.0), (1, 0.25), (1, 1.0), (1, 1.0)]
    expected = np.zeros((8, 3))
    for row, (s, (cell, t)) in enumerate(zip(sigma, share, strict=True)):
        expected[row, cell : cell + 2] = np.array([1.0 - t, t]) * s / np.hypot(t, 1.0 - t)
    np.testing.assert_allclose(value_rows(entry, q), expected, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(expected, axis=1), sigma)


@pytest.mark.parametrize(("positions", "parts"), [(2, 2), (16, 16), (17, 17), (18, 17), (500, 17)])
def test_a_curve_has_as_many_cells_as_pieces_and_no_more_than_sixteen(positions: int, parts: int) -> None:
    assert CELLS == 16
    x = np.linspace(0.0, 160.0, positions)
    entry = Entry("mean", "EXX", np.zeros((positions, 0)), np.ones(positions), x)
    assert NUMBERS["mean"].parts(entry) == parts
    rows = value_rows(entry, np.array([0.0, 5.0, 160.0]))
    assert rows.shape == (3, parts)
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1.0)
    # farther apart than a cell they are independent
    assert rows[0] @ rows[2] == (0.0 if parts > 2 else pytest.approx(0.0))
    if parts == 17:
        assert rows[1] @ rows[0] == pytest.approx(0.5**0.5)


# -- what they do to the tip -------------------------------------------------------------------------------

#: Lever arms: one of rows X and Y, another of row Z.
ARMS = [((0, 1), [np.array([2.0]), np.array([3.0]), np.array([5.0])]),
        ((2,), [np.array([7.0]), np.array([11.0]), np.array([13.0])])]  # fmt: skip
STATE = AxisState(1, np.array([30.0]), np.array([0.5]), 10.0, ARMS)  # type: ignore[arg-type]


def acting(entry: Entry, state: AxisState) -> list[float]:
    rows = [0.0, 0.0, 0.0]
    for row, coefficient in NUMBERS[entry.kind].acts(entry, state):
        assert rows[row] == 0.0
        rows[row] = float(np.ravel(coefficient)[0])
    return rows


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("EXY", [1, 0, 0]), ("EYY", [0, 1, 0]), ("EZY", [0, 0, 1]),
        # angle x arm: a: (0, -z, y); b: (z, 0, -x); c: (-y, x, 0), each row with its own arm
        ("EAY", [0, -5, 11]), ("EBY", [5, 0, -7]), ("ECY", [-3, 2, 0]),
    ],
)  # fmt: skip
def test_what_one_unit_of_a_component_does_to_the_tip(name: str, rows: list[float]) -> None:
    mean, half, wave = replace(MEAN, name=name), replace(HALF, name=name), replace(WAVE, name=name)
    assert acting(mean, STATE) == rows
    assert acting(wave, STATE) == rows
    # half a difference of directions acts with the play, and not in the mean of both
    assert acting(half, STATE) == [0.5 * row for row in rows]
    assert acting(half, replace(STATE, play=None)) == [0.0, 0.0, 0.0]


def test_what_squareness_and_backlash_do_to_the_tip() -> None:
    """20 mm from the datum: (-C0Y y + B0Z z, -A0Z z, 0). Backlash acts with minus half the play."""
    tilted = {name: acting(replace(TILT, name=name), STATE) for name in SQUARENESS}
    assert tilted == {"C0Y": [-20, 0, 0], "B0Z": [20, 0, 0], "A0Z": [0, -20, 0]}
    assert acting(LOST, STATE) == [0.0, -0.25, 0.0]
    assert acting(LOST, replace(STATE, play=None)) == [0.0, 0.0, 0.0]


# -- all of a machine --------------------------------------------------------------------------------------


def calibration(**more: Any) -> Calibration:
    curves = (
        Curve("X", X, {"EXX": np.zeros(3)}, line_mm=(0.0, 20.0, -30.0), interpolation="linear"),
        Curve("Z", [-200.0, 0.0], {"EAZ": np.zeros(2)}, line_mm=(0.0, 0.0, 0.0), tool_mm=(0.0, 5.0, -70.0)),
    )
    return Calibration("m", BOX, datum_mm=(1.0, 2.0, 3.0), curves=curves, **more)


POINTS = np.array([[10.0, 30.0, -50.0], [25.0, 2.0, 3.0]])
TOOL = np.array([4.0, -6.0, -100.0])


def test_rows_of_several_entries_by_hand() -> None:
    """Columns: one of the factor, then those independent parts that have a variance, one after another."""
    roll = Entry("mean", "EAZ", np.array([[1e-6], [3e-6]]), np.zeros(2), np.array([-200.0, 0.0]))
    entries = (
        Entry("mean", "EXX", np.array([[1.0], [2.0], [4.0]]), np.array([0.0, 0.5, 0.0]), X),
        Entry("squareness", "A0Z", np.array([[2e-6]]), np.array([5e-6])),
        roll,
        Entry("backlash", "Y", np.array([[0.0]]), np.array([3e-3])),
    )
    known = Uncertainty(entries, "", "")
    sensitivity = Sensitivity.of(calibration(), "FXYZ", known)
    # 3 + 1 + 2 + 1 numbers; parts: 3 of EXX, 1 of A0Z, none of EAZ, 1 of Y
    assert sensitivity.first == (0, 3, 4, 6) and sensitivity.spare == (7, 10, -1, 11)
    assert sensitivity.columns == 6 and sensitivity.table.shape == (12, 6)
    play = np.array([[0.0, 1.0, 0.0], [0.0, -0.5, 0.0]])
    rows = sensitivity.rows(POINTS, TOOL, play)
    expected = np.zeros((3, 2, 6))
    # EXX: 2 at 10, 3 at 25 mm, and 0.5 and 0.25 of its own, in cells of 20 mm
    expected[0, 0, :3] = 2.0, 0.5 * 0.5**0.5, 0.5 * 0.5**0.5
    expected[0, 1, [0, 2, 3]] = 3.0, *(np.array([0.75, 0.25]) * 0.25 / np.hypot(0.75, 0.25))
    # A0Z: -(z - 3), row Y
    expected[1, :, 0] = 2e-6 * 53.0, 0.0
    expected[1, :, 4] = 5e-6 * 53.0, 0.0
    # EAZ on the tool alone: dY = -a (t_z - line_z), dZ = a (t_y - line_y)
    angle = np.array([2.5e-6, 3e-6])
    expected[1, :, 0] += -angle * (-100.0 + 70.0)
    expected[2, :, 0] = angle * (-6.0 - 5.0)
    expected[1, :, 5] = 3e-3 * -0.5 * play[:, 1]
    np.testing.assert_allclose(rows, expected, rtol=1e-6, atol=1e-12)
    # in the mean of both directions backlash is nothing; a tool per point is the same as one
    without = sensitivity.rows(POINTS, np.tile(TOOL, (2, 1)))
    expected[1, :, 5] = 0.0
    np.testing.assert_allclose(without, expected, rtol=1e-6, atol=1e-12)
    # what the control corrects is no part of it
    skipped = Sensitivity.of(calibration(), "FXYZ", known, skip=frozenset({"EXX", "EAZ"}))
    assert [entry.name for entry in skipped.entries] == ["A0Z", "Y"]
    assert skipped.first == (0, 1) and skipped.spare == (2, 3)
    # the equation of the paper knows no tool
    of_paper = Sensitivity.of(calibration(model="huddersfield"), "FXYZ", Uncertainty((roll,), "", ""))
    np.testing.assert_array_equal(of_paper.rows(POINTS, TOOL), np.zeros((3, 2, 1)))


def test_nothing_known_has_no_columns() -> None:
    sensitivity = Sensitivity.of(calibration(), "FXYZ", Uncertainty((), "", ""))
    assert sensitivity.columns == 0
    assert sensitivity.rows(POINTS, TOOL).shape == (3, 2, 0)


def test_expansion_acts_by_axis_position_and_by_place_of_the_part() -> None:
    thermal = Thermal(
        scale_per_K=(10e-6, 0.0, 8e-6), fixed_at_mm=(1.0, 2.0, 3.0), workpiece_per_K=23e-6,
        clamped_at_mm=(5.0, 6.0, 7.0),
    )  # fmt: skip
    warm = calibration(thermal=thermal, temperature_degC=22.0)
    known = Uncertainty((), "", "", temperature_K=0.5)
    expansion = Expansion.of(warm, known, {"X_scale": 30.0, "Y_scale": 19.0, "workpiece": 40.0})
    # Y has no coefficient, and is 3 K below the calibration: that of steel counts in full
    steel = EXPANSION_PER_K
    assert steel == 11.5e-6
    assert expansion.scale == pytest.approx((5e-6, np.hypot(0.5, 3.0) * steel, 4e-6))
    assert expansion.workpiece == pytest.approx(11.5e-6)
    assert expansion.unmodelled_K == 3.0
    assert (expansion.fixed_at_mm, expansion.clamped_at_mm) == (thermal.fixed_at_mm, thermal.clamped_at_mm)
    rows = Sensitivity.of(warm, "FXYZ", known, expansion=expansion).rows(POINTS, TOOL)
    assert rows.shape == (3, 2, 4)
    expected = np.zeros((3, 2, 4))
    for j in range(3):
        expected[j, :, j] = expansion.scale[j] * (POINTS[:, j] - thermal.fixed_at_mm[j])
        expected[j, :, 3] = -11.5e-6 * (POINTS[:, j] + TOOL[j] - thermal.clamped_at_mm[j])
    np.testing.assert_allclose(rows, expected, rtol=1e-6)
    # a part without coefficient, 4 K above 20 degC; the largest difference is stated
    plain = Expansion.of(calibration(), known, {"Y_scale": 19.0, "workpiece": 24.0})
    assert plain.unmodelled_K == 4.0
    assert plain.workpiece == pytest.approx(np.hypot(0.5, 4.0) * steel)
    assert plain.scale == pytest.approx((0.5 * steel, np.hypot(0.5, 1.0) * steel, 0.5 * steel))
    assert plain.fixed_at_mm == plain.clamped_at_mm == (0.0, 0.0, 0.0)


def test_expansion_comes_behind_the_other_unknowns() -> None:
    known = Uncertainty((TILT,), "", "", temperature_K=1.0)
    expansion = Expansion.of(calibration(), known, {})
    assert expansion.unmodelled_K == 0.0
    assert Expansion((0.0,) * 3, (0.0,) * 3, 0.0, (0.0,) * 3).unmodelled_K == 0.0
    sensitivity = Sensitivity.of(calibration(), "FXYZ", known, expansion=expansion)
    rows = sensitivity.rows(POINTS, TOOL)
    assert rows.shape == (3, 2, 6)
    np.testing.assert_allclose(rows[0, :, :2], np.outer(POINTS[:, 2] - 3.0, [2.0, 0.5]), rtol=1e-6)
    np.testing.assert_allclose(rows[0, :, 2], 11.5e-6 * POINTS[:, 0], rtol=1e-6)
    np.testing.assert_allclose(rows[2, :, 5], -11.5e-6 * (POINTS[:, 2] - 100.0), rtol=1e-6)


def test_rows_are_the_change_of_the_error_with_each_number() -> None:
    """Against differences of the exact model, on a chain whose table moves."""
    known = Uncertainty(
        (
            Entry("mean", "EAZ", np.array([[1e-6], [3e-6]]), np.zeros(2), np.array([-200.0, 0.0])),
            Entry("squareness", "C0Y", np.array([[2e-6]]), np.zeros(1)),
        ),
        "", "",
    )  # fmt: skip
    measured = Curve(
        "Z", [-200.0, 0.0], {"EAZ": [1e-6, 3e-6]}, line_mm=(0.0, 0.0, 0.0), tool_mm=(0.0, 5.0, -70.0),
        interpolation="linear",
    )  # fmt: skip
    for chain in ("FXYZ", "ZYFX", "XZFY"):
        moved = replace(calibration(), curves=(calibration().curves[0], measured), squareness={"C0Y": 2e-6})
        rows = Sensitivity.of(calibration(), chain, known).rows(POINTS, TOOL)
        np.testing.assert_allclose(rows[:, :, 0].T, build(moved, chain).error(POINTS, TOOL), atol=2e-9)


def test_standard_uncertainties_by_the_key_of_their_source() -> None:
    measured = calibration(squareness={"C0Y": 1e-5})
    known = of_sigmas(measured, {"curves": {"EXX": np.full(3, 2e-3)}, "squareness": {"C0Y": 4e-6}})
    assert known is not None
    assert [(e.kind, e.name, e.rest.tolist()) for e in known.entries] == [
        ("mean", "EXX", [2e-3] * 3), ("squareness", "C0Y", [4e-6]),
    ]  # fmt: skip
    assert known.fingerprint == fingerprint(measured)
    assert known.source.startswith("sigma columns: components are taken as independent")
    assert "the 16 parts of a curve" in known.source
    assert of_sigmas(measured, {}) is None
    assert of_sigmas(measured, {"squareness": {}, "curves": {"EYX": np.full(3, 2e-3)}}) is None
