"""Numbers in a text: the value and the form of one, and another value written in the same form."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Spans = npt.NDArray[np.int64] | npt.NDArray[np.int32]

#: Further decimals are below the resolution of a double.
MOST_DECIMALS = 10
#: Characters of a number at most.
LONGEST = 40
#: Positions are smaller than this in any unit.
_MOST = 1e8
_NUMBER = re.compile(rb"([-+]?)(\d*)([.,]?)(\d*)(?:([eEdD])([-+]?\d+))?")
_BLANKS = b" \t"


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
    if abs(value) >= _MOST:
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
    and a longer one replaces blanks, but not the last one.
    """

    def __init__(self, data: bytes, start: Spans, end: Spans) -> None:
        self.data = data
        text = np.concatenate(([0, 0], np.frombuffer(data, np.uint8), [0, 0]))
        blank = (text == 32) | (text == 9)
        first, last = np.ravel(start) + 2, np.ravel(end) + 2
        self.padded = bool((blank[first - 1] & blank[first - 2]).any())
        # numbers before two blanks are in a column with a left edge
        self.trailing = not self.padded and bool(((text[last] == 32) & (text[last + 1] == 32)).any())

    def place(self, start: int, end: int, text: bytes) -> tuple[int, int, bytes]:
        """Start, end and text of the edit that replaces a number by another."""
        more = len(text) - (end - start)
        if self.padded and more > 0:
            taken = min(more, max(self._gap(start) - 1, 0))
            return start - taken, end, text
        if self.padded and more < 0:
            return start, end, b" " * -more + text
        if self.trailing and more > 0:
            after = 0
            while after < more and self.data[end + after : end + after + 2].strip(_BLANKS) == b"":
                after += 1
            return start, min(end + after, len(self.data)), text
        if self.trailing and more < 0 and self.data[end : end + 1] in (b" ", b"\t"):
            return start, end, text + b" " * -more
        return start, end, text

    def _gap(self, start: int) -> int:
        position = start
        while position and self.data[position - 1] in _BLANKS:
            position -= 1
        return start - position


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
