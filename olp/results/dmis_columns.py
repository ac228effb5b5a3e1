"""Reads the plain points among DMIS output in columns: `FA(name)=FEAT/POINT,CART,` with three or six numbers
behind it, in one line without a comment. All other statements are read one by one (`dmis`)."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.program.pointlist.columns import backward, forward, plain_numbers
from olp.program.text.numbers import LARGEST
from olp.program.text.statements import Bytes, Chunk

_LABEL = b"FA("
_FEATURE = b")=FEAT/POINT,CART,"
#: Bytes of the text.
_CLOSING = ord(")")
_COMMA = ord(",")
_DOLLAR = ord("$")
_TAB = ord("\t")
_FEED = ord("\n")
_RETURN = ord("\r")
_BLANK = ord(" ")
#: Bits that capital and small letters have in common.
_CAPITAL = 0xDF
#: A point, and a point with a direction.
_WIDTHS = (3, 6)


@dataclass(frozen=True, slots=True, eq=False)
class PlainPoints:
    """Points (n,) of a chunk by their `line`, from 0 in the chunk. (n, 3) `start` and `end` are the bytes of
    X, Y and Z in the text and `value` what they say; `normal` (n, 3), NaN where there is none."""

    line: Index
    names: tuple[str, ...]
    start: Index
    end: Index
    value: Array
    normal: Array

    def part(self, a: int, b: int) -> PlainPoints:
        """The points a..b."""
        return PlainPoints(
            self.line[a:b], self.names[a:b], self.start[a:b], self.end[a:b], self.value[a:b], self.normal[a:b]
        )


def plain_points(chunk: Chunk) -> PlainPoints:
    """The plain points of a chunk; none where one of them has a number that is not plain."""
    offset, last = int(chunk.line_start[0]), int(chunk.line_end[-1])
    # at least the line end of a chunk that has nothing else
    text = np.frombuffer(chunk.data, np.uint8)[offset : max(last, offset + 1)]
    begin, end = chunk.line_start - offset, chunk.line_end - offset
    closing = _first(text, _CLOSING, begin)
    numbers = closing + len(_FEATURE)
    plain = _is(text, begin, _LABEL) & _is(text, closing, _FEATURE) & (numbers < end)
    plain &= ~_beside_dollars(text, begin)
    for edge in (begin + len(_LABEL), closing - 1):
        plain &= text[np.clip(edge, 0, len(text) - 1)] > _BLANK
    commas = np.append(np.flatnonzero(text == _COMMA), len(text))
    base = np.searchsorted(commas, numbers)
    width = np.searchsorted(commas, end) - base + 1
    control = (text < _BLANK) & (text != _TAB) & (text != _FEED) & (text != _RETURN)
    parts = []
    for count in _WIDTHS if not control.any() else ():
        rows = np.flatnonzero(plain & (width == count))
        cells = _cells(text, numbers[rows], end[rows], commas, base[rows], count)
        parsed = plain_numbers(text, *cells, False) if rows.size else None
        if parsed is None:
            continue
        value = parsed[0] / 10.0 ** parsed[1]
        if (np.abs(value) < LARGEST).all():
            normal = value[:, 3:] if count > 3 else np.full((len(rows), 3), np.nan)
            parts.append((rows, cells[0][:, :3] + offset, cells[1][:, :3] + offset, value[:, :3], normal))
    if not parts:
        nothing = np.zeros((0, 3))
        return PlainPoints(
            np.zeros(0, np.int64), (), nothing.astype(int), nothing.astype(int), nothing, nothing
        )
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.argsort(columns[0])
    line, start, stop, values, normals = (column[order] for column in columns)
    spans = zip((begin[line] + offset).tolist(), (closing[line] + offset + 1).tolist(), strict=True)
    names = tuple("FA" + chunk.data[a + 2 : b].decode("latin-1") for a, b in spans)
    return PlainPoints(line, names, start, stop, values, normals)


def _first(text: Bytes, byte: int, begin: Index) -> Index:
    """The first such byte from positions on, the length of the text where there is none."""
    places = np.append(np.flatnonzero(text == byte), len(text))
    return places[np.searchsorted(places, begin)]


def _is(text: Bytes, position: Index, words: bytes) -> Mask:
    """Whether `words` are at positions, in capital or small letters."""
    padded = np.concatenate((text, np.zeros(len(words), np.uint8)))
    same = np.ones(len(position), bool)
    for k, byte in enumerate(words):
        here = padded[position + k]
        same &= (here & _CAPITAL == byte) if chr(byte).isalpha() else (here == byte)
    return same


def _beside_dollars(text: Bytes, begin: Index) -> Mask:
    """Lines with a `$`, and those after one, which may continue it."""
    lines = np.searchsorted(begin, np.flatnonzero(text == _DOLLAR), "right") - 1
    beside = np.zeros(len(begin) + 1, bool)
    beside[lines] = beside[lines + 1] = True
    return beside[:-1]


def _cells(
    text: Bytes, begin: Index, end: Index, commas: Index, base: Index, count: int
) -> tuple[Index, Index]:
    """(n, count) first and last bytes of cells from `begin` to `end`, without blanks around them."""
    inner = commas[base[:, None] + np.arange(count - 1)]
    first = np.column_stack((begin, inner + 1)).ravel()
    last = np.column_stack((inner, end)).ravel()
    first = forward(text, first, last)
    return first.reshape(-1, count), backward(text, last, first).reshape(-1, count)
