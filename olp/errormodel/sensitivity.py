"""How uncertain numbers of the calibration act on the tip: linearly, at any axis position.

The same first-order law as `olp.errormodel.bodies`. Against the exact matrices it is off by some thousandths
of an uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.interpolation import Column
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.bodies import Body, build_bodies
from olp.errormodel.boxed import as_points
from olp.errormodel.calibration import Calibration, Thermal
from olp.errormodel.entry import AxisState, Entry, Slot
from olp.errormodel.sources.expansion import REFERENCE_DEGC
from olp.errormodel.sources.registry import NUMBERS
from olp.errormodel.uncertainty import EXPANSION_PER_K, Uncertainty

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: Half the memory, and far more digits than an uncertainty has.
Rows = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Expansion:
    """Standard uncertainties of expansion: of each scale by axis position and of the workpiece by place of
    the part, per mm from where it is held. `unmodelled_K` is the largest temperature difference that the job
    states and for which the calibration has no expansion coefficient."""

    scale: Vector
    fixed_at_mm: Vector
    workpiece: float
    clamped_at_mm: Vector
    unmodelled_K: float = 0.0

    @classmethod
    def of(
        cls, calibration: Calibration, uncertainty: Uncertainty, temperatures_degC: dict[str, float]
    ) -> Expansion:
        """From the uncertainty of temperatures, and in full from stated differences for which the
        calibration has no coefficient."""
        thermal = calibration.thermal or Thermal()
        rest, unmodelled = uncertainty.temperature_K, 0.0

        def slope(name: str, known: float, reference: float) -> float:
            nonlocal unmodelled
            difference = 0.0
            if known == 0.0 and name in temperatures_degC:
                difference = abs(temperatures_degC[name] - reference)
                unmodelled = max(unmodelled, difference)
            return float(np.hypot((known or EXPANSION_PER_K) * rest, EXPANSION_PER_K * difference))

        calibrated_degC = calibration.temperature_degC
        scales = zip(AXES, thermal.scale_per_K, strict=True)
        x, y, z = (slope(f"{a}_scale", per_K, calibrated_degC) for a, per_K in scales)
        workpiece = slope("workpiece", thermal.workpiece_per_K, REFERENCE_DEGC)
        return cls((x, y, z), thermal.fixed_at_mm, workpiece, thermal.clamped_at_mm, unmodelled)


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Dependence of the tip's error on unknowns: the numbers of the calibration, whose covariance is
    table @ table.T, one more for each independent part beside them, and four of expansion.

    `first` and `spare` are the first unknown of each entry, and of its independent parts (-1: none). `table`
    (unknowns, columns) makes all of them from independent ones of variance 1.
    """

    bodies: tuple[Body, ...]
    entries: tuple[Entry, ...]
    first: tuple[int, ...]
    spare: tuple[int, ...]
    expansion: Expansion | None
    table: Rows
    tool_terms: bool

    @classmethod
    def of(
        cls,
        calibration: Calibration,
        chain: str,
        uncertainty: Uncertainty,
        *,
        skip: frozenset[str] = frozenset(),
        expansion: Expansion | None = None,
    ) -> Sensitivity:
        """`skip` are components that the control corrects. Raises ConfigError for an unknown chain."""
        tool_terms = calibration.model != "huddersfield"
        bodies = build_bodies(calibration, chain, skip, tool_terms=tool_terms)
        entries = tuple(e for e in uncertainty.entries if e.name not in skip)
        first = np.cumsum([0, *(len(e.rest) for e in entries)]).tolist()
        count, spare = first[-1], []
        for entry in entries:
            parts = 0
            if entry.rest.any():
                parts = NUMBERS[entry.kind].parts(entry)
            spare.append(count if parts else -1)
            count += parts
        count += 4 if expansion is not None else 0
        rank, own = uncertainty.rank, count - first[-1]
        table = np.zeros((count, rank + own), np.float32)
        if first[-1]:
            table[: first[-1], :rank] = np.concatenate([e.factor for e in entries])
        table[first[-1] :, rank:] = np.eye(own, dtype=np.float32)
        return cls(bodies, entries, tuple(first[:-1]), tuple(spare), expansion, table, tool_terms)

    @property
    def columns(self) -> int:
        return int(self.table.shape[1])

    def rows(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Rows:
        """(3, n, columns): the error in mm is that times independent unknowns of variance 1."""
        return np.stack([weights @ self.table for weights in self.weights(axis_mm, tool_mm, play)])

    def weights(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> list[csr_array]:
        """Three matrices (n, unknowns), of X, Y and Z, at known axis positions (n, 3) in mm with tool vectors
        (3,) or (n, 3)."""
        from scipy.sparse import csr_array

        points = as_points(axis_mm)
        n, unknowns = len(points), len(self.table)
        slots: tuple[list[Slot], list[Slot], list[Slot]] = ([], [], [])
        position, tool = self._columns(points, tool_mm)
        for entry, first, spare, q, acts in self._acting(position, tool, play):
            own = list(_own(entry, first, spare, q))
            for row, coefficient in acts:
                slots[row].extend((number, weight * coefficient) for number, weight in own)
        if self.expansion is not None:
            for j, taken in enumerate(slots):
                tip = position[j] + tool_mm[..., j]
                taken.extend(_expansion(self.expansion, j, unknowns - 4, position[j], tip))
        matrices = []
        for taken in slots:
            width = len(taken)
            number, weight = np.zeros((n, width), np.int32), np.zeros((n, width), np.float32)
            for k, (one, value) in enumerate(taken):
                number[:, k], weight[:, k] = one, value
            ends = np.arange(0, n * width + 1, width) if width else np.zeros(n + 1, np.int32)
            matrices.append(csr_array((weight.ravel(), number.ravel(), ends), shape=(n, unknowns)))
        return matrices

    def covariance(
        self, axis_mm: Array, tool_mm: Array, play: Array | None, held: Rows, frame: npt.NDArray[np.integer]
    ) -> tuple[Array, Array]:
        """(n, 3, 3) covariance in mm^2 of the error less that of the touch-off of its frame, at positions
        as in `weights`; and (n,) the variance that comes from expansion. `held` (frames, 3, columns) are the
        rows of the touch-offs, `frame` (n,) leads to them.

        Independent unknowns act one by one, so that only those which the numbers share need rows.
        """
        points = as_points(axis_mm)
        position, tool = self._columns(points, tool_mm)
        touched = bool(held.any())
        covariance = self._of_parts(position, tool, play, held[frame] if touched else None)
        if self.rank:
            shared = np.ascontiguousarray(self.table[:, : self.rank])
            rows = np.stack([weights @ shared for weights in self.weights(axis_mm, tool_mm, play)])
            if touched:
                rows -= held[frame, :, : self.rank].transpose(1, 0, 2)
            _add_products(covariance, rows)
        grown = np.zeros(len(points))
        if self.expansion is not None:
            rows = np.zeros((3, len(points), 4), np.float32)
            for j in range(3):
                for k, weight in _expansion(self.expansion, j, 0, position[j], position[j] + tool_mm[..., j]):
                    rows[j, :, k[0]] = weight
            rows -= held[frame, :, -4:].transpose(1, 0, 2)
            _add_products(covariance, rows)
            grown = (rows**2).sum(axis=(0, 2))
        for i, j in ((0, 1), (0, 2), (1, 2)):
            covariance[j, i] = covariance[i, j]
        return covariance.transpose(2, 0, 1), grown

    def _of_parts(
        self, position: list[Array], tool: list[Column], play: Array | None, held: Rows | None
    ) -> Array:
        """The upper half of (3, 3, n), the covariance that comes from the independent parts of entries, less
        those `held` (n, 3, columns) of touch-offs."""
        covariance = np.zeros((3, 3, len(position[0])))
        point, behind = np.arange(len(position[0])), self.columns - len(self.table)
        for entry, _, spare, q, acts in self._acting(position, tool, play):
            if spare < 0:
                continue
            own = list(NUMBERS[entry.kind].part_weights(entry, q))
            merged = _merged(acts)
            variance = sum(weight * weight for _, weight in own)
            for i, one in merged:
                part = variance * one
                for j, other in merged:
                    if i <= j:
                        covariance[i, j] += part * other
            if held is None:
                continue
            for j in range(3):
                both = sum(weight * held[point, j, spare + behind + number] for number, weight in own)
                for i, one in merged:
                    covariance[min(i, j), max(i, j)] -= (2.0 if i == j else 1.0) * (one * both)
        if held is not None:
            end = self.columns - (4 if self.expansion is not None else 0)
            _add_products(covariance, held[:, :, self.rank : end].transpose(1, 0, 2).astype(float))
        return covariance

    @property
    def rank(self) -> int:
        """Columns of the unknowns that the numbers share, the first ones."""
        return int(self.entries[0].factor.shape[1]) if self.entries else 0

    def _columns(self, points: Array, tool_mm: Array) -> tuple[list[Array], list[Column]]:
        """Positions and tool vectors by axis."""
        tool: list[Column] = [0.0, 0.0, 0.0]
        if self.tool_terms:
            tool = [tool_mm[..., k] for k in range(3)]
        return [np.ascontiguousarray(points[:, k]) for k in range(3)], tool

    def _acting(
        self, position: list[Array], tool: list[Column], play: Array | None
    ) -> Iterator[tuple[Entry, int, int, Array, list[tuple[int, Column]]]]:
        """Each entry with its first unknowns, the positions (n,) of its axis, and the rows of the error that
        it acts on, with what coefficient."""
        for body in self.bodies:
            lever_arms = [(rows, lever_arm.at(position, tool)) for rows, lever_arm in body.lever_arms]
            q = position[body.axis]
            axis_play = None if play is None else play[:, body.axis]
            state = AxisState(body.axis, q, axis_play, body.datum_mm, lever_arms)
            for entry, first, spare in zip(self.entries, self.first, self.spare, strict=True):
                if AXES.index(entry.name[-1]) != body.axis:
                    continue
                acts = list(NUMBERS[entry.kind].acts(entry, state))
                if acts:
                    yield entry, first, spare, q, acts


def _merged(acts: list[tuple[int, Column]]) -> list[tuple[int, Column]]:
    """Each row once, with the sum of its coefficients."""
    sums: dict[int, Column] = {}
    for row, coefficient in acts:
        sums[row] = sums[row] + coefficient if row in sums else coefficient
    return list(sums.items())


def _add_products(covariance: Array, rows: Rows | Array) -> None:
    """Add to the upper half of a covariance (3, 3, n) that of rows (3, n, columns)."""
    for i in range(3):
        for j in range(i, 3):
            covariance[i, j] += np.einsum("nk,nk->n", rows[i], rows[j])


def value_rows(entry: Entry, q: Array) -> Array:
    """(n, columns) dependence of the value of an entry at q (n,) on independent unknowns of variance 1: those
    of the factor, and then its own."""
    numbers, rank, n = NUMBERS[entry.kind], entry.factor.shape[1], len(q)
    rows = np.zeros((n, rank + numbers.parts(entry)))
    if entry.factor.size:
        for number, weight in numbers.weights(entry, q):
            rows[:, :rank] += weight[:, None] * entry.factor[number]
    for number, weight in numbers.part_weights(entry, q):
        rows[np.arange(n), rank + number] += weight
    return rows


def _expansion(expansion: Expansion, j: int, first: int, q: Array, tip: Array) -> Iterator[Slot]:
    """Of axis j, at its positions q (n,) and with the tip at `tip` (n,), both in mm."""
    n = len(q)
    yield np.full(n, first + j, np.int32), expansion.scale[j] * (q - expansion.fixed_at_mm[j])
    yield np.full(n, first + 3, np.int32), -expansion.workpiece * (tip - expansion.clamped_at_mm[j])


def _own(entry: Entry, first: int, spare: int, q: Array) -> Iterator[Slot]:
    """The unknowns that make the value of an entry at q (n,): numbers of the factor, and independent
    parts."""
    numbers = NUMBERS[entry.kind]
    if entry.factor.size:
        yield from ((first + number, weight) for number, weight in numbers.weights(entry, q))
    if spare >= 0:
        yield from ((spare + number, weight) for number, weight in numbers.part_weights(entry, q))
