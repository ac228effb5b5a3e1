"""The solvers of the planner, and a forecast of the time that each takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.trajectory.critical import Profile, best_profile, driven
from olp.trajectory.forecast import expected_s
from olp.trajectory.motion import Motion
from olp.trajectory.overlap import least_s, overlap
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import SmoothPath, smooth
from olp.trajectory.speedgrid import bound_s

#: names of the solvers in a report
OVERLAP = "overlapped moves"
CRITICAL = "critical points"
EXACT_STOP = "exact stops"
OPTIMISED = "optimised speed"
TUBE = "path and speed together"
#: share of the expected time that critical points take at least
_AT_BEST = 0.9


class Run:
    """A route from rest to rest, its limits, and what several solvers share: its smooth path and profile."""

    def __init__(self, route: Route, limits: AxisLimits) -> None:
        self.route = route
        self.limits = limits
        self._path: SmoothPath | None = None
        self._profile: Profile | None = None
        self._bound_s: float | None = None

    def path(self) -> SmoothPath:
        """The smooth path. Raises CannotCompute as `smooth`."""
        if self._path is None:
            self._path = smooth(self.route, self.limits)
        return self._path

    def profile(self) -> Profile:
        """Speeds in closed form along the path. Raises as `path`."""
        if self._profile is None:
            self._profile = best_profile(self.path(), self.limits)
        return self._profile

    def bound_s(self) -> float:
        """About the least seconds along the path without a jerk limit. Raises as `path`."""
        if self._bound_s is None:
            self._bound_s = bound_s(self.path(), self.limits)
        return self._bound_s


@dataclass(frozen=True, slots=True, eq=False)
class Solver:
    """A method to drive a run, which may fail.

    `least_s` gives about the least seconds (n - 1,) along each segment. A solver that `bends` the path is of
    no use for straight moves, and its forecast ignores the effect of corners on their neighbours."""

    name: str
    solve: Callable[[Run], Motion]
    least_s: Callable[[Route, AxisLimits], Array]
    bends: bool


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A solver, and the least seconds that it is expected to take."""

    solver: Solver
    least_s: float


SOLVERS = (
    Solver(
        OVERLAP,
        lambda run: overlap(run.route, run.limits),
        least_s,
        bends=False,
    ),
    Solver(
        CRITICAL,
        lambda run: driven(run.path(), run.profile()),
        lambda route, limits: _AT_BEST * expected_s(route, limits),
        bends=True,
    ),
)
#: exact stops, for where the others fail
LAST = Solver(
    EXACT_STOP,
    lambda run: overlap(replace(run.route, tolerance_mm=np.zeros(len(run.route))), run.limits),
    least_s,
    bends=False,
)
