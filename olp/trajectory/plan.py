"""From a route to the fastest audited motion that any solver finds for each of its runs.

A run goes from one way-point at rest to the next. What each solver will take for it is told beforehand, by a
bound or nearly one, and those that cannot win are not asked. Every candidate is audited, and slowed down as a
whole where it would exceed a limit, so a solver can make a run slow but never wrong; one that fails is left
out, and the exact stop at every way-point always remains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from olp.exceptions import CannotCompute
from olp.trajectory import critical
from olp.trajectory.audit import Audit, Ratios, ratios, slowing, with_jumps
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.motion import Array, Index, Motion
from olp.trajectory.optimise import optimised
from olp.trajectory.overlap import least_s, overlap
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import SmoothPath, needs_stop, smooth
from olp.trajectory.speedgrid import CELL_S, bound_s

Progress = Callable[[str, float], None]

#: a limit may be touched; so much above it is rounding
_ROUNDING = 1e-9
#: ways that the planner knows to drive a run, and how they are named in a report
OVERLAP, CRITICAL, EXACT_STOP = "overlapped moves", "critical points", "exact stops"
OPTIMISED = "optimised speed"
#: runs with fewer segments than this between stops are straight moves to the overlapping solver
_FEW_SEGMENTS = 2
#: critical points take no less than this share of what they are expected to
_AT_BEST = 0.9
#: a solver whose least time is this share of all others' wins without a contest
_SURE = 0.8
#: pieces of a way-point, and of all that is optimised unless asked for: about a minute and a half
_PIECES, _AFFORDED = 3, 1_000_000
#: share of the time that has to be gained, and of what jerk costs in closed form that optimising leaves
_GAIN, _LEFT = 0.003, 0.1
#: way-points that are forecast together, and of runs that are planned together: a call costs more than a move
_BLOCK, _TOGETHER = 1 << 15, 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A stretch of a route that one solver drove: way-points `first` to `last`, in `duration_s`, never
    farther than `deviation_mm` from the polyline; `factor` is what the audit slowed it down by."""

    first: int
    last: int
    solver: str
    duration_s: float
    factor: float
    deviation_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """The motion of a whole program within `limits`, the legs that it was planned in, and its audit."""

    motion: Motion
    limits: AxisLimits
    legs: tuple[Leg, ...]
    audit: Audit

    @property
    def duration_s(self) -> float:
        return self.motion.duration_s

    def at(self, time_s: Array) -> tuple[Array, Array, Array, Array, Index]:
        """Position mm, velocity mm/s, acceleration mm/s^2, jerk mm/s^3, (n, 3) each, and line (n,) at times
        (n,) s."""
        return (*self.motion.at(time_s), self.motion.line[self.motion.piece_at(time_s)])

    def sample_times(self, cycle_s: float) -> Array:
        """Times of the control's cycles, the end included."""
        count = int(np.floor(self.duration_s / cycle_s + 1e-9))
        times: Array = np.arange(count + 1, dtype=float) * cycle_s
        return times if self.duration_s - times[-1] < 1e-12 else np.append(times, self.duration_s)

    def seconds_by_line(self) -> tuple[Index, Array]:
        """Lines that move, in order, and the time spent on each."""
        lines, which = np.unique(self.motion.line, return_inverse=True)
        seconds: Array = np.bincount(which, np.diff(self.motion.start_s), minlength=len(lines)).astype(float)
        return lines.astype(np.int64), seconds


def plan(
    route: Route, limits: AxisLimits, tell: Progress | None = None, *, optimise: bool | None = None
) -> Trajectory:
    """The motion of a route that begins and ends at rest.

    `optimise` tells whether speeds along dense curves are optimised; None: unless that would take minutes.
    Raises CannotCompute for a route that is not finite.
    """
    _check(route, limits)
    route = _with_stops(route)
    parts: list[Motion] = []
    legs: list[Leg] = []
    used = Ratios(np.zeros(3), np.zeros(3), np.zeros(3), 0.0)
    stretches = list(_stretches(route, limits))
    if optimise is None:
        optimise = _to_optimise(stretches) <= _AFFORDED
    for first, last, rivals in stretches:
        for motion, leg, ratio in _legs(route, limits, first, last, rivals, optimise):
            parts += motion
            legs.append(leg)
            used = used.with_those(ratio)
            if tell is not None:
                tell("plan", leg.last / (len(route) - 1))
    if not parts:
        where = route.point_mm[0] if len(route) else np.zeros(3)
        parts.append(
            Motion.rest(where, float(route.dwell_s.sum()), int(route.line[0]) if len(route.line) else 0)
        )
    whole = Motion.joined(parts)
    return Trajectory(whole, limits, tuple(legs), with_jumps(whole, used))


def _check(route: Route, limits: AxisLimits) -> None:
    for name, values in (
        ("position", route.point_mm),
        ("tolerance", route.tolerance_mm),
        ("dwell", route.dwell_s),
    ):
        if not np.isfinite(values).all():
            raise CannotCompute(f"the route has a {name} that is not a finite number")
    if not (route.feed_mm_s > 0.0).all():
        line = int(route.line[np.flatnonzero(~(route.feed_mm_s > 0.0))[0]])
        raise CannotCompute(f"line {line} has no feed above 0, so it would never end")
    for name in AxisLimits.__slots__:
        values = getattr(limits, name)
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise CannotCompute(f"the {name} of an axis is not above 0")


def _with_stops(route: Route) -> Route:
    """The ends at rest, and the way-points where the path turns back on itself."""
    tolerance = route.tolerance_mm.copy()
    tolerance[:1] = tolerance[-1:] = 0.0
    tolerance[route.dwell_s > 0.0] = 0.0
    tolerance[needs_stop(route.point_mm)] = 0.0
    return replace(route, tolerance_mm=tolerance)


def _stretches(route: Route, limits: AxisLimits) -> Iterator[tuple[int, int, tuple[_Rival, ...]]]:
    """First and last way-point of what is planned together, and the solvers that may win there. Runs for
    which only one remains are often many and short: they go together."""
    stops = _stops(route)
    if len(stops) < 2:
        return
    seconds = _forecast(route, limits, stops)
    first, alone = 0, None
    for k, (begin, end) in enumerate(pairwise(stops.tolist())):
        rivals = _promising(seconds[:, k])
        only = rivals[0].solver if len(rivals) == 1 else None
        if alone is not None and (only is not alone or end - first > _TOGETHER):
            yield first, begin, (_Rival(alone, 0.0),)
            alone = None
        if only is None:
            yield begin, end, rivals
        elif alone is None:
            first, alone = begin, only
    if alone is not None:
        yield first, int(stops[-1]), (_Rival(alone, 0.0),)


def _to_optimise(stretches: list[tuple[int, int, tuple[_Rival, ...]]]) -> float:
    """About how many pieces there are to optimise."""
    return sum(
        _PIECES * (last - first) + rival.least_s / CELL_S
        for first, last, rivals in stretches
        for rival in rivals
        if rival.solver.bends
    )


def _stops(route: Route) -> Index:
    return np.flatnonzero((route.tolerance_mm == 0.0) | (route.dwell_s > 0.0))


def _forecast(route: Route, limits: AxisLimits, stops: Index) -> Array:
    """(s, r) seconds that each solver takes at least, or nearly so, for each run."""
    count = len(route) - 1
    each = np.empty((len(_SOLVERS), count))
    for a in range(0, count, _BLOCK):
        b = min(a + _BLOCK, count)
        # what comes before and behind matters to the ends of the block
        c, d = max(a - 1, 0), min(b + 1, count)
        some = Route(
            route.point_mm[c : d + 1], route.feed_mm_s[c:d], route.line[c:d], route.tolerance_mm[c : d + 1],
            route.dwell_s[c : d + 1],
        )  # fmt: skip
        for i, solver in enumerate(_SOLVERS):
            each[i, a:b] = solver.least_s(some, limits)[a - c : b - c]
    seconds: Array = np.add.reduceat(each, stops[:-1], axis=1)
    few = np.diff(stops) <= _FEW_SEGMENTS
    seconds[[solver.bends for solver in _SOLVERS]] += np.where(few, np.inf, 0.0)
    return seconds


def _promising(least_s: Array) -> tuple[_Rival, ...]:
    """The solvers that may win, the most promising first."""
    order = np.argsort(least_s, kind="stable").tolist()
    first = _SOLVERS[order[0]]
    # moves that stay straight take what is forecast; a path that bends may take far longer
    bar = np.inf if first.bends else float(least_s[order[0]]) / _SURE
    return tuple(_Rival(_SOLVERS[i], float(least_s[i])) for i in order if least_s[i] <= bar)


def _legs(
    route: Route, limits: AxisLimits, first: int, last: int, rivals: tuple[_Rival, ...], optimise: bool
) -> Iterator[tuple[list[Motion], Leg, Ratios]]:
    """The stretch from one stop to another, in one leg; run by run where no solver finds that."""
    inner = slice(first, last + 1)
    dwell = route.dwell_s[inner].copy()
    dwell[[0, -1]] = 0.0
    # pieces are named by their segment while feeds are audited, by their line afterwards
    run = Run(
        Route(
            route.point_mm[inner], route.feed_mm_s[first:last], np.arange(last - first),
            route.tolerance_mm[inner], dwell,
        ),
        limits,
    )  # fmt: skip
    found = _fastest(run, rivals, optimise)
    if found is not None:
        yield _with_rests(route, first, last, found)
        return
    stops = first + _stops(run.route)
    if len(stops) <= 2:
        raise CannotCompute(f"no solver found a motion along line {int(route.line[first])}")
    for begin, end in pairwise(stops.tolist()):
        yield from _legs(route, limits, begin, end, rivals, optimise)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A valid motion, slowed down by `factor` where it has to be, and what it uses of the limits."""

    motion: Motion
    solver: str
    factor: float
    ratios: Ratios
    deviation_mm: float

    @property
    def duration_s(self) -> float:
        return self.motion.duration_s * self.factor


def _fastest(run: Run, rivals: tuple[_Rival, ...], optimise: bool) -> _Found | None:
    """The fastest of what the solvers find; those that were given no chance are asked when all else fails,
    and the last one then: stops everywhere are never the fastest."""
    best: _Found | None = None
    for rival in rivals:
        if best is None or rival.least_s < best.duration_s:
            best = _better(run, rival.solver, best)
    if optimise and best is not None and any(rival.solver.bends for rival in rivals):
        best = _optimised(run, best)
    asked = [rival.solver for rival in rivals]
    for solver in (*_SOLVERS, _LAST):
        if best is None and solver not in asked:
            best = _better(run, solver, best)
    return best


def _optimised(run: Run, best: _Found) -> _Found:
    """The motion of optimised speed where it may be faster."""
    try:
        path, profile = run.path(), run.profile()
    except CannotCompute:
        return best
    bound, closed = bound_s(path, run.limits), critical.seconds(path, profile)
    if bound + _LEFT * (closed - bound) > (1.0 - _GAIN) * best.duration_s:
        return best
    solver = Solver(OPTIMISED, lambda run: optimised(path, run.limits, profile), _LAST.least_s, bends=True)
    return _better(run, solver, best) or best


def _better(run: Run, solver: Solver, best: _Found | None) -> _Found | None:
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
    return _Found(motion, solver.name, factor, used.slowed(factor), float(deviation.max(initial=0.0)))


def _with_rests(route: Route, first: int, last: int, found: _Found) -> tuple[list[Motion], Leg, Ratios]:
    """The leg of a motion, with the dwell at its end, and that at its start if it is the first."""
    motion = found.motion if found.factor == 1.0 else found.motion.slowed(found.factor)
    parts = [replace(motion, line=route.line[first:last][motion.line])]
    wait = 0.0
    if first == 0 and route.dwell_s[0] > 0.0:
        wait += float(route.dwell_s[0])
        parts.insert(0, Motion.rest(route.point_mm[0], wait, int(route.line[0])))
    if route.dwell_s[last] > 0.0:
        wait += float(route.dwell_s[last])
        parts.append(Motion.rest(route.point_mm[last], float(route.dwell_s[last]), int(route.line[last - 1])))
    leg = Leg(first, last, found.solver, found.duration_s + wait, found.factor, found.deviation_mm)
    return parts, leg, found.ratios


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
    except (ArithmeticError, ValueError, IndexError, CannotCompute):
        return None
    sound = np.isfinite(motion.time).all() and (np.diff(motion.start_s) >= 0.0).all()
    return motion if sound else None


class Run:
    """A route from rest to rest and its limits, and what several solvers make of it: its smooth path."""

    def __init__(self, route: Route, limits: AxisLimits) -> None:
        self.route = route
        self.limits = limits
        self._path: SmoothPath | None = None
        self._profile: critical.Profile | None = None

    def path(self) -> SmoothPath:
        """Raises CannotCompute where the run stops on its way."""
        if self._path is None:
            self._path = smooth(self.route, self.limits)
        return self._path

    def profile(self) -> critical.Profile:
        """Speeds in closed form along the path; raises as that."""
        if self._profile is None:
            self._profile = critical.best_profile(self.path(), self.limits)
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
class _Rival:
    """A solver, and the seconds that it is expected to take at least."""

    solver: Solver
    least_s: float


_SOLVERS = (
    Solver(
        OVERLAP,
        lambda run: overlap(run.route, run.limits),
        least_s,
        bends=False,
    ),
    Solver(
        CRITICAL,
        lambda run: critical.driven(run.path(), run.profile()),
        lambda route, limits: _AT_BEST * critical.expected_s(route, limits),
        bends=True,
    ),
)
#: stops everywhere: what is left where the others fail
_LAST = Solver(
    EXACT_STOP,
    lambda run: overlap(replace(run.route, tolerance_mm=np.zeros(len(run.route))), run.limits),
    least_s,
    bends=False,
)
