"""Runs of corners and curves: a rest more is no gain, and what is divided is faster than one method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.trajectory import route
from trajectory.test_plan import LIMITS, assert_within

from olp.trajectory.divide import ends, parts
from olp.trajectory.plan import plan
from olp.trajectory.route import Route
from olp.trajectory.solvers import SOLVERS, Run


def corners_and_a_curve(turns: int = 1) -> Route:
    """Sharp corners, then half a circle of dense chords, again and again."""
    angle = np.linspace(0.0, np.pi, 100)
    curve = np.stack((60.0 - 20.0 * np.cos(angle), 20.0 * np.sin(angle), 0.0 * angle), axis=1)
    corners = np.array([[0, 0, 0], [20, 0, 0], [20, 20, 0], [40, 20, 0]], float)
    one = np.concatenate((corners, curve))
    points = np.concatenate([one + np.array([80.0 * k, 0.0, 0.0]) for k in range(turns)])
    return route(points, 100.0, 0.01)


def test_a_rest_between_corners_and_a_curve_is_no_gain() -> None:
    own = corners_and_a_curve()
    trajectory = plan(own, LIMITS)
    assert {leg.solver for leg in trajectory.legs} == {"overlapped moves", "optimised speed"}
    assert_within(trajectory, LIMITS, 100.0)
    for stop in (2, 3, 4):
        tolerance = own.tolerance_mm.copy()
        tolerance[stop] = 0.0
        assert trajectory.duration_s <= plan(replace(own, tolerance_mm=tolerance), LIMITS).duration_s * 1.0001


def test_parts_alternate_and_cover_the_run() -> None:
    own = corners_and_a_curve(3)
    run = Run(own, LIMITS)
    found = parts(run, SOLVERS[1].solve(run), np.inf)
    assert [a for a, _, _ in found[1:]] == [b for _, b, _ in found[:-1]]
    assert (found[0][0], found[-1][1]) == (0, len(own) - 1)
    straight = [part[2] for part in found]
    assert straight == [k % 2 == 0 for k in range(len(found))]
    assert len(found) >= 5
    assert parts(run, SOLVERS[1].solve(run), 0.0) == []


@pytest.mark.parametrize("turned", (False, True))
def test_a_short_move_at_an_end_is_driven_alone(turned: bool) -> None:
    angle = np.linspace(0.0, np.pi, 200)
    curve = 20.0 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    with_step = np.concatenate(([[20.012, -0.002, 0.0]], curve))
    points = with_step[::-1] if turned else with_step
    own = route(points, 100.0, 0.01)
    cut = ends(Run(own, LIMITS))
    assert cut == ([(0, 199, False), (199, 200, True)] if turned else [(0, 1, True), (1, 200, False)])
    alone = plan(route(curve, 100.0, 0.01), LIMITS).duration_s
    assert plan(own, LIMITS).duration_s <= alone + 4.0 * np.cbrt(0.0122 / 2.0 / LIMITS.jerk[0]) + 1e-4
    assert ends(Run(route(curve, 100.0, 0.01), LIMITS)) == []
