"""The planner beside the joint optimum of path and speed, and the reference beside optima that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cases.joint_optimum import best, case, corner, jog, planned
from judge.joint_optimum import Case, Found, optimum

#: share by which a linear program is inexact
INEXACT = 1e-5
#: share by which the reference may be off, for being in steps
STEPS = 3e-3


def straight_s(length: float, speed: float, acceleration: float, jerk: float) -> float:
    """Seconds from rest to rest where the speed is reached, and the acceleration is too."""
    assert speed * jerk > acceleration**2 and length > speed * (speed / acceleration + acceleration / jerk)
    return length / speed + speed / acceleration + acceleration / jerk


def assert_moves(found: Found, some: Case) -> None:
    """Its jerks lead from the first waypoint to rest on the last, inside the limits and the tube."""
    position, velocity, acceleration = some.point_mm[0].copy(), np.zeros(2), np.zeros(2)
    for step, jerk, segment in zip(found.step_s, found.jerk, found.segment, strict=True):
        first, last = some.point_mm[segment : segment + 2]
        for u in np.linspace(0.0, step, 4)[1:]:
            p = position + u * (velocity + u * (acceleration / 2 + u * jerk / 6))
            v = velocity + u * (acceleration + u * jerk / 2)
            a = acceleration + u * jerk
            delta = last - first
            share = np.clip((p - first) @ delta / (delta @ delta), 0.0, 1.0)
            assert np.hypot(*(p - first - share * delta)) <= some.tolerance_mm * (1 + INEXACT) + 1e-7
            assert (np.abs(v) <= some.velocity * (1 + INEXACT)).all()
            assert np.hypot(*v) <= some.feed_mm_s * 1.01
            assert (np.abs(a) <= some.acceleration * (1 + 1e-6)).all()
        position, velocity, acceleration = p, v, a
        assert (np.abs(jerk) <= some.jerk * (1 + 1e-6)).all()
    passed = 1 + np.flatnonzero(np.diff(found.segment))
    missed = np.hypot(*(found.position_mm[passed] - some.point_mm[1:-1]).T)
    assert (missed <= some.tolerance_mm * (1 + INEXACT) + 1e-7).all()
    assert np.allclose(position, some.point_mm[-1], atol=1e-5)
    assert np.allclose(velocity, 0.0, atol=1e-3) and np.allclose(acceleration, 0.0, atol=0.1)


@pytest.mark.slow
def test_the_reference_finds_the_fastest_straight_move() -> None:
    line = case([[0.0, 0.0], [20.0, 0.0]], 0.01, 150.0)
    known = straight_s(20.0, 150.0, 3e3, 1e5)
    line = replace(line, acceleration=np.full(2, 3e3))
    found = optimum(line, np.array([0.0, 1.2 * known]), 3, 7)
    assert found.duration_s == pytest.approx(known, rel=STEPS)
    assert_moves(found, line)


@pytest.mark.slow
def test_the_reference_comes_to_stops_where_the_tolerance_is_none() -> None:
    """Two moves of 20 mm with a feed of 100 mm/s do not reach the acceleration."""
    turn = case(corner(90.0), 1e-5)
    stops = 2 * (20.0 / 100.0 + 2 * np.sqrt(100.0 / 1e5))
    # moves may overlap in a corner of 10 nm
    found = optimum(turn, np.array([0.0, 0.5, 1.0]) * 1.2 * stops, 6, 5)
    assert (1 - 6e-3) * stops < found.duration_s <= (1 + STEPS) * stops
    assert_moves(found, turn)


#: times of the planner over those of the joint optimum, at most: the largest measured, and 5e-3 more
WORST = {"corner": 1.006, "jog": 1.007}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "some", "sizes"),
    some_of_a_campaign(
        [("corner", case(corner(90.0), 0.02), (8, 6)), ("jog", case(jog(), 0.005), (8, 6))], 2
    ),
)
def test_a_plan_is_no_slower_and_no_faster_than_the_optimum_allows(
    name: str, some: Case, sizes: tuple[int, int]
) -> None:
    plan = planned(some)
    found = best(some, plan, sizes)
    assert_moves(found, some)
    assert 1 - STEPS < plan.duration_s / found.duration_s < WORST[name]
