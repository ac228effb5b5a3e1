"""The judge of motions sees what it is there to see: sound motions pass, and each kind of damage is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from cases.trajectory import LIMITS, route
from hypothesis import given, settings
from hypothesis import strategies as st
from judge.polynomials import Pieces
from judge.retiming import judge

from olp.trajectory.motion import Motion
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route

number = st.floats(-3.0, 3.0)


def walk() -> Route:
    """Corners, stops and dwells, long ways between them."""
    points = np.array([[0, 0, 0], [30, 0, 0], [30, 20, 0], [60, 20, 5], [60, 60, 5], [0, 60, 0], [0, 9, 0.0]])
    base = route(points, 100.0, 0.02)
    base.tolerance_mm[[3, 4]] = 0.0
    base.dwell_s[4] = 0.5
    return base


WALK = walk()
MOTION = plan(WALK, LIMITS).motion


def of_other(**changes: np.ndarray) -> Motion:
    """The motion planned for a route that differs."""
    return plan(replace(WALK, **changes), LIMITS).motion


def moved(k: int, by: tuple[float, float, float]) -> np.ndarray:
    points = WALK.point_mm.copy()
    points[k] += by
    return points


def changed(name: str, k: int, value: float) -> np.ndarray:
    values = getattr(WALK, name).copy()
    values[k] = value
    return values


def doubled_back() -> Motion:
    """A step back of 1 mm on the third segment, and forth again."""
    points = np.insert(WALK.point_mm, 3, [[50, 20, 10 / 3], [49, 20, 19 / 6]], axis=0)
    back = route(points, 100.0, 0.02)
    back.tolerance_mm[[3, 4, 5]] = 0.0
    back.dwell_s[6] = 0.5
    motion = plan(back, LIMITS).motion
    return replace(motion, line=np.array([0, 1, 2, 2, 2, 3, 4, 5])[motion.line])


def with_path(k: int, power: int, by: float) -> Motion:
    path = MOTION.path.copy()
    path[MOTION.shape[k], power] += by
    return replace(MOTION, path=path)


DAMAGE: dict[str, tuple[Callable[[], Motion], str]] = {
    "too fast": (lambda: MOTION.slowed(1 / 1.000002), "jerk is 1.00000"),
    "a place off by 2 nm": (lambda: with_path(20, 0, 2e-9), "position jumps"),
    "a direction off": (lambda: with_path(20, 1, 1e-6), "position jumps"),
    "a corner missed": (lambda: of_other(point_mm=moved(2, (0.0, 0.1, 0.0))), "waypoint 3"),
    "a corner cut too far": (lambda: of_other(tolerance_mm=WALK.tolerance_mm * 1.7), "waypoint"),
    "a waypoint left out": (
        lambda: (
            plan(Route(*(np.delete(getattr(WALK, n), 2, axis=0) for n in Route.__slots__)), LIMITS).motion
        ),
        "waypoint 2",
    ),
    "another end": (lambda: of_other(point_mm=moved(6, (0.0, 1.0, 0.0))), "waypoint 6"),
    "another start": (lambda: of_other(point_mm=moved(0, (1.0, 0.0, 0.0))), "begin"),
    "an end of its own": (
        lambda: plan(route(np.vstack((WALK.point_mm, [0, 5, 0])), 100.0, 0.0), LIMITS).motion,
        "end at its route",
    ),
    "a step back": (doubled_back, "runs back"),
    "a stop not made": (lambda: of_other(tolerance_mm=changed("tolerance_mm", 3, 0.02)), "waypoint 3"),
    "no dwell": (lambda: of_other(dwell_s=np.zeros(7)), "waits"),
    "a dwell too short": (lambda: of_other(dwell_s=changed("dwell_s", 4, 0.499999)), "waits"),
    "a dwell elsewhere": (lambda: of_other(dwell_s=np.array([0, 0, 0, 0.5, 0, 0, 0])), "waits"),
    "a feed too high": (lambda: of_other(feed_mm_s=changed("feed_mm_s", 1, 101.0)), "feed is 1.0"),
    "a line too early": (lambda: replace(MOTION, line=MOTION.line + 1), "line"),
    "not a number": (lambda: with_path(3, 2, np.nan), "not finite"),
}


def test_a_sound_motion_passes() -> None:
    judged = judge(MOTION, WALK, LIMITS)
    assert judged.wrong == ()
    assert judged.jerk == pytest.approx(1.0, rel=1e-6)
    assert judged.feed == pytest.approx(1.0, rel=1e-6)
    assert 0.5 < judged.tolerance <= 1.0


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_seen(name: str) -> None:
    make, word = DAMAGE[name]
    assert word in "; ".join(judge(make(), WALK, LIMITS).wrong)


@pytest.mark.parametrize("what", AxisLimits.__slots__)
def test_each_limit_is_looked_at(what: str) -> None:
    verdict = judge(MOTION, WALK, LIMITS)
    used = getattr(verdict, what)
    for factor, fine in ((used * (1 + 1e-7), True), (used * (1 - 1e-5), False)):
        limits = replace(LIMITS, **{what: getattr(LIMITS, what) * factor})
        assert any(what in text for text in judge(MOTION, WALK, limits).wrong) != fine


def test_differences_of_positions_see_a_joint_that_jumps() -> None:
    """0.1 mm/s more at once is 0.02 of the jerk limit over a cycle of 1 ms too much."""
    start = int(np.argmax(np.abs(MOTION.time[:, 1])))
    time = MOTION.time.copy()
    time[start:, 1] += 0.1
    assert judge(replace(MOTION, time=time), WALK, LIMITS).differences > 1.0


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(st.integers(1, 3), st.lists(st.tuples(*[number] * 9), min_size=1, max_size=4))
def test_bounds_are_those_of_brute_force(order: int, rows: list[tuple[float, ...]]) -> None:
    values = np.array(rows)
    count = len(values)
    path = np.zeros((count, 4, 3))
    path[:, :, 0], path[:, :, 1] = values[:, :4], values[:, 4:8]
    time = np.column_stack((values[:, 8], values[:, :3]))
    lasts = 0.2 + np.abs(values[:, 3])
    motion = Motion(np.concatenate(([0.0], np.cumsum(lasts))), time, path, np.arange(count), np.arange(count))
    pieces = Pieces.of(motion)
    rows_of = np.repeat(np.arange(count), 4001)
    u = np.concatenate([np.linspace(0.0, t, 4001) for t in lasts])
    states = motion.of(rows_of, u)
    ours = [pieces.at(rows_of, u, k) for k in range(4)]
    for theirs, own in zip(states, ours, strict=True):
        np.testing.assert_allclose(own, theirs, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(theirs).max()))
    most = np.abs(ours[order].reshape(count, 4001, 3)).max(axis=1)
    limit = np.maximum(most.max(axis=0) / 2, 1e-3)
    bound = pieces.largest(order, limit) * limit
    assert (bound >= most * (1 - 1e-9)).all()
    above = most > limit
    assert (bound[above] <= most[above] * (1 + 1e-4)).all()
    speed = np.sqrt((ours[1] ** 2).sum(axis=1)).reshape(count, 4001).max(axis=1)
    feed = np.maximum(speed / 2, 1e-3)
    fastest = pieces.fastest(feed) * feed
    assert (fastest >= speed * (1 - 1e-9)).all()
    assert (fastest[speed > feed] <= speed[speed > feed] * (1 + 1e-4)).all()
