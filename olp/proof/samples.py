"""Samples inside the moves of a path: where they are taken, and what is known of each."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass

#: Samples at a time: one block of an error model, of which a move more or less makes no second one.
_RUN = 15_000


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples inside parts: the part, the share of it, and where the tip is."""

    part: Index
    share: Array
    actual: Array

    def pick(self, which: Mask) -> Samples:
        """Some of them."""
        rows = np.flatnonzero(which)
        return Samples(self.part.take(rows), self.share.take(rows), self.actual.take(rows, axis=0))

    def with_more(self, other: Samples) -> Samples:
        """These and others."""
        return Samples(
            np.concatenate((self.part, other.part)),
            np.concatenate((self.share, other.share)),
            np.concatenate((self.actual, other.actual)),
        )

    def with_ends(self, cuts: Index, reached: Array) -> Samples:
        """These, and the ends of the parts `cuts`."""
        return self.with_more(Samples(cuts, np.ones(len(cuts)), reached[cuts]))


class Nearness:
    """Where on their nominal arcs samples lie roughly, by the angles of the arcs that these became: moves
    from `first` of a path, of which nominal moves `owner` (m,) became each."""

    def __init__(self, path: Toolpath, first: int, owner: Index) -> None:
        self.path, self.first, self.owner = path, first, owner

    @cached_property
    def _angles(self) -> tuple[Array, Array, Array] | None:
        """(m,) rad of each move and before it on its nominal arc, (n,) of all of a nominal move; None where
        each move became one."""
        owner = self.owner
        if np.array_equal(owner, np.arange(len(owner))):
            return None
        arcs = self.path.arcs.within(self.first, self.first + len(owner))
        size, row = np.abs(self.path.arcs.sweep_rad[arcs]), self.path.arcs.move[arcs] - self.first
        turn = np.zeros(len(owner))
        turn[row] = size
        total = np.bincount(owner[row], size, minlength=int(owner[-1]) + 1)
        return turn, np.cumsum(turn) - turn - (np.cumsum(total) - total)[owner], np.maximum(total, 1e-12)

    def share(self, part: Index, share: Array, of: Index) -> Array:
        """(k,) the share of its nominal move `of` (k,) at which each sample lies, `share` (k,) of `part`."""
        if self._angles is None:
            return share
        turn, before, total = self._angles
        return np.asarray((before[part] + share * turn[part]) / total[of])


def shares_inside(steps: Index) -> tuple[Index, Array]:
    """The move of each sample inside moves of so many equal steps, and its share of the move."""
    count = steps - 1
    part = np.repeat(np.arange(len(steps)), count)
    share = np.arange(1, len(part) + 1) - np.repeat(np.cumsum(count) - count, count)
    return part, share / np.repeat(steps, count)


def kinds(on_arc: Mask, of: Index) -> tuple[Index, Index, Index]:
    """Which samples of moves `of` are on straight moves, which are on arcs, and the index of the arc of these
    among the moves that are arcs."""
    mine = on_arc[of]
    curved = np.flatnonzero(mine)
    return np.flatnonzero(~mine), curved, (np.cumsum(on_arc) - 1)[of[curved]]


def equal_steps(path: Toolpath, step_mm: float) -> Index:
    """(n,) into how many equal steps of `step_mm` at most each move is divided."""
    start, arcs = path.starts_mm(), path.arcs
    length = np.nan_to_num(np.sqrt(((path.end_mm - start) ** 2).sum(axis=1)))
    if len(arcs):
        radius = np.sqrt(np.nansum((start[arcs.move] - arcs.centre_mm) ** 2, axis=1))
        length[arcs.move] = np.maximum(length[arcs.move], radius * np.abs(arcs.sweep_rad))
    return np.asarray(np.maximum(np.ceil(length / step_mm), 1), np.int64)


def between(start: Array, end: Array, part: Index, share: Array) -> Array:
    """(m, 3) points at shares of straight parts, column by column."""
    point = np.empty((3, len(part)))
    for column, begin, course in zip(point, start.T, (end - start).T, strict=True):
        np.multiply(course.take(part), share, out=column)
        column += begin.take(part)
    return point.T


def runs(moves: Index, steps: Index) -> Iterator[Index]:
    """Moves in runs whose samples, `steps` of each of all, are so many that they stay in the cache."""
    if moves.size:
        group = (np.cumsum(steps[moves]) - 1) // _RUN
        yield from np.split(moves, np.flatnonzero(np.diff(group)) + 1)
