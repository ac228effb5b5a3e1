"""Speed along a smooth path by optimisation: faster than closed forms where ceilings vary smoothly.

The closed-form profile gives a grid of cells, even in time, and a start within every bound. The square of the
speed is optimised on it in windows that end where the profile is slow. Pieces that exceed a bound between the
rows get tighter rows, and the window is solved again. From rest the speed grows as the arc length to the
power 2/3, which no spline of its square follows. So windows launch from rest and land at constant jerk.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.linalg import LinAlgError

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.critical import Profile, Timeline
from olp.trajectory.interior import Rows, Spline, fits, least_time
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath
from olp.trajectory.speedgrid import CELL_S, grid, speed_caps

#: cells of a window
_WINDOW = 3000
#: how far from an even split a window may end, in windows
_MARGIN = 0.35
#: share of the closed form's speed at which windows begin and end, and from which the search starts
_SLOWED = 0.85
#: shares of the square of that speed that are tried as a start
_STARTS = (1.0, 0.7, 0.35)
#: windows with no more cells than this are not split where no start is within the bounds
_SMALL = 100
#: share of the first jerk phase that the launch takes
_LAUNCH = 0.04
#: the same where the length of the launch would have fewer than _DIGITS
_LONGEST = 0.25
#: length of a launch over the rounding of the arc length, at least
_DIGITS = 1e8
#: the same where the jerk leaves the launch fewer: then it has less jerk
_FEW_DIGITS = 1e4
#: the same of the first cell behind it: with fewer digits its jerk would be that of rounding
_CELL_DIGITS = 1e5
#: share of a cell's time that the cell beside an end lasts at least
_CLEAR = 0.4
#: growth of the times of cells after a launch
_GROW = 1.2
#: cells that grow, at most
_MOST = 40
#: share of a window that they may take
_PART = 0.4
#: fewest cells of a window
_FEW = 8
#: points per piece between breaks at which there are rows
_ROWS = 3
#: points per piece between breaks at which the usage is checked
_CHECKED = 9
#: points of the rule that times cells
_GAUSS = 12
#: factor by which b may change in one quintic; otherwise its cell is halved
_STEEP = 1.5
#: times that a cell is halved at most
_HALVES = 8
#: usage that is accepted in each turn of tightening rows
_ACCEPTED = (1.002, 1.002, 1.01, 1.01)
#: factors of b that are tried as a start of each turn
_AGAIN = (0.95, 0.85, 0.7, 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class _Driven:
    """A stretch between arc lengths `arc_mm` (m + 1,): the `seconds` (m,) of each step and its polynomial
    `time` (m, 6)."""

    arc_mm: Array
    seconds: Array
    time: Array


def optimised(path: SmoothPath, limits: AxisLimits, profile: Profile) -> Motion:
    """A motion along `path` from rest to rest, searched for from the closed-form `profile`.

    Bounds hold at the rows of the search. Between them they may be exceeded slightly, so audit the motion.
    """
    clock = Timeline.of(path.break_mm, profile)
    cap = speed_caps(path, limits)
    knots = grid(path, limits, profile, cap, clock)
    todo = list(pairwise(_edges(path, profile, knots)))[::-1]
    parts = []
    while todo:
        first, last = todo.pop()
        window = _Window.of(path, limits, profile, clock, cap, knots, first, last)
        driven = window.solved()
        if driven is None and len(window.spline.h) > _SMALL and last - first > 1:
            middle = _middle(profile, first, last)
            todo += [(middle, last), (first, middle)]
            continue
        parts.append(driven or _closed_form(path, profile, clock, first, last))
    return _motion(path, parts)


def _closed_form(path: SmoothPath, profile: Profile, clock: Timeline, first: int, last: int) -> _Driven:
    """The closed form between two of its nodes, slowed down to join its neighbours."""
    part = slice(int(clock.first[first]), int(clock.first[last]))
    arc_mm = np.append(clock.arc_mm[part], path.break_mm[profile.node[last]])
    powers = _SLOWED ** np.arange(6.0)
    time = np.zeros((len(arc_mm) - 1, 6))
    time[:, 1], time[:, 2], time[:, 3] = (
        clock.speed[part], clock.acceleration[part] / 2.0, clock.jerk[part] / 6.0,
    )  # fmt: skip
    return _Driven(arc_mm, clock.lasts[part] / _SLOWED, time * powers)


def _middle(profile: Profile, first: int, last: int) -> int:
    """The slowest node in the middle half between two nodes."""
    quarter = (last - first) // 4
    lo, hi = max(first + quarter, first + 1), max(last - quarter, first + 2)
    return lo + int(np.argmin(profile.speed[lo:hi]))


def _edges(path: SmoothPath, profile: Profile, knots: Array) -> list[int]:
    """The nodes at which windows begin and end: the slowest within reach of an even split."""
    place = np.searchsorted(knots, path.break_mm[profile.node])
    count = max(round(len(knots) / _WINDOW), 1)
    edges = [0]
    for i in range(1, count):
        about = np.array([i - _MARGIN, i + _MARGIN]) * len(knots) / count
        lo, hi = np.searchsorted(place, about)
        if hi > lo > edges[-1]:
            edges.append(int(lo + np.argmin(profile.speed[lo:hi])))
    return [*edges, len(profile.node) - 1]


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """A window's end: the arc length `arc_mm` where its cells end, `speed` and `acceleration` there, and the
    `seconds` of the launch or landing beyond (0: none), all without the slow-down. `rest` is the arc length
    where that launch ends, `knots` are beside it, and beyond `clear` other knots may follow."""

    arc_mm: float
    speed: float
    acceleration: float
    seconds: float
    rest: float
    knots: Array
    clear: float

    @staticmethod
    def of(profile: Profile, clock: Timeline, x: Array, node: int, span: int, most_s: float) -> _End:
        """The end at a node beside a span of the profile, with knots for `most_s` seconds from there, which
        are negative before an end."""
        arc_mm, speed, sign = float(x[profile.node[node]]), float(profile.speed[node]), float(np.sign(most_s))
        if speed > 0.0:
            return _End(arc_mm, speed, 0.0, 0.0, arc_mm, np.zeros(0), arc_mm + sign * _CLEAR * CELL_S * speed)
        a, j, peak = (float(e[span]) for e in (profile.acceleration, profile.jerk, profile.peak))
        phase = min(a / j, float(np.sqrt(peak / j)))
        fine = j * (_LAUNCH * phase) ** 3 > _DIGITS * np.spacing(x[-1])
        seconds = (_LAUNCH if fine else _LONGEST) * phase
        least_s = float(np.sqrt(6.0 * _FEW_DIGITS * np.spacing(x[-1]) / (_LONGEST * a)))
        if seconds < least_s:
            # hardly any limit of jerk: its phase is shorter than what rounding leaves of the arc length
            seconds, j = least_s, _LONGEST * a / least_s
        gone = j * seconds**3 / 6.0
        # cells that grow in time until they are as long as all others
        times = seconds * _GROW ** np.arange(1.0, _MOST)
        least = j * ((_GROW - 1.0) * seconds) ** 3 / 6.0
        grow = least > _CELL_DIGITS * np.spacing(x[-1])
        times = times[grow & (times * (1.0 - 1.0 / _GROW) < CELL_S) & (times < abs(most_s))]
        knots = clock.arc_at(clock.start_s[clock.first[node]] + sign * times)
        begin = arc_mm + sign * gone
        last = np.concatenate(([arc_mm, begin], knots))[-2:]
        clear = float(last[1] + _CLEAR * (last[1] - last[0]))
        return _End(begin, 0.5 * j * seconds**2, sign * j * seconds, seconds, arc_mm, knots, clear)


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """A stretch between two nodes of the profile: its ends, rows, and the `start` of the search, without the
    slow-down."""

    begin: _End
    end: _End
    rows: _Rows
    spline: Spline
    start: Array

    @staticmethod
    def of(
        path: SmoothPath, limits: AxisLimits, profile: Profile, clock: Timeline, cap: Array, knots: Array,
        first: int, last: int,
    ) -> _Window:  # fmt: skip
        x = path.break_mm
        lasts = float(clock.start_s[clock.first[last]] - clock.start_s[clock.first[first]])
        begin = _End.of(profile, clock, x, first, first, _PART * lasts)
        end = _End.of(profile, clock, x, last, last - 1, -_PART * lasts)
        inner = knots[np.searchsorted(knots, begin.clear) : np.searchsorted(knots, end.clear)]
        z = np.concatenate(([begin.arc_mm], begin.knots, inner, end.knots[::-1], [end.arc_mm]))
        if len(z) <= _FEW:
            z = np.linspace(begin.arc_mm, end.arc_mm, _FEW + 1)
        speed, acceleration = clock.state_at(z)
        speed[0], speed[-1] = begin.speed, end.speed
        acceleration[0], acceleration[-1] = begin.acceleration, end.acceleration
        spline = Spline(z)
        start = spline.fitted(speed**2, 2.0 * acceleration)
        return _Window(begin, end, _Rows.of(path, limits, cap, z), spline, start)

    def solved(self) -> _Driven | None:
        """The stretch in least time; None where no start is within the bounds."""
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
        arc_mm, speed, acceleration, seconds = _states(self.rows.knot, self.spline.h, c)
        if self.begin.seconds:
            arc_mm, speed, acceleration = (
                np.append(e, rest)
                for e, rest in ((self.begin.rest, arc_mm), (0.0, speed), (0.0, acceleration))
            )
            seconds = np.append(self.begin.seconds / _SLOWED, seconds)
        if self.end.seconds:
            arc_mm, speed, acceleration = (
                np.append(rest, e) for e, rest in ((self.end.rest, arc_mm), (0.0, speed), (0.0, acceleration))
            )
            seconds = np.append(seconds, self.end.seconds / _SLOWED)
        return _Driven(arc_mm, seconds, _quintics(arc_mm, speed, acceleration, seconds))


def _tightened(rows_at: _Rows, rows: Rows, spline: Spline, start: Array) -> Array:
    """The coefficients of least time, with tighter rows in pieces that exceed a bound."""
    beta = least_time(rows, spline, start)
    for accepted in _ACCEPTED:
        worst = rows_at.worst(spline.cells(beta))
        over = worst > accepted
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
    """The pieces of a window, cut at breaks of the path and knots of the speed. Each goes from `low` to
    `high` (n,) in cell `cell` and piece `piece` of the path. It keeps `share` (n,) of the limits."""

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
        return np.asarray(whole._at(_CHECKED).usage(c).reshape(-1, _CHECKED).max(axis=1))


def _states(knot: Array, h: Array, c: Array) -> tuple[Array, Array, Array, Array]:
    """Arc length, speed and acceleration (k + 1,) at the knots, and between halves of cells in which b
    changes much; the seconds (k,) between. A quintic through such states is the motion up to rounding."""
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
    arc_mm = np.append(knot[cell[:-1]] + low * h[cell[:-1]], knot[-1])
    return arc_mm, np.sqrt(square(cell, t)), 0.5 * (c[1, cell] + 2.0 * t * c[2, cell]) / h[cell], seconds


def _motion(path: SmoothPath, parts: list[_Driven]) -> Motion:
    """Quintics from knot to knot through the states there, cut at the breaks of the path."""
    arc_mm = np.concatenate([parts[0].arc_mm[:1], *(p.arc_mm[1:] for p in parts)])
    lasts = np.concatenate([p.seconds for p in parts])
    quintic = np.concatenate([p.time for p in parts])
    x = path.break_mm
    cell = np.searchsorted(arc_mm, x[:-1], side="right") - 1
    inside = np.flatnonzero(arc_mm[cell] != x[:-1])
    u = _when(quintic[cell[inside]], x[inside] - arc_mm[cell[inside]], lasts[cell[inside]])
    start_s = np.concatenate(([0.0], np.cumsum(lasts)))
    begin = np.concatenate((start_s[:-1], start_s[cell[inside]] + u))
    order = np.argsort(np.concatenate((arc_mm[:-1], x[inside])), kind="stable")
    place = np.concatenate((arc_mm[:-1], x[inside]))[order]
    owner = np.concatenate((np.arange(len(lasts)), cell[inside]))[order]
    shape = np.clip(np.searchsorted(x, place, side="right") - 1, 0, len(path) - 1)
    time = _moved(quintic[owner], np.concatenate((np.zeros(len(lasts)), u))[order])
    time[:, 0] = place - x[shape]
    return Motion(np.append(begin[order], start_s[-1]), time, path.shape, shape, path.line[shape])


def _quintics(arc_mm: Array, v: Array, a: Array, t: Array) -> Array:
    """(m, 6) coefficients of the arc length after each knot that join the states at both ends."""
    c = np.zeros((len(t), 6))
    c[:, 1], c[:, 2] = v[:-1], 0.5 * a[:-1]
    d = np.diff(arc_mm) - t * (c[:, 1] + t * c[:, 2])
    d1 = (v[1:] - v[:-1] - t * a[:-1]) * t
    d2 = (a[1:] - a[:-1]) * t * t
    c[:, 3] = (10.0 * d - 4.0 * d1 + 0.5 * d2) / t**3
    c[:, 4] = (-15.0 * d + 7.0 * d1 - d2) / t**4
    c[:, 5] = (6.0 * d - 3.0 * d1 + 0.5 * d2) / t**5
    return c


def _when(c: Array, distance: Array, most: Array) -> Array:
    """(n,) seconds after which quintics (n, 6) reach `distance`: bracketed Newton."""
    lo, hi = np.zeros_like(distance), most.copy()
    t = 0.5 * most
    for _ in range(60):
        f = t * (c[:, 1] + t * (c[:, 2] + t * (c[:, 3] + t * (c[:, 4] + t * c[:, 5])))) - distance
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
