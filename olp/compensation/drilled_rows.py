"""Runs of holes and the rows between them, which are written together: which rows these are, and where the
tool axis is before and behind each run."""

from __future__ import annotations

import numpy as np

from olp.compensation.rows import Rows
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Frame
from olp.core.values import dataclass
from olp.program.holes import Holes


@dataclass(frozen=True, slots=True, eq=False)
class DrilledRows:
    """Rows of a chunk with `runs` of holes (k,), each by its first hole.

    (m,) `block` are the first holes of the blocks of cycles, and `run` is that of each. (n,) `items` are the
    rows between the holes, and the first row of each block: among them blocks have their `place` (m,), and
    the others are `plain`. (n,) `counting` marks rows in G91, and `stretch` grows where holes begin or end.
    The rows of all `strokes` are one behind the other, `count` (m,) of each block.
    """

    runs: Index
    block: Index
    run: Index
    items: Index
    place: Index
    plain: Index
    counting: Mask
    stretch: Index
    strokes: Index
    count: Index

    @staticmethod
    def of(holes: Holes, bounds: Index, rows: Rows, a: int, b: int) -> DrilledRows:
        """Of rows `a`..`b` and runs of holes with these bounds (k + 1,)."""
        begin, end = int(bounds[0]), int(bounds[-1])
        block = begin + np.flatnonzero(holes.repeat[begin:end] == 0)
        row = rows.move.searchsorted(holes.first[block])
        flag = rows.flag[a:b]
        cycle = (flag & np.uint8(Flag.CYCLE)) != 0
        edge = np.zeros(b - a, bool)
        edge[1:] = cycle[1:] != cycle[:-1]
        run = np.searchsorted(bounds, block, "right") - 1
        edge[row[np.searchsorted(block, bounds[:-1])] - a] = True
        among = ~cycle
        among[row - a] = True
        items = np.flatnonzero(among)
        moves = holes.last[begin:end] - holes.first[begin:end]
        return DrilledRows(
            runs=bounds[:-1],
            block=block,
            run=run,
            items=items + a,
            place=np.searchsorted(items, row - a),
            plain=np.flatnonzero(~cycle[items]),
            counting=(flag[items] & np.uint8(Flag.INCREMENTAL)) != 0,
            stretch=np.cumsum(edge)[items],
            strokes=a + np.flatnonzero(cycle),
            count=np.add.reduceat(moves, block - begin),
        )

    def lasts(self) -> Index:
        """(k,) the last block of each run."""
        return np.append(np.flatnonzero(np.diff(self.run)), len(self.run) - 1)


class Heights:
    """Where the tool axis is behind each run, from one to the next. It is at the R level, (m,) `level` of its
    blocks as written. Where not all return `to_r`, it is where it was before the series, if that is higher.
    The series in force before has a `number`, and begins at the program coordinate `initial`."""

    def __init__(
        self, drilled: DrilledRows, holes: Holes, frames: list[Frame], level: Array, to_r: Mask, number: int,
        initial: float,
    ) -> None:  # fmt: skip
        self.number, self.initial = number, initial
        self._drilled, self._level, self._to_r = drilled, level, to_r
        third, lasts = PLANES[holes.plane[drilled.block[0]]][2], drilled.lasts()
        self._runs = list(zip(
            holes.series[drilled.runs].tolist(),
            drilled.stretch[drilled.place[lasts]].tolist(),
            [(frame.offset_mm[third], frame.unit_mm) for frame in frames],
            level[lasts].tolist(),
            to_r[lasts].tolist(),
            strict=True,
        ))  # fmt: skip
        #: where the axis was before the series of each run that is reached
        self._before: list[float] = []

    def after(self, stretch: int, before: float) -> float:
        """Where the axis is as a stretch begins, if the plain one before left it at `before`."""
        for number, own, (offset, unit), level, to_r in self._runs[len(self._before) :]:
            if own >= stretch:
                break
            if number != self.number:
                self.number, self.initial = number, (before - offset) / unit
            base = self.initial * unit + offset
            self._before.append(base)
            before = level if to_r or level > base else base
        return before

    def emitted(self, before: float) -> Array:
        """(m,) where the axis is behind each block; the last plain stretch left it at `before`."""
        self.after(int(self._drilled.stretch[-1]) + 1, before)
        base = np.array(self._before)[self._drilled.run]
        return np.where(self._to_r | (self._level > base), self._level, base)
