"""Groups of rows that are nearly equal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index


def alike(columns: Sequence[Array | Index], within: Sequence[float]) -> Index:
    """(n,) the group of each row, from 0. In each column the sorted values of a group lie closer together
    than `within`: 0 for columns whose values must be equal."""
    count = len(columns[0])
    group = np.zeros(count, np.int64)
    # a group that falls apart in a later column may fall apart in an earlier one, too
    for _ in range(min(len(columns), 2)):
        for column, gap in zip(columns, within, strict=True):
            if not count or column.max() - column.min() <= gap:
                continue
            order = np.lexsort((column, group))
            own, values = group[order], column[order]
            new = np.ones(count, bool)
            new[1:] = (np.diff(own) != 0) | (np.diff(values) > gap)
            group[order] = np.cumsum(new) - 1
    return group


def members(group: Index) -> list[Index]:
    """The rows of each group, rising, in order of their first rows."""
    order = np.argsort(group, kind="stable")
    cuts = np.flatnonzero(np.diff(group[order])) + 1
    lists = np.split(order, cuts) if len(order) else []
    return sorted(lists, key=lambda rows: int(rows[0]))


def joined(low: Array, high: Array, of: Index, gap: float) -> Index:
    """(n,) the group of each interval `low`..`high`: those of the same value of `of` (n,) that overlap, or
    are closer together than `gap`, directly or by way of others."""
    order = np.lexsort((low, of))
    key, begin, end = of[order], low[order], high[order]
    # the farthest end so far of the same key
    span = float(np.ptp(np.concatenate((low, high)))) + 2.0 * gap + 1.0 if len(low) else 1.0
    rank = np.cumsum(np.diff(key, prepend=key[:1]) != 0) * 2.0 * span
    reach = np.maximum.accumulate(end + rank) - rank
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(key) != 0) | (begin[1:] > reach[:-1] + gap)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(new) - 1
    return group
