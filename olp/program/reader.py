"""Reads RS-274 and ISO 6983 text: bytes to a nominal toolpath and the words that can be edited.

The way of a chunk of lines: lexer columns -> modal codes per line -> motion lines -> stretches between
events, each resolved in bulk (`motion`), with the blocks that change frames or need the present position
carried out one by one (`state`). Nothing here knows an error model.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.exceptions import ProgramError
from olp.geometry import PLANES
from olp.machine import Setup
from olp.program.columns import Columns
from olp.program.cycles import hole_moves, levels
from olp.program.lexer import WordChunk, chunks
from olp.program.motion import Array, Blocks, Index, Mask, arc_geometry, fill, gather, modal, values
from olp.program.profiles import CUTTER_COMPENSATION, CYCLES, PROBES, Act, Profile
from olp.program.program import ArcSlots, Hole, Program, Words
from olp.program.state import NAN, Effect, State, Word
from olp.toolpath import Arcs, Flag, Frame, Kind, Toolpath

_SWITCH = re.compile(rb"[(;][ \t]*olp (off|on)\b", re.IGNORECASE)
_FLOW = re.compile(rb"[#\[=<]|^/?\s*O|^\W*N?\d*\s*(IF|WHILE|GOTO|END|DO)", re.IGNORECASE)
#: motion code to kind of move; 255 where it is not plain motion, the last entry standing for "none yet"
_KIND = np.full(1001, 255, np.uint8)
_KIND[[0, 10, 20, 30]] = (Kind.RAPID, Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW)
_ALONE = np.array(sorted(CYCLES | PROBES))
_LENGTHS = np.zeros(256, bool)
_LENGTHS[list(b"XYZIJKRQ")] = True
_M_REFUSED = {
    700: "saves modal codes", 710: "forgets saved modal codes", 720: "restores modal codes",
    730: "saves modal codes", 960: "branches", 970: "calls a subprogram", 980: "calls a subprogram",
    990: "repeats the program",
}  # fmt: skip
_PLANE = {170: 0, 180: 1, 190: 2}


@dataclass(frozen=True, slots=True)
class Options:
    """How a program is to be read: `block_delete` leaves `/` blocks out; `contour` takes the contour under
    G41/G42 as the tool path."""

    block_delete: bool = False
    contour: bool = False


def read(
    data: bytes, setup: Setup, profile: Profile, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    right.

    Without `words` the columns that only writing needs are left out.
    """
    return _Reader(data, setup, profile, options or Options(), words).run()


@dataclass(frozen=True, slots=True, eq=False)
class _Codes:
    """The G words of a chunk: line, code x 10, what it does."""

    line: Index
    code: Index
    act: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class _Context:
    """A chunk with its numbers and the modal codes in force on each line; `base` is its first word's
    index."""

    chunk: WordChunk
    value: Array
    base: int
    codes: _Codes
    motion: npt.NDArray[np.int16]
    plane: npt.NDArray[np.int16]
    distance: npt.NDArray[np.int16]
    arc_distance: npt.NDArray[np.int16]
    feed: npt.NDArray[np.int16]
    retract: npt.NDArray[np.int16]


@dataclass(slots=True, eq=False)
class _Rows:
    """The motion lines of a chunk on their way: how many have a frame, how many a position."""

    blocks: Blocks
    frame: npt.NDArray[np.int32]
    assigned: int = 0
    resolved: int = 0


#: Events whose axis words are not motion: G10 G52 G92 G43.1
_CLAIMS = (100, 520, 920, 921, 922, 923, 431)
#: Events that need the present position
_POSITION = (100, 280, 300, 530, 920)


class _Reader:
    """One reading of one program; collects columns chunk by chunk."""

    def __init__(self, data: bytes, setup: Setup, profile: Profile, options: Options, words: bool) -> None:
        self.data = data
        self.profile = profile
        self.options = options
        self.keep_words = words
        self.state = State.at_start(setup, profile)
        x, y, z = self.state.position
        self.start = (x, y, z)
        self.act = np.full(2000, Act.REFUSE, np.int8)
        for code, act in profile.codes.items():
            self.act[code] = act
        if options.contour:
            self.act[list(CUTTER_COMPENSATION)] = Act.CARRY
        self.m_event = np.ones(10_001, bool)
        self.m_event[[m * 10 for m in profile.harmless_m]] = False
        self.columns = Columns(len(data) // 3)
        self.moves = self.arcs = self.word_count = 0
        self.holes: list[Hole] = []
        self.series = self.series_initial = 0.0
        self.sticky: dict[str, float] = {}
        self.linear_motion = self.state.motion
        self.ended = self.tape = False
        self.end_line = 0
        self.remarks: dict[str, tuple[int, str]] = {}
        marked = b"olp o" in data or b"OLP O" in data
        switches = list(_SWITCH.finditer(data)) if marked else []
        self.switch_lines = [data.count(b"\n", 0, m.start()) for m in switches]
        self.switch_off = [m.group(1).lower() == b"off" for m in switches]

    def run(self) -> Program:
        data = self.data
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError(
                "the text is UTF-16; expected one byte a character; save it as plain text", line=1
            )
        if data[:3] == b"\xef\xbb\xbf":
            # a byte order mark is blank to the lexer, and stays where it is
            data = b"   " + data[3:]
        for chunk in chunks(data):
            self._chunk(chunk)
        return self._program()

    # -- one chunk ---------------------------------------------------------------------------------

    def _chunk(self, chunk: WordChunk) -> None:
        base = self.word_count
        self._put_words(chunk)
        lines = len(chunk.line_start)
        last = self._program_end(chunk, 0 if self.ended else lines)
        if not last:
            return
        self.end_line = chunk.first_line + last
        active = np.arange(lines) < last
        if self.options.block_delete:
            active &= ~chunk.deleted
        self._check_odd(chunk, active)
        letter, line, value = chunk.letter, chunk.line, values(chunk)
        usable = active[line]
        g = np.flatnonzero((letter == 71) & usable)
        code = np.clip(np.rint(value[g] * 10), 0, 1999).astype(np.int64)
        line_of = line[g]
        act = self.act[code]
        act[np.abs(code - value[g] * 10) > 1e-6] = Act.REFUSE
        codes = _Codes(line_of, code, act)
        state = self.state
        context = _Context(
            chunk,
            value,
            base,
            codes,
            motion=self._motion(chunk, codes),
            plane=self._modal(chunk, codes, Act.PLANE, state.plane),
            distance=self._modal(chunk, codes, Act.DISTANCE, state.distance),
            arc_distance=self._modal(chunk, codes, Act.ARC_DISTANCE, state.arc_distance),
            feed=self._modal(chunk, codes, Act.FEED, state.feed),
            retract=self._modal(chunk, codes, Act.RETRACT, state.retract),
        )
        self._check_deleted(context, active)
        event = np.zeros(lines, bool)
        event[line_of[(act == Act.EVENT) | (act == Act.REFUSE)]] = True
        m = np.flatnonzero((letter == 77) & usable)
        event[line[m[self.m_event[np.clip(np.rint(value[m] * 10), 0, 10_000).astype(np.int64)]]]] = True
        event[line[(letter == 84) & usable]] = True
        consumed = ~active
        claims = (*_CLAIMS, 40) if self.profile.cycles_apart else _CLAIMS
        consumed[line_of[(act == Act.EVENT) & np.isin(code, claims)]] = True
        self._stretches(context, gather(chunk, context.motion, consumed), event)
        tail = last - 1
        state.plane, state.distance = int(context.plane[tail]), int(context.distance[tail])
        state.arc_distance, state.feed = int(context.arc_distance[tail]), int(context.feed[tail])
        state.retract = int(context.retract[tail])
        state.motion = None if context.motion[tail] < 0 else int(context.motion[tail])

    def _modal(self, chunk: WordChunk, codes: _Codes, which: Act, now: int | None) -> npt.NDArray[np.int16]:
        chosen = codes.act == which
        return self._in_force(chunk, codes.line[chosen], codes.code[chosen], now)

    def _in_force(self, chunk: WordChunk, at: Index, code: Index, now: int | None) -> npt.NDArray[np.int16]:
        if (at[1:] == at[:-1]).any():
            twice = int(at[1:][at[1:] == at[:-1]][0])
            raise ProgramError(
                "two G codes of the same modal group stand in this block; a control takes one",
                line=chunk.first_line + twice + 1,
            )
        return modal(len(chunk.line_start), at, code, -1 if now is None else now)

    def _motion(self, chunk: WordChunk, codes: _Codes) -> npt.NDArray[np.int16]:
        chosen = codes.act == Act.MOTION
        at, code = codes.line[chosen], codes.code[chosen]
        if (code == 800).any():
            # G80 may stand beside another motion code, which wins
            beside = np.isin(at, at[1:][at[1:] == at[:-1]])
            at, code = at[~(beside & (code == 800))], code[~(beside & (code == 800))]
        if self.profile.cycles_apart:
            # cycles are a group of their own: a lone G80 hands back to the last of G0 to G3
            code = code.copy()
            for i, c in enumerate(code.tolist()):
                if c == 800:
                    code[i] = -1 if self.linear_motion is None else self.linear_motion
                elif c < 330:
                    self.linear_motion = c
        return self._in_force(chunk, at, code, self.state.motion)

    def _program_end(self, chunk: WordChunk, last: int) -> int:
        """The number of lines up to the end of the program: M2, M30, or the second tape mark."""
        ends = chunk.line[(chunk.letter == 77) & np.isin(chunk.mantissa, (2, 30)) & (chunk.decimals == 0)]
        if self.options.block_delete:
            ends = ends[~chunk.deleted[ends]]
        if ends.size and ends[0] < last:
            if chunk.deleted[ends[0]]:
                raise ProgramError(
                    "block delete decides here whether the program ends; expected one end for both switch "
                    "positions",
                    line=chunk.first_line + int(ends[0]) + 1,
                )
            last, self.ended = int(ends[0]) + 1, True
        for mark in chunk.marks.tolist():
            if mark >= last:
                break
            if not self.tape and chunk.first_line == 0 and not chunk.first_word[mark]:
                self.tape = True
            else:
                last, self.ended = mark, True
        return last

    def _check_odd(self, chunk: WordChunk, active: Mask) -> None:
        for line in chunk.odd.tolist():
            if not active[line]:
                continue
            text = self.data[chunk.line_start[line] : chunk.line_end[line]].strip()
            number = chunk.first_line + line + 1
            shown = text[:60].decode("latin-1")
            if _FLOW.search(text):
                raise ProgramError(
                    f"`{shown}` uses parameters, expressions or flow control; unroll the program with "
                    "--flatten",
                    line=number,
                )
            raise ProgramError(
                f"`{shown}` is not understood and may move the machine; expected words of a letter and a "
                "number",
                line=number,
            )

    def _check_deleted(self, context: _Context, active: Mask) -> None:
        """A `/` block must not change how later blocks are read, unless the next block restates it."""
        chunk, state = context.chunk, self.state
        deleted = np.flatnonzero(chunk.deleted & active)
        pairs = (
            (context.motion, -1 if state.motion is None else state.motion),
            (context.plane, state.plane),
            (context.distance, state.distance),
            (context.arc_distance, state.arc_distance),
            (context.feed, state.feed),
            (context.retract, state.retract),
        )
        for line in deleted.tolist():
            following = line + 1
            while following < len(chunk.deleted) and chunk.deleted[following]:
                following += 1
            restated = (context.codes.line == following) & (context.codes.act == Act.MOTION)
            for which, (mode, carry) in enumerate(pairs):
                before = mode[line - 1] if line else carry
                if mode[line] != before and not (which == 0 and restated.any()):
                    raise ProgramError(
                        "a block under block delete changes a modal code that later blocks depend on; "
                        "restate the code in the next block or remove the `/`",
                        line=chunk.first_line + line + 1,
                    )

    # -- stretches between events ------------------------------------------------------------------

    def _stretches(self, context: _Context, blocks: Blocks, event: Mask) -> None:
        chunk, state = context.chunk, self.state
        rows = _Rows(blocks, np.zeros(len(blocks), np.int32))
        alone = np.isin(context.motion[blocks.line], _ALONE)
        special = event.copy()
        special[blocks.line[alone]] = True
        for at in np.flatnonzero(special).tolist():
            upto = int(np.searchsorted(blocks.line, at))
            here = upto < len(blocks) and blocks.line[upto] == at
            self._assign(context, rows, upto)
            if not event[at]:
                self._resolve(context, rows, upto)
                self._alone(context, rows, upto, Effect())
                continue
            number = chunk.first_line + at + 1
            words = self._words(context, at)
            mine = slice(
                np.searchsorted(context.codes.line, at), np.searchsorted(context.codes.line, at, "right")
            )
            codes = self._checked(context.codes.code[mine], context.codes.act[mine], words, number)
            self._check_deleted_event(chunk, at, codes, words, number)
            moved = any(state.may_move(round(w.value * 10)) for w in words if w.letter == "M")
            if moved or any(c in _POSITION for c in codes):
                self._resolve(context, rows, upto)
            state.distance = int(context.distance[at])
            effect = state.run(number, words, codes, self.moves)
            if moved:
                self._control_move(number, chunk, at)
            if here and (alone[upto] or effect.home or effect.machine):
                self._resolve(context, rows, upto)
                self._alone(context, rows, upto, effect)
            if effect.home:
                for axis in effect.home:
                    state.position[axis] = NAN
                self._control_move(number, chunk, at)
        self._assign(context, rows, len(blocks))
        self._resolve(context, rows, len(blocks))

    def _checked(
        self, code: Index, act: npt.NDArray[np.int8], words: list[Word], line: int
    ) -> list[int]:
        """The event codes of a block; refuses those that cannot be read right."""
        for c, a in zip(code.tolist(), act.tolist(), strict=True):
            if a == Act.REFUSE:
                why = self.profile.refusals.get(c)
                name = f"G{c / 10:g}"
                if c in CUTTER_COMPENSATION:
                    why = f"{why}; program the tool path, or take the contour as tool path with --contour"
                raise ProgramError(
                    why or f"{name} is not known to the {self.profile.name} profile and may move the machine",
                    line=line,
                )
        for word in words:
            m = round(word.value * 10)
            if word.letter == "M" and m in _M_REFUSED:
                raise ProgramError(
                    f"M{m / 10:g} {_M_REFUSED[m]}; unroll the program with --flatten", line=line
                )
        return [c for c, a in zip(code.tolist(), act.tolist(), strict=True) if a == Act.EVENT]

    def _check_deleted_event(
        self, chunk: WordChunk, at: int, codes: list[int], words: list[Word], line: int
    ) -> None:
        changes = set(codes) - {40, 280, 300, 530} or any(
            w.letter == "M" and w.value in (6, 61) for w in words
        )
        if chunk.deleted[at] and changes:
            raise ProgramError(
                "a block under block delete changes offsets, units, path mode or the tool, so later blocks "
                "depend on the switch; remove the `/`",
                line=line,
            )

    def _words(self, context: _Context, line: int) -> list[Word]:
        chunk = context.chunk
        span = range(int(chunk.first_word[line]), int(chunk.first_word[line + 1]))
        return [
            Word(chr(chunk.letter[i]), float(context.value[i]), context.base + i, bool(chunk.pointed[i]))
            for i in span
        ]

    def _assign(self, context: _Context, rows: _Rows, upto: int) -> None:
        """Give the present frame to the rows that came since the last event."""
        if upto > rows.assigned:
            line = int(rows.blocks.line[rows.assigned]) + context.chunk.first_line + 1
            rows.frame[rows.assigned : upto] = self.state.frame(line)
            if not self.state.unit_stated:
                self.remarks.setdefault("unit", (line, "mm"))
            rows.assigned = upto

    def _resolve(self, context: _Context, rows: _Rows, upto: int) -> None:
        """Positions, kinds and arcs of the plain rows up to `upto`."""
        a, rows.resolved = rows.resolved, max(upto, rows.resolved)
        if upto <= a:
            return
        chunk, blocks, state = context.chunk, rows.blocks, self.state
        line = blocks.line[a:upto]
        number = line + (chunk.first_line + 1)
        motion = context.motion[line]
        kind = _KIND[np.maximum(motion, -1)]
        if (kind == 255).any():
            i = int(np.flatnonzero(kind == 255)[0])
            self._refuse_motion(int(motion[i]), int(number[i]))
        incremental = context.distance[line] == 910
        frame = rows.frame[a:upto]
        offset, unit = self._offsets(frame)
        value = self._scaled(context)
        slot = blocks.slot[a:upto]
        end = fill(slot, value, incremental if incremental.any() else None, offset, unit, state.position)
        flag = np.where(incremental, np.uint8(Flag.INCREMENTAL), np.uint8(0))
        flag[blocks.other[a:upto]] |= np.uint8(Flag.WHOLE)
        flag[chunk.deleted[line]] |= np.uint8(Flag.DELETED)
        inverse = context.feed[line] == 930
        if inverse.any():
            flag[inverse] |= np.uint8(Flag.INVERSE_TIME)
        if self.switch_lines:
            before = np.searchsorted(self.switch_lines, number - 1, "right")
            off = np.concatenate(([False], self.switch_off))[before]
            flag[off] |= np.uint8(Flag.PASS)
        arcs = slice(*np.searchsorted(blocks.arc_row, (a, upto)))
        if arcs.stop > arcs.start:
            self._arcs(context, rows, arcs, a, end, value, offset, unit)
        self._put_moves(kind, flag, number, frame, end, np.where(slot >= 0, slot + context.base, -1))
        state.position[:] = end[-1].tolist()

    def _arcs(
        self,
        context: _Context,
        rows: _Rows,
        arcs: slice,
        a: int,
        end: Array,
        value: Array,
        offset: Array,
        unit: Array | float,
    ) -> None:
        blocks = rows.blocks
        row = blocks.arc_row[arcs] - a
        words = blocks.arc_slot[arcs]
        line = blocks.line[blocks.arc_row[arcs]]
        start = np.where(row[:, None] > 0, end[np.maximum(row - 1, 0)], np.array(self.state.position))
        size = np.where(words >= 0, value[words], np.nan)
        size[:, :4] *= np.asarray(unit)[row] if np.ndim(unit) else unit
        absolute = context.arc_distance[line] == 901
        plane = np.array([_PLANE[p] for p in (170, 180, 190)])[(context.plane[line] - 170) // 10]
        cw = context.motion[line] == 20
        centre, sweep = arc_geometry(
            start,
            end[row],
            size,
            clockwise=cw,
            plane=plane,
            absolute=absolute,
            offset=np.broadcast_to(offset, end.shape)[row],
            line=line + (context.chunk.first_line + 1),
        )
        self._put_arcs(
            row + self.moves, centre, plane, sweep, np.where(words >= 0, words + context.base, -1), absolute
        )

    def _offsets(self, frame: npt.NDArray[np.int32]) -> tuple[Array, Array | float]:
        frames = self.state.frames
        if (frame == frame[0]).all():
            one = frames[int(frame[0])]
            return np.array(one.offset_mm), one.unit_mm
        offsets = np.array([f.offset_mm for f in frames])
        units = np.array([f.unit_mm for f in frames])
        return offsets[frame], units[frame][:, None]

    def _scaled(self, context: _Context) -> Array:
        """Numbers as written, in program units: without a decimal point they count increments on some
        controls."""
        if not self.state.bare_increments:
            return context.value
        bare = np.flatnonzero(~context.chunk.pointed & _LENGTHS[context.chunk.letter])
        if not bare.size:
            return context.value
        out = context.value.copy()
        for letter in np.unique(context.chunk.letter[bare]).tolist():
            mine = bare[context.chunk.letter[bare] == letter]
            out[mine] *= self.state.increment(chr(letter))
        line = int(context.chunk.line[bare[0]]) + context.chunk.first_line + 1
        self.remarks.setdefault("increments", (line, ""))
        return out

    # -- blocks read one by one --------------------------------------------------------------------

    def _alone(self, context: _Context, rows: _Rows, row: int, effect: Effect) -> None:
        """A row that is a canned cycle, a probe, a G53 move or the way to G28's intermediate point."""
        chunk, state = context.chunk, self.state
        at = int(rows.blocks.line[row])
        number = chunk.first_line + at + 1
        rows.assigned = max(rows.assigned, row)
        self._assign(context, rows, row + 1)
        rows.resolved = row + 1
        frame = state.frames[int(rows.frame[row])]
        motion = int(context.motion[at])
        incremental = context.distance[at] == 910
        if motion in CYCLES and not effect.home and not effect.machine:
            self._cycle(context, rows, row, frame, motion, number, incremental=bool(incremental))
            return
        flag = Flag.DELETED if chunk.deleted[at] else Flag(0)
        kind = Kind.RAPID
        offset = np.array(frame.offset_mm)
        if effect.machine:
            if incremental:
                raise ProgramError("G53 names axis positions; expected G90, the block is in G91", line=number)
            if motion not in (0, 10):
                raise ProgramError("G53 goes with G0 or G1 only", line=number)
            kind = Kind(motion // 10)
            flag |= Flag.PASS | Flag.MACHINE
            offset = np.zeros(3)
        elif effect.home:
            flag |= Flag.PASS
        else:
            kind = Kind.PROBE
        if incremental:
            flag |= Flag.INCREMENTAL
        slot = rows.blocks.slot[row : row + 1]
        before = list(state.position)
        relative = np.array([True]) if incremental else None
        end = fill(slot, self._scaled(context), relative, offset, frame.unit_mm, before)
        self._put_moves(
            np.array([kind], np.uint8), np.array([flag], np.uint8), np.array([number]),
            rows.frame[row : row + 1], end, np.where(slot >= 0, slot + context.base, -1),
        )  # fmt: skip
        state.position[:] = end[0].tolist()
        if kind == Kind.PROBE:
            for i in range(3):
                if state.position[i] != before[i]:
                    state.position[i] = NAN
            self._control_move(number, chunk, at)

    def _cycle(
        self,
        context: _Context,
        rows: _Rows,
        row: int,
        frame: Frame,
        code: int,
        line: int,
        *,
        incremental: bool,
    ) -> None:
        state = self.state
        chunk = context.chunk
        at = int(rows.blocks.line[row])
        plane = _PLANE[int(context.plane[at])]
        previous = int(context.motion[at - 1]) if at else (state.motion or -1)
        first, second, third = PLANES[plane]
        if not (previous in CYCLES and self.holes and not _moved_since(self, self.holes[-1])):
            self.series += 1
            self.series_initial = state.position[third]
            self.sticky = {}
        elif previous != code:
            self.sticky = {}
        value = self._scaled(context)
        words = {
            chr(chunk.letter[i]): i for i in range(int(chunk.first_word[at]), int(chunk.first_word[at + 1]))
        }
        for letter in "RQ" + "XYZ"[third]:
            if letter in words:
                self.sticky[letter] = float(value[words[letter]]) * frame.unit_mm
        if "P" in words:
            self.sticky["P"] = float(value[words["P"]])
        missing = [letter for letter in ("R", "XYZ"[third]) if letter not in self.sticky]
        if missing:
            raise ProgramError(f"the cycle G{code / 10:g} has no {' and no '.join(missing)} word", line=line)
        repeats = words.get("L", words.get("K") if self.profile.name != "linuxcnc" else None)
        times = 1 if repeats is None else round(float(context.value[repeats]))
        if times < 1:
            raise ProgramError(
                "a canned cycle with zero repeats only stores values, which is not read yet", line=line
            )
        offset = frame.offset_mm
        z_word, r_word = self.sticky["XYZ"[third]], self.sticky["R"]
        if incremental:
            r, z = levels(r_word, z_word, absolute=False, initial_z=self.series_initial)
        else:
            r, z = r_word + offset[third], z_word + offset[third]
        place, step = [], []
        for axis in (first, second):
            letter = "XYZ"[axis]
            given = float(value[words[letter]]) * frame.unit_mm if letter in words else None
            step.append(given if incremental and given is not None else 0.0)
            held = state.position[axis]
            place.append(held if given is None else held + given if incremental else given + offset[axis])
        if any(np.isnan((*place, *state.position))):
            raise ProgramError(
                "a canned cycle starts where an axis has not been commanded yet; command X, Y and Z first, "
                "or give start_mm in the job file",
                line=line,
            )
        start = (state.position[0], state.position[1], state.position[2])
        flag = Flag.CYCLE | (Flag.DELETED if chunk.deleted[at] else Flag(0)) | self._switched(line)
        for repeat in range(times):
            try:
                strokes = hole_moves(
                    code, start=start, xy=(place[0], place[1]), r=r, z=z, q=self.sticky.get("Q"),
                    p=self.sticky.get("P"), retract_to_r=context.retract[at] == 990,
                    initial_z=self.series_initial, plane=17 + plane,
                    profile="linuxcnc" if self.profile.name == "linuxcnc" else "fanuc",
                )  # fmt: skip
            except ProgramError as error:
                raise ProgramError(error.message, line=line) from None
            moving = [s for s in strokes if s.kind in ("rapid", "feed")]
            count = len(moving)
            begin = self.moves
            self._put_moves(
                np.array([Kind.RAPID if s.kind == "rapid" else Kind.LINE for s in moving], np.uint8),
                np.full(count, flag, np.uint8),
                np.full(count, line),
                np.full(count, rows.frame[row]),
                np.array([s.point for s in moving], float).reshape(count, 3),
                np.full((count, 3), -1),
            )
            self.holes.append(
                Hole(
                    line=line, first=begin, last=self.moves,
                    words={letter: context.base + i for letter, i in words.items()}, plane=plane,
                    place_mm=(place[0], place[1]), r_mm=r, z_mm=z, initial_mm=self.series_initial,
                    incremental=incremental, repeat=repeat, repeats=times, series=int(self.series), code=code,
                )
            )  # fmt: skip
            start = moving[-1].point if moving else start
            place = [place[0] + step[0], place[1] + step[1]]
        state.position[:] = list(start)

    def _switched(self, line: int) -> Flag:
        """PASS in a section that `(olp off)` exempts."""
        k = int(np.searchsorted(self.switch_lines, line - 1, "right"))
        return Flag.PASS if k and self.switch_off[k - 1] else Flag(0)

    def _control_move(self, line: int, chunk: WordChunk, at: int) -> None:
        """A move of the control's own: some axes are unknown after it."""
        flag = Flag.PASS | Flag.CONTROL | (Flag.DELETED if chunk.deleted[at] else Flag(0))
        if not self.moves:
            x, y, z = self.state.position
            self.start = (x, y, z)
            return
        self._put_moves(
            np.array([Kind.RAPID], np.uint8),
            np.array([flag], np.uint8),
            np.array([line]),
            np.array([len(self.state.frames) - 1]),
            np.array([self.state.position]),
            np.full((1, 3), -1),
        )

    def _refuse_motion(self, code: int, line: int) -> None:
        if code in (-1, 800):
            raise ProgramError(
                "axis words stand in a block, but no motion code is in force; expected G0, G1, G2 or G3",
                line=line,
            )
        raise ProgramError(f"G{code / 10:g} is not read as motion", line=line)

    # -- columns -----------------------------------------------------------------------------------

    def _put_words(self, chunk: WordChunk) -> None:
        self.columns.put("line_start", chunk.line_start, np.int32)
        self.columns.put("line_end", chunk.line_end, np.int32)
        if self.keep_words:
            for name in ("letter", "mantissa", "decimals", "pointed"):
                column = getattr(chunk, name)
                self.columns.put(name, column, column.dtype)
            for name in ("start", "number", "end"):
                self.columns.put("word_" + name, getattr(chunk, name), np.int32)
            self.columns.put("first_word", chunk.first_word[:-1] + self.word_count, np.int32)
        self.word_count += len(chunk.letter)

    def _put_moves(
        self,
        kind: npt.NDArray[np.uint8],
        flag: npt.NDArray[np.uint8],
        line: npt.ArrayLike,
        frame: npt.ArrayLike,
        end: Array,
        slot: npt.ArrayLike,
    ) -> None:
        self.columns.put("kind", kind, np.uint8)
        self.columns.put("flag", flag, np.uint8)
        self.columns.put("line", line, np.int32)
        self.columns.put("frame", frame, np.int32)
        self.columns.put("end", end, np.float64)
        if self.keep_words:
            self.columns.put("slot", slot, np.int32)
        self.moves += len(kind)

    def _put_arcs(
        self, move: Index, centre: Array, plane: Index, sweep: Array, words: Index, absolute: Mask
    ) -> None:
        self.columns.put("arc_move", move, np.int64)
        self.columns.put("arc_centre", centre, np.float64)
        self.columns.put("arc_plane", plane, np.int8)
        self.columns.put("arc_sweep", sweep, np.float64)
        self.columns.put("arc_words", words, np.int32)
        self.columns.put("arc_absolute", absolute, np.bool_)

    def _program(self) -> Program:
        arcs = Arcs(
            self.columns.take("arc_move", np.int64),
            self.columns.take("arc_centre", np.float64, 3),
            self.columns.take("arc_plane", np.int8),
            self.columns.take("arc_sweep", np.float64),
        )
        path = Toolpath(
            kind=self.columns.take("kind", np.uint8),
            flag=self.columns.take("flag", np.uint8),
            line=self.columns.take("line", np.int32),
            frame=self.columns.take("frame", np.int32),
            end_mm=self.columns.take("end", np.float64, 3),
            frames=tuple(self.state.frames),
            arcs=arcs,
            start_mm=self.start,
        )
        words = None
        if self.keep_words:
            self.columns.put("first_word", [self.word_count], np.int32)
            words = Words(
                self.columns.take("letter", np.uint8),
                self.columns.take("mantissa", np.int64),
                self.columns.take("decimals", np.int8),
                self.columns.take("pointed", np.bool_),
                self.columns.take("word_start", np.int32),
                self.columns.take("word_number", np.int32),
                self.columns.take("word_end", np.int32),
                self.columns.take("first_word", np.int32),
            )
        return Program(
            data=self.data,
            profile=self.profile,
            toolpath=path,
            words=words,
            slot=self.columns.take("slot", np.int32, 3),
            arc_slots=ArcSlots(
                self.columns.take("arc_words", np.int32, 5), self.columns.take("arc_absolute", np.bool_)
            ),
            line_start=self.columns.take("line_start", np.int32),
            line_end=self.columns.take("line_end", np.int32),
            captures=tuple(self.state.captures),
            path_modes=tuple(self.state.path_modes),
            holes=tuple(self.holes),
            remarks=tuple((name, line, text) for name, (line, text) in self.remarks.items()),
            end_line=self.end_line,
            calculator=not self.state.bare_increments,
        )


def _moved_since(reader: _Reader, hole: Hole) -> bool:
    """Whether anything but cycles moved since this hole, which ends its series."""
    return hole.last != reader.moves
