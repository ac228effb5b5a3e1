"""A chunk of a Heidenhain program while it is read: motion rows, poles and feeds in columns, and which lines
are carried out one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct, is_in
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.heidenhain.columns import DIRECTION, NORMAL, PARAMETER_FEED, SIDE, TURN, Block, Blocks
from olp.program.program import AS_BEFORE
from olp.program.rs274.motion import Blocks as Rows
from olp.program.rs274.motion import gather

#: M functions that move no axis: of the control, and those that builders give to coolant, clamps and chips
_HARMLESS = (
    {0, 1, 3, 4, 5, 7, 8, 9, 90, 94, 97, 98, 101, 102, 103, 105, 106, 107, 108, 109, 110, 111, 115, 116, 117}
    | {118, 120, 124, 126, 127, 129, 134, 135, 137, 138, 141, 143, 144, 145, 148, 149, 150}
    | set(range(10, 30)) | set(range(31, 60))
)  # fmt: skip
#: M functions that act when their block has ended.
LATE_M = (0, 1, 2, 5, 9, 30, 99, 129)
#: M129, which ends tool centre point control.
UNTIPPED = 129
#: `_HARMLESS` by number.
IS_HARMLESS = np.isin(np.arange(1000), sorted(_HARMLESS))
#: Letters of words in motion blocks.
KNOWN_LETTERS = np.isin(np.arange(256), list(b"XYZABCUVWFMRKPQOTSG"))
#: Letters of further words in LN.
IS_DIRECTED = np.isin(np.arange(256), [*DIRECTION, NORMAL])
#: The axis of a letter, or -1.
AXIS = np.full(256, -1, np.int8)
AXIS[list(b"XYZ")] = (0, 1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class Pole:
    """The pole in force, an axis position: its `plane`, the `line` of its block and where that begins, and
    its words by axis. It can be edited where `begin` is a byte. `taken` is as in `Poles`."""

    point: Array
    plane: int
    begin: int
    line: int
    words: tuple[int, int, int]
    taken: int

    def used(self) -> Pole:
        """The same for the arcs behind the first one."""
        return replace(self, begin=-1, taken=AS_BEFORE)


@dataclass(slots=True, eq=False)
class Chunk:
    """A chunk while it is read: its blocks, motion rows, and poles that state both coordinates."""

    blocks: Blocks
    base: int
    rows: Rows
    steps: Mask
    pole_line: Index
    pole_slot: Index
    feed_line: Index
    feed_word: Index
    rapid: Mask
    done: int = 0
    done_line: int = -1


def harmless(function: int) -> bool:
    """Whether an M function moves no axis."""
    return function in _HARMLESS


def takes_position(blocks: Blocks, words: range) -> bool:
    """Whether the words of a CC count from the present position."""
    return len(words) < 2 or bool(blocks.step[words.start : words.stop].any())


def plane_of(axes: Sequence[int]) -> int | None:
    """The plane of axes: of two of them, or XY where none is stated."""
    if not axes:
        return 0
    return next((p for p, (a, b, _) in enumerate(PLANES) if {a, b} == set(axes)), None)


def columns_of(blocks: Blocks, base: int) -> Chunk:
    """The motion rows of a chunk, its poles and its feeds."""
    block, words = blocks.block, blocks.words
    motion = np.where((block >= Block.ARC) & (block <= Block.POLAR), 20, 10).astype(np.int16)
    consumed = ((block < Block.LINE) | (block > Block.POLAR)) & (block != Block.DIRECTED)
    letter = np.where(blocks.letter == ord("T"), np.uint8(ord("A")), blocks.letter)
    rows = gather(replace(words, letter=letter), motion, consumed)
    steps = np.where(rows.slot >= 0, blocks.step[rows.slot], False)
    pole_line = np.flatnonzero(block == Block.POLE)
    of = np.full(len(block), -1, np.int64)
    of[pole_line] = np.arange(len(pole_line))
    axis = AXIS[blocks.letter]
    mine = np.flatnonzero((of[words.line] >= 0) & (axis >= 0) & ~blocks.step)
    pole_slot = np.full((len(pole_line), 3), -1, np.int64)
    pole_slot[of[words.line[mine]], axis[mine]] = mine
    plain = (pole_slot >= 0).sum(axis=1) == 2
    plain &= np.diff(words.first_word)[pole_line] == 2
    f = np.flatnonzero((blocks.letter == ord("F")) | (blocks.letter == PARAMETER_FEED))
    fast = (blocks.letter[f] == ord("F")) & (blocks.value[f] < 0)
    rapid = np.zeros(len(block), bool)
    rapid[words.line[f[fast]]] = True
    f = f[~fast]
    return Chunk(blocks, base, rows, steps, pole_line[plain], pole_slot[plain], words.line[f], f, rapid)


def apart(blocks: Blocks) -> Index:
    """The lines that are carried out one by one."""
    block, words = blocks.block, blocks.words
    m = np.flatnonzero(blocks.letter == ord("M"))
    code = np.rint(blocks.value[m]).astype(np.int64)
    special = (
        (code < 0)
        | (code == UNTIPPED)
        | (code >= len(IS_HARMLESS))
        | ~IS_HARMLESS[np.clip(code, 0, len(IS_HARMLESS) - 1)]
    )
    towards = IS_DIRECTED[blocks.letter] & (block == Block.DIRECTED)[words.line]
    unknown = words.line[~KNOWN_LETTERS[blocks.letter] & ~towards]
    pole = np.flatnonzero(block == Block.POLE)
    axis = (AXIS[blocks.letter] >= 0) & ~blocks.step
    plain = np.bincount(words.line[axis], minlength=len(block))[pole] == 2
    plain &= np.diff(words.first_word)[pole] == 2
    # a side of the contour, and words of arcs in other blocks
    side = (blocks.letter == SIDE) & (blocks.value > 0)
    side |= (blocks.letter == ord("R")) & (block[words.line] != Block.RADIUS)
    side |= (blocks.letter == TURN) & is_in(block[words.line], (Block.LINE, Block.DIRECTED))
    statements = np.flatnonzero(block == Block.STATEMENT)
    return distinct(
        np.concatenate(
            (statements, words.odd, words.line[m[special]], words.line[side], unknown, pole[~plain])
        )
    )
