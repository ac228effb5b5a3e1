"""The character of curves with lines, by what readings beside these lines say of it.

Few targets exclude few kinds of smooth parts, steps and ripple (`character`). Readings all over the volume
see the same curves between them. They tell levels of the three, which all curves of the machine share
up to how they differ. So each curve gets a mixture of what it is to be expected at each level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from olp.calibration.estimator.character import ALIKE, class_of, expected
from olp.calibration.estimator.smoothing import Hides, Shape
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Axis of kinds of smooth parts in a table of probabilities.
KIND = 0
#: Axis of steps.
STEPS = 2
#: Axis of ripple.
RIPPLE = 3
#: Candidates this near stand for a level between two, however alike curves are.
_BETWEEN = 0.5
#: The same where a level is a candidate, and curves do not differ.
_EXACT = 1e-3
#: Levels of one axis (n,) by class, in candidates, which may lie between two.
Levels = Mapping[str, Array]


def level_of(grid: Array, size: float) -> float:
    """Where a size lies among candidates, the first of which is zero."""
    if size < grid[1]:
        return float(size / grid[1])
    return float(1.0 + np.interp(np.log(size), np.log(grid[1:]), np.arange(len(grid) - 1)))


@dataclass(slots=True)
class Lined:
    """Curves with lines: `first` are their shapes by these alone. `heard` holds levels of an axis and their
    probabilities (n,)."""

    first: Mapping[str, Shape]
    hides: Hides
    heard: dict[int, tuple[Levels, Array]] = field(default_factory=dict)

    def hear(self, axis: int, levels: Levels, share: Array) -> None:
        """Levels of an axis have these probabilities, instead of those heard before."""
        self.heard[axis] = levels, share

    def shapes(self) -> Mapping[str, Shape]:
        """Shapes by all that was heard."""
        return self._by(self.heard) if self.heard else self.first

    def at(self, axis: int, levels: Levels, k: int) -> Mapping[str, Shape]:
        """The same if all curves had the k-th level of an axis, whatever was heard of it before."""
        only = np.zeros(len(next(iter(levels.values()))))
        only[k] = 1.0
        return self._by({**self.heard, axis: (levels, only)})

    def _by(self, heard: Mapping[int, tuple[Levels, Array]]) -> dict[str, Shape]:
        shapes = {}
        for name, shape in self.first.items():
            kind, table = class_of(name), shape.table
            for axis, (levels, share) in heard.items():
                mixed = np.zeros_like(table)
                for k in np.flatnonzero(share).tolist():
                    mixed += share[k] * _at(table, axis, float(levels[kind][k]))
                table = mixed
            scales = expected(table, kind)
            shapes[name] = replace(shape, scales=scales, hidden=self.hides(name, scales))
        return shapes


def _at(table: Array, axis: int, level: float) -> Array:
    """Probabilities of a curve, if the curves of its machine had such a level of one axis."""
    apart = np.arange(table.shape[axis]) - level
    differ = max(ALIKE[axis], _BETWEEN if level % 1.0 else _EXACT)
    near = -0.5 * (apart / differ) ** 2
    weight = np.moveaxis(table, axis, -1) * np.exp(near - near.max())
    total = weight.sum()
    if total <= 0.0:
        # lines exclude it, and know better
        return table
    return np.asarray(np.moveaxis(weight / total, -1, axis))
