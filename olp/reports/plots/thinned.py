"""Deviations along a path in the memory of a figure: they come in parts, and no figure needs more of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.comparison.figures import Run
from olp.comparison.path import Path
from olp.core.arrays import Array, Index, Mask
from olp.core.units import UM_PER_MM
from olp.program.text.columns import spans

#: Smallest deviation that a logarithmic axis shows, in um.
FLOOR_UM = 1e-2
#: Columns of a plot along the path.
COLUMNS = 900
#: Steps of a decade of sizes.
_STEPS = 16
#: Decades from FLOOR_UM on: up to 10 m.
_DECADES = 9
#: Limits of the classes of a histogram, in um.
EDGES_UM = FLOOR_UM * 10.0 ** (np.arange(_STEPS * _DECADES + 1) / _STEPS)
#: Pixels of the longer side of a path.
_PIXELS = 420
#: Half the width of a line, in pixels.
_HALF = 2
#: Pixels around a path.
_MARGIN = 4
#: Points farther apart than so many usual ones are not joined.
_GAP = 12.0


class Canvas:
    """Pixels of a path in plan view, `shape` rows by columns; `low_mm` is the corner of the first."""

    def __init__(self, path: Path) -> None:
        parts = [path.vertex_mm[some, :2] for some in spans(len(path.vertex_mm))]
        low = np.min([xy.min(axis=0) for xy in parts], axis=0)
        self.span_mm = np.max([xy.max(axis=0) for xy in parts], axis=0) - low
        self.size_mm = max(float(self.span_mm.max()), 1e-6) / _PIXELS
        self.low_mm = low - _MARGIN * self.size_mm
        columns, rows = (np.floor(self.span_mm / self.size_mm).astype(int) + 1 + 2 * _MARGIN).tolist()
        self.shape = (rows, columns)

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top."""
        (x, y), (rows, columns) = self.low_mm.tolist(), self.shape
        return (x, x + columns * self.size_mm, y, y + rows * self.size_mm)

    def lines(self, begin: Array, end: Array) -> tuple[Index, Index]:
        """The pixels of lines from `begin` to `end` (n, 2), as indices of the flat picture, and the line of
        each."""
        steps = np.ceil(np.abs(end - begin).max(axis=1, initial=0.0) / self.size_mm).astype(np.int64) + 1
        line = np.repeat(np.arange(len(steps)), steps)
        share = (np.arange(len(line)) - (np.cumsum(steps) - steps)[line] + 1) / steps[line]
        return self.cells(begin[line] + share[:, None] * (end - begin)[line]), line

    def cells(self, place: Array) -> Index:
        """The pixels of points (n, 2), as indices of the flat picture."""
        cell = np.floor((place - self.low_mm) / self.size_mm).astype(np.int64)
        cell = np.clip(cell, 0, np.array(self.shape[::-1]) - 1)
        return np.asarray(cell[:, 1] * self.shape[1] + cell[:, 0])


def widened(pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A picture whose lines are wider: each pixel becomes the largest about it."""
    rows, columns = pixels.shape
    around = np.pad(pixels, _HALF)
    result = pixels.copy()
    for i, j in product(range(2 * _HALF + 1), repeat=2):
        if (i - _HALF) ** 2 + (j - _HALF) ** 2 <= _HALF**2:
            np.maximum(result, around[i : i + rows, j : j + columns], out=result)
    return result


class Thinned:
    """What figures show of n points. `low` and `high` (COLUMNS,) are the extremes in um in columns along the
    path, NaN where there is none. `count` has the points by EDGES_UM, and `pixels` the largest in each pixel
    of the plan view in um, 0 where there is none."""

    def __init__(self, path: Path, canvas: Canvas) -> None:
        self.canvas = canvas
        self.low, self.high = np.full(COLUMNS, np.nan), np.full(COLUMNS, np.nan)
        self.count = np.zeros(len(EDGES_UM) - 1, np.int64)
        self.pixels = np.zeros(canvas.shape)
        self._column_mm = path.length_mm / COLUMNS

    @property
    def points(self) -> int:
        return int(self.count.sum())

    @property
    def largest_um(self) -> float:
        return float(self.pixels.max())

    def add(self, run: Run) -> None:
        """The points of a run that count, in order."""
        rows = np.flatnonzero(run.counted)
        if not rows.size:
            return
        size = np.maximum(run.size_mm[rows] * UM_PER_MM, FLOOR_UM)
        s_mm = run.pairing.s_mm[rows]
        column = np.clip((s_mm / self._column_mm).astype(np.int64), 0, COLUMNS - 1)
        np.fmin.at(self.low, column, size)
        np.fmax.at(self.high, column, size)
        step = np.clip((np.log10(size / FLOOR_UM) * _STEPS).astype(np.int64), 0, len(self.count) - 1)
        self.count += np.bincount(step, minlength=len(self.count))
        xy = run.nominal_mm[rows, :2]
        begin = np.concatenate((xy[:1], xy[:-1]))
        begin = np.where(self._joined(rows, xy)[:, None], begin, xy)
        pixel, point = self.canvas.lines(begin, xy)
        np.maximum.at(self.pixels.reshape(-1), pixel, size[point])

    @staticmethod
    def _joined(rows: Index, xy: Array) -> Mask:
        """(n,) points with a line from the one before."""
        step = np.sqrt((np.diff(xy, axis=0, prepend=xy[:1]) ** 2).sum(axis=1))
        return np.asarray(step < _GAP * max(float(np.quantile(step, 0.9)), 1e-6))


Groups = Mapping[str, Thinned]


def painted(path: Path, canvas: Canvas) -> npt.NDArray[np.bool_]:
    """The pixels of the cutting moves of a path."""
    pixels = np.zeros(canvas.shape, bool)
    xy = path.vertex_mm[:, :2]
    for some in spans(len(path)):
        rows, cell = np.flatnonzero(path.cutting[some]), canvas.cells(xy[some.start : some.stop + 1])
        pixels.reshape(-1)[cell[rows]] = True
        # chords of arcs are mostly in one pixel
        rows = some.start + rows[cell[rows] != cell[rows + 1]]
        pixels.reshape(-1)[canvas.lines(xy[rows], xy[rows + 1])[0]] = True
    return widened(pixels)


def thinned(path: Path, runs: Mapping[str, Sequence[Run]]) -> dict[str, Thinned]:
    """Groups of runs that have points that count, as figures show them."""
    canvas = Canvas(path)
    groups = {name: Thinned(path, canvas) for name in runs}
    for name, members in runs.items():
        for run in members:
            groups[name].add(run)
    return {name: group for name, group in groups.items() if group.points}
