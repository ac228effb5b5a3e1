"""Sharp corners: straight moves from rest to rest overlap in time, which cuts corners within the tolerance.

The last `tau` seconds of a move and the first of the next add up. Both have constant jerk there, J1 and J2
times g, so that with the corner at 0 the path is the cubic
    -u1 g J1 (tau - t)^3 / 6 + u2 g J2 t^3 / 6,    0 <= t <= tau,
or, where it lasts longer than one jerk phase of a move, several. How long, and where the corner lies, is said
in `olp.trajectory.cuts`.

Ruckig computes the middle of each move, from and to an acceleration.
Smoothing in time: S. Tajima, B. Sencer, "Kinematic corner smoothing for high speed machine tools",
Int. J. Machine Tools and Manufacture 108 (2016).
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.trajectory.cuts import Cut, cut
from olp.trajectory.growing import Growing
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.ruckig_moves import solve_all
from olp.trajectory.same import groups_of_same
from olp.trajectory.scurve import CRUISE, PHASES, rest_to_rest_s, states

#: moves per block, so that their phases fit into the cache
_BLOCK = 8192


@dataclass(frozen=True, slots=True, eq=False)
class Overlapped:
    """`motion`, and the `segment` (k,) of the route that each piece drives; where two moves overlap, the
    later one."""

    motion: Motion
    segment: Index


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
        first, corners = _merged(route, limits)
        moves = corners.moves
        rest = rest_to_rest_s(moves.length, moves.speed, moves.acceleration, moves.jerk)
        result[first[1:] - 1] = rest - corners.overlap_s[1 : len(first)]
    return result


def overlap_parts(route: Route, limits: AxisLimits) -> Overlapped:
    """As `overlap`, with the segment of each piece."""
    _check(route, limits)
    count = len(route)
    if count == 0:
        return Overlapped(_nothing(route), np.zeros(0, np.int64))
    first, corners = _merged(route, limits)
    segment = first[1:] - 1
    if segment.size == 0:
        line = int(route.line[0]) if len(route.line) else 0
        return Overlapped(Motion.rest(route.point_mm[0], 0.0, line), np.zeros(1, np.int64))
    none = np.zeros(0, np.int64)
    sizes = ((0,), (0, 4), (0, 4, route.point_mm.shape[1]))
    all_seconds, all_time, all_path = (Growing(np.zeros(size)) for size in sizes)
    all_shape, all_owner = Growing(none), Growing(none)
    for a in range(0, len(segment), _BLOCK):
        part = _block(corners, a, min(a + _BLOCK, len(segment)))
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


def _merged(route: Route, limits: AxisLimits) -> tuple[Index, Cut]:
    """The first waypoint of each group of equal ones (m,), and the m - 1 moves between them."""
    group = groups_of_same(route.point_mm)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    tolerance = np.minimum.reduceat(route.tolerance_mm, first)
    feed = route.feed_mm_s[first[1:] - 1]
    return first, cut(route.point_mm[first], feed, tolerance, limits)


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


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    seconds: Array
    time: Array
    path: Array
    shape: Index
    owner: Index


def _block(corners: Cut, a: int, b: int) -> _Pieces:
    """Pieces of moves a to b - 1, each with the overlap at its start."""
    pick = slice(a, b)
    count = b - a
    moves = corners.moves
    every = np.arange(a, b)
    head, tail = corners.overlap_s[a:b], corners.overlap_s[a + 1 : b + 1]
    d0, v0, a0, _ = moves.heads(every, head, corners.share[a:b])
    d1, v1, a1, _ = moves.heads(every, tail, corners.share[a + 1 : b + 1])
    middle, jerk = moves.length[pick] - d0 - d1, moves.jerk[pick]
    solved = solve_all(middle, v0, a0, v1, -a1, moves.speed[pick], moves.acceleration[pick], jerk)
    state = states(solved.duration_s, solved.jerk, middle, v0, a0, v1, -a1)
    # columns of a move: the parts of its overlap, then the phases; those of no duration are dropped
    corner = a + np.flatnonzero(head > 0.0)
    lasts, cubics = _corner(corners, corner)
    parts = lasts.shape[1]
    seconds = np.zeros((count, parts + PHASES))
    seconds[corner - a, :parts] = lasts
    seconds[:, parts:] = solved.duration_s
    time = np.zeros((count, parts + PHASES, 4))
    time[:, :parts, 1] = 1.0
    time[:, parts:, 0] = state.position + d0[:, None]
    time[:, parts:, 1] = state.velocity
    time[:, parts:, 2] = state.acceleration / 2.0
    time[:, parts:, 3] = solved.jerk / 6.0
    time[:, parts + CRUISE, 3] = 0.0
    used = lasts > 0.0
    path = np.zeros((count + int(used.sum()), 4, moves.start.shape[1]))
    path[:count, 0], path[:count, 1] = moves.start[pick], moves.along[pick]
    path[count:] = cubics[used]
    shape = np.broadcast_to(np.arange(count)[:, None], seconds.shape).copy()
    own = shape[corner - a]
    own[:, :parts][used] = count + np.arange(int(used.sum()))
    shape[corner - a] = own
    owner = np.broadcast_to(every[:, None], seconds.shape)
    driven = seconds > 0.0
    return _Pieces(seconds[driven], time[driven], path, shape[driven], owner[driven])


def _corner(corners: Cut, corner: Index) -> tuple[Array, Array]:
    """Where moves overlap at each `corner` (m,): the seconds (m, p) of its parts, of which some are none, and
    their cubics of time (m, p, 4, axes). Longer overlaps have parts that end where the jerk of either move
    changes, and one that ends in their middle."""
    moves, tau, share = corners.moves, corners.overlap_s[corner], corners.share[corner]
    first, later = moves.phase_s[corner - 1], moves.phase_s[corner]
    long = (share >= 1.0) & (tau > np.minimum(first, later))
    edges = [np.zeros(len(corner))]
    if long.any():
        rest, hold = tau - first, moves.hold_s[corner]
        inner = (rest - moves.hold_s[corner - 1], rest, 0.5 * tau, later, later + hold)
        edges += list(np.sort([np.where(long, np.clip(e, 0.0, tau), 0.0) for e in inner], axis=0))
    edges.append(tau)
    begin = np.stack(edges, axis=1)
    lasts = np.diff(begin, axis=1)
    cubics = np.zeros((*lasts.shape, 4, moves.along.shape[1]))
    u1, u2 = moves.along[corner - 1], moves.along[corner]
    for k in range(lasts.shape[1]):
        since, half = begin[:, k], begin[:, k] + 0.5 * lasts[:, k]
        left = moves.heads(corner - 1, tau - since, share)
        gone = moves.heads(corner, since, share)
        jerk1 = moves.heads(corner - 1, tau - half, share)[3]
        jerk2 = moves.heads(corner, half, share)[3]
        cubics[:, k, 0] = corners.point[corner] - u1 * left[0][:, None] + u2 * gone[0][:, None]
        cubics[:, k, 1] = u1 * left[1][:, None] + u2 * gone[1][:, None]
        cubics[:, k, 2] = 0.5 * (u2 * gone[2][:, None] - u1 * left[2][:, None])
        cubics[:, k, 3] = (u1 * jerk1[:, None] + u2 * jerk2[:, None]) / 6.0
    return lasts, cubics


def _nothing(route: Route) -> Motion:
    none = np.zeros(0, np.int64)
    return Motion(np.zeros(1), np.zeros((0, 4)), np.zeros((0, 4, route.point_mm.shape[1])), none, none)
