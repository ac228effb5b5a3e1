"""Lost motion along a program: on which flank every axis rests, and the steps that take it up.

The exact inverse of a play is to lead by half of it in the direction of motion. An axis that nominally
stands still would then jump by the whole play whenever a tiny straightness correction changes sign; a dead
band keeps it where it is instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from olp.compensation.invert import invert
from olp.errormodel import ErrorModel
from olp.errormodel.base import Array, Mask
from olp.toolpath import Flag, Kind, Toolpath

if TYPE_CHECKING:
    from olp.compensation.plan import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Reversal:
    """`axes` (3,) with lost motion worth the trouble; `band_mm` an axis may stay behind rather than turn;
    `lost_mm` (3,) the largest lost motion of each."""

    axes: Mask
    band_mm: float
    lost_mm: Array

    @staticmethod
    def of(model: ErrorModel, band_mm: float) -> Reversal | None:
        box = model.box_mm
        probe = np.column_stack([np.linspace(low, high, 257) for low, high in box])
        lost = model.lost_motion_mm(probe)
        if lost is None:
            return None
        axes = np.abs(lost).max(axis=0) / 2 > band_mm
        return Reversal(axes, band_mm, lost.max(axis=0)) if axes.any() else None


def carry_play(path: Toolpath, model: ErrorModel, rows: Plan, reversal: Reversal) -> Plan:
    """The plan with play: commands lead by half the lost motion, and where an axis turns round in a feed move,
    a row that only takes it up comes first."""
    # without play a command is where the load has to be; the load's turns are the axis' turns
    play = np.zeros((len(rows), 3))
    wanted = np.where(rows.raw, rows.target_mm, rows.command_mm)
    load = wanted.copy()
    for axis in np.flatnonzero(reversal.axes).tolist():
        play[:, axis], load[:, axis] = _follow(wanted[:, axis], reversal.band_mm, max(float(reversal.lost_mm[axis]), 0.0))
    tools = path.tool_mm()
    tool = tools if tools.ndim == 1 else tools[rows.move]
    # a held axis aims at where its load stays, not at where it should be
    held = np.nan_to_num(load - wanted)
    command = invert(model, rows.target_mm + held, tool, play)
    command[rows.raw] = rows.command_mm[rows.raw]
    return _take_up(path, model, replace(rows, command_mm=command, play=play), tool, held)


def _follow(position: Array, band: float, lost: float) -> tuple[Array, Array]:
    """Play state and load position of one axis: it follows in its direction, and turns only beyond the band. At
    the start nobody knows the flank; it is known once the axis has moved by its lost motion in one direction."""
    state = 0.0
    at = low = high = float("nan")
    states, loads = [], []
    for wanted in position.tolist():
        if wanted != wanted or at != at:
            state = 0.0
            at = low = high = wanted
        elif state == 0.0:
            at, low, high = wanted, min(low, wanted), max(high, wanted)
            if wanted - low > lost + band:
                state = 1.0
            elif high - wanted > lost + band:
                state = -1.0
        elif (wanted - at) * state > 0:
            at = wanted
        elif abs(wanted - at) > band:
            state, at = -state, wanted
        states.append(state)
        loads.append(at)
    return np.array(states), np.array(loads)


def _take_up(path: Toolpath, model: ErrorModel, rows: Plan, tool: Array, held: Array) -> Plan:
    """Insert rows that turn the drive round before the load moves, in feed moves whose axis changes flank."""
    assert rows.play is not None
    change = np.zeros(len(rows), bool)
    change[1:] = ((rows.play[1:] != rows.play[:-1]) & ~rows.raw[1:] & ~np.isnan(rows.command_mm[:-1])).any(axis=1)
    change &= (path.kind[rows.move] != Kind.RAPID) & ((path.flag[rows.move] & np.uint8(Flag.CYCLE)) == 0)
    where = np.flatnonzero(change)
    if not where.size:
        return rows
    part_tool = tool if tool.ndim == 1 else tool[where]
    target = rows.target_mm[where - 1] + held[where - 1]
    turned = invert(model, target, part_tool, rows.play[where])
    raw = rows.raw[where]
    turned[raw] = rows.command_mm[where - 1][raw]
    reach = np.where(rows.move[where] == rows.move[where - 1], rows.reach[where - 1], 0.0)

    def insert(column: Array, new: Array) -> Array:
        return np.insert(column, where, new, axis=0)

    return replace(
        rows,
        move=insert(rows.move, rows.move[where]),
        target_mm=insert(rows.target_mm, rows.target_mm[where - 1]),
        command_mm=insert(rows.command_mm, turned),
        raw=insert(rows.raw, raw),
        reach=insert(rows.reach, reach),
        take_up=insert(rows.take_up, np.ones(len(where), bool)),
        play=insert(rows.play, rows.play[where]),
    )
