"""Directions of the tool as they are written: three components with the same digits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.directed import refuse_near
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.core.arrays import Array, Mask
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
    def of(path: JointPath, plan: JointPlan, head: Mask) -> DirectionWords:
        """`head` (r,) are the first rows of moves, which have the words of the program. Raises NotInvertible
        where no axis values give a rounded direction."""
        directions, motion = path.directions, path.motion
        rows = np.flatnonzero(directions.led[plan.move] & np.isfinite(plan.command).all(axis=1))
        move, tool = plan.move[rows], path.tool[plan.move[rows]]
        towards = motion.nominal(plan.axes[rows], tool).rotation[:, :, 2]
        wanted = directions.turned(path.program, move, towards, back=True)
        scale = 10.0**directions.decimals
        mantissa = np.rint(wanted * scale).astype(np.int64)
        rounded = mantissa / np.linalg.norm(mantissa, axis=1)[:, None]
        unit = np.where(head[rows, None], directions.unit[move], np.nan)
        change, emitted = _emitted(wanted, rounded, unit, np.diff(rows, prepend=-2) == 1, 0.5 / scale)
        emitted = directions.turned(path.program, move, emitted)
        axes, structure = plan.axes.copy(), motion.structure
        free = refuse_near(structure, emitted, path.line[move])
        rotary = np.flatnonzero([name == "deg" for name in structure.units])
        turns = rows[~free]
        axes[turns] = motion.directed(axes[turns], emitted[~free], rotary, turns)
        outer = structure.order.index(pair_of(structure)[0].name)
        for row in rows[free & (rows > 0)].tolist():
            axes[row, outer] = axes[row - 1, outer]
        write, whole = np.zeros(len(plan.move), bool), np.zeros((len(plan.move), 3), np.int64)
        write[rows], whole[rows] = change, mantissa
        return DirectionWords(write, whole, directions.decimals, axes)


def _emitted(wanted: Array, rounded: Array, unit: Array, follows: Mask, half: float) -> tuple[Mask, Array]:
    """(r,) which rows are written, and (r, 3) the directions in force behind each. `unit` (r, 3) are those of
    the program's own words, NaN without, `follows` (r,) rows right behind the one before."""
    stated = np.isfinite(unit[:, 0])
    own = stated & (np.linalg.norm(wanted - np.where(stated[:, None], unit, 0.0), axis=1) <= _NO_CHANGE)
    change, emitted = ~own, np.where(own[:, None], unit, rounded)
    for row in np.flatnonzero(~stated & follows).tolist():
        before = emitted[row - 1]
        if np.abs(wanted[row] - before).max() <= max(half, _NO_CHANGE):
            change[row], emitted[row] = False, before
    return change, emitted
