"""Short steps of a route, such as those that take up backlash, become one waypoint within the path tolerance.

A jog of 5 um has two corners of a right angle. Rounded one by one they bend the path within 5 um, though
their bends cancel: the path may go from one side to the other along the moves beside the jog. So the
waypoints of a cluster are moved to its middle, and what that takes of the tolerance does not round corners.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.trajectory.route import Route

#: share of a path tolerance that moving a waypoint may take
_SHARE = 0.6
#: moves of waypoints that are shorter than this share of the tolerance gain nothing
_LEAST = 1e-3


def merged(route: Route) -> Route | None:
    """The same waypoints, those of a cluster in one place, and the tolerance that remains; None where there
    are no clusters.

    That place is the middle of a cluster, or the rest with which it begins or ends. No waypoint is moved by
    more than `_SHARE` of its tolerance, and no rest is moved.
    """
    rest = (route.tolerance_mm == 0.0) | (route.dwell_s > 0.0)
    rest[:1] = rest[-1:] = True
    room = np.where(rest, math.inf, _SHARE * route.tolerance_mm)
    step = np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1))
    least, most = np.minimum(room[:-1], room[1:]), np.maximum(room[:-1], room[1:])
    reach = np.where(np.isinf(most), least, 2.0 * least)
    short = (step <= reach) & (step > _LEAST * least) & np.isfinite(least)
    point, tolerance = route.point_mm.copy(), route.tolerance_mm.copy()
    last = 0
    for first in np.flatnonzero(short).tolist():
        # a rest may end one cluster and begin the next one
        if first < last or (first == last and not rest[first]):
            continue
        last = _last(route.point_mm, room, first)
        fixed = first if rest[first] else last
        place = point[fixed] if rest[fixed] else 0.5 * (route.point_mm[first] + route.point_mm[last])
        own = slice(first, last + 1)
        away = np.sqrt(((route.point_mm[own] - place) ** 2).sum(axis=1))
        if (away <= room[own]).all():
            point[own] = place
            tolerance[own] -= away
    return replace(route, point_mm=point, tolerance_mm=tolerance) if last else None


def _last(point: Array, room: Array, first: int) -> int:
    """The last waypoint of the cluster that begins with a short step at waypoint `first`. A rest ends it, and none has two."""
    last = first + 1
    least = min(float(room[first]), float(room[last]))
    wide = 1.0 if math.isinf(room[first]) else 2.0
    while last + 1 < len(point) and math.isfinite(room[last]):
        least = min(least, float(room[last + 1]))
        away = math.dist(point[first].tolist(), point[last + 1].tolist())
        ends = math.isinf(room[last + 1])
        if (ends and wide == 1.0) or away > least * (1.0 if ends else wide):
            break
        last += 1
    return last
