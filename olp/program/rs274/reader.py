"""Reads RS-274 and ISO 6983 text: bytes to a nominal toolpath and the words that can be edited.

A chunk of lines is read in steps: lexer columns, modal codes per line (`modes`), motion lines, and stretches
between events, each resolved in bulk (`motion`). So are runs of canned cycles (`cycle_blocks`). Blocks that
change frames (`axis_state`) or need the present position (`special_blocks`) are carried out one by one.
`collector` takes the results. Nothing here knows an error model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, any_in_row, is_in
from olp.core.errors import ProgramError
from olp.core.machine import UNKNOWN, Place, Setup
from olp.core.spool import Text, whole
from olp.core.toolpath import Flag, Kind
from olp.core.turns import Turn
from olp.program.dialect import Options
from olp.program.directives import Directives, with_payloads
from olp.program.program import Program
from olp.program.rs274.axis_state import AxisState, Effect
from olp.program.rs274.codes import (
    CYCLES,
    INCREMENTAL,
    INVERSE_TIME,
    PLANE_OF,
    PRESET,
    PROBES,
    THREAD,
    UNITS,
    WRITE_OFFSET,
)
from olp.program.rs274.collector import Collector
from olp.program.rs274.commands import own_words
from olp.program.rs274.cycle_blocks import CycleBlocks
from olp.program.rs274.cycle_runs import CycleWords, Ends, runs
from olp.program.rs274.cycles import stroke_budget
from olp.program.rs274.extrusion import Extrusion
from olp.program.rs274.lexer import WordChunk, chunks
from olp.program.rs274.modes import Context, Modes, Odd, check_odd, scaled
from olp.program.rs274.motion import OTHER, Blocks, arc_geometry, fill, gather
from olp.program.rs274.offset_state import APART, STORES_POSITION, EventBlock
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.rows import Rows
from olp.program.rs274.special_blocks import (
    KnownBlocks,
    SpecialBlocks,
    check_codes,
    event_block,
    event_words,
)
from olp.program.rs274.translated import Beside, check_frames
from olp.program.rs274.translation import Translation
from olp.program.rs274.turned import Turning, along_words

#: motion code to kind of move; 255 where it is not plain motion, the last entry is for "none yet"
_KIND = np.full(1001, 255, np.uint8)
_KIND[[0, 10, 20, 30, THREAD]] = (Kind.RAPID, Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW, Kind.LINE)
_PROBES = np.isin(np.arange(len(_KIND)), list(PROBES))
_ALONE = np.isin(np.arange(len(_KIND)), list(CYCLES | PROBES))
_UNITS = frozenset(UNITS)


def read(
    data: Text, setup: Setup, profile: Profile, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly.

    Without `words` the columns that only writing needs are left out. Payloads that the job gives by line
    are comments in the text of the result (`directives`).
    """
    return _Reader(data, setup, profile, options or Options(), words).run()


class _Reader:
    """Reads one program, chunk by chunk."""

    def __init__(self, data: Text, setup: Setup, profile: Profile, options: Options, words: bool) -> None:
        self.data = data = with_payloads(data, setup.job.payloads, profile.comment)
        self.options = options
        self.state = AxisState.at_start(setup, profile)
        x, y, z = self.state.position
        self.collector = Collector(data, (x, y, z), keep_words=words)
        self.modes = Modes(self.state, block_delete=options.block_delete)
        self.switches = Directives(data)
        self.payloads: dict[int, float] = {}
        # the blocks that move axes by themselves (`departures.Left`)
        self.left: list[tuple[int, Sequence[int], Place, EventBlock]] = []
        self.special_blocks = SpecialBlocks(self.state, self.collector)
        self.cycle_blocks = CycleBlocks(self.state, self.collector, self.switches, stroke_budget(len(data)))
        self.known: KnownBlocks = {}
        self.end_line = 0
        # that of the rows which have a frame and no position yet
        self.turn: Turn | None = None
        self.lost: set[int] = set()
        commands = profile.commands
        self.others = OTHER if commands is None else OTHER.replace(commands.extruder.encode(), b"")
        brackets = self.state.profile.text.brackets
        feeds = commands is not None and commands.feeds(data, brackets=brackets)
        self.extrusion = Extrusion(commands) if commands is not None and feeds else None
        self.feeding = self.whole = np.zeros(0, bool)
        translator = profile.translator
        if profile.spindle_words:
            from olp.program.rs274.spindle_words import translate

            translator = translate
        self.translation = Translation(data) if translator is None else translator(whole(data))

    def run(self) -> Program:
        data = self.translation.text
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError(
                "the text is UTF-16; expected one byte per character; save it as plain text",
                line=1,
                code="OLP502",
            )
        if data[:3] == b"\xef\xbb\xbf":
            # the lexer reads a byte order mark as blanks; it stays in the text
            data = b"   " + data[3:]
        try:
            for chunk in chunks(data, self.state.profile.text, tell=self.options.tell):
                self._chunk(chunk)
        except ProgramError as error:
            from olp.program.origin import origin_of
            from olp.program.rs274.departures import name

            name(error, self.left, self.state.profile, origin_of(self.data))
            raise
        self.modes.check_end()
        return self.collector.program(self.state, self.end_line, self.translation.closings)

    # -- one chunk ---------------------------------------------------------------------------------

    def _chunk(self, chunk: WordChunk) -> None:
        base = self.collector.word_count
        self.collector.put_words(chunk)
        self.payloads = self.switches.follow(chunk)
        last = self.modes.program_end(chunk)
        if not last:
            return
        self.end_line = chunk.first_line + last
        active = np.arange(len(chunk.line_start)) < last
        before_end = active.copy()
        if self.options.block_delete:
            active &= ~chunk.deleted
        odd = check_odd(self.data, chunk, before_end, active, self.state)
        context = self.modes.read(chunk, base, active)
        # a code that is not read says more than its words, which no other code uses
        check_codes(context, self.state.profile)
        self.modes.check_rules(context)
        # a payload makes a new frame, from the motion of its own line on
        context.event[[line for line in self.payloads if active[line]]] = True
        self.lost = self._lost(context, odd)
        if self.extrusion is not None:
            self._extrude(context)
        beside = Beside(self.translation, context, self.state, last)
        central = beside.central
        if central.size:
            # for these lines alone, whatever the mode is
            mode = context.arc_distance.copy()
            context.arc_distance[central] = 901
        directed = self.state.profile.directed
        blocks = gather(chunk, context.motion, context.consumed, self.others, directed=directed)
        self._stretches(context, blocks, beside)
        if central.size:
            context.arc_distance[:] = mode
        self.modes.leave(context, last - 1)
        self.cycle_blocks.leave(context, last - 1)

    def _lost(self, context: Context, odd: list[Odd]) -> set[int]:
        """The lines of a chunk after which no position is known, which are events."""
        codes = context.codes
        lines = {*(each.line for each in odd), *codes.line[codes.act == Act.CONTROL].tolist()}
        context.event[list(lines)] = True
        for each in odd:
            if each.macro:
                macro = (
                    f"{each.macro} is a macro of the machine: no position is known after it, and modes stay"
                )
                self.collector.remarks.setdefault("macro", (context.number(each.line), macro))
        return lines

    def _extrude(self, context: Context) -> None:
        """Follow the extruder: which lines of a chunk feed material, and how its words are shared out."""
        assert self.extrusion is not None
        chunk = context.chunk
        tools = chunk.line[(chunk.letter == ord("T")) & own_words(chunk)]
        lost = np.array(sorted({*self.lost, *tools.tolist()}), np.int64)
        homes = context.codes.line[context.codes.act == Act.CONTROL]
        extruder = self.extrusion.follow(context, lost[~is_in(lost, homes)])
        self.feeding, self.whole = extruder.feeding, np.isnan(extruder.before) & (extruder.word >= 0)
        self.collector.put_shared(extruder, context.base)

    # -- stretches between events ------------------------------------------------------------------

    def _rows(
        self, context: Context, blocks: Blocks, calls: Mask, cycles: tuple[dict[int, Ends], CycleWords]
    ) -> Rows:
        """The rows of a chunk. No block may be put behind lines (of the chunk,) whose motion `calls` a
        cycle."""
        line, deleted = blocks.line, context.chunk.deleted
        motion = context.motion[line]
        kind = _KIND[motion]
        number = line + (context.chunk.first_line + 1)
        incremental = context.distance[line] == INCREMENTAL
        flag = np.where(incremental, np.uint8(Flag.INCREMENTAL), np.uint8(0))
        thread = motion == THREAD
        still = number[thread & ~is_in(context.spindle[line], (3, 4))]
        if still.size:
            why = "G33 needs a turning spindle; give M3 or M4 before it"
            raise ProgramError(why, line=int(still[0]), code="OLP518")
        # a second block behind a thread would wait for the spindle to come round
        flag[blocks.other | calls[line] | thread] |= np.uint8(Flag.WHOLE)
        flag[deleted[line]] |= np.uint8(Flag.DELETED)
        if self.extrusion is not None:
            # a straight move that feeds nothing is a travel
            travel = np.where(self.feeding[line], np.uint8(Kind.LINE), np.uint8(Kind.RAPID))
            kind = np.where(kind > Kind.LINE, kind, travel)
            flag[self.whole[line]] |= np.uint8(Flag.WHOLE)
        flag[context.feed_mode[line] == INVERSE_TIME] |= np.uint8(Flag.INVERSE_TIME)
        if self.switches:
            flag[self.switches.off(number)] |= np.uint8(Flag.PASS)
        word = blocks.slot
        if self.collector.keep_words:
            word = np.where(word >= 0, word + context.base, -1)
        frame, plane = np.zeros(len(blocks), np.int32), context.plane[line]
        return Rows(blocks, frame, *cycles, number, plane, kind, flag, word, incremental)

    def _stretches(self, context: Context, blocks: Blocks, beside: Beside) -> None:
        chunk, state, event = context.chunk, self.state, context.event
        special = event | beside.lines
        rows = self._rows(context, blocks, beside.calls, runs(context, blocks, special))
        motion = context.motion[blocks.line]
        alone, first = _ALONE[motion], _PROBES[motion]
        first[list(rows.runs)] = True
        special[blocks.line[first]] = True
        lines = np.flatnonzero(special)
        stated = event_words(context, lines[(event | beside.lines)[lines]])
        for line, upto, here, changes, calls, deleted, distance, plane, word in _of_lines(
            context, blocks, beside, lines
        ):
            if upto > rows.assigned:
                self._assign(context, rows, upto)
            if not changes:
                # a run of cycles may have been carried out together with one before
                if upto >= rows.resolved:
                    self._alone(context, rows, upto, Effect())
                continue
            number = chunk.first_line + line + 1
            block = event_block(next(stated), number, state.profile, self.known, deleted=deleted)
            if calls:
                block = beside.numbered(number, block)
            lost, payload = line in self.lost, line in self.payloads
            plain = not (calls or payload or lost or state.compensation)
            if block.quiet and plain and not (here and alone[upto]):
                state.pause(number, block)
                continue
            if payload or not block.keeps_frame:
                rows.present = None
            moved, place = state.moved_by(block.m_codes)
            if moved:
                self.left.append((number, moved, place, block))
            lost = lost or state.changes_nozzle(block.words)
            if lost:
                moved, place = (0, 1, 2), state.home_of(block.words)
            # where nothing says where the axes stand then, it is found together with the rows around it
            loose = moved == (0, 1, 2) and place == UNKNOWN and not lost
            stands = None
            if (moved and not loose) or lost or calls or (block.of_place and self._needs_moves(block)):
                self._resolve(context, rows, upto)
            elif block.of_place and self._stores_position(block):
                stands = self._stands(context, rows, upto)
            state.distance, state.plane = distance, plane
            if payload:
                state.payload_kg = self.payloads[line]
            state.first_word = context.base + word
            before = state.position.copy()
            if stands is not None:
                state.position[:] = stands
            effect = state.run(number, block, self.collector.moves + rows.waiting(upto))
            if stands is not None:
                state.position[:] = before
            if loose and rows.resolved < upto:
                rows.own.append(self.special_blocks.own_move(number, upto, deleted=deleted))
                state.position[:], moved = before, ()
            if lost:
                state.lose(number)
            if calls and beside.act(line):
                rows.present = None
                if beside.forgets(line):
                    moved, place = (0, 1, 2), UNKNOWN
            if moved or effect.lost:
                self.special_blocks.control_move(number, deleted=deleted)
            if moved and not effect.lost and effect.home is None:
                self.special_blocks.stand(number, moved, place, deleted=deleted)
            if here and (alone[upto] or effect.home is not None or effect.machine):
                self._alone(context, rows, upto, effect)
            if effect.home is not None:
                self.left.append((number, effect.home, effect.home_mm, block))
                state.forget(effect.home)
                self.special_blocks.control_move(number, deleted=deleted)
                if not moved:
                    self.special_blocks.stand(number, effect.home, effect.home_mm, deleted=deleted)
            if calls:
                self._call(context, rows, upto + here, beside, line)
        if len(blocks) > rows.assigned:
            self._assign(context, rows, len(blocks))
        self._resolve(context, rows, len(blocks))

    def _needs_moves(self, block: EventBlock) -> bool:
        """Whether the moves before an event have to be there: it goes on from where they end, or the numbers
        before it count by another unit."""
        codes = block.events
        if not APART.isdisjoint(codes):
            return True
        return not _UNITS.isdisjoint(codes) and self.state.bare_increments

    def _stores_position(self, block: EventBlock) -> bool:
        """Whether an event stores where the axes stand, and leaves them there."""
        if WRITE_OFFSET in block.events:
            stores = any(w.letter == "L" and round(w.value) == STORES_POSITION for w in block.words)
            return stores and self.state.profile.g10_stores
        return PRESET in block.events

    def _stands(self, context: Context, rows: Rows, upto: int) -> list[float] | None:
        """Where the axes stand before row `upto`, which the state says where it is None. Where the row before
        it says that alone, its moves need not be there."""
        last, state = upto - 1, self.state
        if last < rows.resolved:
            return None
        slot = rows.blocks.slot[last].tolist()
        own = bool(rows.own) and rows.own[-1].row == upto
        if own or self.turn is not None or rows.incremental[last] or min(slot) < 0 or rows.kind[last] == 255:
            self._resolve(context, rows, upto)
            return None
        frame = state.frames[int(rows.frame[last])]
        value = scaled(context, state, self.collector.remarks)
        return [
            float(value[k]) * frame.unit_mm + shift for k, shift in zip(slot, frame.offset_mm, strict=True)
        ]

    def _alone(self, context: Context, rows: Rows, row: int, effect: Effect) -> None:
        """Carry out one row singly, or a run of canned cycles, after the rows before it."""
        self._resolve(context, rows, row)
        stop, joined = rows.runs.get(row, (row + 1, row + 1))
        self._assign(context, rows, row + 1)
        if self.turn is None and self.state.offsets.plane is None and joined > stop:
            stop, self.state.last_frame = joined, int(rows.frame[row])
        self._assign(context, rows, stop)
        rows.resolved = stop
        if row in rows.runs and effect.home is None and not effect.machine:
            self.cycle_blocks.run(context, rows, slice(row, stop))
        else:
            line, frame = int(rows.blocks.line[row]), int(rows.frame[row])
            self.special_blocks.run(context, line, rows.blocks.slot[row : row + 1], frame, effect)

    def _call(self, context: Context, rows: Rows, upto: int, beside: Beside, line: int) -> None:
        """Make the hole of a cycle that is called behind the motion of its block."""
        drilling = beside.drilling(line, moves=upto > rows.resolved)
        if drilling is None:
            return
        self._assign(context, rows, upto)
        self._resolve(context, rows, upto)
        self.special_blocks.drill(context.number(line), drilling, deleted=bool(context.chunk.deleted[line]))

    def _assign(self, context: Context, rows: Rows, upto: int) -> None:
        """Give the present frame to the rows since the last event."""
        if upto > rows.assigned:
            first = int(rows.blocks.line[rows.assigned])
            if rows.present is None:
                rows.present = self.state.frame(context.number(first))
                if self.state.frames[rows.present].turn != self.turn:
                    # what is resolved at once has one turn
                    self._resolve(context, rows, rows.assigned)
                    self.turn = self.state.frames[rows.present].turn
            rows.frame[rows.assigned : upto] = rows.present
            if self.state.unit is None:
                self.collector.remarks.setdefault("unit", (context.number(first), "mm"))
            rows.assigned = upto

    def _resolve(self, context: Context, rows: Rows, upto: int) -> None:
        """Positions, kinds and arcs of the plain rows up to `upto`."""
        a, rows.resolved = rows.resolved, max(upto, rows.resolved)
        if upto <= a:
            return
        blocks, state = rows.blocks, self.state
        number, kind, frame = rows.number[a:upto], rows.kind[a:upto], rows.frame[a:upto]
        if (kind == 255).any():
            rows_without = np.flatnonzero(kind == 255)
            ended = context.motion[blocks.line[a:upto][rows_without]] >= 0
            raise ProgramError.together(map(_no_motion, number[rows_without].tolist(), ended.tolist()))
        incremental, flag = rows.incremental[a:upto], rows.flag[a:upto]
        slot, word = blocks.slot[a:upto], rows.word[a:upto]
        check_frames(state, number, incremental, rows.plane[a:upto], frame)
        lost = np.array([own.row - a for own in rows.own], np.int64)
        if lost.size:
            # one column of places, along which the others are taken: an insertion is ten times as slow
            order = np.insert(np.arange(upto - a), lost, 0)
            lost += np.arange(len(lost))
            number, flag, frame = number[order], flag[order], frame[order]
            kind, incremental, slot, word = kind[order], incremental[order], slot[order], word[order]
            own = np.array([(own.line, own.flag, own.frame) for own in rows.own])
            number[lost], flag[lost], frame[lost] = own.T
            kind[lost], incremental[lost], slot[lost], word[lost] = Kind.RAPID, False, 0, -1
            rows.own.clear()
        offset, unit = self._offsets(frame)
        value = scaled(context, state, self.collector.remarks)
        turning = Turning.of(self.turn)
        tilted = state.offsets.plane is not None
        start = state.along.of(self.turn, state.position) if tilted else along_words(turning, state.position)
        if turning is not None:
            offset = turning.words(offset)
        steps = incremental if incremental.any() else None
        end = fill(slot, value, steps, offset, unit, start, lost)
        if len(blocks.arc_row):
            arcs = slice(*np.searchsorted(blocks.arc_row, (a, upto)))
            if arcs.stop > arcs.start:
                point = np.vstack((start, end))
                row = blocks.arc_row[arcs] - a
                row += (lost - np.arange(len(lost))).searchsorted(row, "right")
                kind = self._arcs(context, rows, arcs, row, kind, point, value, offset, unit)
        last = end[-1]
        if turning is not None:
            end = turning.axes(end)
        self.collector.put_moves(kind, flag, number, frame, end, word)
        state.position[:] = end[-1].tolist()
        if tilted:
            state.along.put(self.turn, state.position, last)

    def _arcs(
        self,
        context: Context,
        rows: Rows,
        arcs: slice,
        row: Index,
        kind: npt.NDArray[np.uint8],
        point: Array,
        value: Array,
        offset: Array,
        unit: Array | float,
    ) -> npt.NDArray[np.uint8]:
        """Put the arcs, the moves `row` among those that lead from point to point (n + 1, 3) along the words;
        returns the kinds of all moves for the axes."""
        blocks = rows.blocks
        words = blocks.arc_slot[arcs]
        line = blocks.line[blocks.arc_row[arcs]]
        number = line + (context.chunk.first_line + 1)
        size = np.where(words >= 0, value[words], np.nan)
        size[:, 4] += bool(self.state.profile.further_turns)
        size[:, :4] *= unit if isinstance(unit, float) else unit[row, None]
        _check_centres(context, line, words)
        absolute = context.arc_distance[line] == 901
        plane = np.array([PLANE_OF[p] for p in (170, 180, 190)])[(context.plane[line] - 170) // 10]
        centre, sweep = arc_geometry(
            point[row],
            point[row + 1],
            size,
            clockwise=context.motion[line] == 20,
            plane=plane,
            absolute=absolute,
            offset=np.broadcast_to(offset, (len(point) - 1, 3))[row],
            line=number,
        )
        turning = Turning.of(self.turn)
        if turning is not None:
            tilted = self.state.offsets.plane is not None
            kind, centre, sweep = turning.arcs(kind, row, centre, sweep, plane, number, tilted=tilted)
        slot = np.where(words >= 0, words + context.base, -1)
        self.collector.put_worded_arcs(row + self.collector.moves, centre, plane, sweep, slot, absolute)
        return kind

    def _offsets(self, frame: npt.NDArray[np.int32]) -> tuple[Array, Array | float]:
        """Offsets and units in mm: (3,) and one where they are the same for all rows, else (n, 3), (n,)."""
        frames = self.state.frames
        if (frame == frame[0]).all():
            one = frames[int(frame[0])]
            return np.array(one.offset_mm), one.unit_mm
        used, which = np.unique(frame, return_inverse=True)
        table = np.array([(*frames[i].offset_mm, frames[i].unit_mm) for i in used.tolist()])[which]
        return table[:, :3], table[:, 3]


def _of_lines(context: Context, blocks: Blocks, beside: Beside, line: Index) -> Iterator[tuple[Any, ...]]:
    """By lines (n,) the first row not before each, and whether that is its own. Then whether it changes
    anything, calls, and is deleted. Last the distance mode, the plane and the first word."""
    chunk, calls = context.chunk, beside.lines[line]
    first, behind = (blocks.line.searchsorted(line, side) for side in ("left", "right"))
    columns = (
        line, first, behind > first, context.event[line] | calls, calls, chunk.deleted[line],
        context.distance[line], context.plane[line], chunk.first_word[line],
    )  # fmt: skip
    return zip(*(column.tolist() for column in columns), strict=True)


def _check_centres(context: Context, line: Index, words: Index) -> None:
    """Refuse arcs with centre words where a setting of the control, which is not stated, decides of them."""
    open_ones = (context.arc_distance[line] < 0) & any_in_row(words[:, :3] >= 0)
    if open_ones.any():
        raise ProgramError(
            "I, J and K of this arc are distances or positions by a setting of the control; give G91.1 or "
            'G90.1 before it, or state arc_centres = "incremental" or "absolute" in the machine file',
            line=context.number(int(line[np.argmax(open_ones)])),
            code="OLP532",
        )


def _no_motion(line: int, ended: bool) -> ProgramError:
    """Of a block behind G80, where a code `ended`, or before any code."""
    stated = "" if ended else ' before it, or motion = "G0" or "G1" in [job_defaults] of the machine file'
    return ProgramError(
        f"a block has axis words, but no motion code is in force; expected G0, G1, G2 or G3{stated}",
        line=line,
        code="OLP517",
    )
