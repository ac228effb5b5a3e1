"""The holes that canned cycles of a program make, in columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

Small = npt.NDArray[np.int32]
#: The letters of the words that a correction of a hole may change.
CHANGED = "XYZR"


@dataclass(frozen=True, slots=True)
class Hole:
    """One of the `Holes`: its moves `first`..`last` of the toolpath, and its words by letter.

    `rests` says where the motion rests, as (number of its moves before, seconds): dwells and reversals of the
    spindle. The other fields are as in `Holes`.
    """

    line: int
    first: int
    last: int
    words: dict[str, int]
    counter: int
    last_word: int
    plane: int
    place_mm: tuple[float, float]
    r_mm: float
    z_mm: float
    initial_mm: float
    incremental: bool
    repeat: int
    repeats: int
    series: int
    code: int
    rests: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Holes:
    """(h,) holes in the order of their moves, which are `first`..`last` of the toolpath, without `last`.

    - `word` (h, 4): indices of the X, Y, Z and R words of the block, -1 where omitted. `counter` is the word
      that counts the holes of the block, or -1, and `last_word` its last word.
    - `place_mm` (h, 2) along the first and second axis of `plane`, `r_mm`, `z_mm` and `initial_mm`: axis
      positions.
    - `series` counts contiguous cycles; a block of one series inherits R and Z of the block before.
    - `repeat` counts the `repeats` holes of one block from 0. `code` is ten times the G number.
    - (k,) `rest_hole`, `rest_after` and `rest_s`: where the motion rests, as hole, number of its moves
      before, and seconds. These are dwells and reversals of the spindle.
    """

    line: Small
    first: Index
    last: Index
    word: Small
    counter: Small
    last_word: Small
    plane: npt.NDArray[np.int8]
    place_mm: Array
    r_mm: Array
    z_mm: Array
    initial_mm: Array
    incremental: Mask
    repeat: Small
    repeats: Small
    series: Small
    code: Small
    rest_hole: Index
    rest_after: Index
    rest_s: Array

    @staticmethod
    def none() -> Holes:
        whole, real, yes = np.zeros(0, np.int32), np.zeros(0), np.zeros(0, bool)
        wide, plane = np.zeros(0, np.int64), np.zeros(0, np.int8)
        words, places = np.zeros((0, 4), np.int32), np.zeros((0, 2))
        return Holes(
            whole, wide, wide, words, whole, whole, plane, places, real, real, real, yes, whole, whole, whole,
            whole, wide, wide, real,
        )  # fmt: skip

    @staticmethod
    def join(parts: list[Holes]) -> Holes:
        """The holes of all parts, which are in order."""
        if not parts:
            return Holes.none()
        before = np.cumsum([0] + [len(part) for part in parts])
        columns = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Holes)}
        shift = np.repeat(before[:-1], [len(part.rest_hole) for part in parts])
        columns["rest_hole"] = columns["rest_hole"] + shift
        return Holes(**columns)

    def part(self, first: int, last: int) -> Holes:
        """The holes whose moves are among `first`..`last`, with their moves counted from `first`."""
        if not len(self):
            return self
        a, b = np.searchsorted(self.first, (first, last)).tolist()
        rests = slice(*np.searchsorted(self.rest_hole, (a, b)).tolist())
        columns = {f.name: getattr(self, f.name)[a:b] for f in fields(Holes) if "rest_" not in f.name}
        return Holes(
            **columns | {"first": self.first[a:b] - first, "last": self.last[a:b] - first},
            rest_hole=self.rest_hole[rests] - a, rest_after=self.rest_after[rests], rest_s=self.rest_s[rests],
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.line)

    def __getitem__(self, i: int) -> Hole:
        mine = slice(*np.searchsorted(self.rest_hole, (i, i + 1)))
        return Hole(
            line=int(self.line[i]), first=int(self.first[i]), last=int(self.last[i]),
            words={letter: w for letter, w in zip(CHANGED, self.word[i].tolist(), strict=True) if w >= 0},
            counter=int(self.counter[i]), last_word=int(self.last_word[i]), plane=int(self.plane[i]),
            place_mm=(float(self.place_mm[i, 0]), float(self.place_mm[i, 1])), r_mm=float(self.r_mm[i]),
            z_mm=float(self.z_mm[i]), initial_mm=float(self.initial_mm[i]),
            incremental=bool(self.incremental[i]), repeat=int(self.repeat[i]), repeats=int(self.repeats[i]),
            series=int(self.series[i]), code=int(self.code[i]),
            rests=tuple(zip(self.rest_after[mine].tolist(), self.rest_s[mine].tolist(), strict=True)),
        )  # fmt: skip

    def __iter__(self) -> Iterator[Hole]:
        return (self[i] for i in range(len(self)))

    def moves(self) -> tuple[Index, Index]:
        """(m,) the moves of all holes, and (m,) the hole of each."""
        count = self.last - self.first
        hole = np.repeat(np.arange(len(self)), count)
        before = np.cumsum(count) - count
        return self.first[hole] + np.arange(len(hole)) - before[hole], hole

    def inside(self, moves: int) -> Mask:
        """(moves,) which moves of the toolpath are those of holes."""
        inside = np.zeros(moves, bool)
        inside[self.moves()[0]] = True
        return inside

    def ends(self, some: Mask) -> tuple[Index, Index]:
        """(h,) the first and the last of the `some` (m,) moves of each hole, as `moves` has them; -1 where
        there is none."""
        move, hole = (column[some] for column in self.moves())
        first, last = np.full(len(self), -1, np.int64), np.full(len(self), -1, np.int64)
        first[hole[::-1]], last[hole] = move[::-1], move
        return first, last
