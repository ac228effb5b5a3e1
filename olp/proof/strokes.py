"""How far the strokes of canned cycles are from the axis and the bottom of their holes.

A corrected hole may have a peck more or less than the nominal one, so strokes are not compared one by one. A
feed stroke anywhere in the hole counts by its distance from the axis of the hole, the deepest one by its
depth, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index
from olp.core.geometry import PLANES, segment_distance
from olp.core.toolpath import Kind, Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_after, plays
from olp.errormodel.sampling import steps_needed
from olp.program.holes import Holes
from olp.program.program import Program

#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)
Single = npt.NDArray[np.float32]
#: Most steps of a stroke: an error that bends more often than that along a hole is no error of an axis.
_MOST_STEPS = 1 << 8
#: mm beyond the backlash at which it is taken up, whatever the rounding
_PAST_MM = 1e-6


def strokes_mm(
    nominal: Program, target_mm: TargetRows, path: Toolpath, holes: Holes, model: ErrorModel,
    bend_mm: float,
) -> tuple[Index, Single]:  # fmt: skip
    """(h,) the nominal move that reaches the bottom of each hole, and (h,) mm, the largest deviation of the
    feed strokes of `holes` of `path` from the nominal hole; NaN where a position is unknown."""
    count = len(nominal.holes)
    worst = np.full(count, np.nan, np.float32)
    if not count or len(holes) != count:
        return np.zeros(0, np.int64), worst[:0]
    move, top, bottom = _axes(nominal.toolpath, target_mm, nominal.holes)
    rows, which = holes.moves()
    feed = path.kind[rows] != Kind.RAPID
    which, rows = which[feed], rows[feed]
    if not rows.size:
        return move, worst
    tip, of = _tips(path, rows, model, bend_mm)
    hole_of = which[of]
    away = segment_distance(tip, top, bottom, hole_of)
    along = bottom - top
    # in no unit, but in order
    depth = np.zeros(len(tip))
    for axis in range(3):
        depth += (tip[:, axis] - top[:, axis].take(hole_of)) * along[:, axis].take(hole_of)
    deepest = np.full(count, -np.inf)
    np.fmax.at(deepest, hole_of, depth)
    # the deepest of a hole counts to its bottom
    lowest = np.flatnonzero(depth == deepest[hole_of])
    off = tip.take(lowest, axis=0) - bottom.take(hole_of[lowest], axis=0)
    away[lowest] = np.sqrt((off**2).sum(axis=1))
    np.fmax.at(worst, hole_of, away.astype(np.float32))
    return move, worst


def _axes(path: Toolpath, target: TargetRows, holes: Holes) -> tuple[Index, Array, Array]:
    """(h,) the move that reaches the bottom of each hole, and (h, 3) the ends of the hole's axis where its
    strokes are, targets."""
    count = len(holes)
    axis = _AXES[holes.plane, 2]
    move, hole = holes.moves()
    feed = path.kind[move] != Kind.RAPID
    # the rapid before the first stroke may end at the bottom, too
    at_bottom, _ = holes.ends(feed & (np.abs(path.end_mm[move, axis[hole]] - holes.z_mm[hole]) < 1e-9))
    reached = np.where(at_bottom >= 0, at_bottom, holes.last - 1)
    bottom = target[reached]
    top, row = bottom.copy(), np.arange(count)
    side = np.where(holes.r_mm >= holes.z_mm, 1.0, -1.0)
    highest = side * (bottom[row, axis] + holes.r_mm - holes.z_mm)
    of = hole[feed]
    # a peck shorter than the clearance begins above R
    for rows in (move[feed], np.maximum(move[feed] - 1, 0)):
        np.fmax.at(highest, of, side[of] * target[rows][np.arange(len(of)), axis[of]])
    top[row, axis] = side * highest
    return reached, top, bottom


def _tips(path: Toolpath, rows: Index, model: ErrorModel, bend_mm: float) -> tuple[Array, Index]:
    """(m, 3) where the tip is along moves `rows`, their starts too, and (m,) which of `rows` each is on."""
    start, end = path.starts_mm().take(rows, axis=0), path.end_mm.take(rows, axis=0)
    tool = path.tool_mm()
    tool = tool if tool.ndim == 1 else tool[rows]
    steps = steps_needed(model, np.nan_to_num(end - start), tool, bend_mm, at_most=_MOST_STEPS)
    of = np.repeat(np.arange(len(rows)), steps + 1)
    first = np.cumsum(steps + 1) - steps - 1
    share = (np.arange(len(of)) - first[of]) / steps[of]
    play = plays(model, path.end_mm)
    if play is None:
        point = start.take(of, axis=0) + share[:, None] * (end - start).take(of, axis=0)
        return point + model.error(point, tool if tool.ndim == 1 else tool[of], None), of
    # a stroke begins on the side on which the move before it ended, and then takes up the backlash
    before = np.concatenate((play[:1], play[:-1]))[rows]
    width = model.backlash_at(end)
    more, of_more = _turns(start, end, before, play[rows], width)
    of, share = np.concatenate((of, of_more)), np.concatenate((share, more))
    point = start[of] + share[:, None] * (end - start)[of]
    play = play_after(before[of], point - start[of], model.backlash_at(point))
    return point + model.error(point, tool if tool.ndim == 1 else tool[of], play), of


def _turns(start: Array, end: Array, before: Array, after: Array, width: Array | None) -> tuple[Array, Index]:
    """(k,) shares of strokes at which an axis has taken up its backlash, and (k,) the stroke of each."""
    size = np.zeros(start.shape) if width is None else np.maximum(np.nan_to_num(width), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.abs(after - before) / 2 * size + _PAST_MM) / np.abs(end - start)
    stroke, axis = np.nonzero((after != before) & (share < 1.0))
    return share[stroke, axis], stroke
