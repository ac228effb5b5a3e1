"""A curve by some of its points, straight between them: for colours, which need no more than a step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index

#: Most rows between two knots, and rows that are worked on at once.
_APART, _BAND = 256, 1 << 16


def knots(values: Array, step: float) -> Index:
    """Rows of (n,) values between which they are straight within a step; knots are whole steps."""
    keep = np.zeros(len(values), bool)
    keep[::_APART] = True
    keep[-1:] = True
    for a in range(0, len(values), _BAND):
        # bands share the knot between them
        rows = slice(a, a + _BAND + 1)
        _refine(keep[rows], values[rows], np.rint(values[rows] / step) * step, step)
    return np.flatnonzero(keep)


def _refine(keep: npt.NDArray[np.bool_], values: Array, rounded: Array, step: float) -> None:
    """Halve the stretches between knots until each is straight."""
    edge = np.flatnonzero(keep)
    first, last = edge[:-1], edge[1:]
    while len(first):
        inside = last - first - 1
        first, last, inside = (some[inside > 0] for some in (first, last, inside))
        if not len(first):
            return
        begin = np.cumsum(inside) - inside
        of = np.repeat(np.arange(len(first)), inside)
        along = np.arange(len(of)) - begin[of] + 1
        slope = (rounded[last] - rounded[first]) / (last - first)
        off = np.abs(rounded[first][of] + along * slope[of] - values[first[of] + along])
        bent = np.maximum.reduceat(off, begin) > step
        first, last = first[bent], last[bent]
        middle = (first + last) // 2
        keep[middle] = True
        first, last = np.concatenate((first, middle)), np.concatenate((middle, last))
