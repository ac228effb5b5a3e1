"""What a program asks of the control beside motion: tool changes, spindle starts and other M codes.

They are found in words of blocks, in TOOL CALL and M functions of conversational programs, and in LOADTL,
LOAD/TOOL, TURRET, SPINDL and AUXFUN of APT. Other languages have none that are read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from heapq import merge

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.machine import ControlTimes
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.feeds.moves import Scan, deleted_lines, numbers
from olp.program.program import Program

TOOL_CHANGE = "tool change"
SPINDLE_START = "spindle start"
#: M codes that take effect after the motion of their block
AFTER = (0, 1, 2, 30, 60)
#: those that do so too on controls with exact stops
AFTER_EXACT = (5, 9)
#: turn of the spindle by M code
_TURNS = {3: 1, 4: -1, 5: 0}
#: the same, with coolant, of conversational programs
_TURNS_WITH_COOLANT = {13: 1, 14: -1}
#: M codes that end a program, or call another one
_CALLS = (2, 30, 97, 98, 99)
#: M functions of conversational programs from here on say how blocks are carried out
_FORM = 89
_CHANGE = 6
#: G4, whose S is no speed, as ten times its number
_DWELL = 40
_CONVERSATIONAL = pattern(rb"(?i)TOOL[ \t]+CALL([^;\r\n]*)|(?<![A-Z0-9_])M(\d{1,3})(?![\d.])")
_M6 = pattern(rb"(?i)(?<![A-Z0-9_])M0*6(?![\d.=])")
_TOOL = pattern(rb'[ \t]*(?:\d|")')
_SPEED = pattern(rb"(?i)(?<![A-Z])S[ \t]*(\d+(?:\.\d*)?)")
_APT = pattern(
    rb"(?im)^[ \t]*(?:(LOADTL|LOAD[ \t]*/[ \t]*TOOL|TURRET)|(SPINDL)|AUXFUN)[ \t]*[/,]?([^$\r\n]*)"
)
_NUMBER = pattern(rb"(?<![\w.])\d+(?:\.\d*)?")


@dataclass(frozen=True, slots=True, eq=False)
class Actions:
    """In order of lines: (k,) `line`, `late` (after the motion of its line), and the `name`: "tool change",
    "spindle start", or that of an M code such as "M8"."""

    line: Index
    late: Mask
    name: tuple[str, ...]

    def seconds(self, times: ControlTimes) -> Array:
        """(k,) the time of each, NaN where it is not stated."""
        own = {TOOL_CHANGE: times.tool_change_s, SPINDLE_START: times.spindle_start_s} | {
            f"M{code}": seconds for code, seconds in times.m_codes_s.items()
        }
        stated = (own.get(name) for name in self.name)
        return np.array([np.nan if seconds is None else seconds for seconds in stated], float)

    def waits(self, line: Index, times: ControlTimes) -> Array:
        """(n + 1,) seconds before, between and after moves on lines (n,) that they take, as far as stated."""
        seconds = np.nan_to_num(self.seconds(times))
        after = np.searchsorted(line, self.line, "right")
        place = np.where(self.late, after, np.searchsorted(line, self.line))
        return np.asarray(np.bincount(place, seconds, len(line) + 1), float)

    def rows(self, times: ControlTimes) -> list[dict[str, float | int | str | None]]:
        """What there is, how often, and the seconds of all; None where they are not stated."""
        names, which = np.unique(np.array(self.name, str), return_inverse=True)
        seconds = self.seconds(times)
        rows = []
        for i, name in enumerate(names.tolist()):
            own = seconds[which == i]
            total = None if np.isnan(own).any() else float(own.sum())
            rows.append({"what": name, "count": len(own), "seconds": total})
        return sorted(rows, key=lambda row: (str(row["what"]).startswith("M"), str(row["what"])))


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a line asks for: M codes, a speed of the spindle, a tool change, a turn of the spindle (None: the
    one before)."""

    line: int
    codes: tuple[int, ...] = ()
    speed: float | None = None
    change: bool = False
    turn: int | None = None


def actions(program: Program, *, block_delete: bool = False) -> Actions | None:
    """The actions of a program that was read with its words, None where its language has none that are
    read."""
    if program.statements is None:
        assert program.words is not None
        late = AFTER + AFTER_EXACT if program.rs274.exact_stop else AFTER
        asked = _of_words(Scan.of(program, program.words, block_delete=block_delete))
        if program.dialect.name == "sinumerik":
            changes = _changes(program, deleted_lines(program).tolist() if block_delete else ())
            asked = merge(changes, asked, key=lambda one: one.line)
        return _actions(asked, late)
    reader = {"heidenhain": _conversational, "apt": _apt}.get(program.dialect.name)
    if reader is None:
        return None
    return _actions((one for one in reader(program) if one.line <= program.end_line), AFTER + AFTER_EXACT)


def _actions(asked: Iterable[_Asked], late: tuple[int, ...]) -> Actions:
    rows: list[tuple[int, bool, str]] = []
    turn, speed, running = 0, 0.0, (0, 0.0)
    for one in asked:
        if one.change:
            rows.append((one.line, False, TOOL_CHANGE))
            turn, running = 0, (0, 0.0)
        speed = speed if one.speed is None else one.speed
        turn = turn if one.turn is None else one.turn
        if turn and (turn, speed) != running:
            rows.append((one.line, False, SPINDLE_START))
        running = (turn, speed) if turn else (0, 0.0)
        rows += [(one.line, code in late, f"M{code}") for code in one.codes]
    line, after, name = zip(*rows, strict=True) if rows else ((), (), ())
    return Actions(np.array(line, np.int64), np.array(after, bool), tuple(name))


def _of_words(scan: Scan) -> Iterator[_Asked]:
    word, line = scan.of_letter(b"M")
    code = np.rint(numbers(scan.words, word)).astype(np.int64)
    s_word, s_line = scan.of_letter(b"S")
    dwells = set(scan.code_line[scan.code == _DWELL].tolist())
    by_line: dict[int, list[int]] = {}
    for at, number in zip(line.tolist(), code.tolist(), strict=True):
        by_line.setdefault(at, []).append(number)
    speeds = {
        at: value
        for at, value in zip(s_line.tolist(), numbers(scan.words, s_word).tolist(), strict=True)
        if at not in dwells
    }
    for at in sorted(by_line.keys() | speeds.keys()):
        yield _asked(at, by_line.get(at, []), _TURNS, speeds.get(at))


def _asked(line: int, codes: list[int], turns: dict[int, int], speed: float | None) -> _Asked:
    return _Asked(
        line, tuple(c for c in codes if c not in (3, 4, _CHANGE, *_CALLS)), speed, _CHANGE in codes,
        next((turns[c] for c in reversed(codes) if c in turns), None),
    )  # fmt: skip


def _changes(program: Program, left_out: Iterable[int]) -> Iterator[_Asked]:
    """M6 of Sinumerik programs, which is not among their words."""
    deleted = set(left_out)
    for line, _, before in _matches(program, _M6):
        said = b";" in before or before.count(b'"') % 2
        if not said and line <= program.end_line and line not in deleted:
            yield _Asked(line, change=True)


def _conversational(program: Program) -> Iterator[_Asked]:
    for line, found, before in _matches(program, _CONVERSATIONAL):
        if b";" in before or before.count(b'"') % 2:
            continue
        if found[2] is not None:
            if int(found[2]) < _FORM:
                yield _asked(line, [int(found[2])], _TURNS | _TURNS_WITH_COOLANT, None)
            continue
        speed = _SPEED.search(found[1].split(b'"')[-1])
        yield _Asked(
            line, change=_TOOL.match(found[1]) is not None, speed=None if speed is None else float(speed[1])
        )


def _apt(program: Program) -> Iterator[_Asked]:
    for line, found, _ in _matches(program, _APT):
        number = _NUMBER.search(found[3])
        if found[1] is not None:
            yield _Asked(line, change=True)
        elif found[2] is None:
            if number is not None:
                yield _asked(line, [int(float(number[0]))], _TURNS, None)
        else:
            off = b"OFF" in found[3].upper()
            back = b"CCLW" in found[3].upper()
            yield _Asked(
                line, speed=None if number is None else float(number[0]), turn=0 if off else -1 if back else 1
            )


def _matches(program: Program, wanted: re.Pattern[bytes]) -> Iterator[tuple[int, re.Match[bytes], bytes]]:
    """The places of a pattern in the text: the line, the match, and what stands before it in its line."""
    for found in wanted.finditer(program.data):
        line = int(np.searchsorted(program.line_start, found.start(), "right"))
        yield line, found, program.data[int(program.line_start[line - 1]) : found.start()]
