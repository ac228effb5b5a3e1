"""Proof by reading back: the written bytes are parsed again, run through the forward model and compared with
the nominal path, at and between the waypoints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Toolpath
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.proof.contour import check_contours
from olp.proof.deviation import Deviation, cutting_moves, measure
from olp.proof.matching import match

#: the proof samples so finely that the error bends by less than this share of the tolerance between samples
_BEND_SHARE = 0.1
#: half the diagonal of the last digit's cube, as a share of the digit
ROUNDING_SHARE = 0.87


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Deviations of the nominal program (`before`) and of the corrected one (`after`), per nominal move.

    `written` is the path of the corrected program, and `groups` (n,) the last of its moves that belongs to
    each nominal one. `digit_mm` is the coarsest last digit written. `allowed_mm` is tolerance plus
    rounding."""

    nominal: Toolpath
    written: Toolpath
    groups: Index
    before: Deviation
    after: Deviation
    tolerance_mm: float
    digit_mm: float
    cutting: Mask
    lean: Mask

    @property
    def allowed_mm(self) -> float:
        return self.tolerance_mm + ROUNDING_SHARE * self.digit_mm

    def size_mm(self) -> Array:
        """(n,) the deviation that counts per nominal move: along the path of cutting moves, at the end of
        others; 0 where the move is not judged."""
        counts = self.after.judged
        waypoint = np.where(counts, np.nan_to_num(self.after.waypoint), 0.0)
        along = np.where(counts & self.cutting & ~self.lean, np.nan_to_num(self.after.path), 0.0)
        return np.asarray(np.maximum(waypoint, along), float)

    def owner(self) -> Index:
        """(m,) the nominal move that each move of the corrected program belongs to."""
        return np.searchsorted(self.groups, np.arange(len(self.written)))

    @property
    def holds(self) -> bool:
        return bool(self.size_mm().max(initial=0.0) <= self.allowed_mm)


def uncorrected_starts(path: Toolpath, uncorrected: Mask) -> Mask:
    """(n,) feed moves after an uncorrected move or after a canned cycle."""
    loose = uncorrected | ((path.flag & np.uint8(Flag.PASS | Flag.MACHINE | Flag.CYCLE)) != 0)
    before = np.concatenate(([False], loose[:-1]))
    return np.asarray(before & cutting_moves(path), bool)


def prove(
    nominal: Program,
    corrected: Program,
    model: ErrorModel,
    *,
    tolerance_mm: float,
    digit_mm: float,
    uncorrected: Index,
    parts: npt.NDArray[np.int32] | None = None,
) -> Proof:
    """Compare the corrected path with the nominal one. `uncorrected` are nominal moves that are left
    uncorrected. `parts` (n,) says how many corrected moves each nominal one became; without it the paths are
    matched. Raises ProgramError where the control would refuse the corrected program."""
    path, written = nominal.toolpath, corrected.toolpath
    target = targets(path, zero_shifts(path.frames, model))
    exempt = np.zeros(len(path), bool)
    exempt[uncorrected] = True
    loose = uncorrected_starts(path, exempt)
    if parts is None:
        groups = match(nominal, target, corrected, model, tolerance_mm + digit_mm)
    else:
        groups = np.cumsum(_with_pecks(nominal, corrected, parts), dtype=np.int64) - 1
    if len(groups) and int(groups[-1]) != len(written) - 1:
        raise ProgramError(
            f"the corrected program has {len(written)} moves; expected {int(groups[-1]) + 1}; it was not "
            "written"
        )
    check_contours(path, written, groups)
    after = measure(path, target, written, groups, model, tolerance_mm * _BEND_SHARE, exempt)
    before = measure(path, target, path, np.arange(len(path)), model, 1e-3, exempt)
    return Proof(path, written, groups, before, after, tolerance_mm, digit_mm, cutting_moves(path), loose)


def _with_pecks(nominal: Program, corrected: Program, parts: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """A corrected depth may take one peck more or less; the difference goes to the last stroke of a hole."""
    parts = parts.copy()
    for mine, other in zip(nominal.holes, corrected.holes, strict=True):
        more = (other.last - other.first) - (mine.last - mine.first)
        parts[mine.last - 1] += max(more, 0)
        parts[mine.last + min(more, 0) - 1 : mine.last - 1] -= 1 if more < 0 else 0
    return parts
