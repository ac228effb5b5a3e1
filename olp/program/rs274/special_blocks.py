"""Blocks that are carried out one by one: probes, G53 moves, homing, and moves that the control makes by
itself. Also the checks of a block with an event.

What an event does to frames and tools is in `axis_state`, blocks of canned cycles are in `cycle_blocks`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from struct import Struct
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.machine import Place
from olp.core.toolpath import Flag, Kind
from olp.core.turns import turned
from olp.core.values import dataclass
from olp.program.rs274.axis_state import AxisState, Effect
from olp.program.rs274.codes import (
    DWELL,
    HOLE_PATTERNS,
    HOMES,
    INCREMENTAL,
    MACHINE,
    MACROS,
    PLANE_OF,
    POLAR,
    SPLINES,
)
from olp.program.rs274.collector import Collector
from olp.program.rs274.flatten.language import UNROLL
from olp.program.rs274.modes import Context, scaled
from olp.program.rs274.motion import fill
from olp.program.rs274.offset_state import EventBlock, Word
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.profiles.words import remedied
from olp.program.rs274.state import NAN
from olp.program.rs274.translation import Drilling
from olp.program.rs274.turned import Turning, along_words

#: (1,) the kind of a move that the control makes by itself.
_RAPID = np.array([Kind.RAPID], np.uint8)
#: flags of a move that the control makes by itself, and of one under block delete.
_OWN = int(Flag.PASS | Flag.CONTROL)
_OWN_DELETED = int(_OWN | Flag.DELETED)
#: (1,) the flag of a move that ends where the machine file says.
_STANDS = np.array([Flag.PASS | Flag.CONTROL | Flag.MACHINE], np.uint8)
#: (1, 3) the words of a move without any.
_NO_WORDS = np.full((1, 3), -1)
#: Events that may stand under block delete.
_DELETED_TOO = frozenset({DWELL, *HOMES, MACHINE})
#: M6 and M61, ten times their number
_TOOL_CODES = frozenset({60, 610})
#: A word of a line as bytes, then a G code with what it does; and how these are taken apart.
_WORD = np.dtype([("letter", np.uint8), ("value", np.float64), ("pointed", np.bool_)])
_CODE = np.dtype([("code", np.int64), ("act", np.int64)])
_WORD_PARTS = Struct("=Bd?")
#: Letters of axes and of centres.
_WHERE = frozenset("XYZABCUVWIJK")
_CODE_PARTS = Struct("=qq")


#: The words of a line of the chunk and its G codes with what each does, as bytes. They are the same in lines
#: that say the same.
EventWords = tuple[bytes, bytes]
#: blocks by what they say
KnownBlocks = dict[EventWords, EventBlock]


def event_words(context: Context, lines: Index) -> Iterator[EventWords]:
    """What lines of the chunk say. Their words are taken out of the columns together."""
    chunk, codes = context.chunk, context.codes
    word, ends = _within(chunk.first_word[lines], chunk.first_word[lines + 1])
    words = _rows(_WORD, chunk.letter[word], context.value[word], chunk.pointed[word])
    first, last = (codes.line.searchsorted(lines, side) for side in ("left", "right"))
    code, code_ends = _within(first, last)
    acts = _rows(_CODE, codes.code[code], codes.act[code])
    a = c = 0
    for b, d in zip((ends * _WORD.itemsize).tolist(), (code_ends * _CODE.itemsize).tolist(), strict=True):
        yield words[a:b], acts[c:d]
        a, c = b, d


def _rows(kind: np.dtype[Any], *columns: npt.NDArray[Any]) -> bytes:
    rows = np.empty(len(columns[0]), kind)
    for name, column in zip(kind.names or (), columns, strict=True):
        rows[name] = column
    return rows.tobytes()


def _within(first: Index, last: Index) -> tuple[Index, Index]:
    """All indices from each `first` up to its `last`, and where those of each end among them."""
    count = last - first
    ends = np.cumsum(count)
    return np.repeat(first - (ends - count), count) + np.arange(int(count.sum())), ends


def event_block(
    stated: EventWords, line: int, profile: Profile, known: KnownBlocks, *, deleted: bool
) -> EventBlock:
    """The words and event codes of a line by its number, which is `deleted` under block delete; refuses what
    cannot be read correctly. Blocks that are `known` of this profile are not looked at again."""
    block = known.get(stated)
    if block is None:
        block = known[stated] = _event_block(stated, profile, line)
    if deleted and (
        not _DELETED_TOO.issuperset(block.events)
        or not _TOOL_CODES.isdisjoint(block.m_codes)
        or (profile.numbers_hold and not block.by_letter.keys().isdisjoint("DH"))
    ):
        raise ProgramError(
            "a block under block delete changes offsets, units, path mode, the tool or its compensation, "
            f"so later blocks depend on the switch; {profile.without_switch}",
            line=line,
            code="OLP525",
        )
    return block


def _event_block(stated: EventWords, profile: Profile, number: int) -> EventBlock:
    words = [
        Word(chr(letter), value, place, pointed)
        for place, (letter, value, pointed) in enumerate(_WORD_PARTS.iter_unpack(stated[0]))
    ]
    if profile.commands is not None:
        # letters behind a command are its parameters
        own = next((k for k, word in enumerate(words) if word.letter != "N"), len(words))
        words = [w for k, w in enumerate(words) if k == own or (k > own and w.letter not in "GMT")]
        still = profile.commands.still_with
        if words and words[0].letter != "G":
            letter = still.get(round(words[0].value), "") if words[0].letter == "M" else ""
            words = [] if letter and any(w.letter == letter for w in words) else words[:1]
    return EventBlock.of(words, _checked(stated, words, profile, number))


def _checked(stated: EventWords, words: list[Word], profile: Profile, line: int) -> list[int]:
    """The event codes of a block; refuses those that cannot be read correctly."""
    unroll = UNROLL if profile.unroller is not None else ""
    numbers = [word.value for word in words if word.letter == "G"]
    codes: list[tuple[int, int]] = list(_CODE_PARTS.iter_unpack(stated[1]))
    for (c, a), number in zip(codes, numbers, strict=True):
        if a == Act.REFUSE and not _still(c, words, profile):
            why = profile.refusals.get(c)
            name = f"G{number:g}"
            spline = c in SPLINES and profile.language.splines and bool(unroll)
            holes = c in HOLE_PATTERNS and profile.language.hole_patterns
            unrolled = c in MACROS or (c == POLAR and profile.polar) or spline or holes
            why = why or _unknown(name, c, words, profile)
            raise ProgramError(
                why if unrolled and unroll else remedied(why),
                line=line,
                code="OLP511" if unrolled else "OLP512",
                hint=unroll if unrolled else "",
                # the other words of a macro call are its arguments
                word="" if c in MACROS else name,
            )
    for m in [round(word.value * 10) for word in words if word.letter == "M"]:
        if _calls_by_m(m, words, profile):
            raise ProgramError(
                f"M{m / 10:g} with P may call a macro with the other words as arguments; write plain blocks, "
                "or list it in still_m_codes of the machine file where it moves no axis",
                line=line,
                code="OLP512",
                word=f"M{m / 10:g}",
            )
        if m in profile.m_refusals:
            helps, instead = profile.unrolls_m(m), profile.m_instead.get(m, "")
            why = f"M{m / 10:g} {profile.m_refusals[m]}"
            raise ProgramError(
                why if helps and unroll else remedied(f"{why}; {instead}" if instead else why),
                hint=unroll if helps else "",
                instead=instead,
                line=line,
                code="OLP511" if helps else "OLP512",
                word=f"M{m / 10:g}",
            )
    for (c, _), number in zip(codes, numbers, strict=True):
        letters, why = profile.lathe_words.get(c, ("", ""))
        if letters and {word.letter for word in words}.issuperset(letters):
            raise ProgramError(
                f"G{number:g} {' '.join(letters)} {why} of a lathe, whose X states diameters; "
                "give the program of a mill",
                line=line,
                code="OLP512",
            )
    return [c for c, a in codes if a == Act.EVENT]


def _calls_by_m(m: int, words: list[Word], profile: Profile) -> bool:
    """Whether an M code, ten times its number, may call a macro with the words of its block: parameters of
    these controls make M codes call one."""
    letters = {word.letter for word in words}
    own = m in profile.still_m or m in profile.m_refusals or m in profile.home_m or m in _TOOL_CODES
    return (
        profile.language.macro_b
        and not profile.language.user_tasks
        and not own
        and "P" in letters
        and "G" not in letters
        and (_has_axes(words) or not letters.isdisjoint("DH"))
    )


def _has_axes(words: list[Word]) -> bool:
    return any(word.letter in _WHERE for word in words)


def _unknown(name: str, code: int, words: list[Word], profile: Profile) -> str:
    """Why a code of no table is refused."""
    if code in profile.still_g:
        return f"{name} is one of still_g_codes, and its block has words of axes; put them into another block"
    why = f"{name} is not known to the {profile.name} profile and may move the machine"
    if name != f"G{code / 10:g}" or profile.commands is not None or _has_axes(words):
        return why
    return (
        f"{why}; post the program without it, or list it in still_g_codes of the machine file where it moves "
        "no axis and changes no mode of the path"
    )


def _still(code: int, words: list[Word], profile: Profile) -> bool:
    """Whether a code that is refused elsewhere changes nothing of the path in this block."""
    if code in profile.still_g:
        return not _has_axes(words)
    letter, values = profile.still_with.get(code, ("", frozenset[float]()))
    own = {word.letter: word.value for word in words if word.letter not in "GN"}
    return bool(letter) and own.keys() == {letter} and own[letter] in values


def check_codes(context: Context, profile: Profile) -> None:
    """Refuse the codes of a chunk that need no state to be refused, all at once."""
    chunk, codes = context.chunk, context.codes
    m = np.flatnonzero((chunk.letter == ord("M")) & context.active[chunk.line])
    m = m[is_in(np.rint(context.value[m] * 10), list(profile.m_refusals))]
    lines = distinct(np.concatenate((codes.line[codes.act == Act.REFUSE], chunk.line[m])))
    if not lines.size:
        return
    errors = []
    for line, stated in zip(lines.tolist(), event_words(context, lines), strict=True):
        try:
            event_block(stated, context.number(line), profile, {}, deleted=bool(chunk.deleted[line]))
        except ProgramError as error:
            errors.append(error)
    if errors:
        raise ProgramError.together(errors)


@dataclass(frozen=True, slots=True)
class OwnMove:
    """A move that the control makes by itself before a `row` of a chunk; no position is known after it."""

    row: int
    line: int
    flag: int
    frame: int


class SpecialBlocks:
    """Carries these blocks out from the position in `state`, and puts their moves into `collector`."""

    def __init__(self, state: AxisState, collector: Collector) -> None:
        self._state = state
        self._collector = collector

    def control_move(self, line: int, *, deleted: bool) -> None:
        """A move that the control makes by itself: the position of some axes is not known after it."""
        if not self._collector.moves:
            x, y, z = self._state.position
            self._collector.start = (x, y, z)
            return
        own = self.own_move(line, 0, deleted=deleted)
        self._collector.put_moves(
            _RAPID,
            np.array([own.flag], np.uint8),
            [line],
            [own.frame],
            np.array([self._state.position]),
            _NO_WORDS,
        )

    def own_move(self, line: int, row: int, *, deleted: bool) -> OwnMove:
        """Such a move before a row of a chunk."""
        return OwnMove(row, line, _OWN_DELETED if deleted else _OWN, self._loose_frame())

    def stand(self, line: int, axes: Sequence[int], place: Place, *, deleted: bool) -> None:
        """Where axes stand after such a move, as far as the machine file states it and the words are those of
        the axes."""
        if deleted or all(place[axis] is None for axis in axes):
            return
        state = self._state
        try:
            number = state.frame(line)
        except ProgramError:
            # what is not defined is refused where a move uses it
            return
        if state.frames[number].turn is not None or state.frames[number].tip:
            return
        for axis in axes:
            state.position[axis] = NAN if (at := place[axis]) is None else at
        state.along.drop()
        self._collector.put_moves(
            _RAPID, _STANDS, [line], [number], np.array([state.position]), _NO_WORDS,
        )  # fmt: skip

    def _loose_frame(self) -> int:
        """The last frame without cutter compensation, which is of no contour."""
        frames = self._state.frames
        for i in range(len(frames) - 1, -1, -1):
            if frames[i].compensation is None:
                return i
        return len(frames) - 1

    def run(self, context: Context, row: int, slot: Index, frame_index: int, effect: Effect) -> None:
        """Carry out a probe, a G53 move or the move to the intermediate point of G28 on line `row` of the
        chunk, whose axis words are `slot` (1, 3), in this frame."""
        state, line, motion = self._state, context.number(row), int(context.motion[row])
        frame = state.frames[frame_index]
        incremental = bool(context.distance[row] == INCREMENTAL)
        deleted = bool(context.chunk.deleted[row])
        flag = _deleted(deleted)
        kind = Kind.RAPID
        offset = np.array(frame.offset_mm)
        if effect.machine:
            if incremental and not state.profile.machine_moves_absolute:
                raise ProgramError(
                    "G53 takes axis positions, and the block is in G91; give G90", line=line, code="OLP518"
                )
            incremental = False
            if motion not in (0, 10):
                stated = (
                    "" if motion >= 0 else ', or motion = "G0" or "G1" in [job_defaults] of the machine file'
                )
                raise ProgramError(
                    f"G53 takes G0 or G1 only; give one of them in the block{stated}",
                    line=line,
                    code="OLP518",
                )
            kind = Kind(motion // 10)
            flag |= Flag.PASS | Flag.MACHINE
            kept = state.profile.machine_moves_keep_length
            offset = np.array(frame.length_mm) if kept else np.zeros_like(offset)
        elif effect.home is not None:
            flag |= Flag.PASS
        else:
            kind = Kind.PROBE
        if incremental:
            flag |= Flag.INCREMENTAL
        before = list(state.position)
        relative = np.array([True]) if incremental else None
        value = scaled(context, state, self._collector.remarks)
        turning = None if effect.machine else Turning.of(frame.turn)
        start = along_words(turning, before)
        offset = offset if turning is None else turning.words(offset)
        end = fill(slot, value, relative, offset, frame.unit_mm, start)
        if turning is not None:
            end = turning.axes(end)
        if effect.machine and not state.setup.machine.located:
            end[slot >= 0] = NAN
        if kind == Kind.PROBE and end[0].tolist() == before:
            raise ProgramError(
                "a probe ends where it starts; give it a path of X, Y or Z", line=line, code="OLP516"
            )
        self._collector.put_moves(
            np.array([kind], np.uint8), np.array([flag], np.uint8), np.array([line]),
            np.array([frame_index]), end, np.where(slot >= 0, slot + context.base, -1),
        )  # fmt: skip
        state.position[:] = end[0].tolist()
        state.along.drop()
        if kind == Kind.PROBE:
            # it may stop anywhere on its path
            for i in range(3):
                if state.position[i] != before[i]:
                    state.position[i] = NAN
                    state.touched.add(i)
            self.control_move(line, deleted=deleted)

    def drill(self, line: int, drilling: Drilling, *, deleted: bool) -> None:
        """The strokes of a cycle that is called at the present position."""
        state = self._state
        number = state.frame(line)
        frame = state.frames[number]
        fixed = frame.tip == "fixed"
        if fixed and PLANE_OF[state.plane]:
            raise ProgramError(
                f"{drilling.name} is called in a tilted plane outside of G17, which is not read; program G17",
                line=line,
                code="OLP512",
            )
        if not fixed and frame.turn is not None and frame.turn[2] != (0.0, 0.0, 1.0):
            raise ProgramError(
                f"{drilling.name} is in a frame that scales or mirrors Z, which is not read; write the hole "
                "as plain moves",
                line=line,
                code="OLP512",
            )
        matrix = np.array(frame.turn) if fixed and frame.turn is not None else np.eye(3)
        place = np.array(state.along.of(frame.turn, state.position) if fixed else state.position)
        offset = turned(matrix.T, np.array([frame.offset_mm]))[0]
        kind, end = drilling.moves(state, place, offset, frame.unit_mm)
        count, moves = len(kind), self._collector.moves
        if fixed:
            self._collector.levels += [(moves + k, 2, float(z)) for k, z in enumerate(end[:, 2])]
        last = end[-1]
        end = turned(matrix, end)
        if moves and drilling.text[0] >= 0:
            bottom = moves + [k for k, _ in drilling.strokes].index(Kind.LINE)
            self._collector.called.append(
                (moves - 1, bottom, *drilling.text, *(byte for level in drilling.levels for byte in level),
                 int(drilling.always))
            )  # fmt: skip
        self._collector.put_moves(
            kind, np.full(count, Flag.CYCLE | _deleted(deleted), np.uint8), np.full(count, line),
            np.full(count, number), end, np.full((count, 3), -1),
        )  # fmt: skip
        state.position[:] = end[-1].tolist()
        if fixed:
            state.along.put(frame.turn, state.position, last)


def _deleted(deleted: bool) -> Flag:
    return Flag.DELETED if deleted else Flag(0)
