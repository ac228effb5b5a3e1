"""What a route will take, before it is planned."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory import ramps
from olp.trajectory.critical import BY_BEND
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.scurve import rest_to_rest_s
from olp.trajectory.smooth import MOST_WIDTH

#: segments per block
_BLOCK = 1 << 15
#: against division by zero
_TINY = 1e-300
#: components of a direction below this do not limit a move
_STRAIGHT = 1e-12


def expected_s(route: Route, limits: AxisLimits) -> Array:
    """(n - 1,) seconds that `critical` will hardly undercut along each segment of a route.

    A kernel apart from all others bends by du / w at its vertex, w as wide as the tolerance allows: that
    limits its speed. Between two such speeds a segment takes as long as with no acceleration at its ends.
    """
    delta = np.diff(route.point_mm, axis=0).T
    length = np.maximum(np.sqrt((delta * delta).sum(axis=0)), _TINY)
    u = delta / length
    velocity, a, j = (most[:, None] for most in (limits.velocity, limits.acceleration, limits.jerk))
    bend = np.abs(np.diff(u, axis=1))
    with np.errstate(all="ignore"):
        size = np.maximum(np.abs(u), _STRAIGHT)
        top = np.minimum((velocity / size).min(axis=0), route.feed_mm_s)
        along = (a / size).min(axis=0), (j / size).min(axis=0)
        width = MOST_WIDTH * route.tolerance_mm[1:-1] / np.sqrt((bend * bend).sum(axis=0))
        slow = np.sqrt(BY_BEND * width * (a / bend).min(axis=0))
        slow = np.minimum(slow, np.cbrt(BY_BEND * width * width * (j / bend).min(axis=0)))
    reaches = np.concatenate(([0.0], width, [0.0]))
    apart = (reaches[:-1] + reaches[1:]) <= length
    apart = apart[:-1] & apart[1:]
    slow = np.where(route.tolerance_mm[1:-1] > 0.0, np.where(apart, slow, np.inf), 0.0)
    # through a kernel the speed is held
    held = np.where(apart & (slow > 0.0), width, 0.0)
    ends = []
    between = length.copy()
    total = np.zeros_like(length)
    for side in (0, 1):
        some = np.insert(held, side * len(held), 0.0)
        speed = np.minimum(np.insert(slow, side * len(slow), 0.0), top)
        total += np.where(some > 0.0, some / np.maximum(speed, _TINY), 0.0)
        between -= some
        ends.append(speed)
    between = np.maximum(between, 0.0)
    # between different speeds: the mean of the times with either speed at both ends
    for end in ends:
        peak = np.minimum(ramps.reach(end, 0.5 * between, *along), top)
        used = 2.0 * ramps.distance(end, peak, *along)
        total += ramps.seconds(end, peak, *along) + 0.5 * np.maximum(between - used, 0.0) / peak
    return np.asarray(total)


def straight(route: Route, limits: AxisLimits, stops: Index) -> tuple[Array, Array]:
    """Seconds of each segment (n - 1,) at its feed, and about the least of each run (r,) from one of the
    `stops` to the next. That is the time of a straight move as long, along which all axes push."""
    seconds, length = np.empty(len(route) - 1), np.empty(len(route) - 1)
    for a in range(0, len(length), _BLOCK):
        part = slice(a, min(a + _BLOCK, len(length)))
        delta = np.abs(np.diff(route.point_mm[part.start : part.stop + 1], axis=0))
        length[part] = np.sqrt((delta * delta).sum(axis=1))
        seconds[part] = np.maximum(
            (delta / limits.velocity).max(axis=1), length[part] / route.feed_mm_s[part]
        )
    begin = stops[:-1]
    whole = np.add.reduceat(length, begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        fastest = np.fmax.reduceat(length / seconds, begin)
    push, jerk = (np.sqrt((limit * limit).sum()) for limit in (limits.acceleration, limits.jerk))
    ramps_s = rest_to_rest_s(whole, np.fmax(fastest, _TINY), push, jerk)
    return seconds, np.maximum(np.add.reduceat(seconds, begin), ramps_s)
