"""Waypoints moved within their tolerance so that a path bends evenly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.trajectory import route
from trajectory.test_merge import circle
from trajectory.test_plan import LIMITS

from olp.trajectory.merge import variants
from olp.trajectory.route import Route
from olp.trajectory.spread import spread


def roughness(own: Route) -> float:
    """The largest change of the direction from a waypoint to the next, beside that of a circle."""
    u = np.diff(own.point_mm, axis=0)
    u /= np.linalg.norm(u, axis=1)[:, None]
    bend = np.linalg.norm(np.diff(u, axis=0), axis=1)
    return float(np.abs(bend - np.median(bend)).max())


def noisy() -> Route:
    angle = np.linspace(0.0, np.pi, 300)
    arc = 20.0 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    return route(arc + np.random.default_rng(3).normal(0.0, 0.002, arc.shape), 80.0, 0.01)


def test_steps_and_noise_are_spread() -> None:
    for own, share in ((variants(route(circle(0.005, 3.0), 100.0, 0.01))[0], 0.02), (noisy(), 0.2)):
        even = spread(own, LIMITS)
        assert even is not None
        assert roughness(even) < share * roughness(own)


def test_a_waypoint_that_cannot_move_far_enough_holds_back_none_far_from_it() -> None:
    own = noisy()
    own.point_mm[150] *= 1.003
    even = spread(own, LIMITS)
    assert even is not None
    inner = slice(200, 290)
    parts = (replace(one, point_mm=one.point_mm[inner]) for one in (own, even))
    before, after = (roughness(part) for part in parts)
    assert after < 0.3 * before


@pytest.mark.parametrize("factor", (1.0, 0.1, 1e-3))
def test_no_waypoint_leaves_its_tolerance_and_no_rest_its_place(factor: float) -> None:
    own = noisy()
    own = replace(own, tolerance_mm=factor * own.tolerance_mm)
    own.tolerance_mm[100] = 0.0
    own.dwell_s[200] = 1.0
    even = spread(own, LIMITS)
    assert even is not None
    moved = np.linalg.norm(even.point_mm - own.point_mm, axis=1)
    np.testing.assert_allclose(even.tolerance_mm, own.tolerance_mm - moved, atol=1e-15)
    assert (even.tolerance_mm >= 0.39 * own.tolerance_mm).all()
    assert not moved[[0, 100, 200, -1]].any()
    assert moved.max() > 0.005 * own.tolerance_mm.max()


def test_units_do_not_matter() -> None:
    """The same in other lengths and times, with limits that follow them."""
    own = noisy()
    larger = replace(
        own, point_mm=25.4 * own.point_mm, tolerance_mm=25.4 * own.tolerance_mm,
        feed_mm_s=2.54 * own.feed_mm_s,
    )  # fmt: skip
    limits = replace(
        LIMITS, velocity=2.54 * LIMITS.velocity, acceleration=0.254 * LIMITS.acceleration,
        jerk=0.0254 * LIMITS.jerk,
    )  # fmt: skip
    first, second = spread(own, LIMITS), spread(larger, limits)
    assert first is not None and second is not None
    np.testing.assert_allclose(second.point_mm, 25.4 * first.point_mm, rtol=0, atol=1e-6)


def test_a_path_that_bends_evenly_stays() -> None:
    assert spread(route(circle(0.0)[:100], 100.0, 0.01), LIMITS) is None
    assert (
        spread(
            route(np.array([[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0], [0, 0, 0.0]]), 50.0, 0.01), LIMITS
        )
        is None
    )
    still = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0.01, 0], [3, 0, 0], [4, 0, 0.0]])
    assert spread(route(still, 50.0, 0.01), LIMITS) is None
