"""Numbers of a calibration with their uncertainty, and how they act on the tip. Terms: JCGM 100 (GUM)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.interpolation import Column
from olp.core.values import dataclass

Index = npt.NDArray[np.int32]
#: The number and the weight of one unknown at each of n positions.
Slot = tuple[Index, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """Numbers of one kind: of component `name` at `position_mm` (n,) for "mean" and "half"; (sine, cosine) of
    `period_mm` for "wave"; one number of a squareness, or of the backlash of an axis.

    `factor` (n, rank) and `rest` (n,), a standard uncertainty, in mm or rad. The caller that gathers entries
    checks them (`Numbers.fits`).
    """

    kind: str
    name: str
    factor: Array
    rest: Array
    position_mm: Array = field(default_factory=lambda: np.zeros(0))
    period_mm: float = 0.0

    @property
    def sigma(self) -> Array:
        """(n,) standard uncertainties, mm or rad."""
        return np.asarray(np.sqrt((np.asarray(self.factor, float) ** 2).sum(axis=1) + self.rest**2))

    def scaled(self, by: float) -> Entry:
        return replace(self, factor=self.factor * by, rest=self.rest * by)


@dataclass(frozen=True, slots=True, eq=False)
class AxisState:
    """Positions of one axis: (n,) `q` in mm and the play there, the axis's number, its datum in mm, and the
    lever arms of its angles, (rows, coordinates)."""

    axis: int
    q: Array
    play: Array | None
    datum_mm: float
    lever_arms: list[tuple[tuple[int, ...], list[Column]]]


class Numbers:
    """One kind of numbers, which a source registers: names that it may have, and how they act. The default is
    one number of weight 1 everywhere."""

    kind: str
    names: tuple[str, ...]

    def count(self, entry: Entry) -> int:
        """How many numbers the entry has, 0 where its positions or its period are wrong."""
        return 1

    def fits(self, entry: Entry) -> bool:
        """Whether it is an entry of this kind, with finite numbers."""
        count = self.count(entry)
        good = entry.name in self.names and entry.factor.ndim == 2 and count > 0
        good = good and entry.factor.shape[0] == count and entry.rest.shape == (count,)
        good = good and bool(np.isfinite(entry.factor).all() and np.isfinite(entry.rest).all())
        return good and bool((entry.rest >= 0.0).all())

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        """Rows of the error that a number acts on, and with what coefficient."""
        raise NotImplementedError

    def weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        """The numbers that make its value at q (n,)."""
        yield np.zeros(len(q), np.int32), np.ones(len(q))

    def parts(self, entry: Entry) -> int:
        """How many independent unknowns `rest` stands for."""
        return len(entry.rest)

    def part_weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        """Those unknowns; the squares of the weights add up to their variance at q (n,)."""
        yield np.zeros(len(q), np.int32), np.full(len(q), entry.rest[0])


def component_acts(name: str, side: Column, state: AxisState) -> Iterator[tuple[int, Column]]:
    """What a component error does to the tip, `side` times."""
    d = "XYZABC".index(name[1])
    if d < 3:
        yield d, side
        return
    # eps x lever arm: an angle about a moves row a - 1 by its arm along a + 1, and row a + 1 by minus its arm
    # along a - 1
    after, before = (d - 2) % 3, (d - 1) % 3
    for rows, arm in state.lever_arms:
        if before in rows:
            yield before, side * arm[after]
        if after in rows:
            yield after, -(side * arm[before])


def alone(kind: str, name: str, sigma: Array | float, position_mm: Array | None = None) -> Entry:
    """Numbers whose standard uncertainty alone is known, (n,) or one, in mm or rad."""
    rest = np.atleast_1d(np.asarray(sigma, float))
    positions = np.zeros(0) if position_mm is None else position_mm
    return Entry(kind, name, np.zeros((len(rest), 0)), rest, positions)
