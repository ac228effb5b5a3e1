"""The character of curves: how much of a curve is bows, steps and ripple, by evidence.

Every combination of scales has a marginal likelihood of the readings of a curve's own lines (D. J. C. MacKay,
Neural Computation 4, 1992). No combination is chosen: few targets exclude few of them, and what they do not
exclude may be between the targets. So a curve gets the size of each process that is to be expected, and the
curves of one machine, which are alike, share what they say.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from olp.calibration.estimator.basis import STRAIGHT, Scales, Spline
from olp.calibration.estimator.normal import Normal
from olp.core.arrays import Array

#: Candidates for bows of positioning, mm, as all candidates. Lines tell no bends from bows, steps and ripple.
BOWS = np.geomspace(0.3, 300.0, 10)
#: Candidates for steps.
STEPS = np.concatenate([[0.0], np.geomspace(3e-4, 0.1, 7)])
#: Candidates for ripple.
RIPPLE = np.concatenate([[0.0], np.geomspace(1e-4, 1e-2, 6)])
#: How large the curves of a class usually are against positioning, in mm or rad.
USUAL = {"positioning": 1.0, "straightness": 0.4, "angle": 0.6e-3}
#: How far the scales of curves of one class differ, as a standard deviation in candidates.
ALIKE = 0.5
#: The same of classes, beside what they usually are.
RELATED = 1.5
#: The scale that stands for all probable ones is the mean of this power of them: 2 is the expected variance.
MOMENT = 1.5
#: Candidates for steps and ripple are as probable, before any reading, as this power of them.
LARGER = 0.5
#: Directions of the unknowns that readings determine less than this, against the best, say nothing.
_LEAST_SHARE = 1e-13


def class_of(name: str) -> str:
    """positioning, straightness or angle."""
    if name[1] in "ABC":
        return "angle"
    return "positioning" if name[1] == name[2] else "straightness"


def _table(every: int) -> Array:
    """(n, 4) all combinations of every so many candidates, of positioning."""
    combined = itertools.product(BOWS[::every], STEPS[::every], RIPPLE[::every])
    return np.array([(bows, 0.0, steps, ripple) for bows, steps, ripple in combined])


#: All combinations of candidates (n, 4).
_ALL = _table(1)
#: Fewer of them, for comparisons of features.
_FEWER = _table(2)


def candidates(kind: str) -> Array:
    """(n, 4) all combinations of bows, bends, steps and ripple of a class of curves."""
    return _ALL * USUAL[kind]


def fewer(kind: str) -> Array:
    """(n, 4) every other candidate of each, for comparisons of features."""
    return _FEWER * USUAL[kind]


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
        table, turned = spline.spectrum()
        base = self.rows[:, : spline.count] @ turned
        straight = amplitude * base[:, :STRAIGHT]
        self.fixed = np.eye(len(root)) + straight @ straight.T
        self.parts = np.stack([(base * variance) @ base.T for variance in table])

    def covariance(self, scales: Array, chosen: Sequence[int]) -> Array:
        """(n, r, r) covariance of the reduced readings for scales (n, 4) and some features."""
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


def characters(values: Mapping[str, Array]) -> dict[str, Scales]:
    """The scales of each component, from the log evidence (n,) of all candidates for each. Those of one class
    differ little, those of others more."""
    kinds = {name: class_of(name) for name in values}
    chances = {name: _normal(own) for name, own in values.items()}
    heard = {name: _logarithm(_blurred(own, ALIKE)) for name, own in chances.items()}
    zero = np.zeros(_SHAPE)
    classes = {
        kind: sum((heard[name] for name in heard if kinds[name] == kind), zero)
        for kind in sorted(set(kinds.values()))
    }
    spread = {kind: _logarithm(_blurred(_normal(own), RELATED)) for kind, own in classes.items()}
    found, before = {}, _before()
    for name, own in chances.items():
        kind = kinds[name]
        others = sum((table for other, table in spread.items() if other != kind), zero)
        prior = _blurred(_normal(classes[kind] - heard[name] + others + before), ALIKE)
        found[name] = _expected(own * prior, kind)
    return found


#: Candidates of bows, of steps, of ripple.
_SHAPE = len(BOWS), len(STEPS), len(RIPPLE)


def _before() -> Array:
    """Log probabilities of candidates before any reading: larger steps and ripple are more probable, else the
    many small candidates, which readings hardly tell apart, would outweigh one that matters."""
    steps, ripple = (np.log(np.maximum(grid, grid[1]) / grid[-1]) for grid in (STEPS, RIPPLE))
    return np.asarray(LARGER * (np.zeros(len(BOWS))[:, None, None] + steps[:, None] + ripple))


def _logarithm(table: Array) -> Array:
    return np.asarray(np.log(np.maximum(table, 1e-300)))


def _normal(values: Array) -> Array:
    """Probabilities, as a table of bows, steps and ripple, from their logarithms."""
    weight = np.exp(values - values.max())
    return np.asarray(weight / weight.sum()).reshape(_SHAPE)


@cache
def _kernel(count: int, differ: float) -> Array:
    """(count, count) how probable a candidate of one curve is, where that of others is another, by column."""
    apart = np.subtract.outer(np.arange(count), np.arange(count)) / differ
    table = np.exp(-0.5 * apart**2)
    return np.asarray(table / table.sum(axis=0))


def _blurred(table: Array, differ: float) -> Array:
    """A table with every axis spread by what curves differ."""
    for axis, count in enumerate(_SHAPE):
        table = np.moveaxis(np.tensordot(_kernel(count, differ), table, (1, axis)), 0, axis)
    return table


def _expected(weight: Array, kind: str) -> Scales:
    share = weight.ravel() / weight.sum()
    return Scales.of((share @ candidates(kind) ** MOMENT) ** (1.0 / MOMENT))
