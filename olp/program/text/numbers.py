"""Numbers in a text: the value and the form of one, and another value written in the same form."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass

Spans = npt.NDArray[np.int64] | npt.NDArray[np.int32]

#: Further decimals are below the resolution of a double.
MOST_DECIMALS = 10
#: Characters of a number at most.
LONGEST = 40
#: Positions are smaller than this in any unit.
LARGEST = 1e8
_NUMBER = pattern(rb"([-+]?)(\d*)([.,]?)(\d*)(?:([eEdD])([-+]?\d+))?")
#: Blanks as bytes.
_SPACE = 32
_TAB = 9
#: Numbers whose surroundings are looked at together, to limit memory.
_BLOCK = 1 << 16


@dataclass(frozen=True, slots=True)
class Number:
    """A number as written: its value, its last digit, and its form."""

    value: float
    digit: float
    plus: bool
    whole: int
    bare: bool
    mark: bytes
    decimals: int
    letter: bytes
    exponent_digits: int
    exponent_plus: bool

    @property
    def places(self) -> int:
        """Decimals of the number without its exponent."""
        return -round(math.log10(self.digit))


def number(text: bytes, decimal: bytes = b".") -> Number | None:
    """The number that a text is, None where it is none or too large for a position. `decimal` is its decimal
    mark."""
    match = _NUMBER.fullmatch(text)
    if match is None or not (match[2] or match[4]) or (match[3] and match[3] != decimal):
        return None
    sign, whole, mark, fraction, letter, exponent = match.groups(b"")
    power = int(exponent or b"0")
    if abs(power) > 99 or len(text) > LONGEST:
        return None
    value = float(sign + (whole or b"0") + b"." + (fraction or b"0") + b"e%d" % power)
    if abs(value) >= LARGEST:
        return None
    return Number(
        value=value, digit=10.0 ** (power - len(fraction)), plus=sign == b"+", whole=len(whole),
        bare=whole == b"", mark=mark, decimals=len(fraction), letter=letter,
        exponent_digits=len(exponent.lstrip(b"+-")), exponent_plus=exponent[:1] == b"+",
    )  # fmt: skip


def written(form: Number, value: float, decimals: int | None = None, decimal: bytes = b".") -> bytes:
    """A value in the form of a number: its sign, leading zeros, digits and exponent. `decimals` count where
    they are more than those of the form."""
    places = max(form.decimals, decimals or 0)
    if form.letter:
        text, power = _scientific(value, places)
        sign = "-" if power < 0 else "+" if form.exponent_plus else ""
        tail = form.letter + f"{sign}{abs(power):0{form.exponent_digits}d}".encode()
    else:
        text, tail = f"{value:.{places}f}", b""
    negative = text.startswith("-")
    whole, _, fraction = text.lstrip("-").partition(".")
    if not (whole + fraction).strip("0"):
        negative = False
    whole = whole.rjust(form.whole, "0") if form.whole > 1 and _padded(form) else whole
    if form.bare and whole == "0" and fraction:
        whole = ""
    sign_text = "-" if negative else "+" if form.plus else ""
    point = (form.mark or decimal) if fraction or form.mark else b""
    return sign_text.encode() + whole.encode() + point + fraction.encode() + tail


def _padded(form: Number) -> bool:
    """Whether the digits before the mark were filled up with zeros."""
    return abs(form.value) < 10.0 ** (form.whole - 1) and not form.letter


def _scientific(value: float, places: int) -> tuple[str, int]:
    mantissa, _, power = f"{value:.{places}e}".partition("e")
    return mantissa, int(power)


class Placing:
    """Where new numbers go so that columns of a text keep their edges.

    A text is padded where numbers come after two blanks or more. Then a shorter number gets blanks before it,
    and a longer one replaces blanks, but not the last one. `start` and `end` are the bytes of all numbers, in
    any order and shape.
    """

    def __init__(self, data: Text, start: Spans, end: Spans) -> None:
        self.text = np.frombuffer(data, np.uint8)
        first: Spans = start.ravel()
        last: Spans = end.ravel()
        blocks = [slice(a, a + _BLOCK) for a in range(0, len(first), _BLOCK)]
        self.padded = any((self._blank(first[k] - 1) & self._blank(first[k] - 2)).any() for k in blocks)
        # numbers before two blanks are in a column with a left edge
        self.trailing = not self.padded and any(
            (self._is(last[k], _SPACE) & self._is(last[k] + 1, _SPACE)).any() for k in blocks
        )

    def places(self, start: Index, end: Index, length: Index) -> tuple[Index, Index, Index, Index]:
        """Of edits that replace numbers (n,) by others of `length` (n,) bytes: start, end, and how many
        blanks come before and behind the new number."""
        more = length - (end - start)
        start, end = start.copy(), end.copy()
        before, after = np.zeros_like(more), np.zeros_like(more)
        if self.padded:
            before = np.maximum(-more, 0)
            longer = np.flatnonzero(more > 0)
            # the last blank of a gap stays
            gap = self._blanks(start[longer] - 1, -1, more[longer] + 1)
            start[longer] -= np.minimum(more[longer], np.maximum(gap - 1, 0))
        elif self.trailing:
            shorter = (more < 0) & self._blank(end)
            after = np.where(shorter, -more, 0)
            longer = np.flatnonzero(more > 0)
            gap = self._blanks(end[longer], 1, more[longer] + 1)
            # where the text ends in blanks all of them go
            at_end = end[longer] + gap == len(self.text)
            taken = np.minimum(more[longer], np.maximum(gap - ~at_end, 0))
            end[longer] += taken
        return start, end, before, after

    def placed(self, edits: list[tuple[int, int, bytes]]) -> list[tuple[int, int, bytes]]:
        """Edits (start, end, new number) with the bytes that they replace, and with their blanks."""
        start, end = np.array([edit[:2] for edit in edits], np.int64).reshape(-1, 2).T
        length = np.array([len(text) for _, _, text in edits], np.int64)
        columns = (column.tolist() for column in self.places(start, end, length))
        return [
            (first, last, b" " * before + text + b" " * after)
            for (_, _, text), first, last, before, after in zip(edits, *columns, strict=True)
        ]

    def _is(self, at: Spans, byte: int) -> Mask:
        """Whether the bytes at positions, in the text or not, are this one."""
        inside = (at >= 0) & (at < len(self.text))
        return np.asarray(inside & (self.text[np.where(inside, at, 0)] == byte))

    def _blank(self, at: Spans) -> Mask:
        return self._is(at, _SPACE) | self._is(at, _TAB)

    def _blanks(self, at: Index, step: int, most: Index) -> Index:
        """How many blanks come one after the other from positions on, `most` (n,) at most."""
        count = np.zeros_like(at)
        rows = np.arange(len(at))
        while rows.size:
            rows = rows[(count[rows] < most[rows]) & self._blank(at[rows] + step * count[rows])]
            count[rows] += 1
        return count


def spliced(data: bytes, edits: list[tuple[int, int, bytes]]) -> bytes:
    """The text with edits (start, end, new bytes) made; none may overlap another. Insertions at one
    position come in the order of the edits."""
    pieces: list[bytes] = []
    done = 0
    for start, end, text in sorted(edits, key=lambda edit: edit[:2]):
        pieces += (data[done:start], text)
        done = end
    pieces.append(data[done:])
    return b"".join(pieces)
