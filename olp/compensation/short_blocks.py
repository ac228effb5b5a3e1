"""Digits of short blocks along contours under cutter compensation, chosen together.

The control offsets a block in its direction. So the last digit of a block that is short beside the cutter
moves the tool by more than a digit: by its share of the length, times the radius. Of the numbers near both
ends those are taken that leave the direction as it is.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from olp.compensation.plan import Limits
from olp.compensation.style import Style, by_unit
from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Flag
from olp.core.values import dataclass
from olp.program.contours.elements import Elements
from olp.program.program import Program

#: share of the tolerance by which digits may move the tool before they are chosen together
_SHORT_SHARE = 0.25
#: share of the tolerance by which a chosen point may be farther off than rounding is, ...
_AWAY_SHARE = 0.25
#: ... which is half the diagonal of a digit's square
_ROUNDING = 0.71
#: Digits by which a chosen number may differ from the nearest one, none of them first.
_STEPS = np.array(sorted(product(range(-2, 3), repeat=2), key=lambda step: (step != (0, 0), step)))
#: Ends whose digits are chosen together; the next one is rounded, so that many such pieces go at once.
_PIECE = 32
#: Times that each end is moved beside its neighbours, which matters where one has more digits than the other.
_SWEEPS = 2
#: The four numbers about a place.
_CORNERS = np.array(list(product((0, 1), repeat=2)))


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """(p, 2) mm between the numbers that the ends of parts can have, from `zero` on. (p,) `free` ends can
    have any of them: both words are there, as positions."""

    step: Array
    zero: Array
    free: Mask

    @staticmethod
    def of(contour: Program, style: Style, move: Index, axes: Index, alone: Mask) -> Grid:
        """Of parts of moves (p,) with `axes` (p, 2) of their planes; `alone` (p,) are all of their move."""
        path = contour.toolpath
        frames, frame = path.frames, path.frame[move]
        unit = np.array([f.unit_mm for f in frames])[frame]
        zero = np.array([f.offset_mm for f in frames]).reshape(-1, 3)[frame[:, None], axes]
        turned = np.array([f.turn is not None for f in frames])[frame]
        step, given = np.zeros(axes.shape), np.zeros(axes.shape, bool)
        for axis in range(3):
            row, column = np.nonzero(axes == axis)
            slot = contour.slot[move[row], axis]
            units = unit[row]
            own = np.maximum(
                style.decimals(np.maximum(slot, 0), axis, units), by_unit(style.least, axis, units)
            )
            decimals = np.where(slot >= 0, own, by_unit(style.usual, axis, units))
            step[row, column] = units / 10.0**decimals
            given[row, column] = slot >= 0
        counts = (path.flag[move] & np.uint8(Flag.INCREMENTAL)) != 0
        return Grid(step, zero, given.all(axis=1) & alone & ~counts & ~turned)


def together(made: Elements, grid: Grid, limits: Limits) -> Array:
    """(p, 2) the ends of the parts `made` of contours, those of short ones as numbers of the grid."""
    point, step = made.end, grid.step
    way = point - made.begin
    length = np.maximum(np.hypot(*way.T), 1e-12)
    #: rad by which a mm across the block turns it, times the radius
    lever = np.where(made.arc, 0.0, made.radius / length)
    short = lever * _ROUNDING * step.max(axis=1) > _SHORT_SHARE * limits.tolerance_mm
    inner = np.append(~made.first[1:], False)
    chosen = np.flatnonzero(grid.free & (short | (inner & np.append(short[1:], False))))
    if not chosen.size:
        return point
    across = np.column_stack((-way[:, 1], way[:, 0])) * (lever / length)[:, None]
    across[made.first] = 0.0
    starts, count = _pieces(chosen)
    away = np.rint((point - grid.zero) / step) * step + grid.zero - point
    nearest = away.copy()
    for k, which in enumerate(_best(nearest, grid, limits, across, starts, count)):
        some = np.flatnonzero(count > k)
        row = starts[some] + k
        away[row] += _STEPS[which[some]] * step[row]
    for _ in range(_SWEEPS):
        for odd in (0, 1):
            _settle(away, nearest, grid, limits, across, chosen[chosen % 2 == odd])
    found = point.copy()
    # exactly what the numbers are
    number = np.rint((point[chosen] + away[chosen] - grid.zero[chosen]) / step[chosen])
    found[chosen] = number * step[chosen] + grid.zero[chosen]
    return found


def _most(step: Array, limits: Limits) -> Array:
    """(k,) mm that ends on grids of steps (k, 2) may be off."""
    return np.asarray(_ROUNDING * step.max(axis=1) + _AWAY_SHARE * limits.tolerance_mm)


def _settle(away: Array, nearest: Array, grid: Grid, limits: Limits, across: Array, row: Index) -> None:
    """Put the ends of parts `row` (k,), none of which is the next one of another, where they are best for
    what their neighbours are off. `away` (p, 2) is what all are off, `nearest` with the nearest numbers."""
    step, slopes = grid.step[row], (across[row], np.vstack((across, np.zeros((1, 2))))[row + 1])
    others = (away[np.maximum(row - 1, 0)], away[np.minimum(row + 1, len(away) - 1)])
    matrix, wanted = np.broadcast_to(np.eye(2), (len(row), 2, 2)), np.zeros((len(row), 2))
    for slope, other in zip(slopes, others, strict=True):
        matrix = matrix + slope[:, :, None] * slope[:, None]
        wanted += slope * (slope * other).sum(axis=1)[:, None]
    best = np.linalg.solve(matrix, wanted[..., None])[..., 0]
    trials = nearest[row, None] + (np.floor((best - nearest[row]) / step)[:, None] + _CORNERS) * step[:, None]
    trials = np.concatenate((away[row, None], trials), axis=1)
    size = np.square(trials).sum(axis=2)
    size[:, 1:][size[:, 1:] > np.square(_most(step, limits))[:, None]] = np.inf
    for slope, other in zip(slopes, others, strict=True):
        size += np.square(((trials - other[:, None]) * slope[:, None]).sum(axis=2))
    away[row] = np.take_along_axis(trials, size.argmin(axis=1)[:, None, None], axis=1)[:, 0]


def _pieces(chosen: Index) -> tuple[Index, Index]:
    """First rows and lengths of pieces of consecutive rows, with one row between two of them."""
    run = np.concatenate(([True], np.diff(chosen) > 1))
    first = chosen[run][np.cumsum(run) - 1]
    place = (chosen - first) % (_PIECE + 1)
    starts = np.flatnonzero(place == 0)
    count = np.minimum(np.diff(np.append(starts, len(chosen))), _PIECE)
    return chosen[starts], count


def _best(
    nearest: Array, grid: Grid, limits: Limits, across: Array, starts: Index, count: Index
) -> list[Index]:
    """For each place in the pieces (s,) which of _STEPS is taken from the nearest numbers. The sum of squares
    of what the digits move the tool is least: of each end, and of each direction (`across`, mm per mm of an
    end)."""
    last = len(nearest) - 1

    def off(row: Index) -> tuple[Array, Array]:
        """(s, c, 2) how far the numbers are from the ends, and (s, c) what that costs."""
        every = nearest[row, None] + _STEPS * grid.step[row, None]
        size = np.square(every).sum(axis=2)
        size[:, 1:][size[:, 1:] > np.square(_most(grid.step[row], limits))[:, None]] = np.inf
        return every, size

    before, _ = off(np.maximum(starts - 1, 0))
    cost = np.full(before.shape[:2], np.inf)
    cost[:, 0] = 0.0
    ways: list[Index] = []
    for k in range(int(count.max()) + 1):
        here, size = off(np.minimum(starts + k, last))
        # behind a piece the number is the nearest one
        size[count == k, 1:] = np.inf
        slope = np.where((starts + k > last)[:, None], 0.0, across[np.minimum(starts + k, last)])
        turn = (here @ slope[:, :, None])[:, None, :, 0] - (before @ slope[:, :, None])
        total = cost[:, :, None] + np.square(turn)
        ways.append(total.argmin(axis=1))
        cost, before = total.min(axis=1) + size, here
    taken, best = [], np.zeros(len(starts), np.int64)
    for k in range(len(ways) - 1, 0, -1):
        best = np.where(count >= k, np.take_along_axis(ways[k], best[:, None], axis=1)[:, 0], 0)
        taken.append(best)
    return taken[::-1]
