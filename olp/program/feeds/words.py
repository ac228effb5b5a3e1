"""Feeds written back into a program: only the numbers of its F words change.

A feed is lowered by a share, so its unit (inches, G93 to G95) needs no conversion. An F word holds for all
blocks until the next one. Where these plan different feeds, the word takes the share with the same total
time, or the least share of them, which a single short block can make very low.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from olp.core.arrays import Array, Index, distinct
from olp.core.errors import CannotCompute, ProgramError
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.program.feeds.moves import lengths_mm, numbers
from olp.program.feeds.stated import feed_words, programmed
from olp.program.program import Program, Words

Shared = Literal["mean", "least"]

#: a feed takes another decimal where rounding would change it by more than this share; it is not changed
#: where the planned feed is within this share of it
_COARSE = 0.01
#: decimals of a written feed at most
_MOST_DECIMALS = 6
#: a line counts as slower than its feed where it is slower by more than this share
_SLOWER = 0.01
#: share by which a feed that is read back may exceed the written one
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class FeedsWritten:
    """A text with other feeds.

    `words` is the number of its F words that are carried out, `changed` how many of them were changed, and
    `shared` how many of these several lines share. `slower` is the number of lines that were planned slower
    than the feed that they have now. `kept` are the lines of words that stay because moves under them are not
    timed.
    """

    data: bytes
    words: int
    changed: int
    shared: int
    slower: int
    kept: tuple[int, ...]


def write_feeds(
    program: Program,
    line: Index,
    planned_s: Array,
    programmed_s: Array,
    *,
    shared: Shared = "mean",
    block_delete: bool = False,
) -> FeedsWritten:
    """The text with the mean planned feed of each block in its F words, where that is below the programmed
    one by more than 1 %.

    `line` (m,) are lines with feed moves, ascending; `planned_s` (m,) is what these moves take, and
    `programmed_s` what they would take at the programmed feed. Raises ProgramError with its line where a
    feed cannot be written in the form of its word.
    """
    words = program.words
    if words is None:
        raise CannotCompute("the program was read without its words, so none can be changed")
    governed = feed_words(program, words, block_delete=block_delete)
    word, word_line, move, owner = governed.word, governed.line, governed.move, governed.owner
    if not len(move):
        return FeedsWritten(whole(program.data), len(word), 0, 0, 0, ())
    of_move = program.toolpath.line[move].astype(np.int64)
    untimed = np.bincount(owner, np.isnan(lengths_mm(program.toolpath)[move]), len(word)) > 0
    place = np.minimum(np.searchsorted(line, of_move), max(len(line) - 1, 0))
    # a line whose moves are too short to be planned does not count
    pair = np.unique(np.stack((owner, place))[:, line[place] == of_move], axis=1) if len(line) else None
    share = np.ones(len(word))
    count = np.zeros(len(word), np.int64)
    if pair is not None:
        owner, place = pair
        count = np.bincount(owner, minlength=len(word))
        if shared == "least":
            np.minimum.at(share, owner, programmed_s[place] / planned_s[place])
        else:
            planned, programmed = (
                np.bincount(owner, seconds[place], len(word)) for seconds in (planned_s, programmed_s)
            )
            share = np.where(
                planned > 0.0, np.minimum(programmed / np.where(planned > 0.0, planned, 1.0), 1.0), 1.0
            )
    kept = np.flatnonzero(untimed)
    share[kept] = 1.0
    slower = 0
    if pair is not None:
        slower = int((programmed_s[place] / planned_s[place] < share[owner] * (1.0 - _SLOWER)).sum())
    parts, begin, changed, several = [], 0, 0, 0
    for k in np.flatnonzero(share < 1.0 - _COARSE).tolist():
        text = _written(program, words, int(word[k]), float(share[k]), int(word_line[k]))
        if text is None:
            continue
        start, end = int(words.number[word[k]]), int(words.end[word[k]])
        parts += [program.data[begin:start], text]
        begin, changed, several = end, changed + 1, several + int(count[k] > 1)
    data = b"".join([*parts, program.data[begin:]])
    return FeedsWritten(data, len(word), changed, several, slower, tuple(distinct(word_line[kept]).tolist()))


def _written(program: Program, words: Words, word: int, share: float, line: int) -> bytes | None:
    """The number of an F word times a share, in the form of the word; None where rounding gives the old
    one."""
    old = program.data[int(words.number[word]) : int(words.end[word])].replace(b" ", b"").replace(b"\t", b"")
    decimals = int(words.decimals[word])
    value = float(numbers(words, np.array([word]))[0])
    wanted = value * share
    # without a point a number is an integer, and has to remain one where a point changes its meaning
    free = bool(words.pointed[word]) or program.calculator
    while free and decimals < _MOST_DECIMALS and abs(round(wanted, decimals) - wanted) > _COARSE * wanted:
        decimals += 1
    new = min(round(wanted, decimals), value)
    if new == value:
        return None
    if not new > 0.0:
        raise ProgramError(
            f"the planned feed {wanted:g} cannot be written in the form of F{value:g}; "
            "give that word a decimal point",
            line=line,
            code="OLP561",
        )
    text = f"{new:.{decimals}f}"
    if decimals == 0 and old.endswith(b"."):
        text += "."
    digits = old.lstrip(b"+").partition(b".")[0]
    if not digits and text.startswith("0."):
        text = text[1:]
    elif digits.startswith(b"0") and len(digits) > 1:
        text = text.zfill(len(text) + len(digits) - len(text.partition(".")[0]))
    return (b"+" if old.startswith(b"+") else b"") + text.encode()


def check_feeds(before: Program, after: Program, *, block_delete: bool = False) -> None:
    """Raise CannotCompute unless two programs make the same moves, the second at feeds not above those of
    the first."""
    here, there = before.toolpath, after.toolpath
    same = (
        np.array_equal(here.end_mm, there.end_mm, equal_nan=True)
        and np.array_equal(here.kind, there.kind)
        and np.array_equal(here.line, there.line)
    )
    if same and before.words is not None and after.words is not None:
        first, second = (programmed(p, block_delete=block_delete) for p in (before, after))
        # NaN, a feed that is not known, has to remain NaN
        same = bool(((second <= first * (1.0 + _ROUNDING)) | (np.isnan(first) & np.isnan(second))).all())
    if not same:
        raise CannotCompute(
            "the text with the planned feeds is not read back as the same moves; it is not written"
        )
