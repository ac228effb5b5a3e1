"""The nominal reading of a program against LinuxCNC's: what differs, in one line each.

A program that olp refuses is never different. One that olp accepts must be accepted by LinuxCNC, with the
same moves: kinds, ends, centres, turns, planes, feeds, units, and no axis known that depends on the start.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from fuzz.drawn_words import TOOLS
from fuzz.grammar import FRAMES, Drawn
from judge import linuxcnc, machines
from judge.linuxcnc import ARC, DWELL, FEED, PROBE, RAPID, CanonMoves, InterpreterError, InterpreterFailure
from judge.machines import Recipe

import olp
from olp.core.errors import OlpError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.program import registry
from olp.program.dialect import Options
from olp.program.feeds.stated import programmed
from olp.program.program import Program

#: 1 nm; numbers pass through inches in the interpreter
SLACK_MM = 1e-6
#: relative, of feeds
FEED_SLACK = 1e-9
ARC_SLACK = 1e-4
#: s that a program of a few blocks may take in the interpreter
SECONDS = 20.0
#: of `Outcome.kind`
SAME = "same"
REFUSED = "refused"
BOTH_REFUSE = "both refuse"
LOOSER = "looser"
DIFFERENT = "different"
CRASH = "crash"
UNJUDGED = "unjudged"
WRONG = (LOOSER, DIFFERENT, CRASH)
_KINDS = {Kind.RAPID: RAPID, Kind.LINE: FEED, Kind.ARC_CW: ARC, Kind.ARC_CCW: ARC, Kind.PROBE: PROBE}
#: index of the plane in the interpreter's order to that of olp
_PLANE = {0: 0, 1: 2, 2: 1}
_FEED = re.compile("zero feed rate|inverse time|feed per rev")
_BEFORE_TAPE = re.compile(rb"\s+(?=%)")
#: the control may have such a code, or such a tool, by a file of its own
_OWN_FILES = ("M-code greater than 199", "not found in the tool table")
_HOME = re.compile(rb"(?i)G0*(28|30)(\.0*)?(?![.0-9])")
_AXES = ((0, 1), (2, 0), (1, 2))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a program comes to: `kind`, what it says (`text`), the line of olp's refusal or of the difference,
    and LinuxCNC's reason where it refuses."""

    kind: str
    text: str = ""
    line: int = 0
    oracle: str = ""


def recipe() -> Recipe:
    """All the frames and tools of the grammar, tool 1 in the spindle."""
    frames = {
        name: {"X_mm": 10.5 * i, "Y_mm": -7.25 * i, "Z_mm": 3.0 * i - 20.0, "set_by": "true"}
        for i, name in enumerate(FRAMES, 1)
    }
    tools = {
        n: {"X_mm": 0.5 * (n - 1), "Y_mm": -0.25 * (n - 1), "Z_mm": 30.0 + 11.0 * n, "radius_mm": 3.0}
        for n in TOOLS
    }
    return Recipe(
        travel=((-3000.0, 3000.0),) * 3, tools=tools, work_offsets=frames,
        job_defaults={"tool": 1, "work_offset": "G54"},
    )  # fmt: skip


def loaded(path: Path) -> Setup:
    setup = olp.load_setup(path)
    return replace(setup, job=replace(setup.job, dialect="linuxcnc"))


@dataclass(slots=True)
class Judge:
    """A machine whose programs are read by both; `folder` is where its files are."""

    path: Path
    setup: Setup

    @staticmethod
    def of(folder: Path) -> Judge:
        path = machines.zero_machine(folder, recipe())
        return Judge(path, loaded(path))

    def read(self, drawn: Drawn) -> tuple[Program, np.ndarray | None]:
        """The program and its feeds in mm/s, None where these alone are refused. Raises OlpError."""
        start = (None, None, None) if drawn.start_mm is None else drawn.start_mm
        setup = replace(self.setup, job=replace(self.setup.job, start_mm=start))
        options = Options(block_delete=drawn.deletes)
        program = registry.read(drawn.data, setup, registry.DIALECTS["linuxcnc"], options)
        try:
            return program, programmed(program, block_delete=drawn.deletes)
        except OlpError:
            return program, None

    def interpret(self, drawn: Drawn) -> CanonMoves:
        """Raises InterpreterError and InterpreterFailure."""
        how: dict[str, Any] = {"deletes": drawn.deletes, "axes": linuxcnc.ALL_AXES, "seconds": SECONDS}
        if drawn.start_mm is not None:
            how |= {"start_mm": drawn.start_mm, "find_known": False}
        return linuxcnc.interpret(drawn.data, self.path, **how)

    def outcome(self, drawn: Drawn) -> Outcome:
        try:
            program, feed = self.read(drawn)
        except OlpError as error:
            return self._refused(drawn, error)
        except Exception as error:
            return Outcome(CRASH, f"olp: {type(error).__name__}: {error}")
        try:
            moves = self.interpret(drawn)
        except InterpreterError as error:
            if any(what in str(error) for what in _OWN_FILES):
                return Outcome(UNJUDGED, str(error))
            # a block that only states G1 needs a feed there, and moves nothing
            bare = error.line not in program.toolpath.line
            own = (feed is None or bare) and _FEED.search(str(error))
            return Outcome(
                BOTH_REFUSE if own else LOOSER, str(error).partition(": ")[2], error.line, str(error)
            )
        except InterpreterFailure as error:
            # the interpreter's Python hands out text of comments, and only as UTF-8
            own = not drawn.data.isascii() and "parse_file" in error.failed
            return Outcome(UNJUDGED if own else LOOSER, f"the interpreter: {error.failed}")
        except RuntimeError as error:
            return Outcome(UNJUDGED, str(error))
        text = difference(drawn.data, program, feed, moves)
        return Outcome(SAME) if text is None else Outcome(DIFFERENT, *text)

    def _refused(self, drawn: Drawn, error: OlpError) -> Outcome:
        line = getattr(error, "line", 0) or 0
        try:
            self.interpret(drawn)
        except InterpreterError as refusal:
            return Outcome(BOTH_REFUSE, str(error), line, str(refusal))
        except RuntimeError as refusal:
            return Outcome(BOTH_REFUSE, str(error), line, str(refusal))
        return Outcome(REFUSED, str(error), line)


def difference(
    data: bytes, program: Program, feed: np.ndarray | None, moves: CanonMoves
) -> tuple[str, int] | None:
    """The first difference and its line, None where both readings agree."""
    return _Comparison(data, program, feed, moves).first()


class _Comparison:
    """Two readings of one program, move by move. Lines are counted by line feeds, as the interpreter does."""

    def __init__(self, data: bytes, program: Program, feed: np.ndarray | None, moves: CanonMoves) -> None:
        self.path, self.feed = program.toolpath, feed
        self.moves = moves.pick(moves.kind != DWELL)
        self.text = data.split(b"\n")
        line_feeds = np.flatnonzero(np.frombuffer(data, np.uint8) == 10)
        begins = np.asarray(program.line_start)[self.path.line - 1]
        # blank lines before a tape mark do not count there
        blank = _BEFORE_TAPE.match(data)
        self.own_line = np.searchsorted(line_feeds, begins) + 1 - (blank[0].count(b"\n") if blank else 0)
        self.starts = self.path.starts_mm()
        arc = np.full(len(self.path), -1)
        arc[self.path.arcs.move] = np.arange(len(self.path.arcs))
        self.arc = arc

    def first(self) -> tuple[str, int] | None:
        # an axis may be unknown here after moves that the control makes by itself
        self.excused = np.isnan(np.array(self.path.start_mm))
        for line in sorted({*self.own_line.tolist(), *self.moves.line.tolist()}):
            text = self._line(line)
            if text is not None:
                return text, line
        return None

    def _line(self, line: int) -> str | None:
        mine = np.flatnonzero(self.own_line == line).tolist()
        theirs = np.flatnonzero(self.moves.line == line).tolist()
        own = [k for k in mine if not self.path.flag[k] & Flag.CONTROL]
        unknown = np.isnan(self.path.end_mm[[k for k in mine if k not in own]]).any(axis=0)
        self.excused |= unknown
        if len(own) < len(theirs) and _HOME.search(re.sub(rb"\s", b"", self.text[line - 1])):
            # where the reference points are, the program does not say
            theirs, unknown = theirs[: len(own)], np.ones(3, bool)
        if len(own) != len(theirs):
            # rapids without a length are left out of cycles
            own = [k for k in own if not self._idle(k)]
            theirs = [k for k in theirs if not self._still(k)]
        text = self._moves_of(own, theirs)
        self.excused |= unknown
        return text

    def _moves_of(self, mine: list[int], theirs: list[int]) -> str | None:
        if len(mine) != len(theirs):
            return f"{len(mine)} moves here, {len(theirs)} there"
        for k, j in zip(mine, theirs, strict=True):
            text = self._move(k, j)
            if text is not None:
                return text
        return None

    def _idle(self, k: int) -> bool:
        if self.arc[k] >= 0:
            return False
        a, b = self.starts[k], self.path.end_mm[k]
        return bool(((np.abs(a - b) < 1e-9) | (np.isnan(a) & np.isnan(b))).all())

    def _still(self, j: int) -> bool:
        return (
            self.moves.kind[j] != ARC and float(np.abs(self.moves.axis[j] - self.moves.begin[j]).max()) < 1e-9
        )

    def _move(self, k: int, j: int) -> str | None:
        path, moves = self.path, self.moves
        end, there = path.end_mm[k], moves.axis[j]
        for i, axis in enumerate("XYZ"):
            if np.isnan(end[i]):
                if not self.excused[i] and moves.known[j, i]:
                    return f"{axis} is known there only"
                continue
            self.excused[i] = False
            if not moves.known[j, i]:
                return f"{axis} is known here only"
            if abs(end[i] - there[i]) > SLACK_MM:
                return f"{axis} ends at {end[i]:.6f}, there {there[i]:.6f}"
        kind = Kind(int(path.kind[k]))
        if _KINDS[kind] != moves.kind[j]:
            return f"{kind.name} here, {linuxcnc.KINDS[moves.kind[j]]} there"
        if moves.kind[j] == ARC:
            text = self._arc(k, j)
            if text is not None:
                return text
        return self._feed(k, j)

    def _arc(self, k: int, j: int) -> str | None:
        arcs, n, moves = self.path.arcs, int(self.arc[k]), self.moves
        plane = _PLANE[int(moves.plane[j])]
        if plane != arcs.plane[n]:
            return f"plane {arcs.plane[n]}, there {plane}"
        for i in _AXES[plane]:
            if abs(arcs.centre_mm[n, i] - moves.centre[j, i]) > SLACK_MM:
                return f"the centre is at {arcs.centre_mm[n].tolist()}, there {moves.centre[j].tolist()}"
        sweep = float(arcs.sweep_rad[n])
        begun = math.ceil(abs(sweep) / (2 * math.pi) - 1e-9)
        if (sweep > 0) != (moves.turns[j] > 0) or begun != abs(moves.turns[j]):
            return f"sweep {math.degrees(sweep):.3f} degrees, there turns {moves.turns[j]}"
        return None

    def _feed(self, k: int, j: int) -> str | None:
        moves = self.moves
        if self.feed is None or moves.kind[j] == RAPID or not math.isfinite(self.feed[k]):
            return None
        if moves.feed_mode[j] and math.isnan(moves.speed[j]):
            return None
        there = float(moves.feed[j]) / 60.0 * (float(moves.speed[j]) if moves.feed_mode[j] else 1.0)
        # of an arc whose radii differ the interpreter takes one
        inverse = self.path.flag[k] & Flag.INVERSE_TIME and moves.kind[j] == ARC
        if abs(there - self.feed[k]) > (ARC_SLACK if inverse else FEED_SLACK) * max(there, self.feed[k]):
            return f"feed {self.feed[k]:.9g} mm/s, there {there:.9g}"
        return None
