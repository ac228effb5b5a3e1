"""A curve by some of its points, straight between them: over its rows, or over the length of a path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.values import dataclass

#: Most rows between two knots, a power of two.
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
        whole = np.asarray(values)

        def columns(rows: slice) -> tuple[Array, Array, Array]:
            some = whole[rows].astype(float)
            along = np.arange(rows.start, rows.start + len(some), dtype=float)
            return some, np.rint(some / step) * step, along

        at = knots(len(whole), columns, step)
        return Curve(at.astype(np.int32), whole[at], step, len(whole), float(whole.max(initial=0.0)))

    def values(self) -> Array:
        """(n,) the values, straight between knots."""
        return straight(self.knot.astype(float), self.at, np.arange(self.count, dtype=float))


def knots(count: int, columns: Callable[[slice], tuple[Array, Array, Array]], tolerance: float) -> Index:
    """Rows of `count` values between which they are straight over `along`, which never falls, within a
    tolerance. `columns` gives of some rows the values, what is stored of them if they are knots, and `along`.
    """
    keep = np.zeros(count, bool)
    keep[::_APART] = True
    keep[-1:] = True
    for a in range(0, count, _BAND):
        # bands share the knot between them
        rows = slice(a, a + _BAND + 1)
        _refine(keep[rows], *columns(rows), tolerance)
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
    """Halve the stretches between knots until each is straight. All are as long: a matrix has a column for
    each."""
    last = len(values) - 1
    first = np.arange(0, last, _APART)
    # rows behind the last are as that one
    short = len(first) * _APART - last
    values, stored, along = (np.pad(column, (0, short), mode="edge") for column in (values, stored, along))
    size = _APART
    while size > 1 and len(first):
        begin, base = along[first], stored[first]
        span = along[first + size] - begin
        rise = np.divide(stored[first + size] - base, span, out=np.zeros(len(span)), where=span > 0.0)
        inside = first + np.arange(1, size)[:, None]
        off = along[inside]
        off -= begin
        off *= rise
        off += base
        off -= values[inside]
        bent = first[np.abs(off, out=off).max(axis=0) > tolerance]
        size //= 2
        middle = bent + size
        middle = middle[middle < last]
        keep[middle] = True
        first = np.concatenate((bent, middle))
