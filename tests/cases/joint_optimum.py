"""Planar runs whose path and speed are planned and compared with the joint optimum."""

from __future__ import annotations

import numpy as np
from judge.joint_optimum import Case, Found, optimum

from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits, Route

VELOCITY, ACCELERATION, JERK = (np.full(2, limit) for limit in (500.0, 5e3, 1e5))
#: steps of a span and spans of a segment, by how many segments there are
_COARSE, _FINE = (4, 3), (8, 6)
_FEW = 4


def case(point_mm, tolerance_mm: float, feed_mm_s: float = 100.0) -> Case:
    return Case(np.asarray(point_mm, float), tolerance_mm, VELOCITY, ACCELERATION, JERK, feed_mm_s)


def corner(turn_deg: float, length: float = 20.0) -> np.ndarray:
    """Two straight moves, the second turned by an angle."""
    turn = np.radians(turn_deg)
    return length * np.array([[0.0, 0.0], [1.0, 0.0], [1.0 + np.cos(turn), np.sin(turn)]])


def staircase() -> np.ndarray:
    return np.cumsum(np.array([[0.0, 0.0], *[[2.0, 0.0], [0.0, 2.0]] * 3]), axis=0)


def jog() -> np.ndarray:
    return np.array([[0.0, 0.0], [20.0, 0.0], [20.5, 0.05], [40.0, 0.05]])


def noisy(noise_mm: float = 0.004) -> np.ndarray:
    """Chords of 2 mm along a line, off it by chance."""
    x = np.linspace(0.0, 20.0, 11)
    y = np.random.default_rng(1).normal(0.0, noise_mm, 11)
    y[[0, -1]] = 0.0
    return np.column_stack((x, y))


def mixture() -> np.ndarray:
    """Noisy chords, corners and a jog."""
    chords = noisy()[:6]
    more = np.array([[0.0, 5.0], [2.0, 5.0], [2.0, 7.0], [2.2, 7.01], [8.0, 7.01]])
    return np.concatenate((chords, chords[-1] + more))


def cases() -> dict[str, Case]:
    """What the bar of re-timing names."""
    found = {
        f"corner of {turn} deg, {tolerance * 1e3:g} um": case(corner(turn), tolerance)
        for turn in (45, 90, 135)
        for tolerance in (0.005, 0.02, 0.1, 0.5)
    }
    found |= {f"staircase, {t * 1e3:g} um": case(staircase(), t) for t in (0.01, 0.05)}
    found |= {f"jog, {t * 1e3:g} um": case(jog(), t) for t in (0.005, 0.02)}
    return found | {"noisy chords, 10 um": case(noisy(), 0.01), "mixture, 10 um": case(mixture(), 0.01)}


def planned(some: Case) -> Trajectory:
    """By the planner; a third axis rests."""
    point = some.point_mm
    count = len(point)
    band = np.full(count, some.tolerance_mm)
    band[[0, -1]] = 0.0
    limits = (np.append(limit, limit[0]) for limit in (some.velocity, some.acceleration, some.jerk))
    route = Route(
        np.column_stack((point, np.zeros(count))), np.full(count - 1, some.feed_mm_s), np.arange(count - 1),
        band, np.zeros(count),
    )  # fmt: skip
    return plan(route, AxisLimits(*limits))


def best(some: Case, trajectory: Trajectory, sizes: tuple[int, int] | None = None) -> Found:
    """The joint optimum, sought from the times at which a plan passes the waypoints."""
    motion = trajectory.motion
    last = [motion.start_s[1:][motion.line <= k].max() for k in range(len(some.point_mm) - 1)]
    sizes = sizes or (_FINE if len(last) <= _FEW else _COARSE)
    return optimum(some, np.array([0.0, *last]), *sizes)
