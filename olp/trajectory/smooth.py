"""A polyline rounded within its tolerance: a path of cubics, twice continuously differentiable.

With l the arc length along the polyline and du_k the change of its direction at vertex k, the path is

    q(l) = polyline(l) + sum_k du_k w_k g((l - l_k) / w_k),   g(x) = (1 - |x|)^3 / 6 for |x| < 1,

whose second derivative is a sum of hats du_k/w_k (1 - |x|) and whose third is constant between the breaks
l_k and l_k +- w_k. Kernels may overlap, so dense points are smoothed over many of them. A single kernel
leaves the polyline by |du| w / 6.

l is kept on a grid of a power of two, on which sums and differences of breaks are exact. So the halves of a
kernel meet to the last digit, however long the path and short the kernel.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.trajectory.hats import hats
from olp.trajectory.kernels import deviations, least_over
from olp.trajectory.route import AxisLimits, Route

#: mm; points closer than this are one
_SAME_MM = 1e-4
#: the same as a share of the least tolerance, where that is less
_SAME_SHARE = 0.02
#: mm; but never less than this
_SAME_LEAST_MM = 1e-9
#: mm; larger tolerances are taken as this one
_MOST_MM = 1e6
#: |u1 + u2| of a vertex where the path turns back on itself
_REVERSAL = 1e-3
#: a change of direction up to this is none
_STRAIGHT = 1e-12
#: share of acceleration and jerk that a kernel should use at full feed
_SHARE = 0.25
#: factor on the width for that; wider kernels are of no use
_WIDER = 1.25
#: share of the arc length to the ends of the run that a kernel may cover: the path is straight there
_END = 0.6
#: kernels become narrower by at least this factor
_SHRINK = 0.95
#: and by at most this one per round
_LEAST_SHRINK = 0.3
#: rounds at most
_ROUNDS = 200
#: power of the excess by which kernels become narrower, as neighbours share it
_POWER = 0.4
#: a kernel is no wider than this times its tolerance over the change of direction
MOST_WIDTH = 6.0 * _SHRINK
#: breaks per block
_BLOCK = 1 << 17


@dataclass(frozen=True, slots=True, eq=False)
class SmoothPath:
    """Piece k runs from `break_mm[k]` to `break_mm[k + 1]` (k + 1,) along the polyline.

    With s the arc length from its start, its axis positions are sum_i `shape[k, i]` s^i mm.
    `shape` is (k, 4, 3), `feed_mm_s` (k,) the largest speed along it, `line` (k,) its program line, `source`
    (k,) its segment of the route. The motion stops at the breaks `rest` (r,), and at both ends."""

    break_mm: Array
    shape: Array
    feed_mm_s: Array
    line: Index
    source: Index
    rest: Index

    def __len__(self) -> int:
        return len(self.shape)

    def at(self, arc_mm: Array) -> tuple[Array, Array, Array, Array]:
        """Position mm and its first three derivatives by the arc length, (n, 3) each, at arc lengths (n,)."""
        k = np.clip(np.searchsorted(self.break_mm, arc_mm, side="right") - 1, 0, len(self) - 1)
        s = (arc_mm - self.break_mm[k])[:, None]
        c0, c1, c2, c3 = (self.shape[k, i] for i in range(4))
        return (c0 + s * (c1 + s * (c2 + s * c3)), *self.derivatives(k, arc_mm))

    def derivatives(self, piece: Index, arc_mm: Array) -> tuple[Array, Array, Array]:
        """The first three derivatives by the arc length, (n, 3) each, of pieces (n,) at arc lengths (n,)."""
        s = (arc_mm - self.break_mm[piece])[:, None]
        c1, c2, c3 = (self.shape[piece, i] for i in range(1, 4))
        return c1 + s * (2.0 * c2 + 3.0 * s * c3), 2.0 * c2 + 6.0 * s * c3, 6.0 * c3


def needs_stop(point_mm: Array) -> Mask:
    """(n,) at which of the points (n, 3) their polyline turns back on itself, without points that are nearly
    equal to the one before."""
    stop = np.zeros(len(point_mm), bool)
    kept = _distinct(point_mm, _SAME_MM)
    if len(kept) > 2:
        delta = np.diff(point_mm[kept], axis=0)
        u = delta / np.linalg.norm(delta, axis=1)[:, None]
        stop[kept[1:-1]] = np.linalg.norm(u[1:] + u[:-1], axis=1) < _REVERSAL
    return stop


def smooth(route: Route, limits: AxisLimits) -> SmoothPath:
    """The path of a route with rests at both ends and at waypoints of tolerance 0.

    The control points of each cubic prove that every point is within the tolerance of the polyline; between
    waypoints the tolerance is interpolated. Rests are met exactly, and the path is straight there. A reversal
    is rounded too, and the path stands still there for a moment; better make it a stop.

    Raises:
        CannotCompute: a point that is not finite, a tolerance below 0, or a feed that is not above 0.
    """
    _check(route)
    inner = np.asarray(route.tolerance_mm, float)[1:-1]
    least = float(inner.min(initial=math.inf, where=inner > 0.0))
    same = max(min(_SAME_MM, _SAME_SHARE * least), _SAME_LEAST_MM)
    kept = _kept(route.point_mm, 1 + np.flatnonzero(inner == 0.0), same)
    point = route.point_mm[kept]
    if len(kept) < 2:
        none = np.zeros(0, np.int64)
        return SmoothPath(np.zeros(1), np.zeros((0, 4, point.shape[1])), np.zeros(0), none, none, none)
    source = kept[1:] - 1
    feed, line = np.asarray(route.feed_mm_s, float)[source], np.asarray(route.line, np.int64)[source]
    delta = np.diff(point, axis=0)
    length = np.linalg.norm(delta, axis=1)
    grid = 2.0 ** math.ceil(math.log2(float(length.sum()) * 2.0**-51))
    arc_mm = np.concatenate(([0.0], np.round(np.cumsum(length) / grid) * grid))
    if not (np.diff(arc_mm) > 0.0).all():
        # segments shorter than the grid of a path of 1e7 mm: each takes one step of the grid
        arc_mm = np.concatenate(([0.0], np.cumsum(np.maximum(np.round(length / grid), 1.0)))) * grid
    u = delta / np.diff(arc_mm)[:, None]
    rest = 1 + np.flatnonzero(route.tolerance_mm[kept[1:-1]] == 0.0)
    tolerance = _tolerance(route, kept, rest, 0.0 if len(kept) == len(route) else 2.0 * same)
    bend = np.diff(u, axis=0)
    width = _widths(u, bend, arc_mm, rest, feed, tolerance, limits, grid)
    used = width > 0.0
    bend, place, width = bend[used], 1 + np.flatnonzero(used), width[used]
    # towards a rest the tolerance is that of the waypoint before
    ends = np.stack((tolerance[:-1], tolerance[1:]), axis=1)
    leave, arrive = np.append(0, rest), np.append(rest, len(arc_mm) - 1)
    ends[leave, 0], ends[arrive - 1, 1] = tolerance[leave + 1], tolerance[arrive - 1]
    still = np.zeros(len(arc_mm), bool)
    still[leave] = still[-1] = True
    breaks, width, shape = _fitted(arc_mm, u, point, bend, place, width, ends, still, grid)
    segment = np.clip(np.searchsorted(arc_mm, breaks[:-1], side="right") - 1, 0, len(u) - 1)
    at_rest = np.searchsorted(breaks, arc_mm[rest])
    return SmoothPath(breaks, shape, feed[segment], line[segment], source[segment], at_rest)


def _check(route: Route) -> None:
    if not np.isfinite(route.point_mm).all():
        raise CannotCompute("a waypoint is not finite")
    if not (np.asarray(route.tolerance_mm)[1:-1] >= 0.0).all():
        raise CannotCompute("a tolerance is not a number of 0 or more")
    if not (np.asarray(route.feed_mm_s) > 0.0).all():
        raise CannotCompute("a feed is not above 0")


def _kept(point: Array, rest: Index, same: float) -> Index:
    """Indices of the points (n, 3) that are kept: the ends, those at `rest` (r,), and between them points
    that are at least `same` apart."""
    if not len(rest):
        return _distinct(point, same)
    keep = np.ones(len(point), bool)
    edges = np.concatenate(([0], rest, [len(point) - 1]))
    short = np.flatnonzero(np.linalg.norm(np.diff(point, axis=0), axis=1) < same)
    for run in np.unique(np.searchsorted(rest, short, side="right")).tolist():
        a, b = int(edges[run]), int(edges[run + 1])
        keep[a + 1 : b + 1] = False
        keep[a + _distinct(point[a : b + 1], same)] = True
    return np.flatnonzero(keep)


def _distinct(point: Array, same: float) -> Index:
    """Indices of points (n, 3) whose neighbours are at least `same` apart, ends included. Points that are
    dropped are within twice that of one that is kept."""
    n = len(point)
    if n < 2:
        return np.arange(n)
    short = np.linalg.norm(np.diff(point, axis=0), axis=1) < same
    if not short.any():
        return np.arange(n)
    keep = np.ones(n, bool)
    index = 0
    for first in np.flatnonzero(short).tolist():
        if first + 1 <= index:
            continue
        here = point[first].tolist()
        index = first + 1
        while index < n:
            there = point[index].tolist()
            if math.dist(here, there) < same:
                keep[index] = False
            else:
                here = there
                if index == n - 1 or not short[index]:
                    break
            index += 1
    kept = np.flatnonzero(keep).tolist()
    if kept[-1] != n - 1:
        end = point[-1]
        while len(kept) > 1 and math.dist(point[kept[-1]], end) < same:
            kept.pop()
        if len(kept) > 1 or math.dist(point[0], end) > 0.0:
            kept.append(n - 1)
    return np.array(kept, np.int64)


def _tolerance(route: Route, kept: Index, rest: Index, margin: float) -> Array:
    """(m,) at the waypoints that are kept: the least of theirs and of those dropped behind, less `margin`.

    Unlimited at the ends and at `rest` (r,), as the kernels end before."""
    raw = np.array(route.tolerance_mm, float)
    if len(kept) <= 2:
        return np.ones(len(kept))
    raw[0], raw[-1] = math.inf, math.inf
    raw = np.minimum.reduceat(raw, kept)
    raw[rest] = math.inf
    return np.minimum(np.maximum(raw - margin, 0.5 * raw), _MOST_MM)


def _widths(
    u: Array, bend: Array, arc_mm: Array, rest: Index, feed: Array, tolerance: Array, limits: AxisLimits,
    grid: float,
) -> Array:  # fmt: skip
    """(m - 2,) first width of each kernel, on the grid: as wide as the tolerance of its vertex allows, but no
    wider than full feed needs."""
    if not len(bend):
        return np.zeros(0)
    with np.errstate(divide="ignore"):
        speed = np.minimum(feed, (limits.velocity / np.abs(u)).min(axis=1))
    speed = np.minimum(speed[:-1], speed[1:])
    most = np.abs(bend)
    by_acceleration = (most / limits.acceleration).max(axis=1) * speed**2 / _SHARE
    by_jerk = np.sqrt((most / limits.jerk).max(axis=1) * speed**3 / _SHARE)
    length = np.diff(arc_mm)
    use = np.maximum(_WIDER * np.maximum(by_acceleration, by_jerk), 0.3 * np.minimum(length[:-1], length[1:]))
    size = np.linalg.norm(bend, axis=1)
    ends = arc_mm[np.concatenate(([0], rest, [len(arc_mm) - 1]))]
    behind = np.searchsorted(ends, arc_mm[1:-1], side="right")
    end = np.minimum(arc_mm[1:-1] - ends[behind - 1], ends[behind] - arc_mm[1:-1])
    with np.errstate(divide="ignore"):
        width = np.minimum(np.minimum(use, MOST_WIDTH * tolerance[1:-1] / size), _END * end)
    width = np.maximum(np.floor(width / grid), 1.0) * grid
    width[rest - 1] = 0.0
    return np.where(size > _STRAIGHT, width, 0.0)


def _fitted(
    arc_mm: Array,
    u: Array,
    point: Array,
    bend: Array,
    place: Index,
    width: Array,
    tolerance: Array,
    rest: Mask,
    grid: float,
) -> tuple[Array, Array, Array]:
    """Breaks, widths and shapes, after every kernel over a piece beyond the tolerance is narrowed."""
    inner = arc_mm[place]
    for turn in range(_ROUNDS):
        wide = hats(arc_mm, place, width, bend, rest)
        lone = np.flatnonzero(~wide.sampled)
        low, high = np.where(wide.sampled, arc_mm[wide.begin], inner - width), inner + width
        high = np.where(wide.sampled, arc_mm[wide.end], high)
        breaks = np.unique(np.concatenate((arc_mm, low[lone], high[lone])))
        begin, middle, end = (np.searchsorted(breaks, e) for e in (low, inner, high))
        shape = np.empty((len(breaks) - 1, 4, u.shape[1]))
        factor = np.ones(len(width))
        for lo in range(0, len(shape), _BLOCK):
            hi = min(lo + _BLOCK, len(shape))
            x = breaks[lo : hi + 1]
            segment = np.clip(np.searchsorted(arc_mm, x[:-1], side="right") - 1, 0, len(u) - 1)
            taylor = wide.at(x[:-1], arc_mm, segment)
            pick = lone[(end[lone] > lo) & (begin[lone] < hi)]
            if pick.size:
                parts = (np.clip(e[pick] - lo, 0, hi - lo) for e in (begin, middle, end))
                taylor += deviations(x, inner[pick], width[pick], bend[pick], *parts)
            share = _allowed(taylor, x, arc_mm, segment, tolerance)
            if (share < 1.0).any():
                pick = np.flatnonzero((end > lo) & (begin < hi))
                a, b = (np.clip(e[pick] - lo, 0, hi - lo) for e in (begin, end))
                factor[pick] = np.minimum(factor[pick], least_over(share, a, b))
            piece = shape[lo:hi]
            piece[:, 0] = point[segment] + u[segment] * (x[:-1] - arc_mm[segment])[:, None] + taylor[:, 0]
            piece[:, 1] = u[segment] + taylor[:, 1]
            piece[:, 2] = taylor[:, 2] / 2.0
            piece[:, 3] = taylor[:, 3] / 6.0
        narrow = factor < 1.0
        if not narrow.any():
            break
        factor = np.maximum(_SHRINK * factor**_POWER, _LEAST_SHRINK)
        width = np.where(narrow, np.maximum(np.floor(width * factor / grid), 1.0) * grid, width)
        if turn > _ROUNDS // 2 and (width[narrow] == grid).all():
            break
    return breaks, width, shape


def _allowed(taylor: Array, x: Array, arc_mm: Array, segment: Index, tolerance: Array) -> Array:
    """(k,) factor by which the deviation of each piece would have to shrink: 1 within the tolerance.

    The norms of the control points of a cubic in Bernstein form bound its norm. The tolerance is linear on
    every piece, so it is its own Bernstein form: four comparisons prove the whole piece."""
    h = np.diff(x)[:, None]
    e, e1, e2, e3 = (taylor[:, i] for i in range(4))
    first, last = tolerance[segment].T
    slope = (last - first) / np.diff(arc_mm)[segment]
    begin, end = (first + slope * (place - arc_mm[segment]) for place in (x[:-1], x[1:]))
    share = np.ones(len(taylor))
    controls = (
        e,
        e + h / 3.0 * e1,
        e + h * (2.0 / 3.0 * e1 + h / 6.0 * e2),
        e + h * (e1 + h * (0.5 * e2 + h / 6.0 * e3)),
    )
    for i, control in enumerate(controls):
        far = np.sqrt(np.einsum("ij,ij->i", control, control))
        here = begin + (end - begin) * (i / 3.0)
        with np.errstate(divide="ignore"):
            share = np.minimum(share, here / far)
    return share
