"""One axis with backlash follows positions: it turns round only for more than a dead band."""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass

#: An axis that has moved by less than this share of half its backlash may still be on either side.
_FREE = 1e-9
#: mm; positions that differ by less are one.
_STILL_MM = 1e-8


@dataclass(frozen=True, slots=True)
class Rest:
    """Where an axis rests between two rows: the `position` that is wanted of its load and the `load` in mm,
    NaN where they are not known. `side` is the sign of the last motion of the load. `taken` is by how much
    motion has narrowed the interval of the play, whose width is 2 at the start."""

    position: float = math.nan
    load: float = math.nan
    side: float = 0.0
    taken: float = 0.0

    def like(self, other: Rest) -> bool:
        """Whether the axis rests where another one does, but for what is no motion."""
        if math.isnan(self.position) or math.isnan(other.position):
            return math.isnan(self.position) and math.isnan(other.position)
        away = max(abs(self.position - other.position), abs(self.load - other.load))
        narrowed = abs(min(self.taken, 2.0) - min(other.taken, 2.0))
        return self.side == other.side and away < _STILL_MM and narrowed < _FREE


#: An axis whose position is not known.
UNKNOWN = Rest()


def follow(
    position_mm: Array, backlash_mm: Array, band_mm: float, before: Rest = UNKNOWN
) -> tuple[Array, Array, Mask, Rest]:
    """Play (n,) of one axis that has to bring its load to (n,) `position_mm` with (n,) `backlash_mm`. Then
    where the load is, the rows before which the drive has to turn, and where the axis rests behind them;
    `before` is where it rests before them.

    The play is known as an interval of the lag, in which its middle is taken: at the start it is anything
    between its two sides, and each motion narrows it. The axis turns only when it would be off by more than
    the band. A position that is not known (NaN) makes the play unknown.
    """
    play, load = np.zeros(len(position_mm)), np.full(len(position_mm), np.nan)
    turns = np.zeros(len(position_mm), bool)
    known = np.concatenate(([0], ~np.isnan(position_mm), [0])).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(known) == 1), np.flatnonzero(np.diff(known) == -1)
    rest = before if not len(position_mm) else UNKNOWN
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        here = slice(begin, end)
        position, half = position_mm[here], np.maximum(backlash_mm[here], 0.0) / 2
        first = float(position[0])
        start = before if begin == 0 and not math.isnan(before.position) else Rest(first, first)
        follows, turns[here] = _follows(position, half, band_mm, start)
        load[here] = _held(np.concatenate(([start.load], position)), follows)
        step = np.diff(load[here], prepend=start.load)
        side = _held(np.concatenate(([start.side], np.sign(step))), step != 0.0)
        taken = _summed(start.taken, _share(step, half))
        play[here] = side * np.minimum(taken / 2, 1.0)
        if end == len(position_mm):
            rest = Rest(float(position[-1]), float(load[-1]), float(side[-1]), float(taken[-1]))
    return play, load, turns, rest


def _follows(position: Array, half: Array, band: float, start: Rest) -> tuple[Mask, Mask]:
    """The rows in which the load goes to its position, and those before which the drive turns."""
    step = np.diff(position, prepend=start.position)
    follows, turns = step != 0.0, np.zeros(len(step), bool)
    load, side, begin = start.load, start.side, 0
    if not start.taken > _FREE:
        bound = np.flatnonzero(_summed(start.taken, _share(step, half)) > _FREE)
        if not bound.size:
            return follows, turns
        load, side, begin = float(position[bound[0]]), float(np.sign(step[bound[0]])), int(bound[0]) + 1
    rows = np.flatnonzero(follows[begin:]) + begin
    if not rows.size:
        return follows, turns
    # runs of rows in which the position goes one way
    way = np.sign(step[rows])
    first = np.flatnonzero(np.diff(way, prepend=0.0))
    run = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(way))))
    last = rows[np.append(first[1:], len(way)) - 1]
    loads, sides = _runs(way[first], position[last], load, side, band)
    back = way != sides[run]
    follows[rows] = goes = way * (position[rows] - loads[run]) > np.where(back, band, 0.0)
    turning = goes & back
    # the first of its run
    turning[1:] &= ~(turning[:-1] & (run[1:] == run[:-1]))
    turns[rows[turning]] = True
    return follows, turns


def _runs(way: Array, last: Array, load: float, side: float, band: float) -> tuple[Array, Array]:
    """The load and the side of the play before each run (k,), which goes one `way` up to `last`."""
    loads, sides = [], []
    for sign, end in zip(way.tolist(), last.tolist(), strict=True):
        loads.append(load)
        sides.append(side)
        if sign * (end - load) > (0.0 if sign == side else band):
            load, side = end, sign
    return np.array(loads), np.array(sides)


def _share(step: Array, half: Array) -> Array:
    """How much each step narrows the interval of the play, whose width is 2 at the start."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(step == 0.0, 0.0, 2 * np.abs(step) / half)


def _summed(before: float, values: Array) -> Array:
    """(n,) the sums of what comes before and of the values up to each."""
    return np.asarray(np.cumsum(np.concatenate(([before], values)))[1:])


def _held(values: Array, new: Mask) -> Array:
    """(n,) the value (n + 1,) of the last row up to each that is `new` (n,), the first one where none is."""
    row = np.where(new, np.arange(1, len(new) + 1), 0)
    return np.asarray(values[np.maximum.accumulate(row)])
