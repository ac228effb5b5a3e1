"""What people ask of a trajectory: how long, where, why so slow, and which axis is at its limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from olp.trajectory.motion import Array, Index
from olp.trajectory.plan import Trajectory
from olp.trajectory.route import Route

AXES = "XYZ"
#: an axis is at its limit where it uses this much of it
_AT_LIMIT = 0.98
#: samples of a piece in which its speed and its use of limits are taken
_SAMPLES = 5
_BLOCK = 1 << 14


@dataclass(frozen=True, slots=True, eq=False)
class LineTimes:
    """Per line of the program (m,): `seconds`, the `length_mm` driven, and the programmed `feed_mm_s`, inf
    for rapids, the fastest where a line has several."""

    line: Index
    seconds: Array
    length_mm: Array
    feed_mm_s: Array

    def achieved(self) -> Array:
        """(m,) mean speed over the programmed feed; 1 for rapids."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = self.length_mm / self.seconds / self.feed_mm_s
        return np.where(np.isfinite(self.feed_mm_s) & (self.seconds > 0), np.nan_to_num(share), 1.0)


def line_times(trajectory: Trajectory, routes: list[Route]) -> LineTimes:
    """Times, lengths and feeds of the lines that move."""
    lines, seconds = trajectory.seconds_by_line()
    length, feed = np.zeros(len(lines)), np.zeros(len(lines))
    for route in routes:
        place = np.searchsorted(lines, route.line)
        delta = np.diff(route.point_mm, axis=0)
        length += np.bincount(place, np.sqrt((delta * delta).sum(axis=1)), minlength=len(lines))
        np.maximum.at(feed, place, route.feed_mm_s)
    return LineTimes(lines, seconds, length, feed)


def at_limits(trajectory: Trajectory) -> dict[str, float]:
    """Share of the time in which each axis is at its limit of velocity, acceleration or jerk."""
    motion, limits = trajectory.motion, trajectory.limits
    total = np.zeros((3, 3))
    share = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    for a in range(0, len(motion), _BLOCK):
        piece = np.arange(a, min(a + _BLOCK, len(motion)))
        width = motion.start_s[piece + 1] - motion.start_s[piece]
        states = motion.of(np.repeat(piece, _SAMPLES), (width[:, None] * share).ravel())[1:]
        weight = np.repeat(width / _SAMPLES, _SAMPLES)
        for i, (state, bound) in enumerate(zip(states, bounds, strict=True)):
            total[i] += weight @ (np.abs(state) >= _AT_LIMIT * bound)
    whole = max(trajectory.duration_s, 1e-12)
    names = ("velocity", "acceleration", "jerk")
    return {
        f"{axis} {name}": float(total[i, k] / whole)
        for i, name in enumerate(names)
        for k, axis in enumerate(AXES)
    }


def summary(trajectory: Trajectory, routes: list[Route], most: int = 10) -> dict[str, Any]:
    """The answers as plain data, for a report in JSON or text."""
    times = line_times(trajectory, routes)
    achieved = times.achieved()
    slow = np.flatnonzero((achieved < 0.5) & (times.length_mm > 0))
    order = slow[np.argsort(-times.seconds[slow], kind="stable")]
    longest = np.argsort(-times.seconds, kind="stable")[:most]
    solvers: dict[str, float] = {}
    for leg in trajectory.legs:
        solvers[leg.solver] = solvers.get(leg.solver, 0.0) + leg.duration_s
    return {
        "duration_s": trajectory.duration_s,
        "solvers_s": solvers,
        "slowed_by_at_most": max((leg.factor for leg in trajectory.legs), default=1.0),
        "at_limit": at_limits(trajectory),
        "below_half_feed": {
            "lines": len(slow),
            "seconds": float(times.seconds[slow].sum()),
            "worst": [
                {
                    "line": int(times.line[i]),
                    "seconds": float(times.seconds[i]),
                    "achieved": float(achieved[i]),
                }
                for i in order[:most].tolist()
            ],
        },
        "longest": [
            {"line": int(times.line[i]), "seconds": float(times.seconds[i])} for i in longest.tolist()
        ],
    }
