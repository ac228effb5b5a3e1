"""Optimised speeds: their optimum by another solver and by Ruckig, their laws, and what they never do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from cases.trajectory import CASES, LIMITS, random_route, route
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from ruckig import InputParameter, Result, Ruckig, Trajectory
from scipy.optimize import minimize

from olp.trajectory import optimise
from olp.trajectory.audit import audit, slowing
from olp.trajectory.critical import Timeline, best_profile, seconds
from olp.trajectory.interior import Rows, Spline, fits, least_time
from olp.trajectory.motion import Motion, derivatives
from olp.trajectory.optimise import optimised
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import SmoothPath, smooth
from olp.trajectory.solvers import OPTIMISED
from olp.trajectory.speedgrid import bound_s, grid, speed_caps

_SLOW_CHECK = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)


def wave(count: int = 120, size: float = 20.0, feed: float = 200.0, tolerance: float = 0.02) -> Route:
    t = np.linspace(0.0, 1.0, count)
    return route(size * np.column_stack((3 * t, np.sin(9 * t), 0.3 * np.cos(5 * t))), feed, tolerance)


def optimised_along(given_route: Route, limits: AxisLimits = LIMITS) -> tuple[SmoothPath, Motion]:
    path = smooth(given_route, limits)
    return path, optimised(path, limits, best_profile(path, limits))


def lasts(given_route: Route, limits: AxisLimits = LIMITS) -> float:
    """Time of the motion after it has been slowed to what its audit allows."""
    path, motion = optimised_along(given_route, limits)
    return motion.duration_s * slowing(audit(motion, limits, path.feed_mm_s[motion.shape]))


def a_window(seed: int, cells: int = 14) -> tuple[Rows, Spline, np.ndarray]:
    """Rows of a curve with random derivatives, between fixed speeds, and a start inside them."""
    r = np.random.default_rng(seed)
    knot = np.concatenate(([0.0], np.cumsum(r.uniform(0.2, 0.6, cells))))
    cell = np.repeat(np.arange(cells), 3)
    place = (knot[:-1, None] + np.diff(knot)[:, None] * np.array([0.0, 0.5, 1.0])).ravel()
    angle = np.cumsum(r.normal(0.0, 0.15, len(place)))
    q1 = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    q2 = r.normal(0.0, 0.05, (len(place), 3)) * [1, 1, 0]
    q3 = r.normal(0.0, 0.05, (len(place), 3)) * [1, 1, 0]
    spline = Spline(knot)
    rows = Rows.of(knot, cell, place, (q1, q2, q3), np.full(len(place), 150.0), LIMITS, np.ones(len(place)))
    start = np.full(cells + 2, 20.0**2)
    assert fits(rows, spline, start)
    return rows, spline, start


@pytest.mark.parametrize("seed", range(6))
def test_optimum_is_that_of_another_solver(seed: int) -> None:
    rows, spline, start = a_window(seed)
    ours = least_time(rows, spline, start)
    assert fits(rows, spline, ours)

    def whole(free: np.ndarray) -> np.ndarray:
        return np.concatenate((start[:2], free * 1e3, start[-2:]))

    def time(free: np.ndarray) -> float:
        return float(spline.seconds(spline.cells(whole(free))).sum())

    def slack(free: np.ndarray) -> np.ndarray:
        b, a, j = rows.spread(spline.cells(whole(free)))
        u = j * np.sqrt(np.maximum(b, 0.0))
        return np.concatenate((1 - b / rows.most, *(1 - a), *(1 + a), *(1 - u), *(1 + u)))

    theirs = minimize(
        time, start[2:-2] / 1e3, method="SLSQP", constraints={"type": "ineq", "fun": slack},
        bounds=[(1e-3, None)] * (len(start) - 4), options={"maxiter": 500, "ftol": 1e-10},
    )  # fmt: skip
    assert theirs.success
    assert time(ours[2:-2] / 1e3) == pytest.approx(theirs.fun, rel=1e-3)


@pytest.mark.parametrize("length", [30.0, 120.0, 700.0, 4000.0])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (2.0, -1.0, 0.5)])
def test_a_straight_path_takes_as_long_as_ruckig_takes(length: float, direction: tuple[float, ...]) -> None:
    u = np.array(direction) / np.linalg.norm(direction)
    points = np.linspace(0.0, length, 9)[:, None] * u
    most = [float((limit / np.maximum(np.abs(u), 1e-12)).min()) for limit in
            (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)]  # fmt: skip
    given_input, trajectory = InputParameter(1), Trajectory(1)
    given_input.target_position = [length]
    given_input.max_velocity, given_input.max_acceleration, given_input.max_jerk = ([m] for m in most)
    assert Ruckig(1).calculate(given_input, trajectory) == Result.Working
    least = trajectory.duration
    # launch and landing cost some milliseconds, whatever the length
    assert least * (1.0 - 1e-9) <= lasts(route(points, 1e4, 0.01)) < least * 1.003 + 0.012


def test_a_reversed_path_takes_as_long() -> None:
    forth = wave()
    back = replace(forth, point_mm=forth.point_mm[::-1].copy())
    assert lasts(back) == pytest.approx(lasts(forth), rel=5e-3)


@pytest.mark.parametrize("scale", [0.1, 3.0])
def test_a_larger_path_with_larger_limits_takes_as_long(scale: float) -> None:
    small = wave()
    large = replace(
        small, point_mm=small.point_mm * scale, feed_mm_s=small.feed_mm_s * scale,
        tolerance_mm=small.tolerance_mm * scale,
    )  # fmt: skip
    limits = AxisLimits(LIMITS.velocity * scale, LIMITS.acceleration * scale, LIMITS.jerk * scale)
    assert lasts(large, limits) == pytest.approx(lasts(small), rel=2e-3)


@pytest.mark.slow
def test_more_waypoints_of_the_same_curve_do_not_slow_it() -> None:
    assert lasts(wave(2000)) < 1.02 * lasts(wave(500))


def laws_hold(given_route: Route, limits: AxisLimits) -> None:
    path = smooth(given_route, limits)
    profile = best_profile(path, limits)
    motion = optimised(path, limits, profile)
    assert np.isfinite(motion.time).all()
    span = np.diff(motion.start_s)
    assert (span >= 0.0).all()
    result = audit(motion, limits, path.feed_mm_s[motion.shape])
    assert slowing(result) < 1.02
    assert motion.duration_s * slowing(result) < 1.25 * seconds(path, profile)
    assert motion.duration_s > 0.97 * bound_s(path, limits)
    # joined, from rest to rest, and never back
    late = 8 * 2.0**-52 * motion.duration_s
    far = float(np.abs(given_route.point_mm).max())
    assert result.position_jump_mm <= 1e-9 + late * limits.velocity.max() + 1e-15 * far
    assert result.velocity_jump_mm_s <= 1e-8 * limits.velocity.max() + late * limits.acceleration.max()
    assert result.acceleration_jump_mm_s2 <= 1e-7 * limits.acceleration.max() + late * limits.jerk.max()
    ends = motion.of(np.array([0, len(motion) - 1]), np.array([0.0, span[-1]]))
    assert np.abs(ends[0] - given_route.point_mm[[0, -1]]).max() <= 1e-9 + 1e-12 * path.break_mm[-1]
    assert np.abs(ends[1]).max() <= 1e-7 * limits.velocity.max()
    assert np.abs(ends[2]).max() <= 1e-6 * limits.acceleration.max()
    for share in np.linspace(0.0, 1.0, 7):
        pace = derivatives(motion.time, share * span)[1]
        assert pace.min() >= -1e-9 * limits.velocity.max()


@pytest.mark.slow
@_SLOW_CHECK
@given(st.integers(0, 2**32 - 1))
@example(16)
@example(50)
@example(54)
@example(12437837)
def test_random_routes_keep_the_laws(seed: int) -> None:
    given_route, limits = random_route(seed)
    path = smooth(given_route, limits)
    assume(len(path) and seconds(path, best_profile(path, limits)) < 100.0)
    laws_hold(given_route, limits)


_LONG = ("feed changes in a curve",)


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(sorted(CASES), _LONG))
def test_adversarial_routes_keep_the_laws(name: str) -> None:
    laws_hold(*CASES[name]())


#: a small router, and a stroke whose backlash is taken up along a ramp
_ROUTER = AxisLimits(np.array([33.0, 33, 12]), np.array([150.0, 150, 80]), np.array([5e3, 5e3, 3e3]))
_RAPID = np.inf


@pytest.mark.parametrize("step_mm", (0.02, 0.03))
def test_a_short_first_move_of_a_long_path_launches_within_bounds(step_mm: float) -> None:
    """Its launch is long, as a short one would have few digits: cells grow behind it all the same."""
    points = [[0, -step_mm, 0], [0, 0, 0], [0, -0.025, -0.3], [0, -0.028, -3.9], [150, -0.028, -3.9]]
    path = smooth(route(np.array(points), np.array([_RAPID, 1.5, 1.5, _RAPID]), 0.01), _ROUTER)
    profile, cap = best_profile(path, _ROUTER), speed_caps(path, _ROUTER)
    clock = Timeline.of(path.break_mm, profile)
    knots = grid(path, _ROUTER, profile, cap, clock)
    window = optimise._Window.of(path, _ROUTER, profile, clock, cap, knots, 0, len(profile.node) - 1)
    assert fits(window.rows.rows(), window.spline, optimise._SLOWED**2 * window.start)


def test_hardly_any_limit_of_jerk_leaves_digits_to_launch_and_land() -> None:
    """The arc length there was rounded to nothing: far from its begin the jerk was 5.5 times its limit."""
    limits = AxisLimits(np.full(3, 500.0), np.full(3, 2e3), np.full(3, 1e9))
    steps = np.random.default_rng(0).normal(size=(12, 3)) * 0.08
    steps[-1] = [150.0, 0.4, 0.0]
    both = []
    for some in (steps, steps[::-1]):
        points = np.concatenate((np.zeros((1, 3)), np.cumsum(some, axis=0)))
        both.append(lasts(route(points, 100.0, 0.005), limits))
    assert both[0] == pytest.approx(both[1], rel=5e-3) and max(both) < 1.7


@pytest.mark.slow
def test_a_ramp_beside_a_turn_back_costs_no_stop() -> None:
    """The critical points stand still at such a turn, so their time says nothing of what optimising gains."""
    there = [[0, 0, 0], [0, -0.025, -0.3], [0, -0.028, -2], [0, -0.003, -1.7], [0, 0, 0], [3, 0, 0]]
    ramps = plan(route(np.array(there), np.array([1.5] * 4 + [_RAPID]), 0.01), _ROUTER, tubes=False)
    straight = route(
        np.array([[0, 0, 0], [0, 0, -2], [0, 0, 0], [3, 0, 0]]), np.array([1.5, 1.5, _RAPID]), 0.01
    )
    assert [leg.solver for leg in ramps.legs] == [OPTIMISED]
    assert ramps.duration_s < plan(straight, _ROUTER, tubes=False).duration_s
