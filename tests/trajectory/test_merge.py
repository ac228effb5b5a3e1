"""Clusters of waypoints in one place: a jog inside the path tolerance costs next to no time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cases.trajectory import route
from hypothesis import given
from hypothesis import strategies as st
from judge.retiming import judge
from trajectory.test_plan import LIMITS, assert_within

from olp.trajectory.merge import merged
from olp.trajectory.plan import plan


def jogs(size_mm: float, count: int = 10) -> np.ndarray:
    """Moves of 10 mm along X with steps in Y between, to one side and back in turn."""
    y = size_mm * (np.arange(count) % 2)
    x = 10.0 * np.arange(count + 1)
    return np.stack((np.repeat(x, 2)[1:-1], np.repeat(y, 2), np.zeros(2 * count)), axis=1)


def circle(jog_mm: float, radius_mm: float = 50.0, way: int = 1) -> np.ndarray:
    """A circle whose halves and quarters are displaced, as a correction for backlash does."""
    angle = way * np.linspace(0.0, 2.0 * np.pi, 401)
    point = radius_mm * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    parts = []
    for k, (x, y) in enumerate(((0, 0), (0, 1), (1, 1), (1, 0))):
        parts.append(point[100 * k : 100 * k + 101] + jog_mm * np.array([x, y, 0.0]))
    return np.concatenate(parts)


@pytest.mark.parametrize("size_mm", (0.001, 0.005, 0.009))
def test_jogs_inside_the_tolerance_cost_a_thousandth(size_mm: float) -> None:
    straight = plan(route(jogs(0.0), 100.0, 0.01), LIMITS).duration_s
    jogged = plan(route(jogs(size_mm), 100.0, 0.01), LIMITS)
    assert jogged.duration_s <= 1.001 * straight
    assert_within(jogged, LIMITS, 100.0)


@pytest.mark.parametrize("tolerance_mm", (0.005, 0.01))
def test_a_circle_with_5_um_of_backlash_is_at_most_a_five_hundredth_slower(tolerance_mm: float) -> None:
    whole = plan(route(circle(0.0), 100.0, tolerance_mm), LIMITS).duration_s
    assert plan(route(circle(0.005), 100.0, tolerance_mm), LIMITS).duration_s <= 1.002 * whole


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius_mm", "feed", "tolerance_mm", "way"),
    [(3.0, 20.0, 0.01, -1), (12.0, 100.0, 0.005, 1), (12.0, 200.0, 0.005, -1), (50.0, 200.0, 0.005, 1)],
)
def test_so_are_other_circles_both_ways(radius_mm: float, feed: float, tolerance_mm: float, way: int) -> None:
    whole, jogged = (
        plan(route(circle(jog, radius_mm, way), feed, tolerance_mm), LIMITS).duration_s
        for jog in (0.0, 0.005)
    )
    assert jogged <= 1.002 * whole


@pytest.mark.slow
@pytest.mark.parametrize(("radius_mm", "feed"), some_of_a_campaign([(3.0, 100.0), (12.0, 200.0)], 2))
def test_circles_that_limits_slow_down_take_little_longer(radius_mm: float, feed: float) -> None:
    """They were 14 to 40 % slower: the acceleration leaves no room for a step beside the circle."""
    whole, jogged = (plan(route(circle(j, radius_mm), feed, 0.01), LIMITS).duration_s for j in (0.0, 0.005))
    assert jogged <= 1.004 * whole


def test_the_line_behind_a_jog_is_not_told_before_the_jog() -> None:
    points = np.array([[0, 0, 0], [20, 0, 0], [20, 0, 0.003], [20, 20, 0.003], [20, 20, 0], [40.0, 20, 0]])
    own = route(points, 20.0, 0.01)
    own = replace(own, line=np.arange(1, 6))
    trajectory = plan(own, LIMITS, tubes=False)
    assert {leg.solver for leg in trajectory.legs} == {"overlapped moves"}
    assert set(trajectory.motion.line.tolist()) == {1, 3, 5}
    assert judge(trajectory.motion, own, LIMITS).wrong == ()


def test_a_cluster_at_a_rest_moves_there_and_a_rest_moves_nowhere() -> None:
    own = route(np.array([[0, 0, 0], [0.004, 0, 0], [9, 0, 0], [9, 0.004, 0], [9.0, 9, 0]]), 100.0, 0.01)
    own.tolerance_mm[3] = 0.0
    other = merged(own)
    assert other is not None
    np.testing.assert_array_equal(other.point_mm, own.point_mm[[0, 3, 4]])
    np.testing.assert_array_equal(other.tolerance_mm, 0.0)
    np.testing.assert_array_equal(other.line, own.line[[1, 3]])


@pytest.mark.parametrize(
    ("before", "jog", "behind", "place"),
    [
        (50.0, 50.0, 50.0, 0.5), (50.0, 90.0, 50.0, 0.5), (90.0, 50.0, 50.0, 0.0), (50.0, 50.0, 90.0, 1.0),
        (np.inf, np.inf, 50.0, 0.5), (90.0, 50.0, 90.0, None), (51.0, 50.0, np.inf, None),
    ],
)  # fmt: skip
def test_no_step_is_passed_at_more_than_its_feed(
    before: float, jog: float, behind: float, place: float | None
) -> None:
    own = route(np.array([[0, 0, 0], [9, 0, 0], [9, 0.004, 0], [18.0, 0.004, 0]]), 50.0, 0.01)
    own = replace(own, feed_mm_s=np.array([before, jog, behind]))
    other = merged(own)
    assert (other is None) == (place is None)
    if other is not None and place is not None:
        np.testing.assert_allclose(other.point_mm[1], [9.0, 0.004 * place, 0.0])
        np.testing.assert_array_equal(other.feed_mm_s, [before, behind])
        np.testing.assert_array_equal(other.line, own.line[[0, 2]])


@given(
    steps=st.lists(st.tuples(*[st.floats(-0.02, 0.02)] * 3), min_size=1, max_size=30),
    tolerance=st.floats(0.001, 0.03),
    rests=st.sets(st.integers(0, 30)),
    feeds=st.lists(st.sampled_from((5.0, 50.0)), min_size=1, max_size=5),
)
def test_what_is_moved_is_taken_from_the_tolerance(
    steps: list[tuple[float, float, float]], tolerance: float, rests: set[int], feeds: list[float]
) -> None:
    own = route(np.cumsum([(0.0, 0.0, 0.0), *steps], axis=0), 100.0, tolerance)
    own = replace(own, line=np.arange(len(steps)), feed_mm_s=np.resize(feeds, len(steps)))
    own.tolerance_mm[[k for k in rests if k < len(own)]] = 0.0
    other = merged(own)
    if other is None:
        return
    # waypoint k became the one before the next step that stays
    became = np.searchsorted(other.line, np.arange(len(own)))
    away = np.linalg.norm(other.point_mm[became] - own.point_mm, axis=1)
    np.testing.assert_array_equal(away[own.tolerance_mm == 0.0], 0.0)
    assert (away <= 0.6 * own.tolerance_mm + 1e-12).all()
    assert (other.tolerance_mm[became] <= own.tolerance_mm - away + 1e-15).all()
    np.testing.assert_array_equal(other.feed_mm_s, own.feed_mm_s[other.line])
