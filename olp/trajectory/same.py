"""Way-points that are one."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index

#: (mm) way-points nearer to the one before are the same
SAME_MM = 1e-9


def groups_of_same(point_mm: Array) -> Index:
    """(n,) number of each way-point once those within 1e-9 mm of the first of their group are taken as
    one."""
    step = np.sqrt((np.diff(point_mm, axis=0) ** 2).sum(axis=1))
    begins = np.concatenate(([True], step > SAME_MM))
    kept = -1
    # way-points that creep: each within reach of the one before, the whole not
    for k in np.flatnonzero(~begins).tolist():
        if begins[k - 1]:
            kept = k - 1
        begins[k] = bool(np.sqrt(((point_mm[k] - point_mm[kept]) ** 2).sum()) > SAME_MM)
    result: Index = np.cumsum(begins) - 1
    return result
