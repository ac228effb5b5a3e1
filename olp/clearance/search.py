"""The nearest triangle to each of many swept parts: boxes first, then planes known to separate, then distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.clearance.distance import Array, Index, Swept, nearest
from olp.clearance.tree import LEAF, Tree, box_distance

#: what is nearer than the nearest found so far by less than this is not looked for, in mm
CLOSE_MM = 1e-4
#: swept parts that go down the tree together
_CHUNK = 1 << 12


@dataclass(frozen=True, slots=True, eq=False)
class Best:
    """The nearest found so far of n blocks: (n,) `distance_mm`, inf where there is none yet; (n, 3) `point_mm` of a
    triangle; (n, 3) `away` towards it; (n,) `tag`, a number that the caller gives to what was nearest."""

    distance_mm: Array
    point_mm: Array
    away: Array
    tag: Index

    @staticmethod
    def of(count: int) -> Best:
        return Best(
            np.full(count, np.inf), np.full((count, 3), np.nan), np.zeros((count, 3)), np.full(count, -1, np.int64)
        )

    def _limit(self, block: Index) -> Array:
        """What a pair has to be nearer than to matter."""
        return self.distance_mm[block] - CLOSE_MM

    def take(self, swept: Swept, block: Index, triangle: Array, tag: int) -> None:
        """Measure pairs and keep what is nearer."""
        found = nearest(swept, triangle, self._limit(block))
        order = np.argsort(-found.distance_mm, kind="stable")
        order = order[found.distance_mm[order] < self.distance_mm[block[order]]]
        # of several pairs of a block the nearest is written last
        to = block[order]
        self.distance_mm[to] = found.distance_mm[order]
        self.point_mm[to], self.away[to] = found.point_mm[order], found.away[order]
        self.tag[to] = tag


def search(tree: Tree, swept: Swept, block: Index, best: Best, tag: int) -> None:
    """Put into `best` what of a tree is nearest to n swept parts, each of the block (n,) it belongs to.

    The distances are those of the nearest triangle, or more than that by at most `CLOSE_MM`.
    """
    low, high = swept.bounds()
    for a in range(0, len(swept), _CHUNK):
        rows = np.arange(a, min(a + _CHUNK, len(swept)))
        _chunk(tree, swept.take(rows), block[rows], low[rows], high[rows], best, tag)


def _chunk(tree: Tree, swept: Swept, block: Index, low: Array, high: Array, best: Best, tag: int) -> None:
    far = box_distance(low, high, tree.low[0][:1], tree.high[0][:1])
    rows = np.flatnonzero(far < best._limit(block))
    if not rows.size:
        return
    first = _first(tree, low[rows], high[rows])
    best.take(swept.take(rows), block[rows], tree.triangle[first], tag)
    part, node = rows, np.zeros(len(rows), np.int64)
    for level_low, level_high in zip(tree.low[1:], tree.high[1:], strict=True):
        part, node = np.repeat(part, 2), np.repeat(2 * node, 2)
        node[1::2] += 1
        far = box_distance(low[part], high[part], level_low[node], level_high[node])
        near = far < best._limit(block[part])
        part, node = part[near], node[near]
    _leaves(tree, swept, block, low, high, part, node, best, tag)


def _first(tree: Tree, low: Array, high: Array) -> Index:
    """(n,) a triangle that is likely near: down the tree to the nearer child, the one nearer in its middle where
    both are as near."""
    node = np.zeros(len(low), np.int64)
    middle = 0.5 * (low + high)
    for level_low, level_high in zip(tree.low[1:], tree.high[1:], strict=True):
        far = []
        for child in (2 * node, 2 * node + 1):
            box_low, box_high = level_low[child], level_high[child]
            off = 0.5 * (box_low + box_high) - middle
            far.append(
                box_distance(low, high, box_low, box_high) + 1e-6 * np.sqrt(np.einsum("ij,ij->i", off, off))
            )
        node = 2 * node + (far[1] < far[0])
    return LEAF * node


def _leaves(
    tree: Tree, swept: Swept, block: Index, low: Array, high: Array, part: Index, node: Index, best: Best,
    tag: int,
) -> None:  # fmt: skip
    """Measure the triangles of leaves that may be nearer, the likeliest first."""
    part = np.repeat(part, LEAF)
    face = (LEAF * node[:, None] + np.arange(LEAF)).reshape(-1)
    corner = tree.triangle[face]
    far = box_distance(low[part], high[part], corner.min(axis=1), corner.max(axis=1))
    take = 1
    while True:
        keep = far < best._limit(block[part])
        part, face, far = part[keep], face[keep], far[keep]
        if part.size:
            # the plane that separates the nearest triangle separates its neighbours as well
            far = np.maximum(far, swept.take(part).gap(tree.triangle[face], best.away[block[part]]))
            keep = far < best._limit(block[part])
            part, face, far = part[keep], face[keep], far[keep]
        if not part.size:
            return
        order = np.lexsort((far, block[part]))
        part, face, far = part[order], face[order], far[order]
        owner = block[part]
        begin = np.flatnonzero(np.concatenate(([True], owner[1:] != owner[:-1])))
        rank = np.arange(len(owner)) - np.repeat(begin, np.diff(np.append(begin, len(owner))))
        now = rank < take
        best.take(swept.take(part[now]), owner[now], tree.triangle[face[now]], tag)
        part, face, far = part[~now], face[~now], far[~now]
        take *= 2
