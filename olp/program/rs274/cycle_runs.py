"""Runs of blocks of canned cycles, which are carried out at once: where they are, and what they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.rs274.codes import ABSOLUTE, CYCLES, INCREMENTAL, PLANE_OF
from olp.program.rs274.lexer import WordChunk
from olp.program.rs274.modes import Context
from olp.program.rs274.motion import Blocks
from olp.program.rs274.state import NAN

_READ = "XYZRQPLKI"
#: The row behind a run, and the row behind the last of the runs that can be carried out together with it.
Ends = tuple[int, int]
#: Words of a further axis.
_OTHERS = np.frombuffer(b"ABCUVW", np.uint8)
#: Plane code of the plane across Z.
_XY = 170
#: Whether a motion code is that of a cycle; the last entry is for "none yet".
_CYCLES = np.zeros(1001, bool)
_CYCLES[list(CYCLES)] = True


@dataclass(frozen=True, slots=True, eq=False)
class CycleWords:
    """The words of blocks of canned cycles (n,) on lines of a chunk. `slot` leads from a letter to the
    indices (n,) of its words, -1 where omitted. `other` (n,) is the least letter of a further axis that a
    block moves, 0 where none. `stated` are numbers (n,) that were asked for, with the numbers of the chunk
    that they were taken from."""

    line: Index
    slot: dict[str, Index]
    other: npt.NDArray[np.uint8]
    stated: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @staticmethod
    def of(chunk: WordChunk, line: Index) -> CycleWords:
        count = chunk.first_word[line + 1] - chunk.first_word[line]
        first = np.append(0, np.cumsum(count))
        owner = np.repeat(np.arange(len(line)), count)
        word = np.arange(len(owner)) + (chunk.first_word[line] - first[:-1])[owner]
        letter, slot = chunk.letter[word], {}
        for name in _READ:
            mine = np.flatnonzero(letter == ord(name))
            slot[name] = np.full(len(line), -1, np.int64)
            slot[name][owner[mine]] = word[mine]
        other = np.zeros(len(line), np.uint8)
        further = np.flatnonzero(is_in(letter, _OTHERS))
        other[owner[further]] = 255
        np.minimum.at(other, owner[further], letter[further])
        return CycleWords(line, slot, other)

    def numbers(self, letter: str, value: Array) -> Array:
        """(n,) the number of a word in each block, of the numbers `value` of the chunk; NaN where it has
        none."""
        known = self.stated.get(letter)
        if known is None or known[0] is not value:
            slot = self.slot[letter]
            known = self.stated[letter] = (value, np.where(slot >= 0, value[slot], NAN))
        return known[1]


_NO_WORDS = CycleWords(np.zeros(0, np.int64), {}, np.zeros(0, np.uint8))


def runs(context: Context, blocks: Blocks, special: Mask) -> tuple[dict[int, Ends], CycleWords]:
    """The runs of blocks of canned cycles that are carried out at once, by the first row of each among the
    blocks of the chunk; the words of all come with them. A run has no event, and no change of cycle, plane or
    distance mode. Where that mode has changed within a series, or may have, one begins where a block states
    both levels and the block before does not. None goes on with another across `special` lines (of the
    chunk,)."""
    row = np.flatnonzero(_CYCLES[context.motion[blocks.line]])
    line = blocks.line[row]
    if not row.size:
        return {}, _NO_WORDS
    words = CycleWords.of(context.chunk, line)
    ended = np.cumsum(~_CYCLES[context.motion])
    breaks = np.cumsum(context.event) + ended
    same = (breaks[line[1:]] == breaks[line[:-1]]) & ~context.event[line[:-1]]
    for mode in (context.motion, context.plane, context.distance):
        same &= mode[line[1:]] == mode[line[:-1]]
    # levels of G90 and G91 may be in force side by side until a block states both
    level = words.slot["R"] >= 0
    for code, plane in PLANE_OF.items():
        level &= (context.plane[line] != code) | (words.slot["XYZ"[PLANES[plane][2]]] >= 0)
    turns = np.cumsum(np.diff(context.distance[line], prepend=0) != 0)
    begin = np.maximum.accumulate(np.where(np.diff(ended[line], prepend=0) > 0, np.arange(len(line)), 0))
    turned = (turns != turns[begin]) | (begin == 0)
    same &= ~(level & turned)[1:] | level[:-1]
    cuts = np.flatnonzero(~same)
    first, last = row[np.append(0, cuts + 1)], row[np.append(cuts, len(row) - 1)]
    final = np.append(
        np.flatnonzero(~_joined(context, blocks, special, last[:-1], first[1:])), len(first) - 1
    )
    together = last[final[final.searchsorted(np.arange(len(first)))]]
    ends = zip((last + 1).tolist(), (together + 1).tolist(), strict=True)
    return dict(zip(first.tolist(), ends, strict=True)), words


def _joined(context: Context, blocks: Blocks, special: Mask, last: Index, following: Index) -> Mask:
    """(n,) whether only straight moves in G17 and G90 are between the `last` rows of runs and the first of
    the `following`. The first of them states Z: then what the next series begins at depends on no hole."""
    line = blocks.line
    flat = (context.distance[line] == ABSOLUTE) & (context.plane[line] == _XY)
    straight = flat & is_in(context.motion[line], (0, 10))
    other, breaks = np.cumsum(~straight), np.cumsum(special)
    calm = (other[following] - other[last] == 1) & (breaks[line[following]] == breaks[line[last]])
    rises = straight[last + 1] & (blocks.slot[last + 1, 2] >= 0)
    return np.asarray(calm & rises & flat[last] & flat[following] & ~special[line[last]])


@dataclass(frozen=True, slots=True, eq=False)
class CycleRun:
    """Runs that are carried out together: blocks (n,) on lines of a chunk in the same plane and distance
    mode, `some` of those of the `words`. `slot` leads from a letter to the indices (n,) of its words, -1
    where omitted. `row` (n,) is where they are among the rows of the runs, `straight` (m,) where the moves
    between these are. `first` (k,) is the first block of each run, `series` (n,) the run of each block."""

    line: Index
    row: Index
    straight: Index
    first: Index
    series: Index
    code: Index
    plane: int
    incremental: bool
    value: Array
    slot: dict[str, Index]
    words: CycleWords
    some: slice

    @staticmethod
    def of(context: Context, words: CycleWords, lines: Index, value: Array) -> CycleRun:
        """The runs on the lines of these rows, of which some of the words are."""
        holes = _CYCLES[context.motion[lines]]
        row = np.flatnonzero(holes)
        line = lines[row]
        a = int(words.line.searchsorted(line[0]))
        some = slice(a, a + len(line))
        begins = np.diff(row, prepend=-2) > 1
        return CycleRun(
            line, row, np.flatnonzero(~holes), np.flatnonzero(begins), np.cumsum(begins) - 1,
            context.motion[line].astype(np.int64), PLANE_OF[int(context.plane[line[0]])],
            bool(context.distance[line[0]] == INCREMENTAL), value,
            {name: slot[some] for name, slot in words.slot.items()}, words, some,
        )  # fmt: skip

    def name(self, block: int) -> str:
        return f"the cycle G{self.code[block] / 10:g}"

    def number(self, letter: str) -> Array:
        """(n,) the number of a word in each block, NaN where it has none."""
        return self.words.numbers(letter, self.value)[self.some]

    @property
    def other(self) -> npt.NDArray[np.uint8]:
        """(n,) the least letter of a further axis that a block moves, 0 where none."""
        return self.words.other[self.some]


class Refused:
    """The first of the blocks that is refused, and why: `row`, all of them where none is."""

    def __init__(self, context: Context, line: Index) -> None:
        self._context, self._line = context, line
        self.row = len(line)
        self._error: ProgramError | None = None

    def where(self, bad: Mask, why: str | Callable[[int], ProgramError], code: str = "") -> None:
        """Refuse blocks (n,) that are `bad`, unless one before them is refused."""
        bad = bad[: self.row]
        if bad.any():
            self.row = int(bad.argmax())
            self._error = ProgramError(why, code=code) if isinstance(why, str) else why(self.row)

    def all(self, why: str, code: str) -> None:
        """Refuse the first block."""
        self.where(np.ones(self.row, bool), why, code)

    def raise_first(self) -> None:
        if self._error is not None:
            number = self._context.number(int(self._line[self.row]))
            raise ProgramError(self._error.message, line=number, code=self._error.code)
