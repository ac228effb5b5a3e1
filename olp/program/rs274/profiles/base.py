"""What a profile of the RS-274 family is: what each word of a control means for the path.

The interpreter, the support matrix of `olp inspect` and the documentation use the same table of a
profile. G codes are keyed by ten times their number (G5.1 is 51).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import field, replace
from enum import IntEnum, auto
from functools import cache
from typing import Any, TypeVar

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import Machine
from olp.core.patterns import pattern
from olp.core.toolpath import Interpolated
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.contours.rules import NGC_CONTOURS, ContourRules
from olp.program.dialect import SKIP_MARK, Dialect, Row, Support
from olp.program.rs274.block_rules import OTHER_RULES, BlockRules
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.codes import (
    COMMON_CYCLES,
    COMPENSATION_OFF,
    CUTTER_COMPENSATION,
    M_AFTER_EXACT,
    M_ENDS,
    PROBES,
    RETRACT_TO_INITIAL,
    RETRACT_TO_R,
)
from olp.program.rs274.commands import Commands
from olp.program.rs274.cycle_rules import CycleRules
from olp.program.rs274.flatten.language import UNROLL, Language
from olp.program.rs274.profiles.words import remedied, word_rows
from olp.program.text.line_ends import split

#: One number, or an array of them.
Number = TypeVar("Number", float, Array)


class Act(IntEnum):
    """What a G code does to the reading of a program."""

    UNCHANGED = auto()  #: nothing: its bytes are unchanged
    MOTION = auto()
    PLANE = auto()
    DISTANCE = auto()
    ARC_DISTANCE = auto()
    FEED = auto()
    RETRACT = auto()
    CONTROL = auto()  #: the control moves by itself: no position is known after it
    EVENT = auto()  #: changes frames, units, tools or path mode; handled block by block
    REFUSE = auto()


@cache
def _in_tenths(whole: frozenset[int], tenths: frozenset[int]) -> frozenset[int]:
    return frozenset(10 * m for m in whole) | tenths


_SUPPORT = {Act.UNCHANGED: Support.UNCHANGED, Act.REFUSE: Support.REFUSED, Act.MOTION: Support.CORRECTED}


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile(Dialect):
    """One control's reading of word-address text.

    - `codes` and `refusals`: what becomes of each G code, and why it is refused. `aliases`: codes that do
      here what another code does elsewhere; one that leads to `NO_CODE` is none of this control.
    - `harmless_m` are the M codes that move no axis; `harmless_m_tenths` those with a decimal, ten times
      their number. `m_refusals`: M codes that are refused, ten times their number, and what they do, and
      `m_instead` what to do about them where unrolling does not help.
    - `motion`, `initial_retract`: G codes that are in force at the start (None: none, or a setting of the
      control, which the machine file states as `motion` and `cycle_return`). `arc_distance`: whether
      centres are absolute (901) or distances (911) at the start; None is a setting of the control, which the
      machine file states as `arc_centres`.
    - `increments_without_point`: X100 means 100 least increments, not 100 mm. `feed_without_point`: F100 is
      100 mm/min all the same.
    - `g52_is_g92`: G52 writes the same offset as G92. `g10_offsets`: the largest P of G10 L2 and L20, 0 where
      it writes no work offset. `g10_adds`: in G91 G10 L2 adds to the offset; None is not known, and refused.
      `g10_stores`: G10 L20
      stores the present position, else it writes the offset G54.1 P. `g10_tools`: the L with which G10
      writes the tables of tools. `g10_active`: P0 is the offset in force, else one that is added to all.
      `further_offsets` name the offsets that G10 L20 writes, with P; `first_further` is the code of P1,
      where 20 of them have codes of their own. `offset_words`: the letter of the number of a work offset
      beside a code, which the code may go without where it is in `offsets_alone`. `offset_names`: the name
      of these offsets where it is not that of the code. `turns_offsets`: a work offset may be turned about
      Z, which R of G10 L2 states too. `scales_axes`: G51 takes a factor for each axis, too.
      `scales_by_parameter`: a parameter of the control sets the unit of these factors, which have no point.
      `mirrors_at_zero`: mirror images are at the zero of the work offset, and their axes have 0.
    - `polar`: X and Y between G16 and G15 are radius and angle about program zero, which the unroller writes
      as X and Y.
    - `return_level`: the code whose word of the tool axis states the level that canned cycles return to, 0
      where they return to the one before their series. `return_modes`: the M codes that choose between that
      level and R, and the G codes that do the same elsewhere.
    - `still_with`: codes that are refused but for a block of their own with this letter and one of its
      numbers, where they change nothing of the path.
    - `still_g`: codes of no table that the machine file states to change nothing of the path, ten times their
      numbers.
    - `lathe_words`: letters that together beside codes show a program of a lathe, and what they do there.
    - `cycles_apart`: canned cycles and G80 are a separate modal group.
    - `axis_dwell`: G4 takes its time from X and U, too, and counts milliseconds where it has no point.
    - `exact_stop`: G61 stops at the end of each block, as G9 does in one, and G62 and G63 end it as G64 does.
      A G0 begins and ends at rest, and M5 and M9 come after the motion of their block.
    - `m61_sets_tool`: M61 Q says which tool is in the spindle. `tools_in_block`: a block may have two T
      words, the tool to change to and the one to make ready. `length_of_spindle_tool`: G43 without H, and
      with H0, takes the length of that tool. `spindle_words`: HA and DA name its length and its radius.
      `numbers_hold`: H and D alone may change a length and a radius that are in force. `zero_ends_length`:
      H0 alone does what G49 does. `radius_holds`: G41 and G42 without D take the D before them.
      `lengths_along_z`: a tool length counts along Z alone. `lengths_keep_unit`: a change of unit does not
      convert the length in force.
    - `feed_words_end`: each G94 and G95 forgets F. `feed_before_unit`: F of a block counts before its G20 or
      G21. `least_inverse_feed`: units per minute, the least feed of a block in G93. `m_with_motion`: M codes
      carried out along with the motion, without a rest.
    - `dwell_words`: the letters that state the time of G4. `dwell_ms`: P counts milliseconds, whatever its
      form, `dwell_in_seconds`: seconds.
    - `home_m`: the M codes that move the tool axis Z to the first reference position, ten times their number.
    - `length_awaits_number`: G43 without H takes the length of the H that a later block states, and no
      move may come before it.
    - `g10_clearances`: the P with which G10 without L states by R how far pecks rise, which moves no point.
    - `tip_codes`: codes that switch tool centre point control on, where a machine has rotary axes: words
      state the tip then, until a code of tool lengths. Behind `direction_codes`, which are some of them,
      words state the direction of the tool, and none a rotary axis.
    - `plane_codes`: codes of tilted planes, which are read there, too.
    - `commands`: each line is a command with parameters, and no code holds for the next line. None: lines are
      blocks of words.
    - `brackets_by_option`: whether (a) is a comment is an option of the firmware, which the machine file
      states as `bracket_comments`.
    - `inert`: whole lines that are no words and move nothing, such as names of programs and labels.
    - `translator` turns a text with statements of its own into words of this family (`translation`).
      `machine_moves_keep_length`: the tool length counts in G53 too. `machine_moves_absolute`: its words are
      axis positions in G91 too. `increments_take_offsets`: an increment
      behind a change of offsets moves by that change as well. `lengths_follow_plane`: lengths count along the
      tool axis of the plane. `further_turns` is the word of the turns of an arc beyond its first part, where
      P does not count them all, `absolute_centre` the function around an absolute coordinate of a centre.
    - `text`, `rules`, `cycles`, `contours`, `language`: what may be in a line and in a block, how canned
      cycles and the tool's path along contours are made, and how parametric programs are written.
    - `metric`: the word of lengths in mm. `cleared`: modes without cycle, tool length and cutter
      compensation. `dwell`: the letter of a time in seconds.
    - `written_ending`: the ending of files that are written for the control. `program_number`: a program
      begins with % and an O number, and ends with %. `touch_log`: comments (LOG, ...) write the results of
      touches to a file.
    """

    first: tuple[bytes, ...] = (b"%", b"O|:")
    long_texts: bool = True
    payload_comments: bool = True
    unrolls_with_tools: bool = True
    expands_cycles: bool = True
    metric: str = "G21"
    cleared: str = "G80 G40 G49"
    dwell: str = "P"
    written_ending: str = "nc"
    program_number: bool = False
    touch_log: bool = False
    codes: Mapping[int, Act]
    refusals: Mapping[int, str]
    aliases: Mapping[int, int] = field(default_factory=dict)
    harmless_m: frozenset[int]
    harmless_m_tenths: frozenset[int] = frozenset()
    m_refusals: Mapping[int, str] = field(default_factory=lambda: M_REFUSALS)
    m_instead: Mapping[int, str] = field(default_factory=lambda: M_INSTEAD)
    motion: int | None = None
    initial_retract: int | None
    arc_distance: int | None = 911
    increments_without_point: bool = False
    feed_without_point: bool = False
    g52_is_g92: bool = False
    g10_offsets: int = 6
    g10_adds: bool | None = False
    g10_stores: bool = True
    g10_tools: frozenset[int] = frozenset()
    g10_active: bool = False
    further_offsets: tuple[str, ...] = ("G54.1",)
    first_further: int = 0
    offset_words: Mapping[int, str] = field(default_factory=lambda: {541: "P", 1540: "P"})
    offset_names: Mapping[int, str] = field(default_factory=dict)
    offsets_alone: frozenset[int] = frozenset()
    turns_offsets: bool = False
    polar: bool = False
    scales_axes: bool = False
    scales_by_parameter: bool = False
    mirrors_at_zero: bool = False
    return_level: int = 0
    return_modes: Mapping[int, int] = field(default_factory=dict)
    still_with: Mapping[int, tuple[str, frozenset[float]]] = field(default_factory=dict)
    still_g: frozenset[int] = frozenset()
    lathe_words: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    cycles_apart: bool = False
    axis_dwell: bool = False
    exact_stop: bool = False
    m61_sets_tool: bool = False
    tools_in_block: bool = False
    length_of_spindle_tool: bool = False
    spindle_words: bool = False
    numbers_hold: bool = False
    zero_ends_length: bool = False
    radius_holds: bool = False
    lengths_along_z: bool = False
    lengths_keep_unit: bool = False
    feed_words_end: bool = False
    feed_before_unit: bool = False
    least_inverse_feed: float = 0.0
    m_with_motion: frozenset[int] = frozenset()
    dwell_ms: bool = False
    dwell_in_seconds: bool = False
    home_m: frozenset[int] = frozenset()
    length_awaits_number: bool = False
    g10_clearances: frozenset[int] = frozenset()
    dwell_words: str = "P"
    tip_codes: frozenset[int] = frozenset()
    direction_codes: frozenset[int] = frozenset()
    plane_codes: frozenset[int] = frozenset()
    leads: Interpolated = "axes"
    commands: Commands | None = None
    brackets_by_option: bool = False
    inert: re.Pattern[bytes] | None = None
    skip_mark: re.Pattern[bytes] | None = SKIP_MARK
    translator: Callable[[bytes], Any] | None = None
    machine_moves_keep_length: bool = False
    machine_moves_absolute: bool = False
    increments_take_offsets: bool = False
    lengths_follow_plane: bool = False
    further_turns: bytes = b""
    absolute_centre: bytes = b""
    text: BlockText
    rules: BlockRules = OTHER_RULES
    contours: ContourRules = NGC_CONTOURS
    cycles: CycleRules
    language: Language

    @property
    def late_m(self) -> frozenset[int]:
        """The M codes that act after the motion of their block."""
        return M_ENDS | M_AFTER_EXACT if self.exact_stop else M_ENDS

    @property
    def still_m(self) -> frozenset[int]:
        """The M codes that move no axis, ten times their number."""
        return _in_tenths(self.harmless_m, self.harmless_m_tenths)

    @property
    def without_switch(self) -> str:
        """What to do about a block under block delete that later blocks depend on."""
        stated = f"{UNROLL} and state block_delete in the job file"
        return f"remove the `/`, or {stated}" if self.unroller is not None else "remove the `/`"

    def further_names(self, number: int) -> list[str]:
        """All names of a further work offset."""
        names = [f"{name}P{number}" for name in self.further_offsets]
        own = self.first_further and 1 <= number <= _WITH_CODES
        return [*names, f"G{self.first_further + number - 1}"] if own else names

    def name_of(self, code: int) -> str:
        """The name that a G code, ten times its number, has on this control."""
        own = next((alias for alias, means in self.aliases.items() if means == code), code)
        return f"G{own / 10:g}"

    @property
    def directed(self) -> bool:
        """Whether words may state the direction of the tool."""
        return bool(self.tips and self.direction_words)

    def unrolls_m(self, code: int) -> bool:
        """Whether the unroller carries out this M code, ten times its number."""
        language = self.language
        calls = code in _CALLS and not language.user_tasks
        return self.unroller is not None and (calls or (language.saved_modes and code in _SAVES))

    def with_tips(self, tips: Interpolated) -> Profile:
        """The same control on a machine with rotary axes. A tip has no length: the codes that switch tool
        centre point control on end the tool length for a reader of linear axes."""
        rules = replace(self.rules, straight="") if self.direction_codes else self.rules
        return replace(
            self,
            tips=tips,
            rules=rules,
            codes={**self.codes, **dict.fromkeys(self.tip_codes | self.plane_codes, Act.EVENT)},
            aliases={**self.aliases, **dict.fromkeys(self.tip_codes, _LENGTH_OFF)},
        )

    def set_as(self, machine: Machine) -> Profile:
        """The same control with what the machine file states of its settings."""
        stated, profile = machine.cycle_return, self
        if stated is not None and self.initial_retract is None and not self.return_modes:
            level = {"initial": RETRACT_TO_INITIAL, "r": RETRACT_TO_R}[stated]
            profile = replace(profile, initial_retract=level)
        if machine.default_motion is not None and self.motion is None:
            profile = replace(profile, motion=int(machine.default_motion[1:]))
        if machine.still_m_codes:
            profile = replace(profile, harmless_m=self.harmless_m | machine.still_m_codes)
        if machine.still_g_codes:
            known = sorted(machine.still_g_codes & (self.codes.keys() | self.aliases.keys()))
            if known:
                raise ConfigError(
                    f"still_g_codes of the machine file has G{known[0] / 10:g}, which the {self.name} "
                    "profile knows; expected codes that it does not know",
                    file=machine.file,
                )
            profile = replace(profile, still_g=machine.still_g_codes)
        if machine.bracket_comments and self.brackets_by_option:
            profile = replace(profile, text=replace(self.text, brackets=True))
        if self.language.increments_open and not self.counts_increments(machine):
            rounds = self.language.rounds_words and not self.language.user_tasks
            language = replace(self.language, increments_open=False, rounds_words=rounds)
            profile = replace(profile, language=language)
        return profile

    def codes_of(self, act: Act) -> frozenset[int]:
        """The G codes that do something, ten times their number."""
        return frozenset(code for code, own in self.codes.items() if own is act)

    def comment_marks(self) -> tuple[tuple[bytes, bytes], ...]:
        return ((b"(", b")"), (b";", b"")) if self.text.brackets else ((b";", b""),)

    def dwell_s(self, number: Number, *, pointed: bool) -> Number:
        """Seconds of P words; Fanuc and Haas count milliseconds where it has no decimal point, printers
        always."""
        counts = self.increments_without_point and not self.dwell_in_seconds
        in_ms = self.dwell_ms or (counts and not pointed)
        return number / 1000.0 if in_ms else number

    def counts_increments(self, machine: Machine) -> bool:
        """Whether a length without a decimal point counts least increments."""
        return self.increments_without_point and machine.decimal_point != "calculator"

    def bare_mm(self, machine: Machine, letter: str, unit_mm: float) -> float:
        """mm per unit of a length without a decimal point, as the control reads it."""
        counted = increment(machine, letter, unit_mm) if self.counts_increments(machine) else 1.0
        return counted * unit_mm

    def lines(self, data: bytes) -> list[bytes]:
        return split(data, self.text.line_end)

    def straightened(self, line: bytes) -> bytes:
        number = _NUMBERED.match(line)
        begin = 0 if number is None else number.end()
        return line[:begin] + b"G1 " + _OF_ARC.sub(b" ", line[begin:])

    def rows(self) -> Sequence[Row]:
        return [*self._g_rows(), *word_rows(self)]

    def _g_rows(self) -> Iterator[Row]:
        """What becomes of each G code, those that do here what another code does elsewhere among them."""
        there = {code: (act, "") for code, act in self.codes.items() if self.aliases.get(code) != NO_CODE}
        for alias, code in self.aliases.items():
            if code != NO_CODE:
                there[alias] = (self.codes[code], f"as G{code / 10:g} of other controls")
        for code, (act, why) in sorted(there.items()):
            if act is Act.REFUSE:
                why = remedied(self.refusals.get(code, "is not a code of this control"))
            elif act is Act.CONTROL:
                why = "the control moves by itself: no position is known behind it"
            yield Row(f"G{code / 10:g}", _SUPPORT.get(act, Support.READ), why)


def increment(machine: Machine, letter: str, unit_mm: float) -> float:
    """Least increment in program units: 0.001 mm goes with 0.0001 inch, 0.0001 mm with 0.00001 inch."""
    axis = {"J": "Y", "K": "Z"}.get(letter, letter)
    least = machine.axes[axis if axis in AXES else "X"].least_increment_mm
    metric = 0.0001 if least < 0.0005 else 0.001
    return metric if unit_mm == 1.0 else metric / 10


#: Further work offsets that have a code of their own.
_WITH_CODES = 20
#: M codes of subprograms, and those that save and restore modes, ten times their numbers.
_CALLS = frozenset({970, 980, 990})
_SAVES = frozenset({700, 710, 720, 730})
#: G49, as ten times its number.
_LENGTH_OFF = 490
#: What a control expects in front of the words of a block.
_NUMBERED = pattern(rb"(?i)[ \t]*/?\d?[ \t]*(?:N[ \t]*\d+[ \t]*)?")
#: The words of a block that make its move an arc, or an arc of its corner.
_OF_ARC = pattern(rb"(?i)G[ \t]*0*[23](?![\d.])|(?:,[ \t]*)?[IJKRP][ \t]*[-+]?[\d.]+")

#: Why codes are refused, where a control has no other reason.
REFUSALS: Mapping[int, str] = {
    50: "G5 is a spline or a high-speed mode of this control",
    51: "G5.1 is a spline or a smoothing mode",
    52: "G5.2 is a NURBS block",
    53: "G5.3 is a NURBS block",
    60: "G6 is a spline block",
    70: "G7 (diameter mode) belongs to lathes",
    71: "G7.1 (cylindrical interpolation) moves a rotary axis",
    101: "G10.1 is not known",
    120: "G12 (circular pocket or polar interpolation) is a cycle of the control",
    121: "G12.1 (polar interpolation) moves a rotary axis",
    130: "G13 is a cycle of the control",
    160: "G16 takes X and Y as radius and angle, which are read only where they are written as X and Y",
    310: "G31 (skip) ends where a signal arrives",
    330: "G33 cuts a thread, which a correction would distort",
    331: "G33.1 (rigid tapping) is synchronous with the spindle",
    434: "G43.4 (tool centre point control) needs rotary axes, and a controller such as fanuc",
    435: "G43.5 (tool centre point control by directions) needs rotary axes, and a controller such as fanuc",
    510: "G51 (scaling) is not read",
    511: "G51.1 (mirror image) is not read",
    650: "G65 calls a macro",
    660: "G66 calls a macro",
    680: "G68 (rotation) is not read",
    682: "G68.2 (tilted plane) is not read",
    760: "G76 threads or fine-bores, which a correction would distort",
    870: "G87 (back boring) moves off axis inside the control",
    880: "G88 waits for the operator inside the cycle",
    281: "G28.1 stores the present position, and no word of it can be edited",
    301: "G30.1 stores the present position, and no word of it can be edited",
}


def g_codes(*, unchanged: set[int], extra: dict[int, Act], without: Set[int] = frozenset()) -> dict[int, Act]:
    """The table of a control: the usual codes, those that stay `unchanged`, those with an `extra` or another
    act, `without` those that it does not have."""
    codes = dict.fromkeys((0, 10, 20, 30, 800, *COMMON_CYCLES, *PROBES), Act.MOTION)
    codes |= dict.fromkeys((170, 180, 190), Act.PLANE)
    codes |= dict.fromkeys((900, 910), Act.DISTANCE)
    codes |= dict.fromkeys((930, 940, 950), Act.FEED)
    codes |= dict.fromkeys((980, 990), Act.RETRACT)
    codes |= dict.fromkeys((40, 100, 200, 210, 280, 300, 430, 490, 520, 530, 610, 640, 920), Act.EVENT)
    codes |= dict.fromkeys(range(540, 600, 10), Act.EVENT)
    codes |= dict.fromkeys((COMPENSATION_OFF, *CUTTER_COMPENSATION), Act.EVENT)
    codes |= dict.fromkeys((960, 970, *unchanged), Act.UNCHANGED)
    codes |= dict.fromkeys(REFUSALS, Act.REFUSE)
    codes |= extra
    return {code: act for code, act in codes.items() if code not in without}


#: M codes that are refused, ten times their number, and what they do.
M_REFUSALS: Mapping[int, str] = {
    960: "branches", 970: "calls a subprogram", 980: "calls a subprogram",
    990: "repeats the program",
}  # fmt: skip
#: What to do about those that unrolling leaves.
M_INSTEAD: Mapping[int, str] = {990: "write M30 in its place where it ends a main program"}
#: The same of controls that save modes; elsewhere these codes are those of the machine's builder.
NGC_M_REFUSALS: Mapping[int, str] = {
    **M_REFUSALS, 700: "saves modal codes", 710: "forgets saved modal codes", 720: "restores modal codes",
    730: "saves modal codes",
}  # fmt: skip
#: What an alias leads to where the control does not have the code.
NO_CODE = -1
#: M codes of ISO 6983 that move no axis.
ISO_M = frozenset({0, 1, 2, 3, 4, 5, 7, 8, 9, 19, 30, 48, 49})
ARC_DISTANCE: Mapping[int, Act] = dict.fromkeys((901, 911), Act.ARC_DISTANCE)
