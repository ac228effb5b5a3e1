"""Proof by reading back: the written bytes are parsed again, run through the forward model and compared with
the nominal path, at and between the waypoints."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import Targets, zero_shifts
from olp.core.arrays import Array, Index, Mask, all_in_row, any_in_row, is_in
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.progress import Progress, part, silent
from olp.core.spool import unload
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.columns import Columns, apart, found, marked, spans
from olp.proof.deviation import Deviation, Single, cutting_moves, measure, owner_of
from olp.proof.kinds import check_kinds
from olp.proof.matching import match
from olp.proof.strokes import strokes_mm

#: the proof samples so finely that the error bends by less than this share of the tolerance between samples
_BEND_SHARE = 0.1
#: numbers that NumPy adds up at once, before it goes by halves
_SUMMED = 128
#: half the diagonal of the last digit's cube, as a share of the digit
ROUNDING_SHARE = 0.87
#: A move that ends within so many digits of its waypoint along each axis, rounding being half of one, ...
_NEAR_DIGITS = 0.6
#: ... and within this share of the tolerance beyond, the band in which an axis may lag, is its partner.
_NEAR_SHARE = 0.25
#: Moves that are looked at together.
_BLOCK = 1 << 14
#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)
#: Moves that the program or you leave as they are.
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


class Counts(IntEnum):
    """How a move counts in the verdict. What cuts counts: along feed moves and strokes of holes, or at the
    points of a program of points, also where it is left uncorrected (LEFT). Rapids are shown, and so are
    UNCORRECTED ones."""

    FEED = 0
    POINT = 1
    HOLE = 2
    LEFT = 3
    RAPID = 4
    UNCORRECTED = 5
    UNKNOWN = 6


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """What a proof keeps of a `Deviation`: (n,) `side` in mm, and of feed moves that count `bend_mm`, the
    largest part that comes from chords, 0 of the nominal program. `summary` are `figures` of all moves."""

    side: Single
    bend_mm: float
    summary: dict[str, dict[str, float]]


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Deviations of the nominal program (`before`) and of the corrected one (`after`), per nominal move.

    `written` is the path of the corrected program, and `groups` (n,) the last of its moves that belongs to
    each nominal one. `digit_mm` is the coarsest last digit written. `counts` (n,) are values of Counts,
    (n,) `before_mm` and `after_mm` the deviation of each move that counts, that at the end of those that are
    only shown, NaN of others. `lean` (n,) are feed moves that start where a move ended uncorrected."""

    nominal: Toolpath
    written: Toolpath
    groups: Index
    before: Side
    after: Side
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
        return np.asarray(self.counts <= Counts.LEFT)

    def size_mm(self, rows: slice | Index) -> Array:
        """(m,) the deviation of nominal moves, 0 where the move does not count."""
        judged = self.counts[rows] <= Counts.LEFT
        return np.where(judged, np.nan_to_num(self.after_mm[rows]), np.float64(0.0))

    @property
    def largest_mm(self) -> float:
        largest = np.float32(0.0)
        for some in spans(len(self.counts)):
            judged = self.counts[some] <= Counts.LEFT
            largest = np.fmax.reduce(self.after_mm[some][judged], initial=largest)
        return float(largest)

    def owner(self) -> Index:
        """(m,) the nominal move that each move of the corrected program belongs to."""
        return np.searchsorted(self.groups, np.arange(len(self.written)))

    def nominal_lines(self) -> npt.NDArray[np.int32]:
        """(m,) the nominal line of each move of the corrected program."""
        line = apart((len(self.written),), np.int32)
        for some in spans(len(line), _BLOCK):
            first, last = np.searchsorted(self.groups, (some.start, some.stop - 1)).tolist()
            owner = owner_of(self.groups[first : last + 1], some.start, some.stop)
            line[some] = self.nominal.line[first + owner]
        return line

    @property
    def holds(self) -> bool:
        return self.largest_mm <= self.allowed_mm


def figures(counts: npt.NDArray[np.uint8], waypoint: Single, whole: Single) -> dict[str, dict[str, float]]:
    """Largest and rms in um of what counts, of deviations in mm (n,): `waypoint` at the ends of moves, and
    `whole` along cutting moves."""
    at_end, along = (Counts.FEED, Counts.POINT, Counts.LEFT), (Counts.FEED, Counts.HOLE, Counts.LEFT)
    return {"waypoints": _figures(waypoint, counts, at_end), "between": _figures(whole, counts, along)}


def _figures(values: Single, counts: npt.NDArray[np.uint8], counted: tuple[Counts, ...]) -> dict[str, float]:
    column, largest = Columns(), 0.0
    for some in spans(len(values)):
        part = values[some]
        part = part[is_in(counts[some], counted) & np.isfinite(part)]
        column.put("all", part, np.float32)
        largest = max(largest, float(part.max(initial=0.0)))
    known = column.take("all", np.float32)
    if not len(known):
        return {"max_um": 0.0, "rms_um": 0.0}
    rms = float(np.sqrt(_square_sum(known) / len(known)))
    return {"max_um": largest * UM_PER_MM, "rms_um": rms * UM_PER_MM}


def _square_sum(values: Single) -> np.float64:
    """The sum of the squares, of halves and their halves, so that it is as exact as that of all at once."""
    if len(values) <= max(_BLOCK, _SUMMED):
        unload()
        return np.float64(np.add.reduce(np.square(values, dtype=np.float64)))
    half = len(values) // 16 * 8
    return np.float64(_square_sum(values[:half]) + _square_sum(values[half:]))


def uncorrected_starts(path: Toolpath, uncorrected: Mask) -> Mask:
    """(n,) feed moves after an uncorrected move or after a canned cycle."""
    alone = np.uint8(Flag.PASS | Flag.MACHINE | Flag.CYCLE)

    def of(some: slice) -> Mask:
        loose = uncorrected[some] | ((path.flag[some] & alone) != 0)
        before = some.start > 0 and (uncorrected[some.start - 1] or (path.flag[some.start - 1] & alone) != 0)
        behind = np.concatenate(([before], loose[:-1]))
        return np.asarray(behind & cutting_moves(path.part(some.start, some.stop)))

    return marked(len(path), of)


def prove(
    nominal: Program,
    corrected: Program,
    model: ErrorModel,
    *,
    tolerance_mm: float,
    digit_mm: float,
    uncorrected: Index,
    tell: Progress = silent,
) -> Proof:
    """Compare the corrected path with the nominal one, from the two programs alone. `uncorrected` are nominal
    moves that are left uncorrected. Raises ProgramError where the second is not a correction of the first, or
    where the control would refuse it."""
    path, written = nominal.toolpath, corrected.toolpath
    target = Targets(path, zero_shifts(path.frames, model))
    exempt = apart((len(path),), np.bool_)
    exempt[uncorrected] = True
    near = _NEAR_DIGITS * digit_mm + _NEAR_SHARE * tolerance_mm
    groups = match(nominal, target, corrected, model, near, part(tell, 0.1, 0.4))
    check_kinds(nominal, corrected, groups, digit_mm)
    bend = tolerance_mm * _BEND_SHARE
    how, counts = apart((len(path),), np.uint8), apart((len(path),), np.uint8)
    rapids = ((path.kind[some] == Kind.RAPID).all() for some in spans(len(path)))
    points = nominal.dialect.points or all(rapids)
    for some in spans(len(path)):
        part_of = path.part(some.start, some.stop)
        how[some] = _how(part_of, points)
        counts[some] = _counts(part_of, how[some], exempt[some])
    feed = marked(len(path), lambda some: np.asarray(counts[some] == Counts.FEED))

    def side(program: Program, ends: Index, chords: Mask | None, told: Progress) -> _Measured:
        bottom, stroke = strokes_mm(nominal, target, program.toolpath, program.holes, model, bend)
        by_hole = nominal.holes.inside(len(path)) if len(bottom) else None
        other = program.toolpath
        deviation = measure(path, target, other, ends, chords, model, bend, told, elsewhere=by_hole)
        size = _sizes(deviation, how, bottom, stroke)
        for some in spans(len(size)):
            size[some][counts[some] > Counts.LEFT] = np.nan
        return _Measured(deviation.waypoint, deviation.side, deviation.bend_mm, size)

    before = side(nominal, _each(groups), None, part(tell, 0.4, 0.7))
    after = side(corrected, groups, feed, part(tell, 0.7, 1.0))
    before_mm, after_mm = before.size, after.size
    blind = found(len(path), lambda some: np.isnan(after_mm[some]) & (counts[some] <= Counts.LEFT))
    counts[blind[counts[blind] == Counts.LEFT]] = Counts.UNKNOWN
    # strokes of a hole above its bottom have no figure of their own
    count = counts[blind]
    stroke = (count == Counts.HOLE) & ~np.isnan(before_mm[blind])
    _refuse_blind(path, blind[(count <= Counts.POINT) | stroke])
    for some in spans(len(path)):
        shown = is_in(counts[some], (Counts.RAPID, Counts.UNCORRECTED))
        for one in (before, after):
            one.size[some][counts[some] > Counts.LEFT] = np.nan
            one.size[some][shown] = one.waypoint[some][shown]
    behind = uncorrected_starts(path, exempt)
    lean = marked(len(path), lambda some: np.asarray(behind[some] & feed[some]))
    return Proof(
        path, written, groups, before.side_of(counts), after.side_of(counts), tolerance_mm, digit_mm, counts,
        before_mm, after_mm, lean,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Of one program: (n,) `waypoint`, `side` and `size` in mm, and `bend_mm` as in `Side`."""

    waypoint: Single
    side: Single
    bend_mm: float
    size: Single

    def side_of(self, counts: npt.NDArray[np.uint8]) -> Side:
        return Side(self.side, self.bend_mm, figures(counts, self.waypoint, self.size))


def _each(groups: Index) -> Index:
    """(n,) each move by itself. Where nothing is inserted, one array does for both."""
    if all(np.array_equal(groups[some], np.arange(some.start, some.stop)) for some in spans(len(groups))):
        return groups
    each = apart((len(groups),), np.int64)
    for some in spans(len(each)):
        each[some] = np.arange(some.start, some.stop)
    return each


def corrections_mm(nominal: Program, corrected: Program, proof: Proof) -> Array:
    """(n, 3) how far each waypoint was moved, 0 where that is not known; of canned cycles the position and
    the bottom of each hole, as a corrected depth may need other pecks."""
    correction = _moved(proof, 0, len(proof.nominal))
    mine, moved = nominal.holes, _holes_moved(nominal, corrected)
    some = slice(len(moved))
    correction[mine.last[some, None] - 1, _AXES[mine.plane[some]]] = moved
    return correction


def largest_correction_mm(nominal: Program, corrected: Program, proof: Proof) -> float:
    """The largest distance of the commands from the nominal path."""
    count = len(proof.nominal)
    parts = (_longest(_moved(proof, some.start, some.stop)) for some in spans(count, _BLOCK))
    return max(_longest(_holes_moved(nominal, corrected)), max(parts, default=0.0))


def _longest(vectors: Array) -> float:
    return float(np.sqrt(np.einsum("ij,ij->i", vectors, vectors).max(initial=0.0)))


def _moved(proof: Proof, a: int, b: int) -> Array:
    """(b - a, 3) how far the waypoints of nominal moves a..b were moved, 0 of canned cycles."""
    correction = np.nan_to_num(
        proof.written.end_mm.take(proof.groups[a:b], axis=0) - proof.nominal.end_mm[a:b]
    )
    correction[(proof.nominal.flag[a:b] & np.uint8(Flag.CYCLE | Flag.CONTROL)) != 0] = 0.0
    return np.asarray(correction)


def _holes_moved(nominal: Program, corrected: Program) -> Array:
    """(h, 3) how far the position and the bottom of each hole were moved, along the axes of its plane."""
    mine, other = nominal.holes, corrected.holes
    some = slice(min(len(mine), len(other)))
    moved = other.place_mm[some] - mine.place_mm[some], (other.z_mm[some] - mine.z_mm[some])[:, None]
    return np.asarray(np.hstack(moved))


def _how(path: Toolpath, points: bool) -> npt.NDArray[np.uint8]:
    """(n,) how each nominal move would count if it were corrected. With `points` rapids count at their
    ends."""
    cutting = cutting_moves(path)
    how = np.full(len(path), Counts.RAPID, np.uint8)
    how[cutting] = Counts.FEED
    how[~cutting & (points | (path.kind != Kind.RAPID))] = Counts.POINT
    cycle = (path.flag & np.uint8(Flag.CYCLE)) != 0
    how[cycle] = np.where(path.kind[cycle] == Kind.RAPID, Counts.RAPID, Counts.HOLE)
    unknown = np.isnan(path.end_mm)
    how[all_in_row(unknown) & (how <= Counts.HOLE)] = Counts.UNKNOWN
    how[any_in_row(unknown) & (how == Counts.HOLE)] = Counts.UNKNOWN
    return how


def _counts(path: Toolpath, how: npt.NDArray[np.uint8], exempt: Mask) -> npt.NDArray[np.uint8]:
    """(n,) how each nominal move counts, `how` (n,) if it were corrected."""
    away = ((path.flag & _AWAY) != 0) | exempt
    own = (path.flag & np.uint8(Flag.CONTROL)) != 0
    left = (how <= Counts.HOLE) & (path.kind != Kind.RAPID) & ~own
    counts = how.copy()
    counts[away & left] = Counts.LEFT
    counts[away & ~left] = Counts.UNCORRECTED
    return counts


def _refuse_blind(path: Toolpath, blind: Index) -> None:
    if blind.size:
        raise ProgramError(
            "the deviation of this move cannot be computed: where the corrected program commands it, the "
            "error is not known; correct the nominal program again, or give start_mm in the job file",
            line=int(path.line[blind[0]]),
            code="OLP561",
        )


def _sizes(deviation: Deviation, how: npt.NDArray[np.uint8], bottom: Index, stroke: Single) -> Single:
    """(n,) mm: along the path of feed moves, at the end of points, of a hole at the move to its bottom. They
    take the place of `deviation.path`."""
    size = deviation.path
    feeds = (Counts.FEED,) if len(bottom) else (Counts.FEED, Counts.HOLE)
    for rows in spans(len(how), _BLOCK):
        kind, end, part = how[rows], deviation.waypoint[rows], size[rows]
        # holes without a partner are compared stroke by stroke
        along = is_in(kind, feeds)
        np.fmax(end, part, out=part, where=along)
        part[~along] = np.nan
        np.copyto(part, end, where=kind == Counts.POINT)
        part += deviation.side[rows]
    hole = bottom[how[bottom] == Counts.HOLE]
    size[hole] = stroke[how[bottom] == Counts.HOLE] + deviation.side[hole]
    return size
