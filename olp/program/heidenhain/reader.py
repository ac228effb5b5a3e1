"""Reads Heidenhain conversational programs: blocks to a nominal toolpath and the words that can be edited.

A chunk is read in steps: motion blocks in columns (`columns`), then the statements between them in their
order (`events`), and the blocks between two changes at once. Nothing here knows an error model.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress
from olp.core.toolpath import Flag, Kind
from olp.core.turns import turned
from olp.program.dialect import Dialect, Options
from olp.program.heidenhain.arcs import Arcs, along_frame
from olp.program.heidenhain.chunk import (
    IS_DIRECTED,
    KNOWN_LETTERS,
    UNTIPPED,
    Chunk,
    apart,
    columns_of,
    harmless,
)
from olp.program.heidenhain.collector import Collected
from olp.program.heidenhain.columns import PARAMETER_FEED, SIDE, TURN, Block, Blocks, blocks
from olp.program.heidenhain.modes import NAN, Modes
from olp.program.heidenhain.planes import Plane, found_by_control
from olp.program.heidenhain.statements import Statement, of_lines
from olp.program.heidenhain.table import UNROLL
from olp.program.heidenhain.vectors import put_directions, without_position
from olp.program.program import Program
from olp.program.rs274.motion import fill
from olp.program.text.line_ends import stray_cr
from olp.program.tilts import Tilt

_ENDS = (2, 30)
_STRAIGHT = (Block.LINE, Block.DIRECTED)
_MACHINE = 91
_DATUM = 92
_CALL = 99
_MODAL_CALL = 89
_PER_TURN = 136
_TIPPED = 128
_TILTED = (104, 112, 114, 130)
#: M functions that are read one by one
_READ = frozenset({*_ENDS, _MACHINE, _DATUM, _CALL, _MODAL_CALL, _PER_TURN, _TIPPED})
_ROTARY = re.compile(rb"\bI?[ABCUVW][ \t]*[-+]?Q[LR]?\d+", re.I)
_WITH_PARAMETER = re.compile(rb"(?:[XYZ]|PA|PR|R)[ \t]*[-+]?Q[LR]?\d+", re.I)


def read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool = True) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup, dialect, options, words).run(options.tell)


class _Reader(Arcs):
    """Reads one program."""

    def __init__(self, data: bytes, setup: Setup, dialect: Dialect, options: Options, words: bool) -> None:
        modes = Modes(setup)
        x, y, z = modes.position
        super().__init__(modes, Collected(data, (x, y, z), keep_words=words), options)
        self.data, self.dialect, self.tips = data, dialect, dialect.tips
        self.feed_mm_s = NAN

    def run(self, tell: Progress) -> Program:
        self._check_bytes()
        for chunk in blocks(self.data, tell, directed=bool(self.tips)):
            self._chunk(chunk)
        self.collector.remarks.update(self.modes.remarks)
        end = self.ended or self.data.count(b"\n") + 1
        return self.collector.finished(self.dialect, self.modes.table.frames, end)

    def _check_bytes(self) -> None:
        if self.data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError(
                "the text is UTF-16; expected one byte per character; save it as plain text",
                line=1,
                code="OLP502",
            )
        stray = stray_cr(self.data)
        if stray >= 0:
            raise ProgramError(
                "a carriage return is inside this line; expected plain text; remove it",
                line=self.data.count(b"\n", 0, stray) + 1,
                code="OLP502",
            )

    # -- one chunk -----------------------------------------------------------------------------------

    def _chunk(self, blocks: Blocks) -> None:
        base = self.collector.word_count
        self.collector.put_blocks(blocks)
        if self.ended:
            return
        chunk, alone = columns_of(blocks, base), apart(blocks)
        polar = chunk.rows.line[chunk.rows.arc_row]
        polar = polar[blocks.block[polar] == Block.POLAR]
        alone = distinct(np.concatenate((alone, polar, without_position(chunk))))
        for line in alone.tolist():
            upto = int(np.searchsorted(chunk.rows.line, line))
            self._resolve(chunk, upto, line)
            if blocks.block[line] == Block.STATEMENT:
                self.take(self._statement(blocks, line))
            else:
                self._block(chunk, line, upto)
            if self.ended:
                return
        self._resolve(chunk, len(chunk.rows), len(blocks.block))

    def _statement(self, blocks: Blocks, line: int) -> Statement:
        stop = line + 1
        while stop < len(blocks.block) and blocks.block[stop] == Block.MORE:
            stop += 1
        start, end = blocks.words.line_start, blocks.words.line_end
        statement = of_lines([self.data[start[k] : end[k]] for k in range(line, stop)], blocks.number(line))
        return replace(statement, span=(int(start[line]), int(end[stop - 1])))

    # -- blocks one by one ---------------------------------------------------------------------------

    def _block(self, chunk: Chunk, line: int, row: int) -> None:
        """A motion block that is carried out alone."""
        blocks = chunk.blocks
        number, kind = blocks.number(line), blocks.block[line]
        if line in blocks.words.odd:
            self._odd(chunk, line)
            return
        words = range(*blocks.words.first_word[line : line + 2].tolist())
        self._check_letters(blocks, words, kind, number)
        if kind == Block.POLE:
            self.set_pole(chunk, line, words)
            return
        here = row < len(chunk.rows) and chunk.rows.line[row] == line
        if kind == Block.DIRECTED and not here:
            raise ProgramError("LN has no coordinate; state X, Y and Z", line=number, code="OLP510")
        functions = [round(float(blocks.value[w])) for w in words if blocks.letter[w] == ord("M")]
        self._functions(functions, number, here=here)
        if here and _MACHINE in functions:
            self._machine(chunk, row, number)
        elif here and _DATUM in functions:
            self._unknown_datum(chunk, row, number)
        elif here and kind == Block.POLAR:
            self.polar(chunk, row, number)
        else:
            self._resolve(chunk, row + int(here), line + 1)
        chunk.done, chunk.done_line = row + int(here), line
        if UNTIPPED in functions and self.tips:
            # it acts when its block has ended
            self.modes.switch_tips("", number)
        moving = [m for m in functions if not harmless(m) and m not in _READ]
        if moving:
            self.control_move(number, (0, 1, 2))
        if _CALL in functions:
            self.hole(number)
        if any(m in _ENDS for m in functions):
            self.ended = number

    def _functions(self, functions: Sequence[int], line: int, *, here: bool) -> None:
        for m in functions:
            if m == _TIPPED and self.tips:
                self.modes.switch_tips(self.tips, line)
            elif m == _TIPPED or m in _TILTED:
                tipped = m == _TIPPED
                why = (
                    "needs the rotary axes of the machine" if tipped else "changes where positions count from"
                )
                raise ProgramError(f"M{m} {why}, which is not read", line=line, code="OLP512", word=f"M{m}")
            if m == _MODAL_CALL:
                raise ProgramError(
                    "M89 calls a cycle at the end of each block",
                    line=line,
                    code="OLP512",
                    word="M89",
                    hint=UNROLL,
                )

    def _check_letters(self, blocks: Blocks, words: range, kind: int, line: int) -> None:
        for w in words:
            letter = int(blocks.letter[w])
            if not KNOWN_LETTERS[letter] and not (kind == Block.DIRECTED and IS_DIRECTED[letter]):
                raise ProgramError(
                    f"the word {chr(letter)} is not known in this block, and may move the machine",
                    line=line,
                    code="OLP510",
                )
            if letter == SIDE and blocks.value[w] > 0:
                raise ProgramError(
                    f"{'RL' if blocks.value[w] == 1 else 'RR'}: the control offsets the contour by the "
                    "radius of the tool",
                    line=line,
                    code="OLP513",
                    hint=UNROLL,
                )
            if (letter == ord("R") and kind != Block.RADIUS) or (letter == TURN and kind in _STRAIGHT):
                raise ProgramError(
                    f"the word {'R' if letter == ord('R') else 'DR'} is not expected in this block; state "
                    "another block, or take it away",
                    line=line,
                    code="OLP510",
                )

    def _odd(self, chunk: Chunk, line: int) -> None:
        """A motion block with something that is no word and a number."""
        statement = self._statement(chunk.blocks, line)
        upper = statement.upper
        if re.fullmatch(rb"(?:L[ \t]+)?M140[ \t]+MB[^;]*", upper):
            self.control_move(statement.line, (2,))
            return
        rest = _ROTARY.sub(b"", upper)
        if rest != upper and re.fullmatch(
            rb"(?:L)?[ \t]*(?:R0[ \t]*)?(?:F[ \t]*(?:MAX|[\d.]+|Q\d+))?[ \t]*(?:M\d+[ \t]*)*", rest
        ):
            functions = [int(m) for m in re.findall(rb"M(\d+)", rest.replace(b"MAX", b""))]
            self._functions(functions, statement.line, here=False)
            if self.tips:
                plane, letters = found_by_control(statement, self.modes.stated_plane)
                self.turned_by_control(plane, letters, statement.line)
            return
        if _WITH_PARAMETER.search(upper) or b"Q" in upper:
            raise ProgramError(
                f"{statement.shown} takes numbers from parameters",
                line=statement.line,
                code="OLP511",
                hint=UNROLL,
            )
        comma = re.search(rb"\d,\d", upper) is not None
        raise ProgramError(
            f"{statement.shown} is not understood, and may move the machine"
            + ("; write its numbers with a decimal point instead of the comma" if comma else ""),
            line=statement.line,
            code="OLP510",
        )

    def control_move(self, line: int, axes: Sequence[int]) -> None:
        position = self.modes.position
        for axis in axes:
            position[axis] = NAN
        self.modes.along.drop()
        self.last_line = line
        if not self.collector.moves:
            x, y, z = position
            self.collector.start = (x, y, z)
            return
        frame = max(len(self.modes.table.frames) - 1, 0)
        self.collector.put_one(Kind.RAPID, Flag.PASS | Flag.CONTROL, line, frame, position, NAN)

    def turned_by_control(self, plane: Plane, letters: str, line: int) -> None:
        self.last_line, collector = line, self.collector
        tilt = Tilt(collector.moves, line, letters, plane.turn, plane.branch, by_table=plane.by_table)
        collector.tilts.append(tilt)
        if not letters:
            self.modes.position[:] = (NAN, NAN, NAN)
        self.modes.along.drop()
        flag = Flag.PASS if letters else Flag.PASS | Flag.CONTROL
        collector.put_one(Kind.RAPID, flag, line, self.modes.frame(line), self.modes.position, np.inf)

    def _machine(self, chunk: Chunk, row: int, line: int) -> None:
        """M91: words are axis positions."""
        self.take_feeds(chunk, int(chunk.rows.line[row]) + 1)
        slot = chunk.rows.slot[row]
        position = self.modes.position
        located = self.modes.setup.machine.located
        self.modes.along.drop()
        for axis in range(3):
            if slot[axis] >= 0:
                if chunk.blocks.step[slot[axis]]:
                    raise ProgramError(
                        "M91 takes axis positions, and the block has a distance; write it without I",
                        line=line,
                        code="OLP518",
                    )
                position[axis] = chunk.blocks.value[slot[axis]] * self.modes.unit_mm if located else NAN
        flag = Flag.PASS | Flag.MACHINE
        rapid = bool(chunk.rapid[chunk.rows.line[row]])
        self.put_row(chunk, row, line, Kind.RAPID if rapid else Kind.LINE, flag, position)

    def put_row(
        self, chunk: Chunk, row: int, line: int, kind: Kind, flag: Flag, position: Sequence[float]
    ) -> None:
        slot = chunk.rows.slot[row]
        feed = np.inf if kind == Kind.RAPID else self.feed_mm_s
        self.collector.put_one(
            kind, flag, line, self.modes.frame(line), position, feed,
            np.where(slot >= 0, slot + chunk.base, -1).tolist(),
        )  # fmt: skip
        self.last_line = line

    def _unknown_datum(self, chunk: Chunk, row: int, line: int) -> None:
        """M92: words count from a point that the control knows."""
        self.take_feeds(chunk, int(chunk.rows.line[row]) + 1)
        self.control_move(line, np.flatnonzero(chunk.rows.slot[row] >= 0).tolist())

    # -- stretches -----------------------------------------------------------------------------------

    def take_feeds(self, chunk: Chunk, upto: int) -> tuple[Index, Array]:
        """The feeds that are stated on the lines since the last stretch, up to a line; the last one holds."""
        a, b = np.searchsorted(chunk.feed_line, (chunk.done_line + 1, upto))
        line, word = chunk.feed_line[a:b], chunk.feed_word[a:b]
        chunk.done_line = max(upto - 1, chunk.done_line)
        if not len(line):
            return line, np.zeros(0)
        value = chunk.blocks.value[word] * self.modes.feed_scale
        by_parameter = np.flatnonzero(chunk.blocks.letter[word] == PARAMETER_FEED)
        for k in by_parameter.tolist():
            known = self.modes.parameters.get(f"Q{round(float(chunk.blocks.value[word[k]]))}", NAN)
            value[k] = known * self.modes.feed_scale
        plain = np.where(chunk.blocks.letter[word] == PARAMETER_FEED, -1, word + chunk.base)
        self.collector.put_feed_words(line + chunk.blocks.words.first_line + 1, plain)
        self.feed_mm_s = float(value[-1])
        return line, value

    def _resolve(self, chunk: Chunk, upto: int, upto_line: int) -> None:
        """Positions, kinds and arcs of the rows up to `upto`, which have one frame; feeds up to a line."""
        a, chunk.done = chunk.done, max(upto, chunk.done)
        before = self.feed_mm_s
        feed_line, feed_value = self.take_feeds(chunk, upto_line)
        if upto <= a:
            return
        blocks, rows, modes = chunk.blocks, chunk.rows, self.modes
        line = rows.line[a:upto]
        number = line + (blocks.words.first_line + 1)
        index = modes.frame(int(number[0]))
        if not modes.unit_stated:
            self.collector.remarks.setdefault("unit", (int(number[0]), "mm"))
        frame = modes.table.frames[index]
        slot = rows.slot[a:upto]
        step = chunk.steps[a:upto]
        self._check_steps(blocks, slot, step, number)
        counted = np.asarray(step.any(axis=1))
        offset = along_frame(frame, frame.offset_mm)
        start = modes.words_at(frame)
        words = fill(slot, blocks.value, counted if counted.any() else None, offset, frame.unit_mm, start)
        end = words if frame.turn is None else turned(np.array(frame.turn), words)
        flag = np.where(step.any(axis=1), np.uint8(Flag.INCREMENTAL), np.uint8(0))
        flag[rows.other[a:upto]] |= np.uint8(Flag.WHOLE)
        rapid = chunk.rapid[line]
        kind = np.where(rapid, np.uint8(Kind.RAPID), np.uint8(Kind.LINE))
        arcs = slice(*np.searchsorted(rows.arc_row, (a, upto)))
        if arcs.stop > arcs.start:
            kind[rows.arc_row[arcs] - a] = self.arcs(chunk, arcs, a, words, frame, number)
        held = np.searchsorted(feed_line, line, "right") - 1
        feed = (
            np.where(held >= 0, feed_value[held], before) if len(feed_value) else np.full(len(line), before)
        )
        feed[rapid] = np.inf
        own = np.where(slot >= 0, slot + chunk.base, -1)
        put_directions(modes, self.collector, chunk, line)
        self.collector.put_moves(kind, flag, number, np.full(len(line), index), end, own)
        self.collector.put_feeds(feed)
        modes.move_to(frame, end[-1].tolist(), words[-1])
        self.last_line = int(number[-1])

    def _check_steps(self, blocks: Blocks, slot: Index, step: Mask, number: Index) -> None:
        mixed = np.flatnonzero(step.any(axis=1) & ((slot >= 0) & ~step).any(axis=1))
        if mixed.size:
            raise ProgramError(
                "a block has distances (I) and positions",
                line=int(number[mixed[0]]),
                code="OLP518",
                hint=UNROLL,
            )

    def hole(self, line: int) -> None:
        modes, collector = self.modes, self.collector
        if self.cycle is None:
            raise ProgramError("a cycle is called, and none is defined", line=line, code="OLP516")
        number = modes.frame(line)
        frame = modes.table.frames[number]
        matrix = np.eye(3) if frame.turn is None else np.array(frame.turn)
        x, y, z = modes.words_at(frame)
        offset = along_frame(frame, frame.offset_mm)
        stroke = self.cycle.stroke(modes, NAN if frame.tip == "fixed" else z, line, float(offset[2]))
        if stroke is None:
            return
        heights = (stroke.approach, stroke.bottom, stroke.retract)
        words = np.array([(x, y, z) for z in heights])
        ends = turned(matrix, words).tolist()
        for kind, z, end in zip((Kind.RAPID, Kind.LINE, Kind.RAPID), heights, ends, strict=True):
            feed = stroke.feed_mm_s if kind == Kind.LINE else np.inf
            if kind == Kind.LINE and collector.moves > 1:
                collector.strokes.append((collector.moves - 2, collector.moves))
                collector.definitions.append(self.cycle.definition(modes, collector.data))
            if frame.tip == "fixed":
                collector.levels.append((collector.moves, 2, z))
            collector.put_one(kind, Flag.CYCLE, line, number, end, feed)
        modes.move_to(frame, ends[-1], words[-1])
        self.last_line = line
