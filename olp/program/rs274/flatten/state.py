"""The state as the unroller follows it, in program coordinates and program units.

It has no tables of offsets and tools: after a change of these the position is not known. This is an error
only where the program needs the position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.units import AXES, MM_PER_INCH
from olp.core.values import dataclass
from olp.program.rs274.codes import (
    CUTTER_COMPENSATION,
    CYCLES,
    DWELL,
    END_OF_CYCLES,
    HOMES,
    INCH,
    LENGTHS,
    LINEAR,
    LOCAL_OFFSET,
    MACHINE,
    MACRO,
    METRIC,
    PATH_MODES,
    PRESET,
    PROBES,
    SHIFTS,
    SPLINES,
    TABLE_LENGTHS,
    TOOL_CHANGE,
    UNITS,
    WORK_OFFSETS,
    WRITE_OFFSET,
)
from olp.program.rs274.cycles import (
    LCNC_CLEARANCE_INCH,
    LCNC_CLEARANCE_MM,
    PLANES,
    Stroke,
    cycle_moves,
    levels,
)
from olp.program.rs274.departures import departure
from olp.program.rs274.flatten.expressions import whole
from olp.program.rs274.flatten.language import Language
from olp.program.rs274.flatten.lines import Word
from olp.program.rs274.flatten.start import Start
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.profiles.words import moving_m
from olp.program.rs274.state import BROKEN_SERIES, NAN, OPEN_RETRACT, TURNED_SERIES, State

#: A word with its value; None is a value whose unit is not known (`Language.increments_open`).
Value = tuple[str, float | None]

#: Codes of motion, without splines.
MOTIONS = LINEAR | CYCLES | PROBES | {331, 760, END_OF_CYCLES, 870, 880}
#: Codes that change the frame and hold already for the move of their own block.
_FRAMES = LENGTHS | WORK_OFFSETS
#: After these the position is not known in program coordinates; G92 states it.
_UNSETTING = (
    _FRAMES
    | (SHIFTS - {PRESET})
    | HOMES
    | PROBES
    | {WRITE_OFFSET, 101, 281, 301, 310, 331, 760, 870, 880, MACRO, 660}
)
_ODD_FRAME = frozenset({70, 71, 121, 160, 434, 435, 510, 511, 680, 682})
_EVEN_FRAME = frozenset({80, 130, 131, 150, 490, 500, 501, 690})
#: Codes whose axis words are no motion, or a motion to another position.
NO_AXES = HOMES | {DWELL, WRITE_OFFSET, LOCAL_OFFSET, PRESET, MACHINE, MACRO}
_STOPS = frozenset({0, 1, 2, 30, 60, 98, 99})
#: What left an axis at a tool change. Where that is in words, `tool_change_mm` does not say.
_BY_TOOL_CHANGE = ("M6", "state in tool_change_moves of the machine file which axes it moves")
#: Words that belong to a cycle.
CYCLE_WORDS = frozenset({"x", "y", "z", "r", "q", "p", "l", "k"})


def tracked(word: Word, value: float | None, language: Language) -> float | None:
    """The value of a word in program units; None where a missing point leaves its unit open."""
    if word.letter == "p" and word.pointed and "p" in language.counts:
        # a dwell in seconds; it is written without a point, which counts milliseconds
        return float(round(1000.0 * word.number))
    open_unit = language.increments_open and word.value is None and not word.pointed
    counts = word.letter in language.counts or word.letter in ("f", "k")
    return None if open_unit and not counts and value != 0 else value


@dataclass(slots=True)
class ProgramState(State):
    """The state whose position is in program coordinates."""

    compensated: bool = False
    odd_frame: bool = False
    spindle: int | None = None
    path: str = "G64"
    feed: float | None = None
    speed: float | None = None
    held_absolute: bool = True
    #: those that M6 may move
    tool_change_axes: tuple[int, ...] = (0, 1, 2)
    #: where axes stand that nothing has moved yet
    start: Start | None = None
    #: by axis, what left it at a place that is not known, and the key that helps (`departure`)
    left: dict[int, tuple[str, str]] = field(default_factory=dict)

    @staticmethod
    def of(profile: Profile, setup: Setup | None) -> ProgramState:
        """The state at the start of a program; the axes that M6 may move are those of `setup`."""
        moves = AXES if setup is None else setup.machine.tool_change_moves
        axes = tuple(i for i, axis in enumerate(AXES) if axis in moves)
        start = Start(setup) if setup is not None and profile.language.tool_variables else None
        return ProgramState(profile, tool_change_axes=axes, start=start)

    def position_of(self, axis: int) -> float:
        """Program position of an axis; ProgramError where it is not known."""
        value = self.position[axis]
        if math.isnan(value) and self.start is not None and not self.odd_frame:
            value = self.start.position_mm(axis) / self.unit_mm
        if math.isnan(value) or self.compensated:
            command = f"command {AXES[axis]} before in the program"
            if axis in self.left:
                name, remedy = self.left[axis]
                command = f"{name} before it may have moved it: {remedy}, or command {AXES[axis]} behind it"
            raise ProgramError(
                f"the position of {AXES[axis]} is needed here and not known off line; {command}",
                code="OLP524",
            )
        return value

    def leave_start(self, words: Sequence[Value]) -> None:
        """Take a block that was carried out: what it moves no longer stands at the start."""
        if self.start is not None:
            self.start.follow(self.codes(words), words, cycle=self.motion in CYCLES)

    def codes(self, words: Sequence[Value]) -> set[int]:
        codes = {round(value * 10) for letter, value in words if letter == "g" and value is not None}
        return {self.profile.aliases.get(code, code) for code in codes}

    def is_cycle(self, words: Sequence[Value]) -> bool:
        """Whether a block with these words makes a canned cycle."""
        codes = self.codes(words)
        motion = codes & MOTIONS
        if motion:
            return any(self.profile.codes.get(code) is Act.MOTION for code in motion & CYCLES)
        return self.motion in CYCLES and not codes & NO_AXES and any(letter in "xyz" for letter, _ in words)

    def apply(self, words: Sequence[Value]) -> None:
        """Follow one block that is not a cycle."""
        codes = self._modes(words)
        motion = codes & MOTIONS
        if self.profile.language.splines:
            motion |= codes & SPLINES
        if motion:
            self.series.begin(None)
        if motion:
            # G80 beside another motion ends the cycle, and the other code is the motion
            self.motion = next(iter(motion - {END_OF_CYCLES} or motion))
        given = {AXES.lower().index(letter): value for letter, value in words if letter in ("x", "y", "z")}
        if PRESET in codes:
            for axis, value in given.items():
                self.position[axis] = NAN if value is None else value
        elif MACHINE in codes:
            self.forget(given)
        elif not codes & NO_AXES and given:
            self._move(given)
        if any(letter in "@^" for letter, _ in words):
            self.forget()
        reached = [self.position[a] if a in given else NAN for a in range(3)]
        self._after(codes)
        if self.absolute and not codes & (NO_AXES | _UNSETTING - _FRAMES) and not self.odd_frame:
            self.position = [r if math.isnan(p) else p for p, r in zip(self.position, reached, strict=True)]

    def _modes(self, words: Sequence[Value]) -> set[int]:
        codes = self.codes(words)
        for unit in UNITS:
            if unit in codes:
                self._change_unit(unit)
        self.take(codes)
        if codes & PATH_MODES:
            self._path_mode(codes, words)
        if codes & CUTTER_COMPENSATION:
            self.compensated = True
        self.odd_frame = (self.odd_frame or bool(codes & _ODD_FRAME)) and not codes & _EVEN_FRAME
        for letter, value in words:
            if letter == "f":
                self.feed = value
            elif letter == "s":
                self.speed = value
            elif letter == "m" and value is not None:
                if value in (3, 4, 5):
                    self.spindle = int(value)
                else:
                    self._forget_moved(round(10.0 * value))
        return codes

    def _forget_moved(self, code: int) -> None:
        """The position of axes that an M code, ten times its number, may move is not known from here on."""
        profile = self.profile
        if not moving_m(profile, (code,)):
            return
        moved = self.tool_change_axes if code == TOOL_CHANGE else (0, 1, 2)
        found = departure((), {code}) if code != TOOL_CHANGE else _BY_TOOL_CHANGE
        self.left |= dict.fromkeys(moved, found) if found is not None else {}
        self.forget(moved)
        if self.start is not None:
            self.start.moved(moved)

    def _after(self, codes: set[int]) -> None:
        if 400 in codes and self.compensated:
            self.compensated = False
            self.forget()
        unsetting = codes & _UNSETTING
        self.series.broken |= bool(unsetting) or PRESET in codes
        if unsetting:
            self.left = {}
        along_z = self.profile.lengths_along_z and unsetting <= TABLE_LENGTHS
        if unsetting and along_z and not self.odd_frame:
            self.forget((2,))
        elif unsetting or self.odd_frame:
            self.forget()

    def _move(self, given: dict[int, float | None]) -> None:
        for axis, value in given.items():
            self.left.pop(axis, None)
            if self.motion not in LINEAR | SPLINES or value is None:
                self.position[axis] = NAN
            elif self.absolute:
                self.position[axis] = value
            else:
                self.position[axis] += value

    def _change_unit(self, unit: int) -> None:
        if self.unit != unit:
            factor = NAN if self.unit is None else MM_PER_INCH if unit == METRIC else 1 / MM_PER_INCH
            self.series.broken = True
            self.position = [p * factor for p in self.position]
            self.unit = unit

    def _path_mode(self, codes: set[int], words: Sequence[Value]) -> None:
        if 640 in codes:
            given = [(letter, value) for letter, value in words if letter in ("p", "q") and value is not None]
            self.path = "G64" + "".join(f" {letter.upper()}{value:.9g}" for letter, value in given)
        else:
            self.path = "G61.1" if 611 in codes else "G61"

    def cycle(self, words: Sequence[Value], clearance: float | None) -> tuple[Stroke, ...]:
        """Follow a block that makes a canned cycle; its strokes. ProgramError where a value is not known."""
        for letter, value in words:
            if letter in ("a", "b", "c", "u", "v", "w", "@", "^"):
                raise ProgramError(
                    f"a canned cycle moves {letter.upper()}, which is not understood", code="OLP531"
                )
            if letter == "m" and value in _STOPS:
                raise ProgramError(
                    f"M{value:g} in the block of a canned cycle; put it into its own block", code="OLP518"
                )
        codes = self._modes(words)
        if self.inverse_time or self.compensated or self.odd_frame:
            raise ProgramError(
                "a canned cycle is in inverse time, cutter compensation or a turned frame, "
                "which is not read; end these modes first",
                code="OLP518",
            )
        chosen = codes & CYCLES
        code = next(iter(chosen)) if chosen else self.motion
        if code is None:
            raise ProgramError("a canned cycle has no code; give one, such as G81", code="OLP531")
        series = self.series
        if self.motion not in CYCLES:
            series.begin(None)
        elif code != self.motion and self.profile.cycles.new_code_forgets:
            series.held = {}
        self.motion = code
        given = {letter.upper(): value for letter, value in words if letter in CYCLE_WORDS}
        first, second, tool = PLANES[self.plane // 10]
        if series.initial is None:
            series.begin(self.position_of(tool))
        initial = NAN if series.initial is None else series.initial
        depth = AXES[tool]
        if series.broken and not self.profile.cycles.keeps_numbers:
            raise ProgramError(BROKEN_SERIES, code="OLP518")
        follows = self.profile.cycles.levels_follow_distance
        turned = follows and series.held and self.held_absolute is not self.absolute
        # those of the other mode may stay levels
        stay = self.profile.cycles.levels_stay and given.keys().isdisjoint((depth, "R"))
        if turned and not stay and not {depth, "R"} <= given.keys():
            raise ProgramError(TURNED_SERIES, code="OLP518")
        if not turned or not stay:
            self.held_absolute = self.absolute
        series.hold(given, depth)
        repeats = self._repeats(given)
        if repeats == 0:
            if {AXES[first], AXES[second]} & given.keys():
                raise ProgramError(
                    "a canned cycle with zero repeats stores its values, and whether it goes to its place is "
                    "not known; leave the place out",
                    code="OLP531",
                )
            return ()
        xy, step = self._hole_and_step(given, first, second)
        if self.retract < 0:
            raise ProgramError(OPEN_RETRACT, code="OLP532")
        r, z = levels(
            self._needed("R"), self._needed(depth), absolute=bool(self.held_absolute), initial_z=initial
        )
        self.position_of(tool)
        strokes = cycle_moves(
            code,
            start=(self.position[0], self.position[1], self.position[2]),
            xy=xy,
            step=step,
            repeats=repeats,
            r=r,
            z=z,
            q=self._optional("Q"),
            p=self._optional("P"),
            retract_to_r=self.retract_to_r,
            initial_z=initial,
            plane=self.plane // 10,
            clearance=self._clearance(code, clearance),
            rules=self.profile.cycles,
        )
        self.position = list(strokes[-1].point)
        self._after(codes)
        return strokes

    def _repeats(self, given: dict[str, float | None]) -> int:
        for letter in self.profile.cycles.repeat_words:
            if letter in given:
                count = whole(self._known(letter, given[letter]), f"the repeat count {letter}")
                return count or self._no_repeats()
        return 1

    def _no_repeats(self) -> int:
        if not self.profile.cycles.stores:
            raise ProgramError("the cycle is repeated L0 times; expected L1 or more", code="OLP531")
        return 0

    def _hole_and_step(
        self, given: dict[str, float | None], first: int, second: int
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        xy, step = [0.0, 0.0], [0.0, 0.0]
        for i, axis in enumerate((first, second)):
            letter = AXES[axis]
            if letter not in given:
                xy[i] = self.position_of(axis)
                continue
            value = self._known(letter, given[letter])
            xy[i] = value
            if not self.absolute:
                step[i] = value
                xy[i] += self.position_of(axis)
        return (xy[0], xy[1]), (step[0], step[1])

    def _known(self, letter: str, value: float | None) -> float:
        if value is None:
            raise ProgramError(
                f"{letter} has no decimal point, so a parameter decides whether it counts least increments "
                'or whole units; write the point, or state decimal_point = "calculator" in the machine file',
                code="OLP541",
            )
        return value

    def _needed(self, letter: str) -> float:
        if letter not in self.series.held:
            raise ProgramError(f"the canned cycle has no {letter} word", code="OLP531")
        return self._known(letter, self.series.held[letter])

    def _optional(self, letter: str) -> float | None:
        held = self.series.held
        return None if letter not in held else self._known(letter, held[letter])

    def _clearance(self, code: int, clearance: float | None) -> float:
        if clearance is not None or code not in (730, 830):
            return clearance or 0.0
        if self.profile.cycles.peck_by_parameter:
            raise ProgramError(
                f"G{code // 10} pecks with a clearance that a parameter of the control sets; "
                "give peck_clearance_mm (--peck-clearance-mm)",
                code="OLP541",
            )
        if self.unit is None:
            raise ProgramError(
                f"G{code // 10} before any G20 or G21, on which its peck clearance depends", code="OLP541"
            )
        return LCNC_CLEARANCE_INCH if self.unit == INCH else LCNC_CLEARANCE_MM
