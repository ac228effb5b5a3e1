"""The best linear estimator from the readings of a fit, which knows the covariance of a family of machines.

It has the fit's states of instruments, and so the same linear readings. Curves are values on a grid whose
covariance is that of the family; what is between grid positions is one more unknown at each position.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
from judge import families, simulated
from scipy.linalg import cho_factor, cho_solve

from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block
from olp.calibration.estimator.parameters import MeasuringLine, Parameters
from olp.core.machine import SQUARENESS

#: Standard deviation of a squareness of all families, rad.
SQUARE = 30e-6
#: Standard deviation of half differences, mm.
HALF = 5e-3
#: Variance of unknowns without a prior, against that of the readings which they explain.
FREE = 1e8
#: Curves from which a covariance is estimated.
DRAWS = 1500
#: Cells of the grid of a curve.
CELLS = 200
#: Positions nearer than this are the same, mm.
SAME_MM = 1e-3


@dataclasses.dataclass(frozen=True, eq=False)
class Grid:
    """A curve as values on a grid, as the layout of unknowns needs it."""

    low_mm: float
    high_mm: float
    cells: int

    @property
    def size(self) -> int:
        return self.cells + 1

    @property
    def spline(self) -> Grid:
        return self

    @property
    def nodes(self) -> np.ndarray:
        return np.linspace(self.low_mm, self.high_mm, self.size)

    def values(self, q: np.ndarray) -> np.ndarray:
        place = np.clip((q - self.low_mm) / (self.high_mm - self.low_mm), 0.0, 1.0) * self.cells
        cell = np.minimum(place.astype(int), self.cells - 1)
        table = np.zeros((len(q), self.size))
        rows = np.arange(len(q))
        table[rows, cell], table[rows, cell + 1] = 1.0 - (place - cell), place - cell
        return table


@cache
def covariance(family: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Grid and covariance; all straightness curves of an axis are alike, and so are its angles."""
    kind, axis = families.class_of(name), name[2]
    across = "YXX"["XYZ".index(axis)]
    alike = {"angle": f"EA{axis}", "positioning": f"E{axis}{axis}", "straightness": f"E{across}{axis}"}
    return _covariance(family, alike[kind])


@cache
def _covariance(family: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    return families.covariance(family, name, DRAWS, CELLS)


class Best:
    """The best linear estimate of a machine's errors from the readings of `fitted`."""

    def __init__(self, fitted: Fit, family: str) -> None:
        own = fitted.parameters
        self.family, self.squares = family, fitted.prior.squares
        spaces = {name: Grid(*simulated.BOX["XYZ".index(name[2])], CELLS) for name in simulated.NAMES}
        lines = dict.fromkeys(own.measuring_lines, MeasuringLine((0.0, 0.0, 0.0)))
        self.layout = Parameters(own.chain, (0.0, 0.0, 0.0), spaces, lines, own.halves, {}, own.shared)  # type: ignore[arg-type]
        blocks = [result.state.block(self.layout, np.zeros(self.layout.size)) for result in fitted.results]
        tables = [_joined(block, self.layout.size) for block in blocks]
        self.rows, self.y = (np.concatenate([table[k] for table in tables]) for k in range(2))
        inner = self.against(self.rows, self.rows)
        start = 0
        for table in tables:
            part = slice(start, start + len(table[1]))
            inner[part, part] += table[2]
            start = part.stop
        self.scale = np.sqrt(np.diag(inner))
        inner = inner / np.outer(self.scale, self.scale) + 1e-13 * np.eye(len(inner))
        self.inner = cho_factor(inner, lower=True)

    def against(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(n, m) covariance of functionals (n, size) with others (m, size)."""
        total = np.zeros((len(one), len(other)))
        for name, part in self.layout.slices.items():
            a, b = one[:, part], other[:, part]
            if name not in simulated.NAMES:
                total += self._deviation(name) ** 2 * a @ b.T
                continue
            nodes, K = covariance(self.family, name)
            total += a @ K @ b.T
            # what interpolation on the grid loses is another unknown at each position
            (gain, q), (more, where) = _position(a, nodes), _position(b, nodes)
            weight = self.layout.spaces[name].values(q)
            lost = weight @ np.diag(K) - np.einsum("ij,jk,ik->i", weight, K, weight)
            total += (gain * np.maximum(lost, 0.0))[:, None] * more * (np.abs(q[:, None] - where) < SAME_MM)
        return total

    def at(self, axis_mm: np.ndarray, tool_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) errors at axis positions (n, 3) with a tool vector, and their standard deviations, mm."""
        rows = self.layout.design(axis_mm, tool_mm).reshape(-1, self.layout.size)
        across = self.against(rows, self.rows) / self.scale
        solved = cho_solve(self.inner, np.column_stack([self.y / self.scale, across.T]))
        whole = np.array([self.against(row[None], row[None])[0, 0] for row in rows])
        left = whole - np.einsum("ij,ji->i", across, solved[:, 1:])
        return (across @ solved[:, 0]).reshape(-1, 3), np.sqrt(np.maximum(left, 0.0)).reshape(-1, 3)

    def _deviation(self, name: str) -> float:
        if name in SQUARENESS:
            return SQUARE
        return HALF if name.startswith("half") else self.squares[name][1]


def _joined(block: Block, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (n, size) and readings (n,) of a block, and the covariance (n, n) of noise and own unknowns."""
    chunks = list(block.chunks())
    y, sigma = (np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("y", "sigma"))
    rows = np.zeros((len(y), size))
    rows[:, block.columns] = np.concatenate([chunk.rows for chunk in chunks])
    local = np.concatenate([chunk.local for chunk in chunks]) / 1.0
    usual = np.sqrt(np.mean((local / sigma[:, None]) ** 2, axis=0))
    local /= np.sqrt(np.where(block.precision > 0.0, block.precision, usual**2 / FREE))
    return rows, y, local @ local.T + np.diag(sigma**2)


def _position(rows: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) by which factor rows (n, nodes) read a curve, and (n,) where."""
    gain = rows.sum(axis=1)
    return gain, np.where(gain == 0.0, 0.0, rows @ nodes / np.where(gain == 0.0, 1.0, gain))
