"""How far points are from nominal moves as these lie on the part, along them and across them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index
from olp.core.geometry import ArcShapes, segment_distance
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass

#: Samples through which a smooth curve is laid.
_THROUGH = 5
#: Places per step at which that curve is looked at.
_PLACES = 6


@dataclass(frozen=True, slots=True, eq=False)
class Courses:
    """Nominal moves: (n, 3) where each should `begin` and its `goal`, with 0 along axes that are unknown at
    its end; (n,) its index among the `shapes` of arcs, -1 where it is straight."""

    begin: Array
    goal: Array
    arc: Index
    shapes: ArcShapes

    @staticmethod
    def of(
        nominal: Toolpath, target: TargetRows, a: int, b: int, known: Callable[[Index, Array], Array]
    ) -> Courses:
        """Moves a..b with their ends at `target`; `known` gives points (m, 3) of moves (m,) without unknown
        axes."""
        goal, every = target[a:b], np.arange(a, b)
        begin = np.zeros_like(goal)
        begin[1:] = goal[:-1]
        begin[0] = target[a - 1] if a else np.array(nominal.start_mm)
        number, arcs = arc_index(nominal, a, b), nominal.arcs
        rows = np.flatnonzero(number >= 0)
        number, which, move = np.full(b - a, -1, np.int64), number[rows], a + rows
        number[rows] = np.arange(len(rows))
        shift = goal[rows] - nominal.end_mm[move]
        shapes = ArcShapes.of(
            known(move, nominal.starts_mm(a, b)[rows] + shift), known(move, goal[rows]),
            known(move, arcs.centre_mm[which] + shift), arcs.plane[which], arcs.sweep_rad[which],
        )  # fmt: skip
        return Courses(known(every, begin), known(every, goal), number, shapes)

    def distance(self, point: Array, of: Index, near: Callable[[Index], Array]) -> Array:
        """(m,) distances of points (m, 3) from moves `of` (m,); `near` says of some of them (rows) roughly at
        which share of their arc they lie."""
        if not len(self.shapes.sweep):
            return segment_distance(point, self.begin, self.goal, of)
        arc = self.arc[of]
        curved, straight = np.flatnonzero(arc >= 0), np.flatnonzero(arc < 0)
        distance = np.empty(len(of))
        if straight.size:
            distance[straight] = segment_distance(
                point.take(straight, axis=0), self.begin, self.goal, of[straight]
            )
        distance[curved] = self.shapes.distance(point.take(curved, axis=0), arc[curved], near(curved))
        return distance


def arc_index(path: Toolpath, first: int, last: int) -> Index:
    """(m,) index into the arcs of each of moves `first`..`last`, -1 where it is none."""
    index = np.full(last - first, -1, np.int64)
    some = path.arcs.within(first, last)
    index[path.arcs.move[some] - first] = np.arange(some.start, some.stop)
    return index


def peaks(sides: tuple[Array, Array], count: Index) -> Array:
    """(m,) the largest length that two smooth functions reach together on each of m stretches.

    `sides` (2 x the sum of `count`) are their values at equal steps, `count` (m,) samples of one stretch
    behind those of the other, 5 at the least. Between samples they are the polynomials of fourth degree
    through five: of a sine with 0.6 rad a step that misses 0.25 % of its amplitude at the most, and five
    times less away from the ends."""
    first, second = sides
    square = first * first + second * second
    tail = np.cumsum(count) - 1
    head = tail - count + 1
    most = np.maximum.reduceat(square, head)
    falls, rises = (np.ones(len(square), bool) for _ in range(2))
    falls[:-1], rises[1:] = square[:-1] >= square[1:], square[1:] >= square[:-1]
    falls[tail] = rises[head] = True
    highest = np.flatnonzero(falls & rises)
    of = np.searchsorted(tail, highest)
    base = np.clip(highest - _THROUGH // 2, head[of], tail[of] + 1 - _THROUGH)
    for here in range(_THROUGH):
        some = np.flatnonzero(highest - base == here)
        samples = [[side.take(base[some] + k) for k in range(_THROUGH)] for side in sides]
        best = np.zeros(len(some))
        for weights in _weights(here):
            there = np.zeros(len(some))
            for values in samples:
                value = _sum(weights, values)
                value *= value
                there += value
            np.fmax(best, there, out=best)
        np.maximum.at(most, of[some], best)
    return np.asarray(np.sqrt(most))


def _sum(weights: list[float], columns: list[Array]) -> Array:
    """(n,) the weighted sum of columns (n,), which `@` may add up in another order for another n."""
    total = weights[0] * columns[0]
    for weight, column in zip(weights[1:], columns[1:], strict=True):
        total += weight * column
    return np.asarray(total)


@cache
def _weights(here: int) -> list[list[float]]:
    """What each of five samples counts (k, 5) at places within a step of sample `here`."""
    nodes = np.arange(_THROUGH)
    places = np.arange(max(here - 1, 0) * _PLACES, min(here + 1, _THROUGH - 1) * _PLACES) / _PLACES
    away, apart = places[:, None] - nodes, nodes[:, None] - nodes
    columns = [(np.prod(np.delete(away, j, 1), 1) / np.prod(np.delete(apart[j], j))).tolist() for j in nodes]
    return [list(weights) for weights in zip(*columns, strict=True)]
