"""Backlash along a program: which side of it every axis is on, and the steps that take it up.

The exact inverse of a play is to lead by half of it in the direction of motion. An axis that nominally
stands still would then jump by the whole play whenever a tiny straightness correction changes sign; a dead
band keeps it where it is instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.compensation.contour import Contour
from olp.compensation.invert import invert
from olp.compensation.plan import Plan
from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.errormodel.base import ErrorModel

_Scalar = TypeVar("_Scalar", bound=np.generic)

#: Backlash is looked for with no tool vector.
_NO_TOOL = np.zeros(3)
#: Iterations of the play states, at most.
_PASSES = 6


@dataclass(frozen=True, slots=True, eq=False)
class Reversal:
    """`axes` (3,) with backlash that matters; `band_mm`: so far an axis may lag rather than turn round."""

    axes: Mask
    band_mm: float

    @staticmethod
    def of(model: ErrorModel, band_mm: float) -> Reversal | None:
        probe = np.column_stack([np.linspace(low, high, 257) for low, high in model.box_mm])
        if model.backlash_at(probe) is None:
            return None
        axes = np.zeros(3, bool)
        for axis in range(3):
            # what the direction of an axis changes, in any component of the error
            ahead = np.zeros((len(probe), 3))
            ahead[:, axis] = 1.0
            change = model.error(probe, _NO_TOOL, ahead) - model.error(probe, _NO_TOOL, -ahead)
            axes[axis] = np.abs(change).max() / 2 > band_mm
        return Reversal(axes, band_mm) if axes.any() else None


def carry_play(
    path: Toolpath,
    model: ErrorModel,
    rows: Plan,
    reversal: Reversal,
    contour: Contour | None,
    *,
    insert: bool,
) -> Plan:
    """The plan with play: commands lead by half the backlash. Where an axis turns round in a feed move, a row
    that only takes it up comes first; without `insert` not before moves that are never split, and never along
    a `contour` under cutter compensation.

    Where one axis turns, the straightness of another may jump with it, so that one turns too. The states are
    iterated until they agree.
    """
    tools = path.tool_mm()
    tool = tools if tools.ndim == 1 else tools[rows.move]
    play = np.zeros((len(rows), 3))
    turns = np.zeros((len(rows), 3), bool)
    command, held = rows.command_mm, np.zeros((len(rows), 3))
    source = None if contour is None else contour.source(rows)
    still = _still(path, rows, source)
    for _ in range(_PASSES):
        backlash = model.backlash_at(command)
        assert backlash is not None
        backlash = np.maximum(np.nan_to_num(backlash), 0.0)
        # where the load is: the command without its lead, and without the hold of the iteration before
        wanted = np.where(rows.raw, rows.target_mm, command - backlash / 2 * play - held)
        if still is not None:
            wanted = np.take_along_axis(wanted, still, axis=0)
        before = play.copy()
        for axis in np.flatnonzero(reversal.axes).tolist():
            play[:, axis], load, turns[:, axis] = _follow(
                wanted[:, axis], backlash[:, axis], reversal.band_mm
            )
            # a held axis aims at where its load is held, not at where it should be
            held[:, axis] = np.nan_to_num(load - wanted[:, axis])
        command = invert(model, rows.target_mm + held, tool, play)
        command[rows.raw] = rows.command_mm[rows.raw]
        if source is not None:
            command = np.take_along_axis(command, source, axis=0)
        if np.abs(play - before).max(initial=0.0) < 1e-3:
            break
    rows = replace(rows, command_mm=command, play=play)
    may = _may_turn(path, rows, insert=insert)
    if contour is not None:
        may &= ~contour.steady[rows.move]
    turns &= may[:, None]
    return _take_up(model, rows, tool, held, turns) if turns.any() else rows


def _still(path: Toolpath, rows: Plan, source: Index | None) -> Index | None:
    """(r, 3) the row at which each axis reached its present position. The strokes of one hole move no axis
    across them, though the error there would ask for it. Without canned cycles it is the `source` of each
    command, where axes are held."""
    cycle = (path.flag[rows.move] & np.uint8(Flag.CYCLE)) != 0
    if not cycle.any():
        return source
    end = path.end_mm[rows.move]
    stays = np.zeros((len(rows), 3), bool)
    line = path.line[rows.move]
    stays[1:] = (cycle[1:] & (line[1:] == line[:-1]))[:, None] & (end[1:] == end[:-1])
    order = np.broadcast_to(np.arange(len(rows))[:, None], stays.shape)
    if source is not None:
        stays |= source != order
    return np.asarray(np.maximum.accumulate(np.where(stays, 0, order), axis=0), np.int64)


def _may_turn(path: Toolpath, rows: Plan, *, insert: bool) -> Mask:
    """(r,) rows before which a step may be put: feed moves that are corrected and start at a known position.
    Without `insert` not before those that are never split."""
    may = ~rows.raw.any(axis=1) & (path.kind[rows.move] != Kind.RAPID)
    may &= (path.flag[rows.move] & np.uint8(Flag.CYCLE)) == 0
    if not insert:
        may &= (path.flag[rows.move] & np.uint8(Flag.WHOLE)) == 0
    may[:1] = False
    may[1:] &= ~np.isnan(rows.command_mm[:-1]).any(axis=1)
    return np.asarray(may, bool)


def _follow(position: Array, backlash: Array, band: float) -> tuple[Array, Array, Mask]:
    """Play (n,) of one axis that has to bring its load to `position` with backlash `lost`, where the load
    then is, and the rows before which the drive has to turn.

    The play is known as an interval of the lag, in which its middle is taken: at the start it is anything
    between its two sides, and each motion narrows it. The axis turns only when it would be off by more than
    the band.
    """
    plays, loads, turns = [], [], []
    load = low = high = float("nan")
    for wanted, width in zip(position.tolist(), backlash.tolist(), strict=True):
        half = max(width, 0.0) / 2
        turn = False
        if wanted != wanted or load != load:
            load, low, high = wanted, -1.0, 1.0
        elif wanted != load:
            sign = 1.0 if wanted > load else -1.0
            step = abs(wanted - load)
            # play that has to be taken up before the middle of the load moves, and until it is known
            first = 1.0 - (high if sign > 0 else -low)
            last = 1.0 - (low if sign > 0 else -high)
            turn = first > 1e-9
            if turn and step <= band:
                turn = False
            else:
                load = wanted
                if half == 0.0 or step >= half * (last - first) / 2:
                    low = high = sign
                else:
                    # while the interval narrows the middle of the load goes half as far as the drive
                    rest = last - first - 2 * step / half
                    low, high = (1.0 - rest, 1.0) if sign > 0 else (-1.0, -1.0 + rest)
        plays.append((low + high) / 2)
        loads.append(load)
        turns.append(turn)
    return np.array(plays), np.array(loads), np.array(turns)


def _take_up(model: ErrorModel, rows: Plan, tool: Array, held: Array, turns: Mask) -> Plan:
    """Insert rows that turn the drive round before the load moves."""
    assert rows.play is not None
    where = np.flatnonzero(turns.any(axis=1))
    target = rows.target_mm[where - 1]
    play = rows.play[where]
    command = invert(model, target + held[where - 1], tool if tool.ndim == 1 else tool[where], play)
    # an axis that does not turn must not leave its side of the backlash here
    step = command - rows.command_mm[where - 1]
    stay = ~turns[where] & (step * play < 0)
    command[stay] = rows.command_mm[where - 1][stay]
    same = rows.move[where] == rows.move[where - 1]

    def insert(column: npt.NDArray[_Scalar], new: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
        return np.insert(column, where, new, axis=0)

    return replace(
        rows,
        move=insert(rows.move, rows.move[where]),
        target_mm=insert(rows.target_mm, target),
        command_mm=insert(rows.command_mm, command),
        raw=insert(rows.raw, rows.raw[where]),
        reach=insert(rows.reach, np.where(same, rows.reach[where - 1], 0.0)),
        take_up=insert(rows.take_up, np.ones(len(where), bool)),
        play=insert(rows.play, play),
    )
