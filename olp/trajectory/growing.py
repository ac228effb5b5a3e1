"""Arrays that grow in place: parts are appended without a second copy of all."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

_Number = TypeVar("_Number", np.float64, np.int64)


class Growing(Generic[_Number]):
    """Rows of one type and shape."""

    def __init__(self, empty: npt.NDArray[_Number]) -> None:
        """`empty` (0, ...) has the type and the shape of the rows."""
        self._rows: npt.NDArray[_Number] = empty.copy()
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, rows: npt.NDArray[_Number]) -> None:
        """Append `rows` (n, ...)."""
        need = self._count + len(rows)
        if need > len(self._rows):
            # the system moves large blocks of memory without a copy; unwritten pages take no memory
            self._rows.resize((max(need, 3 * len(self._rows) // 2), *rows.shape[1:]), refcheck=False)
        self._rows[self._count : need] = rows
        self._count = need

    def whole(self) -> npt.NDArray[_Number]:
        """All rows; the object is empty afterwards."""
        rows: npt.NDArray[_Number] = self._rows
        rows.resize((self._count, *rows.shape[1:]), refcheck=False)
        self._rows = rows[:0].copy()
        self._count = 0
        return rows
