"""Normal equations of a linear Gaussian adjustment, gathered block by block.

Unknowns of one block alone (the zero of a line, its drift, the scale of its laser) are eliminated at once, by
the Schur complement. So a hundred thousand readings need one matrix of the size of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.values import dataclass

Index = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """Some readings of a block: y (n,) = rows (n, k) @ theta[columns] + local (n, l) @ nu + noise of standard
    deviation sigma (n,). To that comes what no unknown holds, of standard deviation `beside` (n,). Readings
    of one `group` (n,) see the same of it: how they differ is noise alone."""

    rows: Array
    y: Array
    sigma: Array
    local: Array
    beside: Array | None = None
    group: Index | None = None

    def standardised(self, values: Array) -> Array:
        """Values (n, c) of the readings in standard deviations, so that no two go together any more: times
        the inverse of a root of their covariance, group by group."""
        scaled = np.asarray(values / self.sigma[:, None])
        if self.beside is None or self.group is None:
            return scaled
        ratio = self.beside / self.sigma
        power = np.bincount(self.group, ratio**2)[self.group]
        several = np.bincount(self.group)[self.group] > 1
        scaled[~several] /= np.sqrt(1.0 + power[~several])[:, None]
        order = np.flatnonzero(several & (power > 0.0))
        if order.size:
            order = order[np.argsort(self.group[order], kind="stable")]
            new = np.diff(self.group[order], prepend=-1) != 0
            common = np.add.reduceat(ratio[order, None] * scaled[order], np.flatnonzero(new), axis=0)
            less = ratio[order] * (1.0 - 1.0 / np.sqrt(1.0 + power[order])) / power[order]
            scaled[order] -= less[:, None] * common[np.cumsum(new) - 1]
        return scaled

    @property
    def log_sigma(self) -> float:
        """Half the logarithm of the determinant of their covariance."""
        size = float(np.log(self.sigma).sum())
        if self.beside is None or self.group is None:
            return size
        return size + 0.5 * float(np.log1p(np.bincount(self.group, (self.beside / self.sigma) ** 2)).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Readings that share local unknowns nu, in chunks that limit memory; each call of `chunks` builds them.

    `columns` (k,) of theta that they depend on, `precision` (l,) the prior precision of nu, whose mean is
    zero; a precision of 0 leaves it free.
    """

    columns: Index
    precision: Array
    chunks: Callable[[], Iterable[Chunk]]
    label: str = ""

    @classmethod
    def of(cls, chunk: Chunk, columns: Index, precision: Array, label: str = "") -> Block:
        """A block of one chunk."""
        return cls(columns, precision, lambda: (chunk,), label)


@dataclass(slots=True, eq=False)
class Normal:
    """H theta = g over n parameters; `square` is the weighted sum of y^2 that locals do not explain, `count`
    the readings, and `free` the local unknowns without a prior. `log_noise` is what the size of the noise
    takes off the log evidence: the logarithms of standard deviations, and of what locals leave open."""

    H: Array
    g: Array
    square: float = 0.0
    count: int = 0
    free: int = 0
    log_noise: float = 0.0

    @classmethod
    def of(cls, n: int) -> Normal:
        return cls(np.zeros((n, n)), np.zeros(n))

    def add(self, block: Block) -> None:
        """Add the readings of a block."""
        k, m = len(block.columns), len(block.precision)
        gram = np.zeros((k + m + 1, k + m + 1))
        for chunk in block.chunks():
            table = chunk.standardised(np.concatenate([chunk.rows, chunk.local, chunk.y[:, None]], axis=1))
            gram += table.T @ table
            self.count += len(chunk.y)
            self.log_noise += chunk.log_sigma
        kept = [*range(k), k + m]
        inner = gram[k : k + m, k : k + m] + np.diag(block.precision)
        outer = gram[np.ix_(kept, range(k, k + m))]
        reduced = gram[np.ix_(kept, kept)] - outer @ np.linalg.solve(inner, outer.T)
        self.H[np.ix_(block.columns, block.columns)] += reduced[:k, :k]
        self.g[block.columns] += reduced[:k, k]
        self.square += float(reduced[k, k])
        self.free += int(np.sum(block.precision == 0.0))
        self.log_noise += 0.5 * float(np.linalg.slogdet(inner)[1])


def residuals_of(block: Block, theta: Array) -> tuple[Array, Array, Array]:
    """(nu, residuals, standardised residuals) of all readings of a block at the solution."""
    own = theta[block.columns]
    inner, right = np.diag(block.precision), np.zeros(len(block.precision))
    rest, standardised = [], []
    for chunk in block.chunks():
        off = (chunk.y - chunk.rows @ own)[:, None]
        weighted = chunk.standardised(np.concatenate([chunk.local, off], axis=1))
        inner = inner + weighted[:, :-1].T @ weighted[:, :-1]
        right = right + weighted[:, :-1].T @ weighted[:, -1]
        rest.append(np.concatenate([chunk.local, off], axis=1))
        standardised.append(weighted)
    nu = np.asarray(np.linalg.solve(inner, right))
    less = np.append(-nu, 1.0)
    return nu, np.concatenate(rest) @ less, np.concatenate(standardised) @ less


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
    square = normal.square - float(explained @ explained)
    return -0.5 * (square + logdet - prior_logdet) - normal.log_noise


def solve(normal: Normal, prior: Array, prior_logdet: float = 0.0) -> Solved:
    """The posterior of theta ~ N(0, prior^-1) given the readings."""
    from scipy.linalg import cho_solve

    factor, scale = _factor(normal.H + prior)
    theta = cho_solve((factor, True), normal.g / scale) / scale
    covariance = cho_solve((factor, True), np.eye(len(scale))) / np.outer(scale, scale)
    explained = _forward(factor, normal.g / scale)
    logdet = 2.0 * float(np.log(np.diag(factor)).sum() + np.log(scale).sum())
    square = normal.square - float(explained @ explained)
    log_evidence = -0.5 * (square + logdet - prior_logdet) - normal.log_noise
    return Solved(theta, 0.5 * (covariance + covariance.T), log_evidence)


def _factor(matrix: Array) -> tuple[Array, Array]:
    """Lower Cholesky factor of the matrix scaled to a unit diagonal, and the scale."""
    scale = np.sqrt(np.diag(matrix))
    scaled = matrix / np.outer(scale, scale) + 1e-13 * np.eye(len(scale))
    return np.asarray(np.linalg.cholesky(scaled)), scale


def _forward(factor: Array, g: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, g, lower=True))
