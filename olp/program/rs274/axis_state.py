"""The state as the reader follows it, in axis positions: offsets, tools, and the blocks that change them.

Positions are axis positions in mm; an axis whose position is not known is NaN. Only blocks with an
*event* word (`Act.EVENT`, M6, T …) come here, one by one; plain motion is read in bulk (`motion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector, WorkOffset
from olp.core.toolpath import CutterCompensation, Frame, LengthError, Touch
from olp.core.values import dataclass
from olp.program.frames import length_errors_of, tool_vector_of, touch_of, touch_tool_of
from olp.program.rs274.codes import (
    COMPENSATION_BY_DIAMETER,
    COMPENSATION_LEFT,
    COMPENSATION_OFF,
    CUTTER_COMPENSATION,
    DWELL,
    FURTHER_OFFSETS,
    HOMES,
    LENGTH_FROM_WORDS,
    LENGTHS,
    LOCAL_OFFSET,
    MACHINE,
    METRIC,
    PATH_MODES,
    PLANE_OF,
    SHIFTS,
    UNITS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.offsets import Offsets
from olp.program.rs274.profiles.base import Profile, increment
from olp.program.rs274.state import NAN, Capture, PathMode, State

#: M6, as ten times its number.
TOOL_CHANGE = 60
#: M61, as ten times its number.
SET_TOOL = 610

#: L of a G10 that stores the present position.
STORES_POSITION = 20

#: What changes or uses offsets beside the move of a block.
_OFFSET_CODES = LENGTHS | HOMES | SHIFTS | WORK_OFFSETS | FURTHER_OFFSETS | {MACHINE, WRITE_OFFSET}
#: RS-274's order of execution within a block; other codes come last.
_RANK = {
    code: rank
    for rank, codes in enumerate(((DWELL,), UNITS, LENGTHS, WORK_OFFSETS, PATH_MODES))
    for code in codes
}


@dataclass(frozen=True, slots=True)
class Word:
    """One word of a block: upper-case letter, number as written, index in the program's word table."""

    letter: str
    value: float
    index: int
    pointed: bool = True


@dataclass(frozen=True, slots=True)
class Effect:
    """What the axis words of a block mean after its events: `machine` coordinates (G53), or `home`, the axes
    that G28/G30 send home after the intermediate point."""

    machine: bool = False
    home: tuple[int, ...] = ()


@dataclass(slots=True, kw_only=True)
class AxisState(State):
    """The state whose position is in axis positions, mm; it knows offsets, lengths and frames."""

    setup: Setup
    offsets: Offsets
    inherited: dict[str, Touch | None] = field(default_factory=dict)
    located: dict[str, str] = field(default_factory=dict)
    length_tool: int | None = None
    selected: int | None = None
    spindle: int | None = None
    turning: int = -1
    length_unit: int = METRIC
    payload_kg: float = 0.0
    compensation: CutterCompensation | None = None
    frames: list[Frame] = field(default_factory=list)
    captures: list[Capture] = field(default_factory=list)
    path_modes: list[PathMode] = field(default_factory=list)
    _index: dict[Frame, int] = field(default_factory=dict)

    @staticmethod
    def at_start(setup: Setup, profile: Profile) -> AxisState:
        start = [NAN if p is None else p for p in setup.job.start_mm]
        state = AxisState(profile, start, setup=setup, offsets=Offsets(setup.machine.default_work_offset))
        state.motion = None if profile.motion is None else profile.motion * 10
        state.spindle = setup.machine.default_tool
        state.payload_kg = setup.job.payload_kg
        if state.spindle is not None and setup.machine.length_active:
            state.length_tool = state.spindle
            state.offsets.length = state._tool(state.spindle, 1, "the tool in the spindle at the start")
        return state

    # -- frames ------------------------------------------------------------------------------------

    def frame(self, line: int) -> int:
        """Index of the present frame; a tool or offset that is not defined is refused here, at its first
        use."""
        name = self.offsets.name
        work = self._work_offset(name)
        base = self.offsets.written.get(name)
        if base is None:
            if work is None:
                raise ProgramError(
                    f'work offset {name} is used but not defined; give [work_offsets."{name}"] '
                    "in the machine or job file",
                    line=line,
                    code="OLP520",
                    missing=("work_offsets", name),
                )
            base = list(work.offset_mm)
        if work is not None and any(work.rotation_deg):
            raise ProgramError(
                f"work offset {name} is rotated, which is not read in this dialect; "
                "state it with A_deg = B_deg = C_deg = 0",
                line=line,
                code="OLP523",
            )
        frame = Frame(
            unit_mm=self.unit_mm,
            offset_mm=self.offsets.total(base),
            length_mm=self.offsets.length,
            tool_mm=self._tool_vector(line),
            tool=self.spindle,
            work_offset=name,
            touched=self._touch(name, base, line),
            lengths=self._lengths(name),
            payload_kg=self.payload_kg,
            compensation=self.compensation,
        )
        known = self._index.get(frame)
        if known is None:
            known = self._index[frame] = len(self.frames)
            self.frames.append(frame)
        return known

    def _work_offset(self, name: str) -> WorkOffset | None:
        return self.setup.work_offset(name) or self.setup.work_offset(name.replace("P", " P"))

    def _tool_vector(self, line: int) -> Vector:
        number = self.spindle if self.spindle is not None else self.length_tool
        if number is None or number == 0:
            return ZERO
        return tool_vector_of(self.setup, number, line)

    def _touch(self, name: str, base: Sequence[float], line: int) -> Touch | None:
        """Where a work offset was touched off. One that G10 L20 sets takes over the point of the offset in
        force; one that G10 L2 changes keeps its own point."""
        if name in self.inherited:
            return self.inherited[name]
        work = self._work_offset(name) or WorkOffset(name, (base[0], base[1], base[2]))
        return touch_of(self.setup, work, line)

    def _lengths(self, name: str) -> tuple[LengthError, ...]:
        """The errors of the active length, and of the length of the tool that touched the offset."""
        if self.length_tool is None:
            return ()
        name = self.located.get(name, name)
        work = self._work_offset(name)
        return length_errors_of(self.setup, self.length_tool, None if work is None else touch_tool_of(work))

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

    # -- values ------------------------------------------------------------------------------------

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

    # -- events ------------------------------------------------------------------------------------

    def run(self, line: int, words: Sequence[Word], codes: Sequence[int], moves: int) -> Effect:
        """Carry out the events of one block in the order of the control; returns what its axis words mean
        then."""
        by_letter = {w.letter: w for w in words}
        axis_words = [(i, by_letter[a]) for i, a in enumerate("XYZ") if a in by_letter]
        m_codes = [round(w.value * 10) for w in words if w.letter == "M"]
        if "T" in by_letter:
            self.selected = self._integer(by_letter["T"], line)
        if TOOL_CHANGE in m_codes:
            if self.selected is None:
                raise ProgramError(
                    "M6 changes to a tool, but no T word comes before it; give T", line=line, code="OLP516"
                )
            self.spindle = self.selected
            self._tool(self.spindle, line, "M6")
            lengths = {430, 432}.intersection(codes) and self.profile.length_of_spindle_tool
            if lengths and not (by_letter["H"].value if "H" in by_letter else self.spindle):
                raise ProgramError(
                    "a tool length beside M6 is that of the tool before the change; put it into the next "
                    "block",
                    line=line,
                    code="OLP518",
                )
        if SET_TOOL in m_codes and self.profile.m61_sets_tool:
            if "Q" not in by_letter:
                raise ProgramError("M61 needs a Q word with the tool number", line=line, code="OLP516")
            self.spindle = self._integer(by_letter["Q"], line)
        if any(self.may_move(m) for m in m_codes):
            self.forget()
        effect = Effect()
        self.unit = next((code for code in codes if code in UNITS), self.unit)
        self._check_modes(codes, line)
        for code in sorted(codes, key=lambda code: _RANK.get(code, len(_RANK))):
            effect = self._event(code, line, by_letter, axis_words, moves, effect)
        return effect

    def may_move(self, m10: int) -> bool:
        """Whether an M code may move axes: M6, and codes that are not known to leave the axes where they
        are."""
        if m10 == SET_TOOL and self.profile.m61_sets_tool:
            return False
        return m10 % 10 != 0 or m10 // 10 not in self.profile.harmless_m

    def _event(
        self,
        code: int,
        line: int,
        by_letter: dict[str, Word],
        axis_words: list[tuple[int, Word]],
        moves: int,
        effect: Effect,
    ) -> Effect:
        if code == DWELL:
            self._dwell(line, by_letter)
        if code == LENGTH_FROM_WORDS:
            values = [(i, self.length_mm(w)) for i, w in axis_words]
            self._set_length(self._merged(self.offsets.length, values))
        elif code in LENGTHS:
            self._tool_length(code, line, by_letter)
        elif code in WORK_OFFSETS or code in FURTHER_OFFSETS:
            self._select_offset(code, line, by_letter)
        elif code in PATH_MODES:
            self._path_mode(code, line, by_letter)
        elif code == COMPENSATION_OFF:
            self.compensation = None
        elif code in CUTTER_COMPENSATION:
            self._cutter_compensation(code, line, by_letter)
        elif code in HOMES:
            if not axis_words:
                return replace(effect, home=(0, 1, 2))
            return replace(effect, home=tuple(i for i, _ in axis_words))
        elif code == MACHINE:
            return replace(effect, machine=True)
        elif code == WRITE_OFFSET:
            self._write_offset(line, by_letter, axis_words, moves)
        elif code in SHIFTS:
            self._shift(code, line, axis_words, moves)
        return effect

    def _dwell(self, line: int, by_letter: dict[str, Word]) -> None:
        """G4: ISO controls take its time from X too; RS-274 takes it from P only, so axis words still
        move."""
        if "P" in by_letter and by_letter["P"].value < 0:
            raise ProgramError("a dwell is negative; expected P0 or more", line=line, code="OLP516")
        if self.profile.axis_dwell and (
            any(a in by_letter for a in "YZ")
            or any(w.letter == "G" and w.value in (0, 1, 2, 3) for w in by_letter.values())
        ):
            raise ProgramError(
                "a dwell and a motion are in one block; put the dwell into its own block",
                line=line,
                code="OLP518",
            )

    def _tool_length(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        if code == 490:
            self._set_length(ZERO)
            self.length_tool = None
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
        self.length_tool = number or None

    def _set_length(self, vector: Vector) -> None:
        self.offsets.length, self.length_unit = vector, self.unit or METRIC

    def _check_modes(self, codes: Sequence[int], line: int) -> None:
        """Refuse codes in modes in which the control refuses them or loses its position."""
        mixed = self.profile.lengths_keep_unit and any(self.offsets.length)
        if mixed and (self.unit or METRIC) != self.length_unit and _OFFSET_CODES.intersection(codes):
            raise ProgramError(
                "the tool length in force was set in the other unit, and the control does not convert it: it "
                "loses the position in this block; give G49 before G20 or G21, and G43 after it",
                line=line,
                code="OLP518",
            )
        if self.compensation is not None and (_OFFSET_CODES - LENGTHS).intersection(codes):
            raise ProgramError(
                "offsets and reference positions are used in cutter compensation; give G40 before",
                line=line,
                code="OLP518",
            )

    def _cutter_compensation(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        """G41 and G42: D is the number of a tool, or a diameter; without it the tool in the spindle counts on
        controls that take its length too."""
        radius_mm = 0.0
        if code in COMPENSATION_BY_DIAMETER:
            radius_mm = self.length_mm(by_letter["D"]) / 2 if "D" in by_letter else 0.0
        else:
            number = self._integer(by_letter["D"], line) if "D" in by_letter else 0
            if not number and self.profile.length_of_spindle_tool:
                number = self.spindle or 0
            tool = self.setup.tool(number)
            radius_mm = 0.0 if tool is None else tool.radius_mm
        left = (code in COMPENSATION_LEFT) == (radius_mm >= 0)
        self.compensation = CutterCompensation(PLANE_OF[self.plane], left, abs(radius_mm))

    def _select_offset(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        if code in (541, 1540):
            if "P" not in by_letter:
                raise ProgramError(
                    f"G{code / 10:g} needs a P word with the number of the work offset",
                    line=line,
                    code="OLP516",
                )
            name = f"G{code / 10:g}P{self._integer(by_letter['P'], line)}"
        else:
            name = f"G{code / 10:g}"
        self.offsets.name = name

    def _path_mode(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        name = f"G{code / 10:g}"
        tolerance, merges = None, False
        if code == 640 and self.profile.path_tolerance:
            if "P" in by_letter:
                tolerance = by_letter["P"].value * self.unit_mm
                name += f" P{by_letter['P'].value:g}"
                merges = "Q" not in by_letter or by_letter["Q"].value != 0
            if "Q" in by_letter:
                name += f" Q{by_letter['Q'].value:g}"
        elif code != 640:
            tolerance = 0.0
        self.path_modes.append(PathMode(line, name, tolerance, merges))

    def _write_offset(
        self, line: int, by_letter: dict[str, Word], axis_words: list[tuple[int, Word]], moves: int
    ) -> None:
        kind = round(by_letter["L"].value) if "L" in by_letter else -1
        if kind not in (2, STORES_POSITION):
            what = f"G10 L{kind}" if kind >= 0 else "G10 without L"
            raise ProgramError(
                f"{what} writes tables of the control, which is not read; expected L2 or L20",
                line=line,
                code="OLP526",
            )
        if "R" in by_letter and (kind == STORES_POSITION or by_letter["R"].value != 0):
            raise ProgramError(
                "G10 R rotates the work offset, which is not read; leave R out", line=line, code="OLP526"
            )
        number = self._integer(by_letter["P"], line) if "P" in by_letter else -1
        if not 0 <= number <= self.profile.g10_offsets:
            raise ProgramError(
                "G10 needs a P word with the number of a work offset, 1 for G54", line=line, code="OLP516"
            )
        name = self.offsets.name if number == 0 else f"G{53 + number}" if number < 7 else f"G59.{number - 6}"
        base = self._work_mm(name)
        if kind == 2 and not self.setup.machine.located:
            raise ProgramError(
                "G10 L2 states machine coordinates, which are not known without a machine file; write one "
                "with olp init, or store the position with G10 L20",
                line=line,
                code="OLP526",
            )
        for i, word in axis_words:
            value = self.length_mm(word)
            if kind == 2:
                adds = not self.absolute and self.profile.g10_adds
                base[i] = base[i] + value if adds else value
            else:
                self._capture(i, word, line, moves)
                active = self.offsets.name
                self.inherited[name] = self._touch(active, self._work_mm(active), line)
                self.located[name] = self.located.get(active, active)
                base[i] = self.offsets.work_at(i, self.position[i], value)
        self.offsets.written[name] = base

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
            work = self._work_mm(offsets.name)
            for i, word in axis_words:
                self._capture(i, word, line, moves)
                offsets.preset(i, self.position[i], work, self.length_mm(word))
            offsets.store_shift()

    def _work_mm(self, name: str) -> list[float]:
        """A work offset as the program has written it, else that of the setup (a copy), else NaN."""
        work = self._work_offset(name)
        return self.offsets.written.get(name) or (list(work.offset_mm) if work is not None else [NAN] * 3)

    def _capture(self, axis: int, word: Word, line: int, moves: int) -> None:
        if math.isnan(self.position[axis]):
            raise ProgramError(
                f"{word.letter} is stored as the present position, but the axis has not been commanded yet; "
                "give start_mm in the job file or command the axis first",
                line=line,
                code="OLP524",
            )
        self.captures.append(Capture(word.index, axis, self.unit_mm, moves, line))

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
