"""The grid of cells that the times of a closed-form speed profile make, and what bounds those times."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory import ramps
from olp.trajectory.ceilings import ceilings
from olp.trajectory.critical import Profile, Timeline, free_speeds
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath

#: time of a cell in the closed-form profile, s; of one at full feed, in cells; least share of one; least
#: cells of a path
CELL_S = 4e-3
_CRUISE, _LEAST, _OF_PATH = 20.0, 0.4, 60.0
#: cells of a ramp at the least, if it changes the speed by more than the share _LEVEL
_OF_RAMP, _LEVEL = 6, 0.02
#: share of the smaller cell beside it that a knot may move
_MOVE = 0.3
#: share for curvature that leaves acceleration as on a straight path
_STRAIGHT = 1e-12
#: a limit that never binds
_FREE = 1e30
#: a speed this near to the feed is it
_AT_FEED = 0.999


def speed_caps(path: SmoothPath, limits: AxisLimits) -> Array:
    """(k,) most speed along each piece for the feed and the axes' velocities."""
    free = AxisLimits(limits.velocity, np.full(3, _FREE), np.full(3, _FREE))
    return ceilings(path, free, np.ones(len(path)))[0]


def grid(path: SmoothPath, limits: AxisLimits, found: Profile, cap: Array, clock: Timeline) -> Array:
    """(m + 1,) ways between which b is one parabola: a cell lasts about CELL_S in the profile, more where
    it drives at the feed."""
    a, j = found.acceleration, found.jerk
    rise = ramps.seconds(found.speed[:-1], found.peak, a, j)
    fall = ramps.seconds(found.speed[1:], found.peak, a, j)
    ways = sum(ramps.distance(v, found.peak, a, j) for v in (found.speed[:-1], found.speed[1:]))
    x = path.break_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.nan_to_num(np.maximum(np.diff(x[found.node]) - ways, 0.0) / found.peak)
    whole = rise + level + fall
    begin = found.node[:-1]
    least = np.minimum.reduceat(cap, begin)
    free = np.minimum.reduceat(ceilings(path, limits, np.ones(len(path)))[0], begin)
    at_feed = (found.peak >= _AT_FEED * least) & (free >= _AT_FEED * least)
    cell_s = cell_seconds(float(whole.sum()))
    up = _of_ramp(rise, found.speed[:-1], found.peak, cell_s)
    down = _of_ramp(fall, found.speed[1:], found.peak, cell_s)
    flat = _count(level, np.where(at_feed, np.maximum(2, np.ceil(level / (_CRUISE * cell_s))),
                                  np.ceil(level / cell_s)))  # fmt: skip
    flat = np.where((level > 0.0) & (level < cell_s), 1, flat)
    up = np.where(up + flat + down == 0, 1, up)
    start = np.concatenate(([0.0], np.cumsum(whole)))
    times, span = [], []
    for lasts, count, offset in ((rise, up, 0.0 * rise), (level, flat, rise), (fall, down, rise + level)):
        k = np.repeat(np.arange(len(count)), count)
        i = np.arange(len(k)) - np.repeat(np.cumsum(count) - count, count)
        times.append(start[k] + offset[k] + i * (lasts / np.maximum(count, 1))[k])
        span.append(k)
    time, owner = np.concatenate(times), np.concatenate(span)
    order = np.argsort(time, kind="stable")
    time, owner = time[order], owner[order]
    cells = [np.where(count > 1, t / np.maximum(count, 1), np.inf) for t, count in ((rise, up), (fall, down))]
    gap = _LEAST * np.minimum(np.minimum(*cells), cell_s)
    kept = time[_apart(time, gap[owner])]
    return _on_breaks(np.unique(np.concatenate((x[:1], clock.way_at(kept), x[-1:]))), x)


def _on_breaks(knot: Array, x: Array) -> Array:
    """Knots moved onto breaks of the path that are near, where cells are cut anyway."""
    after = np.clip(np.searchsorted(x, knot), 1, len(x) - 1)
    near = np.where(knot - x[after - 1] < x[after] - knot, x[after - 1], x[after])
    gap = np.diff(knot)
    room = _MOVE * np.minimum(np.concatenate((gap[:1], gap)), np.concatenate((gap, gap[-1:])))
    return np.unique(np.where(np.abs(near - knot) <= room, near, knot))


def cell_seconds(whole: float) -> float:
    """Time of a cell for a path that takes `whole` seconds."""
    return min(CELL_S, whole / _OF_PATH)


def _of_ramp(lasts: Array, speed: Array, peak: Array, cell_s: float) -> Index:
    """(m,) cells of ramps: more than their time asks for, where they change the speed much."""
    steep = np.where(peak - speed > _LEVEL * peak, _OF_RAMP, 1)
    return _count(lasts, np.maximum(np.ceil(lasts / cell_s - 1e-9), steep))


def _count(lasts: Array, count: Array) -> Index:
    return np.where(lasts > 1e-12, count, 0).astype(np.int64)


def _apart(time: Array, gap: Array) -> Index:
    """Times no two of which are nearer than the later one's gap, from the first on."""
    kept, last = [], -np.inf
    for i, (t, least) in enumerate(zip(time.tolist(), gap.tolist(), strict=True)):
        if t - last >= least:
            kept.append(i)
            last = t
    return np.array(kept, np.int64)


def bound_s(path: SmoothPath, limits: AxisLimits) -> float:
    """About the least seconds that a motion along the path could take if jerk were free."""
    x = path.break_mm
    top = ceilings(path, limits, np.ones(len(path)))[0]
    free = AxisLimits(limits.velocity, limits.acceleration, np.full(3, _FREE))
    acceleration = ceilings(path, free, np.full(len(path), _STRAIGHT))[1]
    ends = np.concatenate(([0.0], np.minimum(top[:-1], top[1:]), [0.0]))
    speed = free_speeds(x, ends, acceleration)
    h = np.diff(x)
    peak = np.sqrt(np.maximum(speed[:-1], speed[1:]) ** 2 + acceleration * h)
    return float((h / np.minimum(top, peak)).sum())
