"""Windows of a long run show along which way it is planned."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases.trajectory import LIMITS, route
from trajectory.test_merge import jogs

from olp.trajectory import contest, ways
from olp.trajectory.plan import plan
from olp.trajectory.route import Route
from olp.trajectory.solvers import Run


def noisy_line(count: int) -> np.ndarray:
    """A line of short steps that turn left and right by more than they go."""
    angle = np.random.default_rng(2).normal(0.0, 1.0, count)
    steps = 0.01 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    return np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are long from some hundred segments on."""
    for name, value in (("_WINDOWS", 4), ("_SEGMENTS", 24), ("_LONG", 2)):
        monkeypatch.setattr(ways, name, value)


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("points", [noisy_line(220), jogs(0.005, 110)])
def test_a_long_run_is_planned_along_one_way_and_no_slower(
    points: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = route(points, 50.0, 0.01)
    whole: list[Run] = []
    better = contest._better

    def counted(run: Run, *others: Any) -> contest.Solution | None:
        whole.extend([run] * (len(run.route) == len(own)))
        return better(run, *others)

    monkeypatch.setattr(contest, "_better", counted)
    once = plan(own, LIMITS, optimise=False)
    assert len(whole) == 1
    monkeypatch.setattr(contest, "windows", lambda run: None)
    every = plan(own, LIMITS, optimise=False)
    assert len(whole) > 2
    assert once.duration_s <= 1.001 * every.duration_s


@pytest.mark.usefixtures("short")
def test_windows_are_parts_of_the_run_with_rests_between() -> None:
    own: Route = route(noisy_line(400), 50.0, 0.01)
    some = ways.windows(Run(own, LIMITS))
    assert some is not None
    assert len(some.route) == 4 * 24 + 1
    assert np.flatnonzero(some.route.tolerance_mm == 0.0).tolist() == [0, 24, 48, 72, 96]
    steps = {tuple(step) for step in np.diff(own.point_mm, axis=0).round(9).tolist()}
    assert {tuple(step) for step in np.diff(some.route.point_mm, axis=0).round(9).tolist()} <= steps
    assert ways.windows(Run(route(noisy_line(150), 50.0, 0.01), LIMITS)) is None
