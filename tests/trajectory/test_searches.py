"""Which runs are searched: those where trials show that it is worth the work."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cases.trajectory import LIMITS, route

from olp.trajectory import variants
from olp.trajectory.searches import searched
from olp.trajectory.solvers import SOLVERS, Candidate
from olp.trajectory.stretches import Stretch

BENDS = tuple(Candidate(solver, 2.0) for solver in SOLVERS if solver.bends)


def runs(count: int, segments: int = 4, cells: float = 0.0) -> list[Stretch]:
    return [Stretch(k * segments, (k + 1) * segments, BENDS, cells=cells, least_s=2.0) for k in range(count)]


class Solving:
    """Solutions that are so much faster where a run is searched, and how many were asked for."""

    def __init__(self, gain: Callable[[Stretch], float]) -> None:
        self.gain = gain
        self.asked: list[Stretch] = []

    def __call__(self, run: Stretch) -> Any:
        self.asked.append(run)
        return SimpleNamespace(duration_s=2.0 * (1.0 - self.gain(run)), run=run)


def by_speed(share: float) -> Callable[[Stretch], float]:
    return lambda run: share if run.optimise else 0.0


@pytest.mark.parametrize(("share", "expected"), [(0.02, True), (0.002, True), (0.0005, False), (0.0, False)])
def test_runs_are_optimised_where_trials_gain_a_thousandth(share: float, expected: bool) -> None:
    solve = Solving(by_speed(share))
    marked, known = searched(runs(90), 400, solve, solve, 1.0)
    assert {run.optimise for run in marked} == {expected}
    assert len(solve.asked) <= 30
    assert {run.first for run in solve.asked} >= set(known)
    assert bool(known) == expected


def test_few_runs_are_searched_without_trials() -> None:
    solve = Solving(by_speed(0.0))
    marked, known = searched(runs(4), 17, solve, solve, 1.0)
    assert all(run.optimise for run in marked) and not known and not solve.asked


def test_a_part_of_too_many_runs_is_optimised() -> None:
    solve = Solving(by_speed(0.1))
    marked, _ = searched(runs(2000), 8001, solve, solve, 1.0)
    cost = sum(run.cost() for run in marked if run.optimise)
    assert 100_000 < cost < 150_000
    # what each waypoint adds is its own; of the rest a route has its share
    part, _ = searched(runs(2000), 8001, solve, solve, 0.5)
    assert cost - sum(run.cost() for run in part if run.optimise) == pytest.approx(50_000, rel=0.05)
    # the gain of few of many runs is nothing for the whole
    solve = Solving(by_speed(0.04))
    marked, _ = searched(runs(8_000), 32_001, solve, solve, 1.0)
    assert not any(run.optimise for run in marked)


def test_long_runs_are_optimised_without_trials_as_far_as_affordable() -> None:
    solve = Solving(by_speed(0.0))
    marked, _ = searched(runs(10, 5000), 50_001, solve, solve, 1.0)
    assert all(run.optimise for run in marked) and not solve.asked
    for count, share in ((100, 1.0), (10, 0.1)):
        marked, _ = searched(runs(count, 5000), count * 5000 + 1, solve, solve, share)
        assert not any(run.optimise for run in marked)


@pytest.mark.parametrize(("share", "expected"), [(0.004, True), (0.0002, False)])
def test_tubes_are_left_out_where_they_gain_nothing(share: float, expected: bool) -> None:
    solve = Solving(lambda run: share if run.tube else 0.0)
    marked, _ = searched(runs(60, cells=50.0), 241, solve, solve, 1.0)
    assert {run.tube for run in marked} == {expected}


def test_what_is_known_of_runs_in_tubes_was_found_in_tubes() -> None:
    solve = Solving(lambda run: 0.02 * run.optimise + 0.004 * run.tube)
    marked, known = searched(runs(90, cells=50.0), 361, solve, solve, 1.0)
    assert all(run.tube and run.optimise for run in marked) and known
    assert all(found.run.tube for found in known.values())  # type: ignore[attr-defined]


def test_a_run_that_no_solver_drives_is_no_trial() -> None:
    def solve(run: Stretch) -> Any:
        return None

    marked, known = searched(runs(90), 400, solve, solve, 1.0)
    assert not any(run.optimise for run in marked) and not known


def test_the_routes_of_a_program_share_the_work_that_one_affords(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of many tools began a route, and each was searched as a program of its own."""
    asked: list[float] = []
    monkeypatch.setattr(variants, "plan", lambda *_, share: asked.append(share))
    own = route(np.cumsum(np.ones((4, 3)), axis=0), 100.0, 0.01)
    longer = route(np.cumsum(np.ones((12, 3)), axis=0), 100.0, 0.01)
    variants._motions([own, longer, longer], LIMITS, lambda *_: None, "plan")
    assert asked == pytest.approx([1 / 7, 3 / 7, 3 / 7])
