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
from olp.trajectory.audit import Audit, Ratios, ratios, slowing, with_jumps
from olp.trajectory.critical import Profile, best_profile, driven, seconds
from olp.trajectory.deviation import deviation_bound
from olp.trajectory.forecast import expected_s
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
#: what a solver that fails may raise
_FAILURES = (ArithmeticError, ValueError, IndexError, CannotCompute)
#: short runs have no more segments; optimising one takes at least as long as this many pieces
_SHORT, _CALL = 64, 500


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
    stretches = _runs(route, limits)
    least = _least_to_optimise(stretches) if optimise is None else (0 if optimise else len(route))
    for stretch in _together(stretches, least):
        for motion, some, ratio in _legs(route, limits, stretch, least):
            parts.append(motion)
            legs += some
            used = used.with_those(ratio)
            if tell is not None:
                tell("plan", some[-1].last / (len(route) - 1))
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


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """What is planned together: way-points `first` to `last`, both at rest, in `runs`, and the solvers that
    may win there, the most promising first."""

    first: int
    last: int
    rivals: tuple[_Rival, ...]
    runs: int = 1

    @property
    def segments(self) -> int:
        return self.last - self.first

    @property
    def bends(self) -> bool:
        return any(rival.solver.bends for rival in self.rivals)

    def cost(self) -> float:
        """About how many pieces there are to optimise."""
        if not self.bends:
            return 0.0
        return _CALL + _PIECES * self.segments + max(rival.least_s for rival in self.rivals) / CELL_S


def _runs(route: Route, limits: AxisLimits) -> list[_Stretch]:
    stops = _stops(route)
    if len(stops) < 2:
        return []
    least_s = _forecast(route, limits, stops).T
    return [
        _Stretch(begin, end, _promising(some))
        for (begin, end), some in zip(pairwise(stops.tolist()), least_s, strict=True)
    ]


def _least_to_optimise(runs: list[_Stretch]) -> int:
    """The fewest segments of a run that is worth optimising, within what is afforded in all."""
    long = sum(run.cost() for run in runs if run.segments > _SHORT)
    short = sum(run.cost() for run in runs if run.segments <= _SHORT)
    if long + short <= _AFFORDED:
        return 0
    return _SHORT + 1 if long <= _AFFORDED else max(run.last for run in runs) + 1


def _together(runs: list[_Stretch], least: int) -> Iterator[_Stretch]:
    """The runs, those joined that stay straight or are short and not to be optimised: they may be many."""
    group: _Stretch | None = None
    for run in runs:
        small = not run.bends or run.segments < min(least, _SHORT + 1)
        if group is not None and (not small or run.last - group.first > _TOGETHER):
            yield group
            group = None
        if not small:
            yield run
        elif group is None:
            group = run
        else:
            rivals = group.rivals if len(group.rivals) >= len(run.rivals) else run.rivals
            group = _Stretch(group.first, run.last, rivals, group.runs + 1)
    if group is not None:
        yield group


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
    route: Route, limits: AxisLimits, stretch: _Stretch, least: int
) -> Iterator[tuple[Motion, list[Leg], Ratios]]:
    """The motion of a stretch and the legs it is made of; run by run where a solver fails on the whole."""
    first, last = stretch.first, stretch.last
    inner = slice(first, last + 1)
    # pieces are named by their segment while feeds are audited, by their line afterwards
    run = Run(
        Route(
            route.point_mm[inner], route.feed_mm_s[first:last], np.arange(last - first),
            route.tolerance_mm[inner], np.zeros(last - first + 1),
        ),
        limits,
    )  # fmt: skip
    if stretch.runs == 1 or len(stretch.rivals) == 1:
        found = _fastest(run, stretch.rivals, stretch.segments >= least and stretch.runs == 1)
        chosen = [] if found is None else [(0, last - first, found)]
    else:
        chosen = _contest(run, stretch.rivals)
    if chosen:
        motion = chosen[0][2].driven() if len(chosen) == 1 else _mixed(chosen)
        legs = [
            Leg(first + a, first + b, found.solver, found.duration_s, found.factor, found.deviation_mm)
            for a, b, found in chosen
        ]
        used = chosen[0][2].ratios
        for _, _, found in chosen[1:]:
            used = used.with_those(found.ratios)
        yield _with_dwells(route, first, last, motion), _waiting(route, legs), used
        return
    stops = first + _stops(run.route)
    if len(stops) <= 2:
        raise CannotCompute(f"no solver found a motion along line {int(route.line[first])}")
    for begin, end in pairwise(stops.tolist()):
        yield from _legs(route, limits, _Stretch(begin, end, stretch.rivals), least)


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

    def driven(self) -> Motion:
        return self.motion if self.factor == 1.0 else self.motion.slowed(self.factor)


def _contest(run: Run, rivals: tuple[_Rival, ...]) -> list[tuple[int, int, _Found]]:
    """First and last way-point of runs that one solver drives best, one after the other; none where a solver
    fails, or has to be slowed down because of one run."""
    all_found = [_better(run, rival.solver, None) for rival in rivals]
    candidates = [found for found in all_found if found is not None and found.factor == 1.0]
    if len(candidates) < len(rivals):
        return []
    stops = _stops(run.route)
    of_run = [np.searchsorted(stops, found.motion.line, side="right") - 1 for found in candidates]
    seconds = np.stack([
        np.bincount(of, np.diff(found.motion.start_s), minlength=len(stops) - 1)
        for of, found in zip(of_run, candidates, strict=True)
    ])  # fmt: skip
    winner = np.argmin(seconds, axis=0)
    edges = np.concatenate(([0], 1 + np.flatnonzero(np.diff(winner)), [len(winner)]))
    out = []
    for a, b in pairwise(edges.tolist()):
        found, of = candidates[winner[a]], of_run[winner[a]]
        pieces = slice(int(np.searchsorted(of, a)), int(np.searchsorted(of, b)))
        out.append((int(stops[a]), int(stops[b]), replace(found, motion=found.motion.part(pieces))))
    return out


def _mixed(chosen: list[tuple[int, int, _Found]]) -> Motion:
    return Motion.joined([found.motion for _, _, found in chosen])


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
    except _FAILURES:
        return best
    bound, closed = bound_s(path, run.limits), seconds(path, profile)
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


def _with_dwells(route: Route, first: int, last: int, motion: Motion) -> Motion:
    """The motion of a stretch with its rests, and the lines of the program."""
    line = route.line[first:last][motion.line]
    waits = _dwells(route, first, last)
    if not waits.size:
        return replace(motion, line=line)
    seconds = route.dwell_s[waits]
    at = np.searchsorted(motion.line, waits - first)
    still = np.zeros((len(waits), 4, 3))
    still[:, 0] = route.point_mm[waits]
    lasts = np.insert(np.diff(motion.start_s), at, seconds)
    return Motion(
        np.concatenate(([0.0], np.cumsum(lasts))),
        np.insert(motion.time, at, 0.0, axis=0),
        np.concatenate((motion.path, still)),
        np.insert(motion.shape, at, len(motion.path) + np.arange(len(waits))),
        # a dwell belongs to the line that ends there; the one before the first move, to the first
        np.insert(line, at, route.line[np.maximum(waits - 1, 0)]),
    )


def _dwells(route: Route, first: int, last: int) -> Index:
    """Way-points with a dwell of a stretch: that at its start belongs to the one before."""
    begin = first if first == 0 else first + 1
    return np.asarray(begin + np.flatnonzero(route.dwell_s[begin : last + 1] > 0.0))


def _waiting(route: Route, legs: list[Leg]) -> list[Leg]:
    """The legs with the time that they wait."""
    waits = [float(route.dwell_s[_dwells(route, leg.first, leg.last)].sum()) for leg in legs]
    return [
        replace(leg, duration_s=leg.duration_s + wait) if wait else leg
        for leg, wait in zip(legs, waits, strict=True)
    ]


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
        lambda run: driven(run.path(), run.profile()),
        lambda route, limits: _AT_BEST * expected_s(route, limits),
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
