"""Blocks that are carried out one by one: canned cycles, probes, G53 moves, homing, and moves that the
control makes by itself. Also the checks of a block with an event.

What an event does to frames and tools is in `axis_state`, the strokes of one hole are in `cycles`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index
from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind
from olp.program.directives import Directives
from olp.program.program import Hole
from olp.program.rs274.axis_state import AxisState, Effect, Word
from olp.program.rs274.codes import (
    CUTTER_COMPENSATION,
    CYCLES,
    DWELL,
    HOMES,
    INCREMENTAL,
    INVERSE_TIME,
    MACHINE,
    MACRO,
    PLANE_OF,
    RETRACT_TO_R,
)
from olp.program.rs274.collector import Collector
from olp.program.rs274.cycles import (
    HOLE_STROKES,
    LCNC_CLEARANCE_MM,
    Stroke,
    check_repeats,
    hole_moves,
    levels,
)
from olp.program.rs274.modes import UNROLL, Context, scaled
from olp.program.rs274.motion import fill
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.state import BROKEN_SERIES, NAN

_M_REFUSED = {
    700: "saves modal codes", 710: "forgets saved modal codes", 720: "restores modal codes",
    730: "saves modal codes", 960: "branches", 970: "calls a subprogram", 980: "calls a subprogram",
    990: "repeats the program",
}  # fmt: skip
_M_CODES = np.array(list(_M_REFUSED))


def event_block(context: Context, line: int, profile: Profile) -> tuple[list[Word], list[int]]:
    """The words and event codes of a line of the chunk; refuses what cannot be read correctly."""
    chunk, codes = context.chunk, context.codes
    span = range(int(chunk.first_word[line]), int(chunk.first_word[line + 1]))
    words = [
        Word(chr(chunk.letter[i]), float(context.value[i]), context.base + i, bool(chunk.pointed[i]))
        for i in span
    ]
    mine = slice(np.searchsorted(codes.line, line), np.searchsorted(codes.line, line, "right"))
    number = context.number(line)
    events = _checked(codes.code[mine], codes.act[mine], words, profile, number)
    changes = set(events) - {DWELL, *HOMES, MACHINE} or any(
        w.letter == "M" and w.value in (6, 61) for w in words
    )
    if chunk.deleted[line] and changes:
        raise ProgramError(
            "a block under block delete changes offsets, units, path mode, the tool or its compensation, "
            "so later blocks depend on the switch; remove the `/`",
            line=number,
            code="OLP525",
        )
    return words, events


def _checked(
    code: Index, act: npt.NDArray[np.int8], words: list[Word], profile: Profile, line: int
) -> list[int]:
    """The event codes of a block; refuses those that cannot be read correctly."""
    numbers = [word.value for word in words if word.letter == "G"]
    for c, a, number in zip(code.tolist(), act.tolist(), numbers, strict=True):
        if a == Act.REFUSE:
            why = profile.refusals.get(c)
            name = f"G{number:g}"
            if c in CUTTER_COMPENSATION:
                why = f"{why}; program the tool path, or take the contour as tool path with --contour"
            raise ProgramError(
                why or f"{name} is not known to the {profile.name} profile and may move the machine",
                line=line,
                code="OLP513" if c in CUTTER_COMPENSATION else "OLP511" if c == MACRO else "OLP512",
                hint=UNROLL if c == MACRO else "",
                # the other words of a macro call are its arguments
                word="" if c == MACRO else name,
            )
    for word in words:
        m = round(word.value * 10)
        if word.letter == "M" and m in _M_REFUSED:
            raise ProgramError(
                f"M{m / 10:g} {_M_REFUSED[m]}",
                hint=UNROLL,
                line=line,
                code="OLP511",
                word=f"M{m / 10:g}",
            )
    return [c for c, a in zip(code.tolist(), act.tolist(), strict=True) if a == Act.EVENT]


def check_codes(context: Context, profile: Profile) -> None:
    """Refuse the codes of a chunk that need no state to be refused, all at once."""
    chunk, codes = context.chunk, context.codes
    m = np.flatnonzero((chunk.letter == ord("M")) & context.active[chunk.line])
    m = m[np.isin(np.rint(context.value[m] * 10), _M_CODES)]
    lines = np.union1d(codes.line[codes.act == Act.REFUSE], chunk.line[m])
    errors = []
    for line in lines.tolist():
        try:
            event_block(context, line, profile)
        except ProgramError as error:
            errors.append(error)
    if errors:
        raise ProgramError.together(errors)


class SpecialBlocks:
    """Carries these blocks out from the position in `state`, and puts their moves and holes into
    `collector`."""

    def __init__(self, state: AxisState, collector: Collector, switches: Directives, strokes: Budget) -> None:
        self._state = state
        self._collector = collector
        self._switches = switches
        self._strokes = strokes
        # line, from 0, and frame of the last block of a series; -1 where none goes on
        self._last_cycle = self._frame = -1

    def leave(self, context: Context, line: int) -> None:
        """Keep for the next chunk whether a series of cycles has ended up to this line, the last one read."""
        if self._last_cycle >= 0 and self._ended(context, line + 1):
            self._last_cycle = -1

    def _ended(self, context: Context, row: int) -> bool:
        """Whether another motion code came into force between the last block of a cycle and this line."""
        first = max(self._last_cycle + 1 - context.chunk.first_line, 0)
        return self._last_cycle < 0 or not CYCLES.issuperset(context.motion[first:row].tolist())

    def run(self, context: Context, row: int, slot: Index, frame: int, effect: Effect) -> None:
        """Carry out the motion on line `row` of the chunk, whose axis words are `slot` (1, 3), in this
        frame."""
        motion = int(context.motion[row])
        if motion in CYCLES and not effect.home and not effect.machine:
            self._cycle(context, row, frame, motion)
        else:
            self._move(context, row, slot, frame, motion, effect)

    def control_move(self, line: int, *, deleted: bool) -> None:
        """A move that the control makes by itself: the position of some axes is not known after it."""
        if not self._collector.moves:
            x, y, z = self._state.position
            self._collector.start = (x, y, z)
            return
        self._collector.put_moves(
            np.array([Kind.RAPID], np.uint8),
            np.array([Flag.PASS | Flag.CONTROL | _deleted(deleted)], np.uint8),
            np.array([line]),
            np.array([len(self._state.frames) - 1]),
            np.array([self._state.position]),
            np.full((1, 3), -1),
        )

    def _move(
        self, context: Context, row: int, slot: Index, frame_index: int, motion: int, effect: Effect
    ) -> None:
        """A probe, a G53 move or the move to the intermediate point of G28."""
        state, line = self._state, context.number(row)
        frame = state.frames[frame_index]
        incremental = bool(context.distance[row] == INCREMENTAL)
        deleted = bool(context.chunk.deleted[row])
        flag = _deleted(deleted)
        kind = Kind.RAPID
        offset = np.array(frame.offset_mm)
        if effect.machine:
            if incremental:
                raise ProgramError(
                    "G53 takes axis positions, and the block is in G91; give G90", line=line, code="OLP518"
                )
            if motion not in (0, 10):
                raise ProgramError(
                    "G53 takes G0 or G1 only; give one of them in the block", line=line, code="OLP518"
                )
            kind = Kind(motion // 10)
            flag |= Flag.PASS | Flag.MACHINE
            offset = np.zeros_like(offset)
        elif effect.home:
            flag |= Flag.PASS
        else:
            kind = Kind.PROBE
        if incremental:
            flag |= Flag.INCREMENTAL
        before = list(state.position)
        relative = np.array([True]) if incremental else None
        value = scaled(context, state, self._collector.remarks)
        end = fill(slot, value, relative, offset, frame.unit_mm, before)
        if kind == Kind.PROBE and end[0].tolist() == before:
            raise ProgramError(
                "a probe ends where it starts; give it a path of X, Y or Z", line=line, code="OLP516"
            )
        self._collector.put_moves(
            np.array([kind], np.uint8), np.array([flag], np.uint8), np.array([line]),
            np.array([frame_index]), end, np.where(slot >= 0, slot + context.base, -1),
        )  # fmt: skip
        state.position[:] = end[0].tolist()
        if kind == Kind.PROBE:
            # it may stop anywhere on its path
            for i in range(3):
                if state.position[i] != before[i]:
                    state.position[i] = NAN
            self.control_move(line, deleted=deleted)

    def _cycle(self, context: Context, row: int, frame_index: int, code: int) -> None:
        state, collector, chunk, line = self._state, self._collector, context.chunk, context.number(row)
        frame = state.frames[frame_index]
        self._check_cycle(context, row, code)
        incremental = bool(context.distance[row] == INCREMENTAL)
        plane = PLANE_OF[int(context.plane[row])]
        first, second, third = PLANES[plane]
        words = {
            chr(chunk.letter[i]): i for i in range(int(chunk.first_word[row]), int(chunk.first_word[row + 1]))
        }
        value = scaled(context, state, collector.remarks)
        given = {letter: float(value[i]) for letter, i in words.items()}
        if "P" in given:
            given["P"] = state.profile.dwell_s(given["P"], pointed=bool(chunk.pointed[words["P"]]))
        held = self._inherit(context, row, given, code, third, frame_index)
        series = state.series
        times = self._repeats(context, words, line)
        offset = frame.offset_mm
        number = NAN if series.initial is None else series.initial
        unit, ground = frame.unit_mm, offset[third]
        levels_of = levels(held["R"], held["XYZ"[third]], absolute=not incremental, initial_z=number)
        r, z, initial = (value * unit + ground for value in (*levels_of, number))
        place, step = [], []
        for axis in (first, second):
            before, letter = state.position[axis], "XYZ"[axis]
            to = given[letter] * frame.unit_mm if letter in given else None
            step.append(to if incremental and to is not None else 0.0)
            place.append(before if to is None else before + to if incremental else to + offset[axis])
        if any(np.isnan((*place, *state.position))):
            raise ProgramError(
                "a canned cycle starts where an axis has not been commanded yet; "
                "command X, Y and Z first, or give start_mm in the job file",
                line=line,
                code="OLP524",
            )
        start = (state.position[0], state.position[1], state.position[2])
        exempt = Flag.PASS if self._switches.off(line) else Flag(0)
        flag = Flag.CYCLE | _deleted(bool(chunk.deleted[row])) | exempt
        for repeat in range(times):
            try:
                strokes = hole_moves(
                    code, start=start, xy=(place[0], place[1]), r=levels_of[0], z=levels_of[1],
                    q=held.get("Q"), clearance=LCNC_CLEARANCE_MM / unit, unit=unit, ground=ground,
                    p=held.get("P"), retract_to_r=bool(context.retract[row] == RETRACT_TO_R),
                    initial_z=initial, plane=17 + plane,
                    rules=state.profile.cycles,
                )  # fmt: skip
                self._strokes.spend(HOLE_STROKES + len(strokes))
            except ProgramError as error:
                raise ProgramError(error.message, line=line, code=error.code) from None
            moving = [s for s in strokes if s.kind in ("rapid", "feed")]
            count = len(moving)
            begin = collector.moves
            collector.put_moves(
                np.array([Kind.RAPID if s.kind == "rapid" else Kind.LINE for s in moving], np.uint8),
                np.full(count, flag, np.uint8),
                np.full(count, line),
                np.full(count, frame_index),
                np.array([s.point for s in moving], float).reshape(count, 3),
                np.full((count, 3), -1),
            )
            collector.holes.append(
                Hole(
                    line=line, first=begin, last=collector.moves,
                    words={letter: context.base + i for letter, i in words.items()}, plane=plane,
                    place_mm=(place[0], place[1]), r_mm=r, z_mm=z, initial_mm=initial,
                    incremental=incremental, repeat=repeat, repeats=times, series=series.count, code=code,
                    rests=_rests(strokes),
                )
            )  # fmt: skip
            start = moving[-1].point if moving else start
            place = [place[0] + step[0], place[1] + step[1]]
        state.position[:] = list(start)

    def _check_cycle(self, context: Context, row: int, code: int) -> None:
        """Refuse modes in which the control makes no cycle."""
        why = ""
        turning = self._state.profile.cycles.turning.get(code)
        span = slice(int(context.chunk.first_word[row]), int(context.chunk.first_word[row + 1]))
        others = set(context.chunk.letter[span].tolist()).intersection(b"ABCUVW")
        if others and not self._state.profile.cycles.other_axes:
            why = f"moves {chr(min(others))} too, which the control refuses; move it in a block of its own"
        elif context.feed_mode[row] == INVERSE_TIME:
            why = "is in inverse time (G93); give G94 before it"
        elif self._state.compensation is not None:
            why = "is in cutter compensation; give G40 before it"
        elif turning is not None and int(context.spindle[row]) not in turning:
            why = f"needs a turning spindle; give {' or '.join(f'M{m}' for m in turning)} before it"
        if why:
            raise ProgramError(f"the cycle G{code / 10:g} {why}", line=context.number(row), code="OLP518")

    def _inherit(
        self, context: Context, row: int, given: dict[str, float], code: int, third: int, frame_index: int
    ) -> dict[str, float]:
        """The words of a block and those inherited from its series, in program units (P in s)."""
        series, depth, line = self._state.series, "XYZ"[third], context.number(row)
        frame = self._state.frames[frame_index]
        ground, unit = frame.offset_mm[third], frame.unit_mm
        holes, rules = self._collector.holes, self._state.profile.cycles
        if self._ended(context, row):
            series.begin((self._state.position[third] - ground) / unit)
        else:
            before = self._state.frames[self._frame]
            series.broken |= (before.offset_mm[third], before.unit_mm) != (ground, unit)
            series.broken |= holes[-1].last != self._collector.moves
            if series.broken and not rules.keeps_numbers:
                raise ProgramError(BROKEN_SERIES, line=line, code="OLP518")
            if holes[-1].code != code and rules.new_code_forgets:
                series.held = {}
        self._last_cycle, self._frame = line - 1, frame_index
        series.hold(given, depth)
        missing = [letter for letter in ("R", depth) if letter not in series.held]
        if missing:
            raise ProgramError(
                f"the cycle G{code / 10:g} has no {' and no '.join(missing)} word", line=line, code="OLP531"
            )
        return {letter: value for letter, value in series.held.items() if value is not None}

    def _repeats(self, context: Context, words: dict[str, int], line: int) -> int:
        """How many holes the block makes: its L word, or K on ISO controls."""
        word = self._state.profile.cycles.counter(words)
        times = 1 if word is None else round(float(context.value[word]))
        if times < 1:
            raise ProgramError(
                "a canned cycle with zero repeats only stores values, which is not read; give one or more",
                line=line,
                code="OLP531",
            )
        try:
            check_repeats(times)
        except ProgramError as error:
            raise ProgramError(error.message, line=line, code=error.code) from None
        return times


def _rests(strokes: Sequence[Stroke]) -> tuple[tuple[int, float], ...]:
    """Dwells and reversals of the spindle in a hole: moves before each, seconds."""
    rests, moves = [], 0
    for stroke in strokes:
        if stroke.kind in ("rapid", "feed"):
            moves += 1
        else:
            rests.append((moves, stroke.seconds))
    return tuple(rests)


def _deleted(deleted: bool) -> Flag:
    return Flag.DELETED if deleted else Flag(0)
