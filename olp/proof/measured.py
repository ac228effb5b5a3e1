"""The measured layer of the table of judgements: what runs on the machine deviate, by move and by line.

A row is a nominal move, or a segment of a nominal file of points. Whatever is said of measured runs by line,
operation or tool comes from here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: Number of lines with the largest deviations in a report.
_WORST = 10

#: States of a line, of all layers.
WITHIN = 0
ABOVE = 1
SHOWN = 2


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Runs by `names`. (n,) `line`, `tool` (-1: none) and `operation` of each nominal move, as in the table.
    `by_run` has (n,) for each run: the largest deviation in um of the points of the move that count, NaN
    where there is none. `tolerance_um` is the part tolerance, None where none is stated."""

    names: tuple[str, ...]
    line: Index
    tool: Index
    operation: Index
    by_run: tuple[Array, ...]
    tolerance_um: float | None

    @staticmethod
    def largest_of(count: int, move: Index, size_um: Array) -> Array:
        """(n,) the largest of the deviations (m,) of points of the moves (m,), of `count` moves; NaN where a
        move has none."""
        largest = np.full(count, np.nan)
        np.fmax.at(largest, move, size_um)
        return largest

    def size_um(self, run: int | None = None) -> Array:
        """(n,) the largest deviation of each move, of one run or of all; NaN where no point counts."""
        if run is not None:
            return self.by_run[run]
        size = np.full(len(self.line), np.nan)
        for one in self.by_run:
            size = np.fmax(size, one)
        return size

    def largest_um(self, run: int | None = None) -> float | None:
        """The largest deviation of a run or of all, None where no point counts."""
        size = self.size_um(run)
        return float(np.nanmax(size)) if np.isfinite(size).any() else None

    @property
    def over(self) -> Mask:
        """(n,) moves with a measured point above the part tolerance."""
        if self.tolerance_um is None:
            return np.zeros(len(self.line), bool)
        return np.asarray(np.nan_to_num(self.size_um()) > self.tolerance_um)

    def by_line(self, run: int | None = None) -> dict[str, npt.NDArray[Any]]:
        """Of each `line` with points that count: `measured_um`, the largest deviation, and `state`: 0 within
        the part tolerance, 1 above, 2 where none is stated."""
        size = self.size_um(run)
        rows = np.isfinite(size)
        lines, row = np.unique(self.line[rows], return_inverse=True)
        largest = np.zeros(len(lines))
        np.maximum.at(largest, row, size[rows])
        state = np.full(len(lines), SHOWN, np.uint8)
        if self.tolerance_um is not None:
            state[:] = np.where(largest > self.tolerance_um, ABOVE, WITHIN)
        return {"line": lines, "measured_um": largest, "state": state}

    def worst(self, count: int = _WORST) -> list[dict[str, Any]]:
        """The lines with the largest deviations of all runs, the largest first."""
        table = self.by_line()
        order = np.lexsort((table["line"], -table["measured_um"]))[:count]
        return [
            {"line": int(table["line"][k]), "max_um": float(table["measured_um"][k])} for k in order.tolist()
        ]

    def lines_over(self) -> list[int]:
        """The lines above the part tolerance, the worst first."""
        table = self.by_line()
        order = np.lexsort((table["line"], -table["measured_um"]))
        return [int(table["line"][k]) for k in order.tolist() if table["state"][k] == ABOVE]

    def report(self) -> dict[str, Any]:
        """The layer by runs, operations and tools, as plain data."""
        runs = [
            {"name": name, "largest_um": self.largest_um(k), "line": self._worst_line(self.size_um(k))}
            for k, name in enumerate(self.names)
        ]
        return {
            "runs": runs,
            "tolerance_um": self.tolerance_um,
            "operations": list(self._group(self.operation)),
            "tools": list(self._group(self.tool)),
        }

    def _worst_line(self, size_um: Array) -> int | None:
        return int(self.line[np.nanargmax(size_um)]) if np.isfinite(size_um).any() else None

    def _group(self, of: Index) -> Iterator[dict[str, Any]]:
        """Of the moves of each value of `of` (n,) with points that count, in order of appearance."""
        size = self.size_um()
        rows = np.flatnonzero(np.isfinite(size))
        values, first, row = np.unique(of[rows], return_index=True, return_inverse=True)
        order = np.argsort(row, kind="stable")
        members = np.split(rows[order], np.cumsum(np.bincount(row, minlength=len(values)))[:-1])
        for k in np.argsort(first).tolist():
            mine = members[k]
            worst = int(mine[size[mine].argmax()])
            yield {
                "first_line": int(self.line[mine].min()),
                "last_line": int(self.line[mine].max()),
                "tool": int(self.tool[worst]) if self.tool[worst] >= 0 else None,
                "measured_um": float(size[worst]),
                "worst_line": int(self.line[worst]),
                "holds": None if self.tolerance_um is None else bool(size[worst] <= self.tolerance_um),
            }
