"""What all writers of corrected programs have in common.

A writer puts the rows of a plan into the program's own text: numbers are changed, words, blocks or statements
inserted, nothing else. It takes the rows in chunks, so that memory is small: digits, then edits, then one
splice per chunk of text.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from olp.compensation.hole_plan import HolePlan
from olp.compensation.plan import Plan, targets
from olp.compensation.rows import Rows
from olp.compensation.stamp import stamped
from olp.compensation.style import Style
from olp.compensation.tally import Tally
from olp.core.machine import Vector
from olp.core.toolpath import Flag, Frame
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.edits import Edits, Prefixes, splice


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What is to be written: the `plan` of a `program` that was read with its words, by a `model`. Also the
    numerical tolerance of the correction, the least increment of each axis, and the `stamp`, empty for
    none; with `stamp_always` a text of which nothing changes bears it too."""

    program: Program
    plan: Plan
    model: ErrorModel
    tolerance_mm: float
    increments_mm: Vector
    stamp: bytes
    stamp_always: bool


class Writer(ABC):
    """One writing of one program. `text()` gives the corrected bytes; `parts` (moves,) then holds how many
    moves the corrected text has for each of the nominal path, and `tally` what was changed."""

    #: Rows at a time.
    chunk: ClassVar[int] = 1 << 15

    def __init__(self, task: Task) -> None:
        program, plan, model = task.program, task.plan, task.model
        assert program.words is not None
        self.program, self.plan, self.model = program, plan, model
        self.words = program.words
        self.tolerance_mm, self.stamp = task.tolerance_mm, task.stamp
        self.stamp_always = task.stamp_always
        self.style = Style.of(program, task.increments_mm)
        self.prefixes = Prefixes()
        self.tally = Tally()
        self.path = program.toolpath
        self.targets = targets(self.path, plan.shift_mm)
        self.parts = np.zeros(len(self.path), np.int32)
        self.holes = HolePlan.of(program, plan, model)
        self.frame_offset_mm = np.array([f.offset_mm for f in self.path.frames]).reshape(-1, 3)
        self.frame_unit_mm = np.array([f.unit_mm for f in self.path.frames])

    def text(self) -> bytes:
        """The corrected text; the program's own bytes where nothing is written. Raises ProgramError where the
        plan cannot be written in the dialect."""
        data, move = self.program.data, self.plan.move
        pieces: list[bytes] = []
        begin, changed = 0, False
        entry = np.array(self.path.start_mm, float)
        for first, last in self._spans():
            end = len(data) if last == len(move) else self._start_of(int(move[last]))
            rows = Rows.of(self.plan, self.path, first, last, entry)
            low, high = int(rows.move[0]), int(rows.move[-1])
            self.parts[low : high + 1] += np.bincount(rows.move - low).astype(np.int32)
            text = self._rewritten(rows, begin, end)
            changed |= text is not None
            pieces.append(data[begin:end] if text is None else text)
            begin, entry = end, rows.emitted[-1].copy()
        if not (changed or (self.stamp and self.stamp_always)):
            return data
        pieces.append(data[begin:])
        if self.stamp:
            pieces[0] = stamped(pieces[0], self.stamp, self.program.eol(1), self.program.dialect.first)
        return b"".join(pieces)

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
        return int(self.program.line_start[self.path.line[move] - 1])

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
        joined = Edits.join(edits)
        return splice(source, begin, joined, self.prefixes, leading_zero=self.style.leading_zero).tobytes()
