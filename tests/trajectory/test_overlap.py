"""Laws of overlapped moves: limits, tolerance, exact stops, joins and progress, on anything there is."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import UsageError
from olp.trajectory import ruckig_moves
from olp.trajectory.audit import audit, slowing
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.overlap import least_s, overlap, overlap_parts
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.same import groups_of_same

LIMITS = AxisLimits(np.array([500.0, 500.0, 300.0]), np.array([5e3, 5e3, 3e3]), np.array([1e5, 1e5, 6e4]))


def route_of(points, feed=100.0, tolerance=0.01) -> Route:
    points = np.asarray(points, np.float64).reshape(-1, 3)
    n = len(points)
    near = np.broadcast_to(np.asarray(tolerance, np.float64), n).copy()
    near[:1] = near[-1:] = 0.0
    feeds = np.broadcast_to(np.asarray(feed, np.float64), max(n - 1, 0)).copy()
    return Route(points, feeds, np.arange(max(n - 1, 0)) + 10, near, np.zeros(n))


def check(route: Route, limits: AxisLimits = LIMITS, *, differences: bool = True):
    """Every law that holds for any route of two or more waypoints."""
    parts = overlap_parts(route, limits)
    motion = parts.motion
    assert least_s(route, limits).sum() <= motion.duration_s * (1 + 1e-8) + 1e-12
    assert len(motion) == len(parts.segment) and np.all(np.diff(motion.start_s) >= 0.0)
    assert np.array_equal(motion.line, route.line[parts.segment])
    assert np.all(np.diff(parts.segment) >= 0)
    result = audit(motion, limits, route.feed_mm_s[parts.segment])
    size = np.abs(route.point_mm).max() + 1.0
    # times late in the motion are rounded: a phase is longer or shorter by this
    late = motion.duration_s * 2.0**-52
    assert slowing(result) <= 1.0 + 1e-6 + late * float((limits.jerk / limits.acceleration).max())
    speed = float((result.velocity * limits.velocity).max())
    rate = float((result.acceleration * limits.acceleration).max())
    assert result.position_jump_mm <= 1e-9 + 1e-14 * size + late * speed
    assert result.velocity_jump_mm_s <= 2e-9 * speed + 2 * late * rate
    assert result.acceleration_jump_mm_s2 <= 2e-9 * rate + 2 * late * float((result.jerk * limits.jerk).max())
    moved = np.diff(motion.start_s)[:, None] > 0
    shape = motion.path[motion.shape[moved[:, 0]]]
    straight = ~shape[:, 2:].any(axis=(1, 2))
    # along its segment a move never goes back
    rates = motion.time[moved[:, 0]][straight]
    u = np.diff(motion.start_s)[moved[:, 0]][straight]
    for share in (0.0, 0.3, 0.7, 1.0):
        v = rates[:, 1] + share * u * (2 * rates[:, 2] + 3 * share * u * rates[:, 3])
        assert v.min(initial=0.0) >= -2e-9 * speed - 2 * late * rate
    near = np.max(route.tolerance_mm) * (1 + 1e-6) + 2e-9 + 1e-14 * size + late * speed
    near = np.full(len(motion), near)
    assert np.all(deviation_bound(motion, route, parts.segment, near) <= near)
    corners(route, parts)
    assert np.abs(motion.at(np.array([0.0]))[0][0] - route.point_mm[0]).max() <= 1e-9
    assert np.abs(motion.at(motion.start_s[-1:])[0][0] - route.point_mm[-1]).max() <= 2e-9 + late * speed
    if differences and motion.duration_s < 100.0:
        step = 1e-3
        t = np.arange(0.0, motion.duration_s, step)
        position = motion.at(t)[0]
        for order, most in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
            change = np.abs(np.diff(position, order, axis=0)) / step**order
            noise = (1e-15 * size + late * speed) * (2.0 / step) ** order
            assert change.max(initial=0.0) == 0.0 or np.all(change.max(axis=0) <= most * (1 + 1e-6) + noise)
    return parts


def corners(route: Route, parts) -> None:
    """The motion passes each waypoint within its tolerance; with tolerance 0, at rest."""
    motion = parts.motion
    size = np.abs(route.point_mm).max() + 1.0
    group = groups_of_same(route.point_mm)
    kept = np.flatnonzero(np.diff(group, prepend=-1))
    for i, k in enumerate(kept[1:-1].tolist(), start=1):
        tolerance = route.tolerance_mm[group == i].min()
        first = int(np.searchsorted(parts.segment, k, side="left"))
        begin = np.array([first])
        # an overlap has more parts than one where the jerk of a move changes within it
        bent = motion.path[motion.shape[first:], 2:].any(axis=(1, 2)) & (
            parts.segment[first:] == parts.segment[first]
        )
        end = first + max(int(np.argmin(np.append(bent, False))), 1)
        if tolerance <= 0.0:
            position, velocity, acceleration, _ = motion.of(begin, np.zeros(1))
            assert np.abs(position[0] - route.point_mm[k]).max() <= 1e-9 + 1e-14 * size
            assert np.abs(velocity).max() <= 1e-9 and np.abs(acceleration).max() <= 1e-6
        else:
            t = np.linspace(motion.start_s[first], motion.start_s[end], 33)
            near = np.sqrt(((motion.at(t)[0] - route.point_mm[k]) ** 2).sum(axis=1))
            assert near.min() <= tolerance * (1 + 1e-6) + 1e-9 + 1e-14 * size


def powers(low: float, high: float):
    return st.floats(np.log10(low), np.log10(high)).map(lambda x: 10.0**x)


@st.composite
def routes(draw):
    count = draw(st.integers(2, 9))
    point, points = np.zeros(3), []
    for _ in range(count):
        points.append(point)
        direction = np.array([draw(st.sampled_from([-1.0, 0.0, 0.0, 0.3, 1.0])) for _ in range(3)])
        point = point + direction * draw(st.one_of(powers(1e-2, 100.0), powers(1e-9, 1e4)))
    feeds = [draw(st.one_of(st.just(np.inf), powers(1.0, 1e3), powers(1e-5, 1e4))) for _ in range(count - 1)]
    near = [draw(st.one_of(st.just(0.0), powers(1e-4, 1.0), st.just(1e3))) for _ in range(count)]
    return route_of(points, feeds, near)


@st.composite
def limits_of(draw):
    jerk = draw(st.one_of(powers(1e3, 1e6), powers(10.0, 1e9)))
    slow = draw(st.sampled_from([1.0, 1.0, 0.01]))
    axis = np.array([1.0, draw(st.sampled_from([1.0, 0.3])), slow])
    return AxisLimits(draw(powers(10.0, 2e3)) * axis, draw(powers(100.0, 2e4)) * axis, jerk * axis)


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(routes(), limits_of())
def test_any_route(route, limits):
    check(route, limits)


STAIR = np.cumsum([[0, 0, 0]] + [[0.01, 0, 0], [0, 0.01, 0]] * 40, axis=0)
ANGLE = np.linspace(0.0, 2 * np.pi, 200)
CASES = {
    "two points": route_of([[0, 0, 0], [10, 0, 0]]),
    "reversal": route_of([[0, 0, 0], [10, 0, 0], [0, 0, 0], [10, 0, 0]], tolerance=0.1),
    "collinear, feeds up and down": route_of(
        [[x, x / 2, 0] for x in range(6)], feed=[10, 400, 1e-2, 100, np.inf], tolerance=0.1
    ),
    "rapid into a slow feed": route_of(
        [[0, 0, 0], [50, 0, 0], [50, 5, 0]], feed=[np.inf, 0.1], tolerance=1.0
    ),
    "tiny beside 10 m": route_of(
        [[0, 0, 0], [1e4, 0, 0], [1e4 + 1e-6, 0, 0], [1e4, 1e-6, 0], [1e4, 1e-6, 1e-8], [0, 1, 0]],
        tolerance=0.02,
    ),
    "duplicates": route_of(np.repeat([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], 3, axis=0)),
    "creeping": route_of([[k * 0.6e-9, 0, 0] for k in range(50)] + [[1, 0, 0], [1, 1, 0]]),
    "tolerance far larger": route_of(STAIR, tolerance=1e3),
    "stair": route_of(STAIR, tolerance=0.01),
    "spike": route_of([[0, 0, 0], [1, 0, 0], [1, 500, 0], [1.0, 0, 0], [2, 0, 0]]),
    "chords of a circle": route_of(np.c_[50 * np.cos(ANGLE), 50 * np.sin(ANGLE), 0 * ANGLE]),
    "closed loop": route_of([[0, 0, 0], [5, 0, 0], [5, 5, 0], [0, 5, 0], [0, 0, 0]], tolerance=0.5),
    "all stops": route_of(STAIR, tolerance=0.0),
    "very slow": route_of([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], feed=1e-5),
    "far from the datum": route_of(np.array([[0, 0, 0], [5, 0, 0], [5, 5, 0]]) + 1e4),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("jerk", [10.0, 1e5, 1e9])
def test_hard_routes(name, jerk):
    check(CASES[name], AxisLimits(LIMITS.velocity, LIMITS.acceleration, np.full(3, jerk)))


def test_an_overlap_saves_time():
    points = [[0, 0, 0], [5, 0, 0], [5, 5, 0], [0, 5, 0]]
    still = overlap(route_of(points, tolerance=0.0), LIMITS).duration_s
    times = [overlap(route_of(points, tolerance=t), LIMITS).duration_s for t in (1e-3, 1e-2, 1e-1)]
    assert still > times[0] > times[1] > times[2]


def longest(points, tolerance):
    """Seconds that the moves to and from the second of three points overlap."""
    stops, cut = (overlap(route_of(points, tolerance=t), LIMITS).duration_s for t in (0.0, tolerance))
    return stops - cut


def test_a_corner_uses_the_tolerance_on_both_sides():
    """With one side, equal moves at right angles overlap for (48 tolerance / (sqrt(2) jerk))^(1/3)."""
    for tolerance in (0.002, 0.02):
        one_side = np.cbrt(48.0 * tolerance / (np.sqrt(2.0) * 1e5))
        saved = longest([[0, 0, 0], [20, 0, 0], [20, 20, 0]], tolerance)
        # the path may be 1 + sqrt(2) times as far from the corner of its lines
        assert saved == pytest.approx(one_side * np.cbrt(1.0 + np.sqrt(2.0)), rel=0.02)


def test_moves_overlap_for_nearly_all_of_their_ramps():
    """At 100 mm/s a ramp takes 2 sqrt(100 / 1e5) s, a jerk phase half of it."""
    ramp = 2.0 * np.sqrt(100.0 / 1e5)
    saved = longest([[0, 0, 0], [50, 0, 0], [50, 50, 0]], 0.5)
    assert 0.9 * ramp < saved < ramp
    parts = check(route_of([[0, 0, 0], [50, 0, 0], [50, 50, 0]], tolerance=0.5))
    assert (parts.motion.path[parts.motion.shape, 2:].any(axis=(1, 2))).sum() >= 3


def test_no_motion():
    assert len(overlap(route_of(np.zeros((0, 3))), LIMITS)) == 0
    for count in (1, 3):
        motion = overlap(route_of([[1, 2, 3]] * count), LIMITS)
        assert motion.duration_s == 0.0
        assert motion.at(np.zeros(1))[0].tolist() == [[1.0, 2.0, 3.0]]


def test_one_stopped_waypoint_among_equals_stops():
    route = route_of([[0, 0, 0], [5, 0, 0], [5, 0, 0], [5, 5, 0]], tolerance=[0, 0.1, 0, 0])
    parts = check(route)
    whole = overlap(route_of([[0, 0, 0], [5, 0, 0], [5, 5, 0]], tolerance=0.0), LIMITS)
    assert parts.motion.duration_s == pytest.approx(whole.duration_s)


def test_blocks_make_no_difference(monkeypatch):
    whole = overlap(CASES["stair"], LIMITS)
    monkeypatch.setattr("olp.trajectory.overlap._BLOCK", 7)
    split = overlap(CASES["stair"], LIMITS)
    t = np.linspace(0.0, whole.duration_s, 1000)
    assert np.abs(whole.at(t)[0] - split.at(t)[0]).max() <= 1e-12


class Raises(ruckig_moves.ruckig.Ruckig):
    def calculate(self, *_):
        raise ruckig_moves.ruckig.RuckigError("no")


class LoopsBack(ruckig_moves.ruckig.Ruckig):
    def calculate(self, ask, result):
        ask.current_velocity = [-0.01]
        return super().calculate(ask, result)


@pytest.mark.parametrize("broken", [Raises, LoopsBack])
@pytest.mark.parametrize("name", ["stair", "spike", "tiny beside 10 m", "rapid into a slow feed"])
def test_a_broken_ruckig(monkeypatch, broken, name):
    good = overlap(CASES[name], LIMITS).duration_s
    monkeypatch.setattr(ruckig_moves.ruckig, "Ruckig", broken)
    replaced = []

    def solved(*args):
        moves = ruckig_moves.solve_all(*args)
        replaced.append(moves.replaced.any())
        return moves

    monkeypatch.setattr("olp.trajectory.overlap.solve_all", solved)
    parts = check(CASES[name])
    assert any(replaced)
    assert parts.motion.duration_s == pytest.approx(good, rel=1e-6)


def test_no_socket(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a socket was opened")

    monkeypatch.setattr(socket, "socket", refuse)
    check(CASES["stair"])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_points_that_are_no_numbers(value):
    with pytest.raises(UsageError, match="not finite"):
        overlap(route_of([[0, 0, 0], [1, value, 0]]), LIMITS)


def test_other_input_that_is_no_route():
    points = [[0, 0, 0], [1, 0, 0]]
    for feed in (0.0, -1.0, np.nan):
        with pytest.raises(UsageError, match="feed"):
            overlap(route_of(points, feed=feed), LIMITS)
    with pytest.raises(UsageError, match="tolerance"):
        overlap(route_of([*points, [2, 1, 0]], tolerance=np.nan), LIMITS)
    for bad in (0.0, np.nan, np.inf):
        with pytest.raises(UsageError, match="jerk"):
            limits = AxisLimits(LIMITS.velocity, LIMITS.acceleration, np.array([1.0, bad, 1.0]))
            overlap(route_of(points), limits)
