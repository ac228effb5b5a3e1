"""Which solver drives a run fastest, audited: inside every limit, the feed, and near enough to the polyline.

A candidate that exceeds a limit is slowed down as a whole, one that strays or fails is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.trajectory.audit import Ratios, ratios, slowing
from olp.trajectory.critical import seconds
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.motion import Motion
from olp.trajectory.optimise import optimised
from olp.trajectory.route import Route
from olp.trajectory.solvers import LAST, OPTIMISED, SOLVERS, Candidate, Run, Solver
from olp.trajectory.speedgrid import bound_s

#: a limit may be touched; so much above it is rounding
_ROUNDING = 1e-9
#: share of the time that has to be gained, and of what jerk costs in closed form that optimising leaves
_GAIN, _LEFT = 0.003, 0.1
#: what a solver that fails may raise
_FAILURES = (ArithmeticError, ValueError, IndexError, CannotCompute)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A valid motion, slowed down by `factor` where it has to be, and what it uses of the limits."""

    motion: Motion
    solver: str
    factor: float
    ratios: Ratios
    deviation_mm: float

    @property
    def duration_s(self) -> float:
        return self.motion.duration_s * self.factor

    def driven(self) -> Motion:
        return self.motion if self.factor == 1.0 else self.motion.slowed(self.factor)


def fastest(run: Run, candidates: tuple[Candidate, ...], optimise: bool) -> Found | None:
    """The fastest of what the solvers find; those that were given no chance are asked when all else fails,
    and the last one then: stops everywhere are never the fastest."""
    best: Found | None = None
    for candidate in candidates:
        if best is None or candidate.least_s < best.duration_s:
            best = _better(run, candidate.solver, best)
    if optimise and best is not None and any(candidate.solver.bends for candidate in candidates):
        best = _optimised(run, best)
    asked = [candidate.solver for candidate in candidates]
    for solver in (*SOLVERS, LAST):
        if best is None and solver not in asked:
            best = _better(run, solver, best)
    return best


def contest(run: Run, candidates: tuple[Candidate, ...]) -> list[tuple[int, int, Found]]:
    """First and last way-point of runs that one solver drives best, one after the other; none where a solver
    fails, or has to be slowed down because of one run."""
    all_found = [_better(run, candidate.solver, None) for candidate in candidates]
    whole = [found for found in all_found if found is not None and found.factor == 1.0]
    if len(whole) < len(candidates):
        return []
    stops = stops_of(run.route)
    of_run = [np.searchsorted(stops, found.motion.line, side="right") - 1 for found in whole]
    seconds = np.stack([
        np.bincount(of, np.diff(found.motion.start_s), minlength=len(stops) - 1)
        for of, found in zip(of_run, whole, strict=True)
    ])  # fmt: skip
    winner = np.argmin(seconds, axis=0)
    edges = np.concatenate(([0], 1 + np.flatnonzero(np.diff(winner)), [len(winner)]))
    out = []
    for a, b in pairwise(edges.tolist()):
        found, of = whole[winner[a]], of_run[winner[a]]
        pieces = slice(int(np.searchsorted(of, a)), int(np.searchsorted(of, b)))
        out.append((int(stops[a]), int(stops[b]), replace(found, motion=found.motion.part(pieces))))
    return out


def _optimised(run: Run, best: Found) -> Found:
    """The motion of optimised speed where it may be faster."""
    try:
        path, profile = run.path(), run.profile()
    except _FAILURES:
        return best
    bound, closed = bound_s(path, run.limits), seconds(path, profile)
    if bound + _LEFT * (closed - bound) > (1.0 - _GAIN) * best.duration_s:
        return best
    solver = Solver(OPTIMISED, lambda run: optimised(path, run.limits, profile), LAST.least_s, bends=True)
    return _better(run, solver, best) or best


def _better(run: Run, solver: Solver, best: Found | None) -> Found | None:
    """What the solver finds if it is faster than the best so far, and valid; else that."""
    motion = _tried(lambda: solver.solve(run))
    if motion is None:
        return best
    used = ratios(motion, run.limits, run.route.feed_mm_s[motion.line])
    factor = slowing(used)
    factor = factor if factor > 1.0 + _ROUNDING else 1.0
    if best is not None and not motion.duration_s * factor < best.duration_s:
        return best
    allowed = _allowed(run.route)[motion.line]
    deviation = deviation_bound(motion, run.route, motion.line, allowed)
    if not (deviation <= allowed).all():
        return best
    return Found(motion, solver.name, factor, used.slowed(factor), float(deviation.max(initial=0.0)))


def _allowed(run: Route) -> Array:
    """(n - 1,) how far the path may be from the polyline along each segment: what the way-points near it
    allow, and rounding."""
    tolerance = np.concatenate((np.zeros(2), run.tolerance_mm, np.zeros(2)))
    near = [tolerance[i : len(run) - 1 + i] for i in range(6)]
    return np.asarray(np.max(near, axis=0) * (1.0 + 1e-6) + 1e-9)


def _tried(solve: Callable[[], Motion]) -> Motion | None:
    """A solver that fails leaves the field to the others."""
    try:
        motion = solve()
    except _FAILURES:
        return None
    sound = np.isfinite(motion.time).all() and (np.diff(motion.start_s) >= 0.0).all()
    return motion if sound else None


def stops_of(route: Route) -> Index:
    """Way-points at rest."""
    return np.flatnonzero((route.tolerance_mm == 0.0) | (route.dwell_s > 0.0))
