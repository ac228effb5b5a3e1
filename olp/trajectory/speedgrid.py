"""The grid of cells from the times of a closed-form speed profile, and a bound of the whole time."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory import ramps
from olp.trajectory.ceilings import ceilings
from olp.trajectory.critical import Profile, Timeline, free_speeds
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath

#: s; time of a cell in the closed-form profile
CELL_S = 4e-3
#: time of a cell at full feed, in cells
_CRUISE = 20.0
#: least time of a cell, as a share of the shortest cells beside it
_LEAST = 0.4
#: least number of cells of a path
_OF_PATH = 480.0
#: least number of cells of a ramp that changes the speed by more than the share _LEVEL
_OF_RAMP = 6
#: share of the speed by which a ramp changes it at least
_LEVEL = 0.02
#: share of the smaller cell beside a knot by which the knot may move
_MOVE = 0.3
#: share for curvature with which the acceleration is that of a straight path
_STRAIGHT = 1e-12
#: a limit that never binds
_FREE = 1e30
#: share of the feed above which a speed counts as the feed
_AT_FEED = 0.999


def speed_caps(path: SmoothPath, limits: AxisLimits) -> Array:
    """(k,) largest speed along each piece for the feed and the axes' velocities."""
    none = np.full_like(limits.velocity, _FREE)
    free = AxisLimits(limits.velocity, none, none)
    return ceilings(path, free, np.ones(len(path)))[0]


def grid(path: SmoothPath, limits: AxisLimits, profile: Profile, cap: Array, clock: Timeline) -> Array:
    """(m + 1,) arc lengths between which b is one parabola: a cell lasts about CELL_S in the profile, and
    longer at the feed."""
    a, j = profile.acceleration, profile.jerk
    rise = ramps.seconds(profile.speed[:-1], profile.peak, a, j)
    fall = ramps.seconds(profile.speed[1:], profile.peak, a, j)
    ramp_mm = sum(ramps.distance(v, profile.peak, a, j) for v in (profile.speed[:-1], profile.speed[1:]))
    x = path.break_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.nan_to_num(np.maximum(np.diff(x[profile.node]) - ramp_mm, 0.0) / profile.peak)
    whole = rise + level + fall
    begin = profile.node[:-1]
    least = np.minimum.reduceat(cap, begin)
    free = np.minimum.reduceat(ceilings(path, limits, np.ones(len(path)))[0], begin)
    at_feed = (profile.peak >= _AT_FEED * least) & (free >= _AT_FEED * least)
    cell_s = cell_seconds(float(whole.sum()))
    up = _of_ramp(rise, profile.speed[:-1], profile.peak, cell_s)
    down = _of_ramp(fall, profile.speed[1:], profile.peak, cell_s)
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
    return _on_breaks(np.unique(np.concatenate((x[:1], clock.arc_at(kept), x[-1:]))), x)


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
    """(m,) cells of ramps: at least _OF_RAMP where they change the speed by more than _LEVEL."""
    steep = np.where(peak - speed > _LEVEL * peak, _OF_RAMP, 1)
    return _count(lasts, np.maximum(np.ceil(lasts / cell_s - 1e-9), steep))


def _count(lasts: Array, count: Array) -> Index:
    return np.where(lasts > 1e-12, count, 0).astype(np.int64)


def _apart(time: Array, gap: Array) -> Index:
    """Indices of times, from the first on, each at least its gap after the one before."""
    kept, last = [], -np.inf
    for i, (t, least) in enumerate(zip(time.tolist(), gap.tolist(), strict=True)):
        if t - last >= least:
            kept.append(i)
            last = t
    return np.array(kept, np.int64)


def bound_s(path: SmoothPath, limits: AxisLimits) -> float:
    """About the least seconds of a motion along the path without a jerk limit."""
    x = path.break_mm
    top = ceilings(path, limits, np.ones(len(path)))[0]
    free = AxisLimits(limits.velocity, limits.acceleration, np.full_like(limits.jerk, _FREE))
    acceleration = ceilings(path, free, np.full(len(path), _STRAIGHT))[1]
    ends = np.concatenate(([0.0], np.minimum(top[:-1], top[1:]), [0.0]))
    speed = free_speeds(x, ends, acceleration)
    h = np.diff(x)
    peak = np.sqrt(np.maximum(speed[:-1], speed[1:]) ** 2 + acceleration * h)
    return float((h / np.minimum(top, peak)).sum())
