"""Interpolation of many columns over one argument, and dense uniform tables for the hot path.

`Interpolant` is exact (piecewise linear or monotone cubic); `DenseTable` is its resampling for speed.
Outside their range both hold the end value; a caller that may leave the range asks `inside` first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, read_only
from olp.core.values import dataclass

Column = Array | float
Kind = Literal["linear", "pchip"]

#: 64k cells of six columns are 6 MB per axis, which the third-level cache holds, and 0.05 mm on 3 m.
MAX_CELLS = 65536
#: Knots this close to a grid node count as lying on it.
ON_GRID_MM = 1e-9


def pchip_slopes(x: Array, y: Array) -> Array:
    """(n, m) derivatives at the knots of the monotone cubic of F. N. Fritsch and R. E. Carlson (SIAM J.
    Numer. Anal. 17, 1980) with the weighted harmonic mean of F. N. Fritsch and J. Butland (1984) and the
    three-point end formula; x (n,) strictly increasing, y (n, m)."""
    h = np.diff(x)[:, None]
    secant = np.diff(y, axis=0) / h
    if len(x) == 2:
        return np.repeat(secant, 2, axis=0)
    slopes = np.zeros_like(y)
    before, after = secant[:-1], secant[1:]
    w_before, w_after = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    monotone = before * after > 0.0
    safe_before, safe_after = np.where(monotone, before, 1.0), np.where(monotone, after, 1.0)
    mean = (w_before + w_after) / (w_before / safe_before + w_after / safe_after)
    slopes[1:-1] = np.where(monotone, mean, 0.0)
    slopes[0] = _end_slope(float(h[0, 0]), float(h[1, 0]), secant[0], secant[1])
    slopes[-1] = _end_slope(float(h[-1, 0]), float(h[-2, 0]), secant[-1], secant[-2])
    return slopes


def _end_slope(h0: float, h1: float, secant0: Array, secant1: Array) -> Array:
    """One-sided three-point slope, limited so that the end piece keeps its shape."""
    slope = ((2.0 * h0 + h1) * secant0 - h0 * secant1) / (h0 + h1)
    turned = np.sign(slope) != np.sign(secant0)
    steep = (np.sign(secant0) != np.sign(secant1)) & (np.abs(slope) > 3.0 * np.abs(secant0))
    return np.where(turned, 0.0, np.where(steep, 3.0 * secant0, slope))


@dataclass(frozen=True, slots=True, eq=False)
class Interpolant:
    """Columns y (n, m) over strictly increasing knots x (n,); `slopes` (n, m) is used by "pchip" only."""

    x: Array
    y: Array
    kind: Kind
    slopes: Array

    @classmethod
    def through(cls, x: Array, y: Array, kind: Kind) -> Interpolant:
        x, y = np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)
        return cls(x, y, kind, pchip_slopes(x, y) if kind == "pchip" else np.zeros_like(y))

    def __call__(self, q: Array) -> Array:
        """(k, m) values at q (k,); the end value outside the knots."""
        q = np.clip(q, self.x[0], self.x[-1])
        i = np.clip(np.searchsorted(self.x, q, side="right") - 1, 0, len(self.x) - 2)
        h = (self.x[i + 1] - self.x[i])[:, None]
        s = (q - self.x[i])[:, None] / h
        y0, y1 = self.y[i], self.y[i + 1]
        if self.kind == "linear":
            return y0 + s * (y1 - y0)
        m0, m1 = h * self.slopes[i], h * self.slopes[i + 1]
        rise = y1 - y0
        return y0 + s * (m0 + s * ((3.0 * rise - 2.0 * m0 - m1) + s * (m0 + m1 - 2.0 * rise)))

    def inside(self, q: Array) -> npt.NDArray[np.bool_]:
        """(k,) True where q lies within the knots."""
        return np.asarray((q >= self.x[0]) & (q <= self.x[-1]))

    def second_derivatives(self) -> tuple[Array, Array]:
        """(n-1, m) second derivative at the start and at the end of each piece; it is linear between."""
        h = np.diff(self.x)[:, None]
        secant = np.diff(self.y, axis=0) / h
        if self.kind == "linear":
            return np.zeros_like(secant), np.zeros_like(secant)
        m0, m1 = self.slopes[:-1], self.slopes[1:]
        return (6.0 * secant - 4.0 * m0 - 2.0 * m1) / h, (2.0 * m0 + 4.0 * m1 - 6.0 * secant) / h

    def max_curvature(self) -> Array:
        """(m,) largest absolute second derivative inside the pieces."""
        start, end = self.second_derivatives()
        return np.asarray(np.abs([start, end]).max(axis=(0, 1)))

    def max_slope(self) -> Array:
        """(m,) largest absolute first derivative: at a knot, or where the second derivative vanishes."""
        secant = np.diff(self.y, axis=0) / np.diff(self.x)[:, None]
        if self.kind == "linear":
            return np.asarray(np.abs(secant).max(axis=0))
        m0, m1 = self.slopes[:-1], self.slopes[1:]
        start, end = self.second_derivatives()
        change = end - start
        share = np.clip(-start / np.where(change == 0.0, 1.0, change), 0.0, 1.0)
        h = np.diff(self.x)[:, None]
        between = m0 + h * share * (start + 0.5 * share * change)
        return np.asarray(np.abs([m0, m1, between]).max(axis=(0, 1)))


@dataclass(frozen=True, slots=True, eq=False)
class DenseTable:
    """Piecewise linear columns on fine nodes. `constant` has the number of each column that is the same
    everywhere, and None of those that vary. Of these (v, count) `value` holds the values at the nodes, and
    `rise` how much they rise over the cells.

    `nodes` is None for a uniform grid from `low` with `step`. Else it holds the nodes, `rise` is the slope,
    and `step` is the widest cell. Then `guide` gives the cell at the start of each of many equal bins, none
    of which holds two nodes (None: bisect).
    """

    low: float
    step: float
    count: int
    nodes: Array | None
    constant: tuple[float | None, ...]
    value: Array
    rise: Array
    guide: npt.NDArray[np.intp] | None = None

    @classmethod
    def empty(cls) -> DenseTable:
        """A table without columns."""
        none = np.zeros((0, 1))
        return cls(0.0, 1.0, 1, None, (), none, none)

    @classmethod
    def of(
        cls, low: float, step: float, nodes: Array | None, values: Array, guide: npt.NDArray[np.intp] | None
    ) -> DenseTable:
        """The table of columns `values` (count, m) at the nodes."""
        same = np.all(values == values[0], axis=0).tolist()
        constant = tuple(float(first) if one else None for first, one in zip(values[0], same, strict=True))
        value = np.ascontiguousarray(values.T[[not one for one in same]])
        rise = np.zeros_like(value)
        rise[:, :-1] = np.diff(value) if nodes is None else np.diff(value) / np.diff(nodes)
        return cls(low, step, len(values), nodes, constant, read_only(value), read_only(rise), guide)

    def at_nodes(self) -> Array:
        """(count, m) the columns at the nodes."""
        varying = iter(self.value)
        columns = [next(varying) if one is None else np.full(self.count, one) for one in self.constant]
        return np.stack(columns, axis=1) if columns else np.zeros((self.count, 0))

    def lookup(self, q: Array) -> list[Column]:
        """One (k,) array, or a float where constant, per column at finite q (k,); end values outside."""
        if not len(self.value):
            return [one for one in self.constant if one is not None]
        index, rest = self._locate(q)
        # all columns in one call
        columns = self.rise.take(index, axis=1)
        columns *= rest
        columns += self.value.take(index, axis=1)
        varying = iter(columns)
        return [next(varying) if one is None else one for one in self.constant]

    def _locate(self, q: Array) -> tuple[npt.NDArray[np.intp], Array]:
        if self.nodes is not None:
            return self._locate_node(np.clip(q, self.nodes[0], self.nodes[-1]), self.nodes)
        u = q - self.low
        u *= 1.0 / self.step
        np.clip(u, 0.0, self.count - 1.0, out=u)
        floor = np.floor(u)
        u -= floor
        return floor.astype(np.intp), u

    def _locate_node(self, q: Array, nodes: Array) -> tuple[npt.NDArray[np.intp], Array]:
        if self.guide is None:
            index = np.searchsorted(nodes, q, side="right") - 1
            return index, q - nodes[index]
        bin_position = q - self.low
        bin_position *= (len(self.guide) - 1) / (nodes[-1] - nodes[0])
        index = self.guide.take(bin_position.astype(np.intp), mode="clip")
        # Rounding may give the neighbouring bin: one step in either direction mends it.
        index -= nodes.take(index, mode="clip") > q
        index += nodes.take(index + 1, mode="clip") <= q
        np.clip(index, 0, self.count - 1, out=index)
        return index, q - nodes.take(index, mode="clip")


def dense_table(
    knots: Array,
    evaluate: Callable[[Array], Array],
    curvature: Sequence[float],
    tolerance: Sequence[float],
) -> DenseTable:
    """Resample the columns of `evaluate` (q (k,) -> (k, m)) from the first to the last of the
    strictly increasing `knots`.

    Every knot becomes a node, so piecewise linear data are exact. Within MAX_CELLS, cells are as short as the
    column of greatest curvature needs for its tolerance (error of linear interpolation: step^2 / 8 x
    curvature). Knots on no common grid give a non-uniform table.
    """
    needed = [math.sqrt(8.0 * t / c) for t, c in zip(tolerance, curvature, strict=True) if c > 0.0]
    fine = min(needed, default=math.inf)
    low, span = float(knots[0]), float(knots[-1] - knots[0])
    base = _common_step(knots)
    if base is not None:
        cells = round(span / base)
        split = max(1, min(math.ceil(base / fine), MAX_CELLS // cells))
        step, count = base / split, cells * split + 1
        positions = low + step * np.arange(count, dtype=np.float64)
        return DenseTable.of(low, step, None, evaluate(positions), None)
    widths = np.diff(knots)
    fine = max(fine, span / max(1, MAX_CELLS - len(widths)))
    pieces = np.maximum(1, np.ceil(widths / fine)).astype(np.intp)
    parts = [a + (b - a) * np.arange(k) / k for a, b, k in zip(knots[:-1], knots[1:], pieces, strict=True)]
    nodes = np.concatenate([*parts, knots[-1:]])
    return DenseTable.of(low, float(np.diff(nodes).max()), nodes, evaluate(nodes), _guide(nodes))


def _guide(nodes: Array) -> npt.NDArray[np.intp] | None:
    """Cell at the start of each bin, bins shorter than the shortest cell; None where that takes too many."""
    span = float(nodes[-1] - nodes[0])
    bins = math.ceil(1.01 * span / float(np.diff(nodes).min()))
    if bins > 4 * MAX_CELLS:
        return None
    starts = nodes[0] + span * (np.arange(bins + 1) / bins)
    return np.asarray(np.clip(np.searchsorted(nodes, starts, side="right") - 1, 0, len(nodes) - 1), np.intp)


def _common_step(knots: Array) -> float | None:
    """The widest step, a simple fraction of the narrowest spacing, on whose multiples all knots lie."""
    span = float(knots[-1] - knots[0])
    narrowest = float(np.diff(knots).min())
    for parts in range(1, 11):
        cells = round(span / narrowest * parts)
        if cells > MAX_CELLS:
            return None
        step = span / cells
        steps = (knots - knots[0]) / step
        if float(np.abs(steps - np.round(steps)).max()) * step < ON_GRID_MM:
            return step
    return None
