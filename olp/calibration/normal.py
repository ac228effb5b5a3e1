"""Normal equations of a linear Gaussian adjustment, gathered block by block.

What only one block knows (the zero of a line, its drift, the scale of its laser) is eliminated at once, by
the Schur complement; so a hundred thousand readings cost one matrix of the size of the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.errormodel.base import Array

Index = npt.NDArray[np.intp]
#: rows taken at once
_CHUNK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Readings of one file: y = rows @ theta[columns] + local @ nu + noise of standard deviation sigma.

    `rows` (n, k), `columns` (k,), `local` (n, l), `precision` (l,) the prior precision of nu, whose mean is
    zero; `y` and `sigma` (n,).
    """

    rows: Array
    columns: Index
    y: Array
    sigma: Array
    local: Array
    precision: Array
    label: str = ""

    def __len__(self) -> int:
        return len(self.y)


@dataclass(slots=True, eq=False)
class Normal:
    """H theta = g over n parameters; `square` is the weighted sum of y^2 that is not explained by locals, and
    `count` the readings."""

    H: Array
    g: Array
    square: float = 0.0
    count: int = 0
    local: int = 0

    @classmethod
    def of(cls, n: int) -> Normal:
        return cls(np.zeros((n, n)), np.zeros(n))

    def add(self, block: Block, use: npt.NDArray[np.bool_] | None = None) -> None:
        """Add the readings of a block, those that `use` (n,) marks."""
        k, m = len(block.columns), block.local.shape[1]
        gram = np.zeros((k + m + 1, k + m + 1))
        keep = np.arange(len(block)) if use is None else np.flatnonzero(use)
        for start in range(0, len(keep), _CHUNK):
            part = keep[start : start + _CHUNK]
            table = np.concatenate(
                [block.rows[part], block.local[part], block.y[part, None]], axis=1
            ) / block.sigma[part, None]  # fmt: skip
            gram += table.T @ table
        inner = gram[k : k + m, k : k + m] + np.diag(block.precision)
        outer = np.concatenate([gram[:k, k : k + m], gram[k + m :, k : k + m]])
        solved = np.linalg.solve(inner, outer.T) if m else np.zeros((0, k + 1))
        reduced = np.block([[gram[:k, :k], gram[:k, k + m :]], [gram[k + m :, :k], gram[k + m :, k + m :]]])
        reduced -= outer @ solved
        grid = np.ix_(block.columns, block.columns)
        self.H[grid] += reduced[:k, :k]
        self.g[block.columns] += reduced[:k, k]
        self.square += float(reduced[k, k])
        self.count += len(keep)
        self.local += int(np.sum(block.precision == 0.0)) if m else 0


def locals_of(block: Block, theta: Array, use: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """(nu, residual (n,) of all readings) of a block at the solution."""
    rest = block.y - block.rows @ theta[block.columns]
    m = block.local.shape[1]
    if not m:
        return np.zeros(0), rest
    weighted = block.local[use] / block.sigma[use, None]
    inner = weighted.T @ weighted + np.diag(block.precision)
    nu = np.asarray(np.linalg.solve(inner, weighted.T @ (rest[use] / block.sigma[use])))
    return nu, np.asarray(rest - block.local @ nu)


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """theta (n,), its covariance (n, n), and the log evidence up to a constant."""

    theta: Array
    covariance: Array
    evidence: float


def evidence(normal: Normal, prior: Array, prior_logdet: float) -> float:
    """Log marginal likelihood of the readings under theta ~ N(0, prior^-1), up to a constant."""
    factor, scale = _factor(normal.H + prior)
    explained = _forward(factor, normal.g / scale)
    logdet = 2.0 * float(np.log(np.diag(factor)).sum() + np.log(scale).sum())
    return -0.5 * (normal.square - float(explained @ explained)) - 0.5 * logdet + 0.5 * prior_logdet


def solve(normal: Normal, prior: Array, prior_logdet: float = 0.0) -> Solved:
    """The posterior of theta ~ N(0, prior^-1) given the readings."""
    from scipy.linalg import cho_solve

    factor, scale = _factor(normal.H + prior)
    theta = cho_solve((factor, True), normal.g / scale) / scale
    covariance = cho_solve((factor, True), np.eye(len(scale))) / np.outer(scale, scale)
    explained = _forward(factor, normal.g / scale)
    logdet = 2.0 * float(np.log(np.diag(factor)).sum() + np.log(scale).sum())
    found = -0.5 * (normal.square - float(explained @ explained)) - 0.5 * logdet + 0.5 * prior_logdet
    return Solved(theta, 0.5 * (covariance + covariance.T), found)


def _factor(matrix: Array) -> tuple[Array, Array]:
    """Lower Cholesky factor of the matrix scaled to a unit diagonal, and the scale."""
    scale = np.sqrt(np.diag(matrix))
    scaled = matrix / np.outer(scale, scale) + 1e-13 * np.eye(len(scale))
    return np.asarray(np.linalg.cholesky(scaled)), scale


def _forward(factor: Array, g: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, g, lower=True))
