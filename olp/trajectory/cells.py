"""Cells of time of a tube: where its spline has knots, and the segment of each cell between them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import CannotCompute
from olp.trajectory.motion import Motion
from olp.trajectory.passing import passing_s
from olp.trajectory.route import AxisLimits, Route

#: cells of a segment at least; a run that would have too many has fewer of each, and ...
_OF_SEGMENT = (16, 12, 8)
#: ... of the whole, where they are no shorter than ...
_OF_WHOLE = 48
#: ... this share of the time in which the jerk moves an axis by the tolerance
_FINEST = 1.4
#: share of that time below which no cell is halved
_HALVED = 0.5
#: knots of the motion closer than this share of a cell are one, and so are waypoints of a step
_SAME = 0.25
#: both ends of a step are reached at one place where it is no longer than this times their tolerance
_BOTH = 1.5
#: cells at most: a run that needs more by its forecast is left as it is, and one that needs twice as many
MOST_CELLS = 780
#: cells at least: all coefficients of fewer are those of the ends
_FEWEST = 4
#: s; a segment that is passed in less has no cell of its own
_LEAST_S = 1e-7


def cells_of(lasts: Array, tolerance_mm: Array, limits: AxisLimits, stops: Index) -> Array:
    """(r,) about the cells of runs from each of the `stops` to the next, whose segments last so long between
    waypoints of tolerances (n,)."""
    share = lasts / _finest_s(tolerance_mm, limits)
    each = [np.add.reduceat(np.ceil(np.minimum(share, most)), stops[:-1]) for most in _OF_SEGMENT]
    return np.select([count <= MOST_CELLS for count in each], each, each[-1])


def knots(route: Route, limits: AxisLimits, motion: Motion) -> tuple[Array, Index]:
    """Knots (m + 1,) s, and the segment (m,) of each cell: where the motion passes waypoints, and where its
    own cubics meet, and between so many that no cell is too long. Raises CannotCompute."""
    passed = _at_once(route, passing_s(route, motion))
    finest_s = _finest_s(route.tolerance_mm, limits)
    for count in _OF_SEGMENT:
        most = np.minimum(np.diff(passed) / count, passed[-1] / _OF_WHOLE)
        knot_s, segment = _between(passed, np.maximum(most, finest_s), motion)
        if len(segment) <= 2 * MOST_CELLS:
            break
    else:
        raise CannotCompute("the run is too long")
    if len(segment) < _FEWEST:
        raise CannotCompute("the run has too few cells")
    knot_s[0], knot_s[-1] = 0.0, float(passed[-1])
    return np.array(knot_s), np.array(segment, np.int64)


def _between(passed: Array, most: Array, motion: Motion) -> tuple[list[float], list[int]]:
    """Knots and the segments of their cells, no cell of a segment longer than `most` (n - 1,) s."""
    # only cubics of time meet at knots of a spline
    own = motion.start_s if motion.cubic else passed
    knot_s, segment = [0.0], []
    for k in np.flatnonzero(np.diff(passed) > _LEAST_S).tolist():
        begin, end, gap = float(passed[k]), float(passed[k + 1]), _SAME * float(most[k])
        edges = [begin]
        for time in own[np.searchsorted(own, begin + gap) : np.searchsorted(own, end - gap)].tolist():
            if time - edges[-1] > gap:
                edges.append(time)
        edges.append(end)
        for a, b in pairwise(edges):
            count = max(math.ceil((b - a) / most[k] - 1e-9), 1)
            knot_s += [a + (b - a) * i / count for i in range(1, count)] + [b]
            segment += [k] * count
    return knot_s, segment


def halved(
    route: Route, limits: AxisLimits, knot_s: Array, segment: Index, rough: Mask
) -> tuple[Array, Index] | None:
    """The knots and segments with the `rough` (m,) cells halved, where they are not the shortest; None where
    all are."""
    least = _HALVED * _finest_s(route.tolerance_mm, limits)[segment]
    cell = np.flatnonzero(rough & (np.diff(knot_s) > 2.0 * least))
    if not len(cell) or len(segment) + len(cell) > 2 * MOST_CELLS:
        return None
    middle = 0.5 * (knot_s[cell] + knot_s[cell + 1])
    return np.insert(knot_s, cell + 1, middle), np.insert(segment, cell, segment[cell])


def _at_once(route: Route, passed: Array) -> Array:
    """(n,) times at which waypoints are passed. Both ends of a step inside the tolerance are passed at once
    where it lasts a small share of the segments beside it: a cell of such a step is too short."""
    lasts = np.diff(passed)
    step = np.diff(route.point_mm, axis=0)
    least = np.minimum(route.tolerance_mm[:-1], route.tolerance_mm[1:])
    inside = np.sqrt((step * step).sum(axis=1)) <= _BOTH * least
    beside = np.minimum(np.append(np.inf, lasts[:-1]), np.append(lasts[1:], np.inf))
    # the first and the last step end at rests
    inside[[0, -1]] = False
    short = np.flatnonzero(inside & (lasts < _SAME * beside))
    passed = passed.copy()
    passed[short] = passed[short + 1] = 0.5 * (passed[short] + passed[short + 1])
    return passed


def _finest_s(tolerance_mm: Array, limits: AxisLimits) -> Array:
    """(n - 1,) the shortest cells of segments between waypoints of tolerances (n,)."""
    wide = np.maximum(tolerance_mm[:-1], tolerance_mm[1:])
    return np.asarray(np.maximum(_FINEST * np.cbrt(wide / limits.jerk.max()), _LEAST_S))
