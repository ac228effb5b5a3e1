"""How a program writes its words: digits, spacing, case. Inserted words follow it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, is_in
from olp.core.machine import Vector
from olp.core.toolpath import Flag
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.text.columns import spans

#: Digits behind the point, at most.
_MOST_DECIMALS = 9
#: Numbers of digits behind the point that a word may have.
_KINDS = 1 << 7
#: Bytes that are blanks at the start of a line.
_BLANK = np.array([chr(byte).isspace() for byte in range(256)])
#: The space before a word, by style number modulo 3.
_SPACE = (b"", b" ", b"\t")

Slots = npt.NDArray[np.int32] | npt.NDArray[np.int64]


def fewest_decimals(increment_mm: float, unit_mm: float, inch_decimals: int) -> int:
    """Decimals that a least increment needs: 0.001 mm needs 3, and in inch what the control takes for it."""
    if unit_mm not in (1.0, MM_PER_INCH):
        return max(0, math.ceil(-math.log10(increment_mm / unit_mm) - 1e-9))
    metric = max(0, math.ceil(-math.log10(increment_mm) - 1e-9))
    return metric if unit_mm == 1.0 else metric + inch_decimals - 3


@dataclass(frozen=True, slots=True, eq=False)
class Style:
    """Observed once per program."""

    program: Program
    increments_mm: Vector
    common: tuple[int, int, int]
    finest: tuple[int, int, int]
    leading_zero: bool
    spaced: int
    bare_decimals: tuple[int, int, int]

    @staticmethod
    def of(program: Program, increments_mm: Vector) -> Style:
        words, path = program.words, program.toolpath
        assert words is not None
        counts, finest = np.zeros((3, _KINDS), np.int64), [0, 0, 0]
        leading_zero = True
        text = np.frombuffer(program.data, np.uint8)
        for some in spans(len(program.slot)):
            counting = (path.flag[some] & np.uint8(Flag.INCREMENTAL)) != 0
            for axis in range(3):
                slot = program.slot[some, axis]
                used = slot >= 0
                counts[axis] += np.bincount(words.decimals[slot[used]], minlength=_KINDS)
                steps = slot[used & counting]
                finest[axis] = max(finest[axis], int(words.decimals[steps].max(initial=0)))
                leading_zero = leading_zero and not (text[words.number[slot[used]]] == 46).any()
        common = counts.argmax(axis=1).tolist()
        index = np.arange(1, min(len(words.start), 4000))
        inner = index[words.number[index - 1] >= 0]
        inner = inner[~is_in(inner, words.first_word[:4001])]
        spaced = int(inner.size == 0 or np.mean(text[words.start[inner] - 1] == 32) >= 0.5)
        bare = [3 if step >= 0.0005 else 4 for step in increments_mm]
        return Style(
            program, increments_mm, (common[0], common[1], common[2]), (finest[0], finest[1], finest[2]),
            leading_zero, spaced, (bare[0], bare[1], bare[2]),
        )  # fmt: skip

    def decimals(
        self, slot: Slots, axis: int | npt.NDArray[np.int64], unit_mm: float | npt.NDArray[np.float64]
    ) -> npt.NDArray[np.int64]:
        """Digits behind the point of words, counting the hidden ones of numbers in least increments. All are
        of one axis and unit, or each of its own."""
        words = self.program.words
        assert words is not None
        digits = words.decimals[slot].astype(np.int64)
        if not self.program.calculator:
            hidden = np.array(self.bare_decimals)[axis] + (np.asarray(unit_mm) != 1.0)
            digits = np.where(words.pointed[slot], digits, hidden)
        return digits

    def decimals_of(self, slot: int, axis: int, unit_mm: float) -> int:
        """The same for one word."""
        return int(self.decimals(np.array([slot]), axis, unit_mm)[0])

    def lead(self, word: int) -> bytes:
        """The space before a word; of a first word, the usual one."""
        return _SPACE[int(self.separators(np.array([word]), self.program)[0]) % 3]

    def cased(self, word: int, letters: bytes) -> bytes:
        """Letters in the case of a word."""
        return letters.lower() if int(self.separators(np.array([word]), self.program)[0]) >= 3 else letters

    def least(self, axis: int, unit_mm: float) -> int:
        return fewest_decimals(self.increments_mm[axis], unit_mm, self.program.dialect.inch_decimals)

    def usual(self, axis: int, unit_mm: float) -> int:
        """Digits of an inserted word."""
        return min(max(self.least(axis, unit_mm), self.common[axis]), _MOST_DECIMALS)

    def grid(self, axis: int, unit_mm: float) -> int:
        """Digits of words in G91: all on one grid, as fine as the finest of them."""
        return min(max(self.least(axis, unit_mm), self.finest[axis]), _MOST_DECIMALS)

    def centre(self, axis: int, unit_mm: float) -> int:
        """Digits of a centre word: one more than positions where the control takes it, since the far side of
        an arc moves by twice what its centre does."""
        return min(self.usual(axis, unit_mm) + self.program.dialect.free_digits, _MOST_DECIMALS)

    def block_start(self, line: int) -> bytes:
        """The text before the first word of a block that is inserted behind a line."""
        deleted = self.program.text(line).lstrip().startswith("/")
        return self.program.eol(line) + (b"/" if deleted else b"")

    def block_starts(self, line: Slots) -> tuple[list[bytes], npt.NDArray[np.int64]]:
        """The different `block_start` of lines (n,), and (n,) which of them each has."""
        text, program = np.frombuffer(self.program.data, np.uint8), self.program
        begin, end = program.line_start[line - 1], program.line_end[line - 1]
        behind = program.line_start[np.minimum(line, len(program.line_start) - 1)]
        gap = np.minimum(np.where(line < len(program.line_start), behind, len(text)) - end, 7)
        last = len(text) - 1
        first, ending = (text[np.minimum(place, last)].astype(np.int64) for place in (begin, end))
        # lines that begin and end alike; those that may begin with a blank are looked at one by one
        own = np.where((first <= 32) | (first >= 128), line, 0).astype(np.int64)
        key = ((own * 256 + first) * 8 + gap) * 256 + ending
        _, example, which = np.unique(key, return_index=True, return_inverse=True)
        return [self.block_start(int(n)) for n in np.asarray(line)[example].tolist()], which

    def word(self, line: int, letter: str) -> int | None:
        """Index of the first word with a letter in a line."""
        words = self.program.words
        assert words is not None
        return next((i for i in words.of_line(line) if words.letter[i] == ord(letter)), None)

    def last_word(self, line: int) -> int:
        words = self.program.words
        assert words is not None
        return int(words.first_word[line]) - 1

    def separators(self, word: npt.NDArray[np.integer], program: Program) -> npt.NDArray[np.int64]:
        """Style number of each word: the space before it, and its case."""
        words = program.words
        assert words is not None
        text = np.frombuffer(program.data, np.uint8)
        start = words.start[word]
        before = text[np.maximum(start - 1, 0)]
        space = np.where(before == 32, 1, np.where(before == 9, 2, 0))
        # of the same type: another would be that of a copy of the whole column
        place = np.searchsorted(words.first_word, word.astype(words.first_word.dtype))
        opens = words.first_word[place] == word
        space = np.where(opens, self.spaced, space)
        lower = (text[start] & 32) != 0
        return np.asarray(space + 3 * lower.astype(np.int64), np.int64)

    def separator(self, which: int, letter: bytes) -> bytes:
        """Text before an inserted number, in the style of this number: space and letter."""
        return _SPACE[which % 3] + (letter.lower() if which >= 3 else letter)


def by_unit(
    places: Callable[[int, float], int], axis: int, unit: Array | float
) -> int | npt.NDArray[np.int8]:
    """Decimals of an axis in the unit of all rows, or of each."""
    if not isinstance(unit, np.ndarray):
        return places(axis, unit)
    units, which = np.unique(unit, return_inverse=True)
    return np.array([places(axis, u) for u in units.tolist()], np.int8)[which]
