"""How two straight moves overlap at a corner: for how long, and about which point beside the waypoint.

A move leaves rest with constant jerk J for a phase p, then holds its acceleration, then lowers it. Of the
move before a corner the same is seen backwards. With tau up to 2 p the middle of an overlap is at

    V + tau^3 D / 48,   D = g (u2 J2 - u1 J1),

V being the corner of the two lines. It need not be the waypoint. It is moved against D, as far as both lines
stay within the tolerance of their segments: by the tolerance over the larger sine of their angles with D. So
the middle may be farther from V, and the overlap lasts longer. Before the middle the distance from the first
line only grows, behind it that from the second only shrinks.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.trajectory.route import AxisLimits

#: components of a direction below this do not limit a move
_ALONG = 1e-12
#: share of the limits to which moves are planned, as Ruckig gets 1e-9 more than that
_INSIDE = 1.0 - 1e-8
#: share of a jerk phase, or of two, that an overlap may take, so that the middle of a move keeps a rest of it
_ROOM = 0.98
#: a corner is moved by at most so many tolerances
_FARTHEST = 3.0
#: and by this share of the shorter move beside it
_OF_LENGTH = 0.1
#: share of the tolerance that a moved corner uses
_USED = 1.0 - 1e-6
#: by this factor a move may reduce its acceleration and jerk for overlaps beyond its first phase
_EASED = 1.1
#: so that what is reduced is within the limits after rounding
_OVER = 1.0 + 1e-9
#: times at which an overlap about a moved corner is checked, from its begin to its end
_CHECKED = np.arange(13.0) / 12.0
#: share of the feed for the speed between these times
_BETWEEN = 1.0 - 4e-3
#: turns in which corners that fail a check go back to their waypoints
_TURNS = 3
#: against division by zero
_TINY = 1e-30


@dataclass(frozen=True, slots=True, eq=False)
class Moves:
    """n straight moves from rest to rest: start and direction (n, axes); length, largest speed, acceleration
    and jerk (n,); the time `phase_s` of constant jerk at both ends, and `hold_s` of constant acceleration
    behind it."""

    start: Array
    along: Array
    length: Array
    speed: Array
    acceleration: Array
    jerk: Array
    phase_s: Array
    hold_s: Array

    @staticmethod
    def of(point: Array, feed: Array, limits: AxisLimits, eased: Array | float = 1.0) -> Moves:
        """The moves along a polyline (n + 1, axes) with feeds (n,), accelerations and jerks reduced by the
        factors `eased` (n,)."""
        delta = np.diff(point, axis=0)
        length = np.sqrt((delta * delta).sum(axis=1))
        along = delta / length[:, None]
        size = np.maximum(np.abs(along), _ALONG)
        speed = np.minimum((limits.velocity / size).min(axis=1), feed) * _INSIDE
        a = (limits.acceleration / size).min(axis=1) * _INSIDE / eased
        j = (limits.jerk / size).min(axis=1) * _INSIDE / eased
        phase = np.minimum(np.minimum(a / j, np.sqrt(speed / j)), np.cbrt(length / (2.0 * j)))
        peak = np.minimum(speed, 0.5 * a * (np.sqrt(phase * phase + 4.0 * length / a) - phase))
        hold = np.where(phase >= a / j, np.maximum(peak / a - phase, 0.0), 0.0)
        return Moves(point[:-1], along, length, speed, a, j, phase, hold)

    def heads(self, move: Index, t: Array, share: Array) -> tuple[Array, Array, Array, Array]:
        """Distance, speed, acceleration and jerk (k,) of moves (k,) at times (k,) after their rest. With less
        than the whole jerk, its `share` (k,) below 1, they are in their first phase."""
        j = share * self.jerk[move]
        phase, hold = np.where(share < 1.0, np.inf, self.phase_s[move]), self.hold_s[move]
        t1 = np.minimum(t, phase)
        d, v, a = j * t1**3 / 6.0, 0.5 * j * t1 * t1, j * t1
        t2 = np.clip(t - phase, 0.0, hold)
        d, v = d + t2 * (v + 0.5 * t2 * a), v + t2 * a
        t3 = np.maximum(t - phase - hold, 0.0)
        d += t3 * (v + t3 * (a / 2.0 - t3 * j / 6.0))
        rate = np.where(t3 > 0.0, -j, np.where(t2 > 0.0, 0.0, j))
        return d, v + t3 * (a - 0.5 * t3 * j), a - t3 * j, rate


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """`moves` between n + 1 corners `point` (n + 1, axes); at each the time (n + 1,) that its moves overlap,
    and the `share` g (n + 1,) of the jerk for it."""

    moves: Moves
    point: Array
    overlap_s: Array
    share: Array


def cut(point: Array, feed: Array, tolerance: Array, limits: AxisLimits) -> Cut:
    """The moves along a polyline (n + 1, axes) without equal neighbours, with tolerances (n + 1,) of its
    waypoints, of which none at the ends counts."""
    moves = Moves.of(point, feed, limits)
    inner = tolerance[1:-1]
    none = np.zeros_like(point[1:-1])
    room = _room(moves, feed, inner, limits)
    offset = _offsets(moves, room, inner)
    for turn in range(_TURNS + 1):
        if turn == _TURNS:
            offset = none
        moved = point.copy()
        moved[1:-1] += offset
        own = Moves.of(moved, feed, limits, _eased(Moves.of(moved, feed, limits), inner, limits))
        some = _room(own, feed, inner, limits)
        tau, good = _within(own, some, offset, inner)
        if good.all():
            break
        offset = np.where(good[:, None], offset, 0.0)
    ends = np.zeros(1)
    return Cut(
        own, moved, np.concatenate((ends, tau, ends)), np.concatenate((ends + 1.0, some.share, ends + 1.0))
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Room:
    """At each inner corner (n - 1,) the share of the jerk, D (n - 1, axes) and its length, and the longest
    overlap that the moves and feeds have room for."""

    share: Array
    across: Array
    size: Array
    most_s: Array


def _room(moves: Moves, feed: Array, tolerance: Array, limits: AxisLimits) -> _Room:
    push = moves.along * moves.jerk[:, None]
    before, after = push[:-1], push[1:]
    summed = (limits.jerk / np.maximum(np.abs(before + after), _ALONG * limits.jerk)).min(axis=1)
    share = np.where(summed >= 1.0, 1.0, summed * _INSIDE)
    across = share[:, None] * (after - before)
    # the first jerk phase of both moves
    most = _ROOM * np.minimum(moves.phase_s[:-1], moves.phase_s[1:]) / np.sqrt(share)
    # there the summed speed is convex in time: at both ends it is no faster than the slower feed
    slow = np.minimum(feed[:-1], feed[1:])
    steepest = share * np.maximum(moves.jerk[:-1], moves.jerk[1:])
    most = np.minimum(most, np.sqrt(2.0 * slow / steepest))
    longer = np.flatnonzero(_whole(share, tolerance))
    if longer.size:
        twice = 2.0 * _ROOM * np.minimum(moves.phase_s[longer], moves.phase_s[longer + 1])
        fits = _fits(moves, longer, twice, slow[longer], limits)
        most[longer[fits]] = twice[fits]
    return _Room(share, across, np.sqrt((across * across).sum(axis=1)), np.where(tolerance > 0.0, most, 0.0))


def _eased(moves: Moves, tolerance: Array, limits: AxisLimits) -> Array:
    """(n,) by how much moves have to reduce their acceleration and jerk, so that the sums of two are within
    the limits beyond their first phases, too. It is 1 where no overlap is as long, or where it is by too
    much."""
    u1, u2 = moves.along[:-1], moves.along[1:]
    push1, push2 = u1 * moves.jerk[:-1, None], u2 * moves.jerk[1:, None]
    phase = np.minimum(moves.phase_s[:-1], moves.phase_s[1:])
    long = np.sqrt(((push2 - push1) ** 2).sum(axis=1)) * (_ROOM * phase) ** 3 / 48.0 < tolerance
    jerk = (np.maximum(np.abs(push1 - push2), np.abs(push1 + push2)) / limits.jerk).max(axis=1)
    pull1, pull2 = u1 * moves.acceleration[:-1, None], u2 * moves.acceleration[1:, None]
    pull1, pull2 = (
        np.minimum(np.abs(a), np.abs(b) * phase[:, None]) for a, b in ((pull1, push1), (pull2, push2))
    )
    factor = np.maximum(jerk, ((pull1 + pull2) / limits.acceleration).max(axis=1))
    factor = np.where(long & (factor <= _EASED), np.maximum(factor, 1.0) * _OVER, 1.0)
    return np.asarray(np.maximum(np.append(factor, 1.0), np.append(1.0, factor)))


def _whole(share: Array, tolerance: Array) -> Mask:
    """(n - 1,) where neither a corner nor those beside it drive with less than the whole jerk. Only then does
    a second phase lead to the speed that the move would have without an overlap."""
    full = np.concatenate(([True], (share >= 1.0) | (tolerance <= 0.0), [True]))
    return np.asarray(full[:-2] & full[1:-1] & full[2:] & (tolerance > 0.0))


def _fits(moves: Moves, corner: Index, tau: Array, slow: Array, limits: AxisLimits) -> Mask:
    """(k,) whether overlaps of `tau` (k,) or less at corners (k,) keep the summed limits and feeds, where the
    moves are beyond their first phase."""
    u1, u2 = moves.along[corner], moves.along[corner + 1]
    push1, push2 = u1 * moves.jerk[corner, None], u2 * moves.jerk[corner + 1, None]
    # one pushes on while the other lowers its acceleration
    fits = np.asarray((np.abs(push1 - push2) <= limits.jerk).all(axis=1))
    one = np.ones(len(corner))
    for part in _CHECKED:
        _, v1, _, _ = moves.heads(corner, tau * (1.0 - part), one)
        _, v2, _, _ = moves.heads(corner + 1, tau * part, one)
        speed = np.sqrt(((u1 * v1[:, None] + u2 * v2[:, None]) ** 2).sum(axis=1))
        fits &= speed <= slow * (_BETWEEN if 0.0 < part < 1.0 else 1.0)
        fits &= (np.abs(u1 * v1[:, None]) + np.abs(u2 * v2[:, None]) <= limits.velocity).all(axis=1)
        most1, most2 = (moves.phase_s[k] * moves.jerk[k] for k in (corner, corner + 1))
        fits &= (np.abs(u2 * most2[:, None] - u1 * most1[:, None]) <= limits.acceleration).all(axis=1) | (
            np.abs(u1 * u2).max(axis=1) <= _ALONG
        )
    return fits


def _offsets(moves: Moves, room: _Room, tolerance: Array) -> Array:
    """(n - 1, axes) how far corners are moved against D: no farther than the longest overlap needs."""
    size = np.maximum(room.size, _TINY)
    unit = room.across / size[:, None]
    sine = np.zeros(len(size))
    for along in (moves.along[:-1], moves.along[1:]):
        cosine = (unit * along).sum(axis=1)
        sine = np.maximum(sine, np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0)))
    delta = _USED * tolerance * np.minimum(1.0 / np.maximum(sine, _TINY), _FARTHEST)
    delta = np.minimum(delta, _OF_LENGTH * np.minimum(moves.length[:-1], moves.length[1:]))
    delta = np.minimum(delta, np.maximum(room.size * room.most_s**3 / 48.0 - tolerance, 0.0))
    return -unit * np.where(room.size > 0.0, delta, 0.0)[:, None]


def _within(moves: Moves, room: _Room, offset: Array, tolerance: Array) -> tuple[Array, Mask]:
    """(n - 1,) the longest overlaps whose middle is within the tolerance of the waypoint, and which corners
    keep it all along; a corner on its waypoint does."""
    square = np.maximum(room.size**2, _TINY)
    toward, far = (offset * room.across).sum(axis=1), (offset * offset).sum(axis=1)
    inside = toward * toward - square * (far - tolerance * tolerance)
    cube = (np.sqrt(np.maximum(inside, 0.0)) - toward) / square
    tau = np.minimum(np.cbrt(48.0 * cube), room.most_s)
    good = inside >= 0.0
    # where the path turns by less than a right angle, it passes the ends of its segments only in the middle
    sharp = (moves.along[:-1] * moves.along[1:]).sum(axis=1) < 0.0
    rows = np.flatnonzero(good & sharp & (far > 0.0))
    if rows.size:
        good[rows] = _close(moves, room, offset, tolerance, rows, tau[rows])
    return tau, good


def _close(moves: Moves, room: _Room, offset: Array, tolerance: Array, corner: Index, tau: Array) -> Mask:
    """(k,) whether the path beyond the end of its own segment is within the tolerance of the waypoint."""
    u1, u2, share = moves.along[corner], moves.along[corner + 1], room.share[corner]
    fits = np.ones(len(corner), bool)
    for part in _CHECKED:
        s1 = moves.heads(corner, tau * (1.0 - part), share)[0]
        s2 = moves.heads(corner + 1, tau * part, share)[0]
        place = offset[corner] - u1 * s1[:, None] + u2 * s2[:, None]
        away = np.sqrt((place * place).sum(axis=1))
        beyond = (place * u1).sum(axis=1) if part < 0.5 else -(place * u2).sum(axis=1)
        fits &= (away <= tolerance[corner]) | (beyond <= 0.0) | (part == 0.5)
    return fits
