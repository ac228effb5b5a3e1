"""The texts of both programs side by side, by the line numbers of their files.

A row pairs a line with its partner in the corrected program; an inserted block has a separate row. Lines end
where the reader of programs ends them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.program.program import Program
from olp.program.text.line_ends import LINE_END_TEXT
from olp.review.samples import Samples

Small = npt.NDArray[np.int32]

#: Most characters of a line; a longer one is cut, as browsers are slow with it.
LONGEST = 2000

#: Characters that act on a terminal, hide text, or change its direction, except tab and line feed.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]"
)
#: Those of them that are ASCII, and carriage return.
_CONTROL_BYTES = bytes(set(range(0x20)) - set(b"\t\n") | {0x7F})
_LINE_FEED = b"\n"[0]
#: A line that is too long.
_LONG = re.compile(rf"[^\n]{{{LONGEST + 1},}}")


@dataclass(frozen=True, slots=True, eq=False)
class Listing:
    """Texts with the lines of the files, without control characters; (r,) `row_nominal` and `row_corrected`,
    line numbers counted from 1, 0 where a row has no such line. For each line of the texts, `sample_nominal`
    and `sample_corrected`, the last sample of its moves, or else that of the line before."""

    nominal: str
    corrected: str
    row_nominal: Small
    row_corrected: Small
    sample_nominal: Small
    sample_corrected: Small

    def row_of(self, line: Index) -> Index:
        """Rows of lines of the nominal program."""
        have = np.flatnonzero(self.row_nominal)
        return have[np.searchsorted(self.row_nominal[have], line)]

    def row_of_corrected(self, line: Index) -> Index:
        """Rows of lines of the corrected program."""
        have = np.flatnonzero(self.row_corrected)
        return have[np.searchsorted(self.row_corrected[have], line)]


def shown(data: bytes) -> str:
    """The text of a program for display: lines end with a line feed, control characters are replaced by their
    pictures, and long lines are cut. Bytes that are not UTF-8 are read as Latin-1."""
    if data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
    plain = data.isascii() and len(data.translate(None, _CONTROL_BYTES)) == len(data)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if not plain:
        text = pictured(LINE_END_TEXT.sub("\n", text) if "\r" in text else text)
    if _longest(data) > LONGEST:
        text = _LONG.sub(lambda m: f"{m[0][:LONGEST]} … ({len(m[0])} characters)", text)
    # the end of the last line begins no further line
    return text.removesuffix("\n")


def pictured(text: str) -> str:
    """A text with its control characters as their pictures."""
    return _CONTROL.sub(_picture, text)


def _longest(data: bytes) -> int:
    """Bytes of the longest line: a line has no more characters than bytes."""
    feeds = np.flatnonzero(np.frombuffer(data, np.uint8) == _LINE_FEED)
    return int(np.diff(feeds, prepend=-1, append=len(data)).max())


def _picture(match: re.Match[str]) -> str:
    code = ord(match[0])
    return chr(0x2400 + code) if code < 0x20 else "␡" if code == 0x7F else "�"


def aligned(nominal: Program, corrected: Program, groups: Index, samples: Samples) -> Listing:
    """Both texts, their lines paired: by the moves that they make, and between those by their text."""
    first, second = shown(nominal.data), shown(corrected.data)
    mine, theirs = _anchors(nominal, corrected, groups)
    rows = _pairs(first, second, mine, theirs, nominal.lines, corrected.lines)
    last = _last(nominal.toolpath.line[samples.move], first)
    return Listing(first, second, *rows, last, _last(corrected.toolpath.line[samples.part], second))


def _last(line: Small, text: str) -> Small:
    """The last sample of each line of a text, or else that of the line before; `line` is that of each sample,
    from 1."""
    count = text.count("\n") + 1
    last = np.full(count, -1, np.int32)
    last[line - 1] = np.arange(len(line))
    known = np.maximum.accumulate(np.where(last >= 0, np.arange(count), 0))
    return np.asarray(np.maximum(last[known], 0))


def _anchors(nominal: Program, corrected: Program, groups: Index) -> tuple[Index, Index]:
    """Lines, counted from 0, that make the same last move in both texts."""
    path, other = nominal.toolpath, corrected.toolpath
    last = np.flatnonzero(np.diff(path.line, append=-1))
    mine, theirs = path.line[last].astype(np.int64) - 1, other.line[groups[last]].astype(np.int64) - 1
    rising = (mine > np.concatenate(([-1], np.maximum.accumulate(mine)[:-1]))) & (
        theirs > np.concatenate(([-1], np.maximum.accumulate(theirs)[:-1]))
    )
    return mine[rising], theirs[rising]


def _pairs(
    first: str, second: str, mine: Index, theirs: Index, count: int, other: int
) -> tuple[Small, Small]:
    """Rows of line numbers from 1: lines between anchors are paired where both texts have as many."""
    begin = np.concatenate(([0], mine + 1))
    begin_other = np.concatenate(([0], theirs + 1))
    gap = np.append(mine, count) - begin
    gap_other = np.append(theirs, other) - begin_other
    inserted: list[int] = []
    left_out: list[int] = []
    uneven = np.flatnonzero(gap != gap_other).tolist()
    if uneven:
        lines, others = _Cut(first), _Cut(second)
        for k in uneven:
            a, b = int(begin[k]), int(begin_other[k])
            some, more = lines.take(a, int(gap[k])), others.take(b, int(gap_other[k]))
            inserted += (b + i for i in _without_partner(some, more))
            left_out += (a + i for i in _without_partner(more, some))
    return _woven(count, other, np.array(inserted, np.int64), np.array(left_out, np.int64))


class _Cut:
    """A text of which some lines are wanted."""

    def __init__(self, text: str) -> None:
        self.data = text.encode()
        feeds = np.flatnonzero(np.frombuffer(self.data, np.uint8) == _LINE_FEED)
        self.ends = np.append(feeds, len(self.data))

    def take(self, first: int, count: int) -> list[bytes]:
        """Some lines, the first counted from 0."""
        if not count:
            return []
        begin = int(self.ends[first - 1]) + 1 if first else 0
        return self.data[begin : int(self.ends[first + count - 1])].split(b"\n")


def _without_partner(some: list[bytes], more: list[bytes]) -> Iterator[int]:
    """The lines of `more` without a partner: those between the equal ones at the beginning and at the end."""
    spare = len(more) - len(some)
    if spare <= 0:
        return
    same = 0
    while same < len(some) and some[same] == more[same]:
        same += 1
    yield from range(same, same + spare)


def _woven(count: int, other: int, inserted: Index, left_out: Index) -> tuple[Small, Small]:
    """Rows of all lines: one per pair, and one per line without a partner."""
    single = np.zeros(count, bool)
    single[left_out] = True
    single_other = np.zeros(other, bool)
    single_other[inserted] = True
    # the order of rows is that of the pairs before them
    key = np.cumsum(~single) - ~single
    key_other = np.cumsum(~single_other) - ~single_other
    own = np.flatnonzero(single)
    place = np.concatenate((key[~single], key[own], key_other[inserted]))
    kind = np.concatenate(
        (np.full(int((~single).sum()), 2), np.zeros(len(own), int), np.ones(len(inserted), int))
    )
    line = np.concatenate((np.flatnonzero(~single) + 1, own + 1, np.zeros(len(inserted), int)))
    line_other = np.concatenate((np.flatnonzero(~single_other) + 1, np.zeros(len(own), int), inserted + 1))
    order = np.lexsort((kind, place))
    return line[order].astype(np.int32), line_other[order].astype(np.int32)
