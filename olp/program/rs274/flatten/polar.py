"""Polar positions (G16) of an unrolled program as X and Y: the radius and the angle about program zero.

On Fanuc and compatible controls X is a radius and Y an angle in degrees between G16 and G15, in G17. In G91
the angle counts from the one before (Fanuc Series 0i, operator's manual, polar coordinate command).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.codes import (
    ABSOLUTE,
    DWELL,
    INCH,
    INCREMENTAL,
    METRIC,
    POLAR,
    POLAR_OFF,
)
from olp.program.rs274.flatten.lines import Line, Word, compile_line
from olp.program.rs274.flatten.state import NO_AXES
from olp.program.rs274.profiles.base import Profile

#: Decimals of the positions that are written, by their unit.
_DECIMALS = {METRIC: 4, INCH: 5}
_PLANES = frozenset({170, 180, 190})
#: What else moves the frame or the machine by axis words.
_NOT_POLAR = NO_AXES | {310, 510, 511, 680}


@dataclass(slots=True)
class _State:
    """What is in force: `radius` and `angle` are None until a block states them, `written` the position that
    was written last."""

    on: bool = False
    absolute: bool = True
    plane: int = 170
    unit: int = METRIC
    radius: float | None = None
    angle: float | None = None
    written: tuple[float, float] = (0.0, 0.0)


def as_xy(
    blocks: list[tuple[bytes, bytes]], profile: Profile, number: Callable[[float], str]
) -> list[tuple[bytes, bytes]]:
    """The same blocks (text and line end), with polar positions as X and Y, and without G16 and G15. `number`
    writes a length. Raises ProgramError, with the index of the block as its line, for what is no position."""
    if not profile.polar:
        return blocks
    state = _State(absolute=True)
    written = []
    for index, (raw, eol) in enumerate(blocks):
        line = compile_line(raw, index + 1, profile.language)
        try:
            written.append((_block(line, state, profile, number), eol))
        except ProgramError as error:
            error.line = index + 1
            raise
    return written


def _block(line: Line, state: _State, profile: Profile, number: Callable[[float], str]) -> bytes:
    """One block, with X and Y in place of what is polar."""
    codes = {round(10 * word.number) for word in line.words if word.letter == "g" and word.value is None}
    _follow(codes, state)
    cut = [
        word for word in line.words if word.letter == "g" and round(10 * word.number) in (POLAR, POLAR_OFF)
    ]
    axes = {word.letter: word for word in line.words if word.letter in "xy"}
    if POLAR in codes:
        _check_start(state, bool(axes))
    splices = [(word.start, word.end, b"") for word in cut]
    if state.on and axes and DWELL not in codes:
        if codes & _NOT_POLAR:
            raise ProgramError(
                "axis words of this block are no polar positions, and G16 is in force; give G15 before",
                code="OLP518",
            )
        splices += _position(axes, state, profile, number)
    text, done = b"", 0
    for start, end, new in sorted(splices):
        text += line.raw[done:start] + new
        done = end
    return text + line.raw[done:] if splices else line.raw


def _follow(codes: set[int], state: _State) -> None:
    state.unit = next((code for code in (INCH, METRIC) if code in codes), state.unit)
    state.plane = next((code for code in _PLANES if code in codes), state.plane)
    if codes & {ABSOLUTE, INCREMENTAL}:
        state.absolute = ABSOLUTE in codes
    if POLAR_OFF in codes:
        state.on, state.radius, state.angle = False, None, None
    if POLAR in codes:
        state.on = True


def _check_start(state: _State, moves: bool) -> None:
    if not state.absolute:
        raise ProgramError(
            "G16 in G91 takes the present position as its centre, which is not followed; give G90 before it",
            code="OLP518",
        )
    if state.plane != 170:
        raise ProgramError("G16 is read in the plane G17 only; give G17 before it", code="OLP518")
    if moves:
        raise ProgramError(
            "G16 and a position are in one block; put G16 into a block of its own", code="OLP518"
        )


def _position(
    axes: dict[str, Word], state: _State, profile: Profile, number: Callable[[float], str]
) -> list[tuple[int, int, bytes]]:
    """The splices that write the position of a block."""
    for word in axes.values():
        if not word.pointed and word.number and profile.language.increments_open:
            raise ProgramError(
                f"{word.letter.upper()} has no decimal point, so the machine decides what it counts; "
                "write it with a point",
                code="OLP515",
            )
    if "x" in axes:
        if not state.absolute:
            raise ProgramError(
                "a radius in G91 counts from the present position, which is not followed; give it in G90",
                code="OLP518",
            )
        state.radius = axes["x"].number
    if "y" in axes:
        state.angle = axes["y"].number if state.absolute else (state.angle or 0.0) + axes["y"].number
    if state.radius is None or state.angle is None:
        raise ProgramError(
            "the first position behind G16 states no radius or no angle; give X and Y", code="OLP516"
        )
    turn = math.radians(state.angle)
    decimals = _DECIMALS[state.unit]
    x, y = (round(state.radius * part(turn), decimals) for part in (math.cos, math.sin))
    before, state.written = state.written, (x, y)
    words = (x, y) if state.absolute else (round(x - before[0], decimals), round(y - before[1], decimals))
    text = " ".join(letter + number(value) for letter, value in zip("XY", words, strict=True)).encode()
    first, *rest = sorted(axes.values(), key=lambda word: word.start)
    return [(first.start, first.end, text), *((word.start, word.end, b"") for word in rest)]
