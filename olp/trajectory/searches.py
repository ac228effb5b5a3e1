"""Which runs are searched for a faster motion: those that a few trials show to be worth the work.

Work is counted in pieces and cells, not in time, so the same route always has the same plan. A search whose
trials promise less than a thousandth of the route's time is left out, as its gain is not worth the wait.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.contest import Solution
from olp.trajectory.stretches import SHORT, Stretch

#: pieces of long runs that are optimised at most unless asked for: about a minute and a half
_AFFORDED = 1_000_000
#: pieces of short runs that are optimised at most, and ...
_OF_SHORT = 100_000
#: ... so many more for each waypoint ...
_EACH = 8
#: ... of a route of at most so many
_WAYPOINTS = 6_000
#: share of the time of a route that a search has to promise
_WORTH = 1e-3
#: pieces of the runs on which optimising is tried, about
_TRIAL = 10_000
#: cells of the runs on which tubes are tried, about
_TRIAL_CELLS = 400
#: runs that are tried at least
_TRIED = 4
#: a search that costs no more than so many trials is made without one
_TRIALS = 3

#: the solution of a run, searched as it states
Solve = Callable[[Stretch], Solution | None]


def searched(
    runs: Sequence[Stretch], waypoints: int, solve: Solve, in_group: Solve, share: float
) -> tuple[list[Stretch], dict[int, Solution]]:
    """The runs with those marked that are optimised, and in tubes only those of which that is worth it; and
    the solutions that are known from trials, by the first waypoint of their run. Short runs that are not
    optimised are planned `in_group`. `share` of the work that is afforded is theirs."""
    known: dict[int, Solution] = {}
    whole_s = sum(run.least_s for run in runs)
    cost = [run.cost() for run in runs]
    chosen = {k for k, run in enumerate(runs) if run.bends and run.segments > SHORT}
    if sum(cost[k] for k in chosen) > share * _AFFORDED:
        chosen = set()
    else:
        short = [k for k, run in enumerate(runs) if run.bends and run.segments <= SHORT]
        short = _within(short, runs, cost, share * _OF_SHORT + _EACH * min(waypoints, _WAYPOINTS))
        speed = _Search(lambda run: in_group(_bare(run)), lambda run: solve(_optimised(_bare(run))), _TRIAL)
        if speed.worth([runs[k] for k in short], [cost[k] for k in short], whole_s, known):
            chosen.update(short)
    marked = [_optimised(run) if k in chosen else run for k, run in enumerate(runs)]
    tubed = [run for run in marked if run.tube]
    in_tubes: dict[int, Solution] = {}
    tube = _Search(lambda run: solve(_bare(run)), solve, _TRIAL_CELLS)
    if tube.worth(tubed, [run.cells for run in tubed], whole_s, in_tubes):
        for run in tubed:
            known.pop(run.first, None)
        return marked, known | in_tubes
    return [_bare(run) for run in marked], known


def _optimised(run: Stretch) -> Stretch:
    return replace(run, optimise=True)


def _bare(run: Stretch) -> Stretch:
    """The run without a tube."""
    return replace(run, cells=0.0) if run.tube else run


def _within(short: list[int], runs: Sequence[Stretch], cost: Sequence[float], most: float) -> list[int]:
    """Of short runs those that take most time for their cost, which is at most `most` in all."""
    own = np.array([cost[k] for k in short])
    each = np.array([runs[k].least_s for k in short])
    order = np.argsort(-each / np.maximum(own, 1.0), kind="stable")
    count = int(np.searchsorted(np.cumsum(own[order]), most, side="right"))
    return sorted(short[i] for i in order[:count].tolist())


@dataclass(frozen=True, slots=True)
class _Search:
    """A kind of search: solving a run `without` and `within` it, and about the cost of all trials."""

    without: Solve
    within: Solve
    trial: float

    def worth(
        self, of: Sequence[Stretch], cost: Sequence[float], whole_s: float, known: dict[int, Solution]
    ) -> bool:
        """Whether searching some runs gains enough of the `whole_s` of all, by trials where it costs more
        than a few. The solutions of trials become `known` where it does."""
        own = np.array(cost)
        if own.sum() <= _TRIALS * self.trial:
            return True
        all_s = sum(run.least_s for run in of)
        if all_s < _WORTH * whole_s:
            return False
        found: dict[int, Solution] = {}
        before = after = 0.0
        for run in (of[i] for i in _spread(own, self.trial).tolist()):
            first, second = self.without(run), self.within(run)
            if first is not None and second is not None:
                before, after = before + first.duration_s, after + second.duration_s
                found[run.first] = second
        if not before or all_s * (1.0 - after / before) < _WORTH * whole_s:
            return False
        known.update(found)
        return True


def _spread(cost: Array, most: float) -> Index:
    """Indices of runs that are spread evenly over their cost, and cost about `most` in all."""
    count = max(_TRIED, int(most / cost.mean()))
    places = (np.arange(count) + 0.5) / count * cost.sum()
    return np.unique(np.minimum(np.searchsorted(np.cumsum(cost), places), len(cost) - 1))
