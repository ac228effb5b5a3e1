"""Connected feed moves of one level: what contours, walls and flat areas are found in."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass
from olp.review.features.moves import Does, Moves

#: Shares of arcs at which the box around them is taken.
_SHARES = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """The m moves of c chains, in program order. (m,) `row` of the move, `chain` and `length_mm`; (m, 3)
    `start` and `end`, the third coordinate along the tool axis. Of arcs (m, 2) `centre` and (m,) `sweep` in
    rad, 0 of lines. (c + 1,) `first`: where each chain begins. (c,) `closed`: it ends where it began."""

    row: Index
    chain: Index
    start: Array
    end: Array
    centre: Array
    sweep: Array
    length_mm: Array
    first: Index
    closed: Mask

    def __len__(self) -> int:
        return len(self.closed)

    def linked(self) -> Mask:
        """(m,) moves that the next one of the same chain follows."""
        follows = np.zeros(len(self.row), bool)
        follows[:-1] = self.chain[:-1] == self.chain[1:]
        return follows

    @property
    def straight(self) -> Mask:
        """(m,) moves that are lines."""
        return np.asarray(self.sweep == 0.0)

    def points(self, which: Index, share: Array) -> Array:
        """(k, 2) points across the tool axis, at shares (k,) of some of the moves."""
        start, end = self.start[which, :2], self.end[which, :2]
        point = start + share[:, None] * (end - start)
        turned = np.flatnonzero(self.sweep[which] != 0.0)
        arc = which[turned]
        arm, last = (side[turned] - self.centre[arc] for side in (start, end))
        angle = np.arctan2(arm[:, 1], arm[:, 0]) + share[turned] * self.sweep[arc]
        radius = np.hypot(*arm.T) + share[turned] * (np.hypot(*last.T) - np.hypot(*arm.T))
        point[turned] = self.centre[arc] + radius[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=1)
        return point

    def box(self, which: Index) -> tuple[Array, Array]:
        """(3,) lowest and highest coordinates of some of the moves, arcs at steps of a sixteenth."""
        flat = self.points(np.repeat(which, len(_SHARES)), np.tile(_SHARES, len(which)))
        level = self.start[which, 2]
        low, high = flat.min(axis=0), flat.max(axis=0)
        return np.append(low, level.min()), np.append(high, level.max())

    def sums(self, values: Array) -> Array:
        """(c,) sums of values (m,) by chain."""
        return np.asarray(np.bincount(self.chain, values, len(self)), float)


def chains_of(moves: Moves) -> Chains:
    """The chains of a path. Of a freeform stretch only those that end where they began: its level lines are
    no walls."""
    does = moves.does
    some = np.flatnonzero(does != Does.NOTHING)
    level = (does[some] == Does.LEVEL) | (does[some] == Does.LEVEL_ARC)
    stretch = moves.stretch[some]
    new = level.copy()
    new[1:] &= ~level[:-1] | (stretch[1:] != stretch[:-1])
    number = np.cumsum(new)[level] - 1
    row, begin = some[level], np.flatnonzero(new)
    if not len(row):
        return _gathered(moves, row, number, np.zeros(0, bool))
    first = np.searchsorted(number, np.arange(len(begin) + 1))
    start, _ = moves.ends(row[first[:-1]])
    _, end = moves.ends(row[first[1:] - 1])
    closed = np.abs(end - start).max(axis=1) <= moves.near_mm
    kept = ~moves.freeform[moves.stretch[row[first[:-1]]]] | (closed & (np.diff(first) > 2))
    mine = kept[number]
    return _gathered(moves, row[mine], (np.cumsum(kept) - 1)[number[mine]], closed[kept])


def there_and_back(moves: Moves, chains: Chains) -> Mask:
    """(c,) chains of lines that go from a rapid along one line, and back on it to where they began."""
    begin = chains.start[chains.first[:-1], :2]
    away = chains.end[:, :2] - begin[chains.chain]
    size = np.hypot(away[:, 0], away[:, 1])
    farthest = np.zeros(len(chains))
    np.maximum.at(farthest, chains.chain, size)
    # the farthest point of each chain, and how far the others are from the line to it
    tip = np.zeros((len(chains), 2))
    reached = size >= farthest[chains.chain]
    tip[chains.chain[reached]] = away[reached]
    along = tip / np.maximum(farthest, 1e-12)[:, None]
    off = np.abs(away[:, 0] * along[chains.chain, 1] - away[:, 1] * along[chains.chain, 0])
    good = chains.straight & (off <= moves.near_mm)
    before = moves.before(chains.row[chains.first[:-1]])
    from_rapid = (before >= 0) & (moves.does[np.maximum(before, 0)] == Does.RAPID)
    return np.asarray(chains.closed & from_rapid & (chains.sums((~good).astype(float)) == 0.0))


def _gathered(moves: Moves, row: Index, chain: Index, closed: Mask) -> Chains:
    start, end = moves.ends(row)
    centre, sweep = np.zeros((len(row), 2)), np.zeros(len(row))
    turned = np.flatnonzero(moves.does[row] == Does.LEVEL_ARC)
    # moves of arcs rise, as they are in program order
    arc = np.searchsorted(moves.path.arcs.move, row[turned])
    centre[turned] = moves.placed(row[turned], moves.path.arcs.centre_mm[arc])[:, :2]
    sweep[turned] = moves.path.arcs.sweep_rad[arc] * moves.sense(
        row[turned], moves.path.arcs.plane[arc].astype(np.int64)
    )
    first = np.searchsorted(chain, np.arange(len(closed) + 1))
    return Chains(row, chain, start, end, centre, sweep, moves.length_mm[row], first, closed)
