"""Laws of a planner: less freedom is no gain. A rest more, a lower limit, less feed or less tolerance.

The best path is not known, only the best of several methods. So the laws hold to a share that is stated here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cases.trajectory import route

from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits, Route

LIMITS = AxisLimits(np.full(3, 300.0), np.full(3, 1500.0), np.full(3, 2e4))
#: share by which a run with more freedom may be slower; of limits, and of the path
SHARE = 2e-3
SHARE_OF_PATH = 0.03


def mixed(seed: int) -> Route:
    """Corners, an arc of chords, jogs and a staircase, in an order of chance."""
    rng = np.random.default_rng(seed)
    points = [np.zeros(3)]
    for kind in rng.permutation(4).tolist():
        here = points[-1]
        if kind == 0:
            points += [here + step for step in np.cumsum(rng.normal(size=(4, 3)) * 8.0, axis=0)]
        elif kind == 1:
            radius = 10.0 ** rng.uniform(-0.3, 1.2)
            angle = np.linspace(0.0, rng.uniform(1.0, 5.0), 30)
            turn = np.stack((np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle), axis=1)
            points += list(here + radius * turn[1:])
        elif kind == 2:
            for _ in range(4):
                points.append(points[-1] + np.array([rng.uniform(1.0, 8.0), 0.0, 0.0]))
                points.append(points[-1] + rng.normal(size=3) * 0.005)
        else:
            step = 10.0 ** rng.uniform(-1.5, 0.0)
            for k in range(16):
                points.append(points[-1] + step * np.eye(3)[k % 2])
    return route(np.array(points), 10.0 ** rng.uniform(1.3, 2.3), 10.0 ** rng.uniform(-2.3, -0.5))


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign(range(4), 4))
def test_less_freedom_is_no_gain(seed: int) -> None:
    own = mixed(seed)
    rng = np.random.default_rng(100 + seed)
    duration_s = plan(own, LIMITS).duration_s
    stopped = own.tolerance_mm.copy()
    stopped[rng.integers(1, len(own) - 1)] = 0.0
    less: dict[str, tuple[Route, AxisLimits, float]] = {
        "a rest more": (replace(own, tolerance_mm=stopped), LIMITS, SHARE_OF_PATH),
        "less jerk": (own, replace(LIMITS, jerk=0.9 * LIMITS.jerk), SHARE),
        "less acceleration": (own, replace(LIMITS, acceleration=0.9 * LIMITS.acceleration), SHARE),
        "less velocity": (own, replace(LIMITS, velocity=0.5 * LIMITS.velocity), SHARE),
        "less feed": (replace(own, feed_mm_s=0.9 * own.feed_mm_s), LIMITS, SHARE),
        "exact stops": (replace(own, tolerance_mm=0.0 * own.tolerance_mm), LIMITS, 0.0),
        "less tolerance": (replace(own, tolerance_mm=0.9 * own.tolerance_mm), LIMITS, SHARE_OF_PATH),
        "half the tolerance": (replace(own, tolerance_mm=0.5 * own.tolerance_mm), LIMITS, SHARE_OF_PATH),
    }
    seconds = {name: plan(some, limits).duration_s for name, (some, limits, _) in less.items()}
    faster = {name: s for name, s in seconds.items() if s * (1.0 + less[name][2]) < duration_s}
    assert faster == {}


def test_a_fine_staircase_inside_the_tolerance_is_nearly_a_straight_line() -> None:
    step = 0.05 * np.eye(3)[np.arange(400) % 2]
    stairs = route(np.concatenate((np.zeros((1, 3)), np.cumsum(step, axis=0))), 50.0, 0.05)
    line = route(np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 0.0]]), 50.0, 0.05)
    assert plan(stairs, LIMITS).duration_s <= 1.2 * plan(line, LIMITS).duration_s
