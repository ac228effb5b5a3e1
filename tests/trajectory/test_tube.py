"""Path and speed planned together: limits, tube and order by the judge, and slopes by differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.joint_optimum import corner, jog
from judge.retiming import judge

from olp.trajectory.overlap import overlap
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.solvers import TUBE
from olp.trajectory.stretches import runs_of
from olp.trajectory.timespline import TimeSpline

LIMITS = AxisLimits(np.array([500.0, 400.0, 300.0]), np.array([5e3, 4e3, 3e3]), np.array([1e5, 8e4, 6e4]))


def route_of(flat: np.ndarray, tolerance: float, feed: np.ndarray | float = 100.0) -> Route:
    count = len(flat)
    band = np.full(count, tolerance)
    band[[0, -1]] = 0.0
    point = np.column_stack((flat, 0.1 * flat[:, 0]))
    return Route(
        point, np.broadcast_to(feed, count - 1).astype(float), np.arange(1, count), band, np.zeros(count)
    )


def tubes_of(route: Route) -> float:
    """The time of the plan, which the judge passes and which is all in a tube."""
    found = plan(route, LIMITS)
    assert judge(found.motion, route, LIMITS).wrong == ()
    assert {leg.solver for leg in found.legs} == {TUBE}
    return found.duration_s


def test_a_corner_is_faster_than_by_any_method_alone() -> None:
    route = route_of(corner(45.0, 5.0), 0.1)
    assert tubes_of(route) < 0.997 * plan(route, LIMITS, tubes=False).duration_s


def test_a_jog_between_narrow_and_wide_tolerances_keeps_both() -> None:
    route = route_of(jog() / 4.0, 0.005)
    route.tolerance_mm[1] = 0.1
    tubes_of(route)


@pytest.mark.parametrize("bend", [0.0, 0.02])
@pytest.mark.parametrize("feeds", [(20.0, 150.0), (150.0, 20.0)])
def test_more_feed_holds_behind_the_waypoint_and_not_within_the_tolerance_of_it(
    bend: float, feeds: tuple[float, float]
) -> None:
    """A path may pass a waypoint by the tolerance before it; feeds once changed there."""
    flat = np.array([[0.0, 0.0], [4.0, 0.0], [8.0, bend], [8.0, 3.0]])
    route = route_of(flat, 0.05, np.array([*feeds, 80.0]))
    tubes_of(route)
    motion = plan(route, LIMITS).motion
    place, velocity = motion.at(np.linspace(0.0, motion.duration_s, 20_000)[1:-1])[:2]
    slow = (place[:, 0] < 4.0 - 1e-6) if feeds[0] < feeds[1] else (place[:, 0] > 4.0 + 1e-6)
    slow &= place[:, 0] < 7.0
    assert slow.sum() > 1000
    assert np.sqrt((velocity[slow] ** 2).sum(axis=1)).max() <= 20.0 * (1.0 + 1e-9)


def test_points_that_are_one_and_rapids_are_driven() -> None:
    flat = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.0], [3.0, 2.0], [5.0, 2.0]])
    tubes_of(route_of(flat, 0.02, np.array([100.0, 100.0, np.inf, np.inf])))


def test_no_more_runs_are_in_tubes_than_are_affordable() -> None:
    """Those that lose most time for each cell; all others as before."""
    corners = np.cumsum(np.tile([[0.5, 0.0], [0.0, 0.5]], (400, 1)), axis=0)
    route = route_of(corners, 0.01)
    route.tolerance_mm[::2] = 0.0
    runs = runs_of(route, LIMITS, tubes=True)
    assert 0 < sum(run.tube for run in runs) < len(runs) / 2
    assert not any(run.tube for run in runs_of(route, LIMITS))
    few = replace(
        route, point_mm=route.point_mm[:9], feed_mm_s=route.feed_mm_s[:8], line=route.line[:8],
        tolerance_mm=route.tolerance_mm[:9], dwell_s=route.dwell_s[:9],
    )  # fmt: skip
    assert all(run.tube for run in runs_of(few, LIMITS, tubes=True))


def test_a_spline_through_cubics_of_time_is_that_motion() -> None:
    motion = overlap(route_of(corner(70.0), 0.02), LIMITS)
    spline = TimeSpline.through(motion, motion.start_s)
    time = np.linspace(0.0, motion.duration_s, 500)[:-1]
    again = spline.motion(motion.line)
    for one, other, scale in zip(again.at(time)[:3], motion.at(time)[:3], (1.0, 1e2, 1e4), strict=True):
        assert np.abs(one - other).max() <= 1e-9 * scale


def test_slopes_are_those_of_differences() -> None:
    rng = np.random.default_rng(1)
    spline = TimeSpline(rng.normal(size=(12, 2)), rng.uniform(0.5, 2.0, 9))
    knot = np.arange(1, 9)
    slopes = (*spline.rates().slopes(), *(place.slope() for place in spline.controls()))

    def values(one: TimeSpline) -> list[np.ndarray]:
        rates = one.rates()
        places = [place.point() for place in one.controls()]
        return [rates.d1, rates.d2, rates.d3, *places, one.at_knots(knot)[0]]

    by_c, by_h = spline.at_knots(knot)[1:]
    step = 1e-6
    for node in range(-1, 13):
        for axis in range(3):
            c, h = np.zeros_like(spline.coefficient), np.zeros_like(spline.cell_s)
            if axis < 2 and 0 <= node < 12:
                c[node, axis] = step
            elif axis == 2 and 0 < node <= 9:
                h[node - 1] = step
            else:
                continue
            up, down = values(spline.moved(c, h)), values(spline.moved(-c, -h))
            change = [(a - b) / (2.0 * step) for a, b in zip(up, down, strict=True)]
            for k, (slope, first) in enumerate(zip(slopes, (-1, -1, -1, 0, 0), strict=True)):
                for row in range(len(slope)):
                    own = node - row - first
                    expected = slope[row, :, own, axis] if 0 <= own < 5 else 0.0
                    assert np.allclose(change[k][row], expected, rtol=1e-6, atol=1e-6)
            for row in range(len(knot)):
                own = node - row
                expected = np.zeros(2)
                if axis < 2 and 1 <= own < 4:
                    expected[axis] = by_c[row, own - 1]
                elif axis == 2 and 0 <= own < 4:
                    expected = by_h[row, own]
                assert np.allclose(change[-1][row], expected, rtol=1e-6, atol=1e-6)
