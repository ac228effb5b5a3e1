"""How far a function on a grid can depart from its chord along a straight move: rigorous upper bounds.

Along a move by d the second derivative is sum_jk d_j d_k f_jk inside the cells, and the slope jumps by d_j
times that of f_j where a face of a cell is crossed. The departure is the integral of a tent kernel against
both (see `chord`): at most 1/8 of the first and 1/4 of the jumps. A function that changes by no more than L
over the move departs by no more than L/2, and never by more than its whole span. All of them grow with each
|d_j|, so that a bound holds for shorter moves too.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from olp.core.arrays import Array
from olp.core.grid_interpolation import Grid
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.chord import UPPER_MM, bins, distinct_bins, in_all_bins


@dataclass(frozen=True, slots=True, eq=False)
class GridBound:
    """Bounds for the m columns of a grid whose argument k is axis `axes[k]`.

    `second` holds (k, l, (m,) max |f_kl|), each pair once, and `slope` (d, m) max |f_k|. `kinks` are per
    argument None or (bins, m), a quarter of the jumps that a move of a bin's length can cross. `span` is
    (m,).
    """

    axes: tuple[int, ...]
    second: tuple[tuple[int, int, Array], ...]
    slope: Array
    kinks: tuple[Array | None, ...]
    span: Array

    @classmethod
    def of(cls, grid: Grid, arguments: tuple[str, ...]) -> GridBound:
        count = len(arguments)
        second = []
        for k, other in combinations_with_replacement(range(count), 2):
            order = [0] * count
            order[k] += 1
            order[other] += 1
            bound = grid.largest(order)
            if np.any(bound):
                second.append((k, other, bound if k == other else 2.0 * bound))
        slope = np.array([grid.largest([int(i == k) for i in range(count)]) for k in range(count)])
        kinks = tuple(_windows(grid.knots[k], grid.jumps(k)) for k in range(count))
        return cls(tuple(AXES.index(a) for a in arguments), tuple(second), slope, kinks, grid.span())

    def departure(self, delta_mm: Array) -> Array:
        """(n, m) bound of the departure from the chord for moves delta_mm (n, 3)."""
        length = [np.ascontiguousarray(np.abs(delta_mm[:, j])) for j in self.axes]
        bound = np.zeros((len(delta_mm), len(self.span)))
        for k, other, most in self.second:
            bound += (0.125 * length[k] * length[other])[:, None] * most
        for d, kinks in zip(length, self.kinks, strict=True):
            if kinks is not None:
                bound += d[:, None] * kinks.take(bins(d), axis=0, mode="clip")
        steep = 0.5 * (np.abs(delta_mm[:, self.axes]) @ self.slope)
        return np.minimum(bound, np.minimum(steep, self.span))

    def change(self, delta_mm: Array) -> Array:
        """(n, m) bound of the change from start to end."""
        return np.minimum(np.abs(delta_mm[:, self.axes]) @ self.slope, self.span)


def _windows(knots: Array, jumps: Array) -> Array | None:
    """(bins, m) a quarter of the largest sum of jumps at inner knots that a window of a bin's upper length
    can hold; None where there are none."""
    if not np.any(jumps):
        return None
    inner = knots[1:-1]
    total = np.concatenate([np.zeros((1, jumps.shape[1])), np.cumsum(jumps, axis=0)])
    some = distinct_bins(inner)
    last = np.searchsorted(inner, inner[:, None] + UPPER_MM[some], side="right")
    return in_all_bins(0.25 * (total[last] - total[:-1, None]).max(axis=0), some)
