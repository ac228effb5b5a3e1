"""What all writers of corrected programs have in common.

A writer puts the rows of a plan into the program's own text: numbers are changed, words, blocks or statements
inserted, nothing else. It takes the program band by band, and the rows of a band in chunks, so that memory is
small: digits, then edits, then one splice per chunk of text.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from olp.compensation.hole_plan import HolePlan
from olp.compensation.plan import Plan, targets
from olp.compensation.rows import Rows
from olp.compensation.stamp import stamped
from olp.compensation.style import Style
from olp.compensation.tally import Tally
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import Plane
from olp.core.machine import Vector
from olp.core.progress import Progress, silent
from olp.core.spool import Spool
from olp.core.toolpath import Flag, Frame, Kind
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.bands import Band
from olp.program.program import Program
from olp.program.text.edits import Edits, Prefixes, render, splice


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What is to be written: the corrections of a `program` that was read with its words, by a `model`. Also
    the numerical tolerance of the correction, the least increment of each axis, and the `stamp`, empty for
    none; with `stamp_always` a text of which nothing changes bears it too. With `located` the writer says
    where each line of the program begins in the text."""

    program: Program
    model: ErrorModel
    tolerance_mm: float
    increments_mm: Vector
    stamp: bytes
    stamp_always: bool
    located: bool = False


class Writer(ABC):
    """One writing of one program, of which `program`, `path`, `plan`, `targets`, `holes` and `parts` are
    those of the present band. (n,) `parts` is how many moves the corrected text has for each of its moves.
    `tally` is what was changed so far."""

    #: Rows at a time.
    chunk: ClassVar[int] = 1 << 15

    plan: Plan
    targets: Array
    parts: npt.NDArray[np.int32]
    holes: HolePlan

    def __init__(self, task: Task) -> None:
        program = task.program
        assert program.words is not None
        self.program, self.path, self.model = program, program.toolpath, task.model
        self.words = program.words
        self.tolerance_mm, self.stamp, self.stamp_always = task.tolerance_mm, task.stamp, task.stamp_always
        self.style = Style.of(program, task.increments_mm)
        self.prefixes = Prefixes()
        self.tally = Tally()
        self.frame_offset_mm = np.array([f.offset_mm for f in self.path.frames]).reshape(-1, 3)
        self.frame_unit_mm = np.array([f.unit_mm for f in self.path.frames])
        self.turns = self.path.turns()
        #: (frames, 3) offsets along the words, mm
        self.word_offset_mm = self.frame_offset_mm
        if self.turns is not None:
            self.word_offset_mm = self.turns.words(self.frame_offset_mm, self.turns.of_frame)
        # what is written so far: nothing before the first change
        self._out = Spool()
        # where the text grows, and by how much, if that is asked for
        self._grown: list[tuple[Index, Index]] | None = [] if task.located else None
        self._begin, self._changed = 0, False
        self._entry = np.array(self.path.start_mm, float)

    def add(self, band: Band, plan: Plan, tell: Progress = silent) -> None:
        """Write the next band; `tell` is told what share of it is written. Raises ProgramError where the plan
        cannot be written in the dialect."""
        self.program, self.path, self.plan = band.program, band.program.toolpath, plan
        self.targets = targets(self.path, plan.shift_mm)
        self.parts = np.zeros(len(self.path), np.int32)
        self.holes = HolePlan.of(self.program, plan, self.model).along_words(self.path, self.turns)
        move = plan.move
        for first, last in self._spans():
            end = band.end if last == len(move) else self._start_of(int(move[last]))
            rows = Rows.of(plan, self.path, first, last, self._entry)
            low, high = int(rows.move[0]), int(rows.move[-1])
            self.parts[low : high + 1] += np.bincount(rows.move - low).astype(np.int32)
            text = self._rewritten(rows, self._begin, end)
            if text is not None and not self._changed:
                self._changed = True
                self._put(0, self._begin)
            if self._changed:
                self._put(self._begin, end, text)
            self._begin, self._entry = end, rows.emitted[-1].copy()
            tell("correct", last / len(move))

    def text(self) -> Spool | None:
        """The corrected text, None where nothing is written. It is given once."""
        if not (self._changed or (self.stamp and self.stamp_always)):
            return None
        self._put(self._begin if self._changed else 0, len(self.program.data))
        return self._out

    def _put(self, begin: int, end: int, text: bytes | None = None) -> None:
        """Write the bytes `begin`..`end` of the program, or the `text` in their place; the stamp with the
        first of them."""
        program = self.program
        text = program.data[begin:end] if text is None else text
        if not text:
            return
        if self.stamp and not self._out.size:
            text = stamped(text, self.stamp, program.eol(1), program.dialect.first)
        self._out.write(text)

    def starts(self) -> Index | None:
        """(lines,) where each line of the program, with the blocks that are put before it, begins in the
        text without its stamp; None where it was not asked for."""
        if self._grown is None:
            return None
        starts = self.program.line_start.astype(np.int64)
        if not self._grown:
            return starts
        place, grown = (np.concatenate(column) for column in zip(*self._grown, strict=True))
        total = np.append(0, np.cumsum(grown))
        moved: Index = starts + total[np.searchsorted(place, starts, "left")]
        return moved

    def _spans(self) -> list[tuple[int, int]]:
        """Chunks of rows that end between lines, and not behind a deleted block: words of the next one depend
        on it."""
        count, move, line = len(self.plan), self.plan.move, self.path.line
        deleted = (self.path.flag & np.uint8(Flag.DELETED)) != 0
        cuts = [0]
        while cuts[-1] < count:
            cut = min(cuts[-1] + self.chunk, count)
            while cut < count and (line[move[cut]] == line[move[cut - 1]] or deleted[move[cut - 1]]):
                cut += 1
            cuts.append(cut)
        return list(pairwise(cuts))

    def _start_of(self, move: int) -> int:
        """Where the text of a move begins, at the start of a line."""
        return self.program.text_of(move)

    def turn_of(self, rows: Rows) -> Index:
        """(r,) which matrix of `turns` leads from the words of rows to the axes; 0: none."""
        if self.turns is None:
            return np.zeros(len(rows.move), np.int64)
        machine = (rows.flag & np.uint8(Flag.MACHINE)) != 0
        return np.where(machine, 0, self.turns.of_frame[self.path.frame[rows.move]])

    def along_words(self, axes: Array, turn: Index | int) -> Array:
        """(n, 3) axis positions along the words, of each row or all by the matrix `turn`."""
        return axes if self.turns is None else self.turns.words(axes, turn)

    def along_axes(self, words: Array, turn: Index | int) -> Array:
        """(n, 3) the other way round."""
        return words if self.turns is None else self.turns.axes(words, turn)

    def clockwise(self, move: Index, plane: Plane) -> Mask:
        """(m,) whether words state arcs in these planes clockwise: mirrored ones turn the other way."""
        clockwise = np.asarray(self.path.kind[move] == Kind.ARC_CW)
        if self.turns is None:
            return clockwise
        return np.asarray(clockwise != self.turns.mirrors(self.turns.of_frame[self.path.frame[move]], plane))

    def sizes(self, move: Index, plane: Plane) -> Array:
        """(m,) how much longer lengths in planes are on the machine than their words say."""
        if self.turns is None:
            return np.ones(len(move))
        return self.turns.sizes(self.turns.of_frame[self.path.frame[move]], plane)

    def frame_of(self, move: int) -> Frame:
        return self.path.frames[int(self.path.frame[move])]

    @abstractmethod
    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        """The bytes `begin`..`end` of the program with these rows in it, None where nothing changes. The rows
        then hold the positions that they reach as written."""

    def _spliced(self, edits: list[Edits], begin: int, end: int) -> bytes | None:
        """The bytes `begin`..`end` of the program with edits made, None where there are none."""
        edits = [e for e in edits if len(e)]
        if not edits:
            return None
        source = np.frombuffer(self.program.data, np.uint8)[begin:end]
        joined = Edits.join(outside(edits, self.program.closings))
        if self._grown is not None:
            _, length = render(joined, self.prefixes, leading_zero=self.style.leading_zero)
            self._grown.append((joined.start, length - (joined.end - joined.start)))
        return splice(source, begin, joined, self.prefixes, leading_zero=self.style.leading_zero).tobytes()


def outside(edits: list[Edits], closings: Index) -> list[Edits]:
    """Edits in which what is inserted behind a number comes behind the bracket that closes there too."""
    if not len(closings):
        return edits
    moved = []
    for edit in edits:
        place = np.minimum(np.searchsorted(closings, edit.start), len(closings) - 1)
        inside = ((edit.start == edit.end) & (closings[place] == edit.start)).astype(np.int64)
        moved.append(replace(edit, start=edit.start + inside, end=edit.end + inside))
    return moved
