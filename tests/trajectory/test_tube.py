"""Path and speed planned together: limits, tube and order by the judge, and slopes by differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.joint_optimum import corner, jog
from judge.retiming import judge

from olp.core.errors import CannotCompute
from olp.trajectory import descent, tube
from olp.trajectory.cells import MOST_CELLS, knots
from olp.trajectory.overlap import overlap
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.solvers import TUBE
from olp.trajectory.stretches import runs_of
from olp.trajectory.timespline import TimeSpline
from olp.trajectory.tube import _itself, _Tube, in_tube

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


def test_a_sharp_corner_of_long_moves_has_cells_fine_enough() -> None:
    """A spline with cells for 100 mm leaves a tolerance of 5 um at the corner, so there they are halved."""
    route = route_of(np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 80.0]]), 0.005)
    assert tubes_of(route) < 0.999 * plan(route, LIMITS, tubes=False).duration_s


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


#: a small router, and a stroke into a hole whose backlash is taken up along ramps
ROUTER = AxisLimits(np.array([33.0, 33, 12]), np.array([150.0, 150, 80]), np.array([5e3, 5e3, 3e3]))
STROKE = np.array([[0, 0, 0], [0, -0.025, -0.3], [0, -0.028, -2], [0, -0.003, -1.7], [0, 0, 0], [3, 0, 0]])


def strokes(count: int) -> Route:
    """So many holes in a row. The tool turns back nearly, but no stop is needed."""
    holes = [STROKE[1 if k else 0 :] + np.array([3.0 * k, 0.0, 0.0]) for k in range(count)]
    point = np.concatenate(holes)
    feed = np.tile([1.5, 1.5, 1.5, 1.5, np.inf], count)
    band = np.full(len(point), 0.01)
    band[[0, -1]] = 0.0
    return Route(point, feed, np.arange(len(feed)), band, np.zeros(len(point)))


@pytest.mark.slow
def test_strokes_that_nearly_turn_back_are_planned_in_tubes_however_many_they_are() -> None:
    """Such runs were too long, or their corners between rapids and feeds too short for the first cells."""
    for count in (1, 12):
        own = strokes(count)
        found = plan(own, ROUTER)
        assert judge(found.motion, own, ROUTER).wrong == ()
        assert {leg.solver for leg in found.legs} == {TUBE}
        assert found.duration_s < 0.993 * plan(own, ROUTER, tubes=False).duration_s


@pytest.mark.parametrize(
    ("middle", "good"), [((1.5, 3.0, 4.0, 3.0, 1.5), True), ((2.0, 4.0, 3.0, 4.0, 2.0), False)]
)
def test_a_motion_may_turn_with_its_route_and_not_twice(middle: tuple[float, ...], good: bool) -> None:
    """There and back, each of its velocities leads along one of both segments; only their order tells."""
    route = route_of(np.array([[0.0, 0.0], [4.0, 0.0], [0.5, 0.02]]), 0.05)
    tube = _Tube.of(route, LIMITS, np.repeat([0, 1], 4))
    x = np.concatenate((np.zeros(3), middle, np.full(3, 0.5)))
    assert tube.forward(TimeSpline(np.column_stack((x, 0.0 * x, 0.1 * x)), np.ones(8))) is good


@pytest.mark.slow
def test_a_search_goes_on_from_a_motion_that_cannot_be_pulled_inside(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that a search has found may touch bounds on all sides. It is inside with its own cells."""
    route = replace(route_of(corner(45.0, 3.0), 0.1), line=np.arange(2))
    first = overlap(route, LIMITS)
    with monkeypatch.context() as few:
        few.setattr(descent, "_STEPS", 12)
        found = in_tube(route, LIMITS, first)
    monkeypatch.setattr(tube, "_PULLS", 0)
    again = in_tube(route, LIMITS, found)
    assert judge(again, route, LIMITS).wrong == ()
    assert again.duration_s < 0.999 * found.duration_s
    # what is not inside is no start
    with pytest.raises(CannotCompute, match="not inside the tube"):
        in_tube(route, LIMITS, first)


@pytest.mark.slow
def test_a_search_that_ends_in_a_turn_back_keeps_what_came_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mixture took 2.138 s, and 1.733 s with the last motion on the way that never turns back."""
    route = replace(route_of(corner(45.0, 3.0), 0.1), line=np.arange(2))
    first = overlap(route, LIMITS)
    least_s = in_tube(route, LIMITS, first).duration_s
    most_s = 0.5 * (first.duration_s + least_s)
    monkeypatch.setattr(_Tube, "forward", lambda _, spline: spline.duration_s > most_s)
    assert most_s < in_tube(route, LIMITS, first).duration_s < first.duration_s
    monkeypatch.setattr(_Tube, "forward", lambda *_: False)
    with pytest.raises(CannotCompute, match="no faster motion"):
        in_tube(route, LIMITS, first)


def test_points_that_are_one_and_rapids_are_driven() -> None:
    flat = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.0], [3.0, 2.0], [5.0, 2.0]])
    tubes_of(route_of(flat, 0.02, np.array([100.0, 100.0, np.inf, np.inf])))


def test_no_more_runs_are_in_tubes_than_are_affordable() -> None:
    """Those that lose most time for each cell; all others as before."""
    corners = np.cumsum(np.tile([[0.5, 0.0], [0.0, 0.5]], (400, 1)), axis=0)
    route = route_of(corners, 0.01)
    route.tolerance_mm[::2] = 0.0
    runs = runs_of(route, LIMITS, tubes=1.0)
    assert 0 < sum(run.tube for run in runs) < len(runs) / 2
    assert not any(run.tube for run in runs_of(route, LIMITS))
    half = sum(run.tube for run in runs_of(route, LIMITS, tubes=0.5))
    assert half == pytest.approx(sum(run.tube for run in runs) / 2, abs=1)
    few = replace(
        route, point_mm=route.point_mm[:9], feed_mm_s=route.feed_mm_s[:8], line=route.line[:8],
        tolerance_mm=route.tolerance_mm[:9], dwell_s=route.dwell_s[:9],
    )  # fmt: skip
    assert all(run.tube for run in runs_of(few, LIMITS, tubes=1.0))


@pytest.mark.parametrize(("count", "each"), [(48, 16), (50, 12), (97, 8), (98, 0)])
def test_a_few_waypoints_more_do_not_end_a_search(count: int, each: int) -> None:
    """A correction divides moves: its run went beyond the most cells, and was slower than the nominal one."""
    angle = np.linspace(0.0, 2.0, count + 1)
    route = route_of(20.0 * count * np.column_stack((np.sin(angle), np.cos(angle))), 0.01)
    route = replace(route, line=np.arange(count))
    (run,) = runs_of(route, LIMITS, tubes=True)
    assert run.cells == count * each
    segment = knots(route, LIMITS, overlap(route, LIMITS))[1]
    assert min(each, 8) * count <= len(segment) <= 2 * MOST_CELLS


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


def test_a_run_that_is_passed_in_a_few_cells_is_refused_with_its_reason() -> None:
    """Its tolerance is far larger than it is; it ended in an error of arrays, which nothing told."""
    route = route_of(np.array([[0.0, 0.0], [1e-4, 0.0], [1e-4, 1e-4]]), 50.0)
    with pytest.raises(CannotCompute, match="too few cells"):
        in_tube(route, LIMITS, overlap(replace(route, tolerance_mm=np.zeros(3)), LIMITS))


@pytest.mark.parametrize(("share", "inside"), [(1.0, True), (0.5, False)])
def test_a_motion_that_leaves_its_tube_is_no_start(share: float, inside: bool) -> None:
    """It has all of a corner's tolerance, and twice what the narrower tube leaves."""
    found = in_tube(
        route_of(corner(45.0, 5.0), 0.1), LIMITS, overlap(route_of(corner(45.0, 5.0), 0.1), LIMITS)
    )
    assert (_itself(route_of(corner(45.0, 5.0), 0.1 * share), LIMITS, found) is not None) is inside
