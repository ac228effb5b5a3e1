"""When a motion passes the waypoints of its route."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.trajectory.motion import Motion
from olp.trajectory.route import Route

#: places in each piece that are looked at
_PLACES = 8
#: segments before that of a piece whose ends it may pass
_BEFORE = 1
#: segments behind it
_BEHIND = 2
#: steps to the nearest place
_STEPS = 4
#: s of a step at most
_STEP_S = 1e-3
_TINY = 1e-300


def passing_s(route: Route, motion: Motion) -> Array:
    """(n,) times at which a motion, whose lines are segments, is nearest to each waypoint, in order. Where
    no piece is near one, it is passed between its neighbours, even in length."""
    count = len(route)
    lasts = np.diff(motion.start_s)[:, None]
    share = np.arange(_PLACES) / _PLACES
    time = np.append((motion.start_s[:-1, None] + lasts * share).ravel(), motion.start_s[-1])
    piece = np.append(np.repeat(np.arange(len(motion)), _PLACES), len(motion) - 1)
    place = motion.positions(piece, time - motion.start_s[piece])
    near = motion.line[piece][:, None] + np.arange(-_BEFORE, _BEHIND + 2)
    inner = (near > 0) & (near < count - 1)
    row, waypoint = np.nonzero(inner)[0], near[inner]
    away = ((place[row] - route.point_mm[waypoint]) ** 2).sum(axis=1)
    order = np.lexsort((away, waypoint))
    nearest = order[np.flatnonzero(np.diff(waypoint[order], prepend=-1))]
    found, when = waypoint[nearest], time[row[nearest]]
    for _ in range(_STEPS):
        position, velocity = motion.at(when)[:2]
        square = np.maximum((velocity * velocity).sum(axis=1), _TINY)
        step = ((route.point_mm[found] - position) * velocity).sum(axis=1) / square
        when = np.clip(when + np.clip(step, -_STEP_S, _STEP_S), time[0], time[-1])
    delta = np.diff(route.point_mm, axis=0)
    arc = np.concatenate(([0.0], np.cumsum(np.sqrt((delta * delta).sum(axis=1)))))
    known = np.concatenate(([0], found, [count - 1]))
    passed = np.concatenate((time[:1], np.maximum.accumulate(when), time[-1:]))
    return np.asarray(np.interp(arc, arc[known], passed))
