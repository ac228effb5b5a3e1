"""From a route to the fastest audited motion that any solver finds for each of its runs.

A run goes from one way-point at rest to the next. Every candidate is audited, and slowed down as a whole
where it would exceed a limit, so a solver can make a run slow but never wrong; one that fails is left out,
and the exact stop at every way-point always remains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from olp.exceptions import CannotCompute
from olp.trajectory.audit import Audit, audit, path_deviation, slowing
from olp.trajectory.critical import critical
from olp.trajectory.motion import Array, Index, Motion
from olp.trajectory.overlap import overlap
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.smooth import needs_stop, smooth

Progress = Callable[[str, float], None]

#: a limit may be touched; so much above it is rounding
_ROUNDING = 1e-9
#: ways that the planner knows to drive a run, and how they are named in a report
OVERLAP, CRITICAL, EXACT_STOP = "overlapped moves", "critical points", "exact stops"
#: runs with fewer segments than this between stops are straight moves to the overlapping solver
_FEW_SEGMENTS = 2


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


def plan(route: Route, limits: AxisLimits, tell: Progress | None = None) -> Trajectory:
    """The motion of a route that begins and ends at rest. Raises CannotCompute for a route that is not
    finite."""
    _check(route, limits)
    route = _with_stops(route)
    stops = np.flatnonzero((route.tolerance_mm == 0.0) | (route.dwell_s > 0.0))
    parts: list[Motion] = []
    legs: list[Leg] = []
    at = 0
    edges = stops.tolist()
    while at < len(edges) - 1:
        to = at + 1
        # runs of few segments are planned together: they are many, and a call costs more than a move
        while to < len(edges) - 1 and edges[to + 1] - edges[to] <= _FEW_SEGMENTS >= edges[at + 1] - edges[at]:
            to += 1
        motion, leg = _leg(route, limits, edges[at], edges[to])
        parts.append(motion)
        legs.append(leg)
        at = to
        if tell is not None:
            tell("plan", edges[at] / max(edges[-1], 1))
    if not parts:
        where = route.point_mm[0] if len(route) else np.zeros(3)
        parts.append(
            Motion.rest(where, float(route.dwell_s.sum()), int(route.line[0]) if len(route.line) else 0)
        )
    motion = Motion.joined(parts)
    return Trajectory(motion, limits, tuple(legs), audit(motion, limits))


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


def _leg(route: Route, limits: AxisLimits, first: int, last: int) -> tuple[Motion, Leg]:
    """The fastest of what the solvers find from one stop to another, with the dwell at its end."""
    inner = slice(first, last + 1)
    dwell = route.dwell_s[inner].copy()
    dwell[[0, -1]] = 0.0
    # pieces are named by their segment while feeds are audited, by their line afterwards
    run = Route(
        route.point_mm[inner], route.feed_mm_s[first:last], np.arange(last - first),
        route.tolerance_mm[inner], dwell,
    )  # fmt: skip
    best: tuple[float, float, str, Motion, float] | None = None
    for name, solve in _SOLVERS:
        # stops everywhere are never the fastest
        motion = solve(run, limits) if best is None or solve is not _exact else None
        if motion is None:
            continue
        deviation = path_deviation(motion, run, motion.line)
        if (deviation > _allowed(run)[motion.line]).any():
            continue
        factor = slowing(audit(motion, limits, run.feed_mm_s[motion.line]))
        factor = factor if factor > 1.0 + _ROUNDING else 1.0
        time = motion.duration_s * factor
        if best is None or time < best[0]:
            best = (time, factor, name, motion, float(deviation.max(initial=0.0)))
    if best is None:
        raise CannotCompute(f"no solver found a motion along line {int(route.line[first])}")
    time, factor, name, motion, away = best
    if factor > 1.0:
        motion = motion.slowed(factor)
    motion = replace(motion, line=route.line[first:last][motion.line])
    wait = float(route.dwell_s[last] + (route.dwell_s[0] if first == 0 else 0.0))
    leg = Leg(first, last, name, time + wait, factor, away)
    rests = []
    if first == 0 and route.dwell_s[0] > 0.0:
        rests.append(Motion.rest(route.point_mm[0], float(route.dwell_s[0]), int(route.line[0])))
    rests.append(motion)
    if route.dwell_s[last] > 0.0:
        rests.append(Motion.rest(route.point_mm[last], float(route.dwell_s[last]), int(route.line[last - 1])))
    return (Motion.joined(rests) if len(rests) > 1 else motion), leg


def _allowed(run: Route) -> Array:
    """(n - 1,) how far the path may be from the polyline along each segment: what the way-points near it
    allow, and rounding."""
    tolerance = np.concatenate((np.zeros(2), run.tolerance_mm, np.zeros(2)))
    near = [tolerance[i : len(run) - 1 + i] for i in range(6)]
    return np.asarray(np.max(near, axis=0) * (1.0 + 1e-6) + 1e-9)


def _overlapped(run: Route, limits: AxisLimits) -> Motion | None:
    return _tried(lambda: overlap(run, limits))


def _critical(run: Route, limits: AxisLimits) -> Motion | None:
    if len(run) - 1 <= _FEW_SEGMENTS or not (run.tolerance_mm[1:-1] > 0.0).all():
        return None
    return _tried(lambda: critical(smooth(run, limits), limits))


def _exact(run: Route, limits: AxisLimits) -> Motion | None:
    """Stops everywhere: what is left where the others fail."""
    return _tried(lambda: overlap(replace(run, tolerance_mm=np.zeros(len(run))), limits))


def _tried(solve: Callable[[], Motion]) -> Motion | None:
    """A solver that fails leaves the field to the others."""
    try:
        motion = solve()
    except (ArithmeticError, ValueError, IndexError, CannotCompute):
        return None
    sound = np.isfinite(motion.time).all() and (np.diff(motion.start_s) >= 0.0).all()
    return motion if sound else None


_SOLVERS = ((OVERLAP, _overlapped), (CRITICAL, _critical), (EXACT_STOP, _exact))
