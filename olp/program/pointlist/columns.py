"""Reads the plain tables among lists of positions in columns: no quotes, no exponents, one number per cell.

Other tables are read row by row (`reader`), which also says what is wrong with them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.values import dataclass
from olp.program.rs274.lexer import Bytes, blanked, numbers, runs
from olp.program.text.delimited import DELIMITERS, Layout
from olp.program.text.numbers import LONGEST

#: mantissas of positions are smaller, and below this they are exact as doubles
_MOST = 10**15
#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """(n,) `line` from 1 and bytes `begin`..`end` of each row; (n, m) bytes `start`..`stop` of its numbers,
    their `mantissa` / 10**`decimals`. `cells` (n, k, 2) are the bytes of the other columns that were asked
    for."""

    line: Index
    begin: Index
    end: Index
    start: Index
    stop: Index
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    cells: Index

    @property
    def value(self) -> npt.NDArray[np.float64]:
        """(n, m) the numbers."""
        return np.asarray(self.mantissa / _POW10[self.decimals], float)


def columns(
    data: bytes, layout: Layout, header_line: int, places: list[int], others: list[int]
) -> Columns | None:
    """The rows of a table after its header, by the indices of its columns of numbers and of others; None
    where it is not plain."""
    if b'"' in data or data.count(b"\r") != data.count(b"\r\n") or not data:
        return None
    if data[:3] == b"\xef\xbb\xbf":
        data = b"   " + data[3:]
    text = np.frombuffer(data, np.uint8)
    if ((text < 32) & (text != 9) & (text != 10) & (text != 13)).any():
        return None
    newline = np.flatnonzero(text == 10)
    ends = newline if newline.size and newline[-1] == len(text) - 1 else np.append(newline, len(text))
    starts = np.concatenate(([0], ends[:-1] + 1))
    content = ends - ((ends > starts) & (text[np.maximum(ends - 1, 0)] == 13))
    lead = forward(text, starts, content)
    row = (lead < content) & (np.arange(len(starts)) >= header_line)
    for mark in {b"#", layout.comment.encode()}:
        row &= ~_begins(text, lead, mark)
    chosen = np.flatnonzero(row)
    if not chosen.size:
        return None
    begin, end = starts[chosen], content[chosen]
    count = len(places)
    spans = _cells(text, begin, end, layout, [*places, *others], count)
    if spans is None:
        return None
    start, stop = spans[:, :count, 0], spans[:, :count, 1]
    parsed = plain_numbers(text, start, stop, layout.decimal == "comma")
    if parsed is None:
        return None
    mantissa, decimals = parsed
    return Columns(chosen + 1, begin, end, start, stop, mantissa, decimals, spans[:, count:])


def _begins(text: Bytes, first: Index, mark: bytes) -> Mask:
    same = np.ones(len(first), bool)
    padded = np.concatenate((text, np.zeros(len(mark) + 1, np.uint8)))
    for i, byte in enumerate(mark):
        same &= padded[first + i] == byte
    return same


def forward(text: Bytes, position: Index, stop: Index) -> Index:
    """The first byte from `position` that is no blank, `stop` where all are."""
    position = position.copy()
    todo = np.arange(len(position))
    while True:
        todo = todo[position[todo] < stop[todo]]
        todo = todo[text[position[todo]] <= 32]
        if not todo.size:
            return position
        position[todo] += 1


def backward(text: Bytes, position: Index, start: Index) -> Index:
    """The byte after the last one before `position` that is no blank, `start` where all are."""
    position = position.copy()
    todo = np.arange(len(position))
    while True:
        todo = todo[position[todo] > start[todo]]
        todo = todo[text[position[todo] - 1] <= 32]
        if not todo.size:
            return position
        position[todo] -= 1


def _cells(
    text: Bytes, begin: Index, end: Index, layout: Layout, places: list[int], filled: int
) -> Index | None:
    """(n, k, 2) the bytes of cells, without blanks around them; None where a row has too few, or one of the
    first `filled` is empty."""
    mark = DELIMITERS[layout.delimiter]
    spans = np.zeros((len(begin), len(places), 2), np.int64)
    if mark is None:
        dark = np.concatenate(([False], text > 32, [False]))
        edges = np.flatnonzero(dark[1:] != dark[:-1])
        first, last = edges[0::2], edges[1::2]
        base = np.searchsorted(first, begin)
        count = np.searchsorted(first, end) - base
        if (count <= max(places)).any():
            return None
        for k, place in enumerate(places):
            spans[:, k, 0], spans[:, k, 1] = first[base + place], last[base + place]
        return spans
    marks = np.append(np.flatnonzero(text == ord(mark)), len(text))
    base = np.searchsorted(marks, begin)
    count = np.searchsorted(marks, end) - base
    if (count < max(places)).any():
        return None
    for k, place in enumerate(places):
        a = begin if place == 0 else marks[base + place - 1] + 1
        b = np.where(place < count, marks[np.minimum(base + place, len(marks) - 1)], end)
        spans[:, k, 0] = first_ = forward(text, a, b)
        spans[:, k, 1] = last_ = backward(text, b, first_)
        if k < filled and (first_ >= last_).any():
            return None
    return spans


def plain_numbers(
    text: Bytes, start: Index, stop: Index, comma: bool
) -> tuple[Index, npt.NDArray[np.int8]] | None:
    """Mantissa and decimals of numbers at the bytes `start`..`stop` of a text; None where one is not
    plain."""
    order = np.argsort(start, axis=None, kind="stable")
    first, last = start.ravel()[order], stop.ravel()[order]
    step = np.zeros(len(text) + 1, np.int8)
    step[first] += 1
    step[last] -= 1
    keep = np.cumsum(step[:-1], dtype=np.int8).astype(bool)
    work = blanked(text, keep)
    # `+,-./` and digits make a number here: a slash and the other decimal mark do not belong to one
    if ((work == 47) | (work == (46 if comma else 44))).any():
        return None
    work[work == 44] = 46
    compact, begin, end = runs(work)
    if len(begin) != len(first) or (begin != first).any() or (end != last).any():
        return None
    mantissa, decimals, _, malformed = numbers(compact, compact[8 : len(compact) - 8], begin, end)
    long = (stop - start).max(initial=0) > LONGEST
    if malformed.size or long or (np.abs(mantissa) >= _MOST).any():
        return None
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return mantissa[back].reshape(start.shape), decimals[back].reshape(start.shape)
