"""Columns that grow: each is one array, so a long program leaves no small arrays in memory."""

from __future__ import annotations

import mmap
import sys
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.values import dataclass

#: Entries of the first block of a column; each further one has twice as many as the one before,
_FIRST = 1 << 10
#: up to so many.
_MOST = 1 << 16
#: Bytes from which an array has memory of its own. That of a smaller one is a place among others, and what is
#: free between places in use does not go back to the system.
_OWN = 1 << 16


if sys.platform == "win32":

    def _memory(size: int) -> mmap.mmap:
        return mmap.mmap(-1, size)

else:

    def _memory(size: int) -> mmap.mmap:
        return mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE)


def apart(shape: tuple[int, ...], kind: npt.DTypeLike) -> npt.NDArray[Any]:
    """An array to be filled, whose memory goes back to the system with it where it is large."""
    kind = np.dtype(kind)
    size = prod(shape) * kind.itemsize
    if size < _OWN:
        return np.empty(shape, kind)
    try:
        memory = _memory(size)
    except OSError:
        raise MemoryError from None
    return np.frombuffer(memory, kind).reshape(shape)


@dataclass(slots=True, eq=False)
class _Column:
    """Blocks that are full, the block that is filled now, and how many of its entries are used."""

    full: list[npt.NDArray[Any]]
    block: npt.NDArray[Any]
    used: int = 0


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
        for a in range(0, len(values), _MOST):
            part = values[a : a + _MOST]
            column.put("all", part if before is None else part - before[a : a + _MOST], values.dtype)
        return column.packed("all", before)

    def __len__(self) -> int:
        return len(self.small)

    def __getitem__(self, index: Any) -> Any:
        numbers = self.small[index].astype(np.int64)
        return numbers if self.before is None else numbers + self.before[index]


class Columns:
    """Named columns that are appended to and taken once. Each entry is moved once, when its column is taken:
    a column of a million entries that grows as one array is moved five times."""

    def __init__(self) -> None:
        self._columns: dict[str, _Column] = {}

    def put(self, name: str, values: npt.ArrayLike, kind: npt.DTypeLike) -> None:
        """Append values to a column, which is made with the first of them."""
        values = np.asarray(values)
        column = self._columns.get(name)
        if column is None:
            column = self._columns[name] = _Column([], apart((_FIRST, *values.shape[1:]), kind))
        while len(values) > (room := len(column.block) - column.used):
            column.block[column.used :] = values[:room]
            values = values[room:]
            column.full.append(column.block)
            size = min(2 * len(column.block), _MOST)
            column.block, column.used = apart((size, *values.shape[1:]), column.block.dtype), 0
        column.block[column.used : column.used + len(values)] = values
        column.used += len(values)

    def take(self, name: str, kind: npt.DTypeLike, *width: int) -> npt.NDArray[Any]:
        """The column, read-only; empty where nothing was put. Where all its numbers are the same, as frames
        often are, it is one number that stands for all."""
        blocks = self._blocks(name)
        return _joined(blocks, blocks[0].dtype) if blocks else _joined([np.zeros((0, *width), kind)], kind)

    def packed(self, name: str, before: npt.NDArray[np.int32] | None = None) -> Packed:
        """The column (n,) of whole numbers in few bytes; it holds by how much each is behind those `before`,
        where there are any."""
        blocks = self._blocks(name) or [np.zeros(0, np.int64)]
        low = min(int(block.min(initial=0)) for block in blocks)
        high = max(int(block.max(initial=0)) for block in blocks)
        least = np.min_scalar_type(high if low == 0 else min(low, -1 - high))
        return Packed(_joined(blocks, least), before)

    def _blocks(self, name: str) -> list[npt.NDArray[Any]]:
        """The blocks of a column, which is not there any more; none where nothing was put."""
        column = self._columns.pop(name, None)
        return [] if column is None else [*column.full, column.block[: column.used]]


def _joined(blocks: list[npt.NDArray[Any]], kind: npt.DTypeLike) -> npt.NDArray[Any]:
    """One read-only array of blocks, which are taken from the list."""
    end = sum(map(len, blocks))
    array = apart((end, *blocks[0].shape[1:]), kind)
    # from the last one on: the memory of each is free before more of the array is filled
    while blocks:
        block = blocks.pop()
        array[end - len(block) : end] = block
        end -= len(block)
    if array.ndim == 1 and len(array):
        one = np.broadcast_to(array[:1].copy(), len(array))
        array = one if np.array_equal(array, one, equal_nan=True) else array
    array.setflags(write=False)
    return array
