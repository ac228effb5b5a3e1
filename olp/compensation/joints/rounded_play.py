"""Backlash of linear axes where rotary words are rounded: the linear axes take up what the rounding does to
the tip, so an axis may turn round for that alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.compensation.dead_band import Rest, follow
from olp.compensation.joints.commanded import Rows
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointLimits, JointPlan
from olp.compensation.joints.play import Play
from olp.core.arrays import Array, Index, Mask
from olp.errormodel.reversal import play_interval
from olp.kinematics.poses import Poses

_Scalar = TypeVar("_Scalar", bound=np.generic)


def loads(path: JointPath, plan: JointPlan, emitted: Array) -> Array:
    """(r, axes) where the loads of axes are at the rows of a plan whose rotary words are `emitted` (r, axes):
    the linear ones meet the position. Rows that stay as they are have none."""
    motion, rotary = path.motion, path.coordinates.rotary
    solid = np.asarray(np.isfinite(plan.command).all(axis=1), bool)
    load = plan.axes - 0.5 * motion.width * plan.side
    load[:, rotary] = np.where(solid[:, None], emitted, np.nan)[:, rotary]
    turning = np.flatnonzero(rotary & (motion.width != 0.0))
    if turning.size:
        # moves that stay as they are move the axes, too
        drive = np.where(solid[:, None], emitted, path.axes(plan.move, path.end[plan.move]))
    for axis in turning.tolist():
        # a step that is rounded may not take up all of a backlash
        command = np.repeat(drive[:, axis : axis + 1], 3, axis=1)
        least, greatest = play_interval(command, np.full(3, motion.width[axis]))
        known = least[:, 0] == greatest[:, 0]
        load[:, axis] -= 0.5 * motion.width[axis] * np.where(known, least[:, 0], plan.side[:, axis])
    rows = np.flatnonzero(solid)
    target = Poses(plan.target.rotation[rows], plan.target.position[rows])
    load[rows] = motion.linear(load[rows], path.tool[plan.move[rows]], target).values
    return load


def with_rounded(path: JointPath, plan: JointPlan, limits: JointLimits, emitted: Array) -> JointPlan:
    """The plan with the sides of linear axes as they are where rotary words are `emitted` (r, axes), and rows
    where these axes take up their backlash."""
    motion, rotary = path.motion, path.coordinates.rotary
    solid = np.flatnonzero(np.isfinite(plan.command).all(axis=1))
    if not solid.size:
        return plan
    load = loads(path, plan, emitted)
    play = Play.of(path, _rows(plan, load, solid), limits.tolerance_mm, limits.tolerance_rad)
    side, turns = plan.side.copy(), np.zeros(plan.side.shape, bool)
    past = plan.stands & (plan.share == 1.0)
    for axis in np.flatnonzero(~rotary & (motion.width != 0.0)).tolist():
        side[:, axis], turns[:, axis] = _sides(plan, load[:, axis], past, play, axis)
    may = path.feed & ~(path.holes.whole | path.holes.strokes)
    known = np.asarray(np.isfinite(load).all(axis=1), bool)
    where = np.flatnonzero(turns.any(axis=1) & may[plan.move] & known & ~plan.stands)
    where = where[(where > 0) & known[where - 1] & (plan.move[where] - plan.move[where - 1] <= 1)]
    # a row that takes up backlash anyway takes up that of these axes, too
    early = where[(plan.stands & ~past)[where - 1]]
    side[early - 1] = np.where(turns[early], side[early], side[early - 1])
    where = np.setdiff1d(where, early)
    written = np.where(np.isfinite(emitted), emitted, plan.axes)
    axes = np.where(rotary, written, load + 0.5 * motion.width * side)
    steps = np.where(turns[where], side[where], side[where - 1])
    # the words of rotary axes stay
    stand = np.where(rotary, written[where - 1], load[where - 1] + 0.5 * motion.width * steps)
    made = _inserted(replace(plan, axes=axes, side=side), where, stand, steps)
    some = np.flatnonzero(np.isfinite(made.axes).all(axis=1) & np.isfinite(made.command).all(axis=1))
    command = made.command.copy()
    command[some] = motion.programmed(made.axes[some], path.tool[made.move[some]], path.tip[made.move[some]])
    return replace(made, command=command)


def _rows(plan: JointPlan, load: Array, some: Index) -> Rows:
    target = Poses(plan.target.rotation[some], plan.target.position[some])
    return Rows(
        plan.move[some], plan.share[some], load[some], target, plan.side[some], plan.left_rad[some],
        plan.limited[some],
    )  # fmt: skip


def _sides(plan: JointPlan, load: Array, past: Mask, play: Play, axis: int) -> tuple[Array, Mask]:
    """(r,) the side of one linear axis, and the rows before which it turns round. Where its side is not known
    it stays as planned."""
    side, turns = plan.side[:, axis].copy(), np.zeros(len(load), bool)
    # a row past an end is no place of the load
    rows = np.flatnonzero(np.isfinite(load) & ~past)
    known = np.abs(side[rows]) == 1.0
    edge = np.flatnonzero(np.diff(np.concatenate(([False], known, [False])).astype(np.int8)))
    width = np.full(len(load), play.width[axis])
    for a, b in edge.reshape(-1, 2).tolist():
        some = rows[a:b]
        rest = Rest(float(load[some[0]]), float(load[some[0]]), float(side[some[0]]), 2.0)
        side[some], _, turns[some], _ = follow(load[some], width[some], float(play.band[axis]), rest)
    return side, turns


def _inserted(plan: JointPlan, where: Index, axes: Array, side: Array) -> JointPlan:
    """The plan with rows before others that stand where the rows before do."""
    same = plan.move[where] == plan.move[where - 1]

    def put(column: npt.NDArray[_Scalar], values: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
        return np.insert(column, where, values, axis=0)

    return JointPlan(
        put(plan.move, plan.move[where]), put(plan.share, np.where(same, plan.share[where - 1], 0.0)),
        put(plan.command, plan.command[where - 1]), put(plan.axes, axes),
        Poses(put(plan.target.rotation, plan.target.rotation[where - 1]),
              put(plan.target.position, plan.target.position[where - 1])),
        put(plan.side, side), put(plan.left_rad, plan.left_rad[where - 1]),
        put(plan.limited, plan.limited[where - 1]), plan.straight,
    )  # fmt: skip
