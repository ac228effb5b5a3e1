"""A program whose contours are written as the path of the tool, without cutter compensation.

Only blocks of contours change: G41, G42 and their D go, positions and centres become those of the tool, and
the moves that the control makes at outside corners become blocks. Other bytes stay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.style import Style
from olp.core.arrays import Array, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.machine import Vector
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import AXES
from olp.program.origin import Origin, Unrolled, origin_of
from olp.program.program import Program
from olp.program.rs274.codes import CUTTER_COMPENSATION, GROUPS
from olp.program.rs274.motion import modal

#: Moves whose words are not those of their end point.
_OTHER = np.uint8(Flag.CYCLE | Flag.CONTROL | Flag.PASS | Flag.MACHINE)
_CODE = {Kind.RAPID: b"G0", Kind.LINE: b"G1", Kind.ARC_CW: b"G2", Kind.ARC_CCW: b"G3"}
#: G90.1, ten times its number.
_ABSOLUTE = 901
#: mm by which rounding may move an end or a centre
_ALIKE_MM = 0.05
#: mm below which an axis does not move
_STILL_MM = 1e-9


def as_tool_path(program: Program, increments_mm: Vector) -> tuple[Unrolled, Mask]:
    """The text with the path of the tool, and (n,) which moves have a block in it. Raises ProgramError for
    blocks that cannot have it."""
    text = _Text(program, increments_mm)
    return text.written(), text.has_block


def with_exact_path(written: Program, program: Program, has_block: Mask) -> Program:
    """The text as read again, with the path of the tool before its digits were rounded. (n,) `has_block` are
    the moves of the program that are in the text."""
    path, exact = written.toolpath, program.toolpath
    end_mm = exact.end_mm[has_block]
    alike = len(path) == len(end_mm) and bool((path.kind == exact.kind[has_block]).all())
    alike &= len(path.arcs) == len(exact.arcs)
    if alike:
        ends = np.nan_to_num(path.end_mm - end_mm)
        centres = path.arcs.centre_mm - exact.arcs.centre_mm
        alike = max(np.abs(ends).max(initial=0.0), np.abs(centres).max(initial=0.0)) < _ALIKE_MM
    if not alike:
        raise ProgramError(
            "the path of the tool cannot be written as blocks of this program; leave --contour path out",
            code="OLP561",
        )
    arcs = replace(exact.arcs, move=path.arcs.move)
    remarks = (*written.remarks, ("path", int(exact.line[np.argmax(exact.compensated())]), ""))
    return replace(written, toolpath=replace(path, end_mm=end_mm, arcs=arcs), remarks=remarks)


def _unlike(a: Array, b: Array) -> Mask:
    """(n,) rows that differ; what is not known in both is alike."""
    return np.asarray(((a != b) & ~(np.isnan(a) & np.isnan(b))).any(axis=1))


class _Text:
    """One text while it is written. `at` is where the tool is as written, mm."""

    def __init__(self, program: Program, increments_mm: Vector) -> None:
        assert program.words is not None
        self.program, self.path, self.words = program, program.toolpath, program.words
        stated = program.programmed or program
        self.stated: Toolpath = stated.toolpath
        self.style = Style.of(stated, increments_mm)
        self.blocks = np.arange(len(self.path)) if program.blocks is None else program.blocks
        self.corner = np.array([(c := f.compensation) is not None and c.corner for f in self.path.frames])
        self.arc = {int(move): i for i, move in enumerate(self.path.arcs.move)}
        #: tenths of the numbers of words, which G codes are
        self.tenths = np.rint(self.words.mantissa[:] / 10.0 ** (self.words.decimals.astype(float) - 1))
        self.absolute = self._absolute_centres()
        self.edits: dict[int, list[tuple[int, int, bytes]]] = {}
        self.before: dict[int, list[bytes]] = {}
        #: the moves that have a block
        self.has_block = np.ones(len(self.path), bool)

    def written(self) -> Unrolled:
        path, on = self.path, self.path.compensated()
        start, stated_start = path.starts_mm(), self.stated.starts_mm()[self.blocks]
        off = _unlike(path.end_mm, self.stated.end_mm[self.blocks]) | _unlike(start, stated_start)
        at = np.array(path.start_mm)
        for move in range(len(path)):
            if (off[move] or on[move]) and not path.flag[move] & _OTHER:
                at = self._move(move, at)
            else:
                at = path.end_mm[move]
        self._without_codes()
        return self._joined()

    def _move(self, move: int, at: Array) -> Array:
        """Write a move from where the tool is; where it is then."""
        path, line = self.path, int(self.path.line[move])
        frame = path.frames[int(path.frame[move])]
        flag = int(path.flag[move])
        if frame.turn is not None or flag & Flag.INVERSE_TIME or flag & Flag.DELETED:
            raise ProgramError(
                "a contour in a turned frame, in G93 or under block delete cannot be written as the path of "
                "the tool; leave --contour path out",
                line=line,
                code="OLP561",
            )
        now, words = at.copy(), []
        for axis in range(3):
            slot = int(self.program.slot[move, axis])
            if abs(path.end_mm[move, axis] - at[axis]) < _STILL_MM and slot < 0:
                continue
            places = self.style.grid(axis, frame.unit_mm) if flag & Flag.INCREMENTAL else max(
                self.style.usual(axis, frame.unit_mm), 0 if slot < 0 else int(self.words.decimals[slot])
            )  # fmt: skip
            zero = at[axis] if flag & Flag.INCREMENTAL else frame.offset_mm[axis]
            number = round((path.end_mm[move, axis] - zero) / frame.unit_mm, places)
            now[axis] = number * frame.unit_mm + zero
            words.append((AXES[axis].encode(), slot, b"%.*f" % (max(places, 1), number)))
        arc = self.arc.get(move)
        if arc is not None:
            words += self._centre(move, arc, at, frame.unit_mm, frame.offset_mm)
        if self.corner[path.frame[move]] and not words:
            # both sides of a right angle are extended to one point
            self.has_block[move] = False
        elif self.corner[path.frame[move]]:
            code = _CODE[Kind(int(path.kind[move]))]
            block = b" ".join([code, *(letter + number for letter, _, number in words)])
            self.before.setdefault(line, []).append(block)
        else:
            self._replace(line, move, words)
        return now

    def _centre(
        self, move: int, arc: int, at: Array, unit_mm: float, offset_mm: Vector
    ) -> list[tuple[bytes, int, bytes]]:
        """The centre words of an arc: letter, index of the word or -1, number."""
        arcs, slots = self.path.arcs, self.program.arc_slots
        corner = self.corner[self.path.frame[move]]
        absolute = self.absolute[int(self.path.line[move])] if corner else slots.absolute[arc]
        words = []
        for axis in PLANES[int(arcs.plane[arc])][:2]:
            zero = offset_mm[axis] if absolute else at[axis]
            places = self.style.centre(axis, unit_mm)
            number = (arcs.centre_mm[arc, axis] - zero) / unit_mm
            words.append((b"IJK"[axis : axis + 1], int(slots.word[arc, axis]), b"%.*f" % (places, number)))
        return words

    def _absolute_centres(self) -> Mask:
        """(lines + 1,) whether centres are positions (G90.1) in front of a line, by its number."""
        words = self.words
        code = np.flatnonzero((words.letter == ord("G")) & np.isin(self.tenths, GROUPS["arc_distance"]))
        line = np.searchsorted(words.first_word, code, "right") + 1
        start = -1 if self.program.rs274.arc_distance is None else self.program.rs274.arc_distance
        count = len(self.program.line_start) + 1
        line, code = line[line < count], code[line < count]
        return np.asarray(modal(count, line, self.tenths[code].astype(np.int64), start) == _ABSOLUTE, bool)

    def _replace(self, line: int, move: int, words: list[tuple[bytes, int, bytes]]) -> None:
        """Change and insert the words of a block."""
        table = self.words
        edits = self.edits.setdefault(line, [])
        radius = self.arc.get(move)
        if radius is not None and (slot := int(self.program.arc_slots.word[radius, 3])) >= 0:
            edits.append((int(table.start[slot]), int(table.end[slot]), b""))
        own = [i for i in table.of_line(line) if table.letter[i] != ord("N")]
        end = int(table.end[own[-1]])
        for letter, slot, number in words:
            if slot >= 0:
                edits.append((int(table.number[slot]), int(table.end[slot]), number))
            else:
                edits.append((end, end, b" " + letter + number))
        if line in self.before and not self._states_motion(line):
            first = int(table.start[own[0]])
            edits.append((first, first, _CODE[Kind(int(self.path.kind[move]))] + b" "))

    def _states_motion(self, line: int) -> bool:
        words = self.words
        return any(
            words.letter[i] == ord("G") and words.mantissa[i] < 4 * 10 ** int(words.decimals[i])
            and words.mantissa[i] % 10 ** int(words.decimals[i]) == 0
            for i in words.of_line(line)
        )  # fmt: skip

    def _without_codes(self) -> None:
        """Take out the codes that switch compensation on, with their D."""
        words = self.words
        code = (words.letter == ord("G")) & np.isin(self.tenths, sorted(CUTTER_COMPENSATION))
        for word in np.flatnonzero(code).tolist():
            line = int(np.searchsorted(words.first_word, word, "right"))
            if line > self.program.end_line:
                continue
            for i in words.of_line(line):
                if i == word or words.letter[i] == ord("D"):
                    begin = int(words.start[i])
                    self.edits.setdefault(line, []).append((begin, int(words.end[i]), b""))

    def _joined(self) -> Unrolled:
        """The text with its changes, and where its lines come from."""
        data, program = bytes(self.program.data), self.program
        pieces, origin, last = [], [], 0
        count = len(program.line_start)
        ends = [*program.line_start[1:].tolist(), len(data)]
        for line in range(1, count + 1):
            begin = int(program.line_start[line - 1])
            for block in self.before.get(line, ()):
                pieces.append(block + program.eol(line))
                origin.append(line)
            last, opens = begin, True
            # what is inserted at one place comes in its own order, behind what ends there
            for a, b, new in sorted(self.edits.get(line, ()), key=lambda edit: (edit[0], edit[1])):
                kept = data[last:a]
                opens = opens and not kept.strip()
                if not new:
                    # the first word of a line takes the blanks behind it along, others those before
                    kept = kept if opens else kept.rstrip(b" ")
                    while opens and data[b : b + 1] == b" ":
                        b += 1
                pieces.append(kept)
                pieces.append(new)
                opens = opens and not new
                last = b
            pieces.append(data[last : ends[line - 1]])
            origin.append(line)
        lines = np.array(origin, np.int64)
        known = origin_of(self.program.data)
        if known is not None:
            return Unrolled.of(b"".join(pieces), replace(known, line=known.line[lines - 1]))
        texts = tuple(program.dialect.lines(data))
        nowhere = Origin((), np.zeros(0, np.int64), texts, lines)
        return Unrolled.of(b"".join(pieces), nowhere)
