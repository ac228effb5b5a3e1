"""Triangles as a complete binary tree of boxes, in flat arrays: each level halves the groups of the level
above."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass

#: triangles of a leaf
LEAF = 4


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """`triangle` (k, 3, 3) in the order of the leaves, `LEAF` to each, the last ones repeated to fill it;
    `index` (k,) their numbers in the mesh. `low`, `high`: a (2^l, 3) array of box corners for each level l,
    the root first; the children of node i are 2 i and 2 i + 1."""

    triangle: Array
    index: Index
    low: tuple[Array, ...]
    high: tuple[Array, ...]

    @staticmethod
    def of(triangle: Array) -> Tree:
        """The tree of m > 0 triangles (m, 3, 3): each group is halved at the median of its longest side."""
        count = len(triangle)
        depth = max(int(np.ceil(np.log2(count / LEAF))), 0)
        order = np.minimum(np.arange(LEAF << depth), count - 1)[None]
        centre = triangle.mean(axis=1)
        for _ in range(depth):
            group = centre[order]
            axis = (group.max(axis=1) - group.min(axis=1)).argmax(axis=1)
            key = np.take_along_axis(group, axis[:, None, None], axis=2)[..., 0]
            half = order.shape[1] // 2
            order = np.take_along_axis(order, np.argpartition(key, half, axis=1), axis=1).reshape(-1, half)
        index = order.reshape(-1)
        sorted_ = np.ascontiguousarray(triangle[index])
        low = [sorted_.min(axis=1).reshape(-1, LEAF, 3).min(axis=1)]
        high = [sorted_.max(axis=1).reshape(-1, LEAF, 3).max(axis=1)]
        while len(low[0]) > 1:
            low.insert(0, low[0].reshape(-1, 2, 3).min(axis=1))
            high.insert(0, high[0].reshape(-1, 2, 3).max(axis=1))
        return Tree(sorted_, index, tuple(low), tuple(high))


def box_distance(low: Array, high: Array, wide: Array, other_low: Array, other_high: Array) -> Array:
    """(n,) lower bounds of the distance between boxes widened by the radius `wide` (n,) about Z, and other
    boxes."""
    gap = np.maximum(low - other_high, other_low - high)
    np.maximum(gap, 0.0, out=gap)
    x, y, z = gap[:, 0], gap[:, 1], gap[:, 2]
    aside = np.maximum(np.sqrt(x * x + y * y) - wide, 0.0)
    return np.asarray(np.sqrt(aside * aside + z * z), float)
