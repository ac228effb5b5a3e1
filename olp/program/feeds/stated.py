"""The feed of each move and the word that states it, in any dialect."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError, UsageError
from olp.core.toolpath import Flag, Kind
from olp.core.values import dataclass
from olp.program.feeds.moves import Scan, feeds, governing
from olp.program.program import Program, Statements, Words


@dataclass(frozen=True, slots=True, eq=False)
class FeedWords:
    """The (k,) `word`s that state feeds and their `line`s; of the m feed moves that one of them governs, the
    `move` and the index of its word, `owner`."""

    word: Index
    line: Index
    move: Index
    owner: Index


def feed_words(program: Program, words: Words, *, block_delete: bool) -> FeedWords:
    """Which word governs which move. Raises ProgramError for a feed move without a feed."""
    if program.statements is None:
        scan = Scan.of(program, words, block_delete=block_delete)
        word, line = scan.of_letter(b"F")
        return FeedWords(word, line, *governing(scan))
    _stated(program, program.statements)
    stated = program.statements.feeds
    move = np.flatnonzero(program.toolpath.kind != Kind.RAPID)
    latest = np.searchsorted(stated.move, move, "right") - 1
    own = stated.word[latest] >= 0
    # a word may hold again after a cycle, which has its own feed
    word, first, which = np.unique(stated.word, return_index=True, return_inverse=True)
    none = int((word < 0).any())
    return FeedWords(word[none:], stated.line[first[none:]], move[own], which.reshape(-1)[latest[own]] - none)


def programmed(program: Program, *, block_delete: bool = False) -> Array:
    """(n,) feed of each move in mm/s: inf for rapids, NaN for moves that the control makes by itself and
    where it is not known. Raises ProgramError for a feed move without a feed, UsageError for a program read
    without words."""
    if program.statements is not None:
        return _stated(program, program.statements)
    if program.words is None:
        raise UsageError("the program was read without its words; feeds need them")
    return feeds(Scan.of(program, program.words, block_delete=block_delete))


def _stated(program: Program, statements: Statements) -> Array:
    path, feed = program.toolpath, statements.feed_mm_s
    free = np.uint8(Flag.CONTROL | Flag.CYCLE)
    lacking = (path.kind == Kind.LINE) | (path.kind == Kind.ARC_CW) | (path.kind == Kind.ARC_CCW)
    lacking &= ((path.flag & free) == 0) & ~(feed > 0)
    if lacking.any():
        raise ProgramError(
            "a feed move has no feed that is a speed; give one in a unit of speed before it, "
            "or one per turn and the turns of the spindle",
            line=int(path.line[np.flatnonzero(lacking)[0]]),
            code="OLP551",
        )
    return feed
