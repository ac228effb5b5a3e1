"""What a motion really asks of the axes: its largest velocity, acceleration, jerk and feed against limits.

Where the axes are cubics of time (a straight path, or a path driven at constant rate) the extremes are
those of quadratics and lines, taken in closed form. Elsewhere the polynomials are of degree nine, and are
looked at on both ends of every piece and densely inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.exceptions import UsageError
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.same import groups_of_same

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

#: pieces in one block
_BLOCK = 1 << 14
#: places looked at in a piece of high degree, and for the speed along the path, ends included
_PLACES = 17
_SPEED_PLACES = 5
#: segments to either side of a piece's own that its distance is taken to
_NEAR = 2
#: segments that a search without a hint looks ahead, and samples in its block
_AHEAD = 64
#: (mm) distances below are none
_EVEN_MM = 1e-8
_TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, slots=True, eq=False)
class Audit:
    """Largest ratios to the limits: `velocity`, `acceleration`, `jerk` (3,) per axis, `feed` along the path
    (0 if none was given); and the largest jumps where pieces join: `position_jump_mm`,
    `velocity_jump_mm_s`, `acceleration_jump_mm_s2`. Times are floats: at t seconds a jump of position of
    the speed times t / 2^53 is none of the motion's. Neither ends of the motion count as joins."""

    velocity: Array
    acceleration: Array
    jerk: Array
    feed: float
    position_jump_mm: float
    velocity_jump_mm_s: float
    acceleration_jump_mm_s2: float


def audit(motion: Motion, limits: AxisLimits, feed_mm_s_by_piece: Array | None = None) -> Audit:
    """Ratios of the motion to the axis limits, and to the feed of each piece (k,) (inf: none).

    Raises UsageError if the feeds are not one for each piece.
    """
    if feed_mm_s_by_piece is not None and feed_mm_s_by_piece.shape != (len(motion),):
        raise UsageError(f"feeds have shape {feed_mm_s_by_piece.shape}; expected ({len(motion)},)")
    largest = np.zeros((3, 3))
    feed = 0.0
    jumps = np.zeros(3)
    last: tuple[Array, Array, Array] | None = None
    for a in range(0, len(motion), _BLOCK):
        piece = np.arange(a, min(a + _BLOCK, len(motion)))
        seconds = np.diff(motion.start_s[a : a + len(piece) + 1])
        given = None if feed_mm_s_by_piece is None else feed_mm_s_by_piece[piece]
        cubic, simple = axis_cubics(motion, piece)
        rows, rest = np.flatnonzero(simple), np.flatnonzero(~simple)
        largest = np.maximum(largest, _exact(cubic[rows], seconds[rows]))
        dense, fastest = _dense(motion, piece[rest], seconds[rest])
        largest = np.maximum(largest, dense)
        if given is not None:
            feed = max(feed, float((fastest / given[rest]).max(initial=0.0)))
            feed = max(feed, float((_fastest(cubic[rows], seconds[rows]) / given[rows]).max(initial=0.0)))
        begin = motion.of(piece, np.zeros(len(piece)))[:3]
        end = motion.of(piece, seconds)[:3]
        for i in range(3):
            jump = np.abs(begin[i][1:] - end[i][:-1]).max(initial=0.0)
            if last is not None:
                jump = max(jump, np.abs(begin[i][0] - last[i]).max())
            jumps[i] = max(jumps[i], jump)
        last = (end[0][-1], end[1][-1], end[2][-1])
    return Audit(
        largest[0] / limits.velocity, largest[1] / limits.acceleration, largest[2] / limits.jerk, feed,
        *(float(jump) for jump in jumps),
    )  # fmt: skip


def slowing(result: Audit) -> float:
    """The factor, 1 or more, by which the motion's time has to be stretched to keep every limit."""
    return max(
        1.0,
        float(result.velocity.max()),
        result.feed,
        float(np.sqrt(result.acceleration.max())),
        float(np.cbrt(result.jerk.max())),
    )


def axis_cubics(motion: Motion, piece: Index) -> tuple[Array, Mask]:
    """(n, 4, 3) axis positions of pieces (n,) as cubics of the time after their start, and where they are
    that; elsewhere the values mean nothing."""
    time, path = motion.time[piece], motion.path[motion.shape[piece]]
    straight = ~path[:, 2:].any(axis=(1, 2)) & ~time[:, 4:].any(axis=1)
    steady = ~time[:, 2:].any(axis=1)
    # of a straight path only the first rate is not zero, and a cubic of a steady parameter stays one
    c0, c1 = time[:, 0, None], time[:, 1, None]
    p0, p1, p2, p3 = (path[:, i] for i in range(4))
    cubic = np.empty((len(piece), 4, 3))
    cubic[:, 0] = p0 + c0 * (p1 + c0 * (p2 + c0 * p3))
    rate = p1 + c0 * (2.0 * p2 + 3.0 * c0 * p3)
    cubic[:, 1] = rate * c1
    cubic[:, 2] = rate * time[:, 2, None] + (p2 + 3.0 * c0 * p3) * c1 * c1
    cubic[:, 3] = rate * time[:, 3, None] + p3 * c1**3
    simple: Mask = np.logical_or(straight, steady)
    return cubic, simple


def _exact(cubic: Array, seconds: Array) -> Array:
    """(3, 3) largest velocity, acceleration, jerk of cubics (n, 4, 3) on [0, seconds]."""
    u = seconds[:, None]
    b1, b2, b3 = cubic[:, 1], cubic[:, 2], cubic[:, 3]
    # velocity turns where 2 b2 + 6 b3 u = 0
    with np.errstate(all="ignore"):
        turn = -b2 / (3.0 * b3)
    turn = np.where((turn > 0.0) & (turn < u), turn, 0.0)
    largest = np.zeros((3, 3))
    for at in (np.zeros_like(u), u, turn):
        found = (b1 + at * (2.0 * b2 + 3.0 * at * b3), 2.0 * b2 + 6.0 * at * b3, 6.0 * b3)
        for i, values in enumerate(found):
            largest[i] = np.maximum(largest[i], np.abs(values).max(axis=0, initial=0.0))
    return largest


def _dense(motion: Motion, piece: Index, seconds: Array) -> tuple[Array, Array]:
    """The same of any pieces (n,), and the largest speed of each along the path (n,)."""
    largest, speed2 = np.zeros((3, 3)), np.zeros(len(piece))
    for share in _places() if piece.size else ():
        found = motion.of(piece, share * seconds)[1:]
        for i, values in enumerate(found):
            largest[i] = np.maximum(largest[i], np.abs(values).max(axis=0))
        speed2 = np.maximum(speed2, (found[0] * found[0]).sum(axis=1))
    return largest, np.sqrt(speed2)


def _fastest(cubic: Array, seconds: Array) -> Array:
    """(n,) largest speed along the path of cubics (n, 4, 3)."""
    b1, b2, b3 = cubic[:, 1], cubic[:, 2], cubic[:, 3]
    best = np.zeros(len(cubic))
    at = np.zeros(len(cubic))

    def speed2(u: Array) -> Array:
        v = b1 + u[:, None] * (2.0 * b2 + 3.0 * u[:, None] * b3)
        result: Array = (v * v).sum(axis=1)
        return result

    for share in np.linspace(0.0, 1.0, _SPEED_PLACES):
        value = speed2(share * seconds)
        at = np.where(value > best, share * seconds, at)
        best = np.maximum(value, best)
    # from the best of the places to the top: v a = 0, by Newton
    for _ in range(4):
        u = at[:, None]
        v, a, j = b1 + u * (2.0 * b2 + 3.0 * u * b3), 2.0 * b2 + 6.0 * u * b3, 6.0 * b3
        slope, curve = (v * a).sum(axis=1), (a * a + v * j).sum(axis=1)
        with np.errstate(all="ignore"):
            trial = np.where(curve < 0.0, at - slope / curve, at)
        trial = np.clip(trial, 0.0, seconds)
        value = speed2(trial)
        at = np.where(value > best, trial, at)
        best = np.maximum(value, best)
    return np.sqrt(best)


def _places() -> Array:
    """Shares of a piece: the ends, and points denser toward them, where jerk is largest."""
    result: Array = (1.0 - np.cos(np.linspace(0.0, np.pi, _PLACES))) / 2.0
    return result


def path_deviation(motion: Motion, route: Route, segment: Index | None = None, places: int = 5) -> Array:
    """(k,) largest distance mm of each piece, at `places` times, from the segments of the polyline near it
    in order.

    With `segment` (k,), the segment each piece drives, those within two of it are looked at. Without, the
    samples are matched to segments that never go back, nearest in the sense of least squares; a wrong match
    can make the distance too large, never too small.
    """
    if segment is not None and segment.shape != (len(motion),):
        raise UsageError(f"segments have shape {segment.shape}; expected ({len(motion)},)")
    group = groups_of_same(route.point_mm)
    polyline = route.point_mm[np.flatnonzero(np.diff(group, prepend=-1))]
    if len(polyline) == 1:
        polyline = np.repeat(polyline, 2, axis=0)
    largest = np.zeros(len(motion))
    known = 0
    for piece, point in _samples(motion, places):
        if segment is None:
            flat, known = _in_order(point.reshape(-1, 3), polyline, known)
            largest[piece] = flat.reshape(point.shape[:2]).max(axis=1)
            continue
        own = group[segment[piece]]
        away = np.full(point.shape[:2], np.inf)
        for step in range(-_NEAR, _NEAR + 1):
            near = np.clip(own + step, 0, len(polyline) - 2)
            away = np.minimum(away, _to_segment(point, polyline[near], polyline[near + 1]))
        largest[piece] = away.max(axis=1)
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


def _to_segment(point: Array, begin: Array, end: Array) -> Array:
    """(n, k) distances of points (n, k, 3) from segments (n, 3) to (n, 3)."""
    delta = (end - begin)[:, None, :]
    offset = point - begin[:, None, :]
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
        table = _to_segment(np.broadcast_to(take, (len(begin), *take.shape)), begin, end).T
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
