"""Geometry of the canned drilling cycles G73, G74, G81-G86 and G89: which strokes one hole makes.

Pure functions of numbers in program coordinates and program units. Codes are integers, ten times the
G number (810 is G81). The sequence is that of RS-274/NGC (NIST IR 6556, section 3.5.16) as LinuxCNC
carries it out (`NGC_CYCLES`); `ISO_CYCLES` are those of Fanuc and Haas controls, which differ here:

- an initial level below R: LinuxCNC goes straight to R first; Fanuc positions in the plane at its present
  level, then goes to R.
- a start at or below R in a series: LinuxCNC rises on the diagonal move to the hole, to R with G99, to the
  initial level with G98. Fanuc positions at its present level.
- tapping (G84, G74) and G89 feed up to R on Fanuc, then go to the initial level as a rapid; LinuxCNC
  feeds up to the end.
- pecks: the clearance is 0.010 inch (0.254 mm) in LinuxCNC and a parameter of the control on Fanuc
  (5114, 5115) and Haas (settings 22, 52). Pass it as `clearance`; where it is not known the end points
  of the hole hold and the pecks between them do not.

Grbl has no canned cycles. G76 and G87 (orientation and shift of the spindle) and G88 (an operator moves
the axes by hand) are refused. So is tapping outside G17 on LinuxCNC: its release 2.9 makes the feed strokes
of G84 and G74 there along the wrong axes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from olp.core.budget import Budget
from olp.core.errors import ProgramError

Point = tuple[float, float, float]
Kind = Literal["rapid", "feed", "dwell", "spindle"]
Spindle = Literal["", "stop", "reverse", "restore"]

#: Axis numbers (first, second, tool axis) of a plane; X is 0.
PLANES: dict[int, tuple[int, int, int]] = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}

#: The clearance in LinuxCNC between the bottom of the last peck and the end of the rapid that returns to it.
LCNC_CLEARANCE_MM = 0.254
#: The same for programs in inches.
LCNC_CLEARANCE_INCH = 0.010

_TAPPING = frozenset({740, 840})
_PECKING = frozenset({730, 830})
_DWELL_NEEDED = frozenset({820, 860, 890})
#: pecks of a hole at most: a step far below the resolution of the numbers would never end
_MAX_PECKS = 100_000
#: holes of a block at most
_MAX_REPEATS = 20_000
#: strokes of all holes of a program: of a short one, and for each byte of a long one
_STROKES = 250_000
_STROKES_PER_BYTE = 4.0
#: work of a hole beside its strokes, in strokes
HOLE_STROKES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleRules:
    """How a control makes canned cycles.

    - `rises_first`: it leaves a level below R before it goes to the hole.
    - `feeds_home`: G84, G74 and G89 feed up to the end, else to R only.
    - `taps_in_any_plane`: else G84 and G74 go along the wrong axes outside G17.
    - `taps_by_control`: it synchronises G84 and G74, so that plain moves cannot replace them.
    - `peck_by_parameter`: a parameter of the control gives the clearance of pecks.
    - `repeat_words`: these count the holes of a block, the first of them that is there.
    - `stores`: zero holes store the words of the cycle, else they are an error.
    - `new_code_forgets`: another cycle of a series takes no words from the one before.
    - `levels_follow_distance`: after a change between G90 and G91 a series needs R and depth again.
    - `keeps_numbers`: a series keeps its initial level, R and depth as numbers of the program. Offsets and
      units may change, and G28 may come between. Else it has to end there.
    - `turning`: how the spindle has to turn in these cycles, M3 or M4.
    - `other_axes`: words of further axes may be in the block of a cycle.
    - `exact_corners`: all corners of a cycle are exact, whatever the path mode.
    """

    rises_first: bool
    feeds_home: bool
    taps_in_any_plane: bool
    taps_by_control: bool
    peck_by_parameter: bool
    repeat_words: str
    stores: bool
    new_code_forgets: bool
    levels_follow_distance: bool
    keeps_numbers: bool
    exact_corners: bool
    other_axes: bool
    turning: Mapping[int, tuple[int, ...]]

    def counter(self, words: Mapping[str, int]) -> int | None:
        """Of the words of a block by letter the one that counts its holes."""
        return next((words[letter] for letter in self.repeat_words if letter in words), None)


NGC_CYCLES = CycleRules(
    rises_first=True, feeds_home=True, taps_in_any_plane=False, taps_by_control=False,
    peck_by_parameter=False, repeat_words="L", stores=False, new_code_forgets=True,
    levels_follow_distance=False, keeps_numbers=True, exact_corners=True,
    other_axes=False, turning={740: (4,), 840: (3,), 860: (3, 4)},
)  # fmt: skip
ISO_CYCLES = CycleRules(
    rises_first=False, feeds_home=False, taps_in_any_plane=True, taps_by_control=True,
    peck_by_parameter=True, repeat_words="LK", stores=True, new_code_forgets=False,
    levels_follow_distance=True, keeps_numbers=False, exact_corners=False,
    other_axes=True, turning={},
)  # fmt: skip


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


def levels(r: float, z: float, *, absolute: bool, initial_z: float) -> tuple[float, float]:
    """Absolute R and Z levels from the words of the block.

    In G91 (RS-274 and Fanuc alike) R counts from the initial level of the series, and Z from R.
    """
    if absolute:
        return r, z
    return initial_z + r, initial_z + r + z


def hole_moves(
    code: int,
    *,
    start: Point,
    xy: tuple[float, float],
    r: float,
    z: float,
    q: float | None = None,
    p: float | None = None,
    retract_to_r: bool,
    initial_z: float,
    plane: int = 17,
    clearance: float = LCNC_CLEARANCE_MM,
    unit: float = 1.0,
    ground: float = 0.0,
    rules: CycleRules = NGC_CYCLES,
) -> tuple[Stroke, ...]:
    """Strokes of one hole, in order; rapids of zero length are left out, a feed of zero length is not.

    `start` is the position before the block, (x, y, z). `xy` is the position of the hole along the first and
    second axis of the plane: (X, Y) in G17, (Z, X) in G18, (Y, Z) in G19. `r`, `z` and `initial_z` are
    absolute, along the tool axis; `initial_z` is the position on that axis before the first cycle of the
    series of contiguous cycles. `q` is the peck, `p` the dwell in s, `clearance` the distance kept above
    the last peck (G83) or drawn back after it (G73). All lengths are in program units. Or `r`, `z`, `q` and
    `clearance` alone are, and a level n lies at n * `unit` + `ground` of the others. Pecks are counted in
    numbers of the program, as the control does it: the last one may hang on the last bit.

    A second hole of the same series starts where the first ended, with the same `initial_z`.
    Raises ProgramError (without a line) for a cycle without offline geometry and for words it cannot accept.
    """
    _check(code, plane, r, z, q, p)
    if not rules.taps_in_any_plane and code in _TAPPING and plane != 17:
        raise ProgramError(
            f"G{code // 10} in plane G{plane}: LinuxCNC 2.9 taps along the wrong axes outside G17; use G17",
            code="OLP531",
        )
    axes = PLANES[plane]
    level = start[axes[2]]
    depths = _depths(r, z, q or 0.0) if code in _PECKING else []
    pecks = [(d * unit + ground, (d + clearance) * unit + ground) for d in depths]
    r, z = r * unit + ground, z * unit + ground
    clear = r if retract_to_r else max(initial_z, r)
    hole = _Hole(
        position=list(start),
        axes=axes,
        r=r,
        z=z,
        pecks=pecks,
        p=p or 0.0,
        clear=clear,
        feed_home=rules.feeds_home,
    )
    if rules.rises_first:
        if initial_z < r:
            hole.rapid_to(r)
        if level <= r or initial_z < r:
            level = clear
    hole.rapid_over(xy, level)
    hole.rapid_to(r)
    _RECIPES[code](hole)
    return tuple(hole.strokes)


def _depths(r: float, z: float, q: float) -> list[float]:
    """The depths of all pecks but the last. Repeated subtraction, as the control does it: a closed form may
    differ by one peck through rounding."""
    depths = []
    depth = r - q
    while depth > z:
        depths.append(depth)
        depth -= q
    return depths


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
    """Strokes of a block with a repeat count (L; K on Fanuc): first hole at `xy`, the next `step` further.

    In G90 the step is zero: RS-274 makes the same hole again. Other arguments and errors as in `hole_moves`.
    """
    if repeats < 1:
        raise ProgramError("the cycle is repeated fewer than one time; expected L1 or more", code="OLP531")
    check_repeats(repeats)
    strokes: list[Stroke] = []
    for _ in range(repeats):
        strokes += hole_moves(
            code, start=start, xy=xy, r=r, z=z, q=q, p=p, retract_to_r=retract_to_r, initial_z=initial_z,
            plane=plane, clearance=clearance, rules=rules,
        )  # fmt: skip
        start = strokes[-1].point
        xy = (xy[0] + step[0], xy[1] + step[1])
    return tuple(strokes)


def check_repeats(repeats: int) -> None:
    """Raise ProgramError where a block makes more holes than any part has."""
    if repeats > _MAX_REPEATS:
        raise ProgramError(f"the block makes {repeats} holes; expected at most {_MAX_REPEATS}", code="OLP543")


def stroke_budget(size: int) -> Budget:
    """The strokes that the holes of a program of `size` bytes may have together."""
    return Budget.of(
        size, least=_STROKES, per_byte=_STROKES_PER_BYTE,
        message="the canned cycles of the program have more than {limit} strokes; split the program",
    )  # fmt: skip


@dataclass(slots=True)
class _Hole:
    """One hole while its strokes are made: the position, the strokes so far, and the values of the cycle.
    `pecks` are the depths of all but the last one, and how far the tool comes back from each."""

    position: list[float]
    axes: tuple[int, int, int]
    r: float
    z: float
    pecks: list[tuple[float, float]]
    p: float
    clear: float
    feed_home: bool
    strokes: list[Stroke] = field(default_factory=list)

    def rapid_over(self, xy: tuple[float, float], level: float) -> None:
        before = tuple(self.position)
        first, second, tool = self.axes
        self.position[first], self.position[second], self.position[tool] = *xy, level
        if tuple(self.position) != before:
            self._add("rapid")

    def rapid_to(self, level: float) -> None:
        if self.position[self.axes[2]] != level:
            self.position[self.axes[2]] = level
            self._add("rapid")

    def feed_to(self, level: float) -> None:
        self.position[self.axes[2]] = level
        self._add("feed")

    def dwell(self) -> None:
        self._add("dwell", seconds=self.p)

    def spindle(self, action: Spindle) -> None:
        self._add("spindle", spindle=action)

    def _add(self, kind: Kind, *, seconds: float = 0.0, spindle: Spindle = "") -> None:
        x, y, z = self.position
        self.strokes.append(Stroke(kind, x, y, z, seconds, spindle))

    def drill(self) -> None:
        self.feed_to(self.z)
        self.rapid_to(self.clear)

    def drill_dwell(self) -> None:
        self.feed_to(self.z)
        self.dwell()
        self.rapid_to(self.clear)

    def peck(self) -> None:
        self._pecks(full_retract=True)

    def chip_break(self) -> None:
        self._pecks(full_retract=False)

    def _pecks(self, *, full_retract: bool) -> None:
        for depth, back in self.pecks:
            self.feed_to(depth)
            if full_retract:
                self.rapid_to(self.r)
            self.rapid_to(back)
        self.drill()

    def tap(self) -> None:
        self.feed_to(self.z)
        self.spindle("stop")
        self.spindle("reverse")
        self.dwell()
        self.feed_to(self.clear if self.feed_home else self.r)
        self.spindle("stop")
        self.spindle("restore")
        self.rapid_to(self.clear)

    def bore(self) -> None:
        self.feed_to(self.z)
        self.feed_to(self.r)
        self.rapid_to(self.clear)

    def bore_stop(self) -> None:
        self.feed_to(self.z)
        self.dwell()
        self.spindle("stop")
        self.rapid_to(self.clear)
        self.spindle("restore")

    def bore_dwell(self) -> None:
        self.feed_to(self.z)
        self.dwell()
        self.feed_to(self.clear if self.feed_home else self.r)
        self.rapid_to(self.clear)


_RECIPES: dict[int, Callable[[_Hole], None]] = {
    730: _Hole.chip_break,
    740: _Hole.tap,
    810: _Hole.drill,
    820: _Hole.drill_dwell,
    830: _Hole.peck,
    840: _Hole.tap,
    850: _Hole.bore,
    860: _Hole.bore_stop,
    890: _Hole.bore_dwell,
}

#: The cycles that `hole_moves` knows.
CODES = frozenset(_RECIPES)


def _check(code: int, plane: int, r: float, z: float, q: float | None, p: float | None) -> None:
    name = f"G{code / 10:g}"
    if code not in CODES:
        raise ProgramError(
            f"{name} has no geometry that is known offline; expected one of "
            f"{', '.join(f'G{known / 10:g}' for known in sorted(CODES))}; write the hole as plain moves",
            code="OLP544",
        )
    if plane not in PLANES:
        raise ProgramError(f"{name} in plane G{plane}; expected G17, G18 or G19", code="OLP531")
    if not all(map(math.isfinite, (r, z))):
        raise ProgramError(
            f"{name} without a finite R and Z; give both on the first block of the cycle", code="OLP531"
        )
    if r < z:
        raise ProgramError(
            f"{name} has R {r:g} below the bottom {z:g}; R must not be below it", code="OLP531"
        )
    if code in _PECKING:
        if q is None or not q > 0:
            raise ProgramError(f"{name} needs a peck Q greater than zero, found {q}", code="OLP531")
        if (r - z) / q > _MAX_PECKS:
            raise ProgramError(
                f"{name} with Q {q:g} makes more than {_MAX_PECKS} pecks; give a larger Q", code="OLP543"
            )
    if code in _DWELL_NEEDED and p is None:
        raise ProgramError(f"{name} needs a dwell P; give P0 for none", code="OLP531")
    if p is not None and p < 0:
        raise ProgramError(f"{name} has a negative dwell P {p:g}; expected zero or more", code="OLP531")
