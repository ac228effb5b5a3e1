"""From a route to the fastest audited motion that any solver finds for each of its runs.

A run goes from one waypoint at rest to the next. A forecast (about a lower bound) of each solver's time
selects the solvers that can win. Every candidate is audited, and slowed down as a whole where it would exceed
a limit: a solver can make a run slow but never wrong. A solver that fails is dropped; exact stops at every
waypoint are always possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.progress import Progress
from olp.core.values import dataclass
from olp.trajectory.audit import Audit, Ratios, with_jumps
from olp.trajectory.contest import Solution, contest, fastest, improved, stops_of
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.searches import searched
from olp.trajectory.smooth import needs_stop
from olp.trajectory.solvers import Run
from olp.trajectory.stretches import Stretch, runs_of, together


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A stretch of a route that one solver drove: waypoints `first` to `last`, in `duration_s`, never
    farther than `deviation_mm` from the polyline; `factor` is by how much the audit slowed it down.
    `not_faster` says why a search in a tube found no faster motion, where one was made in vain."""

    first: int
    last: int
    solver: str
    duration_s: float
    factor: float
    deviation_mm: float
    not_faster: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """The motion of a whole program within `limits`, the legs in which it was planned, and its audit."""

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


def plan(
    route: Route, limits: AxisLimits, tell: Progress | None = None, *, optimise: bool | None = None,
    tubes: bool = True, share: float = 1.0,
) -> Trajectory:  # fmt: skip
    """The motion of a route that begins and ends at rest.

    `optimise`: whether speeds along dense curves are optimised; None: where that is worth its work, as
    `olp.trajectory.searches` finds.
    `tubes`: whether path and speed may be planned together where that gains most.
    `share`: of the work that searches afford, as a program of several routes affords no more than one.
    Raises CannotCompute for a route that is not finite.
    """
    _check(route, limits)
    route = with_stops(route)
    legs: list[Leg] = []
    none = np.zeros_like(limits.velocity)
    used = [Ratios(none, none, none, 0.0)]

    def parts() -> Iterator[Motion]:
        runs = runs_of(route, limits, tubes=share if tubes and optimise is not False else 0.0)
        known: dict[int, Solution] = {}
        if optimise is None:
            # a run is tried with and without a tube, which begins from the motion without
            bare: dict[int, Solution | None] = {}
            runs, known = searched(
                runs, len(route), lambda run: _solution(route, limits, run, bare),
                lambda run: _in_group(route, limits, run), share,
            )  # fmt: skip
        elif optimise:
            runs = [replace(run, optimise=True) for run in runs]
        for stretch in together(runs):
            for motion, some, ratio in _legs(route, limits, stretch, known):
                legs.extend(some)
                used[0] = used[0].with_those(ratio)
                yield motion
                if tell is not None:
                    tell("plan", some[-1].last / (len(route) - 1))
        if not runs:
            where = route.point_mm[0] if len(route) else none
            line = int(route.line[0]) if len(route.line) else 0
            yield Motion.rest(where, float(route.dwell_s.sum()), line)

    whole = Motion.joined(parts())
    return Trajectory(whole, limits, tuple(legs), with_jumps(whole, used[0]))


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
        raise CannotCompute("this line has no feed above 0, so it would never end", line=line)
    for name in AxisLimits.__slots__:
        values = getattr(limits, name)
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise CannotCompute(f"the {name} of an axis is not above 0")


def with_stops(route: Route) -> Route:
    """The route with rests at its ends, at dwells, and at waypoints where the path turns back on itself."""
    tolerance = route.tolerance_mm.copy()
    tolerance[:1] = tolerance[-1:] = 0.0
    tolerance[route.dwell_s > 0.0] = 0.0
    tolerance[needs_stop(route.point_mm)] = 0.0
    return replace(route, tolerance_mm=tolerance)


def _legs(
    route: Route, limits: AxisLimits, stretch: Stretch, known: Mapping[int, Solution]
) -> Iterator[tuple[Motion, list[Leg], Ratios]]:
    """The motion of a stretch, its legs and its ratios; run by run where all solvers fail on the whole. The
    solutions of some runs are `known` by their first waypoint."""
    first, last = stretch.first, stretch.last
    if stretch.runs == 1 or len(stretch.candidates) == 1:
        alone = stretch.runs == 1 and first in known
        solution = known[first] if alone else _solution(route, limits, stretch, {})
        chosen = [] if solution is None else [(0, last - first, solution)]
    else:
        chosen = contest(_run(route, limits, stretch), stretch.candidates)
    if chosen:
        motion = Motion.joined(solution.driven() for _, _, solution in chosen)
        legs = [
            Leg(
                first + a,
                first + b,
                solution.solver,
                solution.duration_s,
                solution.factor,
                solution.deviation_mm,
                solution.not_faster,
            )
            for a, b, solution in chosen
        ]
        used = chosen[0][2].ratios
        for _, _, solution in chosen[1:]:
            used = used.with_those(solution.ratios)
        yield _with_dwells(route, first, last, motion), _waiting(route, legs), used
        return
    stops = first + stops_of(_run(route, limits, stretch).route)
    if len(stops) <= 2:
        raise CannotCompute("no solver found a motion along this line", line=int(route.line[first]))
    for begin, end in pairwise(stops.tolist()):
        yield from _legs(route, limits, Stretch(begin, end, stretch.candidates), known)


def _run(route: Route, limits: AxisLimits, stretch: Stretch) -> Run:
    """What a stretch drives, without dwells. Pieces carry their segment while feeds are audited, their line
    afterwards."""
    first, last = stretch.first, stretch.last
    inner = slice(first, last + 1)
    own = Route(
        route.point_mm[inner], route.feed_mm_s[first:last], np.arange(last - first),
        route.tolerance_mm[inner], np.zeros(last - first + 1),
    )  # fmt: skip
    return Run(own, limits)


def _solution(
    route: Route, limits: AxisLimits, stretch: Stretch, bare: dict[int, Solution | None]
) -> Solution | None:
    """The fastest motion of a stretch along which one solver drives, None where all fail. `bare` keeps what
    is found of optimised runs without a tube, by their first waypoint."""
    run = _run(route, limits, stretch)
    optimise = stretch.optimise and stretch.runs == 1
    if optimise and stretch.first in bare:
        solution = bare[stretch.first]
    else:
        solution = fastest(run, stretch.candidates, optimise)
        if optimise:
            bare[stretch.first] = solution
    return improved(run, solution) if solution is not None and stretch.tube else solution


def _in_group(route: Route, limits: AxisLimits, stretch: Stretch) -> Solution | None:
    """The solution of a run as it is among others that are planned together, None where all fail."""
    run = _run(route, limits, stretch)
    winners = contest(run, stretch.candidates) if len(stretch.candidates) > 1 else []
    return winners[0][2] if winners else fastest(run, stretch.candidates, False)


def _with_dwells(route: Route, first: int, last: int, motion: Motion) -> Motion:
    """The motion of a stretch with its dwells and the lines of the program."""
    line = route.line[first:last][motion.line]
    waits = _dwells(route, first, last)
    if not waits.size:
        return replace(motion, line=line)
    seconds = route.dwell_s[waits]
    index = np.searchsorted(motion.line, waits - first)
    still = np.zeros((len(waits), *motion.path.shape[1:]))
    still[:, 0] = route.point_mm[waits]
    lasts = np.insert(np.diff(motion.start_s), index, seconds)
    return Motion(
        np.concatenate(([0.0], np.cumsum(lasts))),
        np.insert(motion.time, index, 0.0, axis=0),
        np.concatenate((motion.path, still)),
        np.insert(motion.shape, index, len(motion.path) + np.arange(len(waits))),
        # a dwell belongs to the line that ends there; a dwell before the first move, to the first line
        np.insert(line, index, route.line[np.maximum(waits - 1, 0)]),
    )


def _dwells(route: Route, first: int, last: int) -> Index:
    """Waypoints of a stretch with a dwell; a dwell at its start belongs to the stretch before."""
    begin = first if first == 0 else first + 1
    return np.asarray(begin + np.flatnonzero(route.dwell_s[begin : last + 1] > 0.0))


def _waiting(route: Route, legs: list[Leg]) -> list[Leg]:
    """The legs, with their dwells in their durations."""
    waits = [float(route.dwell_s[_dwells(route, leg.first, leg.last)].sum()) for leg in legs]
    return [
        replace(leg, duration_s=leg.duration_s + wait) if wait else leg
        for leg, wait in zip(legs, waits, strict=True)
    ]
