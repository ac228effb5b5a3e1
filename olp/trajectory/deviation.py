"""How far a motion's path is from the polyline that it follows.

A stretch of a cubic stays inside the hull of its four control points, and the distance from a segment is
convex. So no point of the stretch is farther than the farthest of the four.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import UsageError
from olp.trajectory.motion import Motion
from olp.trajectory.pieces import Pieces, blocks, dot
from olp.trajectory.route import Route
from olp.trajectory.same import groups_of_same

#: passes over a curved piece: into how many parts it is cut, and the segments, relative to its own, that each
#: part is compared with; the halves of a cut corner belong to the segments on its sides
_PASSES: tuple[tuple[int, tuple[int, ...]], ...] = ((2, (0, -1)), (8, (0, -1, 1, -2, 2)))
#: against division by zero
_TINY = float(np.finfo(np.float64).tiny)


def deviation_bound(motion: Motion, route: Route, segment: Index, allowed_mm: Array) -> Array:
    """(k,) distance mm from the polyline that no point of each piece exceeds.

    `segment` (k,) is the segment of the route that each piece drives: those within two of it, in order, are
    compared. Bounds up to `allowed_mm` (k,) are not made tighter. Raises UsageError for other shapes.
    """
    if segment.shape != (len(motion),) or allowed_mm.shape != segment.shape:
        raise UsageError(
            f"segments have shape {segment.shape}, distances {allowed_mm.shape}; expected ({len(motion)},)"
        )
    group, polyline = _polyline(route)
    corners = np.ascontiguousarray(polyline.T)
    largest = np.zeros(len(motion))
    for part, pieces in blocks(motion):
        own = group[segment[part]]
        away = _bound(pieces, corners, own, 1, (0,))
        rows = np.flatnonzero(~pieces.straight() | (away > allowed_mm[part]))
        for parts, near in _PASSES:
            if rows.size:
                bound = _bound(pieces.take(rows), corners, own[rows], parts, near)
                away[rows] = np.minimum(away[rows], bound)
                rows = rows[bound > allowed_mm[part][rows]]
        largest[part] = away
    return largest


def _bound(pieces: Pieces, corners: Array, own: Index, parts: int, near: tuple[int, ...]) -> Array:
    """(n,) bound of pieces cut in `parts`, each with the segment of `near` that it is closest to."""
    low, high = pieces.reach()
    width = (high - low) / parts
    largest = np.zeros(len(low))
    for i in range(parts):
        begin, end = low + i * width, low + (i + 1) * width
        first, last = pieces.positions(begin), pieces.positions(end)
        controls = (
            first,
            first + (width / 3.0) * pieces.slopes(begin),
            last - (width / 3.0) * pieces.slopes(end),
            last,
        )
        best = np.full(len(low), np.inf)
        for step in near:
            k = np.clip(own + step, 0, corners.shape[1] - 2)
            a = corners[:, k]
            delta = corners[:, k + 1] - a
            size = np.maximum(dot(delta, delta), _TINY)
            far = np.maximum.reduce([_square_to(point - a, delta, size) for point in controls])
            best = np.minimum(best, far)
        largest = np.maximum(largest, best)
    return np.asarray(np.sqrt(largest))


def _square_to(offset: Array, delta: Array, size: Array) -> Array:
    """(n,) squared distances of points from segments 0 to `delta` (3, n), whose squared length is `size`."""
    share = np.clip(dot(offset, delta) / size, 0.0, 1.0)
    rest = offset - share * delta
    return dot(rest, rest)


def _polyline(route: Route) -> tuple[Index, Array]:
    """(n,) number of each waypoint, and the polyline (m, 3), with equal neighbours merged."""
    group = groups_of_same(route.point_mm)
    polyline = route.point_mm[np.flatnonzero(np.diff(group, prepend=-1))]
    return group, (np.repeat(polyline, 2, axis=0) if len(polyline) == 1 else polyline)
