"""Laws of the closed-form speed profile: inside every limit, joined, never back, from rest to rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from cases.trajectory import CASES, LIMITS, critical, excess, random_route, route
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from olp.trajectory import ramps
from olp.trajectory.forecast import expected_s
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import SmoothPath, smooth


def laws_hold(given_route: Route, limits: AxisLimits, path: SmoothPath, motion: Motion) -> None:
    lasts = np.diff(motion.start_s)
    assert (lasts >= 0.0).all()
    assert excess(motion, limits, path.feed_mm_s[motion.shape]) <= 1.0 + 1e-6
    piece = np.arange(len(motion))
    start, end = motion.of(piece, np.zeros(len(motion))), motion.of(piece, lasts)
    # a time is known to its rounding, in which the axes move on
    late = 4 * 2.0**-52 * motion.duration_s
    bounds = (
        1e-9 + late * limits.velocity + 1e-15 * np.abs(given_route.point_mm).max(),
        1e-9 * limits.velocity + late * limits.acceleration,
        1e-9 * limits.acceleration + late * limits.jerk,
    )
    for before, after, bound in zip(end, start, bounds, strict=False):
        assert (np.abs(before[:-1] - after[1:]) <= bound).all()
    for values, bound in zip(start[1:3], bounds[1:], strict=True):
        assert (np.abs(values[0]) <= bound).all()
    for values, bound in zip(end[1:3], bounds[1:], strict=True):
        assert (np.abs(values[-1]) <= bound).all()
    assert np.abs(start[0][0] - given_route.point_mm[0]).max() <= bounds[0].max()
    assert np.abs(end[0][-1] - given_route.point_mm[-1]).max() <= bounds[0].max()
    # progress along the path: shapes in order, the parameter rising inside each
    assert (np.diff(motion.shape) >= 0).all()
    for share in np.linspace(0.0, 1.0, 9):
        u = share * lasts
        pace = motion.time[:, 1] + u * (2 * motion.time[:, 2] + 3 * u * motion.time[:, 3])
        assert pace.min() >= -1e-9


@pytest.mark.parametrize("name", sorted(CASES))
def test_adversarial_routes_are_driven_inside_the_limits(name: str) -> None:
    given_route, limits = CASES[name]()
    path = smooth(given_route, limits)
    laws_hold(given_route, limits, path, critical(path, limits))


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, 2**32 - 1))
def test_random_routes_are_driven_inside_the_limits(seed: int) -> None:
    given_route, limits = random_route(seed)
    path = smooth(given_route, limits)
    if len(path):
        laws_hold(given_route, limits, path, critical(path, limits))


def test_one_line_takes_the_least_time() -> None:
    """Rest to rest along x: jerk up, hold, down, cruise and the same back, worked by hand."""
    path = smooth(route(np.array([[0.0, 0, 0], [100.0, 0, 0]]), np.inf, 0.1), LIMITS)
    v, a, j = 500.0, 5e3, 1e5
    motion = critical(path, LIMITS)
    ramp = v / a + a / j
    if v * ramp <= 100.0:
        assert motion.duration_s == pytest.approx(2 * ramp + (100.0 - v * ramp) / v, rel=1e-12)
    assert len(motion) == 7


# at the feed, bends of these have hardly any acceleration left
@example(20457)
@example(22428)
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_lone_corners_take_what_is_forecast(seed: int) -> None:
    r = np.random.default_rng(seed)
    step = r.normal(size=(6, 3))
    step *= (r.uniform(20.0, 60.0, 6) / np.linalg.norm(step, axis=1))[:, None]
    given_route = route(np.cumsum(step, axis=0), 10.0 ** r.uniform(0.5, 2.5), 10.0 ** r.uniform(-3, -1))
    taken = critical(smooth(given_route, LIMITS), LIMITS).duration_s
    assert 0.93 * taken <= expected_s(given_route, LIMITS).sum() <= 1.01 * taken


def test_between_rests_the_profile_is_that_of_the_run_alone() -> None:
    given_route, limits = CASES["noise 0.2"]()
    given_route.tolerance_mm[[20, 21, 77]] = 0.0
    whole = critical(smooth(given_route, limits), limits)
    edges = [0, 20, 21, 77, len(given_route) - 1]
    alone = 0.0
    for a, b in pairwise(edges):
        run = Route(
            given_route.point_mm[a : b + 1], given_route.feed_mm_s[a:b], given_route.line[a:b],
            given_route.tolerance_mm[a : b + 1], given_route.dwell_s[a : b + 1],
        )  # fmt: skip
        alone += critical(smooth(run, limits), limits).duration_s
    assert whole.duration_s == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize("spans", [1, 3])
def test_a_motion_driven_in_blocks_is_the_same(spans: int, monkeypatch: pytest.MonkeyPatch) -> None:
    given_route, limits = CASES["noise 0.2"]()
    path = smooth(given_route, limits)
    whole = critical(path, limits)
    monkeypatch.setattr("olp.trajectory.critical._SPANS", spans)
    split = critical(path, limits)
    assert split.duration_s == pytest.approx(whole.duration_s, rel=1e-12)
    times = np.linspace(0.0, min(whole.duration_s, split.duration_s), 5000)
    for one, other, size in zip(whole.at(times), split.at(times), (1.0, 1e2, 1e4), strict=False):
        assert np.abs(one - other).max() <= 1e-10 * size


def test_nothing_to_drive_takes_no_time() -> None:
    motion = critical(smooth(route(np.zeros((3, 3)), 1.0, 0.1), LIMITS), LIMITS)
    assert motion.duration_s == 0.0
    assert len(Motion.joined([motion, motion])) == 0


_SPEED = st.one_of(st.just(0.0), st.floats(1e-3, 1e3))
_POSITIVE = st.floats(-6, 6).map(lambda e: 10.0**e)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(_SPEED, _POSITIVE, _POSITIVE, _POSITIVE)
def test_what_is_reached_is_reached_in_the_length(v0: float, length: float, a: float, j: float) -> None:
    args = [np.array([e]) for e in (v0, length, a, j)]
    v1 = ramps.reach(*args)
    assert v1 >= v0
    need = ramps.distance(args[0], v1, args[2], args[3])
    # a speed is known to 1e-16 of itself, and the change of speed in proportion less well
    known = 1e-9 + 1e-15 * v1 / np.maximum(v1 - v0, 1e-300)
    assert need <= length * (1.0 + known)
    if v1 > v0:
        assert need >= length * (1.0 - 1e-6 - known)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(_SPEED, _SPEED, st.floats(0.0, 8.0), _POSITIVE, _POSITIVE, st.floats(0.0, 1.0))
def test_ramps_fit_under_the_peak(
    v0: float, v1: float, more: float, a: float, j: float, share: float
) -> None:
    b, c, a_, j_ = (np.array([e]) for e in (v0, v1, a, j))
    length = np.maximum(ramps.distance(b, c, a_, j_), 1e-6) * (1.0 + more)
    top = np.array([max(v0, v1) * 3.0 + 1.0])
    p = ramps.peak(b, c, length, top, a_, j_)
    used = ramps.distance(b, p, a_, j_) + ramps.distance(c, p, a_, j_)
    assert p >= max(v0, v1)
    assert used <= length * (1.0 + 1e-9)
    higher = p * (1.0 + 1e-10)
    assert p == top or sum(ramps.distance(e, higher, a_, j_) for e in (b, c)) >= length * (1.0 - 1e-9)
    # the length after which a speed is reached, and the time
    speed = b + share * (p - b)
    place = ramps.passing(speed, b, p, a_, j_)
    assert -1e-12 * length <= place <= ramps.distance(b, p, a_, j_) * (1.0 + 1e-9)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(_SPEED, _POSITIVE, _POSITIVE, st.floats(0.0, 1.0))
def test_when_is_the_inverse_of_the_cubic(v: float, j: float, t: float, share: float) -> None:
    v_, j_, t_ = (np.array([e]) for e in (v, j, t))
    u = share * t_
    got = ramps.when(u * (v_ + j_ * u * u / 6.0), v_, np.zeros(1), j_, t_)
    assert got == pytest.approx(u, rel=1e-9, abs=1e-12 * t)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    st.floats(0.0, 1e3), st.floats(1e-9, 1e5), st.floats(1e-1, 1e5), st.floats(1e-1, 1e8)
)  # fmt: skip
def test_one_reach_is_that_of_arrays(v0: float, length: float, acceleration: float, jerk: float) -> None:
    arrays = ramps.reach(*(np.array([e]) for e in (v0, length, acceleration, jerk)))
    assert ramps.reach_one(v0, length, acceleration, jerk) == pytest.approx(float(arrays[0]), rel=1e-12)
