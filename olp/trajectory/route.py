"""Routes: waypoints with feeds, path tolerances and dwells."""

from __future__ import annotations

from olp.core.arrays import Array, Index
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class AxisLimits:
    """(axes,) largest velocity mm/s, acceleration mm/s^2 and jerk mm/s^3 of each axis."""

    velocity: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A polyline of commanded axis positions.

    - `point_mm` (n, axes): the waypoints; rotary axes as `olp.trajectory.from_joints` has them.
    - `feed_mm_s` (n - 1,): largest speed along each segment, inf for rapids.
    - `line` (n - 1,): the line of the program that each segment comes from.
    - `tolerance_mm` (n,): how far from each waypoint the path may pass, 0 for a stop on it (as at both ends).
    - `dwell_s` (n,): time at rest there.
    """

    point_mm: Array
    feed_mm_s: Array
    line: Index
    tolerance_mm: Array
    dwell_s: Array

    def __len__(self) -> int:
        return len(self.point_mm)
