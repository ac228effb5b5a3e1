"""Routes whose smooth paths are faster: corners moved outward, waypoints off a line by noise moved onto it.

A kernel leaves the polyline to the inside of a corner only. So a corner far from others is moved outward
until its segments are the tolerance away from those of the route. Its kernel may then be as much wider. Where
the path turns by more than a right angle, less gains more: the corner is sharper from farther away.

Where a path turns left and right inside the tolerance, as noise of a measured or rounded path does, it is a
line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, distinct
from olp.trajectory.route import Route
from olp.trajectory.smooth import MOST_WIDTH

#: share of the tolerance by which a corner is moved outward
_OUTWARD = 0.98
#: the same where the path turns by more than a right angle
_BACK = 0.65
#: widths of its kernel that the segments beside a moved corner are long, at least
_ALONE = 2.5
#: cosine of half the turn of a corner that is moved, at least: nearly reversals are none
_SHARPEST = 0.2
#: a turn below this is none
_STRAIGHT = 1e-9
#: share of a tolerance by which a waypoint may be moved onto a line
_SHARE = 0.6
#: turns of noise are together at least so many times their sum
_NOISE = 3.0
#: share of that from which on it is looked at exactly
_NEARLY = 0.999
#: fewest waypoints between the ends of a line
_FEWEST = 2


def outward(route: Route) -> Route | None:
    """The route with corners between long segments moved outward, and the tolerance that they have from
    there; None where there are none."""
    u, length = _directions(route.point_mm)
    if len(length) < 2 or not (length > 0.0).all():
        return None
    bend = np.diff(u, axis=0)
    size = np.sqrt((bend * bend).sum(axis=1))
    cosine = np.sqrt(np.maximum(1.0 - 0.25 * size * size, 0.0))
    tolerance = route.tolerance_mm[1:-1]
    share = np.where(cosine < np.sqrt(0.5) * (1.0 - _STRAIGHT), _BACK, _OUTWARD)
    away = share * tolerance / np.maximum(cosine, _SHARPEST)
    width = MOST_WIDTH * (tolerance + away)
    alone = np.minimum(length[:-1], length[1:]) * size > _ALONE * width
    # kernels of corners beside it do not reach a corner that is moved
    quiet = np.concatenate(([True], alone | (tolerance <= 0.0), [True]))
    fits = alone & quiet[:-2] & quiet[2:] & (cosine > _SHARPEST) & (tolerance > 0.0) & (size > _STRAIGHT)
    moved = np.flatnonzero(fits)
    if not moved.size:
        return None
    point, most = route.point_mm.copy(), route.tolerance_mm.copy()
    point[moved + 1] -= bend[moved] / size[moved, None] * away[moved, None]
    most[moved + 1] += away[moved]
    return replace(route, point_mm=point, tolerance_mm=most)


def levelled(route: Route) -> Route | None:
    """The route with waypoints moved onto lines where it turns left and right, and the tolerance that
    remains; None where it does not. Waypoints keep their order, so that segments keep their feeds and
    lines."""
    u, length = _directions(route.point_mm)
    if len(length) < _FEWEST + 1 or not (length > 0.0).all():
        return None
    bend = np.diff(u, axis=0)
    point, tolerance = route.point_mm.copy(), route.tolerance_mm.copy()
    rest = (route.tolerance_mm == 0.0) | (route.dwell_s > 0.0)
    edges = distinct(np.concatenate(([0], np.flatnonzero(rest), [len(route) - 1])))
    found = False
    for a, b in _winding(bend, *_near_lines(route, edges)):
        inner = slice(a + 1, b)
        place = _on_line(route.point_mm, a, b)
        step = route.point_mm[inner] - place
        turns = bend[a : b - 1]
        forward = ((np.diff(place, axis=0) @ (route.point_mm[b] - route.point_mm[a])) > 0.0).all()
        sizes = np.sqrt((turns * turns).sum(axis=1)).sum()
        if forward and sizes > _NOISE * np.sqrt((turns.sum(axis=0) ** 2).sum()):
            point[inner] = place
            tolerance[inner] -= np.sqrt((step * step).sum(axis=1))
            found = True
    return replace(route, point_mm=point, tolerance_mm=tolerance) if found else None


def _near_lines(route: Route, edges: Index) -> tuple[Index, Index]:
    """The first and last waypoints of stretches between edges whose others are near the line through these.
    A stretch that has others is divided at the one that is farthest beyond; all of a round at once."""
    point, most = route.point_mm, _SHARE * route.tolerance_mm
    first, last = edges[:-1], edges[1:]
    near: list[Index] = []
    while True:
        wide = last - first > _FEWEST
        first, last = first[wide], last[wide]
        if not first.size:
            break
        count = last - first - 1
        begin = np.cumsum(count) - count
        of = np.repeat(np.arange(len(first)), count)
        inner = first[of] + 1 + np.arange(len(of)) - begin[of]
        along = point[last] - point[first]
        away = point[inner] - point[first][of]
        share = _dot(away, along[of]) / np.maximum(_dot(along, along), 1e-300)[of]
        away -= share[:, None] * along[of]
        over = np.sqrt(_dot(away, away)) - most[inner]
        worst = np.maximum.reduceat(over, begin)
        good = worst <= 0.0
        near.append(np.stack((first[good], last[good])))
        at = np.flatnonzero((over == worst[of]) & ~good[of])
        at = at[np.diff(of[at], prepend=-1) > 0]
        middle, first, last = inner[at], first[~good], last[~good]
        first, last = np.concatenate((first, middle)), np.concatenate((middle, last))
    stretches = np.concatenate([np.zeros((2, 0), np.int64), *near], axis=1)
    return stretches[0], stretches[1]


def _winding(bend: Array, first: Index, last: Index) -> Iterator[tuple[int, int]]:
    """The stretches in which turns are nearly as large in sum as those of noise, or larger."""
    size = np.concatenate(([0.0], np.cumsum(np.sqrt((bend * bend).sum(axis=1)))))
    turn = np.concatenate((np.zeros((1, bend.shape[1])), np.cumsum(bend, axis=0)))
    sizes, whole = size[last - 1] - size[first], turn[last - 1] - turn[first]
    wound = sizes > _NEARLY * _NOISE * np.sqrt((whole * whole).sum(axis=1))
    return zip(first[wound].tolist(), last[wound].tolist(), strict=True)


def _directions(point: Array) -> tuple[Array, Array]:
    delta = np.diff(point, axis=0)
    length = np.sqrt((delta * delta).sum(axis=1))
    return delta / np.where(length > 0.0, length, 1.0)[:, None], length


def _on_line(point: Array, a: int, b: int) -> Array:
    """Feet of the waypoints between two on the line through these."""
    along = point[b] - point[a]
    share = (point[a + 1 : b] - point[a]) @ along / max(float(along @ along), 1e-300)
    return np.asarray(point[a] + share[:, None] * along)


def _dot(first: Array, second: Array) -> Array:
    """Products summed along the last axis in order: of points that are equally far, none hangs on how a
    library sums on this processor."""
    product = first * second
    return np.asarray(product[..., 0] + product[..., 1] + product[..., 2])
