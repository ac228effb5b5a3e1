"""Arcs about poles that blocks of their own state: CC edited or put before an arc, and their later parts."""

from __future__ import annotations

import math
import re

import numpy as np

from olp.compensation.arc_centres import ArcRows, solve
from olp.compensation.block_arcs import radii
from olp.compensation.block_writer import BlockWriter
from olp.compensation.conversational_blocks import ConversationalBlocks
from olp.compensation.rows import Rows
from olp.compensation.writer import Task
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag
from olp.core.values import dataclass
from olp.program.heidenhain.columns import ANGLE, STEP_ANGLE, Block
from olp.program.program import AS_BEFORE, STATED, Poles
from olp.program.text.edits import BARE, EditList, Edits

#: decimals of angles in degrees: 2 nm at a radius of 100 mm
_ANGLE_DECIMALS = 6
#: of the radius: the chord of a part whose ends do not meet
_CHORD_SHARE = 0.2
_NAME = re.compile(rb"[ \t]*\d*[ \t]*(?P<c>C)R?", re.I)
#: rad; an arc that turns further is a whole circle
_WHOLE = 2 * math.pi - 1e-9
#: mm; a pole that is off by less is the same
_SAME_MM = 1e-9


class PoleWriter(BlockWriter):
    """A writer of blocks that say in words what they are. `moves_before` are those of the bands before."""

    moves_before = 0

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.blocks = ConversationalBlocks(self.program)


@dataclass(frozen=True, slots=True)
class _Part:
    """One part of an arc as it will be written: its row, its move and line, what states it, and in mm its
    centre and its ends. `solved`: it is another arc than the program's; `lifted`: it becomes CP."""

    row: int
    move: int
    arc: int
    line: int
    form: int
    head: bool
    solved: bool
    lifted: bool
    plane: int
    centre: Array
    start: Array
    end: Array
    sweep: float


class PoleArcs:
    """The arcs of one program, in the order of its rows; the pole as written goes on from arc to arc."""

    def __init__(self) -> None:
        self._pole: Array | None = None
        self._lifted = np.zeros(0, bool)

    def polar(self, writer: PoleWriter, rows: Rows) -> Mask:
        """(r,) parts of arcs that state an angle in place of their end."""
        path, poles = writer.path, _poles(writer)
        polar = np.zeros(len(path), bool)
        polar[path.arcs.move[poles.form == Block.POLAR]] = True
        return np.asarray(polar[rows.move] & ~rows.take_up)

    def enter(self, writer: PoleWriter, rows: Rows, a: int, b: int) -> None:
        """Positions after the polar arcs a..b: where they are commanded, the third axis on its digits."""
        part = slice(rows.first + a, rows.first + b)
        move = rows.move[a:b]
        nominal, command = writer.path.end_mm[move], writer.plan.command_mm[part]
        raw = writer.plan.raw[part]
        point = np.where(raw | (np.abs(command - nominal) < _SAME_MM), nominal, command)
        third = np.array(PLANES)[writer.path.arcs.plane[np.searchsorted(writer.path.arcs.move, move)], 2]
        for k, axis in enumerate(third.tolist()):
            if point[k, axis] != nominal[k, axis]:
                frame = int(writer.path.frame[move[k]])
                unit, offset = float(writer.frame_unit_mm[frame]), float(writer.frame_offset_mm[frame, axis])
                scale = 10.0 ** writer.style.usual(axis, unit)
                point[k, axis] = round((point[k, axis] - offset) / unit * scale) / scale * unit + offset
        rows.emitted[a:b] = point

    def lift(self, writer: PoleWriter, rows: Rows) -> None:
        """Find the arcs that need their third axis, of which their blocks say nothing: controls take it in CP
        alone, so these blocks become CP. So do whole circles whose ends are off by a digit from where they
        begin, which would be tiny arcs. Their words are not written."""
        path = writer.path
        self._lifted = np.zeros(len(rows.move), bool)
        row = np.flatnonzero(rows.arc & ~rows.take_up)
        if not row.size:
            return
        arc = np.searchsorted(path.arcs.move, rows.move[row])
        third = np.array(PLANES)[path.arcs.plane[arc], 2]
        silent = writer.program.slot[rows.move[row], third] < 0
        needed = (silent & rows.write[row, third]) | _torn(writer, rows, row, arc)
        lifted = row[needed & (_poles(writer).form[arc] != Block.POLAR)]
        self._lifted[lifted] = True
        rows.write[lifted[rows.head[lifted]]] = False

    def edits(self, writer: PoleWriter, rows: Rows) -> list[Edits]:
        """Edits of poles, radii and angles, and blocks for the later parts of arcs."""
        if not rows.arc.any():
            return []
        edits = EditList(writer.prefixes)
        by_angle = self.polar(writer, rows) | self._lifted
        for part in _parts(writer, rows, solve(writer, rows, by_angle), self._lifted):
            if part.form == Block.RADIUS and part.head and not part.lifted:
                self._radius(writer, part, edits)
            else:
                self._about_pole(writer, rows, part, edits)
        return [edits.done()]

    # -- poles ---------------------------------------------------------------------------------------

    def _present(self, writer: PoleWriter, rows: Rows, part: _Part) -> Array | None:
        """The pole that the text states where an arc begins, None where it is not known."""
        nominal = np.asarray(writer.path.arcs.centre_mm[part.arc], float)
        taken = int(_poles(writer).taken[part.arc])
        if not part.head or taken == AS_BEFORE:
            return nominal if self._pole is None else self._pole
        if taken == STATED:
            return nominal
        move = taken - 1 - writer.moves_before
        row = int(rows.move.searchsorted(move, "right")) - 1
        if row < 0 or rows.move[row] != move:
            return None
        same = np.abs(rows.emitted[row] - writer.path.end_mm[move]).max() < _SAME_MM
        return nominal if same else None

    def _about_pole(self, writer: PoleWriter, rows: Rows, part: _Part, edits: EditList) -> None:
        present = self._present(writer, rows, part)
        axes = PLANES[part.plane][:2]
        centre, numbers = part.centre.copy(), {}
        if part.solved:
            if part.lifted or part.form == Block.POLAR:
                centre = _between(part)
            for axis in axes:
                mantissa, decimals, centre[axis] = _number(writer, part.move, axis, float(centre[axis]))
                numbers[axis] = (mantissa, decimals)
        moved = present is None or any(abs(present[a] - centre[a]) > _SAME_MM for a in axes)
        if moved and not numbers:
            numbers = {a: _number(writer, part.move, a, centre[a])[:2] for a in axes}
        self._pole = centre
        begin = int(_poles(writer).begin[part.arc])
        lead = writer.blocks.lead(part.line)
        if part.head:
            if moved and begin >= 0:
                self._edit_pole(writer, part, numbers, edits)
            elif moved:
                place = int(writer.program.line_start[part.line - 1])
                eol = writer.program.eol(part.line)
                _put(edits, place, _pole_words(lead[len(eol) :], numbers), eol, part.row * 8 + 21)
                writer.tally.inserted_blocks += 1
            if part.lifted:
                self._become_polar(writer, part, centre, edits)
            elif part.form == Block.POLAR and part.solved:
                self._edit_angle(writer, part, centre, edits)
            return
        place = int(writer.program.line_end[part.line - 1])
        order = part.row * 8 + 16
        pieces = _pole_words(lead, numbers) if moved else []
        pieces += _end_words(writer, rows, part, centre, lead)
        direction = b" DR+" if part.sweep > 0 else b" DR-"
        _put(edits, place, pieces, direction + writer.blocks.trail(part.line), order)
        writer.tally.inserted_blocks += 1 + int(moved)

    def _edit_pole(
        self, writer: PoleWriter, part: _Part, numbers: dict[int, tuple[int, int]], edits: EditList
    ) -> None:
        for axis, (mantissa, decimals) in numbers.items():
            word = int(writer.program.arc_slots.word[part.arc, axis])
            _replace(writer, word, mantissa, decimals, edits)

    def _edit_angle(self, writer: PoleWriter, part: _Part, centre: Array, edits: EditList) -> None:
        """The angle of CP, and its third axis, as a position."""
        words, third = writer.words, PLANES[part.plane][2]
        mantissa = round(math.degrees(_sweep(part, centre)) * 10**_ANGLE_DECIMALS)
        place = -1
        for i in words.of_line(part.line):
            if words.letter[i] in (ANGLE, STEP_ANGLE):
                number, place = int(words.number[i]), int(words.end[i])
                if words.letter[i] == ANGLE:
                    begin = int(words.start[i]) - 1
                    edits.add(begin, begin, BARE, 0, b"I")
                edits.add(number, place, mantissa, _ANGLE_DECIMALS)
                writer.tally.changed_words += 1
        height, decimals, _ = _number(writer, part.move, third, part.end[third], fine=False)
        slot = int(writer.program.slot[part.move, third])
        letter = b"XYZ"[third : third + 1]
        if slot >= 0:
            edits.add(int(words.start[slot]), int(words.end[slot]), height, decimals, letter)
        elif abs(part.end[third] - part.start[third]) > _SAME_MM:
            edits.add(place, place, height, decimals, b" " + letter, 1)

    def _become_polar(self, writer: PoleWriter, part: _Part, centre: Array, edits: EditList) -> None:
        """C or CR becomes CP: its words make room for an angle and the third axis."""
        words, data = writer.words, writer.program.data
        begin = int(writer.program.line_start[part.line - 1])
        name = _NAME.match(data, begin)
        assert name is not None
        edits.add(name.end("c"), name.end(), BARE, 0, b"P")
        mantissa = round(math.degrees(_sweep(part, centre)) * 10**_ANGLE_DECIMALS)
        place = name.end()
        edits.add(place, place, mantissa, _ANGLE_DECIMALS, b" IPA", 1)
        third = PLANES[part.plane][2]
        height, decimals, _ = _number(writer, part.move, third, part.end[third], fine=False)
        edits.add(place, place, height, decimals, b" " + b"XYZ"[third : third + 1], 2)
        for i in words.of_line(part.line):
            if words.letter[i] in b"XYZ" or (words.letter[i] == ord("R") and part.form == Block.RADIUS):
                start = int(words.start[i])
                edits.add(start - (data[start - 1 : start] == b" "), int(words.end[i]), BARE, 0)
        writer.tally.changed_words += 1

    def _radius(self, writer: PoleWriter, part: _Part, edits: EditList) -> None:
        """The radius of a CR block; where it is too coarse, near half circles, a pole and C in its place."""
        if not part.solved:
            return
        words = writer.words
        word = int(writer.program.arc_slots.word[part.arc, 3])
        unit = float(writer.frame_unit_mm[writer.path.frame[part.move]])
        axis = PLANES[part.plane][0]
        decimals = max(int(words.decimals[word]), writer.style.centre(axis, unit))
        lone = ArcRows(
            np.array([part.row]), np.array([part.move]), np.array([part.line], np.int32), part.start[None],
            part.end[None], part.centre[None], np.array([part.sweep]), np.array([part.plane], np.int8),
        )  # fmt: skip
        mantissa, good = radii(writer, lone, np.array([decimals]), np.array([unit]))
        if good[0]:
            _replace(writer, word, int(mantissa[0]), decimals, edits)
            return
        numbers, centre = {}, part.centre.copy()
        for a in PLANES[part.plane][:2]:
            m, d, centre[a] = _number(writer, part.move, a, part.centre[a])
            numbers[a] = (m, d)
        self._pole = centre
        lead, eol = writer.blocks.lead(part.line), writer.program.eol(part.line)
        place = int(writer.program.line_start[part.line - 1])
        _put(edits, place, _pole_words(lead[len(eol) :], numbers), eol, part.row * 8 + 21)
        name = place + writer.program.data[place : int(words.start[word])].upper().index(b"CR")
        edits.add(name + 1, name + 2, BARE, 0)
        edits.add(int(words.start[word]), int(words.end[word]), BARE, 0)
        writer.tally.inserted_blocks += 1


def _torn(writer: PoleWriter, rows: Rows, row: Index, arc: Index) -> Mask:
    """(k,) whole circles, each in one row, that as written do not end where they begin."""
    arcs, before = writer.path.arcs, np.maximum(row - 1, 0)
    start = np.where((row > 0)[:, None], rows.emitted[before], rows.entry)
    alone = rows.head[row] & np.append(rows.head, True)[row + 1]
    across = np.array(PLANES)[arcs.plane[arc], :2]
    off = np.abs(np.take_along_axis(rows.emitted[row] - start, across, axis=1)).max(axis=1)
    return np.asarray(alone & (np.abs(arcs.sweep_rad[arc]) > _WHOLE) & (off > _SAME_MM), np.bool_)


def _poles(writer: PoleWriter) -> Poles:
    poles = writer.program.arc_slots.poles
    assert poles is not None
    return poles


def _parts(writer: PoleWriter, rows: Rows, solved: ArcRows, lifted: Mask) -> list[_Part]:
    """The parts of arcs among rows, also those that keep their words."""
    path = writer.path
    poles = _poles(writer)
    row = np.flatnonzero(rows.arc & ~rows.take_up & ((rows.flag & np.uint8(Flag.PASS)) == 0))
    move = rows.move[row]
    arc = np.searchsorted(path.arcs.move, move)
    at = np.full(len(rows.move), -1)
    at[solved.row] = np.arange(len(solved.row))
    which = at[row]
    parts = []
    for r, m, k, s in zip(row.tolist(), move.tolist(), arc.tolist(), which.tolist(), strict=True):
        line, form = int(path.line[m]), int(poles.form[k])
        plane = int(path.arcs.plane[k])
        if s >= 0:
            geometry = (solved.centre[s], solved.start[s], solved.end[s], float(solved.sweep[s]))
        else:
            start = rows.emitted[r - 1] if r else rows.entry
            geometry = (path.arcs.centre_mm[k], start, rows.emitted[r], float(path.arcs.sweep_rad[k]))
        parts.append(
            _Part(r, m, k, line, form, bool(rows.head[r]), s >= 0, bool(lifted[r]), plane, *geometry)
        )
    return parts


def _number(
    writer: PoleWriter, move: int, axis: int, value_mm: float, *, fine: bool = True
) -> tuple[int, int, float]:
    """Mantissa and decimals of a position in the program's numbers, and the position that they state."""
    frame = int(writer.path.frame[move])
    unit, offset = float(writer.frame_unit_mm[frame]), float(writer.frame_offset_mm[frame, axis])
    decimals = writer.style.centre(axis, unit) if fine else writer.style.usual(axis, unit)
    mantissa = round((value_mm - offset) / unit * 10**decimals)
    return mantissa, decimals, mantissa / 10**decimals * unit + offset


def _between(part: _Part) -> Array:
    """The centre of a part, moved along its chord to where both ends are equally far: an angle leads from one
    to the other. One whose ends nearly meet keeps it."""
    axes = list(PLANES[part.plane][:2])
    start, end, centre = part.start[axes], part.end[axes], part.centre.copy()
    chord = end - start
    length = math.hypot(*chord.tolist())
    if length > _CHORD_SHARE * math.hypot(*(start - centre[axes]).tolist()):
        along = float((centre[axes] - (start + end) / 2) @ chord) / length
        centre[axes] -= along * chord / length
    return centre


def _sweep(part: _Part, centre: Array) -> float:
    """The angle between the ends of a part about its centre as written."""
    a, b, _ = PLANES[part.plane]
    first, last = part.start - centre, part.end - centre
    angle = math.atan2(last[b], last[a]) - math.atan2(first[b], first[a])
    return angle + 2 * math.pi * round((part.sweep - angle) / (2 * math.pi))


Piece = tuple[int, int, bytes]


def _pole_words(lead: bytes, numbers: dict[int, tuple[int, int]]) -> list[Piece]:
    """CC with its two words: mantissa, decimals, and the text before."""
    pieces: list[Piece] = []
    for axis in sorted(numbers):
        text = (lead + b"CC " if not pieces else b" ") + b"XYZ"[axis : axis + 1]
        pieces.append((*numbers[axis], text))
    return pieces


def _end_words(writer: PoleWriter, rows: Rows, part: _Part, centre: Array, lead: bytes) -> list[Piece]:
    """The block of a later part: C with its end, or CP with its angle."""
    first, second, third = PLANES[part.plane]
    pieces: list[Piece] = []
    if part.form == Block.POLAR or part.lifted:
        mantissa = round(math.degrees(_sweep(part, centre)) * 10**_ANGLE_DECIMALS)
        pieces.append((mantissa, _ANGLE_DECIMALS, lead + b"CP IPA"))
        height, decimals, _ = _number(writer, part.move, third, part.end[third], fine=False)
        if abs(part.end[third] - part.start[third]) > _SAME_MM:
            pieces.append((height, decimals, b" " + b"XYZ"[third : third + 1]))
        return pieces
    step = bool(rows.flag[part.row] & np.uint8(Flag.INCREMENTAL))
    for axis in sorted((first, second, *((third,) if rows.write[part.row, third] else ()))):
        if rows.write[part.row, axis] or step:
            number = int(rows.mantissa[part.row, axis]), int(rows.decimals[part.row, axis])
        else:
            number = _number(writer, part.move, axis, part.end[axis], fine=False)[:2]
        letter = (b"I" if step else b"") + b"XYZ"[axis : axis + 1]
        pieces.append((*number, (lead + b"C " if not pieces else b" ") + letter))
    return pieces


def _put(edits: EditList, place: int, pieces: list[Piece], trail: bytes, order: int) -> None:
    """Insert numbers with their texts at one position; all of them in one order among other insertions."""
    for mantissa, decimals, text in pieces:
        edits.add(place, place, mantissa, decimals, text, order)
    edits.add(place, place, BARE, 0, trail, order)


def _replace(writer: PoleWriter, word: int, mantissa: int, decimals: int, edits: EditList) -> None:
    words = writer.words
    own = int(words.decimals[word])
    decimals, mantissa = (own, mantissa * 10 ** (own - decimals)) if own > decimals else (decimals, mantissa)
    if int(words.mantissa[word]) * 10 ** (decimals - own) != mantissa:
        edits.add(int(words.number[word]), int(words.end[word]), mantissa, decimals)
        writer.tally.changed_words += 1
