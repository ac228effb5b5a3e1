"""Writes the plan of a machine with rotary joints into a program of points (APT): GOTO with the direction of
the tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.joints.writer import PLACES, JointWriter, WrittenJoints
from olp.compensation.wrapping import carded, wrapped
from olp.core.arrays import Array
from olp.core.toolpath import Kind
from olp.core.units import AXES
from olp.program.text.edits import BARE, EditList, Edits


class StatementJoints(JointWriter):
    """A later part of a move is a point of its own, which states all numbers."""

    def _direction_words(self) -> tuple[bytes, ...]:
        return (b",", b",", b",")

    def written(self) -> WrittenJoints:
        done, statements = super().written(), self.program.statements
        assert statements is not None
        if done.text is None:
            return done
        lines = carded if statements.cards else wrapped
        return replace(done, text=lines(done.text, statements.width, statements.mark))

    def _drill(self, command: Array) -> Edits:
        made = super()._drill(command)
        # a point states all coordinates, those too that the correction leaves
        columns = [self.order.index(name) for name in AXES]
        self.stated = command[:, columns]
        return made

    def _replaced(self) -> list[Edits]:
        edits, statements = super()._replaced(), self.program.statements
        assert statements is not None
        for edit in edits if statements.broken else ():
            for row, word in enumerate(np.searchsorted(self.words.start, edit.start).tolist()):
                if word in statements.broken:
                    edit.prefix[row] = self.prefixes(statements.broken[word])
        return edits

    def _inserted_words(self) -> list[Edits]:
        """Directions of points that state none, behind their coordinates."""
        directions = slice(len(self.order), None)
        missing = (self.write & (self.slot < 0) & self.head[:, None])[:, directions]
        rows = np.flatnonzero(missing.any(axis=1))
        last = self.slot[rows, self.order.index("Z")]
        place, edits = self.words.end[last].astype(np.int64), []
        for number, column in enumerate(range(len(self.order), len(self.names))):
            prefix = self.prefixes(self.names[column])
            edits.append(self._edit(rows, column, place, place, prefix, number + 1))
        self.tally.inserted_words += 3 * len(rows)
        return edits

    def _inserted_blocks(self) -> list[Edits]:
        edits, program, path = EditList(self.prefixes), self.program, self.path
        statements = program.statements
        assert statements is not None
        for row in np.flatnonzero(self._tails()).tolist():
            move = int(self.plan.move[row])
            place = int(statements.end[move])
            eol = program.eol(int(path.line[move]))
            lead = eol + b"GOTO/"
            if program.toolpath.kind[move] == Kind.RAPID:
                # it holds for one point
                lead = eol + statements.rapid + lead
            for number, (mantissa, decimals) in enumerate(self._numbers(row, move)):
                edits.add(place, place, mantissa, decimals, b"," if number else lead, row * PLACES + number)
            edits.add(place, place, BARE, 0, b"", row * PLACES + PLACES - 1)
            self.tally.inserted_blocks += 1
        return [edits.done()]

    def _numbers(self, row: int, move: int) -> list[tuple[int, int]]:
        """Mantissas and decimals of the numbers of a point."""
        numbers = []
        for own, name in enumerate(AXES):
            column, unit = self.order.index(name), float(self.path.unit[move])
            if self.write[row, column]:
                numbers.append((int(self.mantissa[row, column]), int(self.decimals[row, column])))
                continue
            decimals = self.style.usual(own, unit)
            value = (self.stated[row, own] - self.path.offset[move, column]) / unit
            numbers.append((round(float(value) * 10**decimals), decimals))
        columns = range(len(self.order), len(self.names))
        return numbers + [(int(self.mantissa[row, k]), int(self.decimals[row, k])) for k in columns]
