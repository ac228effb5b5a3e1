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


_NO_TOOL = np.zeros(3)


@dataclass(frozen=True, slots=True, eq=False)
class Reversal:
    """`axes` (3,) with lost motion worth the trouble; `band_mm` an axis may stay behind rather than turn;
    `lost_mm` (3,) the largest lost motion of each."""

    axes: Mask
    band_mm: float
    lost_mm: Array

    @staticmethod
    def of(model: ErrorModel, band_mm: float) -> Reversal | None:
        probe = np.column_stack([np.linspace(low, high, 257) for low, high in model.box_mm])
        lost = model.lost_motion_mm(probe)
        if lost is None:
            return None
        axes = np.zeros(3, bool)
        for axis in range(3):
            # what the direction of an axis changes, in any component of the error
            ahead = np.zeros((len(probe), 3))
            ahead[:, axis] = 1.0
            change = model.error(probe, _NO_TOOL, ahead) - model.error(probe, _NO_TOOL, -ahead)
            axes[axis] = np.abs(change).max() / 2 > band_mm
        return Reversal(axes, band_mm, lost.max(axis=0)) if axes.any() else None


def carry_play(path: Toolpath, model: ErrorModel, rows: Plan, reversal: Reversal) -> Plan:
    """The plan with play: commands lead by half the lost motion, and where an axis turns round in a feed move,
    a row that only takes it up comes first."""
    # without play a command is where the load has to be
    wanted = np.where(rows.raw, rows.target_mm, rows.command_mm)
    lost = model.lost_motion_mm(wanted)
    assert lost is not None
    play = np.zeros((len(rows), 3))
    turns = np.zeros((len(rows), 3), bool)
    load = wanted.copy()
    for axis in np.flatnonzero(reversal.axes).tolist():
        play[:, axis], load[:, axis], turns[:, axis] = _follow(
            wanted[:, axis], np.nan_to_num(lost[:, axis]), reversal.band_mm
        )
    tools = path.tool_mm()
    tool = tools if tools.ndim == 1 else tools[rows.move]
    # a held axis aims at where its load stays, not at where it should be
    held = np.nan_to_num(load - wanted)
    command = invert(model, rows.target_mm + held, tool, play)
    command[rows.raw] = rows.command_mm[rows.raw]
    return _take_up(path, model, replace(rows, command_mm=command, play=play), tool, held, turns.any(axis=1))


def _follow(position: Array, lost: Array, band: float) -> tuple[Array, Array, Mask]:
    """Play (n,) of one axis that has to bring its load to `position` with lost motion `lost`, where the load then
    is, and the rows before which the drive has to turn.

    The play is known as an interval of the lag, in which its middle is taken: at the start it is anything between
    the two flanks, and each motion narrows it. The axis turns only when it would be off by more than the band.
    """
    plays, loads, turns = [], [], []
    at = low = high = float("nan")
    for wanted, width in zip(position.tolist(), lost.tolist(), strict=True):
        half = max(width, 0.0) / 2
        turn = False
        if wanted != wanted or at != at:
            at, low, high = wanted, -1.0, 1.0
        elif wanted != at:
            sign = 1.0 if wanted > at else -1.0
            step = abs(wanted - at)
            # play that has to be taken up before the middle of the load moves, and until it is known
            first = 1.0 - (high if sign > 0 else -low)
            last = 1.0 - (low if sign > 0 else -high)
            turn = first > 1e-9
            if turn and step <= band:
                turn = False
            else:
                at = wanted
                if half == 0.0 or step >= half * (last - first) / 2:
                    low = high = sign
                else:
                    # while the interval narrows the middle of the load goes half as far as the drive
                    rest = last - first - 2 * step / half
                    low, high = (1.0 - rest, 1.0) if sign > 0 else (-1.0, -1.0 + rest)
        plays.append((low + high) / 2)
        loads.append(at)
        turns.append(turn)
    return np.array(plays), np.array(loads), np.array(turns)


def _take_up(path: Toolpath, model: ErrorModel, rows: Plan, tool: Array, held: Array, turns: Mask) -> Plan:
    """Insert rows that turn the drive round before the load moves, in feed moves whose axis changes flank."""
    assert rows.play is not None
    change = turns & ~rows.raw.any(axis=1)
    change[0] = False
    change[1:] &= ~np.isnan(rows.command_mm[:-1]).any(axis=1)
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
