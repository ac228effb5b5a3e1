"""A curve by some of its points, straight between them: over its rows, or over the length of a path."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.values import dataclass

#: Most rows between two knots.
_APART = 256
#: Rows that are worked on at once; a multiple of the above.
_BAND = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """`count` values over their rows by knots: (k,) rows `at` and `knot` there. It is within a `step` of each
    of the values; the `largest` of them is known."""

    at: npt.NDArray[np.int32]
    knot: npt.NDArray[Any]
    step: float
    count: int
    largest: float

    @staticmethod
    def of(values: npt.ArrayLike, step: float) -> Curve:
        """The curve of (n,) finite values; its knots are stored in steps."""
        rows = np.asarray(values, float)
        at = knots(rows, np.rint(rows / step) * step, np.arange(len(rows), dtype=float), step)
        knot = np.asarray(values)[at]
        return Curve(at.astype(np.int32), knot, step, len(rows), float(rows.max(initial=0.0)))

    def values(self) -> Array:
        """(n,) the values, straight between knots."""
        return straight(self.knot.astype(float), self.at, np.arange(self.count, dtype=float))


def knots(values: Array, stored: Array, along: Array, tolerance: float) -> Index:
    """Rows of (n,) values between which they are straight over `along` (n,), which never falls, within a
    tolerance; a knot has the `stored` value of its row."""
    keep = np.zeros(len(values), bool)
    keep[::_APART] = True
    keep[-1:] = True
    for a in range(0, len(values), _BAND):
        # bands share the knot between them
        rows = slice(a, a + _BAND + 1)
        _refine(keep[rows], values[rows], stored[rows], along[rows], tolerance)
    return np.flatnonzero(keep)


def straight(knot: Array, at: npt.NDArray[np.integer[Any]], along: Array) -> Array:
    """(n,) values over `along` (n,), which are straight between knots in rows `at`; the page computes the
    same doubles. Where `along` rests, they are those of the knot before."""
    row = np.arange(len(along))
    of = np.searchsorted(at, row, "right") - 1
    begin, span, rise = along[at], np.diff(along[at], append=np.inf), np.diff(knot, append=0.0)
    share = np.divide(along - begin[of], span[of], out=np.zeros(len(row)), where=span[of] > 0.0)
    return np.asarray(knot[of] + share * rise[of])


def lengths(path: npt.NDArray[Any]) -> Array:
    """(n,) lengths along a path of whole numbers (n, 3), in their unit, as the page computes them."""
    squares = np.zeros(len(path))
    for j in range(3):
        step = np.diff(path[:, j].astype(float), prepend=path[:1, j])
        squares += step * step
    return np.cumsum(np.sqrt(squares))


def _refine(
    keep: npt.NDArray[np.bool_], values: Array, stored: Array, along: Array, tolerance: float
) -> None:
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
        row = np.arange(len(of)) + (first - begin + 1)[of]
        span = along[last] - along[first]
        rise = np.divide(stored[last] - stored[first], span, out=np.zeros(len(span)), where=span > 0.0)
        off = np.abs(stored[first][of] + (along[row] - along[first][of]) * rise[of] - values[row])
        bent = np.maximum.reduceat(off, begin) > tolerance
        first, last = first[bent], last[bent]
        middle = (first + last) // 2
        keep[middle] = True
        first, last = np.concatenate((first, middle)), np.concatenate((middle, last))
