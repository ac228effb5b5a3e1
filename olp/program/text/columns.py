"""Columns that grow: each is one array from the start, so a long program leaves no small arrays in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class Columns:
    """Named columns that are appended to and taken once. Memory that was never written costs nothing, so
    `expected` may be too large."""

    def __init__(self, expected: int) -> None:
        self._expected = max(expected, 64)
        self._arrays: dict[str, npt.NDArray[Any]] = {}
        self._used: dict[str, int] = {}

    def put(self, name: str, values: npt.ArrayLike, kind: npt.DTypeLike) -> None:
        """Append values to a column, which is made with the first of them."""
        values = np.asarray(values)
        array = self._arrays.get(name)
        if array is None:
            array = self._arrays[name] = np.zeros((self._expected, *values.shape[1:]), kind)
            self._used[name] = 0
        used = self._used[name]
        if used + len(values) > len(array):
            longer = np.zeros((2 * (used + len(values)), *array.shape[1:]), array.dtype)
            longer[:used] = array[:used]
            array = self._arrays[name] = longer
        array[used : used + len(values)] = values
        self._used[name] = used + len(values)

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put."""
        array = self._arrays.pop(name, None)
        column = np.zeros((0, *width), kind) if array is None else array[: self._used[name]]
        column.setflags(write=False)
        return column
