"""Canned drilling cycles one block at a time: the strokes that its holes make.

Pure functions of numbers in program coordinates and program units. Codes are integers, ten times the
G number (810 is G81). How controls differ is in `cycle_rules`; `strokes` makes many holes at once.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import numpy as np

from olp.core.arrays import Array
from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.cycle_rules import NGC_CYCLES, CycleRules
from olp.program.rs274.strokes import Drilling, Step, strokes

Point = tuple[float, float, float]
Kind = Literal["rapid", "feed", "dwell", "spindle"]
Spindle = Literal["", "stop", "reverse", "restore"]
Number = TypeVar("Number", float, Array)

#: Axis numbers (first, second, tool axis) of a plane; X is 0.
PLANES: dict[int, tuple[int, int, int]] = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}

#: The clearance in LinuxCNC between the bottom of the last peck and the end of the rapid that returns to it.
LCNC_CLEARANCE_MM = 0.254
#: The same for programs in inches.
LCNC_CLEARANCE_INCH = 0.010

#: holes of a block at most
MOST_REPEATS = 20_000
#: strokes of all holes of a program: of a short one, and for each byte of a long one
_STROKES = 250_000
_STROKES_PER_BYTE = 4.0
#: work of a hole beside its strokes, in strokes
HOLE_STROKES = 10

_KINDS: dict[int, tuple[Kind, Spindle]] = {
    Step.RAPID: ("rapid", ""),
    Step.FEED: ("feed", ""),
    Step.DWELL: ("dwell", ""),
    Step.STOP: ("spindle", "stop"),
    Step.REVERSE: ("spindle", "reverse"),
    Step.RESTORE: ("spindle", "restore"),
}


@dataclass(frozen=True, slots=True)
class Stroke:
    """One step of a cycle. `x`, `y`, `z` is the position after it, in program coordinates and units.

    `seconds` is the time of a dwell. `spindle` says what a spindle step does: "stop", "reverse" (start
    in the other direction) or "restore" (start as before the cycle).
    """

    kind: Kind
    x: float
    y: float
    z: float
    seconds: float = 0.0
    spindle: Spindle = ""

    @property
    def point(self) -> Point:
        return (self.x, self.y, self.z)


def levels(r: Number, z: Number, *, absolute: bool, initial_z: float) -> tuple[Number, Number]:
    """Absolute R and Z levels from the words of the block.

    In G91 (RS-274 and Fanuc alike) R counts from the initial level of the series, and Z from R.
    """
    if absolute:
        return r, z
    return initial_z + r, initial_z + r + z


def cycle_moves(
    code: int,
    *,
    start: Point,
    xy: tuple[float, float],
    step: tuple[float, float] = (0.0, 0.0),
    repeats: int = 1,
    r: float,
    z: float,
    q: float | None = None,
    p: float | None = None,
    retract_to_r: bool,
    initial_z: float,
    plane: int = 17,
    clearance: float = LCNC_CLEARANCE_MM,
    rules: CycleRules = NGC_CYCLES,
) -> tuple[Stroke, ...]:
    """Strokes of a block, in order; rapids of zero length are left out, a feed of zero length is not.

    `start` is the position before the block, (x, y, z). `xy` is the position of the hole along the first and
    second axis of the plane: (X, Y) in G17, (Z, X) in G18, (Y, Z) in G19. With a repeat count (L; K on Fanuc)
    the next hole is `step` further. In G90 the step is zero: RS-274 makes the same hole again.
    `r`, `z` and `initial_z` are absolute, along the tool axis; `initial_z` is the position on that axis
    before the first cycle of the series of contiguous cycles. `q` is the peck, `p` the dwell in s,
    `clearance` the distance kept above the last peck (G83) or drawn back after it (G73). All lengths are in
    program units.

    A second block of the same series starts where the first ended, with the same `initial_z`.
    Raises ProgramError (without a line) for a cycle without offline geometry and for words it cannot accept.
    """
    if repeats < 1:
        raise ProgramError("the cycle is repeated fewer than one time; expected L1 or more", code="OLP531")
    if repeats > MOST_REPEATS:
        raise repeats_error(repeats)
    if plane not in PLANES:
        raise ProgramError(f"G{code / 10:g} in plane G{plane}; expected G17, G18 or G19", code="OLP531")
    numbers = [np.full(repeats, np.nan if word is None else word) for word in (r, z, q, p)]
    drilling = Drilling(
        np.full(repeats, code),
        plane - 17,
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        clearance,
        1.0,
        0.0,
        rules,
    )
    for bad, why in drilling.faults():
        if bad.any():
            raise why(0)
    places = np.cumsum(np.vstack((xy, np.tile(step, (repeats - 1, 1)))), axis=0)
    made = strokes(
        drilling, np.array([start]), np.zeros(repeats, np.int64), places, np.full(repeats, retract_to_r),
        np.array([initial_z]),
    )  # fmt: skip
    rows = zip(made.step.tolist(), made.point.tolist(), made.seconds.tolist(), strict=True)
    return tuple(Stroke(_KINDS[what][0], x, y, z, s, _KINDS[what][1]) for what, (x, y, z), s in rows)


def repeats_error(repeats: int) -> ProgramError:
    """A block makes more holes than any part has."""
    return ProgramError(f"the block makes {repeats} holes; expected at most {MOST_REPEATS}", code="OLP543")


def stroke_budget(size: int) -> Budget:
    """The strokes that the holes of a program of `size` bytes may have together."""
    return Budget.of(
        size, least=_STROKES, per_byte=_STROKES_PER_BYTE,
        message="the canned cycles of the program have more than {limit} strokes; split the program",
    )  # fmt: skip
