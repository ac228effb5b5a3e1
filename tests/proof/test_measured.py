"""The layer of measured runs, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.proof.measured import ABOVE, SHOWN, WITHIN, Measured

NAN = math.nan
LINE = np.array([3, 3, 5, 9])
RUNS = (np.array([1.0, 4.0, NAN, 2.0]), np.array([2.0, 3.0, NAN, NAN]))


def measured(tolerance_um: float | None = 3.5, runs: tuple[np.ndarray, ...] = RUNS) -> Measured:
    return Measured(("a", "b"), LINE, np.array([1, 1, 2, -1]), np.array([0, 0, 1, 2]), runs, tolerance_um)


def test_a_move_has_the_largest_of_its_points() -> None:
    got = Measured.largest_of(4, np.array([1, 1, 3]), np.array([2.0, 5.0, 1.0]))
    assert got[[1, 3]].tolist() == [5.0, 1.0]
    assert np.isnan(got[[0, 2]]).all()


def test_of_one_run_and_of_all() -> None:
    runs = measured()
    assert runs.largest_um() == 4.0
    assert runs.largest_um(1) == 3.0
    assert runs.size_um()[[0, 1, 3]].tolist() == [2.0, 4.0, 2.0]
    assert measured(runs=(np.full(4, NAN),) * 2).largest_um() is None


@pytest.mark.parametrize(("tolerance_um", "over"), [(None, 0), (4.0, 0), (3.9, 1), (1.9, 3)])
def test_a_move_is_above_the_part_tolerance_or_not(tolerance_um: float | None, over: int) -> None:
    assert measured(tolerance_um).over.sum() == over


def test_lines_with_their_states() -> None:
    table = measured().by_line()
    assert (table["line"].tolist(), table["measured_um"].tolist()) == ([3, 9], [4.0, 2.0])
    assert table["state"].tolist() == [ABOVE, WITHIN]
    assert measured(4.0).by_line()["state"].tolist() == [WITHIN, WITHIN]
    assert measured(None).by_line()["state"].tolist() == [SHOWN, SHOWN]
    assert measured().by_line(1)["line"].tolist() == [3]


def test_the_worst_lines_come_first_and_of_equal_ones_the_first() -> None:
    equal = measured(1.5, (np.array([2.0, 1.0, 7.0, 2.0]), np.full(4, NAN)))
    assert equal.worst() == [
        {"line": 5, "max_um": 7.0},
        {"line": 3, "max_um": 2.0},
        {"line": 9, "max_um": 2.0},
    ]
    assert equal.worst(1) == [{"line": 5, "max_um": 7.0}]
    assert equal.lines_over() == [5, 3, 9]
    assert measured().lines_over() == [3]


def test_ten_lines_are_the_worst() -> None:
    many = Measured(("a",), np.arange(12), np.ones(12, int), np.zeros(12, int), (np.arange(12.0),), None)
    assert [row["line"] for row in many.worst()] == list(range(11, 1, -1))


def test_the_report_by_runs_operations_and_tools() -> None:
    report = measured().report()
    assert report["runs"] == [
        {"name": "a", "largest_um": 4.0, "line": 3}, {"name": "b", "largest_um": 3.0, "line": 3}
    ]  # fmt: skip
    assert report["tolerance_um"] == 3.5
    first = {"first_line": 3, "last_line": 3, "tool": 1, "measured_um": 4.0, "worst_line": 3, "holds": False}
    second = {
        "first_line": 9, "last_line": 9, "tool": None, "measured_um": 2.0, "worst_line": 9, "holds": True
    }  # fmt: skip
    assert report["operations"] == report["tools"][::1] == [first, second]
    assert [group["holds"] for group in measured(4.0).report()["tools"]] == [True, True]
    assert [group["holds"] for group in measured(None).report()["tools"]] == [None, None]
    nothing = measured(runs=(np.full(4, NAN),) * 2).report()
    assert nothing["runs"][0] == {"name": "a", "largest_um": None, "line": None}
    assert nothing["operations"] == []


def test_groups_of_runs_have_their_lines_and_their_worst() -> None:
    """The tools 2 and 1 in order of appearance; the worst is the first of equal ones."""
    lines = np.array([9, 5, 7, 8, 3, 4])
    sizes = np.array([1.0, 6.0, 2.0, 6.0, NAN, 3.0])
    tools = np.array([2, 1, 2, 1, 2, 1])
    report = Measured(("a",), lines, tools, np.zeros(6, int), (sizes,), 6.0).report()
    assert report["tools"] == [
        {"first_line": 7, "last_line": 9, "tool": 2, "measured_um": 2.0, "worst_line": 7, "holds": True},
        {"first_line": 4, "last_line": 8, "tool": 1, "measured_um": 6.0, "worst_line": 5, "holds": True},
    ]
    (operation,) = report["operations"]
    assert (operation["first_line"], operation["last_line"], operation["tool"]) == (4, 9, 1)
    assert report["runs"] == [{"name": "a", "largest_um": 6.0, "line": 5}]


def test_tool_zero_is_a_tool() -> None:
    report = Measured(("a",), np.array([3]), np.array([0]), np.array([0]), (np.array([1.0]),), None).report()
    assert report["tools"][0]["tool"] == 0


def test_no_runs_and_no_points() -> None:
    none = Measured((), LINE, np.ones(4, int), np.zeros(4, int), (), 3.5)
    assert none.largest_um() is None
    assert np.isnan(none.size_um()).all()
    assert (none.by_line()["line"].tolist(), none.worst(), none.lines_over()) == ([], [], [])
    assert none.over.tolist() == [False] * 4
    assert none.report()["tools"] == []
    assert none.by_line()["state"].dtype == np.uint8


def test_the_states_of_one_run_are_its_own() -> None:
    runs = measured(3.5)
    assert runs.by_line(1)["state"].tolist() == [WITHIN]
    assert runs.by_line(0)["state"].tolist() == [ABOVE, WITHIN]
    assert runs.by_line(0)["measured_um"].tolist() == [4.0, 2.0]
