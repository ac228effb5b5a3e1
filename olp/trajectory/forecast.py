"""What a route will take, before it is planned."""

from __future__ import annotations

import numpy as np

from olp.trajectory import ramps
from olp.trajectory.critical import BY_BEND
from olp.trajectory.route import Array, AxisLimits, Route
from olp.trajectory.smooth import MOST_WIDTH

_TINY = 1e-300
#: shares of a direction below this do not limit a move
_STRAIGHT = 1e-12


def expected_s(route: Route, limits: AxisLimits) -> Array:
    """(n - 1,) seconds that `critical` will hardly undercut along each segment of a route.

    A kernel that meets no other bends by du / w at its vertex, w as wide as the tolerance allows: so much
    speed is left there. Between two such speeds a segment takes as long as with no acceleration at its ends.
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
    slow = np.where(apart[:-1] & apart[1:], slow, np.inf)
    slow = np.concatenate(([0.0], np.where(route.tolerance_mm[1:-1] > 0.0, slow, 0.0), [0.0]))
    end = np.minimum(np.maximum(slow[:-1], slow[1:]), top)
    peak = np.minimum(ramps.reach(end, 0.5 * length, *along), top)
    way = 2.0 * ramps.distance(end, peak, *along)
    return np.asarray(2.0 * ramps.seconds(end, peak, *along) + np.maximum(length - way, 0.0) / peak)
