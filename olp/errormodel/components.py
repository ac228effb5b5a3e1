"""The six component errors of one axis by position: curves, direction, cyclic terms, backlash."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, distinct
from olp.core.interpolation import ON_GRID_MM, Column, DenseTable, Interpolant, dense_table
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.chord import Variation
from olp.errormodel.lever_arms import CROSS, DIRECTIONS, LeverArms
from olp.errormodel.sources.cyclic import Cyclic, cyclic_value

#: mm; the largest error of resampling a curve of translations, a ten-thousandth of a micrometre.
TABLE_MM = 1e-7
#: rad; the same for angles: as much at a lever arm of 1 m.
TABLE_RAD = 1e-10

#: A row X, Y or Z and how far a cyclic angle moves the tip along it beside its axis' lever arms: by the angle
#: times (a + b q), a in mm.
Moved = tuple[int, float, float]

Six = tuple[Column | None, Column | None, Column | None, Column | None, Column | None, Column | None]


@dataclass(frozen=True, slots=True)
class ActingTerm:
    """A cyclic term, and what it moves beside the lever arms of its axis because it was measured
    elsewhere."""

    term: Cyclic
    moved: tuple[Moved, ...] = ()

    @classmethod
    def of(cls, term: Cyclic, own: LeverArms, shared: LeverArms) -> ActingTerm:
        """`own` are the lever arms on which the term acts, `shared` those of all angles of its axis."""
        a, j = DIRECTIONS.index(term.component[1]) - 3, AXES.index(term.component[2])
        arms, others = ({i: arm for rows, arm in arms for i in rows} for arms in (own, shared))
        moved = []
        for i, angle, k, sign in CROSS:
            if angle == a and arms[i] != others[i]:
                slope = float(arms[i].moves[k]) - float(others[i].moves[k]) if k == j else 0.0
                moved.append((i, sign * (others[i].offset_mm[k] - arms[i].offset_mm[k]), sign * slope))
        return cls(term, tuple(moved))

    def six(self, q: Array) -> list[Column | None]:
        """Component errors at positions q (n,)."""
        values: list[Column | None] = [None] * 6
        value = cyclic_value(self.term, q)
        values[DIRECTIONS.index(self.term.component[1])] = value
        for i, constant, slope in self.moved:
            values[i] = value * (constant + slope * q)
        return values

    def variations(self, low_mm: float, high_mm: float) -> Iterator[tuple[int, Variation]]:
        """Bounds of each component that it changes, for positions in a range."""
        yield DIRECTIONS.index(self.term.component[1]), Variation.of_cyclic(self.term)
        for i, constant, slope in self.moved:
            most = max(abs(constant + slope * low_mm), abs(constant + slope * high_mm))
            yield i, Variation.of_cyclic(self.term, most, slope)


@dataclass(frozen=True, slots=True, eq=False)
class AxisComponents:
    """Component errors of axis `axis` in the order X, Y, Z, A, B, C; mm and rad; None stands for
    zero everywhere.

    `mean` and `half` give the column of `table`; a component at play s is mean + s * half.
    """

    axis: int
    table: DenseTable
    mean: tuple[int | None, ...]
    half: tuple[int | None, ...]
    cyclic: tuple[ActingTerm, ...]
    backlash_mm: float
    variation: tuple[Variation | None, ...]
    varies: tuple[bool, ...]

    @classmethod
    def of(
        cls, calibration: Calibration, axis: str, skip: frozenset[str], cyclic: tuple[ActingTerm, ...]
    ) -> AxisComponents:
        j = AXES.index(axis)
        columns = AxisColumns(calibration, axis, skip)
        mean, half = columns.slots("mean"), columns.slots("half")
        table = columns.table()
        bounds = columns.variations(table)
        low, high = (float(face) for face in calibration.box_mm[j])
        waves = [wave for acting in cyclic for wave in acting.variations(low, high)]
        variation, varies = [], []
        for d in range(len(DIRECTIONS)):
            parts = [bounds[slot] for slot in (mean[d], half[d]) if slot is not None]
            repeating = [wave for i, wave in waves if i == d]
            varies.append(bool(repeating) or any(p.varies for p in parts))
            variation.append(Variation.total([*parts, *repeating]) if parts or repeating else None)
        return cls(j, table, mean, half, cyclic, calibration.backlash_mm[j], tuple(variation), tuple(varies))

    def with_sines(self, exact_rad: float) -> AxisComponents | None:
        """The same with the sines of the angles in the table, which are exact to `exact_rad` between nodes,
        too. None where they are not, and where angles are more than columns of the table."""
        if self.cyclic or any(slot is not None for slot in self.half[3:]):
            return None
        values, table = self.table.at_nodes(), self.table
        angles = values[:, [slot for slot in self.mean[3:] if slot is not None]]
        sines, between = np.sin(angles), np.sin(0.5 * (angles[:-1] + angles[1:]))
        if np.abs(between - 0.5 * (sines[:-1] + sines[1:])).max(initial=0.0) > exact_rad:
            return None
        values[:, [slot for slot in self.mean[3:] if slot is not None]] = sines
        return replace(self, table=DenseTable.of(table.low, table.step, table.nodes, values, table.guide))

    def evaluate(self, q: Array, play: Array | None) -> Six:
        """Values at finite positions q (n,) and play (n,) in [-1, 1]."""
        columns = self.table.lookup(q)
        mean, half = self._of_table(columns)
        values = list(mean)
        if play is not None:
            for d, difference in enumerate(half):
                if difference is not None:
                    values[d] = _plus(values[d], play * difference)
            if self.backlash_mm != 0.0:
                values[self.axis] = _plus(values[self.axis], play * (-0.5 * self.backlash_mm))
        for acting in self.cyclic:
            for d, value in enumerate(acting.six(q)):
                if value is not None:
                    values[d] = _plus(values[d], value)
        return _six(values)

    def sources(self, q: Array, play: Array | None) -> list[tuple[str, Six]]:
        """(name, components) by source; their sum is `evaluate`."""
        mean, half = self._of_table(self.table.lookup(q))
        axis = AXES[self.axis]
        contributions = [
            (f"E{DIRECTIONS[d]}{axis}", _only(d, value)) for d, value in enumerate(mean) if value is not None
        ]
        contributions += [(f"cyclic {acting.term.component}", _six(acting.six(q))) for acting in self.cyclic]
        if play is not None:
            directional: list[Column | None] = [None if value is None else play * value for value in half]
            if self.backlash_mm != 0.0:
                directional[self.axis] = _plus(directional[self.axis], play * (-0.5 * self.backlash_mm))
            if any(value is not None for value in directional):
                contributions.append((f"backlash {axis}", _six(directional)))
        return contributions

    def backlash_at(self, q: Array) -> Column | None:
        """Backlash in mm at q (n,): backward minus forward; None where the axis has none."""
        if self.backlash_mm != 0.0:
            return self.backlash_mm
        slot = self.half[self.axis]
        return None if slot is None else -2.0 * self.table.lookup(q)[slot]

    def _of_table(self, columns: list[Column]) -> tuple[list[Column | None], list[Column | None]]:
        return (
            [None if slot is None else columns[slot] for slot in self.mean],
            [None if slot is None else columns[slot] for slot in self.half],
        )


class AxisColumns:
    """Gathers the columns of all curves of one axis, to be resampled onto one grid. Column i is column
    `of_column[i][1]` of `interpolants[of_column[i][0]]`."""

    def __init__(self, calibration: Calibration, axis: str, skip: frozenset[str]) -> None:
        self._axis = axis
        self._keys: list[tuple[str, str]] = []
        self.interpolants: list[Interpolant] = []
        self.of_column: list[tuple[int, int]] = []
        for curve in calibration.curves_of(axis):
            kept: list[Array] = []
            for name in curve.names:
                if name in skip:
                    continue
                for key, values in (("mean", curve.mean(name)), ("half", curve.half_difference(name))):
                    if values is not None and np.any(values != 0.0):
                        self._keys.append((key, name))
                        self.of_column.append((len(self.interpolants), len(kept)))
                        kept.append(values)
            if kept:
                y = np.stack(kept, axis=1)
                self.interpolants.append(Interpolant.through(curve.position_mm, y, curve.interpolation))

    def slots(self, key: str) -> tuple[int | None, ...]:
        names = [(key, f"E{d}{self._axis}") for d in DIRECTIONS]
        return tuple(self._keys.index(name) if name in self._keys else None for name in names)

    def knots(self) -> Array:
        """Where the columns are resampled in any case: positions that all curves of the axis cover."""
        low = max(float(f.x[0]) for f in self.interpolants)
        high = min(float(f.x[-1]) for f in self.interpolants)
        knots = distinct(np.concatenate([f.x for f in self.interpolants]))
        knots = knots[(knots >= low) & (knots <= high)]
        # Files of one axis may differ by rounding; two knots that close are one.
        apart = np.concatenate([[True], np.diff(knots) > ON_GRID_MM])
        return np.asarray(knots[apart], float)

    def table(self) -> DenseTable:
        if not self.interpolants:
            return DenseTable.empty()
        curvature = np.concatenate([f.max_curvature() for f in self.interpolants])
        tolerance = [TABLE_RAD if name[1] in "ABC" else TABLE_MM for _, name in self._keys]

        def evaluate(q: Array) -> Array:
            return np.concatenate([f(q) for f in self.interpolants], axis=1)

        return dense_table(self.knots(), evaluate, curvature.tolist(), tolerance)

    def variations(self, table: DenseTable) -> list[Variation]:
        """Bounds of each column."""
        return [each for f in self.interpolants for each in Variation.of_curve(f, table.step)]


def _plus(a: Column | None, b: Column) -> Column:
    return b if a is None else a + b


def _six(values: list[Column | None]) -> Six:
    x, y, z, a, b, c = values
    return x, y, z, a, b, c


def _only(d: int, value: Column) -> Six:
    values: list[Column | None] = [None] * 6
    values[d] = value
    return _six(values)
