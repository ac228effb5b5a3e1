"""The texts of both programs side by side, by the line numbers of their files.

A row pairs a line with its partner in the corrected program; an inserted block has a separate row. Lines end
where the reader of programs ends them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import SequenceMatcher

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.text.line_ends import LINE_END_TEXT
from olp.review.samples import Samples

Small = npt.NDArray[np.int32]

#: Most lines between two moves that are compared one with another.
_MOST_COMPARED = 500
#: Most characters of a line; a longer one is cut, as browsers are slow with it.
LONGEST = 2000
#: Bytes of a text that are looked at at once.
_BAND = 1 << 20

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
    """The nominal text as it was `read`, and the `corrected` one as it is shown; (r,) `row_nominal` and
    `row_corrected`, line numbers counted from 1, 0 where a row has no such line. For each line of the texts,
    `sample_nominal` and `sample_corrected`, the last sample of its moves, or else that of the line before."""

    read: bytes
    corrected: str
    row_nominal: Small
    row_corrected: Small
    sample_nominal: Small
    sample_corrected: Small

    @property
    def nominal(self) -> str:
        """The nominal text as it is shown. It is not kept, as long texts are large."""
        return shown(self.read)

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
    # the end of the last line begins no further line
    if _is_plain(data):
        text = str(memoryview(data)[: len(data) - data.endswith(b"\n")], "ascii")
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
        text = pictured(LINE_END_TEXT.sub("\n", text) if "\r" in text else text).removesuffix("\n")
    if _longest(data) > LONGEST:
        text = _LONG.sub(lambda m: f"{m[0][:LONGEST]} … ({len(m[0])} characters)", text)
    return text


def _is_plain(data: bytes) -> bool:
    """Whether a text is ASCII without control characters other than tab and line feed."""
    bare = (some.translate(None, _CONTROL_BYTES) for some in _bands(data))
    return data.isascii() and sum(map(len, bare)) == len(data)


def _bands(data: bytes) -> Iterator[bytes]:
    """Some bytes at a time, so that a long text is not there twice."""
    return (data[a : a + _BAND] for a in range(0, len(data), _BAND))


def pictured(text: str) -> str:
    """A text with its control characters as their pictures."""
    return _CONTROL.sub(_picture, text)


def _longest(data: bytes) -> int:
    """Bytes of the longest line: a line has no more characters than bytes."""
    longest, begin, last = 0, 0, -1
    for some in _bands(data):
        feeds = np.flatnonzero(np.frombuffer(some, np.uint8) == _LINE_FEED) + begin
        longest = max(longest, int(np.diff(feeds, prepend=last).max(initial=0)))
        begin, last = begin + len(some), int(feeds[-1]) if len(feeds) else last
    return max(longest, len(data) - last)


def _picture(match: re.Match[str]) -> str:
    code = ord(match[0])
    return chr(0x2400 + code) if code < 0x20 else "␡" if code == 0x7F else "�"


def aligned(nominal: Program, corrected: Program, groups: Index, samples: Samples) -> Listing:
    """Both texts, their lines paired: by the moves that they make, and between those by their text."""
    rows = _pairs(nominal, corrected, *_anchors(nominal, corrected, groups))
    last = _last(nominal, nominal.toolpath.line[samples.move])
    last_corrected = _last(corrected, corrected.toolpath.line[samples.part])
    return Listing(whole(nominal.data), shown(whole(corrected.data)), *rows, last, last_corrected)


def _last(program: Program, line: Small) -> Small:
    """The last sample of each line of a text, or else that of the line before; `line` is that of each sample,
    from 1."""
    count = len(program.line_start)
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


def _pairs(nominal: Program, corrected: Program, mine: Index, theirs: Index) -> tuple[Small, Small]:
    """Rows of line numbers from 1: lines between anchors are paired where both texts have as many."""
    count, other = len(nominal.line_start), len(corrected.line_start)
    begin = np.concatenate(([0], mine + 1))
    begin_other = np.concatenate(([0], theirs + 1))
    gap = np.append(mine, count) - begin
    gap_other = np.append(theirs, other) - begin_other
    inserted: list[int] = []
    left_out: list[int] = []
    for k in np.flatnonzero(gap != gap_other).tolist():
        a, b = int(begin[k]), int(begin_other[k])
        some, more = _lines(nominal, a, int(gap[k])), _lines(corrected, b, int(gap_other[k]))
        mine_alone, theirs_alone = _without_partner(some, more)
        left_out += (a + i for i in mine_alone)
        inserted += (b + i for i in theirs_alone)
    return _woven(count, other, np.array(inserted, np.int64), np.array(left_out, np.int64))


def _lines(program: Program, first: int, count: int) -> list[bytes]:
    """Some lines of a text, the first counted from 0."""
    begin, end = (some[first : first + count].tolist() for some in (program.line_start, program.line_end))
    return [bytes(program.data[a:b]) for a, b in zip(begin, end, strict=True)]


def _without_partner(some: list[bytes], more: list[bytes]) -> tuple[list[int], list[int]]:
    """The lines of either text of a gap without a partner in the other. Equal lines are partners; of the
    others between them the last ones are, as what is inserted comes before the line that it was split
    from."""
    same = 0
    while same < min(len(some), len(more)) and some[same] == more[same]:
        same += 1
    first, second = some[same:], more[same:]
    equal: list[tuple[int, int, int]] = [(len(first), len(second), 0)]
    if first and second and max(len(first), len(second)) <= _MOST_COMPARED:
        blocks = SequenceMatcher(None, first, second, False).get_matching_blocks()
        equal = [(block.a, block.b, block.size) for block in blocks]
    mine: list[int] = []
    theirs: list[int] = []
    a = b = 0
    for begin, begin_other, size in equal:
        gap, other = begin - a, begin_other - b
        both = min(gap, other)
        mine += range(same + a, same + begin - both)
        theirs += range(same + b, same + begin_other - both)
        a, b = begin + size, begin_other + size
    return mine, theirs


def _woven(count: int, other: int, inserted: Index, left_out: Index) -> tuple[Small, Small]:
    """Rows of all lines: one per pair, and one per line without a partner. Before a pair are first the lines
    that were left out since the pair before it, then those that were inserted."""
    paired = np.ones(count, bool)
    paired[left_out] = False
    paired_other = np.ones(other, bool)
    paired_other[inserted] = False
    # how many pairs are before each single line
    before, before_other = left_out - np.arange(len(left_out)), inserted - np.arange(len(inserted))
    pair = np.arange(count - len(left_out))
    row = pair + np.searchsorted(before, pair, "right") + np.searchsorted(before_other, pair, "right")
    line, line_other = np.zeros((2, count + len(inserted)), np.int32)
    line[row] = np.flatnonzero(paired) + 1
    line_other[row] = np.flatnonzero(paired_other) + 1
    line[left_out + np.searchsorted(before_other, before, "left")] = left_out + 1
    line_other[inserted + np.searchsorted(before, before_other, "right")] = inserted + 1
    return line, line_other
