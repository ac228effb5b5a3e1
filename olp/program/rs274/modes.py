"""What is in force on each line of a chunk: modal codes, the end of the program, and which lines are events,
which are read one by one.

A whole chunk is read at once. Refused here are lines with more than words, words that may not be in one block
(`block_rules`), and block delete that later blocks depend on.
"""

from __future__ import annotations

import re
from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.block_rules import M
from olp.program.rs274.codes import (
    AXIS_VALUES,
    COMPENSATION_OFF,
    CUTTER_COMPENSATION,
    DWELL,
    END_OF_CYCLES,
    GROUPS,
)
from olp.program.rs274.commands import Reading, check_lines, own_words, sorted_line
from olp.program.rs274.flatten.language import UNROLL
from olp.program.rs274.lexer import WordChunk
from olp.program.rs274.motion import modal, values
from olp.program.rs274.profiles.base import Act, Profile

Modal = npt.NDArray[np.int16]

_FLOW = pattern(rb"[#\[=<]|^/?\s*O|^\W*N?\d*\s*(IF|WHILE|GOTO|END|DO|CALL|RTS)", re.IGNORECASE)
#: The number of a program on ISO controls.
_PROGRAM = b":1"
_POLAR = pattern(rb"[@^]")
_COMMA = pattern(rb"\d,\d")
_ROUNDED = pattern(rb"(?i),[ \t]*[CR][ \t]*[\d.]")
#: D and H
_NUMBERS = (68, 72)
_LENGTHS = np.zeros(256, bool)
_LENGTHS[list(b"XYZIJKRQ")] = True


@dataclass(frozen=True, slots=True, eq=False)
class Codes:
    """The G words of a chunk: line, code x 10 (-1: no control has it), what it does."""

    line: Index
    code: Index
    act: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class Context:
    """A chunk with its numbers and the modal codes in force on each line; `base` is its first word's
    index.

    `event` marks the lines to be read one by one, `consumed` those whose axis words are not motion, `active`
    those that count.
    """

    chunk: WordChunk
    value: Array
    base: int
    codes: Codes
    motion: Modal
    plane: Modal
    distance: Modal
    arc_distance: Modal
    feed_mode: Modal
    retract: Modal
    #: 3, 4 or 5: M3, M4, M5; -1 before any
    spindle: Modal
    event: Mask
    consumed: Mask
    active: Mask
    #: numbers as written, by the unit in force
    scaled: dict[float, Array] = field(default_factory=dict)

    def number(self, line: int) -> int:
        """The number of a line of the chunk in the program, counted from 1."""
        return self.chunk.first_line + line + 1


@dataclass(frozen=True, slots=True)
class Odd:
    """A line of the chunk after which no position is known, and the `macro` that it calls, empty for none."""

    line: int
    macro: str


class Modes:
    """The codes in force, from chunk to chunk; those at the end of a chunk are kept in the `state`."""

    def __init__(self, state: AxisState, *, block_delete: bool) -> None:
        self._state = state
        self._block_delete = block_delete
        profile = state.profile
        self._cycles_apart = profile.cycles_apart
        claims = AXIS_VALUES | {profile.return_level}
        self._claims = sorted(claims | {DWELL} if profile.axis_dwell else claims)
        self._returns = profile.return_modes
        # the last entry is of codes that no control has
        self._act = np.full(3000, Act.REFUSE, np.int8)
        for code, act in profile.codes.items():
            self._act[code] = act
        # the last entry stays that of no code
        self._code_of = np.arange(len(self._act))
        for alias, code in profile.aliases.items():
            self._code_of[alias] = code
        self._m_event = np.ones(10_001, bool)
        self._m_event[list(profile.still_m)] = False
        self._rules = profile.rules.tables()
        self._linear_motion = state.motion
        self._commands = profile.commands
        self._ended = False
        # the line of the first tape mark, from 1
        self._tape = 0

    def program_end(self, chunk: WordChunk) -> int:
        """The number of lines up to the end of the program: M2, M30, or the second tape mark; the lines of a
        program of commands have no such end."""
        last = 0 if self._ended else len(chunk.line_start)
        if self._commands is not None:
            # neither M2 and M30 nor tape marks end a program
            return last
        codes = np.flatnonzero(chunk.letter == 77)
        value = chunk.mantissa[codes] / 10.0 ** chunk.decimals[codes]
        ends = chunk.line[codes[is_in(value, (2.0, 30.0))]]
        if self._block_delete:
            ends = ends[~chunk.deleted[ends]]
        if ends.size and ends[0] < last:
            if chunk.deleted[ends[0]]:
                raise ProgramError(
                    "the end of the program is under block delete; "
                    "expected the same end for both positions of the switch",
                    line=chunk.first_line + int(ends[0]) + 1,
                    code="OLP525",
                )
            last, self._ended = int(ends[0]) + 1, True
        for mark in chunk.marks.tolist():
            if mark >= last:
                break
            pairs = self._state.profile.text.marks_in_pairs
            first = chunk.first_line == 0 and not chunk.first_word[mark]
            if pairs and chunk.comments.size:
                first &= bool(chunk.comments[0] > chunk.line_start[mark])
            if not self._tape and first:
                self._tape = chunk.first_line + mark + 1
            elif (self._tape and mark not in chunk.odd) or not pairs:
                last, self._ended = mark, True
            else:
                raise ProgramError(
                    "`%` is in the middle of the program, or not alone in its line; expected it as the first "
                    "line and the last one, or not at all",
                    line=chunk.first_line + mark + 1,
                    code="OLP505",
                )
        return last

    def read(self, chunk: WordChunk, base: int, active: Mask) -> Context:
        """The codes on the lines of a chunk; those of lines that are not active do not count. Its first word
        is the program's `base`th."""
        value, state = values(chunk), self._state
        usable = active[chunk.line]
        if self._commands is not None:
            usable &= own_words(chunk)
        codes = self._codes(chunk, value, usable)
        context = Context(
            chunk,
            value,
            base,
            codes,
            motion=self._motion(chunk, codes),
            plane=_modal(chunk, codes, Act.PLANE, state.plane),
            distance=_modal(chunk, codes, Act.DISTANCE, state.distance),
            arc_distance=_modal(chunk, codes, Act.ARC_DISTANCE, state.arc_distance),
            feed_mode=_modal(chunk, codes, Act.FEED, state.feed_mode),
            retract=self._retract(chunk, value, codes, usable),
            spindle=self._spindle(chunk, value, usable),
            event=self._events(chunk, value, codes, usable),
            consumed=self._consumed(codes, active),
            active=active,
        )
        if self._commands is not None:
            np.logical_or(context.consumed, context.motion < 0, out=context.consumed)
            arcs = (context.motion == 20) | (context.motion == 30)
            check_lines(chunk, own_words(chunk), active, arcs, self._commands)
        _check_deleted(context, state)
        return context

    def check_rules(self, context: Context) -> None:
        """Refuse the blocks of a chunk with words that may not be together, all at once."""
        chunk, active = context.chunk, context.active
        usable = active[chunk.line]
        if self._commands is not None:
            usable &= own_words(chunk)
        keys = self._keys(chunk, context.value, context.codes, usable)
        self._rules.check(chunk, active, keys, context.motion, context.plane)

    def check_end(self) -> None:
        """Refuse a text that begins with `%` and has no end, where the control does."""
        if self._state.profile.text.marks_in_pairs and self._tape and not self._ended:
            raise ProgramError(
                "the program begins with `%` and has no end; give M2, M30 or a second `%`",
                line=self._tape,
                code="OLP532",
            )

    def leave(self, context: Context, line: int) -> None:
        """Keep the codes in force on this line, the last one that is read, for the next chunk."""
        state = self._state
        state.take({int(getattr(context, group)[line]) for group in GROUPS})
        state.motion = None if context.motion[line] < 0 else int(context.motion[line])
        state.turning = int(context.spindle[line])

    def _codes(self, chunk: WordChunk, value: Array, usable: Mask) -> Codes:
        g = np.flatnonzero((chunk.letter == 71) & usable)
        tenths = value[g] * 10
        code = np.rint(tenths)
        listed = (np.abs(code - tenths) < 1e-6) & (code >= 0) & (code < len(self._act))
        code = self._code_of[np.where(listed, code, -1).astype(np.int64)]
        return Codes(chunk.line[g], code, self._act[code])

    def _spindle(self, chunk: WordChunk, value: Array, usable: Mask) -> Modal:
        m = np.flatnonzero((chunk.letter == 77) & usable)
        m = m[is_in(value[m], (3, 4, 5, 6, 19))]
        line, code = chunk.line[m], value[m]
        # a tool change and an oriented stop end it, the change before its start in one block
        order = np.lexsort((code != 6, line))
        line, code = line[order], code[order]
        last = np.append(line[1:] != line[:-1], True)[: len(line)]
        return modal(len(chunk.line_start), line[last], code[last], self._state.turning)

    def _retract(self, chunk: WordChunk, value: Array, codes: Codes, usable: Mask) -> Modal:
        """Whether cycles return to R: by G codes, or by M codes that stand for them."""
        if not self._returns:
            return _modal(chunk, codes, Act.RETRACT, self._state.retract)
        m = np.flatnonzero((chunk.letter == 77) & usable & is_in(value, list(self._returns)))
        code = np.array([self._returns[int(number)] for number in value[m].tolist()], np.int64)
        return _in_force(chunk, chunk.line[m], code, self._state.retract)

    def _keys(self, chunk: WordChunk, value: Array, codes: Codes, usable: Mask) -> tuple[Index, Index]:
        """The lines and keys of G and M codes for `block_rules`."""
        m = np.flatnonzero((chunk.letter == 77) & usable)
        key = M + np.clip(np.rint(value[m] * 10), 0, M - 1).astype(np.int64)
        return np.append(codes.line, chunk.line[m]), np.append(codes.code, key)

    def _events(self, chunk: WordChunk, value: Array, codes: Codes, usable: Mask) -> Mask:
        """The lines with a G word that is an event, an M word not known as harmless, or a T word."""
        letter, line = chunk.letter, chunk.line
        event = np.zeros(len(chunk.line_start), bool)
        event[codes.line[(codes.act == Act.EVENT) | (codes.act == Act.CONTROL)]] = True
        m = np.flatnonzero((letter == 77) & usable)
        event[line[m[self._m_event[np.clip(np.rint(value[m] * 10), 0, 10_000).astype(np.int64)]]]] = True
        event[line[(letter == 84) & usable]] = True
        if self._state.profile.numbers_hold:
            event[line[is_in(letter, _NUMBERS) & usable]] = True
        # along a contour, these are checked too
        on = self._compensated(codes, len(event))
        if on is not None:
            stated = (codes.act == Act.PLANE) | is_in(codes.code, self._state.profile.contours.refused_g)
            some = np.append(codes.line[stated], line[m])
            event[some] |= on[some]
        return event

    def _compensated(self, codes: Codes, lines: int) -> Mask | None:
        """(lines,) whether cutter compensation is on before or behind a line; None where it is nowhere."""
        switch = is_in(codes.code, CUTTER_COMPENSATION | {COMPENSATION_OFF})
        before = self._state.compensation is not None
        if not switch.any() and not before:
            return None
        on = modal(lines, codes.line[switch], codes.code[switch] != COMPENSATION_OFF, before) != 0
        return np.asarray(on | np.append(before, on[:-1]), bool)

    def _consumed(self, codes: Codes, active: Mask) -> Mask:
        consumed = ~active
        consumed[codes.line[(codes.act == Act.EVENT) & is_in(codes.code, self._claims)]] = True
        return consumed

    def _motion(self, chunk: WordChunk, codes: Codes) -> Modal:
        chosen = codes.act == Act.MOTION
        line, code = codes.line[chosen], codes.code[chosen]
        if self._commands is not None:
            own = np.full(len(chunk.line_start), -1, np.int16)
            own[line] = code
            return own
        # G80 may be beside another motion code, which then holds
        beside = (code == END_OF_CYCLES) & is_in(line, line[1:][line[1:] == line[:-1]])
        line, code = line[~beside], code[~beside]
        if self._cycles_apart:
            # cycles are a separate group: after G80 alone the last of G0 to G3 is in force again
            for i, c in enumerate(code.tolist()):
                if c == END_OF_CYCLES:
                    code[i] = -1 if self._linear_motion is None else self._linear_motion
                elif c < 330:
                    self._linear_motion = c
        return _in_force(chunk, line, code, self._state.motion)


def check_odd(data: Text, chunk: WordChunk, before_end: Mask, active: Mask, state: AxisState) -> list[Odd]:
    """Refuse active lines with more than words, all of the chunk at once; of those `before_end` that block
    delete skips the ones whose bytes are refused, as the control reads these all the same. Of commands the
    lines after which no position is known."""
    profile = state.profile
    lines = chunk.odd[before_end[chunk.odd]].tolist()
    if profile.commands is not None:
        return _odd_commands(data, chunk, lines, state)
    errors = [_odd(data, chunk, line, profile, words=bool(active[line])) for line in lines]
    some = [error for error in errors if error is not None]
    if some:
        raise ProgramError.together(some)
    return []


def _odd_commands(data: Text, chunk: WordChunk, lines: list[int], state: AxisState) -> list[Odd]:
    """The lines of more than words after which no position is known. Raises ProgramError for all that cannot
    be read correctly."""
    profile, known = state.profile, state.setup.machine.still_macros
    assert profile.commands is not None
    moving, errors = [], []
    for line in lines:
        text = data[int(chunk.line_start[line]) : int(chunk.line_end[line])]
        try:
            reading = sorted_line(
                text, profile.commands, profile.still_m, profile.codes_of(Act.CONTROL),
                profile.codes_of(Act.UNCHANGED), known,
                brackets=profile.text.brackets, by_option=profile.brackets_by_option,
            )  # fmt: skip
        except ProgramError as error:
            error.line = chunk.first_line + line + 1
            errors.append(error)
            continue
        if reading is not Reading.STILL:
            name = text.split()[0].decode("latin-1") if reading is Reading.UNKNOWN else ""
            moving.append(Odd(line, name))
    if errors:
        raise ProgramError.together(errors)
    return moving


def _odd(data: Text, chunk: WordChunk, line: int, profile: Profile, *, words: bool) -> ProgramError | None:
    """Why a line with more than words is refused, by its bytes, or by its `words` too."""
    number = chunk.first_line + line + 1
    start = int(chunk.line_start[line])
    inert = profile.inert
    if inert is not None and inert.fullmatch(data[start : chunk.line_end[line]]):
        return None
    newline = data.find(b"\n", start)
    error = profile.text.refusal(data[start : newline if newline >= 0 else len(data)])
    if error is not None:
        error.line = number
        return error
    if not words:
        return None
    text = data[start : chunk.line_end[line]].strip()
    shown = text[:60].decode("latin-1")
    if _FLOW.search(text):
        return ProgramError(
            f"`{shown}` uses parameters, expressions or flow control",
            hint=UNROLL if profile.unroller is not None else "post the program without them",
            line=number,
            code="OLP511",
        )
    if profile.unroller is not None and profile.language.splines and _POLAR.search(text):
        return ProgramError(f"`{shown}` states a radius or an angle", hint=UNROLL, line=number, code="OLP511")
    if profile.unroller is not None and profile.language.corners and _ROUNDED.search(text):
        return ProgramError(
            f"`{shown}` asks for a corner that the control makes", hint=UNROLL, line=number, code="OLP511"
        )
    if text.startswith(b":") and inert is not None and inert.fullmatch(_PROGRAM):
        return ProgramError(
            f"`{shown}` begins with a colon, with which a program begins on this control; write N instead",
            line=number,
            code="OLP510",
        )
    comma = "; write a decimal point instead of the comma" if _COMMA.search(text) else ""
    if _ROUNDED.search(text):
        comma = "; where it rounds or breaks a corner inside the control, post the corner as a move"
    return ProgramError(
        f"`{shown}` is not understood and may move the machine; expected words of a letter and a number"
        f"{comma}",
        line=number,
        code="OLP510",
    )


def scaled(context: Context, state: AxisState, remarks: dict[str, tuple[int, str]]) -> Array:
    """The chunk's numbers as written, in program units: without a decimal point they count increments on
    some controls, which is remarked."""
    if not state.bare_increments:
        return context.value
    if state.unit_mm in context.scaled:
        return context.scaled[state.unit_mm]
    chunk = context.chunk
    bare = np.flatnonzero(~chunk.pointed & _LENGTHS[chunk.letter])
    if not bare.size:
        return context.value
    numbers = context.value.copy()
    for letter in distinct(chunk.letter[bare]).tolist():
        mine = bare[chunk.letter[bare] == letter]
        numbers[mine] *= state.increment(chr(letter))
    # 0 is 0 either way, and K counts the holes of a cycle too
    some = bare[(context.value[bare] != 0.0) & (chunk.letter[bare] != ord("K"))]
    some = some[context.active[chunk.line[some]]]
    if some.size:
        remarks.setdefault("increments", (context.number(int(chunk.line[some[0]])), ""))
    context.scaled[state.unit_mm] = numbers
    return numbers


def _modal(chunk: WordChunk, codes: Codes, which: Act, now: int | None) -> Modal:
    chosen = codes.act == which
    return _in_force(chunk, codes.line[chosen], codes.code[chosen], now)


def _in_force(chunk: WordChunk, lines: Index, code: Index, now: int | None) -> Modal:
    return modal(len(chunk.line_start), lines, code, -1 if now is None else now)


def _check_deleted(context: Context, state: AxisState) -> None:
    """A `/` block must not change how later blocks are read, unless the next block restates it."""
    chunk = context.chunk
    lines = np.flatnonzero(chunk.deleted & context.active)
    if not lines.size:
        return
    kept = np.flatnonzero(~chunk.deleted)
    following = np.append(kept, len(chunk.deleted))[np.searchsorted(kept, lines)]
    restated = np.zeros(len(chunk.deleted) + 1, bool)
    restated[context.codes.line[context.codes.act == Act.MOTION]] = True
    changed = _changes(context.motion, state.motion)[lines] & ~restated[following]
    for group in GROUPS:
        changed |= _changes(getattr(context, group), getattr(state, group))[lines]
    if changed.any():
        raise ProgramError(
            "a block under block delete changes a modal code that later blocks depend on; "
            f"restate the code in the next block, or {state.profile.without_switch}",
            line=context.number(int(lines[np.argmax(changed)])),
            code="OLP525",
        )


def _changes(mode: npt.NDArray[np.int16], before: int | None) -> Mask:
    """(lines,) whether a mode is another one than in the line before."""
    first = np.array([-1 if before is None else before], mode.dtype)
    return np.asarray(mode != np.concatenate((first, mode[:-1])), bool)
