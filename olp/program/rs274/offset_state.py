"""The offsets and tool lengths of the state, and the blocks that change them: G43, G49, G54, G10, G52, G92.

Lengths become mm here. How offsets add up is in `offsets`, what becomes of them as a frame in `axis_state`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector, WorkOffset
from olp.core.patterns import pattern
from olp.core.toolpath import Touch
from olp.core.turns import Turn
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.frames import touch_of
from olp.program.rs274.codes import (
    ALIGNED,
    CYCLES,
    DWELL,
    HOMES,
    LENGTH_OFF,
    LENGTHS,
    LOCAL_OFFSET,
    MACHINE,
    METRIC,
    PATH_MODES,
    PLANE_OF,
    PRESET,
    TILTED,
    TRANSFORMS,
    UNITS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.offsets import Offsets
from olp.program.rs274.profiles.base import increment
from olp.program.rs274.state import KNOWN_BY, NAN, Capture, State
from olp.program.rs274.turned import Turning, along_words

#: L of a G10 that stores the present position.
STORES_POSITION = 20
#: P of a G10 L20 that writes an offset G54.1 P, at most.
_FURTHER = 300
#: RS-274's order of execution within a block; other codes come last.
_RANK = {
    code: rank
    for rank, codes in enumerate(((DWELL,), UNITS, LENGTHS, WORK_OFFSETS, PATH_MODES))
    for code in codes
}
#: Codes that have no P, beside which it may be the number of a work offset.
_LEAVES_P = frozenset({
    0, 10, *PLANE_OF, *UNITS, *LENGTHS, *WORK_OFFSETS, 400, 800, 900, 910, 940, 950, 980, 990,
})  # fmt: skip
#: Events that leave frame, tool and position as they are.
_QUIET = frozenset({DWELL, *PATH_MODES})
#: Events that change no frame
_KEEPS_FRAME = frozenset({*_QUIET, MACHINE, *HOMES})
#: Events that go on from the present position, or turn it
APART = HOMES | TRANSFORMS | {MACHINE, TILTED, ALIGNED}
#: Events that may need it, or numbers by another unit before it
_OF_PLACE = APART | {PRESET, WRITE_OFFSET, *UNITS}
#: Words that number a tool, its length or its radius.
_NUMBERS = frozenset("THD")
_SPACED = pattern(r"([\d.])([A-Z])")


@dataclass(frozen=True, slots=True)
class Word:
    """One word of a block: upper-case letter, number as written, place in the block."""

    letter: str
    value: float
    index: int
    pointed: bool = True


@dataclass(frozen=True, slots=True)
class EventBlock:
    """The words of a block with an event, also `by_letter`, those of axes with the `axes`, and the codes of G
    and M, ten times their number. `events` are the G codes that are events, in the order of the control. A
    `quiet` block has dwells and path modes only: the frame and the tool stay. Others may move, and yet change
    no tool, and no frame: one that `keeps_frame`. One `of_place` may go on from the present position or store
    it, or count by another unit."""

    words: list[Word]
    by_letter: dict[str, Word]
    axes: list[tuple[int, Word]]
    g_codes: list[int]
    m_codes: list[int]
    events: list[int]
    quiet: bool
    keeps_frame: bool
    of_place: bool

    @staticmethod
    def of(words: list[Word], events: Sequence[int]) -> EventBlock:
        by_letter = {word.letter: word for word in words}
        axes = [(i, by_letter[a]) for i, a in enumerate(AXES) if a in by_letter]
        g_codes, m_codes = ([round(w.value * 10) for w in words if w.letter == a] for a in "GM")
        ordered = sorted(events, key=lambda code: _RANK.get(code, len(_RANK)))
        keeps = not m_codes and _NUMBERS.isdisjoint(by_letter)
        quiet = bool(events) and keeps and _QUIET.issuperset(g_codes)
        keeps = keeps and _KEEPS_FRAME.issuperset(events)
        of_place = not _OF_PLACE.isdisjoint(events)
        return EventBlock(words, by_letter, axes, g_codes, m_codes, ordered, quiet, keeps, of_place)


@dataclass(slots=True, kw_only=True)
class OffsetState(State):
    """The state with the offsets and lengths in force."""

    setup: Setup
    offsets: Offsets
    inherited: dict[str, Touch | None] = field(default_factory=dict)
    located: dict[str, str] = field(default_factory=dict)
    length_tool: int | None = None
    #: the H of the length in force, 0 for none of its own; None behind G49
    length_number: int | None = None
    #: the code of a length whose H a later block states, 0 for none
    awaiting_number: int = 0
    #: the last D
    radius_number: int | None = None
    spindle: int | None = None
    length_unit: int = METRIC
    #: those of the setup that were looked up, None where it has none of this name
    known_offsets: dict[str, WorkOffset | None] = field(default_factory=dict)
    captures: list[Capture] = field(default_factory=list)
    #: axes that a probe has moved last: only the control knows where they are
    touched: set[int] = field(default_factory=set)
    #: index of the first word of the present block in the program's table
    first_word: int = 0

    def length_mm(self, word: Word) -> float:
        """A length word in mm; without a decimal point it counts least increments on some controls."""
        return word.value * self.word_scale(word.letter, word.pointed)

    def word_scale(self, letter: str, pointed: bool) -> float:
        """mm per unit of the number as written."""
        return self.unit_mm if pointed else self.profile.bare_mm(self.setup.machine, letter, self.unit_mm)

    @property
    def bare_increments(self) -> bool:
        """Whether a length without a decimal point counts least increments."""
        return self.profile.counts_increments(self.setup.machine)

    def increment(self, letter: str) -> float:
        """Least increment in program units."""
        return increment(self.setup.machine, letter, self.unit_mm)

    def _work_offset(self, name: str) -> WorkOffset | None:
        if name not in self.known_offsets:
            spaced = _SPACED.sub(r"\1 \2", name)
            self.known_offsets[name] = self.setup.work_offset(name) or self.setup.work_offset(spaced)
        return self.known_offsets[name]

    def _angle_deg(self, name: str, line: int) -> float:
        """By how much a work offset is turned about Z, as the program has written it, else as the setup has
        it. Raises ProgramError where the control cannot turn it so."""
        if name in self.offsets.turned_deg:
            return self.offsets.turned_deg[name]
        work = self._work_offset(name)
        a, b, c = ZERO if work is None else work.rotation_deg
        if a or b or (c and not self.profile.turns_offsets):
            own = self.profile.turns_offsets
            how = "A_deg = B_deg = 0" if own else "A_deg = B_deg = C_deg = 0"
            raise ProgramError(
                f"work offset {name} is rotated, which this control does not do so; state it with {how}",
                line=line,
                code="OLP523",
            )
        return c

    def _touch(self, name: str, base: Sequence[float], line: int) -> Touch | None:
        """Where a work offset was touched off. One that G10 L20 sets takes over the point of the offset in
        force; one that G10 L2 changes keeps its own point."""
        if name in self.inherited:
            return self.inherited[name]
        work = self._work_offset(name) or WorkOffset(name, (base[0], base[1], base[2]))
        return touch_of(self.setup, work, line)

    def _tool(self, number: int, line: int, what: str) -> Vector:
        if number == 0:
            return ZERO
        tool = self.setup.tool(number)
        if tool is None:
            raise ProgramError(
                f"{what} uses tool {number}, which is not defined; give [tools.{number}] in the machine or "
                "job file",
                line=line,
                code="OLP521",
                missing=("tools", str(number)),
            )
        return tool.length_mm

    def _tool_length(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        self.awaiting_number = 0
        if code == LENGTH_OFF:
            self._set_length(ZERO)
            self.length_tool = self.length_number = None
            return
        name = f"G{code / 10:g}"
        number = self._integer(by_letter["H"], line) if "H" in by_letter else None
        if not number and self.profile.length_of_spindle_tool and (number is not None or code != 432):
            number = self.spindle
            if number is None:
                raise ProgramError(
                    f"{name} takes the length of the tool in the spindle, which is not known; give T and M6 "
                    "before it, or `tool` in the job file",
                    line=line,
                    code="OLP532",
                )
        if number is None and code == 430 and self.spindle in (None, self.length_number):
            # the last H and the tool in the spindle are the same, whichever the control takes
            number = self.length_number or None
        if number is None and self.profile.length_awaits_number:
            self._set_length(ZERO)
            self.length_tool = self.length_number = None
            self.awaiting_number = code
            return
        if number is None:
            raise ProgramError(
                f"{name} needs an H word with the number of the tool length", line=line, code="OLP516"
            )
        if self.spindle is None and number:
            # only the length that is called up shows which tool is in the spindle
            self.length_tool = number
        vector = self._tool(number, line, name)
        if self.profile.lengths_along_z:
            vector = (0.0, 0.0, vector[2])
        if code == 440:
            vector = (-vector[0], -vector[1], -vector[2])
        if code == 432:
            vector = self._sum(self.offsets.length, vector)
        self._set_length(vector)
        self.length_tool, self.length_number = number or None, number

    def _set_length(self, vector: Vector) -> None:
        self.offsets.length, self.length_unit = vector, self.unit or METRIC

    def _check_number(self, block: EventBlock, line: int) -> None:
        """Refuse a word that may be the number of a work offset, or belong to another code of its block."""
        if "P" in block.by_letter and _LEAVES_P.issuperset(block.g_codes):
            worded, further = self.profile.offset_words, self.profile.further_offsets[0]
            alone = [code for code in block.events if code in WORK_OFFSETS and code not in worded]
            if alone:
                raise ProgramError(
                    f"what this control makes of P beside G{alone[0] / 10:g} is not known; a further work "
                    f"offset is {further} P",
                    line=line,
                    code="OLP518",
                )
        offsets = self.profile.offsets_alone.intersection(block.g_codes)
        if not offsets:
            return
        others = [code for code in block.g_codes if code in CYCLES or code in (DWELL, WRITE_OFFSET)]
        for code in offsets:
            letter, name = self.profile.offset_words.get(code, ""), f"G{code / 10:g}"
            if others and letter in block.by_letter:
                raise ProgramError(
                    f"{letter} may be that of {name} or of G{others[0] / 10:g}; put {name} in a block of its "
                    "own",
                    line=line,
                    code="OLP518",
                )

    def _select_offset(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        name = f"G{code / 10:g}"
        letter = self.profile.offset_words.get(code, "")
        if letter in by_letter:
            name = self.profile.offset_names.get(code, name)
            name += f"{letter}{self._integer(by_letter[letter], line)}"
        elif letter and code not in self.profile.offsets_alone:
            article = "an" if letter in "FHLMNRSX" else "a"
            what = f"{name} needs {article} {letter} word with the number of the work offset"
            raise ProgramError(what, line=line, code="OLP516")
        self.offsets.name = name

    def _write_offset(
        self, line: int, by_letter: dict[str, Word], axis_words: list[tuple[int, Word]], moves: int
    ) -> None:
        stated = self._stated_offset(line, by_letter)
        if stated is None:
            return
        kind, number, further = stated
        if number == 0 and not self.profile.g10_active:
            changes = kind != 2 or any(word.value for _, word in axis_words)
            self._check_common(line, changes=changes)
            return
        names = [self.offsets.name]
        if further:
            names, kind = self.profile.further_names(number), 2
        elif number:
            names = [f"G{53 + number}" if number < 7 else f"G59.{number - 6}"]
        name = next((name for name in names if self._work_offset(name)), names[0])
        base = self._work_mm(name)
        if kind == 2 and not self.setup.machine.located:
            raise ProgramError(
                "G10 L2 states machine coordinates, which are not known without a machine file; write one "
                "with olp init, or store the position with G10 L20",
                line=line,
                code="OLP526",
            )
        if kind == STORES_POSITION and any(self._angle_deg(n, line) for n in (name, self.offsets.name)):
            raise ProgramError(
                "G10 L20 stores a position in a work offset that is turned, which is not read; state the "
                "offset with G10 L2",
                line=line,
                code="OLP526",
            )
        if "R" in by_letter and kind == 2 and self.profile.turns_offsets:
            self.offsets.turned_deg[name] = by_letter["R"].value
        for i, word in axis_words:
            value = self.length_mm(word)
            if kind == 2:
                if not self.absolute and self.profile.g10_adds is None:
                    raise ProgramError(
                        "G10 L2 is in G91, and whether this control adds to the offset then is not known; "
                        "give G90 before it",
                        line=line,
                        code="OLP518",
                    )
                adds = not self.absolute and self.profile.g10_adds
                base[i] = base[i] + value if adds else value
            else:
                self._capture(i, word, line, moves)
                active = self.offsets.name
                self.inherited[name] = self._touch(active, self._work_mm(active), line)
                self.located[name] = self.located.get(active, active)
                base[i] = self.offsets.work_at(i, self.position[i], value)
        self.offsets.written |= dict.fromkeys(names, base)

    def _stated_offset(self, line: int, by_letter: dict[str, Word]) -> tuple[int, int, bool] | None:
        """The L and P of a block with G10, and whether P is that of a further offset; None where the block
        writes no work offset. Raises ProgramError for what is not read."""
        from olp.program.rs274.tool_tables import check_tool, words_of_tool

        if "L" not in by_letter and "P" in by_letter and by_letter["P"].value in self.profile.g10_clearances:
            return None
        if not self.profile.g10_offsets:
            raise ProgramError(
                "G10 writes tables of the control, which is not read; give what it writes in the machine or "
                "job file, and take it out",
                line=line,
                code="OLP526",
            )
        kind = round(by_letter["L"].value) if "L" in by_letter else -1
        stated = {a: self.length_mm(by_letter[a]) for a in words_of_tool(self, kind) if a in by_letter}
        if stated and "P" in by_letter:
            check_tool(self, kind, self._integer(by_letter["P"], line), stated, line)
            return None
        if kind not in (2, STORES_POSITION):
            what = f"G10 L{kind}" if kind >= 0 else "G10 without L"
            raise ProgramError(
                f"{what} writes tables of the control, which is not read; expected L2 or L20",
                line=line,
                code="OLP526",
            )
        turns = self.profile.turns_offsets and kind == 2
        if "R" in by_letter and not turns and (kind == STORES_POSITION or by_letter["R"].value != 0):
            raise ProgramError(
                "G10 R turns the work offset, which this control does not do here; leave R out",
                line=line,
                code="OLP526",
            )
        number = self._integer(by_letter["P"], line) if "P" in by_letter else -1
        further = kind == STORES_POSITION and not self.profile.g10_stores
        if not further <= number <= (_FURTHER if further else self.profile.g10_offsets):
            raise ProgramError(
                "G10 needs a P word with the number of a work offset, 1 for G54", line=line, code="OLP516"
            )
        return kind, number, further

    def _check_common(self, line: int, *, changes: bool) -> None:
        """Refuse what `changes` what some controls add to all work offsets: it is 0 here, as the machine file
        has it in each of them."""
        if changes or any(self.offsets.local):
            raise ProgramError(
                "G10 P0 writes what this control adds to all work offsets, which is not read; add it to each "
                "work offset of the machine or job file, and take this block out",
                line=line,
                code="OLP526",
            )

    def _shift(self, code: int, line: int, axis_words: list[tuple[int, Word]], moves: int) -> None:
        offsets = self.offsets
        if code in (921, 922):
            offsets.clear_shift(save=code == 922)
        elif code == 923:
            offsets.restore_shift()
        elif code == LOCAL_OFFSET:
            target = offsets.shift if self.profile.g52_is_g92 else offsets.local
            for i, word in axis_words:
                target[i] = self.length_mm(word)
            if self.profile.g52_is_g92:
                offsets.store_shift()
        else:
            work, angle_deg = self._work_mm(offsets.name), self._angle_deg(offsets.name, line)
            for i, word in axis_words:
                self._capture(i, word, line, moves, offsets.turn(angle_deg))
            values = {i: self.length_mm(word) for i, word in axis_words}
            offsets.preset(values, self.position, work, angle_deg)
            offsets.store_shift()

    def _work_mm(self, name: str) -> list[float]:
        """A work offset as the program has written it, else that of the setup (a copy), else NaN."""
        work = self._work_offset(name)
        return self.offsets.written.get(name) or (list(work.offset_mm) if work is not None else [NAN] * 3)

    def _capture(self, axis: int, word: Word, line: int, moves: int, turn: Turn | None = None) -> None:
        if math.isnan(along_words(Turning.of(turn), self.position)[axis]):
            if axis in self.touched:
                raise ProgramError(
                    f"{word.letter} is stored where a probe has touched, which only the control knows; touch "
                    "before the program, state that place as a work offset, and take both blocks out",
                    line=line,
                    code="OLP524",
                )
            raise ProgramError(
                f"{word.letter} is stored as the present position, but the axis has not been commanded yet; "
                f"{KNOWN_BY}",
                line=line,
                code="OLP524",
            )
        self.captures.append(Capture(self.first_word + word.index, axis, self.unit_mm, moves, line, turn))

    @staticmethod
    def _integer(word: Word, line: int) -> int:
        if word.value != round(word.value) or word.value < 0:
            raise ProgramError(
                f"{word.letter}{word.value:g} is not a number of a table; expected an integer from 0",
                line=line,
                code="OLP516",
            )
        return round(word.value)

    @staticmethod
    def _sum(a: Vector, b: Vector) -> Vector:
        return (a[0] + b[0], a[1] + b[1], a[2] + b[2])

    @staticmethod
    def _merged(old: Vector, new: list[tuple[int, float]]) -> Vector:
        values = list(old)
        for i, value in new:
            values[i] = value
        return (values[0], values[1], values[2])
