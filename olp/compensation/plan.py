"""The plan of a correction: where every move is commanded, one or more rows per move.

A plan holds no text. `planning` makes it, and the writers put it into the text of a program.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.machine import Vector
from olp.core.toolpath import Frame, Toolpath, Touch
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the plan: the numerical tolerance of model and chords and the last digit written, in mm.
    `split_rapids`: rapids are subdivided too. `refuse_outside`: commands outside the calibrated box are
    refused. `insert`: a step that takes up backlash may be put before a move that is not split. `one_radius`:
    arcs are written with the radius of their start, and may not end on another one."""

    tolerance_mm: float
    digit_mm: float = 0.0
    split_rapids: bool = False
    refuse_outside: bool = True
    insert: bool = True
    one_radius: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Rows in program order, one or more per move. (r,) `move` is its index. (r, 3) `target_mm` is where the
    tip has to be (kept only where the model has backlash), `command_mm` the command for it. (r, 3) `raw` is
    True where the axis keeps the program's own command. (r,) `reach` is the share of the move that ends at
    the row. (r,) `take_up` rows only take up backlash.

    `uncorrected` are moves that are left as they are for want of a position, `shift_mm` (frames, 3) the
    error that the touch-off of each frame holds. (r, 3) `centre_mm` are the centres of arcs that are not
    found from their ends alone, NaN elsewhere.
    """

    move: npt.NDArray[np.int32]
    target_mm: Array
    command_mm: Array
    raw: Mask
    reach: Array
    take_up: Mask
    uncorrected: Index
    shift_mm: Array
    play: Array | None
    centre_mm: Array | None = None

    def __len__(self) -> int:
        return len(self.move)


def zero_shifts(frames: tuple[Frame, ...], model: ErrorModel) -> Array:
    """(frames, 3): where the part really lies from where the offset says, per frame.

    A point touched off on the uncompensated machine at axis position c0 is at c0 + e(c0), and remains there.
    A tool length that was set on it at s is too short by Z of e(s): that of the tool that cuts counts, less
    that of the tool that touched.
    """

    def error_at(touch: Touch) -> Array:
        position, tool = touch
        return np.asarray(model.error(np.array([position]), np.array(tool, float))[0])

    shifts = np.zeros((len(frames), 3))
    for i, frame in enumerate(frames):
        if frame.touched is not None:
            shifts[i] += error_at(frame.touched)
        for length in frame.lengths:
            set_mm = 0.0 if length.touched is None else float(error_at(length.touched)[2])
            shifts[i] += np.array(length.along) * (set_mm - length.constant_mm)
    return shifts


class TargetRows(Protocol):
    """Rows (n, 3) of which some are asked for at a time."""

    def __getitem__(self, rows: Index | slice | int, /) -> Array: ...


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """(n, 3) where the tip has to be at the end of each move of a path, as `targets` has it, made when some
    are asked for. `shift_mm` are those of its frames."""

    path: Toolpath
    shift_mm: Array

    def __getitem__(self, rows: Index | slice | int, /) -> Array:
        end = self.path.end_mm
        end = end.take(rows, axis=0) if isinstance(rows, np.ndarray) else end[rows]
        return end + self.shift_mm[self.path.frame[rows]] if self.shift_mm.any() else end


def targets(path: Toolpath, shift_mm: Array) -> Array:
    """(n, 3) where the tip has to be at the end of each move; a move that the control adds has no target."""
    if not shift_mm.any():
        return path.end_mm
    vectors: list[Vector] = [(float(s[0]), float(s[1]), float(s[2])) for s in shift_mm]
    return path.end_mm + path.per_frame(vectors)
