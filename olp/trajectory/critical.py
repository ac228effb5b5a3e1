"""Speed along a smooth path, in closed form: ramps between the places that bind.

Every piece has ceilings of the speed, acceleration and jerk along it (olp.trajectory.ceilings). The profile
runs from node to node, where its acceleration is nil, by a ramp up, a stretch at one speed and a ramp down.
Nodes are the rests, and the dips of the speed's ceiling that bind even where jerk is free; a profile that is
too fast somewhere gets a node at the worst place, until none is (bidirectional scan with jerk: Dong,
Ferreira, Stori 2007; pruned to the critical points as VPOp does).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.trajectory import ramps
from olp.trajectory.ceilings import ceilings
from olp.trajectory.growing import Growing
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath

#: share of each limit that curvature may use up at full speed: in general, where the first profile holds its
#: speed, and in a bend between straights, where nothing is left to do but to pass
_BY_SPEED, _BY_DIP, BY_BEND = 0.6, 0.8, 0.97
_LEVEL = 1.02
_BINDS, _TOO_FAST, _PATIENT = 1e-6, 1e-8, 40
#: pieces of the path, and spans of a profile, worked on at a time
_BLOCK, _SPANS = 1 << 17, 1 << 15
#: chains of nodes that are followed one by one rather than all at once
_ALONE, _TINY = 24, 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Speed along a path: `node` (m + 1,) breaks of the path at which the acceleration is nil, `speed`
    (m + 1,) there; between, up to `peak` (m,) with `acceleration` and `jerk` (m,). mm, s."""

    node: Index
    speed: Array
    peak: Array
    acceleration: Array
    jerk: Array


def profile(path: SmoothPath, limits: AxisLimits, share: Array) -> Profile:
    """The speed profile from rest to rest, within the ceilings of every piece for `share` (k,)."""
    top, most_a, most_j = ceilings(path, limits, share)
    x = path.break_mm
    ceiling = np.concatenate(([0.0], np.minimum(top[:-1], top[1:]), [0.0]))
    ceiling[path.rest] = 0.0
    node = _dips(x, top, ceiling, most_a)
    turn = 0
    while True:
        at = np.flatnonzero(node)
        begin = at[:-1]
        way = np.diff(x[at])
        a, j = np.minimum.reduceat(most_a, begin), np.minimum.reduceat(most_j, begin)
        speed = _reachable(ceiling[at], way, a, j)
        peak = ramps.peak(speed[:-1], speed[1:], way, np.maximum.reduceat(top, begin), a, j)
        found = Profile(at, speed, peak, a, j)
        worst = _too_fast(x, top, found, everywhere=turn >= _PATIENT)
        if not worst.size:
            return found
        node[worst] = True
        node[worst + 1] = True
        turn += 1


def _dips(x: Array, top: Array, ceiling: Array, acceleration: Array) -> Mask:
    """(k + 1,) where it rests, and both ends of the pieces whose ceiling is lower than that of a neighbour,
    higher than that of none, and reached where only acceleration is bounded (no jerk-bounded profile is
    faster)."""
    node = np.zeros(len(x), bool)
    node[ceiling == 0.0] = True
    free = free_speeds(x, ceiling, acceleration)
    before = np.concatenate(([np.inf], top[:-1]))
    behind = np.concatenate((top[1:], [np.inf]))
    dip = (top <= before) & (top <= behind) & ((top < before) | (top < behind))
    dip &= np.maximum(free[:-1], free[1:]) >= top * (1.0 - _BINDS)
    node[:-1] |= dip
    node[1:] |= dip
    return node


def free_speeds(x: Array, ceiling: Array, acceleration: Array) -> Array:
    """(k + 1,) the most speeds at the breaks, below their ceilings, where jerk is free."""
    square = ceiling * ceiling
    rise = np.minimum(2.0 * acceleration * np.diff(x), float(square.max(initial=0.0)))
    total = np.concatenate(([0.0], np.cumsum(rise)))
    square = np.minimum(square, total + np.minimum.accumulate(square - total))
    total = total[-1] - total
    back = (square - total)[::-1]
    square = np.minimum(square, total + np.minimum.accumulate(back)[::-1])
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def _reachable(ceiling: Array, way: Array, a: Array, j: Array) -> Array:
    """(m + 1,) the most speeds at the nodes that ramps can join, both ways."""
    forward = _scan(ceiling, way, a, j)
    return _scan(forward[::-1].copy(), way[::-1], a[::-1], j[::-1])[::-1].copy()


def _scan(ceiling: Array, way: Array, a: Array, j: Array) -> Array:
    """Speeds such that every rise is one a ramp can make: waves of all nodes at once that lower the speed
    behind those lowered before; they die out within a chain of rising nodes."""
    speed = ceiling.copy()
    todo = np.flatnonzero(speed[1:] > speed[:-1])
    while todo.size:
        if todo.size < _ALONE:
            _follow(speed, todo, way, a, j)
            break
        most = ramps.reach(speed[todo], way[todo], a[todo], j[todo])
        lower = most < speed[todo + 1]
        todo = todo[lower] + 1
        speed[todo] = most[lower]
        todo = todo[todo < len(way)]
        todo = todo[speed[todo + 1] > speed[todo]]
    return speed


def _follow(speed: Array, starts: Index, way: Array, a: Array, j: Array) -> None:
    """The scan from few nodes on, each until its chain ends."""
    last = len(way)
    for k in starts.tolist():
        v = float(speed[k])
        while k < last and speed[k + 1] > v:
            v = ramps.reach_one(v, float(way[k]), float(a[k]), float(j[k]))
            if v >= speed[k + 1]:
                break
            k += 1
            speed[k] = v


def _too_fast(x: Array, top: Array, found: Profile, everywhere: bool) -> Index:
    """The piece of each span that the profile exceeds the most (all of them, if `everywhere`)."""
    begin, end = found.node[:-1], found.node[1:]
    slow = np.flatnonzero(np.minimum.reduceat(top, begin) * (1.0 + _TOO_FAST) < found.peak)
    chosen: list[Index] = []
    at = 0
    count = np.cumsum(end[slow] - begin[slow])
    while at < len(slow):
        stop = max(int(np.searchsorted(count, (count[at - 1] if at else 0) + _BLOCK)), at + 1)
        chosen.append(_too_fast_of(x, top, found, slow[at:stop], everywhere))
        at = stop
    return np.concatenate(chosen) if chosen else np.zeros(0, np.int64)


def _too_fast_of(x: Array, top: Array, found: Profile, spans: Index, everywhere: bool) -> Index:
    begin, size = found.node[spans], found.node[spans + 1] - found.node[spans]
    first = np.concatenate(([0], np.cumsum(size)[:-1]))
    span = np.repeat(spans, size)
    piece = np.arange(len(span)) - np.repeat(first - begin, size)
    limit = top[piece] * (1.0 + _TOO_FAST)
    pick = limit < found.peak[span]
    span, piece, limit = span[pick], piece[pick], limit[pick]
    v0, v1, peak = found.speed[span], found.speed[span + 1], found.peak[span]
    a, j = found.acceleration[span], found.jerk[span]
    left, whole = x[piece] - x[found.node[span]], x[found.node[span + 1]] - x[found.node[span]]
    right = x[piece + 1] - x[found.node[span]]
    up = np.where(limit > v0, ramps.passing(np.maximum(limit, v0), v0, peak, a, j), 0.0)
    down = whole - np.where(limit > v1, ramps.passing(np.maximum(limit, v1), v1, peak, a, j), 0.0)
    over = (left < down) & (right > up)
    if not over.any():
        return np.zeros(0, np.int64)
    if everywhere:
        out: Index = piece[over]
        return out
    span, piece = span[over], piece[over]
    v0, v1, peak, a, j, left, right, whole = (e[over] for e in (v0, v1, peak, a, j, left, right, whole))
    # the speed there, good enough to rank by: on ramps as if the acceleration were constant
    rise, fall = ramps.distance(v0, peak, a, j), ramps.distance(v1, peak, a, j)
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = np.where(right < rise, v0**2 + (peak**2 - v0**2) * right / rise, peak**2)
        falling = np.where(whole - left < fall, v1**2 + (peak**2 - v1**2) * (whole - left) / fall, peak**2)
    ratio = np.minimum(rising, falling) / top[piece] ** 2
    order = np.lexsort((-ratio, span))
    head = np.concatenate(([True], span[order][1:] != span[order][:-1]))
    # how far a node at the worst place slows the profile beside it: places farther away need their own
    rank = np.cumsum(np.concatenate(([True], span[1:] != span[:-1]))) - 1
    slowest = order[head][rank]
    reach = ramps.distance(np.minimum(top[piece[slowest]], peak), peak, a, j)
    cell = np.floor(left / np.maximum(2.0 * reach, _TINY))
    order = np.lexsort((-ratio, cell, span))
    change = (span[order][1:] != span[order][:-1]) | (cell[order][1:] != cell[order][:-1])
    best = order[np.concatenate(([True], change))]
    beside = (span[best][1:] == span[best][:-1]) & (cell[best][1:] - cell[best][:-1] <= 1.0)
    less = ratio[best][1:] < ratio[best][:-1]
    keep = np.ones(len(best), bool)
    keep[1:] &= ~(beside & less)
    keep[:-1] &= ~(beside & ~less)
    worst: Index = piece[best[keep]]
    return worst


def best_profile(path: SmoothPath, limits: AxisLimits) -> Profile:
    """The fastest profile found along a path of one piece and more."""
    share = _shares(path)
    first = profile(path, limits, share)
    _give_dips(first, share)
    second = profile(path, limits, share)
    return _by_run(path, first, second)


def _by_run(path: SmoothPath, first: Profile, second: Profile) -> Profile:
    """From one rest to the next the faster of two profiles."""
    both = (first, second)
    run = [np.searchsorted(path.rest, found.node[:-1], side="right") for found in both]
    before, after = (
        np.bincount(of, _seconds(path, found), minlength=len(path.rest) + 1)
        for of, found in zip(run, both, strict=True)
    )
    better = after < before
    if better.all() or not better.any():
        return second if better.all() else first
    spans = [np.flatnonzero(mine[of]) for mine, of in zip((~better, better), run, strict=True)]
    order = np.argsort(np.concatenate([found.node[k] for found, k in zip(both, spans, strict=True)]))

    def merged(one: Array, other: Array) -> Array:
        result: Array = np.concatenate((one[spans[0]], other[spans[1]]))[order]
        return result

    begins = np.concatenate((first.node[spans[0]], second.node[spans[1]]))[order]
    return Profile(
        np.append(begins, first.node[-1]),
        np.append(merged(first.speed, second.speed), 0.0),
        merged(first.peak, second.peak),
        merged(first.acceleration, second.acceleration),
        merged(first.jerk, second.jerk),
    )


def _shares(path: SmoothPath) -> Array:
    """(k,) share of the limits for curvature, from the look of the path."""
    straight = np.ones(len(path) + 4, bool)
    straight[2:-2] = ~path.shape[:, 2:].any(axis=(1, 2))
    lonely = ~straight[2:-2] & (
        (straight[1:-3] & straight[4:]) | (straight[:-4] & straight[3:-1]) | (straight[1:-3] & straight[3:-1])
    )
    return np.where(lonely, BY_BEND, _BY_SPEED)


def _give_dips(found: Profile, share: Array) -> None:
    """Where the profile holds its speed over a whole piece between two nodes, curvature may use up more."""
    held = np.diff(found.node) == 1
    held &= found.peak < _LEVEL * np.minimum(found.speed[:-1], found.speed[1:])
    dips = found.node[:-1][held]
    share[dips] = np.maximum(share[dips], _BY_DIP)


def seconds(path: SmoothPath, found: Profile) -> float:
    """Time of a profile."""
    return float(_seconds(path, found).sum())


def _seconds(path: SmoothPath, found: Profile) -> Array:
    """(m,) times between its nodes."""
    way = np.diff(path.break_mm[found.node])
    total = np.zeros_like(way)
    for end in (found.speed[:-1], found.speed[1:]):
        ramp = ramps.seconds(end, found.peak, found.acceleration, found.jerk)
        way -= 0.5 * (end + found.peak) * ramp
        total += ramp
    return np.asarray(total + np.maximum(way, 0.0) / found.peak)


def driven(path: SmoothPath, found: Profile) -> Motion:
    """The motion of a profile: cut wherever the path or the jerk changes, each piece from its own start."""
    starts, times = Growing(np.zeros(0)), Growing(np.zeros((0, 4)))
    shapes, at = Growing(np.zeros(0, np.int64)), 0.0
    starts.append(np.zeros(1))
    for lo in range(0, len(found.peak), _SPANS):
        hi = min(lo + _SPANS, len(found.peak))
        some = Profile(found.node[lo : hi + 1], found.speed[lo : hi + 1],
                       *(e[lo:hi] for e in (found.peak, found.acceleration, found.jerk)))  # fmt: skip
        end_s, time, shape = _driven(path, some)
        starts.append(at + end_s)
        at += float(end_s[-1])
        times.append(time)
        shapes.append(shape)
    which = shapes.whole()
    return Motion(starts.whole(), times.whole(), path.shape, which, path.line[which])


def _driven(path: SmoothPath, found: Profile) -> tuple[Array, Array, Index]:
    """Of the pieces (p,) of some spans: seconds until each ends, (p, 4) polynomials, piece of the path."""
    low, high = int(found.node[0]), int(found.node[-1])
    x = path.break_mm[low:high]
    clock = Timeline.of(path, found)
    # breaks of the path inside a phase; those at the start of one are there already
    phase = np.searchsorted(clock.way, x, side="right") - 1
    inside = np.flatnonzero(clock.way[phase] != x)
    phase = phase[inside]
    u = clock.when(phase, x[inside])
    v, a, j = clock.speed[phase], clock.acceleration[phase], clock.jerk[phase]
    order = np.argsort(np.concatenate((clock.way, x[inside])), kind="stable")
    begin = np.concatenate((clock.start_s[:-1], clock.start_s[phase] + u))[order]
    shape = np.concatenate((np.searchsorted(x, clock.way, side="right") - 1, inside))[order]
    time = np.empty((len(order), 4))
    time[:, 0] = np.concatenate((clock.way, x[inside]))[order] - x[shape]
    time[:, 1] = np.concatenate((clock.speed, np.maximum(v + u * (a + 0.5 * u * j), 0.0)))[order]
    time[:, 2] = np.concatenate((clock.acceleration, a + u * j))[order] / 2.0
    time[:, 3] = np.concatenate((clock.jerk, j))[order] / 6.0
    return np.append(begin[1:], clock.start_s[-1]), time, shape + low


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """The phases (p,) of constant jerk of a profile: `start_s` (p + 1,); way, speed, acceleration and jerk at
    the start of each and how long it `lasts`; `first` (m + 1,) of each span, and their number."""

    start_s: Array
    way: Array
    speed: Array
    acceleration: Array
    jerk: Array
    lasts: Array
    first: Index

    @staticmethod
    def of(path: SmoothPath, found: Profile) -> Timeline:
        v0, v1, peak, a, j = found.speed[:-1], found.speed[1:], found.peak, found.acceleration, found.jerk
        begin = path.break_mm[found.node[:-1]]
        whole = np.diff(path.break_mm[found.node])
        up, up_flat = ramps.phases(v0, peak, a, j)
        down, down_flat = ramps.phases(peak, v1, a, j)
        rise, fall = ramps.distance(v0, peak, a, j), ramps.distance(peak, v1, a, j)
        with np.errstate(divide="ignore", invalid="ignore"):
            cruise = np.where(peak > 0.0, np.maximum(whole - rise - fall, 0.0) / peak, 0.0)
        lasts = np.stack((up, up_flat, up, cruise, down, down_flat, down), axis=1)
        zero = np.zeros_like(j)
        jerk = np.stack((j, zero, -j, zero, -j, zero, j), axis=1)
        high, low = j * up, -j * down
        acceleration = np.stack((zero, high, high, zero, zero, low, low), axis=1)
        gain, loss = 0.5 * high * up, 0.5 * low * down
        speed = np.stack((v0, v0 + gain, peak - gain, peak, peak, peak + loss, v1 - loss), axis=1)
        start = np.empty_like(lasts)
        start[:, 0] = begin
        for i in range(6):
            t = lasts[:, i]
            step = t * (speed[:, i] + t * (acceleration[:, i] / 2.0 + t * jerk[:, i] / 6.0))
            start[:, i + 1] = np.minimum(start[:, i] + step, begin + whole)
        used = lasts > 0.0
        start_s = np.concatenate(([0.0], np.cumsum(lasts[used])))
        first = np.concatenate(([0], np.cumsum(used.sum(axis=1))))
        return Timeline(start_s, start[used], speed[used], acceleration[used], jerk[used], lasts[used], first)

    def when(self, phase: Index, way: Array) -> Array:
        """(n,) seconds into phases (n,) at which ways (n,) are reached."""
        v, a, j = self.speed[phase], self.acceleration[phase], self.jerk[phase]
        return ramps.when(np.maximum(way - self.way[phase], 0.0), v, a, j, self.lasts[phase])

    def way_at(self, time_s: Array) -> Array:
        """(n,) ways at times (n,)."""
        k = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, len(self.way) - 1)
        u = time_s - self.start_s[k]
        return np.asarray(
            self.way[k] + u * (self.speed[k] + u * (self.acceleration[k] / 2.0 + u * self.jerk[k] / 6.0))
        )

    def at_way(self, way: Array) -> tuple[Array, Array]:
        """Speed and acceleration (n,) at ways (n,)."""
        k = np.clip(np.searchsorted(self.way, way, side="right") - 1, 0, len(self.way) - 1)
        v, a, j, u = self.speed[k], self.acceleration[k], self.jerk[k], self.when(k, way)
        return np.maximum(v + u * (a + 0.5 * u * j), 0.0), a + u * j
