"""The adjustment of a fit with a smooth field beside the curves.

The normal equations of volumetric readings cover curves, field and the own unknowns of each set. They are
stored by folds, so that any fold may be held out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from olp.calibration.estimator.beside import block_of
from olp.calibration.estimator.field import Modes
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block, Chunk, Normal
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.observations.base import Result, ScatteredState, residual_and_chi_square
from olp.core.arrays import Array, Index
from olp.core.machine import SQUARENESS
from olp.core.units import AXES
from olp.core.values import dataclass

#: Parts into which the points fall for the held-out figure.
FOLDS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Both:
    """Curves and field together, as the unknowns of blocks."""

    parameters: Parameters
    modes: Modes

    @property
    def size(self) -> int:
        return self.parameters.size + 3 * self.modes.size

    def design(self, position: Array, tool: Array, /) -> Array:
        return np.concatenate([self.parameters.design(position, tool), wide(self.modes, position)], axis=2)


def wide(modes: Modes, position: Array) -> Array:
    """(n, 3, 3 m) the field's dependence on its coefficients at axis positions (n, 3)."""
    values, m = modes.values(position), modes.size
    table = np.zeros((len(position), 3, 3 * m))
    for i in range(3):
        table[:, i, i * m : (i + 1) * m] = values
    return table


def straight(parameters: Parameters, position: Array) -> Array:
    """The design of what moves every tool alike: displacement curves and squareness, no angles."""
    table = parameters.design(position, np.zeros(3))
    keep = np.zeros(parameters.size, bool)
    for name, part in parameters.slices.items():
        keep[part] = name in (*SQUARENESS, "frame") or (name in parameters.spaces and name[1] in AXES)
    table[:, :, ~keep] = 0.0
    return table


@dataclass(slots=True, eq=False)
class _Sums:
    """Gram matrices of [curves, field, nuisances, y] of standardised readings: of what is never held out
    (first) and of each fold; `counts` the readings of each."""

    gram: Array
    counts: Array


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """The readings reduced to the field: precision G and right side v with all else eliminated, the weighted
    residual square without a field, and its degrees of freedom."""

    G: Array
    v: Array
    square: float
    freedom: float


class Adjustment:
    """The normal equations. Lines and priors have no part in the field."""

    def __init__(self, fit: Fit, modes: Modes) -> None:
        self.fit, self.modes = fit, modes
        self.size, self.own = fit.parameters.size, 3 * modes.size
        both = Both(fit.parameters, modes)
        theta = np.concatenate([fit.theta, np.zeros(self.own)])
        sets = [
            (r.state, block_of(r.state, theta, fit.parameters, fit.prior.hidden, both)) for r in fit.scattered
        ]
        self.blocks = [block for _, block in sets]
        local = [len(block.precision) for block in self.blocks]
        self.total = both.size + sum(local)
        gram = np.zeros((FOLDS + 1, self.total + 1, self.total + 1))
        counts = np.zeros(FOLDS + 1)
        nuisance = np.zeros(self.total)
        offset = both.size
        for (state, block), count in zip(sets, local, strict=True):
            nuisance[offset : offset + count] = block.precision
            columns = [*range(both.size), *range(offset, offset + count), self.total]
            folds = _folds(state)
            start = 0
            for chunk in block.chunks():
                part = folds[start : start + len(chunk.y)]
                start += len(chunk.y)
                for k in np.unique(part).tolist():
                    table = _table(chunk, part == k)
                    gram[k][np.ix_(columns, columns)] += table.T @ table
                    counts[k] += len(table)
            offset += count
        self.sums = _Sums(gram, counts)
        self.free = int(np.sum(nuisance[both.size :] == 0.0))
        other = Normal.of(self.size)
        for block in self._other_blocks():
            other.add(block)
        fit.prior.push(other)
        self.lines = other.H
        self.prior = np.diag(nuisance)
        self.prior[: self.size, : self.size] = other.H + fit.prior.precision()[0]
        self.right = np.zeros(self.total)
        self.right[: self.size] = other.g
        known = self.prior[: self.size, : self.size]
        self.constant = float(other.g @ np.linalg.solve(known, other.g))

    def normal(self, without: int | None = None) -> tuple[Array, Array, float, float]:
        """(H, g, weighted square, readings) of everything but one fold, without the field's prior."""
        use = [k for k in range(FOLDS + 1) if k != without]
        gram = self.sums.gram[use].sum(axis=0)
        n = self.total
        square = float(gram[n, n]) + self.constant
        return gram[:n, :n] + self.prior, gram[:n, n] + self.right, square, float(self.sums.counts[use].sum())

    def reduced(self) -> Reduced:
        H, g, square, count = self.normal()
        field = self.columns((0, 1, 2))
        rest = np.setdiff1d(np.arange(self.total), field)
        factor = solver_of(H[np.ix_(rest, rest)])
        across = H[np.ix_(field, rest)]
        solved = factor(np.column_stack([across.T, g[rest]]))
        G = H[np.ix_(field, field)] - across @ solved[:, :-1]
        v = g[field] - across @ solved[:, -1]
        residual_square = square - float(g[rest] @ solved[:, -1])
        return Reduced(0.5 * (G + G.T), v, residual_square, count - self.free)

    def columns(self, coordinates: Sequence[int]) -> Index:
        m = self.modes.size
        parts = [np.arange(self.size + i * m, self.size + (i + 1) * m) for i in coordinates]
        return np.concatenate([np.zeros(0, np.int64), *parts])

    def solve(
        self, coordinates: Sequence[int], log_variance: Array, noise: float, without: int | None = None
    ) -> tuple[Array, Array, Index]:
        """(x, covariance, columns) of curves, the field's `coordinates` and nuisances."""
        H, g, _, _ = self.normal(without)
        field = self.columns(coordinates)
        keep = np.concatenate([np.arange(self.size), field, np.arange(self.size + self.own, self.total)])
        A, b = H[np.ix_(keep, keep)] / noise**2, g[keep] / noise**2
        inner = np.arange(self.size, self.size + len(field))
        A[inner, inner] += np.exp(-log_variance)
        inverse = solver_of(A)(np.column_stack([np.eye(len(A)), b]))
        return inverse[:, -1], inverse[:, :-1], keep

    def misses(self, x: Array, keep: Index, folds: Sequence[int]) -> tuple[float, float]:
        """Weighted residual square of the readings of folds at x, and their number."""
        whole = np.zeros(self.total + 1)
        whole[keep], whole[-1] = x, -1.0
        gram = self.sums.gram[list(folds)].sum(axis=0)
        return max(float(whole @ gram @ whole), 0.0), float(self.sums.counts[list(folds)].sum())

    def believed(self, coordinates: Sequence[int], log_variance: Array, noise: float) -> Array:
        """The prior precision alone of the unknowns of `solve`."""
        field = self.columns(coordinates)
        rest = np.arange(self.size + self.own, self.total)
        keep = np.concatenate([np.arange(self.size), field, rest])
        precision = self.prior[np.ix_(keep, keep)] / noise**2
        precision[: self.size, : self.size] -= self.lines / noise**2
        inner = np.arange(self.size, self.size + len(field))
        precision[inner, inner] += np.exp(-log_variance)
        return np.asarray(precision)

    def results_of(self, x: Array) -> tuple[tuple[Result[Any], ...], float]:
        """The results of all observations, those of scattered ones with curves and field x, and chi-square of
        all readings."""
        blocks = iter(self.blocks)
        results, chi_square = [], 0.0
        for result in self.fit.results:
            if isinstance(result.state, ScatteredState):
                residual, square = residual_and_chi_square(next(blocks), x)
                result = Result(result.state, residual, square, result.freedom)
                chi_square += square
            results.append(result)
        for block in self._other_blocks():
            chi_square += residual_and_chi_square(block, x)[1]
        return tuple(results), chi_square

    def _other_blocks(self) -> list[Block]:
        """The blocks of the observations that do not depend on the field."""
        fit = self.fit
        states = [r.state for r in fit.results if not isinstance(r.state, ScatteredState)]
        return [fit.block(state) for state in states]


def _table(chunk: Chunk, use: np.ndarray) -> Array:
    table = np.concatenate([chunk.rows, chunk.local, chunk.y[:, None]], axis=1)
    return np.asarray(chunk.standardised(table)[use])


def _folds(state: ScatteredState) -> Index:
    """The fold from 1 of every reading, in the order of its block; 0 is never held out. All readings of a
    point are in one fold."""
    n = len(state.observation.axis_mm)
    return state.spread_over_rows(1 + np.random.default_rng(n).permutation(n) % FOLDS)


def solver_of(matrix: Array) -> Callable[[Array], Array]:
    """Solves matrix x = right, scaled to a unit diagonal."""
    from scipy.linalg import cho_solve

    scale = np.sqrt(np.diag(matrix))
    factor = np.linalg.cholesky(matrix / np.outer(scale, scale) + 1e-13 * np.eye(len(scale)))

    def solved(right: Array) -> Array:
        return np.asarray(cho_solve((factor, True), right / scale[:, None]) / scale[:, None])

    return solved
