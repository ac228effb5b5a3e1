"""Edits of a text: numbers replaced, words and blocks inserted, everything else kept byte for byte.

An edit replaces `start`..`end` of the source by a prefix (from a short table) and a number. All edits of
a stretch are rendered and spliced at once, in columns.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, distinct
from olp.core.values import dataclass

Bytes = npt.NDArray[np.uint8]
Whole = TypeVar("Whole", np.int8, np.int32, np.int64)

#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10 ** np.arange(19, dtype=np.int64)
#: four digits of text at a time
_DIGITS = (
    (np.arange(10_000)[:, None] // [1000, 100, 10, 1] % 10 + ord("0")).astype(np.uint8).view(np.uint32)[:, 0]
)
#: Bits of `Edits.order`; those of a position and one more go beside them.
_ORDER_BITS = 31
#: mantissa of an edit that has a prefix and no number
BARE = np.iinfo(np.int64).min


@dataclass(frozen=True, slots=True, eq=False)
class Edits:
    """(n,) columns. `mantissa` / 10**`decimals` is the number, BARE for none; `prefix` indexes a table of
    bytes; `order` is that of insertions at one position."""

    start: Index
    end: Index
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    prefix: npt.NDArray[np.int32]
    order: npt.NDArray[np.int32]

    @staticmethod
    def of(
        start: npt.ArrayLike, end: npt.ArrayLike, mantissa: npt.ArrayLike, decimals: npt.ArrayLike,
        prefix: npt.ArrayLike = 0, order: npt.ArrayLike = 0,
    ) -> Edits:  # fmt: skip
        """Edits of columns (n,), `start` for one; single numbers hold for all."""
        count = len(np.asarray(start))

        def column(value: npt.ArrayLike, kind: type[Whole]) -> npt.NDArray[Whole]:
            array = np.asarray(value, kind)
            return array if array.ndim else np.full(count, array)

        return Edits(
            column(start, np.int64), column(end, np.int64), column(mantissa, np.int64),
            column(decimals, np.int8), column(prefix, np.int32), column(order, np.int32),
        )  # fmt: skip

    @staticmethod
    def join(parts: list[Edits]) -> Edits:
        """All edits in the order of the text."""
        columns = [np.concatenate([getattr(p, name) for p in parts]) for name in Edits.__slots__]
        start, end, order = columns[0], columns[1], columns[5]
        # what is inserted at a position comes before what is replaced there. As one number, as the parts are
        # in order already: that takes a sixth of the time of three keys
        key = (start << 1) | (end > start)
        index = np.argsort((key << _ORDER_BITS) | order, kind="stable")
        return Edits(*(column.take(index) for column in columns))

    def __len__(self) -> int:
        return len(self.start)


class EditList:
    """Edits that are found one by one; `done` turns them into columns."""

    def __init__(self, prefixes: Prefixes) -> None:
        self._prefixes = prefixes
        self._rows: list[tuple[int, int, int, int, int, int]] = []

    def add(
        self, start: int, end: int, mantissa: int, decimals: int, prefix: bytes = b"", order: int = 0
    ) -> None:
        """Replace `start`..`end` by a prefix and a number (BARE: no number)."""
        self._rows.append((start, end, mantissa, decimals, self._prefixes(prefix), order))

    def done(self) -> Edits:
        columns = np.array(self._rows, np.int64).reshape(-1, 6).T
        start, end, mantissa, decimals, prefix, order = columns
        return Edits(
            start, end, mantissa, decimals.astype(np.int8), prefix.astype(np.int32), order.astype(np.int32)
        )


class Prefixes:
    """A table of the few byte strings that come before inserted numbers."""

    def __init__(self) -> None:
        self.table: list[bytes] = [b""]
        self._index: dict[bytes, int] = {b"": 0}

    def __call__(self, text: bytes) -> int:
        index = self._index.get(text)
        if index is None:
            index = self._index[text] = len(self.table)
            self.table.append(text)
        return index


def splice(source: Bytes, offset: int, edits: Edits, prefixes: Prefixes, *, leading_zero: bool) -> Bytes:
    """The text of `source`, which begins at `offset` of the whole, with its edits made."""
    if not len(edits):
        return source
    text, length = render(edits, prefixes, leading_zero=leading_zero)
    return replaced(source, edits.start - offset, edits.end - offset, text, length)


def replaced(source: Bytes, start: Index, end: Index, text: Bytes, length: Index) -> Bytes:
    """`source` with its bytes `start`..`end` (n,) replaced by runs of `text` that are `length` (n,) long, in
    the order of the text. At least one."""
    count = len(start)
    grow = np.cumsum(length - (end - start))
    total = len(source) + int(grow[-1])
    runs = np.zeros(2 * count + 1, np.int64)
    flags = np.zeros(2 * count + 1, bool)
    flags[1::2] = True
    runs[1::2] = length
    runs[0] = start[0]
    runs[2:-1:2] = start[1:] - end[:-1]
    runs[-1] = len(source) - end[-1]
    fresh = np.repeat(flags, runs)
    runs[1::2] = end - start
    removed = np.repeat(flags, runs)
    spliced = np.zeros(total, np.uint8)
    spliced[fresh] = text
    spliced[~fresh] = source[~removed]
    return spliced


def render(edits: Edits, prefixes: Prefixes, *, leading_zero: bool) -> tuple[Bytes, Index]:
    """All prefixes and numbers as one run of bytes, and the length of each."""
    bare = edits.mantissa == BARE
    mantissa = np.where(bare, 0, edits.mantissa)
    decimals = edits.decimals.astype(np.int64)
    negative = mantissa < 0
    size = np.abs(mantissa)
    # dividing by one number is several times cheaper than by a column of them
    one = bool((decimals == decimals[0]).all())
    power = _POW10[int(decimals[0])] if one else _POW10[decimals]
    whole = size // power
    fraction = size - whole * power
    slow = np.flatnonzero((decimals > 8) | (whole >= 10**8))
    if slow.size:
        whole[slow] = fraction[slow] = decimals[slow] = 0
    widths = np.array([len(p) for p in prefixes.table], np.int64)
    lead = int(widths[edits.prefix].max()) + 1
    whole_groups = 1 if int(whole.max(initial=0)) < 10_000 else 2
    fraction_groups = 1 if int(decimals.max(initial=0)) <= 4 else 2
    point = lead + 4 * whole_groups
    width = point + 1 + 4 * fraction_groups
    text = np.zeros((len(size), width), np.uint8)
    if whole_groups == 2:
        high = whole // 10_000
        text[:, lead : lead + 4] = _DIGITS[high].view(np.uint8).reshape(-1, 4)
        text[:, lead + 4 : point] = _DIGITS[whole - high * 10_000].view(np.uint8).reshape(-1, 4)
    else:
        text[:, lead:point] = _DIGITS[whole].view(np.uint8).reshape(-1, 4)
    text[:, point] = 46
    scaled = fraction * _POW10[np.maximum(4 * fraction_groups - decimals, 0)]
    if fraction_groups == 2:
        high = scaled // 10_000
        text[:, point + 1 : point + 5] = _DIGITS[high % 10_000].view(np.uint8).reshape(-1, 4)
        text[:, point + 5 :] = _DIGITS[scaled - high * 10_000].view(np.uint8).reshape(-1, 4)
    else:
        text[:, point + 1 :] = _DIGITS[scaled % 10_000].view(np.uint8).reshape(-1, 4)
    short = whole.astype(np.int32)
    digits = np.ones(len(size), np.int16)
    for n in range(1, 4 * whole_groups):
        digits += short >= 10**n
    if not leading_zero:
        digits -= (whole == 0) & (decimals > 0)
    begin = np.int16(point) - digits
    end = np.where(decimals > 0, point + 1 + decimals, point).astype(np.int16)
    begin[bare] = end[bare] = point
    begin -= negative
    rows = np.flatnonzero(negative)
    text[rows, begin[rows]] = 45
    with_prefix = np.flatnonzero(edits.prefix)
    for which in distinct(edits.prefix[with_prefix]).tolist():
        chosen = with_prefix[edits.prefix[with_prefix] == which]
        for i, byte in enumerate(reversed(prefixes.table[which])):
            text[chosen, begin[chosen] - 1 - i] = byte
    begin -= widths[edits.prefix].astype(np.int16)
    # columns from `begin` on and before `end`: to look them up is faster than to compare all
    behind = np.arange(width) >= np.arange(width + 1)[:, None]
    valid = behind.take(begin, axis=0) & ~behind.take(end, axis=0)
    length = (end - begin).astype(np.int64)
    flat = text[valid]
    if slow.size:
        return _with_slow(flat, length, edits, prefixes, slow, leading_zero)
    return flat, length


def _with_slow(
    flat: Bytes, length: Index, edits: Edits, prefixes: Prefixes, slow: Index, leading_zero: bool
) -> tuple[Bytes, Index]:
    """Put in the rare numbers with more than eight digits on a side of the point."""
    stop = np.cumsum(length)
    pieces: list[Bytes] = []
    done = 0
    length = length.copy()
    for i in slow.tolist():
        pieces.append(flat[done : int(stop[i] - length[i])])
        word = prefixes.table[int(edits.prefix[i])] + number_text(
            int(edits.mantissa[i]), int(edits.decimals[i]), leading_zero=leading_zero
        )
        pieces.append(np.frombuffer(word, np.uint8))
        done = int(stop[i])
        length[i] = len(word)
    pieces.append(flat[done:])
    return np.concatenate(pieces), length


def number_text(mantissa: int, decimals: int, *, leading_zero: bool = True) -> bytes:
    """One number, fixed point, all decimals written."""
    digits = str(abs(mantissa)).rjust(decimals + 1, "0")
    whole, fraction = digits[: len(digits) - decimals], digits[len(digits) - decimals :]
    if not leading_zero and whole == "0" and decimals:
        whole = ""
    return (("-" if mantissa < 0 else "") + whole + ("." + fraction if decimals else "")).encode()
