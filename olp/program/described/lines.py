"""The lines of a text in a described language: statements with their positions, and lines that are similar.

Lines are similar where they differ in the digits of their numbers only. What the first of them states, the
others state with other numbers. So a program of many moves is matched with its forms once per kind of line.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.values import dataclass
from olp.program.described.forms import NUMBERS
from olp.program.described.language import Rule, UserDialect
from olp.program.rs274.lexer import Bytes, numbers, runs
from olp.program.text.line_ends import split
from olp.program.text.numbers import LONGEST

#: Bytes of a number without a sign.
_DIGITS = b"0123456789."
#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
#: a mantissa below this is exact as a double
_MOST = 10**15
_PRIMES = np.array([3, 1_000_003, 998_244_353, 2_147_483_647, 4_294_967_291, 67_280_421_310_721], np.uint64)


@dataclass(frozen=True, slots=True)
class Line:
    """A statement: its first line from 1, its text without comment, and where each of its lines begins: in
    the text, and in the bytes."""

    number: int
    text: str
    starts: tuple[tuple[int, int], ...]
    begin: int
    end: int

    def place(self, index: int) -> int:
        for first, start in reversed(self.starts):
            if index >= first:
                return start + index - first
        return self.begin


class Text:
    """The lines of a text, and the numbers of each, as columns.

    (n,) `start`, `end` of lines without their ends; (m,) `first`..`last` bytes of numbers with their
    `mantissa` and `decimals`. `offset` (m,) is where each number is in its line without digits. `token`
    (n + 1,) leads from line to numbers. (n,) `plain`: each number of the line was read as one.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.start, self.end = _lines(data)
        text = np.frombuffer(data, np.uint8)
        self.first, self.last, self.mantissa, self.decimals, good = _tokens(text)
        self.token = np.searchsorted(self.first, np.append(self.start, len(text)))
        owner = np.repeat(np.arange(len(self.start)), np.diff(self.token))
        deleted = ((text >= 48) & (text <= 57)) | (text == 46)
        gone = np.concatenate((np.zeros(1, np.int32), np.cumsum(deleted, dtype=np.int32)))
        self.offset = self.first - self.start[owner] - (gone[self.first] - gone[self.start[owner]])
        bad = np.bincount(owner[~good], minlength=len(self.start))
        self.count: list[int] = np.diff(self.token).tolist()
        self.plain: list[bool] = (bad == 0).tolist()
        # one value for the positions of all numbers of a line
        rank = np.arange(len(owner)) - self.token[owner]
        mixed = (self.offset.astype(np.uint64) + np.uint64(1)) * _PRIMES[rank % len(_PRIMES)]
        total = np.concatenate((np.zeros(1, np.uint64), np.cumsum(mixed, dtype=np.uint64)))
        self.places: list[int] = (total[self.token[1:]] - total[self.token[:-1]]).tolist()
        self.keys = self._keys()

    def _keys(self) -> list[bytes]:
        """Each line without the digits of its numbers."""
        data = self.data
        if b"\r" not in data and data[:3] != b"\xef\xbb\xbf":
            return data.translate(None, _DIGITS).split(b"\n")[: len(self.start)]
        bounds = zip(self.start.tolist(), self.end.tolist(), strict=True)
        return [data[a:b].translate(None, _DIGITS) for a, b in bounds]

    @property
    def value(self) -> npt.NDArray[np.float64]:
        """(m,) the numbers."""
        return np.asarray(self.mantissa / _POW10[self.decimals], float)

    def statement(self, line: int, dialect: UserDialect) -> tuple[Line | None, int]:
        """The statement that begins in a line, None for none, and the line after it."""
        text, starts, first = "", [], line
        while line < len(self.keys):
            start, end = int(self.start[line]), int(self.end[line])
            code = _without_comment(self.data[start:end].decode("latin-1"), dialect)
            kept = code.rstrip()
            goes_on = bool(dialect.continuation) and kept.endswith(dialect.continuation)
            starts.append((len(text), start))
            text += kept[: -len(dialect.continuation)] + " " if goes_on else code
            line += 1
            if not goes_on:
                break
        begin, stop = int(self.start[first]), int(self.end[line - 1])
        return (Line(first + 1, text, tuple(starts), begin, stop) if text.strip() else None), line


@dataclass(frozen=True, slots=True)
class SameForm:
    """A line that states its move in numbers: which of its numbers (from 0) are X, Y and Z, the orientation,
    the speed (-1: none); `label` is how many of them its label has. The statement begins `gap` bytes after
    the last of these, or that far into the line, and ends `rest` bytes after its last number."""

    rule: Rule
    count: int
    places: int
    offset: tuple[int, ...]
    xyz: tuple[int, int, int]
    turn: tuple[int, ...]
    speed: int
    label: int
    gap: int
    rest: int


def same_form_of(text: Text, line: Line, bare: Line, rule: Rule, match: re.Match[str]) -> SameForm | None:
    """What the lines that are similar to this one state; None where more than the numbers of named fields
    could differ."""
    if (
        len(line.starts) > 1
        or rule.does not in ("line", "rapid")
        or rule.incremental
        or rule.enters is not None
    ):
        return None
    index = line.number - 1
    if not text.plain[index]:
        return None
    tokens = range(int(text.token[index]), int(text.token[index + 1]))
    spans = {
        (line.begin + match.start(name), line.begin + match.end(name)): name
        for name, value in match.groupdict().items()
        if value is not None
    }
    if not all(name in NUMBERS for name in spans.values()):
        return None
    names: dict[str, int] = {}
    label = 0
    for k, token in enumerate(tokens):
        span = (int(text.first[token]), int(text.last[token]))
        if span in spans:
            names[spans[span]] = k
        elif span[1] <= bare.begin and k == label:
            label += 1
        else:
            return None
    if len(names) != len(spans) or not {"x", "y", "z"} <= names.keys():
        return None
    before = int(text.last[tokens[label - 1]]) if label else line.begin
    return SameForm(
        rule=rule, count=len(tokens), places=text.places[index],
        offset=tuple(text.offset[tokens.start : tokens.stop].tolist()),
        xyz=(names["x"], names["y"], names["z"]), turn=tuple(names[a] for a in "abc" if a in names),
        speed=names.get("speed", -1), label=label, gap=bare.begin - before,
        rest=bare.end - int(text.last[tokens[-1]]),
    )  # fmt: skip


def _tokens(text: Bytes) -> tuple[Index, Index, Index, npt.NDArray[np.int8], Mask]:
    """First and last byte, mantissa and decimals of the numbers of a text, and whether each is one."""
    # the lexer counts these two as characters of numbers; here they separate numbers
    parted = np.where((text == 44) | (text == 47), np.uint8(32), text)
    compact, begin, end = runs(parted)
    sign = (text == 43) | (text == 45)
    has_digit = _within((text >= 48) & (text <= 57), begin, end) > 0
    begin, end = begin[has_digit], end[has_digit]
    good = (_within(text == 46, begin, end) <= 1) & (_within(sign, begin, end) <= sign[begin])
    good &= end - begin <= LONGEST
    # malformed numbers, as in a comment, are left out: one of them would make the lexer read all singly
    step = np.zeros(len(text) + 1, np.int8)
    step[begin[good]] += 1
    step[end[good]] -= 1
    keep = np.cumsum(step[:-1], dtype=np.int8).astype(bool)
    compact, first, last = runs(np.where(keep, text, np.uint8(32)))
    number, places, _, malformed = numbers(compact, compact[8 : len(compact) - 8], first, last)
    mantissa, decimals = np.zeros(len(begin), np.int64), np.zeros(len(begin), np.int8)
    mantissa[good], decimals[good] = number, places
    fine = np.abs(number) < _MOST
    fine[malformed] = False
    good[good] = fine
    return begin, end, mantissa, decimals, good


def _within(what: Mask, begin: Index, end: Index) -> Index:
    """(n,) how many bytes from `begin` up to `end` are set; the stretches do not overlap, and none is
    empty."""
    if not len(begin):
        return np.zeros(0, np.int64)
    edges = np.column_stack((begin, end)).ravel()
    # a last stretch that ends with the text has no bytes after it
    padded = np.append(what.view(np.uint8), np.uint8(0))
    return np.asarray(np.add.reduceat(padded, edges, dtype=np.int32)[::2], np.int64)


def _lines(data: bytes) -> tuple[Index, Index]:
    """(n,) where each line begins and where its text ends."""
    head = 3 if data[:3] == b"\xef\xbb\xbf" else 0
    if b"\r" not in data:
        newline = np.flatnonzero(np.frombuffer(data, np.uint8) == 10)
        rest = not len(newline) or newline[-1] < len(data) - 1
        end = np.append(newline, len(data)) if rest and len(data) > head else newline
        return np.concatenate(([head], end[:-1] + 1))[: len(end)], end
    rows = split(data[head:])
    size = np.array([len(r) for r in rows], np.int64)
    start = head + np.cumsum(size) - size
    return start, start + np.array([len(r.rstrip(b"\r\n")) for r in rows], np.int64)


def _without_comment(body: str, dialect: UserDialect) -> str:
    first = min((p for mark in dialect.comments if (p := body.find(mark)) >= 0), default=-1)
    if first < 0 or not dialect.quote or dialect.quote not in body[:first]:
        return body if first < 0 else body[:first]
    quoted = False
    for i, letter in enumerate(body):
        if letter == dialect.quote:
            quoted = not quoted
        elif not quoted and any(body.startswith(mark, i) for mark in dialect.comments):
            return body[:i]
    return body
