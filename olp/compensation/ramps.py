"""Backlash taken up along a cut: a ramp in place of a step where an axis turns round.

A step aside makes the path stop, where it is longer than controls round corners. While the drive of an axis
crosses its backlash the load rests, though, and the path may go on as long as the load is where it has to be,
within the tolerance. So the drive goes from one side to the other on a short part of the move before the turn
and on a longer one behind it. At the turn itself the load is off by so little that the waypoint counts as
met. Before arcs and behind them a step stays.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.plan import Limits, Plan
from olp.core.arrays import Array, Index, Mask, any_in_row
from olp.core.toolpath import BLEND_MM, Kind, Toolpath
from olp.core.values import dataclass
from olp.program.bands import directions

#: of the tolerance: how far the load may be off at the turn, and behind it; the dead band of two axes comes
#: on top, 0.35
AT_TURN = 0.2
BEHIND = 0.6
#: of a row, at most, that a ramp takes at either end
SHARE = 1.0 / 3.0
#: times the backlash, at either side; a longer ramp is no faster, and its load rests longer than it must
LONGEST = 20.0
#: times the backlash; a shorter ramp is a step
SHORTEST = 0.5
#: last digits; a shorter part of a ramp is left out
LEAST_DIGITS = 4.0
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Ramps:
    """(m,) `row` before which an axis turns round on a ramp. (m,) `before` and `behind` are the shares of the
    row before and of `row` on which it does, 0 for none. (m,) `done` is the share of the ramp that lies
    before the turn."""

    row: Index
    before: Array
    behind: Array
    done: Array

    @staticmethod
    def none() -> Ramps:
        return Ramps(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def ramps(
    path: Toolpath, rows: Plan, turns: Mask, free: Mask, backlash_mm: Array, load_mm: Array,
    before: tuple[Array, Array], limits: Limits, *, cut_before: bool,
) -> Ramps:  # fmt: skip
    """Where axes that turn round before rows, (r, 3) `turns`, do so on ramps. (n,) `free` are the moves that
    may be split. (r, 3) `backlash_mm`, and `load_mm`, where the load of each axis has to be: its way counts
    and not that of the tip, whose errors it follows. `before` is the target and the load (3,) before the
    first row, and `cut_before` says whether the move there is one of `cuts`. No ramp begins there, nor at
    places where bands may end."""
    row = np.flatnonzero(any_in_row(turns))
    cut = cuts(path, free)
    move = np.concatenate(([rows.move[0]], rows.move))
    goes = np.where(row > 0, cut[move[row]], cut_before)
    # what stands on a line between, such as M0 or a dwell, may be a rest, during which the load may be moved
    goes &= path.line[rows.move[row]] - path.line[move[row]] <= 1
    row = row[cut[rows.move[row]] & goes]
    ways = directions(path, 0, len(path))
    same = rows.move[row] == move[row]
    early = (row > 0) & (same | any_in_row(ways[rows.move[row]] != ways[move[row]]))
    turning = turns[row]
    begin, load = np.vstack((before[0], rows.target_mm)), np.vstack((before[1], load_mm))
    width = np.where(turning, backlash_mm[row], 0.0).max(axis=1, initial=0.0)
    least = LEAST_DIGITS * limits.digit_mm
    most = AT_TURN * limits.tolerance_mm, BEHIND * limits.tolerance_mm
    ahead, near = _reach(begin[row] - begin[row - 1], load[row] - load[row - 1], turning, most[0])
    behind, far = _reach(begin[row + 1] - begin[row], load[row + 1] - load[row], turning, most[1])
    near = np.where(early & (near >= least), np.minimum(near, LONGEST * width), 0.0)
    far = np.where(far >= least, np.minimum(far, LONGEST * width), 0.0)
    good = np.flatnonzero((near + far >= SHORTEST * width) & (far > 0.0) & (width > BLEND_MM))
    near, far = near[good], far[good]
    done = near / (near + far)
    return Ramps(row[good], near / np.where(near > 0.0, ahead[good], 1.0), far / behind[good], done)


def cuts(path: Toolpath, free: Mask) -> Mask:
    """(n,) moves behind which a ramp may be, and on which: lines that may be split. What rests before a turn,
    as a rapid does, is a place for a step."""
    return np.asarray(free & (path.kind == Kind.LINE))


def _reach(step: Array, moved: Array, turning: Mask, most_mm: float) -> tuple[Array, Array]:
    """(m,) lengths of rows (m, 3), and how far on them the loads that turn move by no more than `most_mm`,
    all together."""
    length = np.nan_to_num(np.sqrt((step * step).sum(axis=1)))
    away = np.sqrt(np.where(turning, moved * moved, 0.0).sum(axis=1))
    with np.errstate(divide="ignore"):
        within = most_mm * np.maximum(length, _TINY) / away
    return length, np.minimum(within, SHARE * length)
