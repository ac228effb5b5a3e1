"""Numbers of a covariance: how they make a value, and what they do to the tip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from olp.core.machine import SQUARENESS
from olp.errormodel.entry import AxisState, Entry
from olp.errormodel.sensitivity import value_rows
from olp.errormodel.sources.curves import CELLS
from olp.errormodel.sources.registry import NUMBERS

X = np.array([0.0, 10.0, 40.0])
MEAN = Entry("mean", "EXX", np.array([[1.0, 0.0], [2.0, 5.0], [4.0, 0.0]]), np.zeros(3), X)
HALF = replace(MEAN, kind="half")
WAVE = Entry("wave", "EXX", np.array([[3.0], [4.0]]), np.array([0.3, 0.4]), period_mm=8.0)
TILT = Entry("squareness", "B0Z", np.array([[2.0]]), np.array([0.5]))
LOST = Entry("backlash", "Y", np.array([[2.0]]), np.array([0.5]))


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
