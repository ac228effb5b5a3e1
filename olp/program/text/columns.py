"""Columns that grow. A long one waits in a temporary file.

Its pages come to memory where they are looked at. Who goes through columns goes by `spans`, which let them go
again, so that the memory of a run does not grow with its text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask, Scalar
from olp.core.spool import Spool, room, unload
from olp.core.values import dataclass

#: Entries for which a column has room at first; it doubles
_FIRST = 1 << 10
#: up to so many. What is more waits in a file.
_MOST = 1 << 16
#: Entries far from each other that are looked at together: the system loads a few pages for each.
_PICKED = 1 << 8
#: Zeros that are written at once.
_ZEROS = bytes(1 << 16)


def spans(count: int, size: int | None = None) -> Iterator[slice]:
    """Slices of columns of `count` entries, each of `size` at most. What is looked at in one leaves memory
    before the next."""
    size = size or _MOST
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))
        unload()


def found(count: int, of: Callable[[slice], Mask]) -> Index:
    """The rows of columns of `count` entries of which `of` is true, where it is asked for by spans."""
    return np.concatenate(
        [np.zeros(0, np.int64), *(some.start + np.flatnonzero(of(some)) for some in spans(count))]
    )


def marked(count: int, of: Callable[[slice], Mask]) -> Mask:
    """(count,) what `of` says of the rows of columns of so many entries, where it is asked by spans."""
    mask = apart((count,), np.bool_)
    for some in spans(count):
        mask[some] = of(some)
    return mask


def picked(column: npt.NDArray[Scalar], rows: Index) -> npt.NDArray[Scalar]:
    """(m, ...) the entries of a column at rows (m,) that are far from each other."""
    if len(column) <= _MOST:
        return column[rows]
    return np.concatenate([column[:0], *(column[rows[some]] for some in spans(len(rows), _PICKED))])


def apart(shape: tuple[int, ...], kind: npt.DTypeLike) -> npt.NDArray[Any]:
    """An array of zeros to be filled; a long one is in a file where there is room for it."""
    kind = np.dtype(kind)
    size = prod(shape) * kind.itemsize
    if shape[0] <= _MOST or size > room():
        return np.zeros(shape, kind)
    file = Spool(long=0)
    # written, because a disk that is full may not show later
    for first in range(0, size, len(_ZEROS)):
        file.write(_ZEROS[: size - first])
    return np.frombuffer(file.mapped(), kind).reshape(shape)


class _Column:
    """A column that grows: what is in a `file`, None at first, and behind it the `used` entries of a
    block."""

    __slots__ = ("block", "file", "used")

    def __init__(self, row: tuple[int, ...], kind: npt.DTypeLike) -> None:
        self.block = np.empty((_FIRST, *row), kind)
        self.used = 0
        self.file: Spool | None = None

    def put(self, values: npt.NDArray[Any]) -> None:
        """Append values."""
        while len(values) > (room := len(self.block) - self.used):
            self.block[self.used :] = values[:room]
            values, self.used = values[room:], len(self.block)
            if self.used < _MOST:
                longer = np.empty((2 * self.used, *self.block.shape[1:]), self.block.dtype)
                longer[: self.used] = self.block
                self.block = longer
            else:
                self._store()
        self.block[self.used : self.used + len(values)] = values
        self.used += len(values)

    def _store(self) -> None:
        if self.file is None:
            self.file = Spool(long=0)
        if self.used:
            self.file.write(self.block[: self.used].data.cast("B"))
        self.used = 0

    def array(self) -> npt.NDArray[Any]:
        """The whole column, which ends to grow."""
        if self.file is None:
            return self.block[: self.used].copy()
        self._store()
        return np.frombuffer(self.file.mapped(), self.block.dtype).reshape(-1, *self.block.shape[1:])


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """(n,) whole numbers that take few bytes each: `small` of the least kind that holds them, added to those
    `before`, where there are any. Indexed as an array, it gives them at full width."""

    small: npt.NDArray[np.integer[Any]]
    before: npt.NDArray[np.int32] | None = None

    @staticmethod
    def of(values: npt.NDArray[np.integer[Any]], before: npt.NDArray[np.int32] | None = None) -> Packed:
        """Numbers (n,) that are not far behind those `before`, where there are any."""
        column = Columns()
        for some in spans(len(values)):
            column.put("all", values[some] if before is None else values[some] - before[some], values.dtype)
        return column.packed("all", before)

    def __len__(self) -> int:
        return len(self.small)

    def __getitem__(self, index: Any) -> Any:
        numbers = self.small[index].astype(np.int64)
        return numbers if self.before is None else numbers + self.before[index]


class Columns:
    """Named columns that are appended to and taken once."""

    def __init__(self) -> None:
        self._columns: dict[str, _Column] = {}

    def put(self, name: str, values: npt.ArrayLike, kind: npt.DTypeLike) -> None:
        """Append values to a column, which is made with the first of them."""
        values = np.asarray(values)
        column = self._columns.get(name)
        if column is None:
            column = self._columns[name] = _Column(values.shape[1:], kind)
        column.put(values)

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put. Where all its numbers are the same, as frames
        often are, it is one number that stands for all."""
        column = self._columns.pop(name, None)
        return _settled(np.zeros((0, *width), kind) if column is None else column.array())

    def packed(self, name: str, before: npt.NDArray[np.int32] | None = None) -> Packed:
        """The column (n,) of whole numbers in few bytes; it holds by how much each is behind those `before`,
        where there are any."""
        column = self._columns.pop(name, None)
        if column is None:
            return Packed(_settled(np.zeros(0, np.uint8)), before)
        array, low, high = column.array(), 0, 0
        for some in spans(len(array)):
            low, high = min(low, int(array[some].min())), max(high, int(array[some].max()))
        least = np.min_scalar_type(high if low == 0 else min(low, -1 - high))
        small = _Column((), least)
        for some in spans(len(array)):
            small.put(array[some])
        return Packed(_settled(small.array()), before)


def _settled(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same read-only, and as one number where it has no other."""
    if array.ndim == 1 and len(array):
        one = np.broadcast_to(array[:1].copy(), len(array))
        same = (np.array_equal(array[some], one[some], equal_nan=True) for some in spans(len(array)))
        array = one if all(same) else array
    array.setflags(write=False)
    return array
