"""The numbers in the lines of a text, as whole numbers with the form in which they are written.

A number is a run of digits with at most one point, and the minus before it where it is below 0. Value and
form give its characters back, so that a text is its skeleton and its numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.values import dataclass

Small = npt.NDArray[np.int32]
Byte = npt.NDArray[np.uint8]

#: What a number is replaced by in the skeleton of its line; the text itself must not contain it.
MARK = b"\x01"
#: Most digits of a number; a longer run of digits is text.
DIGITS = 9
#: Characters of a text that are searched at once, so that temporaries fit the cache.
_BAND = 1 << 17

_MINUS = b"-"[0]
_POINT = b"."[0]
_ZERO = b"0"[0]


@dataclass(frozen=True, slots=True, eq=False)
class Tokens:
    """Of the k numbers of a text in order: (k,) `value` without its point, digits before it (`whole`) and
    behind it (`decimals`), and whether there is a `point`. (n,) `skeleton` of each line, an index of
    `skeletons`, in which a mark stands for each number."""

    skeletons: list[bytes]
    skeleton: Small
    value: Small
    whole: Byte
    decimals: Byte
    point: npt.NDArray[np.bool_]

    @staticmethod
    def of(text: str) -> Tokens:
        """Raises ValueError for a text that contains the mark."""
        if MARK.decode() in text:
            raise ValueError("the text contains the mark of numbers")
        known: dict[bytes, int] = {}
        lines: list[Small] = []
        parts: tuple[list[npt.NDArray[Any]], ...] = ([], [], [], [])
        for band in _bands(text):
            found, rest = _numbers(np.frombuffer(band, np.uint8))
            for part, column in zip(parts, found, strict=True):
                part.append(column)
            names = rest.tobytes().split(b"\n")
            for name in dict.fromkeys(names):
                known.setdefault(name, len(known))
            lines.append(np.fromiter(map(known.__getitem__, names), np.int32, len(names)))
        return Tokens(list(known), _joined(lines), *map(_joined, parts))


def _joined(parts: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Parts of a column in one, and no longer alone."""
    whole = np.concatenate(parts)
    parts.clear()
    return whole


def _bands(text: str) -> Iterator[bytes]:
    """The text in parts of whole lines, without the line feeds between them. A long text is not encoded as a
    whole."""
    begin = 0
    while True:
        end = text.find("\n", begin + _BAND)
        if end < 0:
            yield text[begin:].encode()
            return
        yield text[begin:end].encode()
        begin = end + 1


def _numbers(code: Byte) -> tuple[tuple[npt.NDArray[Any], ...], Byte]:
    """Value, digits before and behind the point, and the point of each number; and the skeleton."""
    is_point = code == _POINT
    body = np.zeros(len(code) + 2, bool)
    body[1:-1] = ((code - _ZERO) < 10) | is_point
    edge = np.flatnonzero(body[1:] != body[:-1])
    start, stop = edge[0::2], edge[1::2]
    points = np.concatenate(([0], np.cumsum(is_point, dtype=np.int32)))
    count = points[stop] - points[start]
    digits = stop - start - count
    valid = (count <= 1) & (digits >= 1) & (digits <= DIGITS)
    start, stop, digits = start[valid], stop[valid], digits[valid]
    point = count[valid] == 1
    decimals = np.zeros(len(start), np.int64)
    decimals[point] = stop[point] - 1 - np.flatnonzero(is_point)[points[start[point]]]
    value = _values(code, start, digits, decimals, point)
    # a minus before 0 stays in the text, as -0 is not an integer
    minus = (start > 0) & (value != 0)
    minus[minus] = code[start[minus] - 1] == _MINUS
    value[minus] *= -1
    rest = _without(code, start - minus, stop)
    form = (digits - decimals).astype(np.uint8), decimals.astype(np.uint8), point
    return (value, *form), rest


def _values(code: Byte, start: Index, digits: Index, decimals: Index, point: npt.NDArray[np.bool_]) -> Small:
    """The whole numbers of runs, without their points; runs of one form at a time."""
    value = np.zeros(len(start), np.int32)
    form = ((digits * (DIGITS + 1) + decimals) * 2 + point).astype(np.uint8)
    for one in np.flatnonzero(np.bincount(form)).tolist():
        rows = np.flatnonzero(form == one)
        count, behind = int(digits[rows[0]]), int(decimals[rows[0]])
        first = start[rows]
        for k in range(count):
            # the digits behind a point are one place on
            value[rows] = 10 * value[rows] + (code[first + k + (one % 2 and k >= count - behind)] - _ZERO)
    return value


def _without(code: Byte, start: Index, stop: Index) -> Byte:
    """The text with a mark in place of each run from `start` to `stop`."""
    change = np.zeros(len(code) + 1, np.int8)
    change[start] = 1
    change[stop] -= 1
    keep = np.cumsum(change[:-1], dtype=np.int8) == 0
    keep[start] = True
    rest = code.copy()
    rest[start] = MARK[0]
    return np.asarray(rest[keep])
