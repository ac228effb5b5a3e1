"""Lexer of statements, `[label =] MAJOR [/ minor, minor …]`, which APT and DMIS share.

Bytes are never decoded. `$` at the end of a line joins the next line to it, also inside a token; `$$` starts
a comment. Lines that state a plain point (`GOTO/x,y,z`, one line, no comment) are read in columns; all
others become `Statement`s, one by one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.core.progress import Progress, silent
from olp.core.values import dataclass
from olp.program.rs274.lexer import CHUNK, blanked, numbers, runs, slow_number, without_cr
from olp.program.text.line_ends import LONE_CR

Bytes = npt.NDArray[np.uint8]

_NUMBER = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EDed][+-]?\d+)?\Z")
_QUOTED = re.compile(rb"'[^'\r\n]*'")
#: the last eight columns of a card: a number, perhaps after letters
_SEQUENCE = re.compile(rb"[A-Z]{0,4} *\d{1,8} *\Z")
_CARD = re.compile(rb"(?m)^([^\r\n]{72})[^\r\n]{8}(?=\r?$)")
_CONTINUED = re.compile(rb"\$[ \t]*\Z")
_GROUPED = re.compile(rb"[()']")
#: numbers of fewer digits are exact in any case
_PLAIN_DIGITS = 13
#: numbers of a plain point at most: position and tool axis
_WIDEST = 6


def shown(text: bytes) -> str:
    """Words of a program in printable form, for a message."""
    printable = text.decode("ascii", "backslashreplace")
    return "".join(c if c.isprintable() else "?" for c in printable[:40])


class Field(NamedTuple):
    """One minor word of a statement: its text without blanks around it, in capitals, and its bytes
    `start`..`end` of the program."""

    text: bytes
    start: int
    end: int

    @property
    def number(self) -> tuple[int, int] | None:
        """Mantissa and decimals of a number; None for a word."""
        return number_of(self.text)


@lru_cache(1 << 12)
def number_of(text: bytes) -> tuple[int, int] | None:
    """Mantissa and decimals of a number as APT and DMIS write it, with an exponent or not; None where it is
    none."""
    whole, _, fraction = text.partition(b".")
    digits = whole + fraction
    if len(digits) < _PLAIN_DIGITS and (digits[1:] if digits[:1] in b"+-" else digits).isdigit():
        return int(digits), len(fraction)
    if not _NUMBER.match(text):
        return None
    body, _, power = text.upper().replace(b"D", b"E").partition(b"E")
    pair = slow_number(body)
    if pair is None or not power:
        return pair
    if len(power) > 4:
        return None
    mantissa, decimals = pair[0], pair[1] - int(power)
    if abs(decimals) > 18:
        return None
    if decimals < 0:
        mantissa, decimals = mantissa * 10**-decimals, 0
    return (mantissa, decimals) if abs(mantissa) < 10**18 and decimals <= 18 else None


@dataclass(slots=True, eq=False)
class Statement:
    """One statement: `line` (from 1) and bytes `begin`..`end` of its first to its last line, its `text`
    without comments and marks of continuation, and where each byte of that is (None: from `begin` on)."""

    line: int
    begin: int
    end: int
    text: bytes
    where: list[int] | None = None
    lines: int = 1

    def place(self, index: int) -> int:
        """Where a byte of `text` is in the program."""
        return self.begin + index if self.where is None else self.where[index]

    def head(self) -> tuple[bytes, bytes]:
        """The label before an equals sign and the major word, in capitals, without blanks."""
        before = self.text.partition(b"/")[0]
        label, equals, major = before.partition(b"=")
        if not equals:
            label, major = b"", before
        return label.strip().upper(), b" ".join(major.upper().split())

    def fields(self) -> list[Field]:
        """The minor words after the slash. Commas separate them, and blanks between two numbers; a comma at
        the end means nothing. Brackets keep a group together."""
        begin = self.text.find(b"/") + 1
        if not begin:
            return []
        text = self.text
        if not _GROUPED.search(text, begin):
            return self._simple(begin)
        fields, start, depth, quoted = [], begin, 0, False
        for i in range(begin, len(text)):
            c = text[i]
            if c == 39:
                quoted = not quoted
            elif quoted:
                continue
            elif c == 40:
                depth += 1
            elif c == 41:
                depth -= 1
            elif c == 44 and depth == 0:
                fields += self._parted(start, i)
                start = i + 1
        if text[start:].strip():
            fields += self._parted(start, len(text))
        return fields

    def _simple(self, position: int) -> list[Field]:
        """The minor words of a statement without brackets and quotes."""
        fields: list[Field] = []
        begin, where = self.begin, self.where
        pieces = self.text[position:].split(b",")
        last = len(pieces) - 1
        for k, piece in enumerate(pieces):
            inner = piece.strip()
            size = len(piece)
            if not inner and k == last:
                break
            if not inner or b" " in inner or b"\t" in inner:
                fields += self._parted(position, position + size)
            else:
                start = position + piece.index(inner)
                stop = start + len(inner) - 1
                if where is None:
                    fields.append(Field(inner.upper(), begin + start, begin + stop + 1))
                else:
                    fields.append(Field(inner.upper(), where[start], where[stop] + 1))
            position += size + 1
        return fields

    def _parted(self, a: int, b: int) -> list[Field]:
        """One minor word, or several numbers with blanks between them."""
        piece = self.text[a:b]
        inner = piece.strip()
        if not inner:
            return [Field(b"", self.place(a) if a < len(self.text) else self.end, self.place(a - 1) + 1)]
        spans = [(m.start() + a, m.end() + a) for m in re.finditer(rb"\S+", piece)]
        if len(spans) > 1 and not all(_NUMBER.match(self.text[s:e]) for s, e in spans):
            spans = [(spans[0][0], spans[-1][1])]
        return [Field(self.text[s:e].upper(), self.place(s), self.place(e - 1) + 1) for s, e in spans]


@dataclass(slots=True, eq=False)
class Chunk:
    """Whole statements of consecutive lines; lines count from 0 in the chunk, bytes from the start of the
    text.

    `point` (m,) are the lines of plain points and `width` (m,) their numbers; `first` (m + 1,) leads to the
    numbers: `mantissa` / 10**`decimals`, `start`, `end`. `others` are the other lines that are not blank.
    """

    data: bytes
    first_line: int
    line_start: Index
    line_end: Index
    point: Index
    width: Index
    first: Index
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    pointed: Mask
    start: Index
    end: Index
    others: Index

    def raw(self, line: int) -> bytes:
        """The bytes of a line, without its end."""
        return self.data[int(self.line_start[line]) : int(self.line_end[line])]

    def statements(
        self, free: re.Pattern[bytes], goes_on: Callable[[bytes], bool] | None = None
    ) -> Iterator[Statement | Comment]:
        """The statements and comments of the lines that are not plain points, in order. What begins as
        `free` says takes the rest of its line as text. A comment that ends with `$` has the next line too,
        where `goes_on` says so of it. Raises ProgramError for a `$` inside a statement."""
        lines = self.others.tolist()
        taken = -1
        for line in lines:
            if line <= taken:
                continue
            raw = self.raw(line)
            bare = raw.lstrip()
            number = self.first_line + line + 1
            begin = int(self.line_start[line])
            if bare[:2] == b"$$":
                taken = line if goes_on is None else self._commented(line, goes_on)
                end = int(self.line_end[taken])
                yield Comment(number, begin, end, self.data[begin:end])
            elif b"$" not in raw or free.match(bare):
                taken = line
                yield Statement(number, begin, begin + len(raw), raw)
            else:
                statement = self._joined(line)
                taken = line + statement.lines - 1
                yield statement

    def _commented(self, line: int, goes_on: Callable[[bytes], bool]) -> int:
        """The last line of a comment."""
        while (
            self.raw(line).rstrip()[-1:] == b"$"
            and line + 1 < len(self.line_start)
            and goes_on(self.raw(line + 1))
        ):
            line += 1
        return line

    def _joined(self, line: int) -> Statement:
        """A statement with its comment cut off and its further lines joined on."""
        text, where = bytearray(), list[int]()
        number = self.first_line + line + 1
        last = line
        while True:
            raw = self.raw(last)
            start = int(self.line_start[last])
            code = raw[: _comment_at(raw)]
            mark = _CONTINUED.search(code) if len(code) == len(raw) else None
            code = code[: mark.start()] if mark else code
            if b"$" in _QUOTED.sub(b"", code):
                raise ProgramError(
                    "a `$` is inside a statement; expected it at the end of a line that goes on, "
                    "or twice before a comment",
                    line=number + last - line,
                    code="OLP510",
                )
            text += code
            where += range(start, start + len(code))
            if mark is None:
                break
            if last + 1 >= len(self.line_start):
                raise ProgramError(
                    "the last line ends with `$`, so it should go on; remove the `$`",
                    line=number + last - line,
                    code="OLP510",
                )
            last += 1
        end = int(self.line_end[last])
        return Statement(
            number, int(self.line_start[line]), end, bytes(text), where or None, lines=last - line + 1
        )


@dataclass(frozen=True, slots=True)
class Comment:
    """A line that is a comment from its `$$` on, and the lines that go on with it."""

    line: int
    begin: int
    end: int
    text: bytes


def _comment_at(raw: bytes) -> int:
    """Where the comment of a line opens, outside quotes; its length where there is none."""
    start = raw.find(b"$$")
    if start < 0:
        return len(raw)
    masked = _QUOTED.sub(lambda m: b"'" * len(m[0]), raw)
    start = masked.find(b"$$")
    return start if start >= 0 else len(raw)


def is_cards(data: bytes) -> bool:
    """Whether a text is made of cards: lines of 80 columns, the last eight of which are their numbers."""
    head = [line.rstrip(b"\r") for line in data[: 1 << 13].split(b"\n")[:40]]
    lines = [line for line in head[:-1] if line.strip()]
    if len(lines) < 3 or any(len(line) != 80 for line in lines):
        return False
    numbers = [line[72:] for line in lines if line[72:].strip()]
    return len(numbers) > 1 and all(_SEQUENCE.match(number) for number in numbers)


def chunks(data: bytes, size: int = CHUNK, tell: Progress = silent) -> Iterator[Chunk]:
    """Lex a whole text, chunk by chunk, each ending at the end of a statement. The numbers of cards are
    read as blanks. Raises ProgramError for a text of two bytes per character."""
    if is_cards(data):
        data = _CARD.sub(rb"\1        ", data)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise ProgramError(
            "the text is UTF-16; expected one byte per character; save it as plain text",
            line=1,
            code="OLP502",
        )
    if data[:3] == b"\xef\xbb\xbf":
        # the lexer reads a byte order mark as blanks; it stays in the text
        data = b"   " + data[3:]
    if b"\r" in data and data.count(b"\r") != data.count(b"\r\n"):
        data = LONE_CR.sub(b"\n", data)
    text = np.frombuffer(data, np.uint8)
    begin = line = 0
    while begin < len(data):
        cut = len(data)
        if begin + size < len(data):
            newline = data.find(b"\n", begin + size)
            while newline >= 0 and data[max(newline - 200, begin) : newline].rstrip()[-1:] == b"$":
                newline = data.find(b"\n", newline + 1)
            cut = newline + 1 if newline >= 0 else cut
        chunk = _lex(data, text[begin:cut], begin, line)
        line += len(chunk.line_start)
        begin = cut
        yield chunk
        tell("read", cut / len(data))


def _lex(data: bytes, text: Bytes, offset: int, first_line: int) -> Chunk:
    size = len(text)
    newline = np.flatnonzero(text == 10)
    ends = newline if newline.size and newline[-1] == size - 1 else np.append(newline, size)
    starts = np.empty(len(ends), np.int64)
    starts[0] = 0
    starts[1:] = ends[:-1] + 1
    content = without_cr(text, starts, ends)

    printed = np.flatnonzero(text > 32)
    leading = np.append(printed, size)[np.searchsorted(printed, starts)]
    blank = leading >= ends
    hot, slash = _plain(text, starts, ends, leading)
    # the numbers of plain points, all else blank
    keep = np.zeros(size, bool)
    spans = np.zeros(2 * len(starts) + 1, np.int64)
    flags = np.zeros(2 * len(starts) + 1, bool)
    flags[1::2] = hot
    begin_of = np.where(hot, slash + 1, starts)
    spans[0] = begin_of[0]
    spans[1::2] = ends - begin_of
    spans[2:-1:2] = begin_of[1:] - ends[:-1]
    spans[-1] = size - ends[-1]
    keep = np.repeat(flags, spans)
    commas = np.flatnonzero((text == 44) & keep)
    keep &= (text > 32) & (text != 44)
    compact, begin, stop = runs(blanked(text, keep))
    mantissa, decimals, pointed, malformed = numbers(compact, compact[8 : len(compact) - 8], begin, stop)
    first = np.searchsorted(begin, np.append(starts, size))
    width = np.diff(first)
    good = hot & ((width == 3) | (width == _WIDEST))
    good[np.searchsorted(starts, begin[malformed], "right") - 1] = False
    # one comma or none between two numbers, none before the first
    before = np.searchsorted(commas, begin)
    gap = np.diff(before, prepend=0)
    opening = np.zeros(len(begin), bool)
    opening[first[:-1][width > 0]] = True
    line_of = np.searchsorted(starts, begin, "right") - 1
    at_slash = np.searchsorted(commas, begin_of)
    wrong = np.where(opening, before - at_slash[line_of] > 0, gap > 1)
    good[line_of[wrong]] = False
    after = np.searchsorted(commas, ends) - np.append(before, 0)[np.minimum(first[1:] - 1, len(before))]
    good &= after <= 1
    chosen = good[line_of]
    point = np.flatnonzero(good)
    return Chunk(
        data=data,
        first_line=first_line,
        line_start=starts + offset,
        line_end=content + offset,
        point=point,
        width=width[point],
        first=np.concatenate(([0], np.cumsum(width[point]))),
        mantissa=mantissa[chosen],
        decimals=decimals[chosen],
        pointed=pointed[chosen],
        start=begin[chosen] + offset,
        end=stop[chosen] + offset,
        others=np.flatnonzero(~good & ~blank),
    )


def _plain(text: Bytes, starts: Index, ends: Index, leading: Index) -> tuple[Mask, Index]:
    """Lines that may be `GOTO/` with numbers and nothing else, by their characters; where their slash is. A
    line after one that ends with `$` is none."""
    lines = len(starts)
    size = len(text)
    upper = text & np.uint8(0xDF)
    letter = (upper >= 65) & (upper <= 90)
    letters = np.flatnonzero(letter)
    where = np.searchsorted(letters, starts)
    count = np.searchsorted(letters, ends) - where
    padded = np.concatenate((text, np.zeros(8, np.uint8)))
    hot = count == 4
    for i, byte in enumerate(b"GOTO"):
        hot &= (padded[np.minimum(leading + i, size)] & 0xDF) == byte
    slashes = np.flatnonzero(text == 47)
    rank = np.searchsorted(slashes, starts)
    hot &= np.searchsorted(slashes, ends) - rank == 1
    slash = np.append(slashes, size)[rank]
    # nothing but blanks between the word and its slash
    printed = np.cumsum(text > 32)
    inside = np.minimum(slash, size - 1)
    hot &= printed[inside] - printed[np.minimum(leading, size - 1)] == 4
    blank = (text == 32) | (text == 9) | (text == 10) | (text == 13)
    odd = np.flatnonzero(((text < 43) & ~blank) | ((text > 57) & ~letter))
    hot &= np.searchsorted(odd, starts) == np.searchsorted(odd, ends)
    dollars = np.flatnonzero(text == 36)
    if dollars.size:
        goes_on = np.searchsorted(starts, dollars, "right") - 1
        goes_on = goes_on[goes_on + 1 < lines]
        hot[goes_on + 1] = False
    return hot, slash
