"""Equal neighbours among waypoints."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index

#: mm; waypoints nearer than this to the first of a group belong to it
SAME_MM = 1e-9


def groups_of_same(point_mm: Array) -> Index:
    """(n,) number of the group of each waypoint; a group lies within 1e-9 mm of its first waypoint."""
    step = np.sqrt((np.diff(point_mm, axis=0) ** 2).sum(axis=1))
    begins = np.concatenate(([True], step > SAME_MM))
    kept = -1
    # chains of waypoints, each near the one before, that lead away from the first
    for k in np.flatnonzero(~begins).tolist():
        if begins[k - 1]:
            kept = k - 1
        begins[k] = bool(np.sqrt(((point_mm[k] - point_mm[kept]) ** 2).sum()) > SAME_MM)
    result: Index = np.cumsum(begins) - 1
    return result
