"""Whole numbers in few bytes: differences along a column, in planes of bytes that deflate well."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.errors import CannotCompute
from olp.core.values import dataclass

Whole = npt.NDArray[np.int64]

#: Most times that a column is differenced: the third difference of a smooth path is rounding.
_MOST = 3
#: A difference of a number below this is a whole number that a double holds, also in zigzag order.
_LARGEST = 1 << 48
#: Rows of a block on which the number of differences is tried.
_TRIED = 2048
#: Blocks of a column that are tried.
_BLOCKS = 8


@dataclass(frozen=True, slots=True)
class Coded:
    """A column that was differenced `order` times, in `planes`: plane k has byte k of each row. A number r is
    stored as 2 r, a negative one as -2 r - 1, in as many bytes as the largest one needs. A `wide` column does
    not fit int32."""

    order: int
    wide: bool
    planes: list[bytes]

    @staticmethod
    def of(name: str, column: Whole) -> Coded:
        """The (n,) column `name`. Raises CannotCompute for numbers of 2^48 or more."""
        largest = max(int(column.max()), -int(column.min())) if len(column) else 0
        if largest >= _LARGEST:
            raise CannotCompute(
                f"values of {name!r} are too large to be stored; they must be below 2^48 steps"
            )
        order = _cheapest(column)
        change = column
        for _ in range(order):
            change = np.diff(change, prepend=0)
        return Coded(order, largest >= 1 << 31, _planes(change))


def small(whole: Whole) -> npt.NDArray[Any]:
    """Whole numbers in half the memory, where they fit."""
    small = whole.astype(np.int32)
    return small if (small == whole).all() else whole


def _planes(change: Whole) -> list[bytes]:
    """Bytes of each plane, the lowest first; none where all numbers are 0."""
    zigzag = (change << 1) ^ (change >> 63)
    width = (int(zigzag.max(initial=0)).bit_length() + 7) // 8
    octets = zigzag.astype("<i8", copy=False).view(np.uint8).reshape(-1, 8)
    return [octets[:, k].tobytes() for k in range(width)]


def _cheapest(column: Whole) -> int:
    """The number of differences with which blocks of a column deflate best."""
    if len(column) <= _TRIED * _BLOCKS:
        blocks = [column]
    else:
        blocks = [column[a : a + _TRIED] for a in np.linspace(0, len(column) - _TRIED, _BLOCKS).astype(int)]

    def size(order: int) -> int:
        # the first row of a block is no difference within it
        some = np.concatenate([np.diff(block, n=order) for block in blocks])
        return sum(len(zlib.compress(plane, 1)) for plane in _planes(some))

    return min(range(_MOST + 1), key=size)
