"""The moves of a program as the search for features sees them.

Positions are those of the frame shown, turned so that the third coordinate is along the tool axis, positive
out of the material. The tool axis is that of the tool vector where it lies along one axis, else Z of the
program. What a move is, is decided in blocks, so that a program of a million lines costs little memory.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Frame, Kind, Toolpath
from olp.program.feeds.moves import lengths_mm
from olp.program.program import Program
from olp.review.features.figures import number
from olp.review.scene import Scene

#: Moves that are looked at at once.
_BLOCK = 1 << 16
#: A coordinate that changes by less does not change, in mm: far below any digit of a program.
SAME_MM = 1e-6
#: Positions closer than this are equal, in mm, and never less than half a digit of the program.
_NEAR_MM = 2e-3
#: The last digit of most programs in mm, and the coarsest one: numbers with fewer decimals are round ones.
_DIGIT_MM = 1e-3
_COARSE_MM = 1e-2
#: A stretch of feed moves with more inclined lines than this may be a freeform surface.
_INCLINED = 12


class Does(IntEnum):
    """What a move does: it stays on its level, goes along the tool axis, or is inclined."""

    NOTHING = 0
    RAPID = 1
    UNKNOWN = 2
    ALONG_TOOL = 3
    LEVEL = 4
    LEVEL_ARC = 5
    OTHER_ARC = 6
    INCLINED = 7
    PROBE = 8


#: Moves that begin a new stretch.
_APART = (Does.RAPID, Does.UNKNOWN)


class Moves:
    """The moves of a scene, n of them. (n,) `does`, `length_mm` and `stretch` of each move: a stretch is
    a run of feed moves of an operation, between rapids. `near_mm` is the distance of equal positions,
    `digit_mm` the last digit of the coordinates."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.path: Toolpath = scene.nominal.toolpath
        self.operation: Index = scene.table.operation
        frames = self.path.frames or (Frame(),)
        self._zero = np.array([np.add(f.length_mm, scene.frame.origin_mm) for f in frames], float)
        turns = [_turned(f) for f in frames]
        self._turns, kept = np.unique(np.array(turns).reshape(len(turns), 9), axis=0, return_inverse=True)
        self._turn_of = kept.reshape(-1)
        self.length_mm = lengths_mm(self.path)
        self.does, self._staying = self._looked_at()
        self.stretch = self._stretches()
        self.digit_mm = scene.digit_mm
        self.near_mm = max(_NEAR_MM, 0.5 * self.digit_mm)

    @cached_property
    def freeform(self) -> Mask:
        """(s,) stretches that are freeform: inclined lines are many, and most of the length."""
        size = int(self.stretch[-1]) + 1 if len(self.stretch) else 0
        inclined = self.does == Does.INCLINED
        feed = np.where(self.does == Does.RAPID, 0.0, np.nan_to_num(self.length_mm))
        whole = np.bincount(self.stretch, feed, size)
        own = np.bincount(self.stretch[inclined], feed[inclined], size)
        return np.asarray(
            (np.bincount(self.stretch[inclined], minlength=size) > _INCLINED) & (own > whole / 2)
        )

    @property
    def staying(self) -> Mask:
        """(n,) moves, also rapids, along the tool axis or without length."""
        return self._staying

    def feeds(self, rows: Index) -> Index:
        """Those of some moves that are feed moves with known positions."""
        does = self.does[rows]
        return np.asarray(rows[(does != Does.RAPID) & (does != Does.UNKNOWN)], np.int64)

    def before(self, rows: Index) -> Index:
        """(m,) the last move with a length before each move, -1 where there is none."""
        some = np.flatnonzero(self.does != Does.NOTHING)
        place = np.searchsorted(some, rows) - 1
        return np.asarray(np.where(place >= 0, some[np.maximum(place, 0)], -1), np.int64)

    def turn(self, row: int) -> Array:
        """(3, 3) columns: the directions of the coordinates of a move, in the frame shown."""
        return np.asarray(self._turns[self._turn_of[self.path.frame[row]]].reshape(3, 3))

    def turn_of(self, rows: Index) -> Index:
        """(m,) which directions the coordinates of moves have."""
        return np.asarray(self._turn_of[self.path.frame[rows]], np.int64)

    def shown(self, rows: Index, axis_mm: Array) -> Array:
        """(m, 3) axis positions of moves, as tips in the frame shown."""
        return np.asarray(axis_mm - self._zero[self.path.frame[rows]])

    def starts_mm(self, rows: Index) -> Array:
        """(m, 3) axis positions at the starts of moves."""
        before = self.path.end_mm[np.maximum(rows - 1, 0)]
        return np.where((rows > 0)[:, None], before, self.path.start_mm)

    def tips(self, rows: Index) -> tuple[Array, Array]:
        """(m, 3) starts and ends of moves in the frame shown."""
        return self.shown(rows, self.starts_mm(rows)), self.shown(rows, self.path.end_mm[rows])

    def ends(self, rows: Index) -> tuple[Array, Array]:
        """(m, 3) starts and ends of moves in coordinates across and along the tool axis."""
        return self.placed(rows, self.starts_mm(rows)), self.placed(rows, self.path.end_mm[rows])

    def sense(self, rows: Index, plane: Index) -> Array:
        """(m,) 1 where arcs of these planes turn the same way in the coordinates of the moves, else -1."""
        turns = self._turns.reshape(-1, 3, 3)[self.turn_of(rows)]
        normal = np.cross(turns[:, :, 0], turns[:, :, 1])
        third = np.array([axes[2] for axes in PLANES])[plane]
        return np.asarray(np.sign(normal[np.arange(len(rows)), third]))

    def level(self, row: int, out: Array) -> str:
        """Where a move ends along the direction `out` (3,), in coordinates of the program: "Z -3 mm". Empty
        where that is none of its axes."""
        frame = self.path.frames[int(self.path.frame[row])]
        own = out if frame.turn is None else out @ np.array(frame.turn)
        axis = int(np.argmax(np.abs(own)))
        if np.abs(own[axis]) < 1.0 - SAME_MM:
            return ""
        tip = frame.tip_mm(self.path.end_mm[row] - np.array(frame.length_mm))
        return f"{'XYZ'[axis]} {number(float(tip[axis]))} mm"

    def placed(self, rows: Index, axis_mm: Array) -> Array:
        """(m, 3) axis positions of moves in coordinates across and along the tool axis."""
        tip = self.shown(rows, axis_mm)
        if len(self._turns) == 1:
            return np.asarray(tip @ self._turns[0].reshape(3, 3))
        turns = self._turns[self.turn_of(rows)].reshape(-1, 3, 3)
        return np.asarray(np.einsum("ij,ijk->ik", tip, turns))

    def _looked_at(self) -> tuple[npt.NDArray[np.uint8], Mask]:
        """What each move does, and whether it stays at one place across the tool axis."""
        path = self.path
        does, staying = np.empty(len(path), np.uint8), np.empty(len(path), bool)
        for a in range(0, len(path), _BLOCK):
            rows = np.arange(a, min(a + _BLOCK, len(path)))
            start, end = self.ends(rows)
            step = np.abs(end - start)
            across = np.maximum(step[:, 0], step[:, 1]) > SAME_MM
            along = step[:, 2] > SAME_MM
            kind = np.where(across & along, Does.INCLINED, np.where(across, Does.LEVEL, Does.ALONG_TOOL))
            kind[~across & ~along] = Does.NOTHING
            unknown = ~np.isfinite(step).all(axis=1)
            kind[unknown] = Does.UNKNOWN
            kind[path.kind[rows] == Kind.RAPID] = Does.RAPID
            kind[(path.kind[rows] == Kind.PROBE) & ~unknown] = Does.PROBE
            does[rows] = kind
            staying[rows] = ~across & ~unknown
        self._look_at_arcs(does, staying)
        return does, staying

    def _look_at_arcs(self, does: npt.NDArray[np.uint8], staying: Mask) -> None:
        arcs = self.path.arcs
        if not len(arcs):
            return
        normal = np.array([axes[2] for axes in PLANES])[arcs.plane]
        turns = self._turns.reshape(-1, 3, 3)[self.turn_of(arcs.move)]
        # the arc is in a level where the normal of its plane is the tool axis
        flat = np.abs(turns[np.arange(len(arcs)), normal, 2]) > 1.0 - SAME_MM
        start, end = self.ends(arcs.move)
        flat &= np.abs(end - start)[:, 2] <= SAME_MM
        known = does[arcs.move] != Does.UNKNOWN
        does[arcs.move] = np.where(flat, Does.LEVEL_ARC, Does.OTHER_ARC)
        does[arcs.move[~known]] = Does.UNKNOWN
        staying[arcs.move] = False

    def _stretches(self) -> Index:
        new = np.isin(self.does, _APART)
        new |= np.diff(self.operation, prepend=self.operation[:1]) != 0
        cycle = (self.path.flag & np.uint8(Flag.CYCLE)) != 0
        new |= np.diff(cycle, prepend=cycle[:1])
        if len(self._turns) > 1:
            turn = self._turn_of[self.path.frame]
            new |= np.diff(turn, prepend=turn[:1]) != 0
        return np.asarray(np.cumsum(new), np.int64)


def _tool_axis(frame: Frame) -> Array:
    """(3,) out of the material, in coordinates of the program."""
    along = np.flatnonzero(np.abs(np.array(frame.tool_mm)[:3]) > SAME_MM)
    out = np.zeros(3)
    if len(along) == 1:
        out[along[0]] = -np.sign(frame.tool_mm[int(along[0])])
    else:
        out[2] = 1.0
    return out


def _turned(frame: Frame) -> Array:
    """(3, 3) columns: the directions of the coordinates in the frame shown. The first two are across the tool
    axis, in the order of PLANES."""
    out = _tool_axis(frame)
    axis = int(np.argmax(np.abs(out)))
    order = next(axes for axes in PLANES if axes[2] == axis)
    turn = np.eye(3) if frame.turn is None else np.array(frame.turn)
    columns = turn[:, list(order)].copy()
    columns[:, 2] *= out[axis]
    # a scaled frame has longer or shorter ones
    columns /= np.linalg.norm(columns, axis=0)
    return np.asarray(columns, float)


def digit_mm(program: Program) -> float:
    """The last digit of the coordinates of a program in mm; where it is not known, that of most programs."""
    used = program.slot[program.slot >= 0] if program.words is not None else np.zeros(0, np.int32)
    if program.words is None or not used.size:
        return _DIGIT_MM
    unit_mm = max(f.unit_mm for f in program.toolpath.frames)
    # zeros at the end may be left out, and single numbers may have more digits
    decimals = int(np.percentile(program.words.decimals[used], 75.0, method="lower"))
    return min(float(unit_mm * 10.0**-decimals), _COARSE_MM)
