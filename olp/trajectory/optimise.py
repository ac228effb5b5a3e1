"""Speed along a smooth path by optimisation: what closed forms leave, where ceilings vary smoothly.

The closed-form profile gives a grid of cells, even in time, and a start inside every bound. The square of the
speed is optimised on it in windows that end where the profile is slow; pieces that exceed a bound between the
rows get tighter rows, and the window is solved again. From and to rest the speed grows as (way)^(2/3), which
no spline of its square follows, so both ends launch and land at constant jerk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import LinAlgError

from olp.core.arrays import Array, Index
from olp.trajectory.critical import Profile, Timeline
from olp.trajectory.interior import Rows, Spline, fits, least_time
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath
from olp.trajectory.speedgrid import CELL_S, grid, speed_caps

#: cells of a window, and how far from there it may end, in windows
_WINDOW, _MARGIN = 3000, 0.35
#: how much slower than the closed form windows begin and end, and their start is; further shares of the
#: square of the speed that are tried for that; cells of a window that is not split for want of a start
_SLOWED, _STARTS, _SMALL = 0.85, (1.0, 0.7, 0.35), 100
#: share of the first phase of jerk that the launch takes, and where its way would not have as many _DIGITS;
#: share of a cell's time that its neighbour lasts
_LAUNCH, _LONGEST, _DIGITS, _CLEAR = 0.04, 0.25, 1e8, 0.4
#: growth of the times of cells after a launch, their most, and the part of a window that they may take
_GROW, _MOST, _PART = 1.2, 40, 0.4
#: fewest cells of a window
_FEW = 8
#: places of a piece between breaks: rows, and where usage is looked at
_ROWS, _LOOKED = 3, 9
#: points of the rule by which cells are timed
_GAUSS = 12
#: b may change by this in one quintic, or its cell is halved, so often at most
_STEEP, _HALVES = 1.5, 8
#: usage that is let be in each turn of tightening rows, and the starts that are tried then
_LET_BE, _AGAIN = (1.002, 1.002, 1.01, 1.01), (0.95, 0.85, 0.7, 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class _Driven:
    """A stretch from `way` to way (m + 1,), and how it is gone in `seconds` (m,): the coefficients (m, 6) of
    time of each step of it."""

    way: Array
    seconds: Array
    time: Array


def optimised(path: SmoothPath, limits: AxisLimits, found: Profile) -> Motion:
    """A motion along `path` from rest to rest that starts its search from the closed-form profile `found`.

    Bounds are kept at the rows of the search; between them they may be exceeded slightly: audit it.
    """
    clock = Timeline.of(path, found)
    cap = speed_caps(path, limits)
    knots = grid(path, limits, found, cap, clock)
    todo = list(pairwise(_edges(path, found, knots)))[::-1]
    parts = []
    while todo:
        first, last = todo.pop()
        window = _Window.of(path, limits, found, clock, cap, knots, first, last)
        driven = window.solved()
        if driven is None and len(window.spline.h) > _SMALL and last - first > 1:
            middle = _middle(found, first, last)
            todo += [(middle, last), (first, middle)]
            continue
        parts.append(driven or _as_found(path, found, clock, first, last))
    return _motion(path, parts)


def _as_found(path: SmoothPath, found: Profile, clock: Timeline, first: int, last: int) -> _Driven:
    """The closed form between two of its nodes, slowed to meet its neighbours."""
    part = slice(int(clock.first[first]), int(clock.first[last]))
    way = np.append(clock.way[part], path.break_mm[found.node[last]])
    powers = _SLOWED ** np.arange(6.0)
    time = np.zeros((len(way) - 1, 6))
    time[:, 1], time[:, 2], time[:, 3] = (
        clock.speed[part], clock.acceleration[part] / 2.0, clock.jerk[part] / 6.0,
    )  # fmt: skip
    return _Driven(way, clock.lasts[part] / _SLOWED, time * powers)


def _middle(found: Profile, first: int, last: int) -> int:
    """The slowest node of the middle half between two."""
    quarter = (last - first) // 4
    lo, hi = max(first + quarter, first + 1), max(last - quarter, first + 2)
    return lo + int(np.argmin(found.speed[lo:hi]))


def _edges(path: SmoothPath, found: Profile, knots: Array) -> list[int]:
    """The nodes at which windows begin and end: the slowest within reach of an even split."""
    place = np.searchsorted(knots, path.break_mm[found.node])
    count = max(round(len(knots) / _WINDOW), 1)
    edges = [0]
    for i in range(1, count):
        about = np.array([i - _MARGIN, i + _MARGIN]) * len(knots) / count
        lo, hi = np.searchsorted(place, about)
        if hi > lo > edges[-1]:
            edges.append(int(lo + np.argmin(found.speed[lo:hi])))
    return [*edges, len(found.node) - 1]


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """A window's end: `way` where its cells end, `speed` and `acceleration` there over the slow-down; the
    `seconds` times the slow-down of the launch or landing beyond (0: none), the way `rest` where that ends,
    the `knots` beside it, and the way `clear` of them where others may be."""

    way: float
    speed: float
    acceleration: float
    seconds: float
    rest: float
    knots: Array
    clear: float

    @staticmethod
    def of(found: Profile, clock: Timeline, x: Array, node: int, span: int, most_s: float) -> _End:
        """The end at a node beside a span of the profile, with knots for `most_s` seconds from there, which
        are negative before an end."""
        way, speed, sign = float(x[found.node[node]]), float(found.speed[node]), float(np.sign(most_s))
        if speed > 0.0:
            return _End(way, speed, 0.0, 0.0, way, np.zeros(0), way + sign * _CLEAR * CELL_S * speed)
        a, j, peak = (float(e[span]) for e in (found.acceleration, found.jerk, found.peak))
        phase = min(a / j, float(np.sqrt(peak / j)))
        fine = j * (_LAUNCH * phase) ** 3 > _DIGITS * np.spacing(x[-1])
        seconds = (_LAUNCH if fine else _LONGEST) * phase
        gone = j * seconds**3 / 6.0
        # cells that grow in time until they are as long as all others
        times = seconds * _GROW ** np.arange(1.0, _MOST)
        times = times[fine & (times * (1.0 - 1.0 / _GROW) < CELL_S) & (times < abs(most_s))]
        knots = clock.way_at(clock.start_s[clock.first[node]] + sign * times)
        begin = way + sign * gone
        last = np.concatenate(([way, begin], knots))[-2:]
        clear = float(last[1] + _CLEAR * (last[1] - last[0]))
        return _End(begin, 0.5 * j * seconds**2, sign * j * seconds, seconds, way, knots, clear)


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """A stretch between two nodes of the profile: its ends, rows, and the `start` of the search, times the
    square of a slow-down."""

    begin: _End
    end: _End
    rows: _Rows
    spline: Spline
    start: Array

    @staticmethod
    def of(
        path: SmoothPath, limits: AxisLimits, found: Profile, clock: Timeline, cap: Array, knots: Array,
        first: int, last: int,
    ) -> _Window:  # fmt: skip
        x = path.break_mm
        lasts = float(clock.start_s[clock.first[last]] - clock.start_s[clock.first[first]])
        begin = _End.of(found, clock, x, first, first, _PART * lasts)
        end = _End.of(found, clock, x, last, last - 1, -_PART * lasts)
        inner = knots[np.searchsorted(knots, begin.clear) : np.searchsorted(knots, end.clear)]
        z = np.concatenate(([begin.way], begin.knots, inner, end.knots[::-1], [end.way]))
        if len(z) <= _FEW:
            z = np.linspace(begin.way, end.way, _FEW + 1)
        speed, acceleration = clock.at_way(z)
        speed[0], speed[-1] = begin.speed, end.speed
        acceleration[0], acceleration[-1] = begin.acceleration, end.acceleration
        spline = Spline(z)
        start = spline.fitted(speed**2, 2.0 * acceleration)
        return _Window(begin, end, _Rows.of(path, limits, cap, z), spline, start)

    def solved(self) -> _Driven | None:
        """The stretch in least time; None where no start is inside the bounds."""
        rows = self.rows.rows()
        for share in _STARTS:
            start = _SLOWED**2 * self.start
            start[2:-2] *= share
            if fits(rows, self.spline, start):
                break
        else:
            return None
        try:
            c = self.spline.cells(_tightened(self.rows, rows, self.spline, start))
        except LinAlgError:
            return None
        way, speed, acceleration, seconds = _states(self.rows.knot, self.spline.h, c)
        if self.begin.seconds:
            way, speed, acceleration = (
                np.append(e, rest) for e, rest in ((self.begin.rest, way), (0.0, speed), (0.0, acceleration))
            )
            seconds = np.append(self.begin.seconds / _SLOWED, seconds)
        if self.end.seconds:
            way, speed, acceleration = (
                np.append(rest, e) for e, rest in ((self.end.rest, way), (0.0, speed), (0.0, acceleration))
            )
            seconds = np.append(seconds, self.end.seconds / _SLOWED)
        return _Driven(way, seconds, _quintics(way, speed, acceleration, seconds))


def _tightened(rows_at: _Rows, rows: Rows, spline: Spline, start: Array) -> Array:
    """The coefficients of least time, with rows tightened beside places that exceed a bound."""
    beta = least_time(rows, spline, start)
    for let_be in _LET_BE:
        worst = rows_at.worst(spline.cells(beta))
        over = worst > let_be
        if not over.any():
            break
        rows_at.share[over] /= worst[over]
        rows = rows_at.rows()
        for slowed in _AGAIN:
            again = beta.copy()
            again[2:-2] *= slowed
            if fits(rows, spline, again):
                break
        else:
            if not fits(rows, spline, start):
                break
            again = start
        beta = least_time(rows, spline, again)
    return beta


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The pieces of a window, cut at breaks of the path and knots of the speed: from `low` to `high` (n,) in
    cell `cell` and piece `piece` of the path, with `share` (n,) of the limits to keep."""

    path: SmoothPath
    limits: AxisLimits
    cap: Array
    knot: Array
    low: Array
    high: Array
    cell: Index
    piece: Index
    share: Array

    @staticmethod
    def of(path: SmoothPath, limits: AxisLimits, cap: Array, z: Array) -> _Rows:
        x = path.break_mm
        inside = x[np.searchsorted(x, z[0], side="right") : np.searchsorted(x, z[-1])]
        cut = np.union1d(inside, z)
        middle = 0.5 * (cut[1:] + cut[:-1])
        cell = np.clip(np.searchsorted(z, middle, side="right") - 1, 0, len(z) - 2)
        piece = np.clip(np.searchsorted(x, middle, side="right") - 1, 0, len(path) - 1)
        return _Rows(path, limits, cap, z, cut[:-1], cut[1:], cell, piece, np.ones(len(middle)))

    def _at(self, places: int) -> Rows:
        part = np.linspace(0.0, 1.0, places)
        place = (self.low[:, None] + (self.high - self.low)[:, None] * part).ravel()
        piece, cell = np.repeat(self.piece, places), np.repeat(self.cell, places)
        share = np.repeat(self.share, places)
        derivatives = self.path.derivatives(piece, place)
        return Rows.of(self.knot, cell, place, derivatives, self.cap[piece], self.limits, share)

    def rows(self) -> Rows:
        return self._at(_ROWS)

    def worst(self, c: Array) -> Array:
        """(n,) largest usage of each piece."""
        whole = replace(self, share=np.ones(len(self.share)))
        return np.asarray(whole._at(_LOOKED).usage(c).reshape(-1, _LOOKED).max(axis=1))


def _states(knot: Array, h: Array, c: Array) -> tuple[Array, Array, Array, Array]:
    """Way, speed and acceleration (k + 1,) at the knots and at halves of cells in which b changes much, and
    the seconds (k,) between. A quintic through such states is the motion all but to rounding."""
    cell, low, high = np.arange(len(h)), np.zeros(len(h)), np.ones(len(h))

    def square(i: Index, t: Array) -> Array:
        return np.asarray(c[0, i] + t * (c[1, i] + t * c[2, i]))

    for _ in range(_HALVES):
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.nan_to_num(-0.5 * c[1, cell] / c[2, cell])
        some = np.stack([square(cell, t) for t in (low, high, np.clip(turn, low, high))])
        wide = some.max(axis=0) > _STEEP * some.min(axis=0)
        if not wide.any():
            break
        count = np.where(wide, 2, 1)
        middle = 0.5 * (low + high)
        second = np.concatenate(([False], np.repeat(wide, count)[1:]))
        second &= np.concatenate(([False], np.diff(np.repeat(np.arange(len(cell)), count)) == 0))
        first = np.repeat(wide, count) & ~second
        cell, middle = np.repeat(cell, count), np.repeat(middle, count)
        low, high = (
            np.where(second, middle, np.repeat(low, count)),
            np.where(first, middle, np.repeat(high, count)),
        )
    node, weight = np.polynomial.legendre.leggauss(_GAUSS)
    t = low + 0.5 * (high - low) * (node[:, None] + 1.0)
    seconds = (high - low) * h[cell] * (0.5 * weight @ (1.0 / np.sqrt(square(cell, t))))
    cell, t = np.append(cell, cell[-1]), np.append(low, 1.0)
    way = np.append(knot[cell[:-1]] + low * h[cell[:-1]], knot[-1])
    return way, np.sqrt(square(cell, t)), 0.5 * (c[1, cell] + 2.0 * t * c[2, cell]) / h[cell], seconds


def _motion(path: SmoothPath, parts: list[_Driven]) -> Motion:
    """Quintics from knot to knot through the states there, cut where the path changes."""
    way = np.concatenate([parts[0].way[:1], *(p.way[1:] for p in parts)])
    lasts = np.concatenate([p.seconds for p in parts])
    quintic = np.concatenate([p.time for p in parts])
    x = path.break_mm
    cell = np.searchsorted(way, x[:-1], side="right") - 1
    inside = np.flatnonzero(way[cell] != x[:-1])
    u = _when(quintic[cell[inside]], x[inside] - way[cell[inside]], lasts[cell[inside]])
    start_s = np.concatenate(([0.0], np.cumsum(lasts)))
    begin = np.concatenate((start_s[:-1], start_s[cell[inside]] + u))
    order = np.argsort(np.concatenate((way[:-1], x[inside])), kind="stable")
    place = np.concatenate((way[:-1], x[inside]))[order]
    owner = np.concatenate((np.arange(len(lasts)), cell[inside]))[order]
    shape = np.clip(np.searchsorted(x, place, side="right") - 1, 0, len(path) - 1)
    time = _moved(quintic[owner], np.concatenate((np.zeros(len(lasts)), u))[order])
    time[:, 0] = place - x[shape]
    return Motion(np.append(begin[order], start_s[-1]), time, path.shape, shape, path.line[shape])


def _quintics(way: Array, v: Array, a: Array, t: Array) -> Array:
    """(m, 6) coefficients of the way after each knot that joins the states at its ends."""
    c = np.zeros((len(t), 6))
    c[:, 1], c[:, 2] = v[:-1], 0.5 * a[:-1]
    d = np.diff(way) - t * (c[:, 1] + t * c[:, 2])
    d1 = (v[1:] - v[:-1] - t * a[:-1]) * t
    d2 = (a[1:] - a[:-1]) * t * t
    c[:, 3] = (10.0 * d - 4.0 * d1 + 0.5 * d2) / t**3
    c[:, 4] = (-15.0 * d + 7.0 * d1 - d2) / t**4
    c[:, 5] = (6.0 * d - 3.0 * d1 + 0.5 * d2) / t**5
    return c


def _when(c: Array, way: Array, most: Array) -> Array:
    """(n,) seconds after which quintics (n, 6) have gone `way`: bracketed Newton."""
    lo, hi = np.zeros_like(way), most.copy()
    t = 0.5 * most
    for _ in range(60):
        f = t * (c[:, 1] + t * (c[:, 2] + t * (c[:, 3] + t * (c[:, 4] + t * c[:, 5])))) - way
        slope = c[:, 1] + t * (2 * c[:, 2] + t * (3 * c[:, 3] + t * (4 * c[:, 4] + t * 5 * c[:, 5])))
        lo, hi = np.where(f <= 0.0, t, lo), np.where(f >= 0.0, t, hi)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = t - f / slope
        new = np.where((new >= lo) & (new <= hi), new, 0.5 * (lo + hi))
        if (np.abs(new - t) <= 1e-15 * most).all():
            break
        t = new
    return t


def _moved(c: Array, u: Array) -> Array:
    """(n, 6) the polynomials (n, 6) counted from `u` (n,) on."""
    c = c.copy()
    for i in range(c.shape[1] - 1):
        for k in range(c.shape[1] - 2, i - 1, -1):
            c[:, k] += u * c[:, k + 1]
    return c
