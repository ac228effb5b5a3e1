"""Holes in a circle or an arc about a centre, one by one: G70 and G71 of Haas mills.

The canned cycle in force makes a hole at each place: G70 at `L` places all around, G71 at `L` places `K`
degrees apart. `I` is the radius and `J` the angle of the first hole, counter-clockwise from X. The centre is
the X and Y of the block, else the present position. Where the axes are taken to be behind the last hole
differs from text to text, so the next pattern has to state its centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.program.rs274.codes import CYCLES, HOLE_ARC, HOLE_CIRCLE, HOLE_PATTERNS
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.state import ProgramState, Value

_NEEDED = {HOLE_CIRCLE: "ijl", HOLE_ARC: "ijkl"}
_XY = 170


def is_pattern(words: Sequence[Value], state: ProgramState) -> bool:
    """Whether a block makes a pattern of holes."""
    return state.profile.language.hole_patterns and bool(state.codes(words) & HOLE_PATTERNS)


def holes(words: Sequence[Value], state: ProgramState, budget: Budget) -> list[tuple[float, float]]:
    """X and Y of each hole, in program units. Raises ProgramError for what is not certain."""
    code = next(iter(state.codes(words) & HOLE_PATTERNS))
    name, given = f"G{code // 10}", dict(words)
    if state.motion not in CYCLES:
        raise ProgramError(f"{name} needs a canned cycle in force; give it before, with L0", code="OLP531")
    if not state.absolute or state.plane != _XY:
        raise ProgramError(f"{name} is read in G90 and G17 only; give them before it", code="OLP518")
    others = sorted({letter.upper() for letter, _ in words} - set("GNXY") - set(_NEEDED[code].upper()))
    if others or len([letter for letter, _ in words if letter == "g"]) > 1:
        what = f"the word {others[0]}" if others else "another code"
        raise ProgramError(f"{name} and {what} are in one block; divide it", code="OLP518")
    missing = next((letter for letter in _NEEDED[code] if letter not in given), "")
    if missing:
        raise ProgramError(f"{name} needs the word {missing.upper()}; give it", code="OLP516")
    values = {letter: _pointed(letter, given[letter]) for letter in "ijkxy" if letter in given}
    count = whole(filled(given["l"]), f"the number of holes L of {name}")
    if count < 1 or values["i"] <= 0.0:
        raise ProgramError(f"{name} needs a radius I above 0, and at least one hole L", code="OLP516")
    budget.spend(count)
    step = values["k"] if code == HOLE_ARC else 360.0 / count
    x, y = (values[a] if a in values else state.position_of("xy".index(a)) for a in "xy")
    angles = [math.radians(values["j"] + step * k) for k in range(count)]
    return [(x + values["i"] * math.cos(a), y + values["i"] * math.sin(a)) for a in angles]


def _pointed(letter: str, value: float | None) -> float:
    if value is None:
        raise ProgramError(
            f"{letter.upper()} has no decimal point, so what it counts is not certain; write the point",
            code="OLP515",
        )
    return value
