"""Columns that grow: each is one array, so a long program leaves no small arrays in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

#: Entries of a column at first.
_FIRST = 1 << 10
#: A full column grows by this share of its length, so that little is reserved and each entry is moved few
#: times.
_GROWTH = 4


class Columns:
    """Named columns that are appended to and taken once; none is longer than a quarter beyond its entries."""

    def __init__(self) -> None:
        self._arrays: dict[str, npt.NDArray[Any]] = {}
        self._used: dict[str, int] = {}

    def put(self, name: str, values: npt.ArrayLike, kind: npt.DTypeLike) -> None:
        """Append values to a column, which is made with the first of them."""
        values = np.asarray(values)
        array = self._arrays.get(name)
        if array is None:
            array = self._arrays[name] = np.zeros((_FIRST, *values.shape[1:]), kind)
            self._used[name] = 0
        used = self._used[name]
        needed = used + len(values)
        if needed > len(array):
            # in place: the system moves pages, and no second array is filled
            array.resize((needed + needed // _GROWTH, *array.shape[1:]), refcheck=False)
        array[used:needed] = values
        self._used[name] = needed

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put."""
        array = self._arrays.pop(name, None)
        if array is None:
            array = np.zeros((0, *width), kind)
        else:
            array.resize((self._used[name], *array.shape[1:]), refcheck=False)
        array.setflags(write=False)
        return array
