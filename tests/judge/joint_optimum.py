"""The fastest motion inside the tube around a planar polyline: path and speed found together.

The motion is cut in steps of constant jerk. Steps belong to spans, all steps of a span last equally long, and
those lengths are unknowns, too. Limits and tube are convex, only the lengths of the steps make it otherwise:
a sequence of linear programs solves it, each linear about the one before. The last has fixed lengths, so that
it is exact and what it finds is a motion. So the result is never below the optimum, and above it by no more
than the steps are too coarse, or by a better motion elsewhere. It shares no code with the planner.

The tube: no place farther than the tolerance from its own segment, and each waypoint no farther than that
from the place where the motion goes over to the next segment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array

#: share by which the length of a step may change at first, the share of it after a poor program, and where
#: the search ends
_TRUST, _SHRINK, _STILL = 0.2, 0.4, 2e-3
#: share of the duration below which a gain is none
_GAIN = 3e-5
#: programs at most
_ROUNDS = 40
#: shares of the duration by which the exact program may be slower than the linear ones
_MARGINS = (1e-5, 3e-4, 3e-3)
#: directions in which the ends of a segment's tube are cut, from that of the segment, and of the feed
_CAP = np.radians([-60.0, -30.0, 0.0, 30.0, 60.0])
_INSIDE = np.cos(np.radians(15.0))
_FEED = np.radians([-60.0, -37.5, -22.5, -7.5, 0.0, 7.5, 22.5, 37.5, 60.0])
#: directions around a waypoint
_ROUND = np.arange(64) * (2 * np.pi / 64)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A polyline `point_mm` (n, 2) from rest to rest; the tolerance; limits of each axis (2,); feed."""

    point_mm: np.ndarray
    tolerance_mm: float
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray
    feed_mm_s: float = np.inf


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """`step_s` (k,), `segment` (k,) and `jerk` (k, 2) of each step; `position_mm` (k + 1, 2), `velocity` and
    `acceleration` between steps."""

    step_s: np.ndarray
    segment: np.ndarray
    jerk: np.ndarray
    position_mm: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @property
    def duration_s(self) -> float:
        return float(self.step_s.sum())


def optimum(case: Case, passes_s: np.ndarray, steps: int, spans: int) -> Found:
    """The fastest motion found, from times (n,) at which a slower one passes the waypoints: each segment is
    cut in `spans` spans of `steps` equal steps. Raises ValueError where there is none near those times."""
    lasts = np.diff(passes_s)
    segment = np.repeat(np.arange(len(lasts)), steps * spans)
    span = np.arange(len(segment)) // steps
    step = np.repeat(lasts / (steps * spans), spans)
    state: Found | None = None
    # a motion along the polyline first, then the same with free lengths
    for slack in (1.0, 1.1, 1.3, 1.7, 2.5, 4.0):
        state = _program(case, segment, span, step * slack, None, 0.0)
        if state is not None:
            step = step * slack
            break
    if state is None:
        raise ValueError("no motion near these times")
    trust, best = _TRUST, state
    for _ in range(_ROUNDS):
        linear = _program(case, segment, span, step, best, trust)
        if linear is not None and linear.duration_s > best.duration_s * (1.0 - _GAIN):
            break
        exact = None if linear is None else _exact(case, segment, span, linear.step_s[::steps], best)
        if exact is None:
            trust *= _SHRINK
        else:
            best, step = exact, exact.step_s[::steps]
        if trust < _STILL:
            break
    return best


def _exact(case: Case, segment: np.ndarray, span: np.ndarray, step: np.ndarray, best: Found) -> Found | None:
    """A motion with steps of these lengths, or a little longer, that is faster than the best."""
    for margin in _MARGINS:
        longer = step * (1.0 + margin)
        if longer[span].sum() > best.duration_s * (1.0 - _GAIN):
            return None
        found = _program(case, segment, span, longer, None, 0.0)
        if found is not None:
            return found
    return None


class _Rows:
    """A linear program's rows."""

    def __init__(self) -> None:
        self.row, self.column, self.value, self.bound, self.count = [], [], [], [], 0

    def add(self, columns: list[np.ndarray], values: list, bound) -> None:
        """Rows of as many terms as columns, one row per entry."""
        rows = self.count + np.arange(len(columns[0]))
        for column, value in zip(columns, values, strict=True):
            self.row.append(rows)
            self.column.append(column)
            self.value.append(np.broadcast_to(value, rows.shape))
        self.bound.append(np.broadcast_to(bound, rows.shape))
        self.count += len(rows)

    def matrix(self, width: int):
        parts = [np.concatenate(some) for some in (self.value, self.row, self.column)]
        return coo_array((parts[0], (parts[1], parts[2])), (self.count, width)).tocsr()


def _program(case, segment, span, step, around: Found | None, trust: float) -> Found | None:
    """One linear program about a motion; exact, with steps of the lengths given, about none."""
    k = len(segment)
    h = step[span]
    knots, kinds = k + 1, (case.velocity, case.acceleration, case.jerk)
    # per axis: positions, then velocities, accelerations and jerks as shares of their limits; then lengths
    at = {(axis, kind): (4 * axis + kind) * knots + np.arange(knots) for axis in (0, 1) for kind in range(4)}
    length = 8 * knots + np.arange(len(step))
    width = 8 * knots + len(step)
    low, high = np.full(width, -1.0), np.full(width, 1.0)
    equal = _Rows()
    lasts, now, then = length[span], slice(0, k), slice(1, k + 1)
    for axis in (0, 1):
        v, a, j = (float(kind[axis]) for kind in kinds)
        p, vs, as_, js = (at[axis, kind] for kind in range(4))
        low[p], high[p] = -np.inf, np.inf
        zero = np.zeros((3, k))
        if around is not None:
            vb, ab, jb = around.velocity[:-1, axis], around.acceleration[:-1, axis], around.jerk[:, axis]
            zero = np.array([vb + h * (ab + h * jb / 2), ab + h * jb, jb])
        # a length is 1 + its unknown
        d1, d2, d3 = zero * h
        equal.add([p[then], p[now], vs[now], as_[now], js[now], lasts],
                  [1.0, -1.0, -v * h, -a * h**2 / 2, -j * h**3 / 6, -d1], 0.0)  # fmt: skip
        equal.add([vs[then], vs[now], as_[now], js[now], lasts],
                  [1 / h, -1 / h, -a / v, -j * h / v / 2, -d2 / v / h], 0.0)  # fmt: skip
        equal.add([as_[then], as_[now], js[now], lasts], [1 / h, -1 / h, -j / a, -d3 / a / h], 0.0)
        for end, place in ((0, 0), (k, -1)):
            low[p[end]] = high[p[end]] = case.point_mm[place, axis]
            for some in (vs, as_):
                low[some[end]] = high[some[end]] = 0.0
    low[length], high[length] = -trust, trust
    most = _tube(case, segment, h, at)
    cost = np.zeros(width)
    np.add.at(cost, lasts, h / h.sum())
    solved = linprog(
        cost, most.matrix(width), np.concatenate(most.bound), equal.matrix(width),
        np.concatenate(equal.bound), np.column_stack((low, high)), method="highs-ipm",
        options={"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-8},
    )  # fmt: skip
    if solved.status != 0:
        return None
    x = solved.x
    p, v, a, j = (
        np.column_stack([x[at[axis, kind]] * scale[axis] for axis in (0, 1)])
        for kind, scale in enumerate((np.ones(2), *kinds))
    )
    return Found(h * (1 + x[lasts]), segment, j[:-1], p, v, a)


def _tube(case: Case, segment: np.ndarray, h: np.ndarray, at) -> _Rows:
    """The rows of the tube and the feed. A step is inside where the control points of its cubic are."""
    most = _Rows()
    point, tolerance = case.point_mm, case.tolerance_mm
    along = np.diff(point, axis=0)
    angle = np.arctan2(along[:, 1], along[:, 0])
    scale = np.array([np.ones(2), case.velocity, case.acceleration])
    steps = np.arange(len(segment))

    def beyond(direction, place, reach, k, terms) -> None:
        """Along a direction, the sum of `terms` (order, factor) of the state at `k` is at most so far."""
        normal = np.column_stack((np.cos(direction), np.sin(direction)))
        columns = [at[axis, order][k] for order, _ in terms for axis in (0, 1)]
        values = [normal[:, axis] * scale[order, axis] * factor for order, factor in terms for axis in (0, 1)]
        most.add(columns, values, (normal * place).sum(axis=1) + reach)

    own, begin, end = angle[segment], point[segment], point[segment + 1]
    cubic = (
        (steps, ((0, 1.0),)), (steps, ((0, 1.0), (1, h / 3))),
        (steps, ((0, 1.0), (1, 2 * h / 3), (2, h * h / 6))), (steps + 1, ((0, 1.0),)),
    )  # fmt: skip
    for k, terms in cubic:
        for side in (-np.pi / 2, np.pi / 2):
            beyond(own + side, begin, tolerance, k, terms)
        for turn in _CAP:
            # inside the round end
            beyond(own + turn, end, tolerance * _INSIDE, k, terms)
            beyond(own + np.pi + turn, begin, tolerance * _INSIDE, k, terms)
    for k, terms in ((steps, ((1, 1.0),)), (steps, ((1, 1.0), (2, h / 2)))):
        for turn in _FEED if np.isfinite(case.feed_mm_s) else ():
            beyond(own + turn, 0.0 * begin, case.feed_mm_s, k, terms)
    quadratic = ((1, 1.0), (2, h / 2))
    for turn in np.arange(4) * (np.pi / 2):
        axis = int(abs(np.sin(turn)) > 0.5)
        beyond(np.full(len(h), turn), 0.0 * begin, case.velocity[axis], steps, quadratic)
    passed = 1 + np.flatnonzero(np.diff(segment))
    for turn in _ROUND:
        reach = tolerance * np.cos(np.pi / len(_ROUND))
        beyond(np.full(len(passed), turn), point[segment[passed]], reach, passed, ((0, 1.0),))
    return most
