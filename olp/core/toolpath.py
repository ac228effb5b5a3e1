"""The nominal path of a program as columns: axis positions of the machine, in program order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from enum import IntEnum, IntFlag
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import arc_points, quarter_shares
from olp.core.machine import ZERO, Vector
from olp.core.turns import Turn, Turns
from olp.core.values import dataclass

#: How far a control may round corners where a program does not state it, in mm: Grbl's default of $11, and
#: usual for a finishing cut.
BLEND_MM = 0.01
#: A tool vector in mm, and the payload in kg behind it where there is one.
Tool = tuple[float, ...]
#: An axis position in mm, and the tool with which it was touched.
Touch = tuple[Vector, Tool]
#: What the control leads evenly along a move with tool centre point control, "" without it. In a tilted
#: plane the rotary axes are "fixed".
Interpolated = Literal["", "axes", "vector", "fixed"]


@dataclass(frozen=True, slots=True)
class LengthError:
    """How far the tip is from where the stored length of a tool has it, because of how that was set.

    The target lies farther by Z of the error at `touched` less `constant_mm`, in the direction `along`: that
    of the tool while cutting, and against that of the tool that touched the work offset. `touched` is where
    the length was set on the uncompensated machine, None where it was measured by other means. `constant_mm`
    is by how much all lengths of its setter are too long.
    """

    along: Vector
    touched: Touch | None
    constant_mm: float = 0.0


class Kind(IntEnum):
    """What a move is. Arcs run clockwise or counter-clockwise seen against their plane's normal."""

    RAPID = 0
    LINE = 1
    ARC_CW = 2
    ARC_CCW = 3
    PROBE = 4


class Flag(IntFlag):
    """Properties of a move."""

    PASS = 1  #: never corrected: G53, G28, G30, a section switched off
    DELETED = 2  #: in a block that the block-delete switch removes
    CYCLE = 4  #: made by a canned cycle: has no words
    WHOLE = 8  #: never split: the block moves a rotary axis too, or follows the spindle
    INCREMENTAL = 16  #: its words are distances
    MACHINE = 32  #: G53: its words are axis positions
    INVERSE_TIME = 64  #: G93: its F word is one over its time
    CONTROL = 128  #: made by the control itself, without words: axes become unknown (M6, G28, after a probe)


@dataclass(frozen=True, slots=True)
class CutterCompensation:
    """G41 or G42: the control offsets the contour to the `left` or to the right by `radius_mm`, in a plane
    (0..2). `number` counts the contours of a program. `corner` moves are made by the control, round an
    outside corner."""

    plane: int
    left: bool
    radius_mm: float = 0.0
    number: int = 0
    corner: bool = False


def carried(tool_mm: Vector, payload_kg: float) -> Tool:
    """A tool row for error models: the tool vector, and the payload as a fourth number where there is one."""
    return (*tool_mm, payload_kg) if payload_kg else tool_mm


@dataclass(frozen=True, slots=True)
class Frame:
    """How words became axis positions for some moves, and which tool was in the spindle.

    Axis position = word x `unit_mm` + `offset_mm` (work offset, shifts and the active tool length
    `length_mm`). `tool_mm` is the tool vector, gauge point to tip; `payload_kg` is what the machine carries.
    `touched` is (axis position, tool vector and payload) of the touch-off of the work offset on the
    uncompensated machine, None where it was located by other means. `lengths` are errors of the lengths of
    tools that are not common to touch-off and cut. In a rotated, mirrored or scaled frame the words are
    turned first, by the rows of `turn`, None where nothing turns: axis position = `turn` (word x `unit_mm`)
    + `offset_mm`. `lift_mm` is
    the part of the offset by which the tip keeps off the programmed point, as over a hole. `compensation` is
    that of the cutter, where the contour was taken as the path of the tool. With tool centre point control
    words state the tip in the workpiece, and `tip` says what turns evenly from end to end: rotary "axes", or
    the direction of the tool ("vector"). In a tilted plane words state the tip too, while rotary axes stand
    ("fixed"), and `length_mm` is NaN where none is in force. It is "" without. Where it is `directed`, words
    I, J and K of straight moves state the direction of the tool.
    """

    unit_mm: float = 1.0
    offset_mm: Vector = ZERO
    length_mm: Vector = ZERO
    tool_mm: Vector = ZERO
    tool: int | None = None
    work_offset: str = ""
    touched: Touch | None = None
    lengths: tuple[LengthError, ...] = ()
    payload_kg: float = 0.0
    turn: Turn | None = None
    lift_mm: Vector = ZERO
    compensation: CutterCompensation | None = None
    tip: Interpolated = ""
    directed: bool = False

    def origin_mm(self) -> Vector:
        """The axis position of the program's origin, no tool length active."""
        parts = zip(self.offset_mm, self.length_mm, self.lift_mm, strict=True)
        x, y, z = (offset - length - lift for offset, length, lift in parts)
        return (x, y, z)

    @property
    def stretch(self) -> float:
        """How much farther the axes go than words say, at most; 1 where nothing is scaled."""
        return 1.0 if self.turn is None else float(np.linalg.norm(self.turn, axis=0).max())

    def placed_mm(self, words: Sequence[float]) -> tuple[float, ...]:
        """The axis position of three words."""
        position_mm = [w * self.unit_mm for w in words]
        if self.turn is not None:
            position_mm = [sum(r * v for r, v in zip(row, position_mm, strict=True)) for row in self.turn]
        return tuple(v + o for v, o in zip(position_mm, self.offset_mm, strict=True))

    def tip_mm(self, point: Array) -> Array:
        """Positions of the tip (n, 3) in this frame, from axis positions less the length."""
        away = point - np.array(self.origin_mm())
        return away if self.turn is None else np.asarray(away @ np.linalg.inv(self.turn).T, float)


@dataclass(frozen=True, slots=True, eq=False)
class Arcs:
    """Arcs and helices: `move` (m,) index, `centre_mm` (m, 3) with the start's third coordinate, `plane`
    (m,) 0..2, `sweep_rad` (m,) signed about the plane's normal, whole turns included."""

    move: Index
    centre_mm: Array
    plane: npt.NDArray[np.int8]
    sweep_rad: Array

    @staticmethod
    def none() -> Arcs:
        return Arcs(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0, np.int8), np.zeros(0))

    def __len__(self) -> int:
        return len(self.move)

    def within(self, first: int, last: int) -> slice:
        """The arcs among moves `first`..`last`."""
        return slice(*np.searchsorted(self.move, (first, last)).tolist())

    def part(self, first: int, last: int) -> Arcs:
        """The same, with their moves counted from `first`."""
        some = self.within(first, last)
        return Arcs(self.move[some] - first, self.centre_mm[some], self.plane[some], self.sweep_rad[some])


@dataclass(frozen=True, slots=True, eq=False)
class Toolpath:
    """(n,) `kind`, `flag`, `line` (from 1), `frame`; (n, 3) `end_mm`, NaN where an axis is unknown."""

    kind: npt.NDArray[np.uint8]
    flag: npt.NDArray[np.uint8]
    line: npt.NDArray[np.int32]
    frame: npt.NDArray[np.int32]
    end_mm: Array
    frames: tuple[Frame, ...]
    arcs: Arcs = field(default_factory=Arcs.none)
    start_mm: tuple[float, float, float] = (float("nan"),) * 3

    def __len__(self) -> int:
        return len(self.kind)

    def starts_mm(self, first: int = 0, last: int | None = None) -> Array:
        """(m, 3) axis positions at the start of moves `first`..`last`."""
        last = len(self) if last is None else last
        starts = np.empty((last - first, 3))
        if last > first:
            starts[1:] = self.end_mm[first : last - 1]
            starts[0] = self.end_mm[first - 1] if first else self.start_mm
        return starts

    def part(self, first: int, last: int) -> Toolpath:
        """Moves `first`..`last` as a path that starts where the moves before it end."""
        some, start = slice(first, last), self.start_mm
        if first:
            x, y, z = self.end_mm[first - 1].tolist()
            start = (x, y, z)
        return Toolpath(
            self.kind[some], self.flag[some], self.line[some], self.frame[some], self.end_mm[some],
            self.frames, self.arcs.part(first, last), start,
        )  # fmt: skip

    def compensated(self) -> Mask:
        """(n,) moves along a contour that the control offsets by the cutter radius."""
        if all(f.compensation is None for f in self.frames):
            # one value stands for all
            return np.broadcast_to(np.False_, len(self))
        return np.array([f.compensation is not None for f in self.frames], bool)[self.frame]

    def offset_by_radius(self) -> bool:
        """Whether the control offsets any move by a cutter radius which is not 0."""
        return any(c is not None and c.radius_mm > 0 for c in (f.compensation for f in self.frames))

    def compensated_radius_mm(self) -> Array:
        """(n,) radius by which the control offsets each move, 0 where it does not."""
        radii = [0.0 if (c := f.compensation) is None else c.radius_mm for f in self.frames]
        return np.array(radii or [0.0], float)[self.frame]

    def contour_number(self) -> Index:
        """(n,) number of the contour that each move belongs to, -1 where it belongs to none."""
        numbers = [-1 if (c := f.compensation) is None else c.number for f in self.frames]
        return np.array(numbers or [-1], np.int64)[self.frame]

    def reach_mm(self) -> tuple[Array, Array]:
        """(n, 3) lowest and highest axis positions at the end of each move and, on arcs, along it; NaN where
        an axis is not known. A line lies in a box where both its ends do."""
        if not len(self.arcs):
            return self.end_mm, self.end_mm
        arcs, move = self.arcs, self.arcs.move
        low, high = self.end_mm.copy(), self.end_mm.copy()
        start = self.starts_mm()[move]
        for quarter in range(4):
            share = quarter_shares(start, arcs.centre_mm, arcs.plane, arcs.sweep_rad, quarter)
            point = arc_points(start, self.end_mm[move], arcs.centre_mm, arcs.plane, arcs.sweep_rad, share)
            low[move], high[move] = np.fmin(low[move], point), np.fmax(high[move], point)
        return low, high

    def turns(self) -> Turns | None:
        """How words of the frames lie to the axes; None where no frame turns."""
        return Turns.of([frame.turn for frame in self.frames])

    def tool_mm(self, first: int = 0, last: int | None = None) -> Array:
        """Tool vectors of moves `first`..`last`: (3,) where it is one and the same, else (m, 3); with
        payloads (4,) or (m, 4), kg in the last column."""
        return self.per_frame(self._tools(), first, last)

    def tools_mm(self) -> Array:
        """(k, 3) the tool vectors of all frames; with payloads (k, 4)."""
        return np.array(self._tools() or np.zeros((1, 3)), float)

    def _tools(self) -> list[Tool]:
        if any(f.payload_kg for f in self.frames):
            return [(*f.tool_mm, f.payload_kg) for f in self.frames]
        return [f.tool_mm for f in self.frames]

    def tool_at(self, move: Index) -> Array:
        """As `tool_mm` of the whole path, at moves (m,) alone."""
        return self.per_frame_at(self._tools(), move)

    def per_frame(self, values: Sequence[Tool], first: int = 0, last: int | None = None) -> Array:
        """One vector per frame, spread over moves: (3,) where it is the same for all of them, else (m, 3)."""
        return _spread(values, self.frame[first:last], self.frame[first:last])

    def per_frame_at(self, values: Sequence[Tool], move: Index) -> Array:
        """As `per_frame` of the whole path, at moves (m,) alone."""
        return _spread(values, self.frame, self.frame[move])


def _spread(values: Sequence[Tool], among: npt.NDArray[np.int32], frame: npt.NDArray[np.int32]) -> Array:
    """The vectors of some frames; one alone where it is the same for all frames `among` which they are."""
    if not values:
        return np.zeros(3)
    table = np.array(values, float)
    if len(values) == 1 or (table == table[0]).all():
        return np.asarray(table[0], float)
    if len(among) and (among == among[0]).all():
        return np.asarray(table[among[0]], float)
    return np.asarray(table[frame], float)
