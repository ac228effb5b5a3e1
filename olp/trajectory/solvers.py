"""The ways that the planner knows to drive a run, and what each takes at least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from olp.core.arrays import Array
from olp.trajectory.critical import Profile, best_profile, driven
from olp.trajectory.forecast import expected_s
from olp.trajectory.motion import Motion
from olp.trajectory.overlap import least_s, overlap
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import SmoothPath, smooth

#: how they are named in a report
OVERLAP, CRITICAL, EXACT_STOP = "overlapped moves", "critical points", "exact stops"
OPTIMISED = "optimised speed"
#: critical points take no less than this share of what they are expected to
_AT_BEST = 0.9


class Run:
    """A route from rest to rest and its limits, and what several solvers make of it: its smooth path."""

    def __init__(self, route: Route, limits: AxisLimits) -> None:
        self.route = route
        self.limits = limits
        self._path: SmoothPath | None = None
        self._profile: Profile | None = None

    def path(self) -> SmoothPath:
        """Raises CannotCompute as `smooth`."""
        if self._path is None:
            self._path = smooth(self.route, self.limits)
        return self._path

    def profile(self) -> Profile:
        """Speeds in closed form along the path; raises as that."""
        if self._profile is None:
            self._profile = best_profile(self.path(), self.limits)
        return self._profile


@dataclass(frozen=True, slots=True, eq=False)
class Solver:
    """A way to drive a run, which may fail; `least_s` tells the seconds (n - 1,) that it takes along each
    segment at least, or nearly so. One that `bends` the path is of no use to straight moves, and its forecast
    leaves out what neighbouring corners do to each other."""

    name: str
    solve: Callable[[Run], Motion]
    least_s: Callable[[Route, AxisLimits], Array]
    bends: bool


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A solver, and the seconds that it is expected to take at least."""

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
#: stops everywhere: what is left where the others fail
LAST = Solver(
    EXACT_STOP,
    lambda run: overlap(replace(run.route, tolerance_mm=np.zeros(len(run.route))), run.limits),
    least_s,
    bends=False,
)
