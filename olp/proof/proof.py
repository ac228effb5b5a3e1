"""Proof by reading back: the written bytes are parsed again, run through the forward model and compared with
the nominal path, at and between the waypoints."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.proof.contour import check_contours
from olp.proof.deviation import Deviation, Single, cutting_moves, measure
from olp.proof.matching import match
from olp.proof.strokes import strokes_mm

#: the proof samples so finely that the error bends by less than this share of the tolerance between samples
_BEND_SHARE = 0.1
#: half the diagonal of the last digit's cube, as a share of the digit
ROUNDING_SHARE = 0.87
#: A move that ends within so many digits of its waypoint along each axis, rounding being half of one, ...
_NEAR_DIGITS = 0.6
#: ... and within this share of the tolerance beyond, the band in which an axis may lag, is its partner.
_NEAR_SHARE = 0.25
#: Moves that the program or you leave as they are.
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


class Counts(IntEnum):
    """How a move counts in the verdict. What cuts counts: along feed moves and strokes of holes, or at the
    points of a program of points. Rapids and what is left uncorrected are shown."""

    FEED = 0
    POINT = 1
    HOLE = 2
    RAPID = 3
    UNCORRECTED = 4
    UNKNOWN = 5


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Deviations of the nominal program (`before`) and of the corrected one (`after`), per nominal move.

    `written` is the path of the corrected program, and `groups` (n,) the last of its moves that belongs to
    each nominal one. `digit_mm` is the coarsest last digit written. `counts` (n,) are values of Counts,
    (n,) `before_mm` and `after_mm` the deviation of each move that counts, NaN of others. `lean` (n,) are
    feed moves that start where a move ended uncorrected."""

    nominal: Toolpath
    written: Toolpath
    groups: Index
    before: Deviation
    after: Deviation
    tolerance_mm: float
    digit_mm: float
    counts: npt.NDArray[np.uint8]
    before_mm: Single
    after_mm: Single
    lean: Mask

    @property
    def allowed_mm(self) -> float:
        """What a deviation may be: numerical tolerance plus rounding."""
        return self.tolerance_mm + ROUNDING_SHARE * self.digit_mm

    @property
    def judged(self) -> Mask:
        """(n,) moves that count."""
        return np.asarray(self.counts <= Counts.HOLE, bool)

    def size_mm(self) -> Array:
        """(n,) the deviation per nominal move, 0 where the move does not count."""
        return np.asarray(np.nan_to_num(self.after_mm), float)

    @property
    def largest_mm(self) -> float:
        return float(self.size_mm().max(initial=0.0))

    def owner(self) -> Index:
        """(m,) the nominal move that each move of the corrected program belongs to."""
        return np.searchsorted(self.groups, np.arange(len(self.written)))

    @property
    def holds(self) -> bool:
        return self.largest_mm <= self.allowed_mm

    def summary(self, side: str) -> dict[str, dict[str, float]]:
        """Largest and rms in um of what counts, at waypoints and along cutting moves; `side` is "before" or
        "after"."""
        part: Deviation = getattr(self, side)
        whole: Single = getattr(self, f"{side}_mm")
        at_end = self.counts <= Counts.POINT
        waypoints = part.waypoint[at_end & np.isfinite(part.waypoint)]
        along = whole[self.judged & (self.counts != Counts.POINT) & np.isfinite(whole)]
        return {"waypoints": _figures(waypoints), "between": _figures(along)}


def _figures(values: Single) -> dict[str, float]:
    if not len(values):
        return {"max_um": 0.0, "rms_um": 0.0}
    rms = float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
    return {"max_um": float(values.max()) * UM_PER_MM, "rms_um": rms * UM_PER_MM}


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
) -> Proof:
    """Compare the corrected path with the nominal one, from the two programs alone. `uncorrected` are nominal
    moves that are left uncorrected. Raises ProgramError where the second is not a correction of the first, or
    where the control would refuse it."""
    path, written = nominal.toolpath, corrected.toolpath
    target = targets(path, zero_shifts(path.frames, model))
    exempt = np.zeros(len(path), bool)
    exempt[uncorrected] = True
    near = _NEAR_DIGITS * digit_mm + _NEAR_SHARE * tolerance_mm
    groups = match(nominal, target, corrected, model, near)
    check_contours(path, written, groups)
    bend = tolerance_mm * _BEND_SHARE
    counts = _counts(nominal, target, exempt)
    sides = []
    for program, ends in ((nominal, np.arange(len(path))), (corrected, groups)):
        deviation = measure(path, target, program.toolpath, ends, model, bend)
        bottom, stroke = strokes_mm(nominal, target, program.toolpath, program.holes, model, bend)
        sides.append((deviation, _sizes(deviation, counts, bottom, stroke)))
    (before, before_mm), (after, after_mm) = sides
    lean = uncorrected_starts(path, exempt) & (counts == Counts.FEED)
    return Proof(
        path, written, groups, before, after, tolerance_mm, digit_mm, counts, before_mm, after_mm, lean
    )


def corrections_mm(nominal: Program, corrected: Program, proof: Proof) -> Array:
    """(n, 3) how far each waypoint was moved, 0 where that is not known; of canned cycles the position and
    the bottom of each hole, as a corrected depth may need other pecks."""
    correction = np.nan_to_num(proof.written.end_mm[proof.groups] - proof.nominal.end_mm)
    correction[(proof.nominal.flag & np.uint8(Flag.CYCLE | Flag.CONTROL)) != 0] = 0.0
    for mine, other in zip(nominal.holes, corrected.holes, strict=False):
        moved = [b - a for a, b in zip(mine.place_mm, other.place_mm, strict=True)]
        correction[mine.last - 1, PLANES[mine.plane]] = (*moved, other.z_mm - mine.z_mm)
    return np.asarray(correction, float)


def largest_correction_mm(nominal: Program, corrected: Program, proof: Proof) -> float:
    """The largest distance of the commands from the nominal path."""
    away = corrections_mm(nominal, corrected, proof)
    return float(np.sqrt(np.einsum("ij,ij->i", away, away).max(initial=0.0)))


def _counts(program: Program, target: Array, exempt: Mask) -> npt.NDArray[np.uint8]:
    """(n,) how each nominal move counts."""
    path = program.toolpath
    cutting = cutting_moves(path)
    counts = np.full(len(path), Counts.RAPID, np.uint8)
    points = program.dialect.points or not (path.kind != Kind.RAPID).any()
    counts[cutting] = Counts.FEED
    counts[~cutting & (points | (path.kind != Kind.RAPID))] = Counts.POINT
    cycle = (path.flag & np.uint8(Flag.CYCLE)) != 0
    counts[cycle] = np.where(path.kind[cycle] == Kind.RAPID, Counts.RAPID, Counts.HOLE)
    counts[(counts <= Counts.HOLE) & ~np.isfinite(target).all(axis=1)] = Counts.UNKNOWN
    counts[((path.flag & _AWAY) != 0) | exempt] = Counts.UNCORRECTED
    return counts


def _sizes(deviation: Deviation, counts: npt.NDArray[np.uint8], bottom: Index, stroke: Single) -> Single:
    """(n,) mm: along the path of feed moves, at the end of points, of a hole at the move to its bottom."""
    side = deviation.side.astype(np.float32)
    size = np.full(len(counts), np.nan, np.float32)
    along, end = counts == Counts.FEED, counts == Counts.POINT
    size[along] = np.fmax(deviation.waypoint, deviation.path)[along] + side[along]
    size[end] = deviation.waypoint[end] + side[end]
    if len(bottom):
        hole = counts[bottom] == Counts.HOLE
        size[bottom[hole]] = stroke[hole] + side[bottom[hole]]
    else:
        # holes without a partner are compared stroke by stroke
        hole_moves = counts == Counts.HOLE
        size[hole_moves] = np.fmax(deviation.waypoint, deviation.path)[hole_moves] + side[hole_moves]
    return size
