"""Speed along a smooth path, in closed form: ramps between critical points.

Every piece has ceilings of the speed, acceleration and jerk along it (olp.trajectory.ceilings). The profile
runs from node to node, where its acceleration is zero, by a ramp up, a stretch at one speed and a ramp down.
Nodes are the rests, and the dips of the speed's ceiling that bind even where jerk is free, and bends that
leave hardly any acceleration. Where a profile is too fast, the worst piece becomes a node; this is repeated
until none is too fast.
Source: bidirectional scan with jerk, Dong, Ferreira, Stori 2007; pruned to the critical points as in VPOp.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.trajectory import ramps
from olp.trajectory.ceilings import ceilings
from olp.trajectory.growing import Growing
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath

#: share of each limit that curvature may use at full speed, in general
_BY_SPEED = 0.6
#: the same where the first profile holds its speed over a whole piece
_BY_DIP = 0.8
#: the same in a bend between straights, where there is no reason to accelerate
BY_BEND = 0.97
#: a peak below this factor times the speeds at its nodes counts as one speed
_LEVEL = 1.02
#: share below a ceiling within which a speed reaches it
_BINDS = 1e-6
#: share above a ceiling beyond which a profile is too fast; less is rounding
_TOO_FAST = 1e-8
#: share by which ceilings differ that are equal but for rounding
_EVEN = 1e-9
#: a piece that allows less than this share of the acceleration beside it is a node where the speed is held
_WEAK = 0.1
#: turns after which every piece that is too fast becomes a node, not only the worst ones
_PATIENT = 40
#: pieces of the path per block
_BLOCK = 1 << 17
#: spans of a profile per block
_SPANS = 1 << 15
#: fewer chains of nodes than this are followed one by one, not all at once
_ALONE = 24
#: against division by zero
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Speed along a path: `node` (m + 1,) breaks of the path at which the acceleration is nil, `speed`
    (m + 1,) there; between, up to `peak` (m,) with `acceleration` and `jerk` (m,). mm, s."""

    node: Index
    speed: Array
    peak: Array
    acceleration: Array
    jerk: Array


def speed_profile(path: SmoothPath, limits: AxisLimits, share: Array) -> Profile:
    """The speed profile from rest to rest, within the ceilings of every piece for `share` (k,)."""
    return profile_within(path.break_mm, path.rest, *ceilings(path, limits, share))


def profile_within(x: Array, rest: Index, top: Array, most_a: Array, most_j: Array) -> Profile:
    """The profile over breaks (k + 1,) in mm, of which those of `rest` are stops, with at most the speed
    `top`, the acceleration and the jerk (k,) along each piece."""
    ceiling = np.concatenate(([0.0], np.minimum(top[:-1], top[1:]), [0.0]))
    ceiling[rest] = 0.0
    node = _dips(x, top, ceiling, most_a)
    turn = 0
    while True:
        index = np.flatnonzero(node)
        begin = index[:-1]
        length = np.diff(x[index])
        a, j = np.minimum.reduceat(most_a, begin), np.minimum.reduceat(most_j, begin)
        speed = _reachable(ceiling[index], length, a, j)
        peak = ramps.peak(speed[:-1], speed[1:], length, np.maximum.reduceat(top, begin), a, j)
        profile = Profile(index, speed, peak, a, j)
        worst = _too_fast(x, top, profile, everywhere=turn >= _PATIENT)
        if not worst.size:
            return profile
        node[worst] = True
        node[worst + 1] = True
        turn += 1


def _dips(x: Array, top: Array, ceiling: Array, acceleration: Array) -> Mask:
    """(k + 1,) the rests, and both ends of the pieces whose ceiling is a dip that binds.

    A dip is lower than a neighbour and higher than none, or allows far less acceleration. It binds where a
    profile without a jerk limit reaches it; no jerk-bounded profile is faster than that."""
    node = np.zeros(len(x), bool)
    node[ceiling == 0.0] = True
    free = free_speeds(x, ceiling, acceleration)
    before = np.concatenate(([np.inf], top[:-1]))
    behind = np.concatenate((top[1:], [np.inf]))
    level = top * (1.0 - _EVEN)
    dip = (
        (level <= before)
        & (level <= behind)
        & ((top < before * (1.0 - _EVEN)) | (top < behind * (1.0 - _EVEN)))
    )
    dip &= np.maximum(free[:-1], free[1:]) >= top * (1.0 - _BINDS)
    # a bend that the feed takes with hardly any acceleration left would slow the ramps beside it
    weak = np.zeros(len(top), bool)
    weak[1:] |= acceleration[1:] < _WEAK * acceleration[:-1]
    weak[:-1] |= acceleration[:-1] < _WEAK * acceleration[1:]
    dip |= weak & (np.minimum(free[:-1], free[1:]) >= top * (1.0 - _BINDS))
    if len(top) > 1:
        # an end that goes on as it begins is none
        for end, beside in ((0, 1), (-1, -2)):
            same = np.allclose((top[end], acceleration[end]), (top[beside], acceleration[beside]), _EVEN, 0.0)
            dip[end] &= not same
    node[:-1] |= dip
    node[1:] |= dip
    return node


def free_speeds(x: Array, ceiling: Array, acceleration: Array) -> Array:
    """(k + 1,) largest speeds at the breaks, up to their ceilings, without a jerk limit."""
    square = ceiling * ceiling
    rise = np.minimum(2.0 * acceleration * np.diff(x), float(square.max(initial=0.0)))
    total = np.concatenate(([0.0], np.cumsum(rise)))
    square = np.minimum(square, total + np.minimum.accumulate(square - total))
    total = total[-1] - total
    back = (square - total)[::-1]
    square = np.minimum(square, total + np.minimum.accumulate(back)[::-1])
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def _reachable(ceiling: Array, length: Array, a: Array, j: Array) -> Array:
    """(m + 1,) largest speeds at the nodes that ramps can join in both directions."""
    forward = _scan(ceiling, length, a, j)
    return _scan(forward[::-1].copy(), length[::-1], a[::-1], j[::-1])[::-1].copy()


def _scan(ceiling: Array, length: Array, a: Array, j: Array) -> Array:
    """Speeds that rise no more than a ramp can: all nodes at once lower the speed of the next one, and those
    lowered go on, until no speed changes."""
    speed = ceiling.copy()
    todo = np.flatnonzero(speed[1:] > speed[:-1])
    while todo.size:
        if todo.size < _ALONE:
            _follow(speed, todo, length, a, j)
            break
        most = ramps.reach(speed[todo], length[todo], a[todo], j[todo])
        lower = most < speed[todo + 1]
        todo = todo[lower] + 1
        speed[todo] = most[lower]
        todo = todo[todo < len(length)]
        todo = todo[speed[todo + 1] > speed[todo]]
    return speed


def _follow(speed: Array, starts: Index, length: Array, a: Array, j: Array) -> None:
    """The same scan from few nodes, one chain after the other."""
    last = len(length)
    for k in starts.tolist():
        v = float(speed[k])
        while k < last and speed[k + 1] > v:
            v = ramps.reach_one(v, float(length[k]), float(a[k]), float(j[k]))
            if v >= speed[k + 1]:
                break
            k += 1
            speed[k] = v


def _too_fast(x: Array, top: Array, profile: Profile, everywhere: bool) -> Index:
    """The piece of each span whose ceiling the profile exceeds most (all such pieces if `everywhere`)."""
    begin, end = profile.node[:-1], profile.node[1:]
    slow = np.flatnonzero(np.minimum.reduceat(top, begin) * (1.0 + _TOO_FAST) < profile.peak)
    chosen: list[Index] = []
    done = 0
    count = np.cumsum(end[slow] - begin[slow])
    while done < len(slow):
        stop = max(int(np.searchsorted(count, (count[done - 1] if done else 0) + _BLOCK)), done + 1)
        chosen.append(_too_fast_of(x, top, profile, slow[done:stop], everywhere))
        done = stop
    return np.concatenate(chosen) if chosen else np.zeros(0, np.int64)


def _too_fast_of(x: Array, top: Array, profile: Profile, spans: Index, everywhere: bool) -> Index:
    begin, size = profile.node[spans], profile.node[spans + 1] - profile.node[spans]
    first = np.concatenate(([0], np.cumsum(size)[:-1]))
    span = np.repeat(spans, size)
    piece = np.arange(len(span)) - np.repeat(first - begin, size)
    limit = top[piece] * (1.0 + _TOO_FAST)
    pick = limit < profile.peak[span]
    span, piece, limit = span[pick], piece[pick], limit[pick]
    v0, v1, peak = profile.speed[span], profile.speed[span + 1], profile.peak[span]
    a, j = profile.acceleration[span], profile.jerk[span]
    start, whole = x[piece] - x[profile.node[span]], x[profile.node[span + 1]] - x[profile.node[span]]
    stop = x[piece + 1] - x[profile.node[span]]
    up = np.where(limit > v0, ramps.passing(np.maximum(limit, v0), v0, peak, a, j), 0.0)
    down = whole - np.where(limit > v1, ramps.passing(np.maximum(limit, v1), v1, peak, a, j), 0.0)
    over = (start < down) & (stop > up)
    if not over.any():
        return np.zeros(0, np.int64)
    if everywhere:
        every: Index = piece[over]
        return every
    span, piece = span[over], piece[over]
    v0, v1, peak, a, j, start, stop, whole = (e[over] for e in (v0, v1, peak, a, j, start, stop, whole))
    # the speed there to rank by: on ramps as if the acceleration were constant
    rise, fall = ramps.distance(v0, peak, a, j), ramps.distance(v1, peak, a, j)
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = np.where(stop < rise, v0**2 + (peak**2 - v0**2) * stop / rise, peak**2)
        falling = np.where(whole - start < fall, v1**2 + (peak**2 - v1**2) * (whole - start) / fall, peak**2)
    ratio = np.minimum(rising, falling) / top[piece] ** 2
    order = np.lexsort((-ratio, span))
    head = np.concatenate(([True], span[order][1:] != span[order][:-1]))
    # how far a node at the worst piece slows the profile beside it: pieces farther away need nodes as well
    rank = np.cumsum(np.concatenate(([True], span[1:] != span[:-1]))) - 1
    slowest = order[head][rank]
    reach = ramps.distance(np.minimum(top[piece[slowest]], peak), peak, a, j)
    cell = np.floor(start / np.maximum(2.0 * reach, _TINY))
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
    """The fastest profile along a path of one piece or more."""
    share = _shares(path)
    first = speed_profile(path, limits, share)
    _give_dips(first, share)
    second = speed_profile(path, limits, share)
    return _by_run(path, first, second)


def _by_run(path: SmoothPath, first: Profile, second: Profile) -> Profile:
    """From one rest to the next the faster of two profiles."""
    both = (first, second)
    run = [np.searchsorted(path.rest, profile.node[:-1], side="right") for profile in both]
    before, after = (
        np.bincount(of, _seconds(path, profile), minlength=len(path.rest) + 1)
        for of, profile in zip(run, both, strict=True)
    )
    better = after < before
    if better.all() or not better.any():
        return second if better.all() else first
    spans = [np.flatnonzero(mine[of]) for mine, of in zip((~better, better), run, strict=True)]
    order = np.argsort(np.concatenate([profile.node[k] for profile, k in zip(both, spans, strict=True)]))

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
    """(k,) share of the limits for curvature: larger for pieces that bend between straights."""
    straight = np.ones(len(path) + 4, bool)
    straight[2:-2] = ~path.shape[:, 2:].any(axis=(1, 2))
    lonely = ~straight[2:-2] & (
        (straight[1:-3] & straight[4:]) | (straight[:-4] & straight[3:-1]) | (straight[1:-3] & straight[3:-1])
    )
    return np.where(lonely, BY_BEND, _BY_SPEED)


def _give_dips(profile: Profile, share: Array) -> None:
    """Where the profile holds its speed over a whole piece between two nodes, curvature may use more."""
    steady = np.diff(profile.node) == 1
    steady &= profile.peak < _LEVEL * np.minimum(profile.speed[:-1], profile.speed[1:])
    dips = profile.node[:-1][steady]
    share[dips] = np.maximum(share[dips], _BY_DIP)


def seconds(path: SmoothPath, profile: Profile) -> float:
    """Time of a profile."""
    return float(_seconds(path, profile).sum())


def _seconds(path: SmoothPath, profile: Profile) -> Array:
    """(m,) seconds between its nodes."""
    length = np.diff(path.break_mm[profile.node])
    total = np.zeros_like(length)
    for end in (profile.speed[:-1], profile.speed[1:]):
        ramp = ramps.seconds(end, profile.peak, profile.acceleration, profile.jerk)
        length -= 0.5 * (end + profile.peak) * ramp
        total += ramp
    return np.asarray(total + np.maximum(length, 0.0) / profile.peak)


def driven(path: SmoothPath, profile: Profile) -> Motion:
    """The motion of a profile: cut wherever the path or the jerk changes, each piece from its own start."""
    starts, times = Growing(np.zeros(0)), Growing(np.zeros((0, 4)))
    shapes, elapsed_s = Growing(np.zeros(0, np.int64)), 0.0
    starts.append(np.zeros(1))
    for lo in range(0, len(profile.peak), _SPANS):
        hi = min(lo + _SPANS, len(profile.peak))
        some = Profile(profile.node[lo : hi + 1], profile.speed[lo : hi + 1],
                       *(e[lo:hi] for e in (profile.peak, profile.acceleration, profile.jerk)))  # fmt: skip
        end_s, time, shape = _driven(path, some)
        starts.append(elapsed_s + end_s)
        elapsed_s += float(end_s[-1])
        times.append(time)
        shapes.append(shape)
    which = shapes.whole()
    return Motion(starts.whole(), times.whole(), path.shape, which, path.line[which])


def _driven(path: SmoothPath, profile: Profile) -> tuple[Array, Array, Index]:
    """Of the pieces (p,) of some spans: seconds until each ends, (p, 4) polynomials, piece of the path."""
    low, high = int(profile.node[0]), int(profile.node[-1])
    x = path.break_mm[low:high]
    clock = Timeline.of(path.break_mm, profile)
    # breaks of the path inside a phase; those at the start of one are there already
    phase = np.searchsorted(clock.arc_mm, x, side="right") - 1
    inside = np.flatnonzero(clock.arc_mm[phase] != x)
    phase = phase[inside]
    u = clock.when(phase, x[inside])
    v, a, j = clock.speed[phase], clock.acceleration[phase], clock.jerk[phase]
    order = np.argsort(np.concatenate((clock.arc_mm, x[inside])), kind="stable")
    begin = np.concatenate((clock.start_s[:-1], clock.start_s[phase] + u))[order]
    shape = np.concatenate((np.searchsorted(x, clock.arc_mm, side="right") - 1, inside))[order]
    time = np.empty((len(order), 4))
    time[:, 0] = np.concatenate((clock.arc_mm, x[inside]))[order] - x[shape]
    time[:, 1] = np.concatenate((clock.speed, np.maximum(v + u * (a + 0.5 * u * j), 0.0)))[order]
    time[:, 2] = np.concatenate((clock.acceleration, a + u * j))[order] / 2.0
    time[:, 3] = np.concatenate((clock.jerk, j))[order] / 6.0
    return np.append(begin[1:], clock.start_s[-1]), time, shape + low


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """The phases (p,) of constant jerk of a profile, from `start_s` (p + 1,) on. Arc length, speed,
    acceleration and jerk are those at the start of each, which `lasts` so long. `first` (m + 1,) is the first
    phase of each span, and their number."""

    start_s: Array
    arc_mm: Array
    speed: Array
    acceleration: Array
    jerk: Array
    lasts: Array
    first: Index

    @staticmethod
    def of(break_mm: Array, profile: Profile) -> Timeline:
        v0, v1 = profile.speed[:-1], profile.speed[1:]
        peak, a, j = profile.peak, profile.acceleration, profile.jerk
        begin = break_mm[profile.node[:-1]]
        whole = np.diff(break_mm[profile.node])
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

    def when(self, phase: Index, arc_mm: Array) -> Array:
        """(n,) seconds into phases (n,) at which arc lengths (n,) are reached."""
        v, a, j = self.speed[phase], self.acceleration[phase], self.jerk[phase]
        return ramps.when(np.maximum(arc_mm - self.arc_mm[phase], 0.0), v, a, j, self.lasts[phase])

    def arc_at(self, time_s: Array) -> Array:
        """(n,) arc lengths at times (n,)."""
        k = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, len(self.arc_mm) - 1)
        u = time_s - self.start_s[k]
        return np.asarray(
            self.arc_mm[k] + u * (self.speed[k] + u * (self.acceleration[k] / 2.0 + u * self.jerk[k] / 6.0))
        )

    def state_at(self, arc_mm: Array) -> tuple[Array, Array]:
        """Speed and acceleration (n,) at arc lengths (n,)."""
        k = np.clip(np.searchsorted(self.arc_mm, arc_mm, side="right") - 1, 0, len(self.arc_mm) - 1)
        v, a, j, u = self.speed[k], self.acceleration[k], self.jerk[k], self.when(k, arc_mm)
        return np.maximum(v + u * (a + 0.5 * u * j), 0.0), a + u * j
