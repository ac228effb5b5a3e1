"""Sharp corners: straight moves from rest to rest overlap in time, which cuts corners within the tolerance.

The last `tau` seconds of a move and the first of the next add up. Both have constant jerk there, J1 and J2
times g, so that with the corner at 0 the path is the cubic
    -u1 g J1 (tau - t)^3 / 6 + u2 g J2 t^3 / 6,    0 <= t <= tau.

At t = tau / 2 the corner is g tau^3 |u2 J2 - u1 J1| / 48 away. The path is never farther from the polyline.
Ruckig computes the middle of each move, from and to an acceleration.
Smoothing in time: S. Tajima, B. Sencer, "Kinematic corner smoothing for high speed machine tools",
Int. J. Machine Tools and Manufacture 108 (2016).
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.trajectory.growing import Growing
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.ruckig_moves import solve_all
from olp.trajectory.same import groups_of_same
from olp.trajectory.scurve import CRUISE, PHASES, rest_to_rest_s, states

#: share of the first jerk phase that an overlap may take, so that the middle keeps a rest of it
_ROOM = 0.98
#: components of a direction below this do not limit a move
_ALONG = 1e-12
#: share of the limits to which moves are planned, as Ruckig gets 1e-9 more than that
_INSIDE = 1.0 - 1e-8
#: moves per block, so that their phases fit into the cache
_BLOCK = 8192


@dataclass(frozen=True, slots=True, eq=False)
class Overlapped:
    """`motion`, and the `segment` (k,) of the route that each piece drives; where two moves overlap, the
    later one."""

    motion: Motion
    segment: Index


@dataclass(frozen=True, slots=True, eq=False)
class _Moves:
    """n moves: start and direction (n, 3); length, largest speed, acceleration and jerk (n,). At their n + 1
    ends: the time that neighbours overlap, and the share g of the jerk for it."""

    start: Array
    along: Array
    length: Array
    speed: Array
    acceleration: Array
    jerk: Array
    overlap_s: Array
    share: Array


def overlap(route: Route, limits: AxisLimits) -> Motion:
    """The motion along `route`, with rests at waypoints of tolerance 0; the caller adds dwells there.

    Raises UsageError where a value of the route or of the limits is not a number or out of range.
    """
    return overlap_parts(route, limits).motion


def least_s(route: Route, limits: AxisLimits) -> Array:
    """(n - 1,) seconds that `overlap` takes at least along each segment of a route: from rest to rest, less
    the overlap at its end. Raises as `overlap`."""
    _check(route, limits)
    result = np.zeros(max(len(route) - 1, 0))
    if len(route) > 1:
        first, moves = _merged(route, limits)
        rest = rest_to_rest_s(moves.length, moves.speed, moves.acceleration, moves.jerk)
        result[first[1:] - 1] = rest - moves.overlap_s[1 : len(first)]
    return result


def overlap_parts(route: Route, limits: AxisLimits) -> Overlapped:
    """As `overlap`, with the segment of each piece."""
    _check(route, limits)
    count = len(route)
    if count == 0:
        return Overlapped(_nothing(route), np.zeros(0, np.int64))
    first, moves = _merged(route, limits)
    segment = first[1:] - 1
    if segment.size == 0:
        line = int(route.line[0]) if len(route.line) else 0
        return Overlapped(Motion.rest(route.point_mm[0], 0.0, line), np.zeros(1, np.int64))
    points = route.point_mm[first]
    none = np.zeros(0, np.int64)
    sizes = ((0,), (0, 4), (0, 4, points.shape[1]))
    all_seconds, all_time, all_path = (Growing(np.zeros(size)) for size in sizes)
    all_shape, all_owner = Growing(none), Growing(none)
    for a in range(0, len(segment), _BLOCK):
        part = _block(moves, points, a, min(a + _BLOCK, len(segment)))
        all_shape.append(part.shape + len(all_path))
        all_owner.append(part.owner)
        all_seconds.append(part.seconds)
        all_time.append(part.time)
        all_path.append(part.path)
    seconds, time, path = all_seconds.whole(), all_time.whole(), all_path.whole()
    shape, owner = all_shape.whole(), all_owner.whole()
    origin = segment[owner]
    start = np.concatenate(([0.0], np.cumsum(seconds)))
    return Overlapped(Motion(start, time, path, shape, route.line[origin]), origin)


def _merged(route: Route, limits: AxisLimits) -> tuple[Index, _Moves]:
    """The first waypoint of each group of equal ones (m,), and the m - 1 moves."""
    group = groups_of_same(route.point_mm)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    tolerance = np.minimum.reduceat(route.tolerance_mm, first)
    feed = route.feed_mm_s[first[1:] - 1]
    return first, _moves(route.point_mm[first], feed, tolerance, limits)


def _check(route: Route, limits: AxisLimits) -> None:
    for name, values in (
        ("velocity", limits.velocity), ("acceleration", limits.acceleration), ("jerk", limits.jerk)
    ):  # fmt: skip
        if np.ndim(values) != 1 or not bool(np.all(np.isfinite(values) & (values > 0.0))):
            raise UsageError(f"the axis limits of {name} are {values}; expected numbers above 0")
    if route.point_mm.ndim != 2 or route.point_mm.shape[1] != len(limits.velocity):
        raise UsageError(f"waypoints have shape {route.point_mm.shape}; expected (n, {len(limits.velocity)})")
    if not bool(np.isfinite(route.point_mm).all()):
        raise UsageError("a waypoint is not finite")
    if not bool(np.all(route.feed_mm_s > 0.0)):
        raise UsageError("a feed is not above 0")
    if not bool(np.all(np.isfinite(route.tolerance_mm) & (route.tolerance_mm >= 0.0))):
        raise UsageError("a tolerance is not a number of 0 or more")


def _moves(point: Array, feed: Array, tolerance: Array, limits: AxisLimits) -> _Moves:
    delta = np.diff(point, axis=0)
    length = np.sqrt((delta * delta).sum(axis=1))
    along = delta / length[:, None]
    size = np.maximum(np.abs(along), _ALONG)
    speed = np.minimum((limits.velocity / size).min(axis=1), feed) * _INSIDE
    acceleration = (limits.acceleration / size).min(axis=1) * _INSIDE
    jerk = (limits.jerk / size).min(axis=1) * _INSIDE
    push = along * jerk[:, None]
    before, after = push[:-1], push[1:]
    summed = (limits.jerk / np.maximum(np.abs(before + after), _ALONG * limits.jerk)).min(axis=1)
    share = np.minimum(1.0, summed * _INSIDE)
    turn = np.sqrt(((after - before) ** 2).sum(axis=1))
    inner = tolerance[1:-1]
    # the waypoint is no farther from the path than the tolerance
    tau = np.cbrt(48.0 * inner / np.maximum(share * turn, 1e-30))
    # both within the first jerk phase of a time-optimal move from rest to rest
    phase = np.minimum(np.minimum(acceleration / jerk, np.sqrt(speed / jerk)), np.cbrt(length / (2.0 * jerk)))
    tau = np.minimum(tau, _ROOM * np.minimum(phase[:-1], phase[1:]) / np.sqrt(share))
    # the summed speed is convex in time: at both ends it is no faster than the slower feed
    slow = np.minimum(feed[:-1], feed[1:])
    tau = np.minimum(tau, np.sqrt(2.0 * slow / (share * np.maximum(jerk[:-1], jerk[1:]))))
    tau = np.where(inner > 0.0, tau, 0.0)
    ends = np.zeros(1)
    return _Moves(
        point[:-1], along, length, speed, acceleration, jerk,
        np.concatenate((ends, tau, ends)), np.concatenate((ends + 1.0, share, ends + 1.0)),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    seconds: Array
    time: Array
    path: Array
    shape: Index
    owner: Index


def _block(moves: _Moves, point: Array, a: int, b: int) -> _Pieces:
    """Pieces of moves a to b - 1, each with the overlap at its start."""
    pick = slice(a, b)
    count = b - a
    length, jerk = moves.length[pick], moves.jerk[pick]
    head, tail = moves.overlap_s[a:b], moves.overlap_s[a + 1 : b + 1]
    head_jerk, tail_jerk = moves.share[a:b] * jerk, moves.share[a + 1 : b + 1] * jerk
    v0, a0, d0 = head_jerk * head * head / 2.0, head_jerk * head, head_jerk * head**3 / 6.0
    v1, a1, d1 = tail_jerk * tail * tail / 2.0, -tail_jerk * tail, tail_jerk * tail**3 / 6.0
    middle = length - d0 - d1
    solved = solve_all(middle, v0, a0, v1, a1, moves.speed[pick], moves.acceleration[pick], jerk)
    state = states(solved.duration_s, solved.jerk, middle, v0, a0, v1, a1)
    # columns of a move: its overlap, then the phases; those of no duration are dropped
    seconds = np.concatenate((head[:, None], solved.duration_s), axis=1)
    time = np.zeros((count, PHASES + 1, 4))
    time[:, 0, 1] = 1.0
    time[:, 1:, 0] = state.position + d0[:, None]
    time[:, 1:, 1] = state.velocity
    time[:, 1:, 2] = state.acceleration / 2.0
    time[:, 1:, 3] = solved.jerk / 6.0
    time[:, 1 + CRUISE, 3] = 0.0
    corners = np.flatnonzero(head > 0.0)
    path = np.zeros((count + len(corners), 4, point.shape[1]))
    path[:count, 0], path[:count, 1] = point[pick], moves.along[pick]
    if corners.size:
        path[count:] = _corner(moves, point, a + corners)
    shape = np.broadcast_to(np.arange(count)[:, None], seconds.shape).copy()
    shape[corners, 0] = count + np.arange(len(corners))
    owner = np.broadcast_to(np.arange(a, b)[:, None], seconds.shape)
    used = seconds > 0.0
    return _Pieces(seconds[used], time[used], path, shape[used], owner[used])


def _corner(moves: _Moves, point: Array, waypoint: Index) -> Array:
    """(m, 4, 3) cubics of time where the moves before and after each `waypoint` (m,) overlap."""
    tau = moves.overlap_s[waypoint][:, None]
    leaving = moves.along[waypoint - 1] * (moves.share[waypoint] * moves.jerk[waypoint - 1])[:, None]
    entering = moves.along[waypoint] * (moves.share[waypoint] * moves.jerk[waypoint])[:, None]
    return np.stack(
        (
            point[waypoint] - leaving * tau**3 / 6.0,
            leaving * tau * tau / 2.0,
            -leaving * tau / 2.0,
            (leaving + entering) / 6.0,
        ),
        axis=1,
    )


def _nothing(route: Route) -> Motion:
    none = np.zeros(0, np.int64)
    return Motion(np.zeros(1), np.zeros((0, 4)), np.zeros((0, 4, route.point_mm.shape[1])), none, none)
