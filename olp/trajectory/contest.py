"""Which solver drives a run fastest, audited: within every limit, the feed, and the path tolerance.

A candidate that exceeds a limit is slowed down as a whole. One that leaves the tolerance or fails is dropped.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.trajectory.audit import Ratios, ratios, slowing
from olp.trajectory.critical import seconds
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.merge import shared
from olp.trajectory.motion import Motion
from olp.trajectory.optimise import optimised
from olp.trajectory.route import Route
from olp.trajectory.solvers import LAST, OPTIMISED, SOLVERS, TUBE, Candidate, Run, Solver
from olp.trajectory.tube import in_tube
from olp.trajectory.ways import OWN, WAYS, Paths, Way, windows

#: a limit may be reached; this share above it is rounding
_ROUNDING = 1e-9
#: share of the time that optimising has to gain
_GAIN = 0.003
#: share of the time that a search in a tube has to gain to be made again from its end ...
_AGAIN = 5e-3
#: ... and how often it is made
_SEARCHES = 3
#: share of the time that jerk costs in closed form which optimising does not recover
_JERK_COST = 0.1
#: why a motion of a tube is not taken that the tube itself finds faster
_EXCEEDS = "the motion found is not faster once it keeps all limits and the tolerance"
#: exceptions of a solver that fails
_FAILURES = (ArithmeticError, ValueError, IndexError, CannotCompute)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A valid motion, the `factor` by which it is slowed down (1: not), and its ratios to the limits. Where
    it was searched for a faster one in a tube, and there is none, `not_faster` says why."""

    motion: Motion
    solver: str
    factor: float
    ratios: Ratios
    deviation_mm: float
    not_faster: str = ""

    @property
    def duration_s(self) -> float:
        return self.motion.duration_s * self.factor

    def driven(self) -> Motion:
        return self.motion if self.factor == 1.0 else self.motion.slowed(self.factor)


def fastest(run: Run, candidates: tuple[Candidate, ...], optimise: bool) -> Solution | None:
    """The fastest solution of the candidates, along the route and the ways beside it. Where all fail, the
    other solvers are tried in order; exact stops come last, as they are never the fastest."""
    best: Solution | None = None
    smooth: list[Run] = []
    paths = Paths(run)
    entries, bending = _entries(paths, candidates, optimise)
    for entry in entries:
        if best is None or entry.least_s < best.duration_s:
            own = paths.along(entry.way)
            if own is None:
                continue
            best = _better(run, entry.solver, best, own)
            # speeds make the tight bends of a level way no better
            if entry.solver.bends and not entry.way.level:
                smooth.append(own)
    if optimise and best is not None and any(candidate.solver.bends for candidate in candidates):
        # optimising takes most of the time: only along the path that promises most
        most = None if bending is None else paths.along(bending)
        best = _optimised(run, best, most or min(smooth or [run], key=_promised_s))
    asked = [candidate.solver for candidate in candidates]
    for solver in (*SOLVERS, LAST):
        if best is None and solver not in asked:
            best = _better(run, solver, best)
    return best


def improved(run: Run, best: Solution) -> Solution:
    """The motion of a run whose path and speed are planned together from the best one, where it is faster. It
    is planned again from that one, as long as that gains."""
    causes: list[str] = []
    for _ in range(_SEARCHES):
        motion = best.driven()
        solver = Solver(TUBE, partial(_from_motion, motion, causes), LAST.least_s, bends=True)
        found = _better(run, solver, best) or best
        gained = found.duration_s < (1.0 - _AGAIN) * best.duration_s
        best = found
        if not gained:
            break
    return best if best.solver == TUBE else replace(best, not_faster=(*causes, _EXCEEDS)[0])


def _from_motion(motion: Motion, causes: list[str], run: Run) -> Motion:
    """The motion in a tube. Why there is none goes to the `causes`, too."""
    try:
        return in_tube(run.route, run.limits, motion)
    except _FAILURES as error:
        causes.append(str(error))
        raise


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A way, the solver that drives it, and the least seconds that it is expected to take."""

    way: Way
    solver: Solver
    least_s: float


def _entries(
    paths: Paths, candidates: tuple[Candidate, ...], optimise: bool
) -> tuple[list[_Entry], Way | None]:
    """The ways with the solvers that drive them, the most promising first, as it may spare the others. Of a
    long run windows show which is first, and along which way speeds are optimised; others spare none."""
    some = windows(paths.run)
    if some is None:
        return _all(paths, candidates, optimise), None
    parts = Paths(some)
    first: list[tuple[float, _Entry]] = []
    bending: list[tuple[float, Way]] = []
    for entry in _all(parts, candidates, optimise):
        own = parts.along(entry.way)
        solution = _better(some, entry.solver, None, own)
        if solution is not None and own is not None:
            first.append((solution.duration_s, entry))
            if optimise and entry.solver.bends and not entry.way.level:
                bending.append((_promised_s(own), entry.way))
    first.sort(key=lambda pair: pair[0])
    entries = [replace(entry, least_s=math.inf) for _, entry in first]
    return entries, min(bending, key=lambda pair: pair[0])[1] if bending else None


def _all(paths: Paths, candidates: tuple[Candidate, ...], optimise: bool) -> list[_Entry]:
    """All ways with all solvers that drive them."""
    limits = paths.run.limits
    entries = [_Entry(OWN, candidate.solver, candidate.least_s) for candidate in candidates]
    for way in WAYS:
        own = paths.along(way) if optimise or not way.even else None
        if own is not None:
            entries += [
                _Entry(way, solver, float(solver.least_s(own.route, limits).sum())) for solver in way.solvers
            ]
    entries.sort(key=lambda entry: entry.least_s)
    return entries


def contest(run: Run, candidates: tuple[Candidate, ...]) -> list[tuple[int, int, Solution]]:
    """First and last waypoint of consecutive runs, and the solver that is fastest there. Empty where a solver
    fails, or where its motion has to be slowed down."""
    solutions = [_better(run, candidate.solver, None) for candidate in candidates]
    whole = [solution for solution in solutions if solution is not None and solution.factor == 1.0]
    if len(whole) < len(candidates):
        return []
    stops = stops_of(run.route)
    of_run = [np.searchsorted(stops, solution.motion.line, side="right") - 1 for solution in whole]
    seconds = np.stack([
        np.bincount(of, np.diff(solution.motion.start_s), minlength=len(stops) - 1)
        for of, solution in zip(of_run, whole, strict=True)
    ])  # fmt: skip
    winner = np.argmin(seconds, axis=0)
    edges = np.concatenate(([0], 1 + np.flatnonzero(np.diff(winner)), [len(winner)]))
    winners = []
    for a, b in pairwise(edges.tolist()):
        solution, of = whole[winner[a]], of_run[winner[a]]
        pieces = slice(int(np.searchsorted(of, a)), int(np.searchsorted(of, b)))
        winners.append((int(stops[a]), int(stops[b]), replace(solution, motion=solution.motion.part(pieces))))
    return winners


def _closed_s(run: Run) -> float:
    """The time along the smooth path in closed form; inf where there is none."""
    try:
        return seconds(run.path(), run.profile())
    except _FAILURES:
        return math.inf


def _promised_s(run: Run, most_s: float = math.inf) -> float:
    """About the time of optimised speeds along the smooth path, where some motion takes `most_s` at most; inf
    where there is no such path."""
    closed = _closed_s(run)
    if math.isinf(closed):
        return closed
    return run.bound_s() + _JERK_COST * (min(closed, most_s) - run.bound_s())


def _optimised(run: Run, best: Solution, own: Run) -> Solution:
    """The motion of optimised speed along the smooth path of `own`, where it is faster."""
    if _promised_s(own, best.duration_s) > (1.0 - _GAIN) * best.duration_s:
        return best
    path, profile = own.path(), own.profile()
    solver = Solver(OPTIMISED, lambda run: optimised(path, run.limits, profile), LAST.least_s, bends=True)
    return _better(run, solver, best) or best


def _better(run: Run, solver: Solver, best: Solution | None, own: Run | None = None) -> Solution | None:
    """The solver's solution for the run, or for its variant `own`, if it is valid for the run and faster than
    the best so far; else the best so far."""
    motion = _tried(lambda: solver.solve(own or run))
    # one that is slower even without a slow-down needs no audit
    if motion is None or (best is not None and motion.duration_s >= best.duration_s):
        return best
    motion = motion if own in {None, run} or solver.bends else shared(motion)
    used = ratios(motion, run.limits, run.route.feed_mm_s[motion.line])
    factor = slowing(used)
    factor = factor if factor > 1.0 + _ROUNDING else 1.0
    if best is not None and not motion.duration_s * factor < best.duration_s:
        return best
    allowed = _allowed(run.route)[motion.line]
    deviation = deviation_bound(motion, run.route, motion.line, allowed)
    if not (deviation <= allowed).all():
        return best
    return Solution(motion, solver.name, factor, used.slowed(factor), float(deviation.max(initial=0.0)))


def _allowed(run: Route) -> Array:
    """(n - 1,) how far the path may be from the polyline along each segment: the tolerances of the waypoints
    around it, and rounding."""
    tolerance = np.concatenate((np.zeros(2), run.tolerance_mm, np.zeros(2)))
    near = [tolerance[i : len(run) - 1 + i] for i in range(6)]
    return np.asarray(np.max(near, axis=0) * (1.0 + 1e-6) + 1e-9)


def _tried(solve: Callable[[], Motion]) -> Motion | None:
    """The motion, or None where the solver fails."""
    try:
        motion = solve()
    except _FAILURES:
        return None
    sound = np.isfinite(motion.time).all() and (np.diff(motion.start_s) >= 0.0).all()
    return motion if sound else None


def stops_of(route: Route) -> Index:
    """Indices of the waypoints at rest."""
    return np.flatnonzero((route.tolerance_mm == 0.0) | (route.dwell_s > 0.0))
