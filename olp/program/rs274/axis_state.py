"""The state as the reader follows it, in axis positions: offsets, tools, and the blocks that change them.

Positions are axis positions in mm; an axis whose position is not known is NaN. Only blocks with an
*event* word (`Act.EVENT`, M6, T …) come here, one by one; plain motion is read in bulk (`motion`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import field, replace
from typing import Any

from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.machine import UNKNOWN, ZERO, Place, Setup, Vector
from olp.core.toolpath import CutterCompensation, Frame, Interpolated, LengthError
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.frames import length_errors_of, tool_vector_of, touch_tool_of
from olp.program.rs274.codes import (
    ALIGNED,
    COMPENSATION_OFF,
    CUTTER_COMPENSATION,
    DWELL,
    FIRST_HOME,
    FURTHER_OFFSETS,
    HOMES,
    LENGTH_FROM_WORDS,
    LENGTH_OFF,
    LENGTHS,
    MACHINE,
    METRIC,
    PATH_MODES,
    PLANE_OF,
    ROTATION,
    SET_TOOL,
    SHIFTS,
    TILTED,
    TOOL_CHANGE,
    TRANSFORMS,
    UNDOES,
    UNDONE_BY,
    UNITS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.cutter import check_block, check_codes_along, switched_on
from olp.program.rs274.offset_state import EventBlock, OffsetState, Word
from olp.program.rs274.offsets import Offsets
from olp.program.rs274.planes import tilted
from olp.program.rs274.profiles.base import Profile
from olp.program.rs274.profiles.words import moving_m
from olp.program.rs274.state import NAN, PathMode
from olp.program.rs274.turned import Along
from olp.program.tilts import Tilt

#: L of a G10 that stores the present position.
STORES_POSITION = 20

#: What changes or uses offsets beside the move of a block.
_OFFSET_CODES = LENGTHS | HOMES | SHIFTS | WORK_OFFSETS | FURTHER_OFFSETS | {MACHINE, WRITE_OFFSET}
_UNITS = frozenset(UNITS)
#: What turns the frame in force by a work offset, or leaves it for positions of the machine.
_MAY_TURN = WORK_OFFSETS | FURTHER_OFFSETS | {MACHINE, WRITE_OFFSET}


@dataclass(frozen=True, slots=True)
class Effect:
    """What the axis words of a block mean after its events: `machine` coordinates (G53), or `home`.

    These are the axes of X, Y and Z that G28/G30 send home after the intermediate point, None of other
    blocks; `home_mm` is where they stand then. The positions of the axes `lost` are not known any more in the
    program, as it is turned otherwise."""

    machine: bool = False
    home: tuple[int, ...] | None = None
    home_mm: Place = UNKNOWN
    lost: tuple[int, ...] = ()


#: Axes beside X, Y and Z, which G28 and G30 may send home alone.
_FURTHER_AXES = frozenset("ABCUVW")
#: That of a block whose axis words mean what they say everywhere.
_AS_STATED = Effect()


@dataclass(slots=True, kw_only=True)
class AxisState(OffsetState):
    """The state whose position is in axis positions, mm; it knows offsets, lengths and frames."""

    selected: int | None = None
    turning: int = -1
    payload_kg: float = 0.0
    compensation: CutterCompensation | None = None
    contours: int = 0
    #: what tool centre point control leads evenly, as the program says it: `Frame.tip`
    leads: Interpolated = ""
    leads_stated: bool = False
    frames: list[Frame] = field(default_factory=list)
    path_modes: list[PathMode] = field(default_factory=list)
    tilts: list[Tilt] = field(default_factory=list)
    #: the position along the words of a tilted plane
    along: Along = field(default_factory=Along)
    #: the frame of the last plain motion, -1 before any
    last_frame: int = -1
    #: those of lengths, by the tool whose length is active and the work offset
    length_errors: dict[tuple[int, str], tuple[LengthError, ...]] = field(default_factory=dict)
    #: frames by the values of their fields: to look one up, none is made
    _index: dict[tuple[Any, ...], int] = field(default_factory=dict)
    #: the same by the state that they were made from
    _seen: dict[tuple[Any, ...], int] = field(default_factory=dict)
    #: what `moved_by` said of M codes
    _moved: dict[tuple[int, ...], tuple[tuple[int, ...], Place]] = field(default_factory=dict)

    @staticmethod
    def at_start(setup: Setup, profile: Profile) -> AxisState:
        start = [NAN if p is None else p for p in setup.job.start_mm]
        profile = profile.set_as(setup.machine)
        state = AxisState(profile, start, setup=setup, offsets=Offsets(setup.machine.default_work_offset))
        state.motion = None if profile.motion is None else profile.motion * 10
        if profile.arc_distance is not None:
            state.arc_distance = profile.arc_distance
        elif setup.machine.arc_centres is not None:
            state.arc_distance = {"incremental": 911, "absolute": 901}[setup.machine.arc_centres]
        else:
            state.arc_distance = -1
        state.spindle = setup.machine.default_tool
        state.payload_kg = setup.job.payload_kg
        if state.spindle is not None and setup.machine.length_active:
            state.length_tool = state.length_number = state.spindle
            state.offsets.length = state._tool(state.spindle, 1, "the tool in the spindle at the start")
        return state

    def forget(self, axes: Iterable[int] = (0, 1, 2)) -> None:
        OffsetState.forget(self, axes)
        self.along.drop()

    # -- frames ------------------------------------------------------------------------------------

    def frame(self, line: int) -> int:
        """Index of the present frame; a tool or offset that is not defined is refused here, at its first
        use."""
        if self.awaiting_number:
            raise ProgramError(
                f"G{self.awaiting_number / 10:g} has no H word, and no block up to this move has one; give H "
                "with the number of the tool length",
                line=line,
                code="OLP516",
            )
        offsets, name = self.offsets, self.offsets.name
        state = (
            self.unit, self.spindle, self.length_tool, self.payload_kg, self.compensation,
            self.inherited.get(name, name), self.located.get(name), *offsets.stated(),
        )  # fmt: skip
        known = self._seen.get(state)
        if known is None:
            known = self._seen[state] = self._frame(name, line)
        return known

    def _frame(self, name: str, line: int) -> int:
        """The same, from the state in force with this work offset."""
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
        angle_deg = self._angle_deg(name, line)
        fixed = self.offsets.plane is not None and not self.offsets.tip
        stated: dict[str, Any] = {
            "unit_mm": self.unit_mm,
            "offset_mm": self.offsets.total(base, angle_deg),
            "turn": self.offsets.turn(angle_deg),
            "length_mm": self._plane_length() if fixed else self.offsets.length,
            "tool_mm": self._tool_vector(line),
            "tool": self.spindle,
            "work_offset": name,
            "touched": self._touch(name, base, line),
            "lengths": self._lengths(name),
            "payload_kg": self.payload_kg,
            "compensation": self.compensation,
            "tip": "fixed" if fixed else self.offsets.tip,
            "directed": self.offsets.directed,
        }
        key = tuple(stated.values())
        known = self._index.get(key)
        if known is None:
            known = self._index[key] = len(self.frames)
            self.frames.append(Frame(**stated))
        return known

    def _plane_length(self) -> Vector:
        """In a tilted plane words state the tip, which has no length; it is not known where the length of the
        tool in the spindle is not in force."""
        number = self.length_tool
        tool = None if number is None else self.setup.tool(number)
        own = tool is not None and tool.length_mm[2] == self.offsets.length[2]
        return ZERO if own and self.spindle in (None, number) else (NAN, NAN, NAN)

    def _tool_vector(self, line: int) -> Vector:
        number = self.spindle if self.spindle is not None else self.length_tool
        if number is None or number == 0:
            return ZERO
        return tool_vector_of(self.setup, number, line)

    def _lengths(self, name: str) -> tuple[LengthError, ...]:
        """The errors of the active length, and of the length of the tool that touched the offset."""
        if self.length_tool is None:
            return ()
        key = self.length_tool, self.located.get(name, name)
        known = self.length_errors.get(key)
        if known is None:
            work = self._work_offset(key[1])
            touching = None if work is None else touch_tool_of(work)
            known = self.length_errors[key] = length_errors_of(self.setup, self.length_tool, touching)
        return known

    # -- events ------------------------------------------------------------------------------------

    def run(self, line: int, block: EventBlock, moves: int) -> Effect:
        """Carry out the events of one block in the order of the control; returns what its axis words mean
        then."""
        by_letter, codes, m_codes = block.by_letter, block.events, block.m_codes
        if "T" in by_letter:
            self._select_tool(line, [w for w in block.words if w.letter == "T"])
        if m_codes:
            self._change_tool(block, line)
        effect = _AS_STATED
        turning = self.profile.turns_offsets and not _MAY_TURN.isdisjoint(codes)
        angle_deg = self._angle_deg(self.offsets.name, line) if turning else 0.0
        if not _UNITS.isdisjoint(codes):
            self.unit = next(code for code in codes if code in UNITS)
        self._check_modes(codes, line)
        if "P" in by_letter or self.profile.offsets_alone:
            self._check_number(block, line)
        if self.compensation is not None:
            check_block(self, codes, line, changes_tool=self._changes_tool(m_codes))
        if self.profile.tip_codes:
            self._switch_tips(block.g_codes)
        for code in codes:
            effect = self._event(code, line, by_letter, block.axes, moves, effect)
        if self.compensation is not None:
            check_codes_along(self, block.g_codes, m_codes, line)
        if self.profile.numbers_hold:
            self._hold_numbers(block, line)
        if turning:
            self._check_turned(angle_deg, effect, line)
        return effect

    def _changes_tool(self, m_codes: Collection[int]) -> bool:
        return TOOL_CHANGE in m_codes or (SET_TOOL in m_codes and self.profile.m61_sets_tool)

    def _change_tool(self, block: EventBlock, line: int) -> None:
        """What the M codes of a block make of the tool in the spindle, and of where the axes stand."""
        by_letter, m_codes = block.by_letter, block.m_codes
        if TOOL_CHANGE in m_codes:
            if self.selected is None:
                raise ProgramError(
                    "M6 changes to a tool, but no T word comes before it; give T", line=line, code="OLP516"
                )
            self.spindle = self.selected
            self._tool(self.spindle, line, "M6")
            lengths = {430, 432}.intersection(block.events) and self.profile.length_of_spindle_tool
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
        self.forget(self.moved_by(m_codes)[0])

    def pause(self, line: int, block: EventBlock) -> None:
        """Carry out a block that is `quiet`."""
        for code in block.events:
            if code == DWELL:
                self._dwell(line, block.by_letter)
            else:
                self._path_mode(code, line, block.by_letter)

    def _hold_numbers(self, block: EventBlock, line: int) -> None:
        """Keep the D of a block, and end the tool length at H0; refuse another H or D alone that may change
        what is in force."""
        used = {letter for code in block.events if (letter := self.profile.offset_words.get(code))}
        used |= {"H"} if not LENGTHS.isdisjoint(block.events) else set()
        used |= {"D"} if not CUTTER_COMPENSATION.isdisjoint(block.events) else set()
        radius = None if self.compensation is None else self.radius_number
        for letter, before in (("H", self.length_number), ("D", radius)):
            word = block.by_letter.get(letter)
            if word is None or letter in used:
                continue
            if letter == "H" and word.value and self.awaiting_number:
                self._tool_length(self.awaiting_number, line, block.by_letter)
            elif letter == "H" and word.value == 0 and self.profile.zero_ends_length and not self.offsets.tip:
                # as G49 does
                self._tool_length(LENGTH_OFF, line, block.by_letter)
            elif before is not None and word.value != before:
                code = "G43" if letter == "H" else "G40, and G41 or G42"
                raise ProgramError(
                    f"{letter}{word.value:g} alone is in the block while {letter}{before} is in force; "
                    f"what the control makes of it is not known; give {code} with it",
                    line=line,
                    code="OLP518",
                )
        if "D" in block.by_letter:
            self.radius_number = self._integer(block.by_letter["D"], line)

    def _switch_tips(self, codes: Sequence[int]) -> None:
        """Tool centre point control with axis words or directions, which every other code of tool lengths
        ends."""
        for code in codes:
            if code in self.profile.tip_codes:
                self.offsets.tip = self.profile.tips
                self.offsets.directed = code in self.profile.direction_codes
            elif code in LENGTHS:
                self.offsets.tip, self.offsets.directed = "", False

    def _check_turned(self, before_deg: float, effect: Effect, line: int) -> None:
        """Refuse what makes a control that turns work offsets lose its position."""
        angle_deg = self._angle_deg(self.offsets.name, line)
        if any(self.offsets.shift[:2]) and (angle_deg != before_deg or (effect.machine and angle_deg)):
            what = "G53 is used in a turned work offset" if effect.machine else "a work offset is turned"
            raise ProgramError(
                f"{what} with G92 in force, which the control does not count there: it loses the position in "
                "this block; give G92.1 before it",
                line=line,
                code="OLP518",
            )

    def _select_tool(self, line: int, words: list[Word]) -> None:
        """T words: the tool that M6 changes to, with the next one behind it on some controls. A command T
        changes the tool by itself, and its length holds at once."""
        self.selected = self._integer(words[0], line)
        if len(words) > 1 and not self.profile.tools_in_block:
            raise ProgramError(
                "the word T is twice in this block; expected it once", line=line, code="OLP515", word="T"
            )
        if self.changes_nozzle(words):
            self.spindle = self.length_tool = self.selected
            self._set_length(self._tool(self.selected, line, f"T{self.selected}"))

    def changes_nozzle(self, words: Sequence[Word]) -> bool:
        """Whether a command T changes to another tool, by which the machine may move."""
        commands = self.profile.commands is not None
        return commands and any(w.letter == "T" and w.value != self.spindle for w in words)

    def lose(self, line: int) -> None:
        """The control moves by itself, and no position is known after it."""
        if any(self.offsets.shift):
            raise ProgramError(
                "the control moves by itself while G92 of X, Y or Z is in force, and what it keeps of that "
                "is not known; go back to the zero of the bed before it",
                line=line,
                code="OLP518",
            )
        self.forget()

    def moved_by(self, m_codes: Sequence[int]) -> tuple[tuple[int, ...], Place]:
        """The axes that M codes may move, ten times their numbers, and where these stand then: those of M6,
        and all of codes that are not known to leave the axes."""
        if not m_codes:
            return (), UNKNOWN
        known = self._moved.get(key := tuple(m_codes))
        if known is None:
            known = self._moved[key] = self._moved_by(moving_m(self.profile, m_codes))
        return known

    def _moved_by(self, moving: set[int]) -> tuple[tuple[int, ...], Place]:
        """The axes that such codes may move, and where these stand then."""
        machine = self.setup.machine
        if moving and moving <= self.profile.home_m:
            return (2,), machine.home_mm
        if moving != {TOOL_CHANGE}:
            return (0, 1, 2) if moving else (), UNKNOWN
        axes = (i for i, a in enumerate(AXES) if a in machine.tool_change_moves)
        return tuple(axes), machine.tool_change_mm

    def home_of(self, words: Sequence[Word]) -> Place:
        """Where a command of a printer leaves the axes: known of G28 without axes."""
        home = [(w.letter, w.value) for w in words if w.letter != "N"] == [("G", 28.0)]
        return self.setup.machine.home_mm if home else UNKNOWN

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
        elif code == LENGTH_FROM_WORDS:
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
            self.compensation = switched_on(self, code, line, by_letter)
        elif code == self.profile.return_level:
            self._return_level(line, axis_words)
        elif code in HOMES:
            alone = _FURTHER_AXES.isdisjoint(by_letter)
            home = tuple(i for i, _ in axis_words) or ((0, 1, 2) if alone else ())
            return replace(effect, home=home, home_mm=self._home(code, by_letter))
        elif code == MACHINE:
            return replace(effect, machine=True)
        elif code == WRITE_OFFSET:
            self._write_offset(line, by_letter, axis_words, moves)
        elif code in SHIFTS:
            self._shift(code, line, axis_words, moves)
        elif code in (TILTED, ALIGNED) or (code in UNDOES and self.offsets.plane is not None):
            found = tilted(self, code, line, by_letter)
            self.tilts += found
            return replace(effect, lost=(0, 1, 2)) if found else effect
        elif code in TRANSFORMS:
            from olp.program.rs274.transforms import change

            lost = change(self, code, line, by_letter, axis_words)
            self.forget(lost)
            return replace(effect, lost=lost)
        return effect

    def _home(self, code: int, by_letter: dict[str, Word]) -> Place:
        """Where G28 and G30 leave the axes. P of G30 is the number of the reference point, 2 if left out."""
        machine = self.setup.machine
        if code == FIRST_HOME:
            return machine.home_mm
        return machine.second_home_mm if "P" not in by_letter or by_letter["P"].value == 2 else UNKNOWN

    def _return_level(self, line: int, axis_words: list[tuple[int, Word]]) -> None:
        """The level that canned cycles return to, as a number of the program."""
        third = PLANES[PLANE_OF[self.plane]][2]
        if [axis for axis, _ in axis_words] != [third]:
            raise ProgramError(
                f"the return level of canned cycles is a word {AXES[third]} alone; give it",
                line=line,
                code="OLP516",
            )
        self.return_level = self.length_mm(axis_words[0][1]) / self.unit_mm

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
        transform = self.offsets.transform
        if transform is not None and not transform.code:
            # a frame of the control's own: machine positions and offsets are used beside it
            transform = None
        if transform is not None and (_OFFSET_CODES - LENGTHS).intersection(codes):
            raise ProgramError(
                "offsets, machine coordinates and reference positions are used in a turned, scaled or "
                "mirrored program, which the control refuses or takes in its own way; give "
                f"{self.profile.name_of(UNDONE_BY[transform.code])} before",
                line=line,
                code="OLP518",
            )
        if transform is not None and transform.code != ROTATION and CUTTER_COMPENSATION.intersection(codes):
            raise ProgramError(
                "cutter compensation changes its side in a mirrored or scaled program, which is not read; "
                f"give {self.profile.name_of(UNDONE_BY[transform.code])} before",
                line=line,
                code="OLP518",
            )
        if self.compensation is not None and (_OFFSET_CODES - LENGTHS | TRANSFORMS).intersection(codes):
            raise ProgramError(
                "offsets and reference positions are used in cutter compensation; give G40 before",
                line=line,
                code="OLP518",
            )

    def _path_mode(self, code: int, line: int, by_letter: dict[str, Word]) -> None:
        name = f"G{code / 10:g}"
        tolerance, merge_mm = None, 0.0
        if code == 640 and self.profile.path_tolerance:
            if "P" in by_letter:
                tolerance = by_letter["P"].value * self.unit_mm
                name += f" P{by_letter['P'].value:g}"
                merge_mm = tolerance
            if "Q" in by_letter:
                merge_mm = by_letter["Q"].value * self.unit_mm
                name += f" Q{by_letter['Q'].value:g}"
        elif code != 640:
            tolerance = 0.0
        self.path_modes.append(PathMode(line, name, tolerance, merge_mm))
