"""Short steps of a route, such as those that take up backlash, become one waypoint within the path tolerance.

A jog of 5 um has two corners of a right angle. Rounded one by one they bend the path within 5 um, though
their bends cancel: the path may go from one side to the other along the moves beside the jog. So a cluster of
waypoints becomes one in its middle, and what that takes of the tolerance does not round corners.

The moves beside a cluster lead through it at their own feeds. So no step is left out whose feed is lower.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array, Mask
from olp.trajectory.motion import Motion
from olp.trajectory.route import Route

#: share of a path tolerance that moving a waypoint may take
_SHARE = 0.6
#: moves of waypoints that are shorter than this share of the tolerance gain nothing
_LEAST = 1e-3


def variants(route: Route) -> list[Route]:
    """The route merged by clusters, and by pairs where that differs: the middles of the steps of a fine
    staircase are on a straight line, those of its clusters are not."""
    found = [other for pairs in (False, True) if (other := merged(route, pairs=pairs)) is not None]
    if len(found) == 2 and np.array_equal(found[0].point_mm, found[1].point_mm):
        found.pop()
    return found


def merged(route: Route, *, pairs: bool = False) -> Route | None:
    """The route with one waypoint for each cluster, and the tolerance that remains; None where there are no
    clusters. With `pairs` a cluster has two waypoints. The steps that stay keep their lines.

    That waypoint is the middle of a cluster, or the rest with which it begins or ends, or its end where the
    move beside it is too fast. No waypoint is moved by more than `_SHARE` of its tolerance; no rest is moved.
    """
    rest = (route.tolerance_mm == 0.0) | (route.dwell_s > 0.0)
    rest[:1] = rest[-1:] = True
    room = np.where(rest, math.inf, _SHARE * route.tolerance_mm)
    step = np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1))
    least, larger = np.minimum(room[:-1], room[1:]), np.maximum(room[:-1], room[1:])
    reach = np.where(np.isinf(larger), least, 2.0 * least)
    short = (step <= reach) & (step > _LEAST * least) & np.isfinite(least)
    point, tolerance = route.point_mm.copy(), route.tolerance_mm.copy()
    stays, driven = np.ones(len(route), bool), np.ones(len(step), bool)
    last = 0
    for first in np.flatnonzero(short).tolist():
        # a rest may end one cluster and begin the next one
        if first < last or (first == last and not rest[first]):
            continue
        last = first + 1 if pairs else _last(route.point_mm, room, first)
        place = _place(route, rest, first, last)
        if place is None:
            continue
        own = slice(first, last + 1)
        away = np.sqrt(((route.point_mm[own] - place) ** 2).sum(axis=1))
        if (away <= room[own]).all():
            one = last if rest[last] else first
            stays[own] = False
            stays[one] = True
            driven[first:last] = False
            point[one], tolerance[one] = place, (route.tolerance_mm[own] - away).min()
    if driven.all():
        return None
    return Route(
        point[stays], route.feed_mm_s[driven], route.line[driven], tolerance[stays], route.dwell_s[stays]
    )


def shared(motion: Motion) -> Motion:
    """A motion of overlapped moves, where a corner belongs to the later move. Where steps were left out, its
    first half goes to the move before it: there the later move is far behind the next step of the program."""
    bent = np.asarray(motion.path[motion.shape, 2:].any(axis=(1, 2)))
    first = 1 + np.flatnonzero(np.diff(motion.line) > 1)
    first = first[bent[first]]
    # an overlap of several parts has a part that ends in its middle
    change = 1 + np.flatnonzero((np.diff(motion.line) != 0) | np.diff(bent))
    last = np.append(change, len(motion))[np.searchsorted(change, first, side="right")]
    middle = 0.5 * (motion.start_s[first] + motion.start_s[last])
    line = motion.line.copy()
    for a, b, at_s in zip(first.tolist(), last.tolist(), middle.tolist(), strict=True):
        if b > a + 1:
            line[a : a + int(np.abs(motion.start_s[a : b + 1] - at_s).argmin())] = line[a - 1]
    corner, middle = first[last == first + 1], middle[last == first + 1]
    begin = motion.start_s[corner]
    half = motion.time[corner]
    half[:, 0] += (middle - begin) * half[:, 1]
    line[corner] = line[corner - 1]
    return Motion(
        np.insert(motion.start_s, corner + 1, middle),
        np.insert(motion.time, corner + 1, half, axis=0),
        motion.path,
        np.insert(motion.shape, corner + 1, motion.shape[corner]),
        np.insert(line, corner + 1, motion.line[corner]),
    )


def _place(route: Route, rest: Mask, first: int, last: int) -> Array | None:
    """Where the waypoints `first` to `last` become one; None where a step between them is slower than those
    beside them that would lead over its place."""
    slowest = route.feed_mm_s[first:last].min()
    # a step that ends at a waypoint which stays in its place does not become longer
    before = first == 0 or bool(route.feed_mm_s[first - 1] <= slowest)
    behind = last == len(route) - 1 or bool(route.feed_mm_s[last] <= slowest)
    begin, end = np.asarray(route.point_mm[first]), np.asarray(route.point_mm[last])
    if rest[first] or rest[last]:
        fits, place = (behind, begin) if rest[first] else (before, end)
        return place if fits else None
    if before and behind:
        return np.asarray(0.5 * (begin + end))
    if before or behind:
        return begin if behind else end
    return None


def _last(point: Array, room: Array, first: int) -> int:
    """The last waypoint of the cluster that begins with a short step at waypoint `first`. A rest ends it, and
    none has two."""
    last = first + 1
    least = min(float(room[first]), float(room[last]))
    wide = 1.0 if math.isinf(room[first]) else 2.0
    while last + 1 < len(point) and math.isfinite(room[last]):
        least = min(least, float(room[last + 1]))
        away = math.dist(point[first].tolist(), point[last + 1].tolist())
        ends = math.isinf(room[last + 1])
        if (ends and wide == 1.0) or away > least * (1.0 if ends else wide):
            break
        last += 1
    return last
