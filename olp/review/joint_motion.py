"""The planned motion of a machine with rotary joints, as the charts of a page show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.kinematics.structure import Structure
from olp.review.motion import MOST_ROWS, MotionTable, instants, split, thinned
from olp.trajectory.joint_motion import Stretch

#: Pieces that are thinned at once, to bound memory.
_BLOCK = 1 << 14


def joint_limits(structure: Structure) -> Mapping[str, Vector]:
    """By axis its largest velocity, acceleration and jerk, in mm or deg; the machine file states them all."""
    stated = {name: joint.most for name, joint in structure.joints.items()}
    return {name: (v or 0.0, a or 0.0, j or 0.0) for name, (v, a, j) in stated.items()}


def joint_table(stretches: Sequence[Stretch]) -> MotionTable:
    """The motion of all axes, and the speed of the tip beside its feed, as at most about MOST_ROWS rows that
    keep every peak; stretches follow one another."""
    parts, begin = [], 0.0
    total = max(sum(len(one.trajectory.motion) for one in stretches), 1)
    for one in stretches:
        count = len(one.trajectory.motion)
        room = max(MOST_ROWS * count // total, 200)
        for a, b in pairwise([*range(0, count, _BLOCK), count]):
            parts.append(thinned(_rows(one, a, b, begin), max(room * (b - a) // count, 100)))
        begin += one.trajectory.duration_s
    rows = np.concatenate(parts)
    rows[:, 0] = np.maximum.accumulate(rows[:, 0])
    return split(rows)


def _rows(one: Stretch, a: int, b: int, begin: float) -> Array:
    """Rows of pieces a..b: time, line, speed of the tip, feed, and the axes' positions and three derivatives
    in mm and deg."""
    motion, route = one.trajectory.motion, one.route
    piece, u = instants(motion, a, b)
    position, velocity, *others = motion.of(piece, u)
    segment = motion.line[piece]
    speed = one.tip_speed(position, velocity, segment)
    feed = np.where(np.isfinite(route.feed_mm_s), route.feed_mm_s, np.nan)[segment]
    time = begin + motion.start_s[piece] - motion.start_s[0] + u
    states = [rate / route.scale for rate in (position, velocity, *others)]
    return np.column_stack((time, route.line[segment], speed, feed, *states))
