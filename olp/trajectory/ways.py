"""Ways beside the path of a run: without short steps, over lines, with corners outward, evenly bent.

A long run is not planned along each of them. Windows of it, one behind the other with rests between, show
which way is fastest. What a way gains beside them is where it is little.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from olp.core.arrays import distinct
from olp.core.values import dataclass
from olp.trajectory.bends import levelled, outward
from olp.trajectory.forecast import straight
from olp.trajectory.merge import variants
from olp.trajectory.route import Route
from olp.trajectory.solvers import SOLVERS, Run, Solver
from olp.trajectory.spread import LENGTHS, spread

#: windows of a long run ...
_WINDOWS = 8
#: ... and the segments of each
_SEGMENTS = 384
#: a run of so many times the segments of all windows is long
_LONG = 8

_BENDING = tuple(solver for solver in SOLVERS if solver.bends)


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """How the route is `made`, None where it is the run's own, and which `solvers` drive it. One that is
    `level` is over lines instead of curves: it has tight bends between them, which speeds make no better. One
    that is `even` is worth its work only where speeds are optimised."""

    made: Callable[[Paths], Route | None]
    solvers: tuple[Solver, ...]
    level: bool = False
    even: bool = False


class Paths:
    """The runs along the ways beside a run, each made once."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._made: dict[Way, Run | None] = {OWN: run}
        self._fewer: list[Route] | None = None

    def fewer(self) -> list[Route]:
        """The route without short steps: by clusters, and by pairs where that differs."""
        if self._fewer is None:
            self._fewer = variants(self.run.route)
        return self._fewer

    def along(self, way: Way) -> Run | None:
        """The run along a way, None where there is none."""
        if way not in self._made:
            route = way.made(self)
            self._made[way] = None if route is None else Run(route, self.run.limits)
        return self._made[way]


def _fewer(number: int) -> Callable[[Paths], Route | None]:
    return lambda paths: next(iter(paths.fewer()[number : number + 1]), None)


def _even(share: float) -> Callable[[Paths], Route | None]:
    return lambda paths: spread((paths.fewer() or [paths.run.route])[0], paths.run.limits, share)


#: the path of the run itself; others come with what drives it
OWN = Way(lambda paths: paths.run.route, ())
WAYS = (
    Way(_fewer(0), SOLVERS),
    Way(_fewer(1), SOLVERS),
    Way(lambda paths: levelled(paths.run.route), _BENDING, level=True),
    Way(lambda paths: outward(paths.run.route), _BENDING),
    *(Way(_even(share), _BENDING, even=True) for share in LENGTHS),
)


def windows(run: Run) -> Run | None:
    """Windows of a long run, moved one behind the other, with rests between; None of a run that is not long.
    They are spread evenly over waypoints and over the time at full feed."""
    route = run.route
    count = len(route) - 1
    if count <= _LONG * _WINDOWS * _SEGMENTS:
        return None
    lasts = straight(route, run.limits, np.array([0, count]))[0]
    passed = np.cumsum(lasts / max(float(lasts.sum()), float(np.finfo(float).tiny)) + 1.0 / count)
    middle = np.searchsorted(passed, (np.arange(_WINDOWS) + 0.5) / _WINDOWS * passed[-1])
    first = np.clip(middle - _SEGMENTS // 2, 0, count - _SEGMENTS)
    segment = distinct((first[:, None] + np.arange(_SEGMENTS)).ravel())
    point = np.concatenate((np.zeros((1, route.point_mm.shape[1])), route.point_mm[segment + 1]))
    point[1:] -= route.point_mm[segment]
    tolerance = np.append(0.0, route.tolerance_mm[segment + 1])
    tolerance[1 + np.flatnonzero(np.diff(segment) > 1)] = tolerance[-1] = 0.0
    some = Route(
        np.cumsum(point, axis=0), route.feed_mm_s[segment], np.arange(len(segment)), tolerance,
        np.zeros(len(tolerance)),
    )  # fmt: skip
    return Run(some, run.limits)
