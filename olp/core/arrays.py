"""Types of the arrays that values hold, and what NumPy does not do without its masked arrays.

Those are a tenth of NumPy's start: `np.unique`, `np.union1d`, `np.median` and, for short arrays, `np.isin`
load them.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
#: Whole numbers of any size, such as lines.
Numbers = npt.NDArray[np.signedinteger[Any]]

#: So many values are compared one by one.
_FEW = 12
#: In so many values others are looked up by bisection, which loads no masked arrays as `np.isin` may; in more
#: only where there is no short table of them.
_SHORT = 1 << 12

Scalar = TypeVar("Scalar", bound=np.generic)


def read_only(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """The same values as an array that refuses to be changed; the given one is as it was."""
    view = values.view()
    view.setflags(write=False)
    return view


def distinct(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """(m,) the distinct values of an array without NaN, ascending, as `np.unique` gives them. It is fast
    where they are in order already, as lines are."""
    if values.size and not any(values.strides):
        # one number that stands for all
        return np.asarray(values.flat[:1])
    ordered = np.sort(values, axis=None, kind="stable")
    first = np.ones(len(ordered), bool)
    first[1:] = ordered[1:] != ordered[:-1]
    return ordered[first]


def is_in(values: npt.NDArray[Scalar], some: Collection[float] | npt.NDArray[Any]) -> Mask:
    """Whether each value, of any shape, is one of `some`, as `np.isin` says."""
    wanted = np.asarray(list(some) if isinstance(some, set | frozenset) else some).ravel()
    whole = wanted.dtype.kind in "iu"
    if len(wanted) > _FEW:
        ordered = np.sort(wanted)
        near = whole and values.dtype.kind in "iu" and int(ordered[-1]) - int(ordered[0]) <= np.size(values)
        if near and np.size(values) > _SHORT:
            return np.isin(values, ordered, kind="table")
        return np.asarray(ordered.take(np.searchsorted(ordered, values), mode="clip") == values)
    found = np.zeros(np.shape(values), bool)
    # a number of its own type would make all others as wide
    for one in wanted.tolist() if whole else wanted:
        found |= values == one
    return found


def any_in_row(rows: Mask) -> Mask:
    """(n,) whether a column of rows (n, k), k > 0, is true. On short rows NumPy's own takes ten times as
    long, here and in the next two."""
    found = rows[:, 0].copy()
    for column in rows.T[1:]:
        found |= column
    return found


def all_in_row(rows: Mask) -> Mask:
    """(n,) whether all columns of rows (n, k), k > 0, are true."""
    held = rows[:, 0].copy()
    for column in rows.T[1:]:
        held &= column
    return held


def most_in_row(rows: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """(n,) the largest value of each of rows (n, k), k > 0; NaN where one of them is."""
    most = rows[:, 0].copy()
    for column in rows.T[1:]:
        np.maximum(most, column, out=most)
    return most


def distinct_rows(rows: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """(m, k) the distinct rows (n, k) without NaN, in ascending order, as `np.unique` gives them."""
    ordered = rows[np.lexsort(rows.T[::-1])]
    first = np.ones(len(ordered), bool)
    first[1:] = any_in_row(ordered[1:] != ordered[:-1])
    return ordered[first]


def median(values: Array) -> float:
    """The median of numbers (n,), n > 0, without NaN, as `np.median` gives it."""
    half, odd = divmod(len(values), 2)
    ordered = np.sort(values)
    return float(ordered[half] if odd else (ordered[half - 1] + ordered[half]) / 2.0)
