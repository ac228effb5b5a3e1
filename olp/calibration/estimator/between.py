"""What a curve may do between its targets within the cells of its spline, which cannot hold it.

The same processes on a spline of many more cells, known at the same targets, leave more open between them.
The difference of both variances is what the cells hide. Waves of a screw are shorter than any of these cells:
such ripple at targets is another one right beside them, and targets do not tell it. Other ripple is as wide
as cells, which hold it: dents, and values of a table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from olp.calibration.estimator.basis import RIPPLE, Scales, Spline, slope_grid, slope_weights
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line, targets_of
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Cells between two targets that resolve what happens there.
_RESOLVED = 6
#: Share of the variance of ripple that waves shorter than cells have.
SHORT = 0.75
#: Cells of the fine spline, at least and at most.
_FINE = 72, 240
#: Cells that resolve what is in one cell of a curve without lines.
_FINER = 8
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
    scales = replace(scales, ripple=math.sqrt(SHORT) * scales.ripple)
    read = _Read(targets, variance, datum_mm, straight)
    left, held = (_left(one, scales, amplitude, q, read, apart=one is fine) for one in (fine, spline))
    return Hidden(q, np.maximum(left - held, 0.0))


def beside_cells(spline: Spline, scales: Scales) -> Hidden:
    """What the cells of `spline` hide of a curve of some scales that no line reads: the same everywhere."""
    return Hidden(np.array([spline.low_mm]), np.array([_lost(spline.cells) @ scales.values**2]))


def ripple_at_targets(spline: Spline, scales: Scales) -> float:
    """The standard deviation of ripple at a target that is another one right beside it. Cells take it for
    their own, as lines alone do not tell it."""
    values = spline.values(np.linspace(spline.low_mm, spline.high_mm, _FINE[0]))
    return math.sqrt(SHORT * float((values**2).sum(axis=1).mean())) * scales.ripple


def in_cells(scales: Scales) -> Scales:
    """The scales of such a curve less what is shorter than any cell."""
    return replace(scales, ripple=math.sqrt(1.0 - SHORT) * scales.ripple)


@cache
def _lost(cells: int) -> Array:
    """(7,) mean variance over the axis that so many cells do not hold of a process of size 1."""
    fine = Spline(0.0, 1.0, _FINER * cells)
    q = np.linspace(0.0, 1.0, 2 * fine.cells + 1)
    coarse, values = np.linalg.qr(Spline(0.0, 1.0, cells).values(q))[0], fine.values(q)
    rest = values - coarse @ (coarse.T @ values)
    lost = np.einsum("ij,kjl,il->k", rest, fine.processes(), rest, optimize=True) / len(q)
    lost[RIPPLE] = (
        SHORT * np.einsum("ij,jl,il->", values, fine.processes()[RIPPLE], values, optimize=True) / len(q)
    )
    return np.asarray(lost)


def _read(lines: Sequence[tuple[Line, Noise]]) -> tuple[Array, Array]:
    """(n,) targets of all lines, ascending, and the variance of the mean of the readings at each."""
    targets = np.concatenate([targets_of(line) for line, _ in lines])
    variance = np.concatenate(
        [np.full(n := len(targets_of(line)), noise.sigma**2 * n / len(line.value)) for line, noise in lines]
    )
    order = np.argsort(targets, kind="stable")
    return targets[order], variance[order]


@dataclass(frozen=True, slots=True, eq=False)
class _Read:
    """Targets (n,) of a curve that is zero at the datum, with the variance of each; whether its mean slope is
    zero."""

    targets: Array
    variance: Array
    datum_mm: float
    straight: bool


def _left(spline: Spline, scales: Scales, amplitude: float, q: Array, read: _Read, *, apart: bool) -> Array:
    """(n,) variance at q of a curve that is known at targets up to its level. Where `apart`, ripple at one
    place says nothing of the place beside it."""
    processes, sizes = spline.processes(), scales.values**2
    own = np.tensordot(sizes, processes, 1) + amplitude**2 * spline.lines() @ spline.lines().T
    grain = 0.0
    if apart:
        own -= sizes[RIPPLE] * processes[RIPPLE]
        grain = float(sizes[RIPPLE] * (spline.values(q) ** 2).sum(axis=1).mean())
    wanted = spline.values(q) - spline.values(np.array([read.datum_mm]))
    if read.straight:
        slope = slope_weights(spline) @ spline.values(slope_grid(spline))
        wanted = wanted - (q - read.datum_mm)[:, None] * slope
    seen = own @ spline.values(read.targets).T
    same = np.equal.outer(read.targets, read.targets)
    inner = spline.values(read.targets) @ seen + np.diag(read.variance) + grain * same
    across = wanted @ seen - grain * (read.targets == read.datum_mm)
    explained = np.einsum("ij,ji->i", across, np.linalg.solve(inner, across.T))
    whole = np.einsum("ij,ij->i", wanted @ own, wanted)
    return np.asarray(whole + 2.0 * grain * (q != read.datum_mm) - explained)
