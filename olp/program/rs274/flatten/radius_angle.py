"""The words `@` and `^` of RS-274: radius and angle about the program zero, as X and Y.

As LinuxCNC's documentation of polar coordinates has them, and as its interpreter makes them: what is left
out stays, and in G91 both count from those of the present position.
"""

from __future__ import annotations

import math

from olp.core.errors import ProgramError
from olp.program.rs274.codes import MACHINE
from olp.program.rs274.flatten.expressions import filled
from olp.program.rs274.flatten.state import NO_AXES, ProgramState, Value

RADIUS = "@"
ANGLE = "^"


def is_polar(words: list[Value]) -> bool:
    """Whether a block has a radius or an angle."""
    return any(letter in (RADIUS, ANGLE) for letter, _ in words)


def target(words: list[Value], state: ProgramState) -> tuple[float, float]:
    """X and Y of a polar block in program units: the position, or in G91 the way to it.

    The modes of the block are in force. Raises ProgramError for what the control refuses, and where it needs
    a position that is not known.
    """
    given = {letter: filled(value) for letter, value in words if letter in (RADIUS, ANGLE)}
    other = next((letter for letter, _ in words if letter in "xy"), "")
    if other:
        raise ProgramError(
            f"a block has {other.upper()} beside `@` or `^`; state the position in one way", code="OLP515"
        )
    if state.codes(words) & (NO_AXES | {MACHINE}):
        raise ProgramError("`@` and `^` state a position of a move, and this block has none", code="OLP516")
    if state.compensated:
        raise ProgramError("`@` and `^` are not for cutter compensation; give X and Y", code="OLP518")
    known = state.absolute and len(given) == 2
    x, y = (0.0, 0.0) if known else (state.position_of(0), state.position_of(1))
    radius, angle = math.hypot(x, y), math.degrees(math.atan2(y, x))
    if state.absolute:
        radius, angle = given.get(RADIUS, radius), given.get(ANGLE, angle)
    else:
        if radius == 0.0:
            raise ProgramError(
                "`@` and `^` in G91 begin at the program zero, where there is no angle; give G90",
                code="OLP518",
            )
        radius, angle = radius + given.get(RADIUS, 0.0), angle + given.get(ANGLE, 0.0)
    to = radius * math.cos(math.radians(angle)), radius * math.sin(math.radians(angle))
    return to if state.absolute else (to[0] - x, to[1] - y)
