"""Rotary axes of a program that was read for three linear ones: the words of A, B and C, and where they lead.

The reader takes a block with such a word as a move and keeps the word as it is. Here these words become
columns beside the linear ones, in degrees.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.errors import ProgramError
from olp.core.machine import Machine
from olp.core.toolpath import Flag
from olp.core.values import dataclass
from olp.program.program import Program, Words
from olp.program.rs274.profiles.base import Profile

#: Letters of rotary axes in programs of this family.
ROTARY_LETTERS = "ABC"
#: Letters of further linear axes, which are not read.
_FURTHER = "UVW"
#: Bytes of a letter and `=` before a number.
_PLAIN_GAP = 2
#: The form of a word of Sinumerik programs.
_FORM = re.compile(rb"(?i)\b(AC|IC|DC|ACP|ACN)[ \t]*\(")
#: deg; a position that is as far off is not left on the shortest way in any case.
_HALF_TURN = 179.0
#: M126 of Heidenhain programs: rotary axes go the shortest way.
_SHORTEST_M = 126
#: deg of a rotary word without a decimal point, where a length without one counts least increments.
_BARE_DEG = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class RotaryWords:
    """Per move and rotary axis (n, k) the `slot` of its word or -1, and its `value` as written, in degrees.
    `scale` (k,) is the degrees of one unit of a word without a decimal point."""

    slot: npt.NDArray[np.int32]
    value: Array
    scale: Array

    @staticmethod
    def none(moves: int, axes: int) -> RotaryWords:
        slot = np.full((moves, axes), -1, np.int32)
        return RotaryWords(slot, np.full(slot.shape, np.nan), np.ones(axes))

    @staticmethod
    def of(program: Program, letters: Sequence[str], machine: Machine) -> RotaryWords:
        """The words of these axes. Raises ProgramError for words of axes that the machine does not have,
        twice in a block, in blocks that do not move, and on arcs."""
        words, dialect = program.words, program.dialect
        assert words is not None
        profile = dialect if isinstance(dialect, Profile) else None
        _refuse_others(words, letters, profile)
        counting = profile is not None and profile.counts_increments(machine)
        scale = np.full(len(letters), _BARE_DEG if counting else 1.0)
        slot = np.full((len(program.toolpath), len(letters)), -1, np.int32)
        for column, letter in enumerate(letters):
            index = np.flatnonzero(words.letter == ord(letter))
            move = _moves(program, index, letter)
            slot[move, column] = index
        number = words.mantissa[slot] / 10.0 ** words.decimals[slot]
        bare = ~words.pointed[slot] & (slot >= 0)
        return RotaryWords(slot, np.where(bare, number * scale, number), scale)

    def follow(self, program: Program, start_deg: Array, offset_deg: Array, found_deg: Array) -> Array:
        """(n, k) degrees of each axis behind each move, NaN where it is not known; `start_deg` (k,) before
        the first, `offset_deg` (frames, k) what a work offset adds to its words. `found_deg` (n, k) are
        positions that the control finds by itself, NaN elsewhere."""
        path = program.toolpath
        flag = path.flag
        control = (flag & np.uint8(Flag.CONTROL)) != 0
        counting = (flag & np.uint8(Flag.INCREMENTAL)) != 0
        machine = (flag & np.uint8(Flag.MACHINE)) != 0
        offset = np.where(machine[:, None], 0.0, offset_deg[path.frame])
        given = self.slot >= 0
        found = np.isfinite(found_deg)
        # G28 leaves the axes that its block names where they are not known, behind the moves of its words
        named = np.zeros((int(path.line.max(initial=0)) + 1, len(self.scale)), bool)
        row, column_of = np.nonzero(given)
        named[path.line[row], column_of] = True
        lost = control[:, None] & (named[path.line] | ~_stated_lines(program)[:, None]) & ~found
        steps = np.where(given & counting[:, None] & ~lost, self.value, 0.0)
        anchor = (given & ~counting[:, None]) | lost | found
        place = np.where(lost, np.nan, np.where(found, found_deg, self.value + offset))
        end = np.empty((len(path), len(self.scale)))
        order = np.arange(len(path))
        for column in range(len(self.scale)):
            source = np.maximum.accumulate(np.where(anchor[:, column], order, -1))
            total = np.cumsum(steps[:, column])
            from_anchor = place[source, column] + total - total[source]
            end[:, column] = np.where(source < 0, start_deg[column] + total, from_anchor)
        return end

    def refuse_ways(self, program: Program, end_deg: Array) -> None:
        """Raise ProgramError for words that say on which way the axis goes, where it is another one than that
        of a plain number, or would be with a small correction. `end_deg` as from `follow`."""
        words, path = program.words, program.toolpath
        assert words is not None
        before = np.vstack((np.full((1, end_deg.shape[1]), np.nan), end_deg))[:-1]
        counting = (path.flag & np.uint8(Flag.INCREMENTAL)) != 0
        shortest = bool(((words.letter == ord("M")) & (words.mantissa[:] == _SHORTEST_M)).any())
        shortest &= program.statements is not None
        for column in range(end_deg.shape[1]):
            given = np.flatnonzero(self.slot[:, column] >= 0)
            index = self.slot[given, column]
            some = words.number[index] - words.start[index] > _PLAIN_GAP
            for move, word in zip(given[some].tolist(), index[some].tolist(), strict=True):
                form = _FORM.search(program.data[int(words.start[word]) : int(words.number[word])])
                _refuse_form(form[1].upper() if form else b"", bool(counting[move]), int(path.line[move]))
            near = some if not shortest else np.ones(len(given), bool)
            long = np.abs(end_deg[given, column] - before[given, column]) > _HALF_TURN
            far = given[near & long & ~counting[given]]
            if far.size:
                raise ProgramError(
                    "a rotary axis goes the shortest way here, and the numbers are half a turn apart, or "
                    "nearly so; program the position that it comes to",
                    line=int(path.line[far[0]]),
                    code="OLP565",
                )


def _refuse_form(form: bytes, counting: bool, line: int) -> None:
    """Raise ProgramError for a form of words that its mode does not have."""
    if form in (b"ACP", b"ACN"):
        why = f"{form.decode()} says on which side an axis comes, and a small correction turns it round"
        raise ProgramError(
            f"{why}; program the position, or DC( )", line=line, code="OLP565", word=form.decode()
        )
    if (form == b"IC") != counting and form in (b"IC", b"AC", b"DC"):
        what = "a distance in G90" if form == b"IC" else "a position in G91"
        raise ProgramError(
            f"the word of a rotary axis is {what}; program it in the other mode",
            line=line,
            code="OLP565",
        )


def _stated_lines(program: Program) -> Mask:
    """(n,) moves whose line has an axis word: the control moves these axes alone."""
    words = program.words
    assert words is not None
    if not program.in_blocks:
        # what is between points is the post-processor's, which has no reason to turn the tool
        return np.ones(len(program.toolpath), bool)
    axes = np.flatnonzero(is_in(words.letter, [ord(letter) for letter in "XYZABC"]))
    line = np.searchsorted(words.first_word, axes, "right")
    stated = np.zeros(len(words.first_word) + 1, bool)
    stated[line] = True
    return np.asarray(stated[program.toolpath.line])


def _refuse_others(words: Words, letters: Sequence[str], profile: Profile | None) -> None:
    """Raise ProgramError for words of axes that the machine does not have."""
    others = [letter for letter in ROTARY_LETTERS + _FURTHER if letter not in letters]
    if profile is not None and ("U" in profile.dwell_words or profile.axis_dwell):
        # beside a dwell it is a time
        others = [letter for letter in others if letter != "U"]
    some = np.flatnonzero(is_in(words.letter, [ord(letter) for letter in others]))
    if some.size:
        letter = chr(int(words.letter[some[0]]))
        raise ProgramError(
            f"the block moves {letter}, which is no axis of the machine; expected X, Y, Z, "
            f"{', '.join(letters)}; name the axis in the machine file",
            line=int(np.searchsorted(words.first_word, some[0], "right")),
            code="OLP564",
        )


def _moves(program: Program, index: Index, letter: str) -> Index:
    """The move that each word of a rotary axis belongs to."""
    path, words = program.toolpath, program.words
    assert words is not None
    line = np.searchsorted(words.first_word, index, "right")
    end = program.end_line or len(words.first_word)
    line = line[line <= end]
    twice = line[1:][line[1:] == line[:-1]]
    if twice.size:
        raise ProgramError(
            f"the word {letter} is twice in this block; expected it once", line=int(twice[0]), code="OLP515"
        )
    move = np.minimum(np.searchsorted(path.line, line), max(len(path) - 1, 0))
    still = line[path.line[move] != line] if len(path) else line
    if still.size:
        raise ProgramError(
            f"{letter} is in a block that does not move it; expected a block with G0 "
            "or G1; offsets of rotary "
            "axes are read from [work_offsets.NAME] of the machine or job file alone",
            line=int(still[0]),
            code="OLP564",
        )
    return np.asarray(move, np.int64)
