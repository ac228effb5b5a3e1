"""Moves and holes of a program page by page, and where the tip is at their ends."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_interval
from olp.program.program import Program

#: Kind of a whole hole.
_HOLE = 255


@dataclass(frozen=True, slots=True, eq=False)
class Units:
    """Moves of a path, whole holes as one. Where there are holes, (u + 1,) `begin` is the first move of each
    unit and, last, their number, and (u,) `hole` marks the holes; else both are None."""

    path: Toolpath
    begin: Index | None
    hole: Mask | None

    @staticmethod
    def of(program: Program, *, holes: bool) -> Units:
        """The units of a program, whose holes are units with `holes`."""
        path = program.toolpath
        if not holes or not len(program.holes):
            return Units(path, None, None)
        starts, within = np.ones(len(path), bool), np.zeros(len(path), bool)
        move, hole = program.holes.moves()
        starts[move[program.holes.first[hole] != move]] = False
        within[move] = True
        first = np.flatnonzero(starts)
        return Units(path, np.append(first, len(path)), within[first])

    def __len__(self) -> int:
        return len(self.path) if self.begin is None else len(self.begin) - 1

    def first(self, a: int, b: int) -> Index:
        """(b - a,) the first moves of units a..b."""
        return np.arange(a, b) if self.begin is None else self.begin[a:b]

    def last(self, a: int, b: int) -> Index:
        """(b - a,) the last moves of units a..b."""
        return np.arange(a, b) if self.begin is None else self.begin[a + 1 : b + 1] - 1

    def kinds(self, a: int, b: int) -> Index:
        """(b - a,) what units a..b are."""
        kind = self.path.kind[self.first(a, b)].astype(np.int64)
        if self.hole is not None:
            kind[self.hole[a:b]] = _HOLE
        return kind


class Tips:
    """Where the tip is at the ends of the moves of a path, which is asked for from its begin to its end."""

    def __init__(self, path: Toolpath, model: ErrorModel) -> None:
        self._path, self._model = path, model
        self._first = 0
        self._tip = np.zeros((0, 3))
        self._command, self._play = np.full((1, 3), np.nan), np.full((2, 3), np.nan)

    def of(self, a: int, b: int) -> Array:
        """(b - a, 3) of moves a..b; `a` never goes back."""
        end = self._first + len(self._tip)
        if b > end:
            self._tip = np.vstack((self._tip[max(a - self._first, 0) :], self._next(end, b)))
            self._first = max(a, self._first)
        return self._tip[a - self._first : b - self._first]

    def _next(self, a: int, b: int) -> Array:
        command = self._path.end_mm[a:b]
        chain, play = np.vstack((self._command, command)), None
        width = self._model.backlash_at(chain)
        if width is not None:
            low, high = play_interval(chain, width, self._play)
            self._play = np.stack((low[-1], high[-1]))
            play = ((low + high) * 0.5)[1:]
        self._command = command[-1:]
        # where an axis is unknown the error may be, too: then the command alone is compared
        return np.asarray(command + np.nan_to_num(self._model.error(command, self._path.tool_mm(a, b), play)))


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """Consecutive units: the `path` of their moves, of which (u,) `last` is the last of each unit, and (u,)
    their `kind`. `first` is the number of moves before them. `left` is the number of units from the first one
    to the end of the program."""

    path: Toolpath
    last: Index
    kind: Index
    first: int
    left: int

    @staticmethod
    def of(units: Units, a: int, b: int) -> Page:
        """Units a..b."""
        last = units.last(a, b)
        first = int(units.first(a, a + 1)[0])
        return Page(
            units.path.part(first, int(last[-1]) + 1), last - first, units.kinds(a, b), first, len(units) - a
        )

    def __len__(self) -> int:
        return len(self.last)

    @property
    def final(self) -> bool:
        """Whether it has all the units up to the end."""
        return self.left == len(self)
