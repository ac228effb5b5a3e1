"""A closed-form speed profile as a clock, and the grid of cells that its times make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.trajectory import ramps
from olp.trajectory.critical import Profile, _phases, ceilings
from olp.trajectory.route import Array, AxisLimits, Index
from olp.trajectory.smooth import SmoothPath

#: time of a cell in the closed-form profile, s; of one at full feed, in cells; least share of one
CELL_S = 4e-3
_CRUISE, _LEAST = 20.0, 0.4
#: cells of a ramp at the least, where a span takes longer than _LONG cells, and their least time, s
_OF_RAMP, _LONG, _SHORTEST_S = 6, 10.0, 5e-4
#: share of the smaller cell beside it that a knot may move
_MOVE = 0.3
#: a speed this near to the feed is it
_AT_FEED = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Phases (p,) of constant jerk: `start_s` (p + 1,), way, speed, acceleration and jerk at their start."""

    start_s: Array
    way: Array
    speed: Array
    acceleration: Array
    jerk: Array
    seconds: Array

    @staticmethod
    def of(path: SmoothPath, found: Profile) -> Timeline:
        return Timeline(*_phases(path.break_mm, found))

    def way_at(self, time_s: Array) -> Array:
        k = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, len(self.way) - 1)
        u = time_s - self.start_s[k]
        return np.asarray(
            self.way[k] + u * (self.speed[k] + u * (self.acceleration[k] / 2.0 + u * self.jerk[k] / 6.0))
        )

    def at_way(self, way: Array) -> tuple[Array, Array]:
        """Speed and acceleration (n,) at ways (n,)."""
        k = np.clip(np.searchsorted(self.way, way, side="right") - 1, 0, len(self.way) - 1)
        v, a, j = self.speed[k], self.acceleration[k], self.jerk[k]
        u = ramps.when(np.maximum(way - self.way[k], 0.0), v, a, j, self.seconds[k])
        return np.maximum(v + u * (a + 0.5 * u * j), 0.0), a + u * j


def speed_caps(path: SmoothPath, limits: AxisLimits) -> Array:
    """(k,) most speed along each piece for the feed and the axes' velocities."""
    free = AxisLimits(limits.velocity, np.full(3, np.inf), np.full(3, np.inf))
    return ceilings(path, free, np.ones(len(path)))[0]


def grid(path: SmoothPath, limits: AxisLimits, found: Profile, cap: Array, clock: Timeline) -> Array:
    """(m + 1,) ways between which b is one parabola: a cell lasts about CELL_S in the profile, more where
    it drives at the feed."""
    a, j = found.acceleration, found.jerk
    rise = ramps.seconds(found.speed[:-1], found.peak, a, j)
    fall = ramps.seconds(found.speed[1:], found.peak, a, j)
    ways = ramps.distance(found.speed[:-1], found.peak, a, j) + ramps.distance(found.speed[1:], found.peak, a, j)
    x = path.break_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.nan_to_num(np.maximum(np.diff(x[found.node]) - ways, 0.0) / found.peak)
    whole = rise + level + fall
    begin = found.node[:-1]
    least = np.minimum.reduceat(cap, begin)
    free = np.minimum.reduceat(ceilings(path, limits, np.ones(len(path)))[0], begin)
    at_feed = (found.peak >= _AT_FEED * least) & (free >= _AT_FEED * least)
    few = np.where(whole > _LONG * CELL_S, _OF_RAMP, 1)
    up, down = (
        _count(t, np.maximum(np.ceil(t / CELL_S - 1e-9), np.minimum(few, np.ceil(t / _SHORTEST_S))))
        for t in (rise, fall)
    )
    flat = _count(level, np.where(at_feed, np.maximum(2, np.ceil(level / (_CRUISE * CELL_S))),
                                  np.ceil(level / CELL_S)))  # fmt: skip
    flat = np.where((level > 0.0) & (level < CELL_S), 1, flat)
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
    cell = np.maximum(rise, fall) / np.maximum(np.maximum(up, down), 1)
    cell = np.where((whole > _LONG * CELL_S) & (cell > 0.0), np.clip(cell, _SHORTEST_S, CELL_S), CELL_S)
    gap = _LEAST * cell
    kept = time[_apart(time, gap[owner])]
    return _on_breaks(np.unique(np.concatenate((x[:1], clock.way_at(kept), x[-1:]))), x)


def _on_breaks(knot: Array, x: Array) -> Array:
    """Knots moved onto breaks of the path that are near, where cells are cut anyway."""
    after = np.clip(np.searchsorted(x, knot), 1, len(x) - 1)
    near = np.where(knot - x[after - 1] < x[after] - knot, x[after - 1], x[after])
    gap = np.diff(knot)
    room = _MOVE * np.minimum(np.concatenate((gap[:1], gap)), np.concatenate((gap, gap[-1:])))
    return np.unique(np.where(np.abs(near - knot) <= room, near, knot))


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
