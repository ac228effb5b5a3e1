"""Interpolation of many columns over a rectilinear grid of one to three arguments: linear or cubic.

Both kinds are tensor products of one interpolation along each argument. So they are linear in the values
(fields add), and no order of the arguments is preferred. A monotone cubic (pchip) has neither property.
"cubic" is the cubic Hermite with three-point parabolic slopes at the knots (Catmull-Rom on equal steps). It
is continuous in its first derivatives, and exact for fields of degree 2 in each argument. Outside the knots
the end value is held.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field
from itertools import product
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.values import dataclass

Index = npt.NDArray[np.intp]
Kind = Literal["linear", "cubic"]

#: The kinds of interpolation, by name.
KINDS = ("linear", "cubic")
#: Rows of points per block: their columns fit in the second-level cache.
_BLOCK = 8192


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Interpolation along one argument. In cell i the value is a polynomial of the share t in [0, 1] of the
    cell. Its coefficients are `weights[i]` (degree + 1, window) times the values from node `first[i]` on."""

    knots: Array
    first: Index
    weights: Array

    @classmethod
    def through(cls, knots: Array, kind: Kind) -> Line:
        """Through strictly increasing knots (n,); one knot makes a constant."""
        n = len(knots)
        if n == 1:
            return cls(knots, np.zeros(1, np.intp), np.ones((1, 1, 1)))
        if kind == "linear" or n == 2:
            weights = np.tile(np.array([[1.0, 0.0], [-1.0, 1.0]]), (n - 1, 1, 1))
            return cls(knots, np.arange(n - 1), weights)
        window = min(4, n)
        cells = np.arange(n - 1)
        first = np.clip(cells - 1, 0, n - window)
        slopes = _parabolic(knots)
        weights = np.zeros((n - 1, 4, window))
        for i in cells.tolist():
            part = slice(int(first[i]), int(first[i]) + window)
            width = knots[i + 1] - knots[i]
            here, there = np.eye(n)[i, part], np.eye(n)[i + 1, part]
            m0, m1, rise = width * slopes[i, part], width * slopes[i + 1, part], there - here
            weights[i] = here, m0, 3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise
        return cls(knots, first, weights)

    def at(self, q: Array) -> tuple[Index, Array]:
        """First node (n,) and the weight of each node of the window (n, window) at finite q (n,)."""
        if len(self.knots) == 1:
            return np.zeros(len(q), np.intp), np.ones((len(q), 1))
        cell = np.clip(np.searchsorted(self.knots, q, side="right") - 1, 0, len(self.knots) - 2)
        low = self.knots[cell]
        t = np.clip((q - low) / (self.knots[cell + 1] - low), 0.0, 1.0)[:, None]
        of_cell = self.weights[cell]
        value = of_cell[:, -1]
        for degree in range(of_cell.shape[1] - 2, -1, -1):
            value = value * t + of_cell[:, degree]
        return self.first[cell], value

    def hull(self, derivative: int) -> Array:
        """(cells, points, nodes) factors on the nodes' values that give Bernstein coefficients: control
        points whose hull holds the derivative (per mm) over each cell."""
        n, cells = len(self.knots), max(len(self.knots) - 1, 1)
        degree = self.weights.shape[1] - 1
        power = self.weights
        width = np.diff(self.knots) if n > 1 else np.ones(1)
        for _ in range(derivative):
            if degree == 0:
                return np.zeros((cells, 1, n))
            power = power[:, 1:] * np.arange(1, degree + 1)[:, None] / width[:, None, None]
            degree -= 1
        to_bernstein = np.array(
            [
                [math.comb(i, k) / math.comb(degree, k) if k <= i else 0.0 for k in range(degree + 1)]
                for i in range(degree + 1)
            ]
        )
        points = np.einsum("ik,ckw->ciw", to_bernstein, power)
        factors = np.zeros((cells, degree + 1, n))
        for c in range(cells):
            factors[c, :, self.first[c] : self.first[c] + points.shape[2]] = points[c]
        return factors


def _parabolic(knots: Array) -> Array:
    """(n, n) slope at each knot of the parabola through it and its neighbours (the nearest three at an
    end)."""
    n = len(knots)
    slopes = np.zeros((n, n))
    for i in range(n):
        a = min(max(i - 1, 0), n - 3)
        x = knots[a : a + 3]
        for k in range(3):
            p, q = (j for j in range(3) if j != k)
            slopes[i, a + k] = (2.0 * knots[i] - x[p] - x[q]) / ((x[k] - x[p]) * (x[k] - x[q]))
    return slopes


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Columns `values` (n1, .., nd, m) over d arguments with `knots` (n1,), .., (nd,)."""

    knots: tuple[Array, ...]
    values: Array
    kind: Kind
    lines: tuple[Line, ...] = field(repr=False)
    #: by node, the values of the window of the last argument that begins there, side by side
    windows: Array = field(repr=False)

    @classmethod
    def through(cls, knots: Sequence[Array], values: Array, kind: Kind) -> Grid:
        lines = tuple(Line.through(np.asarray(k, float), kind) for k in knots)
        whole = np.ascontiguousarray(values, dtype=np.float64)
        rows = whole.reshape(-1, whole.shape[-1])
        window = lines[-1].weights.shape[2]
        # a window never begins so late that it leaves the end of the table
        side_by_side = [rows[k : len(rows) - window + 1 + k] for k in range(window)]
        windows = np.concatenate(side_by_side, axis=1)
        return cls(tuple(line.knots for line in lines), whole, kind, lines, windows)

    def __call__(self, q: Array) -> Array:
        """(n, m) values at finite arguments q (n, d)."""
        columns = self.values.shape[-1]
        result = np.empty((len(q), columns))
        sizes = self.values.shape[:-1]
        strides = [math.prod(sizes[k + 1 :]) for k in range(len(sizes))]
        for start in range(0, len(q), _BLOCK):
            part = q[start : start + _BLOCK]
            stencils = [line.at(part[:, k]) for k, line in enumerate(self.lines)]
            firsts = (first * stride for (first, _), stride in zip(stencils, strides, strict=True))
            node = sum(firsts, start=0)
            total: Array | None = None
            for corner in product(*(range(weight.shape[1]) for _, weight in stencils[:-1])):
                offset = sum(c * stride for c, stride in zip(corner, strides, strict=False))
                value = self.windows.take(node + offset, axis=0)
                for (_, weight), c in zip(stencils, corner, strict=False):
                    value *= weight[:, c, None]
                total = value if total is None else np.add(total, value, out=total)
            assert total is not None
            last = stencils[-1][1]
            np.einsum(
                "nkm,nk->nm", total.reshape(len(part), -1, columns), last, out=result[start : start + _BLOCK]
            )
        return result

    def varies(self) -> npt.NDArray[np.bool_]:
        """(m, d): whether column i changes with argument k."""
        return np.array(
            [
                [bool(np.any(np.diff(self.values[..., i], axis=k) != 0.0)) for k in range(len(self.knots))]
                for i in range(self.values.shape[-1])
            ]
        ).reshape(self.values.shape[-1], len(self.knots))

    def largest(self, derivatives: Sequence[int]) -> Array:
        """(m,) upper bound of the absolute mixed derivative (so many times along each argument) within any
        cell, from the hull of its Bernstein coefficients."""
        hulls = [line.hull(d) for line, d in zip(self.lines, derivatives, strict=True)]
        worst = np.zeros(self.values.shape[-1])
        for block in self._control(hulls):
            worst = np.maximum(worst, np.abs(block).reshape(-1, block.shape[-1]).max(axis=0))
        return worst

    def jumps(self, argument: int) -> Array:
        """(knots - 2, m) largest absolute jump of the slope along one argument at each of its inner knots,
        over all of the others; zero where the kind has none."""
        line = self.lines[argument]
        if line.weights.shape[1] != 2 or len(line.knots) < 3:
            return np.zeros((max(len(line.knots) - 2, 0), self.values.shape[-1]))
        moved = np.moveaxis(self.values, argument, 0)
        width = np.diff(line.knots).reshape(-1, *([1] * (moved.ndim - 1)))
        jump = np.diff(np.diff(moved, axis=0) / width, axis=0)
        # the jump is itself interpolated along the others, a cubic may overshoot its nodes
        hulls = [line.hull(0) for k, line in enumerate(self.lines) if k != argument]
        for k, hull in enumerate(hulls):
            flat = hull.reshape(-1, hull.shape[-1])
            jump = np.moveaxis(np.tensordot(flat, jump, axes=(1, k + 1)), 0, k + 1)
        return np.asarray(np.abs(jump).reshape(len(jump), -1, jump.shape[-1]).max(axis=1))

    def span(self) -> Array:
        """(m,) upper bound of the difference between any two values."""
        low = np.full(self.values.shape[-1], np.inf)
        high = -low
        for block in self._control([line.hull(0) for line in self.lines]):
            flat = block.reshape(-1, block.shape[-1])
            low, high = np.minimum(low, flat.min(axis=0)), np.maximum(high, flat.max(axis=0))
        return np.asarray(high - low)

    def _control(self, hulls: Sequence[Array]) -> Iterator[Array]:
        """Control points, one slab of cells of the first argument at a time."""
        for of_cell in hulls[0]:
            block = np.tensordot(of_cell, self.values, axes=(1, 0))
            for k, hull in enumerate(hulls[1:], 1):
                flat = hull.reshape(-1, hull.shape[-1])
                block = np.moveaxis(np.tensordot(flat, block, axes=(1, k)), 0, k)
            yield block
