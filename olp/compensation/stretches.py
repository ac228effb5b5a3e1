"""Digits of rows whose words change their meaning from stretch to stretch: G90 and G91, mm and inch.

What is written in a stretch depends on where the stretch before it left the axis, and on nothing else of it.
So all stretches of one kind are rounded at once, and one number an axis is carried from stretch to stretch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from olp.compensation.digits import POW10, Absolute, AxisRows, Digits, Places, Starts, incremental, part_of
from olp.compensation.style import Style, by_unit
from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: Where the axis is as a stretch begins, from its number and where the stretch before it left the axis.
Enters = Callable[[int, float], float]


@dataclass(frozen=True, slots=True, eq=False)
class Decimals:
    """Decimals of the words of one axis, of all rows or of each: the fewest and the usual ones in G90, those
    of the grid in G91."""

    least: Places
    usual: Places
    grid: Places

    @staticmethod
    def of(style: Style, axis: int, unit: Array | float) -> Decimals:
        """Those of rows in this unit, one or (n,) of each."""
        least, usual, grid = (by_unit(p, axis, unit) for p in (style.least, style.usual, style.grid))
        return Decimals(least, usual, grid)

    def part(self, rows: slice | Index) -> Decimals:
        return Decimals(part_of(self.least, rows), part_of(self.usual, rows), part_of(self.grid, rows))


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """Consecutive rows in which words mean the same: (k + 1,) `bounds`, (k,) which are `counting` (G91)."""

    bounds: Index
    counting: Mask

    @staticmethod
    def of(counting: Mask, unit: Array | float, part: Index | None = None) -> Stretches:
        """Of rows (n,), at least one, by their mode, their unit, and the `part` of the text that they are
        in."""
        changes = counting[1:] != counting[:-1]
        if isinstance(unit, np.ndarray):
            changes |= unit[1:] != unit[:-1]
        if part is not None:
            changes |= part[1:] != part[:-1]
        bounds = np.concatenate(([0], np.flatnonzero(changes) + 1, [len(counting)]))
        return Stretches(bounds, counting[bounds[:-1]])

    def __len__(self) -> int:
        return len(self.counting)

    def rows(self, which: Mask) -> tuple[slice | Index, Starts]:
        """The rows of some of the stretches, and where each of these begins among them."""
        length = np.diff(self.bounds)
        if which.all():
            return slice(None), Starts.of(self.bounds[:-1], int(self.bounds[-1]))
        chosen = np.flatnonzero(np.repeat(which, length))
        first = np.cumsum(length[which]) - length[which]
        return chosen, Starts.of(first, len(chosen))


def digits_of(
    rows: AxisRows, stretches: Stretches, before: float, decimals: Decimals, enters: Enters | None = None
) -> Digits:
    """The digits of consecutive rows; `before` is the position as written on entry. Where other blocks move
    the axis between stretches, `enters` says where it is then."""
    plain, starts = stretches.rows(~stretches.counting)
    part, places = rows.part(plain), decimals.part(plain)
    fixed = Absolute.of(part, starts, places.least, places.usual)
    if len(stretches) == 1 and not stretches.counting[0] and enters is None:
        return fixed.digits(part, before)
    entry, odd = _entries(rows, stretches, before, decimals, _Ends.of(part, fixed), enters)
    count = len(rows.command)
    result = Digits(
        np.empty(count), np.empty(count, np.int64), np.empty(count, np.int8), np.empty(count, bool)
    )
    if len(starts.first):
        _put(result, plain, fixed.digits(part, entry[~stretches.counting]))
    even = stretches.counting.copy()
    even[list(odd)] = False
    if even.any():
        chosen, starts = stretches.rows(even)
        grid = decimals.part(chosen).grid
        _put(result, chosen, incremental(rows.part(chosen), entry[even], grid, starts))
    for k, digits in odd.items():
        _put(result, slice(*stretches.bounds[k : k + 2]), digits)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """Where the (k,) stretches in G90 leave the axis: at `end` where a word settles that. An omitted axis
    moves on where a command is farther than `half` from where it was: those are from `low` to `high`. Else it
    stays where it was."""

    settled: list[bool]
    end: list[float]
    low: list[float]
    high: list[float]
    half: list[float]

    @staticmethod
    def of(rows: AxisRows, fixed: Absolute) -> _Ends:
        starts, free = fixed.starts, fixed.free
        if not len(starts.first):
            return _Ends([], [], [], [], [])
        stop = np.append(starts.first[1:], starts.count) - 1
        settled = fixed.source[stop] >= starts.first
        last_free = starts.last(free)[stop]
        end = np.where(settled, fixed.follow(rows, np.nan)[0][stop], fixed.written[last_free])
        low = np.minimum.reduceat(np.where(free, rows.command, np.inf), starts.first)
        high = np.maximum.reduceat(np.where(free, rows.command, -np.inf), starts.first)
        half = np.broadcast_to(fixed.half, starts.count)[last_free]
        return _Ends(settled.tolist(), end.tolist(), low.tolist(), high.tolist(), half.tolist())

    def after(self, k: int, before: float) -> float:
        """Where the axis is after stretch k."""
        if self.settled[k] or self.high[k] - before > self.half[k] or before - self.low[k] > self.half[k]:
            return self.end[k]
        return before


def _entries(
    rows: AxisRows,
    stretches: Stretches,
    before: float,
    decimals: Decimals,
    ends: _Ends,
    enters: Enters | None,
) -> tuple[Array, dict[int, Digits]]:
    """(k,) where the axis is as each stretch begins, and the digits of stretches in G91 that are rounded row
    by row, as words are kept in them or a position is unknown."""
    bounds = stretches.bounds
    stop = bounds[1:] - 1
    broken = np.logical_or.reduceat(rows.raw | np.isnan(rows.command), bounds[:-1]).tolist()
    grid = np.broadcast_to(decimals.grid, len(rows.command))[stop]
    unit = np.broadcast_to(rows.unit, len(rows.command))[stop].tolist()
    scale, command = POW10[grid].tolist(), rows.command[stop].tolist()
    entry, odd, plain = np.empty(len(stretches)), {}, 0
    for k, counting in enumerate(stretches.counting.tolist()):
        if enters is not None:
            before = enters(k, before)
        entry[k] = before
        if not counting:
            before = ends.after(plain, before)
            plain += 1
        elif broken[k] or before != before:
            part = replace(rows.part(slice(*bounds[k : k + 2])), unit=unit[k])
            odd[k] = incremental(part, before, int(grid[k]))
            before = float(odd[k].emitted[-1])
        else:
            before += round((command[k] - before) / unit[k] * scale[k]) / scale[k] * unit[k]
    return entry, odd


def _put(result: Digits, rows: slice | Index, digits: Digits) -> None:
    """The digits of some rows into those of all."""
    result.emitted[rows], result.mantissa[rows] = digits.emitted, digits.mantissa
    result.decimals[rows], result.write[rows] = digits.decimals, digits.write
