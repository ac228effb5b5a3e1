"""Poles and arcs of Heidenhain programs: C about a pole, CR with a radius, CP with an angle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Frame, Kind
from olp.core.turns import turned
from olp.program.dialect import Options
from olp.program.heidenhain.chunk import AXIS, Chunk, Pole, plane_of, takes_position
from olp.program.heidenhain.collector import Collected
from olp.program.heidenhain.columns import ANGLE, Block
from olp.program.heidenhain.events import Events
from olp.program.heidenhain.modes import Modes
from olp.program.program import AS_BEFORE, STATED
from olp.program.rs274.motion import arc_geometry

#: turns of one arc at most
_MOST_TURNS = 10_000


class Arcs(Events):
    """Reads arcs, from the pole in force. `last_line` is the line of the move before."""

    def __init__(self, modes: Modes, collector: Collected, options: Options) -> None:
        super().__init__(modes, collector, options)
        self.pole: Pole | None = None
        self.last_line = 0

    def take_feeds(self, chunk: Chunk, upto: int) -> tuple[Index, Array]:
        """The feeds that are stated on the lines since the last stretch, up to a line; the last one holds."""
        raise NotImplementedError

    def put_row(
        self, chunk: Chunk, row: int, line: int, kind: Kind, flag: Flag, position: Sequence[float]
    ) -> None:
        """The move of one row, with its words."""
        raise NotImplementedError

    def set_pole(self, chunk: Chunk, line: int, words: range) -> None:
        """A pole that is not two plain words: the present position, or distances from it."""
        number, blocks = chunk.blocks.number(line), chunk.blocks
        frame = self.modes.table.frames[self.modes.frame(number)]
        here, offset = self.modes.words_at(frame), along_frame(frame, frame.offset_mm)
        stated = []
        for w in words:
            axis = int(AXIS[blocks.letter[w]])
            if axis < 0:
                raise ProgramError(
                    f"CC has the word {chr(blocks.letter[w])}; expected two of X, Y, Z",
                    line=number,
                    code="OLP516",
                )
            stated.append(axis)
            size = float(blocks.value[w]) * frame.unit_mm
            here[axis] = here[axis] + size if blocks.step[w] else size + float(offset[axis])
        plane = plane_of(stated)
        if plane is None:
            raise ProgramError(
                "CC does not state the two axes of a plane; write both", line=number, code="OLP516"
            )
        taken = self.collector.moves if takes_position(blocks, words) else STATED
        self.pole = Pole(np.array(here), plane, -1, number, (-1, -1, -1), taken)

    def polar(self, chunk: Chunk, row: int, line: int) -> None:
        """CP: an arc by its angle about the pole, with a step along the tool axis."""
        blocks, modes = chunk.blocks, self.modes
        self.take_feeds(chunk, int(chunk.rows.line[row]) + 1)
        first, stop = blocks.words.first_word[chunk.rows.line[row] : chunk.rows.line[row] + 2].tolist()
        by_letter = {int(blocks.letter[w]): w for w in range(first, stop)}
        frame = modes.table.frames[modes.frame(line)]
        start, offset = np.array(modes.words_at(frame)), along_frame(frame, frame.offset_mm)
        pole = self.pole_before(chunk, int(chunk.rows.line[row]))
        arc = chunk.rows.arc_slot[int(np.searchsorted(chunk.rows.arc_row, row))]
        if pole is None or not np.isfinite(start).all():
            raise ProgramError(
                "CP needs a pole and the present position, and one is not known; give CC, and command X, Y "
                "and Z before",
                line=line,
                code="OLP524",
            )
        if arc[2] < 0 or (arc[4] < 0) == (ANGLE not in by_letter):
            raise ProgramError("CP needs one angle (PA or IPA) and DR", line=line, code="OLP516")
        a, b, third = PLANES[pole.plane]
        direction = float(blocks.value[arc[2]])
        radius = float(np.hypot(start[a] - pole.point[a], start[b] - pole.point[b]))
        angle = float(np.arctan2(start[b] - pole.point[b], start[a] - pole.point[a]))
        if arc[4] >= 0:
            sweep = float(np.radians(blocks.value[arc[4]]))
            if sweep * direction <= 0:
                raise ProgramError(
                    "IPA and DR of this arc turn in opposite directions; give both the same sign",
                    line=line,
                    code="OLP530",
                )
        else:
            turn = (np.radians(float(blocks.value[by_letter[ANGLE]])) - angle) * direction % (2 * np.pi)
            sweep = float(turn if turn > 1e-9 else 2 * np.pi) * direction
        if radius < 1e-9 or abs(sweep) > 2 * np.pi * _MOST_TURNS:
            raise ProgramError(
                "an arc about its pole has zero radius or too many turns", line=line, code="OLP530"
            )
        end = start.copy()
        end[a] = pole.point[a] + radius * np.cos(angle + sweep)
        end[b] = pole.point[b] + radius * np.sin(angle + sweep)
        slot = chunk.rows.slot[row]
        if (slot[[a, b]] >= 0).any():
            raise ProgramError("CP states the end of its arc twice", line=line, code="OLP515")
        if slot[third] >= 0:
            size = float(blocks.value[slot[third]]) * frame.unit_mm
            step = bool(blocks.step[slot[third]])
            end[third] = end[third] + size if step else size + offset[third]
            if step and self.tips:
                # where words are written again, it is a position
                slot[third] = -1
        centre = start.copy()
        centre[[a, b]] = pole.point[[a, b]]
        collector, matrix = self.collector, np.eye(3) if frame.turn is None else np.array(frame.turn)
        if self.tips:
            collector.levels += [(collector.moves, axis, float(end[axis])) for axis in range(3)]
        words, end, centre = end, *turned(matrix, np.array([end, centre]))
        collector.put_worded_arcs(
            np.array([collector.moves]), centre[None], np.array([pole.plane]), np.array([sweep]),
            np.array([[*pole.words, -1, -1]]), np.array([True]),
        )  # fmt: skip
        collector.put_poles([Block.POLAR], [self._editable(pole)], [pole.taken])
        modes.move_to(frame, end.tolist(), words)
        self.put_row(chunk, row, line, Kind.ARC_CCW if sweep > 0 else Kind.ARC_CW, Flag(0), end.tolist())
        self.pole = pole.used()

    def _editable(self, pole: Pole) -> int:
        """Where the block of a pole begins, -1 where a move comes between it and the arc."""
        return pole.begin if pole.line > self.last_line else -1

    def pole_before(self, chunk: Chunk, line: int) -> Pole | None:
        """The pole in force on a line of the chunk, whose frame is the present one."""
        k = int(np.searchsorted(chunk.pole_line, line)) - 1
        if k < 0 or chunk.blocks.number(int(chunk.pole_line[k])) <= (
            0 if self.pole is None else self.pole.line
        ):
            return self._of_plane(self.pole, chunk.blocks.number(line))
        number = chunk.blocks.number(int(chunk.pole_line[k]))
        frame = self.modes.table.frames[self.modes.frame(number)]
        slot = chunk.pole_slot[k]
        stated = np.flatnonzero(slot >= 0)
        plane = plane_of(stated.tolist())
        assert plane is not None
        point, offset = np.full(3, np.nan), along_frame(frame, frame.offset_mm)
        for axis in stated.tolist():
            point[axis] = chunk.blocks.value[slot[axis]] * frame.unit_mm + offset[axis]
        words = [int(s) + chunk.base if s >= 0 else -1 for s in slot]
        begin = int(chunk.blocks.words.line_start[chunk.pole_line[k]])
        self.pole = Pole(point, plane, begin, number, (words[0], words[1], words[2]), STATED)
        return self._of_plane(self.pole, chunk.blocks.number(line))

    def _of_plane(self, pole: Pole | None, line: int) -> Pole | None:
        """A pole, which has to be stated in the plane that is in force."""
        if pole is not None and pole.line < self.modes.tilted_line:
            raise ProgramError(
                "the pole of this arc is stated before a PLANE, and is none in that plane; give CC again",
                line=line,
                code="OLP516",
            )
        return pole

    def arcs(
        self, chunk: Chunk, arcs: slice, a: int, end: Array, frame: Frame, number: Index
    ) -> npt.NDArray[np.uint8]:
        """Arcs of a stretch that begins with row `a`, with `end` (n, 3) along the words. Their kinds."""
        blocks, rows = chunk.blocks, chunk.rows
        row = rows.arc_row[arcs] - a
        line, words = rows.line[rows.arc_row[arcs]], rows.arc_slot[arcs]
        form = blocks.block[line]
        first = np.array(self.modes.words_at(frame))
        start = np.where(row[:, None] > 0, end[np.maximum(row - 1, 0)], first)
        if (words[:, 2] < 0).any():
            bad = int(np.flatnonzero(words[:, 2] < 0)[0])
            raise ProgramError("an arc has no DR; give DR+ or DR-", line=int(number[row[bad]]), code="OLP516")
        size = np.full((len(row), 5), np.nan)
        plane, slots = np.zeros(len(row), np.int64), np.full((len(row), 5), -1)
        begin, taken = np.full(len(row), -1), np.full(len(row), AS_BEFORE)
        before = np.where(row > 0, number[np.maximum(row - 1, 0)], self.last_line)
        by_radius = form == Block.RADIUS
        size[by_radius, 3] = np.where(
            words[by_radius, 3] >= 0, blocks.value[words[by_radius, 3]] * frame.unit_mm, np.nan
        )
        slots[by_radius, 3] = np.where(words[by_radius, 3] >= 0, words[by_radius, 3] + chunk.base, -1)
        for i in np.flatnonzero(~by_radius).tolist():
            pole = self.pole_before(chunk, int(line[i]))
            if pole is None:
                raise ProgramError(
                    "an arc has no pole; give CC before it", line=int(number[row[i]]), code="OLP516"
                )
            size[i, :3], plane[i], slots[i, :3] = pole.point, pole.plane, pole.words
            begin[i] = pole.begin if pole.line > before[i] else -1
            taken[i] = pole.taken
            self.pole = pole.used()
        centre, sweep = arc_geometry(
            start, end[row], size, clockwise=blocks.value[words[:, 2]] < 0, plane=plane,
            absolute=np.ones(len(row), bool), offset=np.zeros((len(row), 3)), line=number[row],
        )  # fmt: skip
        slots[begin < 0, :3] = -1
        if frame.turn is not None:
            centre = turned(np.array(frame.turn), centre)
        self.collector.put_worded_arcs(row + self.collector.moves, centre, plane, sweep, slots, ~by_radius)
        self.collector.put_poles(form, begin, taken)
        return np.where(sweep > 0, np.uint8(Kind.ARC_CCW), np.uint8(Kind.ARC_CW))


def along_frame(frame: Frame, place: Sequence[float]) -> Array:
    """(3,) a place of the axes along the words of a frame."""
    point = np.array(place, float)
    return point if frame.turn is None else turned(np.array(frame.turn).T, point[None])[0]
