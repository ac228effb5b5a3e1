"""The audit against brute force, and the errors that it must detect."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest
from cases.trajectory import critical, far_from, path_deviation
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import UsageError
from olp.trajectory.audit import audit, slowing
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.extremes import largest, nodes
from olp.trajectory.motion import Motion
from olp.trajectory.overlap import overlap_parts
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import smooth

LIMITS = AxisLimits(np.array([50.0, 40.0, 30.0]), np.array([500.0, 300.0, 200.0]), np.array([5e3, 4e3, 3e3]))
number = st.floats(-10.0, 10.0)


def motion_of(time, path, seconds) -> Motion:
    count = len(seconds)
    return Motion(
        np.concatenate(([0.0], np.cumsum(seconds))), np.array(time, float), np.array(path, float),
        np.arange(count), np.arange(count),
    )  # fmt: skip


@st.composite
def motions(draw, composed):
    count = draw(st.integers(1, 4))
    time, path = [], []
    for _ in range(count):
        shape = np.array([[draw(number) for _ in range(3)] for _ in range(4)])
        drive = np.array([draw(number) for _ in range(4)])
        kind = "composed" if composed else draw(st.sampled_from(["straight", "steady"]))
        if kind == "straight":
            shape[2:] = 0.0
        if kind == "steady":
            drive[2:] = 0.0
        time.append(drive)
        path.append(shape)
    return motion_of(time, path, [draw(st.floats(0.01, 2.0)) for _ in range(count)])


def brute(motion: Motion, count: int):
    k = np.repeat(np.arange(len(motion)), count)
    u = np.tile(np.linspace(0.0, 1.0, count), len(motion)) * np.diff(motion.start_s)[k]
    derivatives = motion.of(k, u)[1:]
    return [np.abs(x).max(axis=0) for x in derivatives], np.sqrt((derivatives[0] ** 2).sum(axis=1)).max()


@pytest.mark.slow
@settings(deadline=None, max_examples=200)
@given(motions(composed=False))
def test_cubics_are_measured_exactly(motion):
    result = audit(motion, LIMITS, np.full(len(motion), 7.0))
    (velocity, acceleration, jerk), speed = brute(motion, 2001)
    for ratio, most, limit in (
        (result.velocity, velocity, LIMITS.velocity),
        (result.acceleration, acceleration, LIMITS.acceleration),
        (result.jerk, jerk, LIMITS.jerk),
    ):  # fmt: skip
        assert np.all(ratio * limit >= most * (1 - 1e-9) - 1e-9)
        assert np.all(ratio * limit <= most * (1 + 1e-3) + 1e-3)
    assert speed * (1 - 1e-6) - 1e-9 <= result.feed * 7.0 <= speed * (1 + 1e-3) + 1e-3


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(motions(composed=True), st.booleans())
def test_composed_pieces_are_bounded_and_what_is_too_large_is_measured(motion, high):
    if high:
        motion = replace(motion, time=np.pad(motion.time, ((0, 0), (0, 2)), constant_values=0.3))
    result = audit(motion, LIMITS, np.full(len(motion), 7.0))
    most, speed = brute(motion, 4001)
    limits = (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
    pairs = [
        (float(r), float(m / limit))
        for ratio, values, all_limits in zip(
            (result.velocity, result.acceleration, result.jerk), most, limits, strict=True
        )
        for r, m, limit in zip(ratio, values, all_limits, strict=True)
    ]
    for ratio, sampled in (*pairs, (result.feed, speed / 7.0)):
        assert ratio >= sampled * (1 - 1e-7) - 1e-100
        assert ratio <= max(sampled * (1 + 1e-4), 1.0 + 1e-9)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(st.integers(1, 14), st.integers(1, 3), st.integers(1, 20), st.integers(0, 10**6))
def test_the_largest_of_polynomials_is_found(degree, width, count, seed):
    controls = np.random.default_rng(seed).normal(size=(degree + 1, width, count))
    x = np.concatenate((nodes(degree), np.linspace(0.0, 1.0, 4001)))[:, None]
    i = np.arange(degree + 1)
    base = np.array([comb(degree, int(k)) for k in i]) * x**i * (1 - x) ** (degree - i)
    values = np.tensordot(base, controls, 1)
    most = np.sqrt((values**2).sum(axis=1)).max()
    assert largest(values[: degree + 1], 0.0) == pytest.approx(most, rel=1e-5)
    assert most * (1 - 1e-9) <= largest(values[: degree + 1], 2 * most) <= 2 * most
    values[0, 0, 0] = np.nan
    assert largest(values[: degree + 1], 0.0) == np.inf


@settings(deadline=None, max_examples=50)
@given(motions(composed=False))
def test_slowed_by_its_factor_a_motion_keeps_its_limits(motion):
    feeds = np.full(len(motion), 7.0)
    factor = slowing(audit(motion, LIMITS, feeds))
    assert factor >= 1.0
    assert slowing(audit(motion.slowed(factor), LIMITS, feeds)) <= 1.0 + 1e-9


def test_jumps_are_measured_also_between_blocks(monkeypatch):
    monkeypatch.setattr("olp.trajectory.pieces._BLOCK", 1)
    path = np.zeros((2, 4, 3))
    path[0, 1], path[1, 0], path[1, 1] = [1, 0, 0], [1.5, 0, 0], [3, 0, 0]
    time = [[0, 1, 0, 0], [0, 1, 2, 0]]
    result = audit(motion_of(time, path, [1.0, 1.0]), LIMITS)
    assert result.position_jump_mm == pytest.approx(0.5)
    assert result.velocity_jump_mm_s == pytest.approx(2.0)
    assert result.acceleration_jump_mm_s2 == pytest.approx(12.0)


def test_one_feed_for_each_piece():
    motion = Motion.rest(np.zeros(3), 1.0, 1)
    with pytest.raises(UsageError, match="feeds"):
        audit(motion, LIMITS, np.ones(2))
    with pytest.raises(UsageError, match="segments"):
        deviation_bound(motion, route_of(np.zeros((2, 3))), np.zeros(2, np.int64), np.zeros(2))
    assert audit(motion, LIMITS, np.ones(1)).feed == 0.0


def route_of(points) -> Route:
    points = np.asarray(points, float)
    n = len(points)
    near = np.full(n, 0.05)
    near[[0, -1]] = 0.0
    return Route(points, np.full(n - 1, 20.0), np.arange(n - 1), near, np.zeros(n))


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.integers(3, 120))
def test_a_search_finds_no_less_than_the_known_segments(seed, count):
    random = np.random.default_rng(seed)
    points = np.cumsum(random.normal(0.0, 1.0, (count, 3)) * random.choice([1.0, 0.02], (count, 1)), axis=0)
    route = route_of(points)
    parts = overlap_parts(route, LIMITS)
    near = np.full(len(parts.motion), 0.05 * (1 + 1e-6))
    assert np.all(deviation_bound(parts.motion, route, parts.segment, near) <= near)
    assert path_deviation(parts.motion, route).max() <= 0.05 * (1 + 1e-6)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.integers(3, 60))
def test_no_place_is_farther_than_the_bound(seed, count):
    random = np.random.default_rng(seed)
    points = np.cumsum(random.normal(0.0, 1.0, (count, 3)) * random.choice([1.0, 0.1], (count, 1)), axis=0)
    route = route_of(points)
    parts = overlap_parts(route, LIMITS)
    bent = critical(smooth(route, LIMITS), LIMITS)
    for motion, segment in ((parts.motion, parts.segment), (bent, bent.line)):
        near = random.choice([0.0, 0.02, 0.05], len(motion))
        bound = deviation_bound(motion, route, segment, near)
        piece = np.repeat(np.arange(len(motion)), 11)
        share = np.tile(np.linspace(0.0, 1.0, 11), len(motion))
        place = motion.of(piece, share * np.diff(motion.start_s)[piece])[0]
        away = far_from(points, place, segment[piece], around=2)
        assert np.all(away <= bound[piece] + 1e-12)
        # halves and eighths are compared with whole segments, so the bound is close
        assert np.all(bound <= 0.05 * (1 + 1e-6))


def test_motions_are_joined():
    one = motion_of([[0, 1, 0, 0]], np.ones((1, 4, 3)), [2.0])
    high = motion_of([[0, 1, 0, 0, 0.5, 0.25]], 2 * np.ones((1, 4, 3)), [1.0])
    whole = Motion.joined([one.shifted(3.0), high, one])
    assert whole.start_s.tolist() == [0.0, 2.0, 3.0, 5.0]
    for start, part in ((0.0, one), (2.0, high), (3.0, one)):
        for u in (0.25, 0.75):
            for a, b in zip(whole.at(np.array([start + u])), part.at(np.array([u])), strict=True):
                assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max()
    assert Motion.joined([one]) is one
    assert Motion.joined([one.shifted(1.0)]).start_s.tolist() == [0.0, 2.0]
    assert len(Motion.joined([])) == 0


def test_a_path_driven_back_and_forth():
    route = route_of([[0, 0, 0], [10, 0, 0], [0, 0, 0], [10, 0, 0], [10, 5, 0]] * 20)
    parts = overlap_parts(route, LIMITS)
    assert path_deviation(parts.motion, route).max() <= 0.05


def test_a_detour_is_measured():
    route = route_of([[0, 0, 0], [10, 0, 0], [10, 10, 0]])
    other = route_of([[0, 0, 0], [10, 0, 0], [12, 5, 0], [10, 10, 0]])
    parts = overlap_parts(other, LIMITS)
    near = np.zeros(len(parts.motion))
    assert deviation_bound(parts.motion, route, np.minimum(parts.segment, 1), near).max() > 1.9
    assert path_deviation(parts.motion, route, places=9).max() > 1.9


def test_one_waypoint():
    route = Route(np.ones((1, 3)), np.zeros(0), np.zeros(0, np.int64), np.zeros(1), np.ones(1))
    assert path_deviation(Motion.rest(np.array([1.0, 1.0, 3.0]), 1.0, 0), route).tolist() == [2.0]
