"""How far a motion's path is from the polyline that it follows.

Known segments: a bound. A stretch of a cubic stays inside the hull of its four control points, and the
distance from a segment is convex, so that no place of the stretch is farther than the farthest of the four.
Unknown segments: samples, matched to segments in order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.exceptions import UsageError
from olp.trajectory.motion import Array, Index, Motion
from olp.trajectory.pieces import Pieces, blocks
from olp.trajectory.route import Route
from olp.trajectory.same import groups_of_same

#: looks at a curved piece: into how many parts it is cut, and the segments around its own that each is held
#: against; the halves of a cut corner go with the segments on its sides
_LOOKS: tuple[tuple[int, tuple[int, ...]], ...] = ((2, (0, -1)), (8, (0, -1, 1, -2, 2)))
#: samples in one block, and segments that a search looks ahead
_BLOCK, _AHEAD = 1 << 14, 64
#: (mm) distances below are none
_EVEN_MM = 1e-8
_TINY = float(np.finfo(np.float64).tiny)


def deviation_bound(motion: Motion, route: Route, segment: Index, allowed_mm: Array) -> Array:
    """(k,) distance mm from the polyline that no place of each piece exceeds.

    `segment` (k,) is the segment of the route that each piece drives: those within two of it, in order, are
    looked at. Bounds up to `allowed_mm` (k,) are not made any tighter. Raises UsageError for other shapes.
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
        for parts, near in _LOOKS:
            if rows.size:
                found = _bound(pieces.take(rows), corners, own[rows], parts, near)
                away[rows] = np.minimum(away[rows], found)
                rows = rows[found > allowed_mm[part][rows]]
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
            size = np.maximum(_dot(delta, delta), _TINY)
            far = np.maximum.reduce([_square_to(point - a, delta, size) for point in controls])
            best = np.minimum(best, far)
        largest = np.maximum(largest, best)
    return np.asarray(np.sqrt(largest))


def _square_to(offset: Array, delta: Array, size: Array) -> Array:
    """(n,) squared distances of points from segments 0 to `delta` (3, n), whose squared length is `size`."""
    share = np.clip(_dot(offset, delta) / size, 0.0, 1.0)
    rest = offset - share * delta
    return _dot(rest, rest)


def _dot(a: Array, b: Array) -> Array:
    """(n,) scalar products of (3, n) and (3, n)."""
    result: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return result


def _polyline(route: Route) -> tuple[Index, Array]:
    """(n,) number of each way-point, and the polyline (m, 3), once those that are the same are one."""
    group = groups_of_same(route.point_mm)
    polyline = route.point_mm[np.flatnonzero(np.diff(group, prepend=-1))]
    return group, (np.repeat(polyline, 2, axis=0) if len(polyline) == 1 else polyline)


def path_deviation(motion: Motion, route: Route, places: int = 5) -> Array:
    """(k,) largest distance mm of each piece, at `places` times, from the polyline: samples are matched to
    segments that never go back, nearest in the sense of least squares. A wrong match can make the distance
    too large, never too small."""
    polyline = _polyline(route)[1]
    largest = np.zeros(len(motion))
    known = 0
    for part, point in _samples(motion, places):
        flat, known = _in_order(point.reshape(-1, 3), polyline, known)
        largest[part] = flat.reshape(point.shape[:2]).max(axis=1)
    return largest


def _samples(motion: Motion, places: int) -> Iterator[tuple[Index, Array]]:
    """Blocks of pieces (n,) and their positions (n, places, 3) in order of time."""
    block = max(_BLOCK // places, 1)
    share = np.linspace(0.0, 1.0, places)
    for a in range(0, len(motion), block):
        piece = np.arange(a, min(a + block, len(motion)))
        seconds = np.diff(motion.start_s[a : a + len(piece) + 1])
        u = (seconds[:, None] * share).ravel()
        yield piece, motion.of(np.repeat(piece, places), u)[0].reshape(len(piece), places, 3)


def _to_segments(point: Array, begin: Array, end: Array) -> Array:
    """(n, m) distances of points (n, 3) from segments (m, 3) to (m, 3)."""
    delta = (end - begin)[None]
    offset = point[:, None, :] - begin[None]
    size = np.maximum((delta * delta).sum(axis=2), _TINY)
    share = np.clip((offset * delta).sum(axis=2) / size, 0.0, 1.0)
    result: Array = np.sqrt(((offset - share[:, :, None] * delta) ** 2).sum(axis=2))
    return result


def _in_order(point: Array, polyline: Array, first: int) -> tuple[Array, int]:
    """(n,) distances of points in order from segments that never go back, the first not before `first`;
    and the segment reached. Dynamic programming over a window that slides along."""
    away = np.zeros(len(point))
    at = 0
    while at < len(point):
        take = point[at : at + _AHEAD]
        last = min(first + 2 * _AHEAD, len(polyline) - 1)
        begin, end = polyline[first:last], polyline[first + 1 : last + 1]
        table = _to_segments(take, begin, end)
        # rounding decides nothing: of segments that are as near the earliest is the one
        cost = np.where(table > _EVEN_MM, table, 0.0) ** 2
        for i in range(1, len(cost)):
            cost[i] += np.minimum.accumulate(cost[i - 1])
        # back from the best end; of equals the earliest, so that a path driven back later is not skipped
        column = int(np.argmin(cost[-1]))
        picks = [column]
        for i in range(len(cost) - 2, -1, -1):
            column = int(np.argmin(cost[i, : column + 1]))
            picks.append(column)
        picks.reverse()
        # the later half of a block is decided with what comes after it
        keep = len(take) if at + len(take) >= len(point) else max(len(take) // 2, 1)
        away[at : at + keep] = table[np.arange(keep), picks[:keep]]
        first += picks[keep - 1]
        at += keep
    return away, first
