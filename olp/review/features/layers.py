"""Deviations of features by layer: of the samples of their moves, or of measured points on them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Array, Index
from olp.proof.proof import Counts
from olp.review.features.base import Deviations
from olp.review.judged import measured_names
from olp.review.measured import Matched
from olp.review.scene import Scene

#: Layers of the model.
MODEL = ("uncorrected", "corrected")


class Layers:
    """The layers of a scene. Only samples of moves that count have a part in figures, and of measured points
    those that count; of a move that counts at its end only, that is its last sample. The start of a move is
    the end of the move before it: it is its first sample, where that move counts, too. `begin` (moves + 1,)
    is the first sample of each move."""

    def __init__(self, scene: Scene) -> None:
        samples = scene.samples
        self._scene = scene
        count = len(scene.nominal.toolpath)
        self._judged = scene.table.judged
        self.begin: Index = np.searchsorted(samples.move, np.arange(count + 1))
        self._points = [
            (matched, _rows_of(matched), samples.move[matched.index[_rows_of(matched)]])
            for matched in scene.measured
        ]
        self.names = (*MODEL, *measured_names(scene))

    def of(self, rows: Index) -> Iterator[tuple[str, Deviations | None]]:
        """The deviations of moves, rows rising, by layer; None where nothing of them counts."""
        own = rows[self._judged[rows]]
        samples, (which, move, weight) = self._scene.samples, self._along(own)
        for name, delta in zip(MODEL, (samples.uncorrected, samples.corrected), strict=True):
            nominal = self._scene.position_mm[which]
            yield name, Deviations(move, nominal, delta[which].astype(float), weight) if len(which) else None
        for name, (matched, some, of) in zip(self.names[len(MODEL) :], self._points, strict=True):
            point, move = _taken(rows, of)
            mine = some[point]
            weight = np.ones(len(mine))
            measured = matched.delta_mm[mine]
            yield name, Deviations(move, matched.base_mm[mine], measured, weight) if len(mine) else None

    def ranges(self, rows: Index) -> Index:
        """(k, 2) the samples of moves, rows rising: first and last of each run."""
        first, last = self.begin[rows], self.begin[rows + 1] - 1
        some = last >= first
        first, last = first[some], last[some]
        if not len(first):
            return np.zeros((0, 2), np.int64)
        new = np.concatenate(([True], first[1:] > last[:-1] + 1))
        return np.stack((first[new], last[np.append(np.flatnonzero(new)[1:] - 1, len(last) - 1)]), axis=1)

    def _along(self, rows: Index) -> tuple[Index, Index, Array]:
        """Samples of moves with their starts: (k,) the sample, the move, and the length of path in mm that
        the sample stands for."""
        samples = self._scene.samples
        rows = rows[self.begin[rows + 1] > self.begin[rows]]
        first, end = self.begin[rows], self.begin[rows + 1]
        point = self._scene.table.counts[rows] == Counts.POINT
        first = np.where(point, end - 1, first)
        before = np.maximum(first - 1, 0)
        reached = samples.joined[first] & (first > 0) & ~point
        started = reached & self._judged[samples.move[before]]
        begin = first - started
        count = end - begin
        which = spread(begin, count)
        move = np.repeat(rows, count)
        step = np.diff(samples.arc_mm[which], prepend=0.0)
        # the first sample of a move stands for the way from its start, where that is no sample of it
        head = np.cumsum(count) - count
        step[head] = np.where(reached & ~started, samples.arc_mm[first] - samples.arc_mm[before], 0.0)
        weight = step / 2.0
        weight[:-1] += np.where(np.diff(move) == 0, step[1:], 0.0) / 2.0
        weight[head] += step[head] / 2.0
        return which, move, weight if weight.sum() > 0.0 else np.ones(len(which))


def _rows_of(matched: Matched) -> Index:
    return np.flatnonzero(matched.counted)


def _taken(rows: Index, of: Index) -> tuple[Index, Index]:
    """The points, whose moves `of` rise, on some moves: (k,) which points, and (k,) the move of each."""
    low, high = np.searchsorted(of, rows, "left"), np.searchsorted(of, rows, "right")
    count = high - low
    return spread(low, count), np.repeat(rows, count)


def spread(begin: Index, count: Index) -> Index:
    """The numbers from each of `begin` on, so many of each."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(begin, count)
