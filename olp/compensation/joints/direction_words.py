"""Directions of the tool as they are written: three components with the same digits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.directed import refuse_near
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.posed import unreached
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import NotInvertible, ProgramError
from olp.core.values import dataclass
from olp.kinematics.directions import pair_of

#: A direction that would change by less, rad, stays as it is.
_NO_CHANGE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class DirectionWords:
    """Of rows of a plan (r,): which `write` their direction, and its `mantissa` (r, 3) with `decimals`.
    `axes` (r, axes) are the axis values of the plan with the rotary ones that what is written leads to."""

    write: Mask
    mantissa: npt.NDArray[np.int64]
    decimals: int
    axes: Array

    @staticmethod
    def of(path: JointPath, plan: JointPlan, head: Mask, emitted: Array) -> DirectionWords:
        """`head` (r,) are the first rows of moves, which have the words of the program. `emitted` (r, axes)
        are the rotary positions of rows that words of axes lead to. Raises ProgramError where no axis values
        give a rounded direction, and where the tool passes along the outer axis."""
        directions, motion, program = path.directions, path.motion, path.program
        structure = motion.structure
        rotary = np.flatnonzero([name == "deg" for name in structure.units])
        rows = np.flatnonzero(directions.led[plan.move] & np.isfinite(plan.command).all(axis=1))
        move, tool = plan.move[rows], path.tool[plan.move[rows]]
        wanted = motion.nominal(plan.axes[rows], tool).rotation[:, :, 2]
        scale = 10.0**directions.decimals
        mantissa = np.rint(directions.turned(program, move, wanted, back=True) * scale).astype(np.int64)
        rounded = mantissa / np.linalg.norm(mantissa, axis=1)[:, None]
        rounded = directions.turned(program, move, rounded)
        unit = np.where(head[rows, None], directions.unit[move], np.nan)
        unit = directions.turned(program, move, unit)
        # the direction in force where no words of one come before
        before = np.where((rows > 0)[:, None], emitted[rows - 1], path.start[move])[:, rotary]
        stands = np.zeros((len(rows), len(structure.order)))
        stands[:, rotary] = np.nan_to_num(before)
        prior = motion.nominal(stands, tool).rotation[:, :, 2]
        prior[~np.isfinite(before).all(axis=1)] = np.nan
        follows = np.diff(rows, prepend=-2) == 1
        change, towards = _written(wanted, rounded, unit, prior, follows, 0.5 / scale)
        free = refuse_near(structure, towards, path.line[move])
        _refuse_passing(path, plan, rows[free], rotary)
        axes, turns = plan.axes.copy(), rows[~free]
        try:
            axes[turns] = motion.directed(axes[turns], towards[~free], rotary, turns)
        except NotInvertible as error:
            raise unreached(int(path.line[plan.move[error.rows[0]]])) from None
        outer = structure.order.index(pair_of(structure)[0].name)
        known = np.isfinite(axes[:, outer])
        for row in rows[free].tolist():
            last = np.flatnonzero(known[:row])[-1:]
            axes[row, outer] = axes[last[0], outer] if last.size else axes[row, outer]
        write, whole = np.zeros(len(plan.move), bool), np.zeros((len(plan.move), 3), np.int64)
        write[rows], whole[rows] = change, mantissa
        return DirectionWords(write, whole, directions.decimals, axes)


def _refuse_passing(path: JointPath, plan: JointPlan, rows: Index, rotary: Index) -> None:
    """Raise ProgramError where the tool is along the outer axis inside of a move that turns it: which way the
    control leads that axis there is open."""
    move = plan.move[rows]
    turning = (path.start[move][:, rotary] != path.end[move][:, rotary]).any(axis=1)
    inside = (plan.share[rows] > 0.0) & (plan.share[rows] < 1.0) & turning
    if inside.any():
        name = pair_of(path.motion.structure)[0].name
        raise ProgramError(
            f"this move leads the tool along the axis of {name}, where the position of {name} is open: "
            "end a move there",
            line=int(path.line[move[np.argmax(inside)]]),
            code="OLP566",
        )


def _written(
    wanted: Array, rounded: Array, unit: Array, prior: Array, follows: Mask, half: float
) -> tuple[Mask, Array]:
    """(r,) which rows are written, and (r, 3) the directions in force behind each. `unit` (r, 3) are those of
    the program's own words, NaN without. `follows` (r,) are rows right behind the one before, and before the
    others `prior` (r, 3) is in force, NaN where it is not known."""
    stated = np.isfinite(unit[:, 0])
    own = stated & (np.linalg.norm(wanted - np.where(stated[:, None], unit, 0.0), axis=1) <= _NO_CHANGE)
    change, towards = ~own, np.where(own[:, None], unit, rounded)
    for row in np.flatnonzero(~stated).tolist():
        before = towards[row - 1] if follows[row] else prior[row]
        if np.abs(wanted[row] - before).max() <= max(half, _NO_CHANGE):
            change[row], towards[row] = False, before
    return change, towards
