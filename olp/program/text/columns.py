"""Columns that grow: each is one array, so a long program leaves no small arrays in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.values import dataclass

#: Entries of a column at first.
_FIRST = 1 << 10
#: A full column grows by this share of its length, so that little is reserved and each entry is moved few
#: times.
_GROWTH = 4


@dataclass(slots=True, eq=False)
class _Column:
    """An array, and how many of its entries are used."""

    array: npt.NDArray[Any]
    used: int = 0


class Columns:
    """Named columns that are appended to and taken once; none is longer than a quarter beyond its entries."""

    def __init__(self) -> None:
        self._columns: dict[str, _Column] = {}

    def put(self, name: str, values: npt.ArrayLike, kind: npt.DTypeLike) -> None:
        """Append values to a column, which is made with the first of them."""
        values = np.asarray(values)
        column = self._columns.get(name)
        if column is None:
            column = self._columns[name] = _Column(np.zeros((_FIRST, *values.shape[1:]), kind))
        used, array = column.used, column.array
        needed = used + len(values)
        if needed > len(array):
            # in place: the system moves pages, and no second array is filled
            array.resize((needed + needed // _GROWTH, *array.shape[1:]), refcheck=False)
        array[used:needed] = values
        column.used = needed

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put."""
        column = self._columns.pop(name, None)
        if column is None:
            array = np.zeros((0, *width), kind)
        else:
            array = column.array
            array.resize((column.used, *array.shape[1:]), refcheck=False)
        array.setflags(write=False)
        return array
