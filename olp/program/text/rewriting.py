"""Numbers of a text written again in their own form, in columns: what `numbers` does one by one."""

from __future__ import annotations

import re

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.program.text.edits import Bytes, Edits, Prefixes, render
from olp.program.text.numbers import LARGEST, number, written

#: Bytes of numbers.
_PLUS = ord("+")
_MINUS = ord("-")
_ZERO = ord("0")
_POINT = ord(".")
#: Where a number goes on in the next line.
_GOES_ON = re.compile(rb"\$\s*")
#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
#: Mantissas are exact as doubles up to here.
_EXACT = 2.0**53


@dataclass(frozen=True, slots=True, eq=False)
class Rewritten:
    """New numbers (n,) one after the other: their bytes `text`, the `length` of each, and the `value` that
    each says, or the old one where the new one is no number for a position. `continued` are those that went
    on in the next line."""

    text: Bytes
    length: Index
    value: Array
    continued: Mask


@dataclass(frozen=True, slots=True, eq=False)
class _Forms:
    """The forms of numbers (n,) that are a sign, digits and a mark at most: `plus` and `decimals`. They are
    `plain` where they have no other feature of a form (exponent, zeros in front, a mark at an end)."""

    plus: Mask
    decimals: Index
    plain: Mask


def rewritten(
    text: Bytes, start: Index, end: Index, old: Array, new: Array, decimals: int | None, decimal: bytes
) -> Rewritten:
    """The values `new` (n,) in the form of the numbers at the bytes `start`..`end` (n,) of a text, whose
    values are `old` (n,). `decimals` and `decimal` are those of `numbers.written`. A number that goes on in
    the next line after a `$` then ends in the first."""
    forms = _forms(text, start, end, decimal)
    places = np.maximum(forms.decimals, decimals or 0)
    scaled = new * _POW10[np.minimum(places, len(_POW10) - 1)]
    mantissa = np.rint(scaled)
    # next to a half the product may be rounded to the other side than the value
    certain = np.abs(scaled - mantissa) < 0.5 - np.spacing(np.abs(scaled))
    plain = forms.plain & certain & (np.abs(mantissa) < _EXACT) & (np.abs(new) < LARGEST - 1.0)
    plain &= places < len(_POW10)
    rows = np.flatnonzero(plain)
    flat, length = _rendered(mantissa[rows].astype(np.int64), places[rows], forms.plus[rows], decimal)
    lengths, value = np.zeros(len(start), np.int64), old.copy()
    lengths[rows], value[rows] = length, mantissa[rows] / _POW10[places[rows]]
    continued = np.zeros(len(start), bool)
    others: list[bytes] = []
    for k in np.flatnonzero(~plain).tolist():
        source = text[start[k] : end[k]].tobytes()
        form = number(_GOES_ON.sub(b"", source), decimal)
        assert form is not None
        word = written(form, float(new[k]), decimals, decimal)
        said = number(word, decimal)
        value[k] = old[k] if said is None else said.value
        continued[k] = b"$" in source
        others.append(word + b"".join(_GOES_ON.findall(source)))
        lengths[k] = len(others[-1])
    if others:
        of_plain = np.repeat(plain, lengths)
        merged = np.empty(len(of_plain), np.uint8)
        merged[of_plain] = flat
        merged[~of_plain] = np.frombuffer(b"".join(others), np.uint8)
        flat = merged
    return Rewritten(flat, lengths, value, continued)


def _forms(text: Bytes, start: Index, end: Index, decimal: bytes) -> _Forms:
    length = end - start
    base = np.cumsum(length) - length
    owner = np.repeat(np.arange(len(start)), length)
    place = np.arange(len(owner)) - base[owner]
    byte = text[start[owner] + place]
    first = text[start]
    sign = (first == _PLUS) | (first == _MINUS)
    digit = (byte >= _ZERO) & (byte <= _ZERO + 9)
    mark = np.flatnonzero(byte == ord(decimal))
    decimals = np.zeros(len(start), np.int64)
    decimals[owner[mark]] = length[owner[mark]] - place[mark] - 1
    marked = np.zeros(len(start), bool)
    marked[owner[mark]] = True
    whole = length - sign - marked - decimals
    plain = np.add.reduceat(digit, base, dtype=np.int64) + sign + marked == length
    plain &= (whole > 0) & ~(marked & (decimals == 0))
    plain &= (whole == 1) | (text[np.minimum(start + sign, len(text) - 1)] != _ZERO)
    return _Forms(first == _PLUS, decimals, plain)


def _rendered(mantissa: Index, decimals: Index, plus: Mask, decimal: bytes) -> tuple[Bytes, Index]:
    if not len(mantissa):
        return np.zeros(0, np.uint8), np.zeros(0, np.int64)
    prefixes = Prefixes()
    prefix = np.where(plus & (mantissa >= 0), prefixes(b"+"), 0).astype(np.int32)
    nowhere = np.zeros(len(mantissa), np.int64)
    edits = Edits(nowhere, nowhere, mantissa, decimals.astype(np.int8), prefix, nowhere.astype(np.int32))
    flat, length = render(edits, prefixes, leading_zero=True)
    flat[flat == _POINT] = ord(decimal)
    return flat, length


def padded(text: Bytes, length: Index, before: Index, after: Index) -> tuple[Bytes, Index]:
    """Runs of `text` of `length` (n,) with so many blanks `before` (n,) and `after` (n,) each, and their new
    lengths."""
    parts = np.column_stack((before, length, after)).ravel()
    inked = np.repeat(np.tile([False, True, False], len(length)), parts)
    result = np.full(len(inked), ord(" "), np.uint8)
    result[inked] = text
    return result, before + length + after


def kept(text: Bytes, length: Index, chosen: Mask) -> tuple[Bytes, Index]:
    """The runs of `text` that are `chosen` (n,)."""
    return text[np.repeat(chosen, length)], length[chosen]
