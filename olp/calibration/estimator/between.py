"""What a curve may do between its targets within the cells of its spline, which cannot hold it.

The same processes on a spline of many more cells, known at the same targets, leave more open between them.
The difference of both variances is what the cells hide.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from olp.calibration.estimator.basis import STRAIGHT, Scales, Spline, slope_grid, slope_weights
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line, targets_of
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Cells between two targets that resolve what happens there.
_RESOLVED = 6
#: Cells of the fine spline, at least and at most.
_FINE = 72, 240
#: Positions between two targets where the variance is taken.
_POSITIONS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """The variance (n,) of a curve that its cells hide, at positions (n,) in mm; straight between them."""

    position_mm: Array
    variance: Array

    def at(self, q: Array) -> Array:
        """(n,) at q (n,)."""
        return np.asarray(np.interp(q, self.position_mm, self.variance))


def hidden(
    lines: Sequence[tuple[Line, Noise]], spline: Spline, scales: Scales, amplitude: float, datum_mm: float
) -> Hidden:
    """What the cells of `spline` hide of a curve of some scales that these lines read; `amplitude` is the
    standard deviation of the coefficients of a straight line. The curve is zero at the datum."""
    targets, variance = _read(lines)
    gaps = max(len(targets) - 1, 1)
    fine = Spline(spline.low_mm, spline.high_mm, int(np.clip(_RESOLVED * gaps, *_FINE)))
    inside = np.diff(targets)[:, None] * (np.arange(_POSITIONS) / _POSITIONS)
    ends = np.array([spline.low_mm, spline.high_mm])
    q = np.union1d((targets[:-1, None] + inside).ravel(), np.append(targets[-1:], ends))
    straight = lines[0][0].quantity == "straightness"
    values = [
        _left(one, scales, amplitude, q, targets, variance, datum_mm, straight) for one in (fine, spline)
    ]
    return Hidden(q, np.maximum(values[0] - values[1], 0.0))


def _read(lines: Sequence[tuple[Line, Noise]]) -> tuple[Array, Array]:
    """(n,) targets of all lines, ascending, and the variance of the mean of the readings at each."""
    targets = np.concatenate([targets_of(line) for line, _ in lines])
    variance = np.concatenate(
        [np.full(n := len(targets_of(line)), noise.sigma**2 * n / len(line.value)) for line, noise in lines]
    )
    order = np.argsort(targets, kind="stable")
    return targets[order], variance[order]


def _left(
    spline: Spline, scales: Scales, amplitude: float, q: Array, targets: Array, variance: Array,
    datum_mm: float, straight: bool,
) -> Array:  # fmt: skip
    """(n,) variance at q of a curve that is zero at the datum, and known at targets up to its level."""
    table, vectors = _spectrum(spline)
    own = scales.values**2 @ table
    own[:STRAIGHT] = amplitude**2
    root = vectors * np.sqrt(own)
    wanted = (spline.values(q) - spline.values(np.array([datum_mm]))) @ root
    if straight:
        slope = slope_weights(spline) @ spline.values(slope_grid(spline)) @ root
        wanted = wanted - (q - datum_mm)[:, None] * slope
    seen = spline.values(targets) @ root
    inner = seen @ seen.T + np.diag(variance)
    across = wanted @ seen.T
    explained = np.einsum("ij,ji->i", across, np.linalg.solve(inner, across.T))
    return np.asarray((wanted**2).sum(axis=1) - explained)


@cache
def _spectrum(spline: Spline) -> tuple[Array, Array]:
    return spline.spectrum()
