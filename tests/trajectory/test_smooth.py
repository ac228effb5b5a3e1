"""Laws of smooth paths: within tolerance, twice continuously differentiable, ends met."""

from __future__ import annotations

import numpy as np
import pytest
from cases.trajectory import CASES, LIMITS, far_from, random_route, route
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from olp.core.errors import CannotCompute
from olp.trajectory.kernels import deviations, least_over
from olp.trajectory.route import Route
from olp.trajectory.smooth import SmoothPath, needs_stop, smooth


def joins_hold(path: SmoothPath) -> None:
    h = np.diff(path.break_mm)[:, None]
    c0, c1, c2, c3 = (path.shape[:, i] for i in range(4))
    ends = (c0 + h * (c1 + h * (c2 + h * c3)), c1 + h * (2 * c2 + 3 * h * c3), 2 * c2 + 6 * h * c3)
    scale = (1.0 + np.abs(c0).max(), 1.0, 1.0 + np.abs(c2).max())
    for end, start, size in zip(ends, (c0, c1, 2 * c2), scale, strict=True):
        if len(path) > 1:
            assert np.abs(end[:-1] - start[1:]).max() <= 1e-9 * size


def laws_hold(given_route: Route, path: SmoothPath) -> None:
    joins_hold(path)
    point = given_route.point_mm
    assert (np.diff(path.break_mm) > 0.0).all()
    assert np.abs(path.shape[0, 0] - point[0]).max() <= 1e-12 * (1 + np.abs(point).max())
    end = path.at(path.break_mm[-1:])
    assert np.abs(end[0] - point[-1]).max() <= 1e-12 * (1 + np.abs(point).max())
    assert np.abs(path.shape[0, 2:]).max() == 0.0 == np.abs(path.shape[-1, 2:]).max()
    # no point farther from the polyline than the tolerance of the waypoints around it
    arc_mm = (path.break_mm[:-1, None] + np.linspace(0.0, 1.0, 5) * np.diff(path.break_mm)[:, None]).ravel()
    inner = given_route.tolerance_mm[1:-1]
    if inner.size:
        q = path.at(arc_mm)[0]
        source = np.repeat(path.source, 5)
        assert (far_from(point, q, source) <= inner.max() * (1.0 + 1e-9) + 1e-9).all()
    else:
        assert far_from(point, path.at(arc_mm)[0], np.repeat(path.source, 5)).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(CASES))
def test_adversarial_routes_are_smoothed_within_tolerance(name: str) -> None:
    given_route, limits = CASES[name]()
    laws_hold(given_route, smooth(given_route, limits))


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, 2**32 - 1))
def test_random_routes_are_smoothed_within_tolerance(seed: int) -> None:
    given_route, limits = random_route(seed)
    path = smooth(given_route, limits)
    if len(path):
        laws_hold(given_route, path)
    else:
        assert (given_route.point_mm[0] == given_route.point_mm[-1]).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_summed_kernels_are_the_kernels_summed(seed: int, count: int) -> None:
    r = np.random.default_rng(seed)
    centre = np.cumsum(r.integers(1, 1 << 12, count)) * 2.0**-10
    width = np.maximum(np.round(np.exp(r.uniform(-6, 3, count)) * 1024), 1) * 2.0**-10
    bend = r.normal(size=(count, 3))
    x = np.unique(np.concatenate((centre, centre - width, centre + width)))
    a, m, b = (np.searchsorted(x, e) for e in (centre - width, centre, centre + width))
    taylor = deviations(x, centre, width, bend, a, m, b)
    t = 0.37 * np.diff(x)
    arc_mm = x[:-1] + t
    inside = 1.0 - np.abs((arc_mm[:, None] - centre) / width)
    want = (np.maximum(inside, 0.0) ** 3 / 6.0 * width) @ bend
    f, f1, f2, f3 = (taylor[:, i] for i in range(4))
    t = t[:, None]
    got = f + t * (f1 + t * (f2 / 2.0 + t * f3 / 6.0))
    assert np.abs(got - want).max() <= 1e-13 * (width * np.abs(bend).max(axis=1)).sum()


def test_least_over_ranges() -> None:
    r = np.random.default_rng(5)
    value = r.normal(size=100)
    begin = r.integers(0, 100, 300)
    end = np.minimum(begin + r.integers(0, 100, 300), 100)
    want = [value[a:b].min() if b > a else np.inf for a, b in zip(begin, end, strict=True)]
    assert (least_over(value, begin, end) == want).all()


@pytest.mark.slow
def test_many_points_keep_their_digits() -> None:
    n = 200_001
    angle = np.linspace(0.0, 400.0, n)
    point = np.stack((500 * np.cos(angle), 500 * np.sin(angle), 0.01 * angle), axis=1)
    given_route = route(point, 100.0, 0.01)
    path = smooth(given_route, LIMITS)
    joins_hold(path)
    last = path.at(path.break_mm[-1:])[0]
    assert np.abs(last - point[-1]).max() < 1e-9


def test_reversals_need_a_stop() -> None:
    point = np.array([[0, 0, 0], [10, 0, 0], [10, 0, 0], [4, 0, 0], [4, 3, 0], [4, 1, 1e-7]], float)
    assert needs_stop(point).tolist() == [False, True, False, False, True, False]
    assert not needs_stop(point[:1]).any()
    assert not needs_stop(np.repeat(point[:1], 5, axis=0)).any()


def test_rests_are_met_exactly_and_straight() -> None:
    given_route, limits = CASES["noise 0.2"]()
    stops = np.array([20, 21, 77])
    given_route.tolerance_mm[stops] = 0.0
    path = smooth(given_route, limits)
    joins = path.break_mm[path.rest]
    q = path.at(joins)
    assert np.abs(q[0] - given_route.point_mm[stops]).max() <= 1e-12
    assert path.rest.size == 3
    for k in (path.rest, path.rest - 1):
        assert np.abs(path.shape[k, 2:]).max() == 0.0
    # between rests the path is that of the run alone
    edges = [0, *stops.tolist(), len(given_route) - 1]
    for a, b, k, end in zip(edges[:-1], edges[1:], [0, *path.rest], [*path.rest, len(path)], strict=True):
        alone = smooth(
            Route(
                given_route.point_mm[a : b + 1], given_route.feed_mm_s[a:b], given_route.line[a:b],
                given_route.tolerance_mm[a : b + 1], given_route.dwell_s[a : b + 1],
            ),
            limits,
        )  # fmt: skip
        arc_mm = np.linspace(0.0, 1.0, 300) * min(alone.break_mm[-1], path.break_mm[end] - path.break_mm[k])
        assert np.abs(path.at(path.break_mm[k] + arc_mm)[0] - alone.at(arc_mm)[0]).max() <= 1e-9


def test_nothing_to_drive() -> None:
    assert len(smooth(route(np.zeros((1, 3)), 1.0, 0.1), LIMITS)) == 0
    assert len(smooth(route(np.zeros((4, 3)), 1.0, 0.1), LIMITS)) == 0


def test_feeds_and_lines_are_kept() -> None:
    point = np.array([[0, 0, 0], [10, 0, 0], [20, 5, 0], [30, 5, 0]], float)
    path = smooth(route(point, np.array([10.0, np.inf, 20.0]), 0.1), LIMITS)
    assert set(path.feed_mm_s[path.source == 1]) == {np.inf}
    assert (path.line == path.source).all()
    assert sorted(set(path.source.tolist())) == [0, 1, 2]


@pytest.mark.parametrize("broken", ["point", "tolerance", "feed"])
def test_bad_routes_are_refused(broken: str) -> None:
    good = route(np.arange(12.0).reshape(4, 3) ** 2, 10.0, 0.1)
    if broken == "point":
        good.point_mm[1, 1] = np.nan
    elif broken == "tolerance":
        good.tolerance_mm[1] = -0.1
    else:
        good.feed_mm_s[1] = 0.0
    with pytest.raises(CannotCompute):
        smooth(good, LIMITS)


def test_chords_of_a_circle_bend_as_evenly_as_the_circle() -> None:
    """Kernels that ended between waypoints left teeth of 3.6 times the third derivative of the circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    chords = 12.0 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    path = smooth(route(chords, 200.0, 0.005), LIMITS)
    _, _, second, third = path.at(np.linspace(10.0, 65.0, 2000))
    assert np.abs(np.linalg.norm(second, axis=1) * 12.0 - 1.0).max() < 0.01
    assert np.abs(np.linalg.norm(third, axis=1) * 144.0 - 1.0).max() < 0.01
