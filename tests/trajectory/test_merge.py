"""Clusters of waypoints in one place: a jog inside the path tolerance costs next to no time."""

from __future__ import annotations

import numpy as np
import pytest
from cases.trajectory import route
from hypothesis import given
from hypothesis import strategies as st
from trajectory.test_plan import LIMITS, assert_within

from olp.trajectory.merge import merged
from olp.trajectory.plan import plan


def jogs(size_mm: float) -> np.ndarray:
    """100 mm along X with a step in Y every 10 mm, to one side and back in turn."""
    y = size_mm * (np.arange(10) % 2)
    x = 10.0 * np.arange(11)
    return np.stack((np.repeat(x, 2)[1:-1], np.repeat(y, 2), np.zeros(20)), axis=1)


def circle(jog_mm: float) -> np.ndarray:
    """A circle whose halves and quarters are displaced, as a correction for backlash does."""
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    point = 50.0 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
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


def test_a_cluster_at_a_rest_moves_there_and_a_rest_moves_nowhere() -> None:
    own = route(np.array([[0, 0, 0], [0.004, 0, 0], [9, 0, 0], [9, 0.004, 0], [9.0, 9, 0]]), 100.0, 0.01)
    own.tolerance_mm[3] = 0.0
    other = merged(own)
    assert other is not None
    np.testing.assert_array_equal(other.point_mm, own.point_mm[[0, 0, 3, 3, 4]])
    np.testing.assert_allclose(other.tolerance_mm, [0.0, 0.006, 0.006, 0.0, 0.0])


@given(
    steps=st.lists(st.tuples(*[st.floats(-0.02, 0.02)] * 3), min_size=1, max_size=30),
    tolerance=st.floats(0.001, 0.03),
    rests=st.sets(st.integers(0, 30)),
)
def test_what_is_moved_is_taken_from_the_tolerance(
    steps: list[tuple[float, float, float]], tolerance: float, rests: set[int]
) -> None:
    own = route(np.cumsum([(0.0, 0.0, 0.0), *steps], axis=0), 100.0, tolerance)
    stops = [k for k in rests if k < len(own)]
    own.tolerance_mm[stops] = 0.0
    other = merged(own)
    if other is None:
        return
    away = np.linalg.norm(other.point_mm - own.point_mm, axis=1)
    np.testing.assert_array_equal(away[own.tolerance_mm == 0.0], 0.0)
    np.testing.assert_allclose(other.tolerance_mm, own.tolerance_mm - away, atol=1e-15)
    assert (away <= 0.6 * own.tolerance_mm + 1e-12).all()
