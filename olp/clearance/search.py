"""The nearest triangle to each of many swept parts: by boxes, separating planes and distances."""

from __future__ import annotations

import numpy as np

from olp.clearance.distance import Swept, nearest
from olp.clearance.tree import LEAF, Tree, box_distance
from olp.core.arrays import Array, Index
from olp.core.values import dataclass

#: mm; triangles nearer than the nearest so far by less than this are not searched for
CLOSE_MM = 1e-4
#: mm; largest distance that is computed for bodies of metres in contact
CONTACT_MM = 5e-4
#: swept parts that go down the tree together
_CHUNK = 1 << 12
#: one in this many swept parts is searched first, as a guess for the others
_STRIDE = 16
#: separating planes that are tried before a distance is measured
_PLANES = 4
#: leaves per block, which bounds the memory
_MOST = 1 << 18
#: boxes per swept part above which a better guess is made
_WIDE = 6


@dataclass(frozen=True, slots=True, eq=False)
class Best:
    """The nearest triangle so far of n blocks: (n,) `distance_mm`, inf without one; (n, 3) `point_mm` of the
    `triangle` (n, 3, 3); (n, 3) `away` towards it; (n,) the caller's number `tag` for its source."""

    distance_mm: Array
    point_mm: Array
    away: Array
    triangle: Array
    tag: Index

    @staticmethod
    def of(count: int, within_mm: float = np.inf) -> Best:
        """No triangle yet; those farther than `within_mm` are not searched for."""
        return Best(
            np.full(count, within_mm), np.full((count, 3), np.nan), np.zeros((count, 3)),
            np.full((count, 3, 3), np.nan), np.full(count, -1, np.int64),
        )  # fmt: skip

    def limit(self, block: Index) -> Array:
        """The distance below which a pair is of interest."""
        return self.distance_mm[block] - CLOSE_MM

    def take(self, swept: Swept, block: Index, triangle: Array, tag: int) -> Array:
        """Measure pairs and keep the nearer ones; (n, 3) normals of planes that separate them."""
        measured = nearest(swept, triangle, self.limit(block))
        order = np.argsort(-measured.distance_mm, kind="stable")
        order = order[measured.distance_mm[order] < self.distance_mm[block[order]]]
        # of several pairs of a block the nearest is written last
        to = block[order]
        self.distance_mm[to] = measured.distance_mm[order]
        self.point_mm[to], self.away[to] = measured.point_mm[order], measured.away[order]
        self.triangle[to], self.tag[to] = triangle[order], tag
        return measured.away


def search(tree: Tree, swept: Swept, block: Index, best: Best, tag: int) -> None:
    """Put into `best` the triangles of a tree nearest to n swept parts, each of its `block` (n,).

    It is fastest where parts that follow one another in the arrays are near one another. Distances are those
    of the nearest triangle, or larger by at most `CLOSE_MM`.
    """
    for a in range(0, len(swept), _CHUNK):
        rows = np.arange(a, min(a + _CHUNK, len(swept)))
        some = rows[::_STRIDE]
        _Group.of(tree, swept.take(some), block[some], best, tag).run()
        group = _Group.of(tree, swept.take(rows), block[rows], best, tag)
        # the triangle nearest to one part is nearly so to its neighbours
        nearby = block[some][np.arange(len(rows)) // _STRIDE]
        for guess in (nearby, block[some][np.minimum(np.arange(len(rows)) // _STRIDE + 1, len(some) - 1)]):
            use = np.flatnonzero(best.tag[guess] == tag)
            best.take(group.swept.take(use), group.block[use], best.triangle[guess[use]], tag)
        group.run()


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Swept parts that go down a tree together, with the boxes around them."""

    tree: Tree
    swept: Swept
    block: Index
    low: Array
    high: Array
    wide: Array
    best: Best
    tag: int

    @staticmethod
    def of(tree: Tree, swept: Swept, block: Index, best: Best, tag: int) -> _Group:
        low, high = swept.bounds()
        return _Group(tree, swept, block, low, high, swept.radius.max(axis=1), best, tag)

    def run(self) -> None:
        """Measure all triangles that may be nearer than the best so far."""
        tree, best, block = self.tree, self.best, self.block
        far = box_distance(self.low, self.high, self.wide, tree.low[0][:1], tree.high[0][:1])
        part = np.flatnonzero(far < best.limit(block))
        node = np.zeros(len(part), np.int64)
        self._guess(part, node, 0)
        away, reach = self._planes()
        for level in range(1, len(tree.low)):
            part, node = np.repeat(part, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
            part, node, far = self._near(part, node, level, away, reach)
            if len(part) > _WIDE * len(block):
                # too many boxes: a guess from the nearest box of each block, then filter again
                order = np.lexsort((far, block[part]))
                first = order[np.flatnonzero(np.diff(block[part[order]], prepend=-1))]
                self._guess(part[first], node[first], level)
                away, reach = self._planes()
                part, node, far = self._near(part, node, level, away, reach)
        if len(part) > _MOST and len(block) > 1:
            for half in np.array_split(np.arange(len(block)), 2):
                _Group.of(tree, self.swept.take(half), block[half], best, self.tag).run()
            return
        part = np.repeat(part, LEAF)
        self._leaves(part, (LEAF * node[:, None] + np.arange(LEAF)).reshape(-1))

    def _near(
        self, part: Index, node: Index, level: int, away: Array, reach: Array
    ) -> tuple[Index, Index, Array]:
        """The pairs of parts and boxes of a level that may contain something nearer, and their bounds."""
        low, high = self.tree.low[level][node], self.tree.high[level][node]
        far = box_distance(self.low[part], self.high[part], self.wide[part], low, high)
        # a plane that separates the nearest triangle may separate the box as well
        direction = away[part]
        corner = np.where(direction > 0, low, high)
        far = np.maximum(far, np.einsum("ij,ij->i", corner, direction) - reach[part])
        keep = np.flatnonzero(far < self.best.limit(self.block[part]))
        return part[keep], node[keep], far[keep]

    def _guess(self, part: Index, node: Index, level: int) -> None:
        """Measure a triangle that is probably near: from a box down to the nearer child, by the distance of
        the centres where both are equally near."""
        low, high, wide = self.low[part], self.high[part], self.wide[part]
        middle = 0.5 * (low + high)
        for level_low, level_high in zip(
            self.tree.low[level + 1 :], self.tree.high[level + 1 :], strict=True
        ):
            far = []
            for child in (2 * node, 2 * node + 1):
                box_low, box_high = level_low[child], level_high[child]
                off = 0.5 * (box_low + box_high) - middle
                aside = 1e-6 * np.sqrt(np.einsum("ij,ij->i", off, off))
                far.append(box_distance(low, high, wide, box_low, box_high) + aside)
            node = 2 * node + (far[1] < far[0])
        self.best.take(self.swept.take(part), self.block[part], self.tree.triangle[LEAF * node], self.tag)

    def _planes(self) -> tuple[Array, Array]:
        """Of each part (n, 3) the direction towards the nearest triangle so far of its block, and (n,) how
        far it reaches in that direction."""
        away = self.best.away[self.block]
        point = self.swept.start + self.swept.support(away)
        return away, np.einsum("ij,ij->i", point, away)

    def _leaves(self, part: Index, face: Index) -> None:
        """Measure triangles that may be nearer, the nearest bounds first."""
        best = self.best
        corner = self.tree.triangle[face]
        far = box_distance(
            self.low[part], self.high[part], self.wide[part], corner.min(axis=1), corner.max(axis=1)
        )
        take = 1
        while part.size:
            keep = np.flatnonzero(far < best.limit(self.block[part]))
            part, face, far = part[keep], face[keep], far[keep]
            away, reach = self._planes()
            ahead = np.einsum("ijk,ik->ij", self.tree.triangle[face], away[part]).min(axis=1)
            far = np.maximum(far, ahead - reach[part])
            keep = np.flatnonzero(far < best.limit(self.block[part]))
            part, face, far = part[keep], face[keep], far[keep]
            owner = self.block[part]
            order = np.lexsort((far, owner))
            part, face, far, owner = part[order], face[order], far[order], owner[order]
            begin = np.flatnonzero(np.diff(owner, prepend=-1))
            rank = np.arange(len(owner)) - np.repeat(begin, np.diff(np.append(begin, len(owner))))
            now, later = np.flatnonzero(rank < take), np.flatnonzero(rank >= take)
            planes = np.zeros((len(owner), 3))
            planes[now] = best.take(
                self.swept.take(part[now]), owner[now], self.tree.triangle[face[now]], self.tag
            )
            first = (np.arange(len(owner)) - rank)[later]
            part, face, far = part[later], face[later], far[later]
            # planes that separate other triangles of the block, the last first: often of the same face
            for back in range(min(take, _PLANES) if part.size else 0):
                gap = self.swept.take(part).gap(self.tree.triangle[face], planes[first + take - 1 - back])
                far = np.maximum(far, gap)
                keep = np.flatnonzero(far < best.limit(self.block[part]))
                part, face, far, first = part[keep], face[keep], far[keep], first[keep]
            take *= 2
