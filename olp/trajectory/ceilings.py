"""What each piece of a smooth path allows along it.

With q', q'', q''' the derivatives by the arc length, the axes have

    velocity q' v,  acceleration q' a + q'' v^2,  jerk q' j + 3 q'' v a + q''' v^3,

so that speed V, acceleration A and jerk J along a piece can be chosen such that every motion within them is
within every axis limit.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.trajectory.route import AxisLimits
from olp.trajectory.smooth import SmoothPath

#: share that 3 q'' v a may use of the jerk that q''' v^3 leaves
_BY_CROSS = 0.5
#: against division by zero
_TINY = 1e-300
#: pieces per block
_BLOCK = 1 << 14


def ceilings(path: SmoothPath, limits: AxisLimits, share: Array) -> tuple[Array, Array, Array]:
    """(k,) speed, acceleration and jerk along each piece, within which all axis limits and the feed hold,
    when curvature may use the `share` (k,) of acceleration and jerk at full speed."""
    n = len(path)
    result = np.empty((3, n))
    for lo in range(0, n, _BLOCK):
        part = slice(lo, min(lo + _BLOCK, n))
        result[:, part] = _ceilings(np.diff(path.break_mm[lo : part.stop + 1]), path.shape[part],
                                    path.feed_mm_s[part], limits, share[part])  # fmt: skip
    return result[0], result[1], result[2]


def _ceilings(h: Array, shape: Array, feed: Array, limits: AxisLimits, share: Array) -> Array:
    """As `ceilings`. A row of each array is an axis: to take the least of three in a row takes NumPy long."""
    velocity, acceleration, jerk = (
        most[:, None] for most in (limits.velocity, limits.acceleration, limits.jerk)
    )
    first, second, third = np.ascontiguousarray(shape[:, 1:].transpose(1, 2, 0))
    second, third = 2.0 * second, 6.0 * third
    # q' is a parabola in the hull of its three control points; q'' is linear
    middle, last = first + 0.5 * h * second, first + h * (second + 0.5 * h * third)
    m1 = np.maximum(np.maximum(np.abs(first), np.abs(last)), np.abs(middle))
    m2 = np.maximum(np.abs(second), np.abs(second + h * third))
    m3 = np.abs(third)
    size = np.sqrt(np.maximum.reduce([(e * e).sum(axis=0) for e in (first, middle, last)]))
    m1, m2, m3 = (np.maximum(e, _TINY) for e in (m1, m2, m3))
    with np.errstate(over="ignore"):
        v = np.minimum((velocity / m1).min(axis=0), feed / np.maximum(size, _TINY))
        v = np.minimum(v, np.sqrt(share * (acceleration / m2).min(axis=0)))
        v = np.minimum(v, np.cbrt(share * (jerk / m3).min(axis=0)))
        cross = 3.0 * m2 * v
        spare_jerk = jerk - m3 * v**3
        a = ((acceleration - m2 * v**2) / m1).min(axis=0)
        a = np.minimum(a, (_BY_CROSS * spare_jerk / np.maximum(cross, _TINY)).min(axis=0))
        j = ((spare_jerk - cross * a) / m1).min(axis=0)
    return np.stack((v, a, j))
