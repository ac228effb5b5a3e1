"""Columns that grow: one array each from the start, so that a long program leaves no chunks behind."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class Columns:
    """Named columns that are appended to and taken once. Pages that were never written cost no memory, so the
    first guess of a length may be generous."""

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
        at = self._used[name]
        if at + len(values) > len(array):
            longer = np.zeros((2 * (at + len(values)), *array.shape[1:]), array.dtype)
            longer[:at] = array[:at]
            array = self._arrays[name] = longer
        array[at : at + len(values)] = values
        self._used[name] = at + len(values)

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put."""
        array = self._arrays.pop(name, None)
        out = np.zeros((0, *width), kind) if array is None else array[: self._used[name]]
        out.setflags(write=False)
        return out
