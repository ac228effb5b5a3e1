"""Writes the plan of a machine with rotary joints into a conversational program: L blocks."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.compensation.conversational_blocks import ConversationalBlocks
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.writer import PLACES, JointWriter
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.units import AXES
from olp.program.heidenhain.chunk import LATE_M
from olp.program.text.edits import BARE, EditList, Edits

_NAME = re.compile(rb"[ \t]*\d*[ \t]*(?P<c>C[RP]?)", re.I)
#: What comes before the word of an angle, from its end on: the rest of its letters, and a blank.
_BEFORE = re.compile(rb"(?:PI?)?[ \t]?", re.I)


class ConversationalJoints(JointWriter):
    """A later part of a move is a block of its own with the number, R0 and FMAX of the first one."""

    def __init__(self, path: JointPath, plan: JointPlan) -> None:
        super().__init__(path, plan)
        slot = path.slot[path.slot >= 0]
        self._blocks = ConversationalBlocks(self.program)
        self._signed = self._blocks.signed(slot)

    def _stay(self, slot: Index) -> Mask:
        """Arcs by an angle, where they stay."""
        if self.plan.straight:
            return super()._stay(slot)
        return np.asarray(self.path.curves.mask[self.plan.move] & (slot < 0), bool)

    def _straightened(self) -> Edits:
        """C, CR and CP become L, and lose what L does not have. Their poles stay, and no block counts from
        them."""
        edits, curves, data = EditList(self.prefixes), self.path.curves, self.program.data
        if not self.plan.straight:
            return edits.done()
        for move in np.flatnonzero(curves.mask).tolist():
            name = _NAME.match(data, int(self.program.line_start[self.path.line[move] - 1]))
            assert name is not None
            edits.add(name.start("c"), name.end("c"), BARE, 0, b"L")
        for i in curves.slot[curves.slot >= 0].tolist():
            word = _BEFORE.match(data[max(int(self.words.start[i]) - 4, 0) : int(self.words.start[i])][::-1])
            start = int(self.words.start[i]) - (0 if word is None else len(word[0]))
            edits.add(start, int(self.words.end[i]), BARE, 0)
        made = edits.done()
        self.tally.changed_words += len(made)
        return made

    def _placed(self, edits: list[Edits]) -> list[Edits]:
        """Numbers that stay positive keep their plus, and new ones get one where the program writes it."""
        text = np.frombuffer(self.program.data, np.uint8)
        placed = []
        for edit in edits:
            new, prefix = (edit.end == edit.start) & (edit.mantissa >= 0) & self._signed, edit.prefix.copy()
            for which in distinct(prefix[new]).tolist():
                prefix[new & (edit.prefix == which)] = self.prefixes(self.prefixes.table[which] + b"+")
            begins = text[np.minimum(edit.start, len(text) - 1)] == ord("+")
            plus = (edit.end > edit.start) & begins & (edit.mantissa >= 0)
            placed.append(replace(edit, prefix=prefix, start=edit.start + plus))
        return placed

    def _starts(self, line: Index) -> tuple[list[bytes], Index]:
        lines, which = np.unique(line, return_inverse=True)
        led = distinct(self.path.line[self.plan.move[self.led]]).tolist()
        names = [b"LN " if n in set(led) else b"L " for n in lines.tolist()]
        starts = [self._blocks.lead(n) + name for n, name in zip(lines.tolist(), names, strict=True)]
        return starts, np.asarray(which, np.int64)

    def _leading(self) -> npt.NDArray[np.int32]:
        # coordinates stand before the components of vectors
        return self.slot[:, : len(self.order)]

    def _drill(self, command: Array) -> Edits:
        """A part of a block with vectors states all coordinates and components, as controls ask for it."""
        made = super()._drill(command)
        tails = self.led & self._tails()
        for name in AXES if tails.any() else ():
            column = self.order.index(name)
            rows = np.flatnonzero(tails & ~self.write[:, column])
            move, used = self.plan.move[rows], self.path.slot[:, column]
            unit = self.path.unit[move]
            own = self.words.decimals[used[used >= 0]].max(initial=0)
            decimals = max(
                int(own), *(self.style.usual(AXES.index(name), u) for u in distinct(unit).tolist()), 0
            )
            value = (command[rows, column] - self.path.offset[move, column]) / unit
            self.mantissa[rows, column] = np.rint(value * 10.0**decimals)
            self.decimals[rows, column], self.write[rows, column] = decimals, True
        self.write[tails, len(self.order) :] = True
        return made

    def _ends(self, tails: Index, line: Index, edits: EditList) -> None:
        """R0 and FMAX behind the words of each part; M functions that act at the end go to the last one."""
        words, data = self.words, self.program.data
        for row, number in zip(tails.tolist(), line.tolist(), strict=True):
            text = self._blocks.trail(number)
            place = int(self.program.line_end[number - 1])
            normal = self._blocks.normal(number)
            if normal:
                # behind X, Y and Z, where the words of rotary axes would be
                edits.add(place, place, BARE, 0, normal, row * PLACES + PLACES + len(AXES))
            if text:
                edits.add(place, place, BARE, 0, text, row * PLACES + 2 * PLACES - 2)
        for number in distinct(line).tolist():
            for i in words.of_line(number):
                if words.letter[i] == ord("M") and int(words.mantissa[i]) in LATE_M:
                    place, (start, end) = (
                        int(self.program.line_end[number - 1]),
                        (words.start[i], words.end[i]),
                    )
                    edits.add(int(start), int(end), BARE, 0)
                    edits.add(place, place, BARE, 0, b" " + data[start:end], 2**30 + i)
