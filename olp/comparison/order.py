"""Matching in order along a path by dynamic programming (dynamic time warping, Sakoe and Chiba 1978).

A row of the table is a measured point, a column a node of the path. The match steps down, right, or both. A
point costs the squared distance to its node; a node without a point costs as much, up to a limit. So passes
that look alike are distinguished by the points before and after. Dwelling costs nothing. A part of the path
that was not measured costs little enough to be skipped.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index

Moves = npt.NDArray[np.uint8]

#: rows of a stretch
_ROWS = 960
#: rows by which neighbouring stretches overlap at both ends
_OVERLAP = 64
#: stretches per block
_TOGETHER = 256
#: cost of a node before the first row or behind the last, as a share of a squared node distance
_UNVISITED = 0.25
#: squared distances count up to this many times the usual one
_FAR = 100.0
#: Moves through the table: to the next row at the same node,
_DOWN = np.uint8(0)
#: to the next row and the next node,
_BOTH = np.uint8(1)
#: to the next node in the same row,
_RIGHT = np.uint8(2)
#: or a new start, where no node of the row before is in the band.
_RESTART = np.uint8(3)


def whole(points_mm: Array, nodes_mm: Array, far_mm: float = np.inf) -> tuple[Index, float]:
    """The best node (L,) of L points among K nodes in order, and the cost of the match; L x K cells.

    The first and the last nodes may be skipped. A distance costs no more than `far_mm`, so that points that
    are not on the path, such as those before its start, do not affect the match.
    """
    count, width = len(points_mm), len(nodes_mm)
    step = np.diff(nodes_mm, axis=0)
    most = float((step * step).sum(axis=1).mean())
    idle = _UNVISITED * most * np.arange(width, dtype=float)
    moves = np.empty((count, 1, width), np.uint8)
    total = np.zeros((1, width))
    for i in range(count):
        cost = np.minimum(_square(nodes_mm - points_mm[i]), far_mm * far_mm)[None]
        total, moves[i] = _row(total, cost, most, idle[None] if i == 0 else None)
    end = total[0] + idle[::-1]
    last = int(end.argmin())
    first = np.zeros((count, 1), np.int64)
    ends = np.array([last])
    near = _back(moves, first, ends, np.zeros((count, 1), np.int64), points_mm[:, None], nodes_mm)
    return near[:, 0], float(end[last])


def banded(points_mm: Array, nodes_mm: Array, middle: Index, width: int) -> Index:
    """The best node (L,) of each point within `width` nodes around `middle` (L,), in order.

    Overlapping stretches of rows are processed side by side; where the band jumps, a new match begins.
    """
    count = len(points_mm)
    width = min(width, len(nodes_mm))
    low = np.clip(np.maximum.accumulate(middle) - width // 2, 0, len(nodes_mm) - width)
    step = _square(np.diff(nodes_mm, axis=0)).mean()
    most = max(float(np.median(_square(points_mm - nodes_mm[middle]))), float(step))
    node = np.empty(count, np.int64)
    starts = np.arange(0, count, _ROWS)
    for a in range(0, len(starts), _TOGETHER):
        begin = starts[a : a + _TOGETHER]
        rows = begin[None] - _OVERLAP + np.arange(min(_ROWS, count) + 2 * _OVERLAP)[:, None]
        # rows beyond the ends repeat the end, as dwelling costs nothing
        rows = np.clip(rows, 0, count - 1)
        near = _side_by_side(points_mm[rows], nodes_mm, low[rows], width, most)
        own = slice(_OVERLAP, len(rows) - _OVERLAP)
        node[rows[own].T.ravel()] = near[own].T.ravel()
    return node


def _side_by_side(points: Array, nodes: Array, low: Index, width: int, most: float) -> Index:
    """(R, B) nodes of points (R, B, 3) of B stretches whose bands begin at `low` (R, B)."""
    rows, stretches = low.shape
    moves = np.empty((rows, stretches, width), np.uint8)
    column = np.arange(width)
    best = np.zeros((rows, stretches), np.int64)
    total = np.zeros((stretches, width))
    padded = np.full((stretches, width + 1), np.inf)
    for i in range(rows):
        cost = np.minimum(_square(nodes[low[i][:, None] + column] - points[i][:, None]), _FAR * most)
        if i:
            padded[:, :width] = total
            shift = (low[i] - low[i - 1])[:, None]
            total = np.take_along_axis(padded, np.minimum(column + shift, width), axis=1)
        total, moves[i] = _row(total, cost, most, np.zeros_like(cost) if i == 0 else None)
        best[i] = total.argmin(axis=1)
    return _back(moves, low, best[-1], best, points, nodes)


def _square(away: Array) -> Array:
    x, y, z = away[..., 0], away[..., 1], away[..., 2]
    return np.asarray(x * x + y * y + z * z, float)


def _row(before: Array, cost: Array, most: float, start: Array | None) -> tuple[Array, Moves]:
    """Least costs (B, K) up to a row and the moves there, from the costs of the row before, or from the cost
    to `start` at a node. `most` is the largest cost of a node without a point."""
    entered = before.copy() if start is None else start.copy()
    lost = np.ones(len(entered), bool)
    if start is None:
        np.minimum(entered[:, 1:], before[:, :-1], out=entered[:, 1:])
        lost[:] = ~np.isfinite(entered).any(axis=1)
        entered[lost] = 0.0
    # total_j = min(entered_j + cost_j, total_{j-1} + skipped_j): with sums of skipped a running minimum
    summed = np.cumsum(np.minimum(cost, most), axis=1)
    head = entered + cost - summed
    least = np.minimum.accumulate(head, axis=1)
    moves = np.where(before <= entered, _DOWN, _BOTH)
    moves[lost] = _RESTART
    moves[head > least] = _RIGHT
    return least + summed, moves


def _back(moves: Moves, low: Index, ends: Index, best: Index, points: Array, nodes: Array) -> Index:
    """(R, B) nodes, from the last row up: of the nodes that a row visited, the nearest to its point."""
    rows, stretches, width = moves.shape
    near = np.empty((rows, stretches), np.int64)
    column = np.arange(width)
    which = np.arange(stretches)
    position = ends.copy()
    for i in range(rows - 1, -1, -1):
        stopped = np.where(moves[i] == _RIGHT, 0, column)
        first = np.maximum.accumulate(stopped, axis=1)[which, position]
        choice, least = position.copy(), np.full(stretches, np.inf)
        spans = position - first
        for more in range(int(spans.max()) + 1):
            some = np.flatnonzero(spans >= more)
            node = first[some] + more
            away = _square(nodes[low[i, some] + node] - points[i, some])
            better = away < least[some]
            choice[some[better]], least[some[better]] = node[better], away[better]
        near[i] = low[i] + choice
        if i:
            move = moves[i, which, first]
            up = first + low[i] - low[i - 1] - (move == _BOTH)
            position = np.where(move == _RESTART, best[i - 1], np.clip(up, 0, width - 1))
    return near
