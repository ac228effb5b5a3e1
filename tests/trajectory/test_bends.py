"""Routes with corners moved outward, and with noise on lines: within the tolerance, and faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.trajectory import route as route_of

from olp.trajectory.bends import levelled, outward
from olp.trajectory.critical import best_profile, driven, seconds
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import smooth

LIMITS = AxisLimits(np.full(3, 500.0), np.full(3, 5e3), np.full(3, 1e5))


def route(points: np.ndarray, feed: float, tolerance_mm: float) -> Route:
    made: Route = route_of(points, feed, tolerance_mm)
    return made


def closed_s(some: Route) -> float:
    path = smooth(some, LIMITS)
    return seconds(path, best_profile(path, LIMITS))


def corners(turns_deg: list[float], tolerance_mm: float) -> Route:
    """Moves of 20 mm, each turned against the one before, in a plane that is none of the axes'."""
    angle = np.radians(np.cumsum([0.0, *turns_deg]))
    plane = np.array([[0.8, 0.6, 0.0], [-0.36, 0.48, 0.8]])
    steps = 20.0 * np.stack((np.cos(angle), np.sin(angle)), axis=1) @ plane
    return route(np.cumsum(np.concatenate((np.zeros((1, 3)), steps)), axis=0), 100.0, tolerance_mm)


def noisy(noise_mm: float, tolerance_mm: float) -> Route:
    """Chords of 2 mm along a line of 40 mm, off it by chance between its ends."""
    x = np.linspace(0.0, 40.0, 21)
    off = np.random.default_rng(3).uniform(-noise_mm, noise_mm, (21, 2))
    off[[0, -1]] = 0.0
    return route(np.column_stack((x, off)), 100.0, tolerance_mm)


@pytest.mark.parametrize(
    ("turns", "tolerance_mm", "factor"),
    [
        ([30.0], 0.02, 0.99), ([90.0], 0.2, 0.99), ([140.0], 0.2, 0.999), ([60.0, -45.0, 100.0], 0.05, 0.99),
        # slow corners gain nothing, nor do those at full speed
        ([90.0], 0.002, 1.01), ([30.0], 0.2, 1.01),
    ],
)  # fmt: skip
def test_a_corner_moved_outward_is_faster_and_within_the_tolerance(
    turns: list[float], tolerance_mm: float, factor: float
) -> None:
    own = corners(turns, tolerance_mm)
    moved = outward(own)
    assert moved is not None
    assert closed_s(moved) < factor * closed_s(own)
    path = smooth(moved, LIMITS)
    motion = driven(path, best_profile(path, LIMITS))
    allowed = np.full(len(motion), tolerance_mm)
    away = deviation_bound(motion, own, motion.line, allowed)
    assert away.max() <= tolerance_mm
    # both sides are used
    assert np.linalg.norm(moved.point_mm - own.point_mm, axis=1).max() > 0.6 * tolerance_mm


def test_a_corner_beside_dense_points_stays() -> None:
    angle = np.linspace(0.0, 1.0, 30)
    arc = 5.0 * np.stack((np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle), axis=1)
    corner = arc[-1] + np.array([[0.0, 20.0, 0.0], [20.0, 20.0, 0.0]])
    assert outward(route(np.concatenate((arc, corner)), 100.0, 0.02)) is None
    # nor does the next one, only the one behind it
    more = corner[-1] + np.array([[0.0, 20.0, 0.0], [20.0, 20.0, 0.0]])
    own = route(np.concatenate((arc, corner, more)), 100.0, 0.02)
    moved = outward(own)
    assert moved is not None
    assert np.any(moved.point_mm != own.point_mm, axis=1).nonzero()[0].min() > 30


def test_noise_inside_the_tolerance_is_a_line() -> None:
    own = noisy(0.004, 0.01)
    line = levelled(own)
    assert line is not None
    np.testing.assert_array_equal(line.line, own.line)
    np.testing.assert_array_equal(line.feed_mm_s, own.feed_mm_s)
    assert np.ptp(line.point_mm[:, 1:], axis=0).max() <= 1e-12
    away = np.linalg.norm(line.point_mm - own.point_mm, axis=1)
    assert (line.tolerance_mm[1:-1] <= own.tolerance_mm[1:-1] - away[1:-1] + 1e-15).all()
    straight = plan(route(own.point_mm[[0, -1]], 100.0, 0.0), LIMITS).duration_s
    assert plan(own, LIMITS).duration_s == pytest.approx(straight, rel=1e-6)


def test_what_is_no_noise_stays() -> None:
    assert levelled(noisy(0.04, 0.01)) is None
    angle = np.linspace(0.0, 3.0, 200)
    arc = 20.0 * np.stack((np.sin(angle), np.cos(angle), 0.0 * angle), axis=1)
    assert levelled(route(arc, 100.0, 0.01)) is None
    back = np.array([[0.0, 0, 0], [5, 0.001, 0], [4, -0.001, 0], [6, 0.001, 0], [5.5, -0.001, 0], [9, 0, 0]])
    assert levelled(route(back, 100.0, 0.01)) is None


def test_a_rest_ends_a_line() -> None:
    own = noisy(0.004, 0.01)
    stopped = replace(own, tolerance_mm=np.where(np.arange(21) == 10, 0.0, own.tolerance_mm))
    line = levelled(stopped)
    assert line is not None
    np.testing.assert_array_equal(line.point_mm[10], own.point_mm[10])


def test_waypoints_on_a_line_cost_no_time() -> None:
    x = np.linspace(0.0, 40.0, 21)[:, None] * np.array([[0.6, 0.8, 0.0]])
    one = closed_s(route(x[[0, -1]], 100.0, 0.01))
    assert closed_s(route(x, 100.0, 0.01)) == pytest.approx(one, rel=1e-9)


def test_waypoints_on_lines_are_those_that_division_one_by_one_finds() -> None:
    """A stretch is divided at the waypoint farthest beyond its share, until no other is left."""
    rng = np.random.default_rng(7)
    for noise_mm in (0.002, 0.004, 0.008):
        steps = np.column_stack((rng.uniform(0.1, 1.0, 2000), rng.normal(0.0, noise_mm, (2000, 2))))
        own = route(np.cumsum(steps, axis=0), 100.0, 0.02)
        line = levelled(own)
        assert line is not None
        moved = (line.point_mm != own.point_mm).any(axis=1)
        fixed = np.zeros(len(own), bool)
        todo = [(0, len(own) - 1)]
        while todo:
            a, b = todo.pop()
            fixed[[a, b]] = True
            along = (own.point_mm[b] - own.point_mm[a]) / np.linalg.norm(own.point_mm[b] - own.point_mm[a])
            away = np.linalg.norm(np.cross(own.point_mm[a + 1 : b] - own.point_mm[a], along), axis=1)
            if (away > 0.6 * own.tolerance_mm[a + 1 : b]).any():
                middle = a + 1 + int(np.argmax(away - 0.6 * own.tolerance_mm[a + 1 : b]))
                todo += [(a, middle), (middle, b)]
        assert moved.any()
        assert not (moved & fixed).any()
        # what is moved lies on the line of the fixed ones around it
        ends = np.flatnonzero(fixed)
        for k in np.flatnonzero(moved).tolist():
            a, b = ends[np.searchsorted(ends, k) - 1], ends[np.searchsorted(ends, k)]
            along = line.point_mm[b] - line.point_mm[a]
            off = np.cross(line.point_mm[k] - line.point_mm[a], along / np.linalg.norm(along))
            assert np.linalg.norm(off) < 1e-9
