"""The character of curves: how much of a curve is bows, steps and ripple, by evidence.

Every combination of scales has a marginal likelihood of the readings of a curve's own lines (D. J. C. MacKay,
Neural Computation 4, 1992). No combination is chosen: few targets exclude few of them, and what they do not
exclude may be between the targets. So a curve gets the size of each process that is to be expected, and the
curves of one machine, which are alike, share what they say. The smooth part is one of several processes, the
same one for all curves of a machine. See docs/background/uncertainty.md.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from olp.calibration.estimator.basis import Scales, Spline
from olp.calibration.estimator.normal import Normal
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Processes that make the smooth part of a curve, as rows of a spectrum: one of them, and no other.
SMOOTH = (0, 1, 4, 5, 6)
#: How probable each is before any reading, up to a factor: few targets do not tell them apart.
SMOOTH_BEFORE = 0.3, 0.5, 1.0, 3.0, 3.0
#: Candidates for the smooth part of positioning, root mean square over the axis in mm, as all candidates.
SIZES = np.geomspace(2e-3, 0.512, 9)
#: Candidates for steps.
STEPS = np.concatenate([[0.0], np.geomspace(4e-4, 0.1024, 8)])
#: Candidates for ripple.
RIPPLE = np.concatenate([[0.0], np.geomspace(4e-4, 0.0256, 7)])
#: How large the curves of a class usually are against positioning, in mm or rad.
USUAL = {"positioning": 1.0, "straightness": 0.4, "angle": 0.6e-3}
#: How far curves of one class differ, as a standard deviation in candidates: kind of the smooth part, its
#: size, steps, ripple. Few targets take a wave of a screw for a smooth curve where its period suits them, so
#: ripple is told by all curves together.
ALIKE = 0.0, 1.0, 0.5, 0.25
#: The same of classes, beside what they usually are.
RELATED = 0.0, 1.0, 0.5, 0.5
#: Before any reading: the probability of no steps, what they are else beside a usual smooth part, mm, and the
#: standard deviation of the logarithm of that.
STEPS_BEFORE = 0.9, 1.05e-3, 0.7
#: The same of ripple.
RIPPLE_BEFORE = 0.15, 3.0e-3, 0.3
#: A usual smooth part of positioning, mm.
USUAL_SIZE = 0.01
#: Steps and ripple go with this power of the smooth part: a machine five times better has less of both, but
#: screws and racks do not know how straight their guides are.
GOES_WITH = 0.5
#: The scale that stands for all probable ones is the mean of this power of them: 2 is the expected variance.
MOMENT = 2.0
#: Directions of the unknowns that readings determine less than this, against the best, say nothing.
_LEAST_SHARE = 1e-13


def class_of(name: str) -> str:
    """positioning, straightness or angle."""
    if name[1] in "ABC":
        return "angle"
    return "positioning" if name[1] == name[2] else "straightness"


@cache
def rms_of_processes() -> Array:
    """(7,) root mean square over the axis of each process of size 1."""
    spline = Spline(0.0, 1.0, 120)
    values = spline.values(np.linspace(0.0, 1.0, 721))
    mean = values.T @ values / len(values)
    return np.asarray(np.sqrt((spline.processes() * mean).sum(axis=(1, 2))))


@cache
def _table(every: int) -> Array:
    """(n, 7) all combinations of every so many candidates, of positioning."""
    combined = itertools.product(SMOOTH[::every], SIZES[::every], STEPS[::every], RIPPLE[::every])
    table = np.zeros((math.prod(len(grid[::every]) for grid in (SMOOTH, SIZES, STEPS, RIPPLE)), 7))
    for row, (process, size, steps, ripple) in zip(table, combined, strict=True):
        row[[process, 2, 3]] = size, steps, ripple
    return table / rms_of_processes()


def candidates(kind: str) -> Array:
    """(n, 7) all combinations of a smooth part, steps and ripple of a class of curves."""
    return _table(1) * USUAL[kind]


def fewer(kind: str) -> Array:
    """(n, 7) every other candidate of each, for comparisons of features."""
    return _table(2) * USUAL[kind]


def largest(kind: str) -> float:
    """The root mean square over the axis above which no curve of a class is expected, mm or rad."""
    return float(SIZES[-1]) * USUAL[kind]


class Evidence:
    """Log evidence of readings under a curve of some scales and features, up to a constant.

    The columns of `normal` are those of the spline, then of features, then others. Readings are reduced to
    the directions that they determine; in these the covariance is a sum with one matrix for each process.
    """

    def __init__(self, normal: Normal, spline: Spline, amplitude: float, feature: float) -> None:
        self.count, self.feature = spline.count, feature
        values, vectors = np.linalg.eigh(normal.H)
        use = values > _LEAST_SHARE * values[-1]
        root = np.sqrt(values[use])
        self.rows = (vectors[:, use] * root).T
        self.z = np.asarray(normal.g @ vectors[:, use] / root)
        base = self.rows[:, : spline.count]
        straight = amplitude * base @ spline.lines()
        self.fixed = np.eye(len(root)) + straight @ straight.T
        self.parts = base @ spline.processes() @ base.T

    def covariance(self, scales: Array, chosen: Sequence[int]) -> Array:
        """(n, r, r) covariance of the reduced readings for scales (n, 7) and some features."""
        own = self.feature * self.rows[:, [self.count + i for i in chosen]]
        return np.asarray(np.tensordot(scales**2, self.parts, 1) + self.fixed + own @ own.T)

    def values(self, covariance: Array) -> Array:
        """(n,) log evidences of covariances (n, r, r)."""
        factor = np.asarray(np.linalg.cholesky(covariance), float)
        half = np.linalg.solve(factor, self.z[:, None])[:, :, 0]
        return np.asarray(-0.5 * (half**2).sum(axis=1) - _logs(factor))

    def gains(self, scales: Array, chosen: Sequence[int], rest: Sequence[int]) -> Array:
        """(len(rest),) by how much each feature of `rest` raises the evidence, integrated over scales."""
        factor = np.asarray(np.linalg.cholesky(self.covariance(scales, chosen)), float)
        more = self.feature * self.rows[:, [self.count + i for i in rest]]
        table = np.linalg.solve(factor, np.column_stack([self.z, more]))
        z, columns = table[:, :, 0], table[:, :, 1:]
        before = -0.5 * (z**2).sum(axis=1) - _logs(factor)
        size = 1.0 + (columns**2).sum(axis=1)
        along = np.einsum("nr,nrk->nk", z, columns)
        after = before[:, None] + 0.5 * along**2 / size - 0.5 * np.log(size)
        return np.asarray(_integrated(after) - _integrated(before[:, None]))


def _logs(factor: Array) -> Array:
    return np.asarray(np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1))


def _integrated(values: Array) -> Array:
    """(k,) log of the sum over the first axis of exp(values (n, k))."""
    top = values.max(axis=0)
    return np.asarray(top + np.log(np.exp(values - top).sum(axis=0)))


def characters(values: Mapping[str, Array]) -> dict[str, Array]:
    """Probabilities of kinds, sizes, steps and ripple of each component, from the log evidence (n,) of all
    candidates for each. Those of one class differ little, those of others more."""
    shared = _Shared.of(values)
    tables = {name: _normal(own) * shared.prior(class_of(name), name) for name, own in values.items()}
    return {name: table / table.sum() for name, table in tables.items()}


def expected(table: Array, kind: str) -> Scales:
    """The scales to be expected of a curve of a class with such probabilities."""
    return Scales.of((table.ravel() @ candidates(kind) ** MOMENT) ** (1.0 / MOMENT))


def of_others(values: Mapping[str, Array]) -> dict[str, Array]:
    """Probabilities of kinds, sizes, steps and ripple of a curve without lines, by class: what the curves
    with lines say by their log evidence (n,), and what is likely before any reading."""
    shared = _Shared.of(values)
    return {kind: shared.prior(kind) for kind in USUAL}


@dataclass(frozen=True, slots=True, eq=False)
class _Shared:
    """Log probabilities of candidates by component and, from all its components, by class."""

    heard: Mapping[str, Array]
    classes: Mapping[str, Array]

    @classmethod
    def of(cls, values: Mapping[str, Array]) -> _Shared:
        heard = {name: _logarithm(_blurred(_normal(own), ALIKE)) for name, own in values.items()}
        classes = {
            kind: sum((heard[name] for name in heard if class_of(name) == kind), np.zeros(_SHAPE))
            for kind in sorted({class_of(name) for name in heard})
        }
        return cls(heard, classes)

    def prior(self, kind: str, name: str = "") -> Array:
        """Probabilities for a component of a class, by all components but itself."""
        zero = np.zeros(_SHAPE)
        own = self.classes.get(kind, zero) - self.heard.get(name, zero)
        others = [
            _logarithm(_blurred(_normal(table), RELATED))
            for one, table in self.classes.items()
            if one != kind
        ]
        return _blurred(_normal(own + sum(others, zero) + _before()), ALIKE)


#: Kinds of smooth parts, sizes of them, steps, ripple.
_SHAPE = len(SMOOTH), len(SIZES), len(STEPS), len(RIPPLE)


def _before() -> Array:
    """Log probabilities of candidates before any reading, for all sizes of smooth parts alike."""
    smooth = np.log(SMOOTH_BEFORE)[:, None, None, None]
    steps, ripple = _log_normal(STEPS, *STEPS_BEFORE), _log_normal(RIPPLE, *RIPPLE_BEFORE)
    return np.asarray(smooth + steps[:, :, None] + ripple[:, None, :] + np.zeros(_SHAPE))


def _log_normal(grid: Array, none: float, middle: float, spread: float) -> Array:
    """(sizes, n) log probabilities of candidates, the first of which is zero, beside each smooth part."""
    middles = middle * (SIZES[:, None] / USUAL_SIZE) ** GOES_WITH
    density = -0.5 * (np.log(grid[1:] / middles) / spread) ** 2
    density = np.exp(density - density.max(axis=1, keepdims=True))
    density *= (1.0 - none) / density.sum(axis=1, keepdims=True)
    return np.asarray(np.log(np.insert(density, 0, none, axis=1)))


def _logarithm(table: Array) -> Array:
    return np.asarray(np.log(np.maximum(table, 1e-300)))


def _normal(values: Array) -> Array:
    """Probabilities, as a table of bows, steps and ripple, from their logarithms."""
    weight = np.exp(values - values.max())
    return np.asarray(weight / weight.sum()).reshape(_SHAPE)


@cache
def _kernel(count: int, differ: float) -> Array:
    """(count, count) how probable a candidate of one curve is, where that of others is another, by column."""
    if differ == 0.0:
        return np.eye(count)
    apart = np.subtract.outer(np.arange(count), np.arange(count)) / differ
    table = np.exp(-0.5 * apart**2)
    return np.asarray(table / table.sum(axis=0))


def _blurred(table: Array, differ: Sequence[float]) -> Array:
    """A table with every axis spread by what curves differ."""
    for axis, (count, own) in enumerate(zip(_SHAPE, differ, strict=True)):
        table = np.moveaxis(np.tensordot(_kernel(count, own), table, (1, axis)), 0, axis)
    return table
