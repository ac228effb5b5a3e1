"""Routes whose waypoints are moved within their tolerance so that the curvature changes little along them.

Steps of a correction, noise and rounding bend a dense path in both directions. Rounded one by one, each bend
takes the tolerance of its own waypoint. Spread along the path they are next to none.

What is made least is the sum of squares of third divided differences by the arc length, and of how far
waypoints are moved. That is a smoothing spline: C. H. Reinsch, "Smoothing by spline functions", Numerische
Mathematik 10 (1967). Waypoints that would leave their room are held more firmly, until none does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded

from olp.core.arrays import Array, Mask
from olp.trajectory.route import AxisLimits, Route

#: share of a tolerance by which a waypoint may be moved
_SHARE = 0.6
#: the path is made even over so many times the length that is passed in the time in which the jerk moves an
#: axis by the tolerance: the more, the less acceleration and jerk the feed leaves
LENGTHS = (1.0, 2.0)
#: waypoints closer than this share of that length count as so far apart, which keeps numbers in range
_CLOSE = 0.05
#: waypoints in a row of which a third difference is taken
_ROW = 4
#: rounds of holding waypoints more firmly, at most
_ROUNDS = 25
#: waypoints may leave their room by this factor: then all are moved less
_OVER = 1.05
#: a weight grows by the square of the excess, of at most so much
_FIRMER = 10.0
#: weight of a waypoint that stays, against the largest one
_FIXED = 1e9
#: moves below this share of the tolerance gain nothing
_LEAST = 1e-2


def spread(route: Route, limits: AxisLimits, share: float = LENGTHS[0]) -> Route | None:
    """The route with waypoints moved so that it bends evenly, and the tolerance that remains; None where it
    does already. Waypoints keep their order, and rests their place. `share` is one of LENGTHS."""
    point = route.point_mm
    step = np.sqrt((np.diff(point, axis=0) ** 2).sum(axis=1))
    if len(point) <= _ROW or not (step > 0.0).all():
        return None
    rest = (route.tolerance_mm == 0.0) | (route.dwell_s > 0.0)
    rest[0] = rest[-1] = True
    length = share * _lengths(route, limits, rest)
    room = np.where(rest, np.inf, _SHARE * route.tolerance_mm)
    step = np.maximum(step, _CLOSE * np.minimum(length[:-1], length[1:]))
    rough = _roughness(np.concatenate(([0.0], np.cumsum(step))))
    own = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    weight = np.where(rest, 0.0, own / length**6)
    for _ in range(_ROUNDS):
        fixed = _FIXED * max(float(weight.max()), float(rough[-1].max()))
        moved = _least(rough, np.where(rest, fixed, weight), point)
        away = np.sqrt((moved**2).sum(axis=1))
        over = float((away / room).max())
        if over <= _OVER:
            break
        weight *= np.clip(away / room, 1.0, _FIRMER) ** 2
    moved *= min(1.0, 1.0 / over) * ~rest[:, None]
    away = np.sqrt((moved**2).sum(axis=1))
    if (away <= _LEAST * room).all():
        return None
    return replace(route, point_mm=point + moved, tolerance_mm=route.tolerance_mm - away)


def _lengths(route: Route, limits: AxisLimits, rest: Mask) -> Array:
    """(n,) mm passed at each waypoint in the time in which the jerk moves an axis by the tolerance."""
    feed = np.minimum(route.feed_mm_s, np.sqrt((limits.velocity**2).sum()))
    feed = np.minimum(np.append(feed, np.inf), np.append(np.inf, feed))
    tolerance = np.where(rest, route.tolerance_mm.max(), route.tolerance_mm)
    return np.asarray(feed * np.cbrt(tolerance / limits.jerk.max()))


def _roughness(arc_mm: Array) -> Array:
    """(4, n) the upper bands of the form that sums squares of third divided differences at (n,) places."""
    count = len(arc_mm) - _ROW + 1
    part = np.full((_ROW, count), 6.0)
    for a in range(_ROW):
        for b in range(_ROW):
            if a != b:
                part[a] /= arc_mm[a : count + a] - arc_mm[b : count + b]
    span = (arc_mm[_ROW - 1 :] - arc_mm[: 1 - _ROW]) / (_ROW - 1)
    bands = np.zeros((_ROW, len(arc_mm)))
    for a in range(_ROW):
        for b in range(a, _ROW):
            bands[_ROW - 1 - (b - a), b : count + b] += span * part[a] * part[b]
    return bands


def _least(rough: Array, weight: Array, point: Array) -> Array:
    """(n, 3) by how much points are moved where roughness and weighted squares of the moves are least."""
    # scaled to a diagonal of 1, as weights differ by many powers of ten
    scale = 1.0 / np.sqrt(rough[-1] + weight)
    bands = np.zeros_like(rough)
    for apart in range(_ROW):
        bands[_ROW - 1 - apart, apart:] = rough[_ROW - 1 - apart, apart:] * scale[apart:]
        bands[_ROW - 1 - apart, apart:] *= scale[: len(scale) - apart]
    bands[-1] = 1.0
    found = solveh_banded(bands, (weight * scale)[:, None] * point) * scale[:, None]
    return np.asarray(found - point)
