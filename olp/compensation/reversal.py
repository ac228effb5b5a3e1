"""Backlash along a program: which side of it every axis is on, and the steps that take it up.

The exact inverse of a play is to lead by half of it in the direction of motion. An axis that nominally
stands still would then jump by the whole play whenever a tiny straightness correction changes sign; a dead
band keeps it where it is instead.
"""

from __future__ import annotations

from dataclasses import field, fields, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from olp.compensation.contour import Contour
from olp.compensation.dead_band import UNKNOWN, Rest, follow
from olp.compensation.invert import invert
from olp.compensation.plan import Limits, Plan
from olp.compensation.ramps import Ramps, cuts, ramps
from olp.core.arrays import Array, Index, Mask, any_in_row, is_in
from olp.core.progress import Progress, silent
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel

_Scalar = TypeVar("_Scalar", bound=np.generic)

#: Backlash is looked for with no tool vector.
_NO_TOOL = np.zeros(3)
#: Iterations of the play states, at most.
_PASSES = 6
#: Change of the play, 2 from side to side, that is none.
_SAME_PLAY = 1e-3


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


@dataclass(slots=True, eq=False)
class Carried:
    """What a plan with play passes on to the one behind it: where each axis rests in each of the `passes` of
    the iteration. Of its last row (3,) each: the target, the command, by how much the load is `held` from the
    target, and where it should be. `cut`: the row belongs to a move that a ramp may follow."""

    passes: list[tuple[Rest, ...]] = field(default_factory=lambda: [(UNKNOWN,) * 3])
    target_mm: Array = field(default_factory=lambda: np.full(3, np.nan))
    command_mm: Array = field(default_factory=lambda: np.full(3, np.nan))
    held_mm: Array = field(default_factory=lambda: np.zeros(3))
    load_mm: Array = field(default_factory=lambda: np.full(3, np.nan))
    cut: bool = False


def carry_play(
    path: Toolpath,
    model: ErrorModel,
    rows: Plan,
    reversal: Reversal,
    contour: Contour | None,
    carried: Carried,
    *,
    free: Mask,
    limits: Limits,
    tell: Progress = silent,
) -> Plan:
    """The plan with play: commands lead by half the backlash. Where an axis turns round in a feed move, a row
    that only takes it up comes first, or it is taken up on a ramp between moves that are `free` (n,) to be
    split. Without `limits.insert` no row comes before moves that are never split, and never along a `contour`
    under cutter compensation. `carried` is that of the rows before, and becomes that of these.

    Where one axis turns, the straightness of another may jump with it, so that one turns too. The states are
    iterated until they agree.
    """
    if not len(rows):
        return rows
    tools = path.tool_mm()
    tool = tools if tools.ndim == 1 else tools[rows.move]
    play = np.zeros((len(rows), 3))
    turns = np.zeros((len(rows), 3), bool)
    command, held = rows.command_mm, np.zeros((len(rows), 3))
    passes: list[tuple[Rest, ...]] = []
    source = None if contour is None else contour.source(rows)
    still = _still(path, rows, source)
    for turn in range(_PASSES):
        every_backlash = model.backlash_at(command)
        assert every_backlash is not None
        change = 0.0
        # that of the same pass: a later one has seen more than this one
        rests = list(carried.passes[min(turn, len(carried.passes) - 1)])
        # one axis at a time, so that memory is small
        for axis in np.flatnonzero(reversal.axes).tolist():
            backlash = np.maximum(np.nan_to_num(every_backlash[:, axis]), 0.0)
            # where the load is: the command without its lead, and without the hold of the iteration before
            wanted = command[:, axis] - backlash / 2 * play[:, axis] - held[:, axis]
            wanted = np.where(rows.raw[:, axis], rows.target_mm[:, axis], wanted)
            if still is not None:
                wanted = wanted[still[:, axis]]
            after, load, turns[:, axis], rests[axis] = follow(wanted, backlash, reversal.band_mm, rests[axis])
            change = max(change, float(np.abs(after - play[:, axis]).max(initial=0.0)))
            play[:, axis] = after
            # a held axis aims at where its load is held, not at where it should be
            held[:, axis] = np.nan_to_num(load - wanted)
        del every_backlash
        command = invert(model, rows.target_mm + held, tool, play)
        command[rows.raw] = rows.command_mm[rows.raw]
        if source is not None:
            command = np.take_along_axis(command, source, axis=0)
        passes.append(tuple(rests))
        tell("correct", (turn + 1) / _PASSES)
        if change < _SAME_PLAY and turn + 1 >= len(carried.passes):
            break
    rows = replace(rows, command_mm=command, play=play)
    may = _may_turn(path, rows, carried.command_mm, insert=limits.insert)
    if contour is not None:
        may &= ~contour.steady[rows.move]
    turns &= may[:, None]
    before, carried.passes = replace(carried), _different(passes)
    carried.target_mm, carried.command_mm = rows.target_mm[-1].copy(), command[-1].copy()
    carried.held_mm = held[-1].copy()
    carried.load_mm = _wanted(model, command[-1:], play[-1:], held[-1:])[0]
    # in a program with cutter compensation no move is split for a ramp
    free = free & all(frame.compensation is None for frame in path.frames)
    carried.cut = bool(cuts(path, free)[rows.move[-1]])
    if not turns.any():
        return rows
    return _taken_up(path, model, rows, tool, held, turns, before, free, limits)


def _taken_up(
    path: Toolpath, model: ErrorModel, rows: Plan, tool: Array, held: Array, turns: Mask, before: Carried,
    free: Mask, limits: Limits,
) -> Plan:  # fmt: skip
    """The plan with the rows that take up backlash: of ramps where there is room, of steps elsewhere."""
    assert rows.play is not None
    width = model.backlash_at(rows.command_mm)
    assert width is not None
    load = _wanted(model, rows.command_mm, rows.play, held)
    ahead = before.target_mm, before.load_mm
    ramp = ramps(path, rows, turns, free, np.nan_to_num(width), load, ahead, limits, cut_before=before.cut)
    steps = turns.copy()
    steps[ramp.row] = False
    new = _Inserted.joined(
        _steps(model, rows, tool, held, steps, before), *_ends(model, rows, tool, held, ramp, before)
    )
    return new.into(_across(model, rows, tool, held, ramp))


def _wanted(model: ErrorModel, command: Array, play: Array, held: Array) -> Array:
    """(r, 3) where loads should be: commands without their leads, and without holds."""
    width = model.backlash_at(command)
    assert width is not None
    return np.asarray(command - np.maximum(np.nan_to_num(width), 0.0) / 2 * play - held)


def _different(passes: list[tuple[Rest, ...]]) -> list[tuple[Rest, ...]]:
    """The passes up to the first one from which on nothing changes any more."""
    count = len(passes)
    while count > 1 and all(a.like(b) for a, b in zip(passes[count - 2], passes[-1], strict=True)):
        count -= 1
    return [*passes[: count - 1], passes[-1]]


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


def _may_turn(path: Toolpath, rows: Plan, command_mm: Array, *, insert: bool) -> Mask:
    """(r,) rows before which a step may be put: feed moves that are corrected and start at a known position,
    the first one at `command_mm` (3,). Those that touch have none, as it would touch too. Without `insert`
    not before those that are never split."""
    may = ~any_in_row(rows.raw) & ~is_in(path.kind[rows.move], (Kind.RAPID, Kind.PROBE))
    may &= (path.flag[rows.move] & np.uint8(Flag.CYCLE)) == 0
    if not insert:
        may &= (path.flag[rows.move] & np.uint8(Flag.WHOLE)) == 0
    # a step in front of a block that calls a cycle would call it too
    calls = (path.line[1:] == path.line[:-1]) & ((path.flag[1:] & np.uint8(Flag.PASS | Flag.CYCLE)) != 0)
    may &= ~np.append(calls, False)[rows.move]
    may &= ~any_in_row(np.isnan(_before(command_mm, rows.command_mm)))
    return np.asarray(may, bool)


def _before(first: Array, rows: Array) -> Array:
    """(r, 3) the row before each of rows, that before the first one (3,) among them."""
    return np.vstack((first, rows[:-1]))


@dataclass(frozen=True, slots=True, eq=False)
class _Inserted:
    """New rows of a plan: (m,) the rows `where` before which they come, and their columns."""

    where: Index
    move: npt.NDArray[np.int32]
    target_mm: Array
    command_mm: Array
    reach: Array
    take_up: Mask
    play: Array

    @staticmethod
    def joined(*parts: _Inserted) -> _Inserted:
        """Those of several parts in the order of rows; those of an earlier part come first before one row."""
        where = np.concatenate([part.where for part in parts])
        order = np.argsort(where, kind="stable")

        def column(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in parts])[order]

        return _Inserted(where[order], *(column(f.name) for f in fields(_Inserted)[1:]))

    def into(self, rows: Plan) -> Plan:
        """A plan with them."""
        assert rows.play is not None

        def insert(column: npt.NDArray[_Scalar], new: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
            return np.insert(column, self.where, new, axis=0)

        return replace(
            rows,
            move=insert(rows.move, self.move),
            target_mm=insert(rows.target_mm, self.target_mm),
            command_mm=insert(rows.command_mm, self.command_mm),
            raw=insert(rows.raw, rows.raw[self.where]),
            reach=insert(rows.reach, self.reach),
            take_up=insert(rows.take_up, self.take_up),
            play=insert(rows.play, self.play),
        )


def _steps(
    model: ErrorModel, rows: Plan, tool: Array, held: Array, turns: Mask, before: Carried
) -> _Inserted:
    """Rows that turn the drive round before the load moves; `before` is of the row before the first one."""
    assert rows.play is not None
    where = np.flatnonzero(any_in_row(turns))
    target = _before(before.target_mm, rows.target_mm)[where]
    start = _before(before.command_mm, rows.command_mm)[where]
    play = rows.play[where]
    held = _before(before.held_mm, held)[where]
    command = invert(model, target + held, tool if tool.ndim == 1 else tool[where], play)
    # an axis that does not turn must not leave its side of the backlash here
    step = command - start
    stay = ~turns[where] & (step * play < 0)
    command[stay] = start[stay]
    reach = np.where(_same(rows, where), rows.reach[where - 1], 0.0)
    return _Inserted(where, rows.move[where], target, command, reach, np.ones(len(where), bool), play)


def _same(rows: Plan, where: Index) -> Mask:
    """Whether rows belong to the move of the one before them."""
    return np.asarray((where > 0) & (rows.move[where] == rows.move[where - 1]))


def _ends(
    model: ErrorModel, rows: Plan, tool: Array, held: Array, ramp: Ramps, before: Carried
) -> tuple[_Inserted, _Inserted]:
    """The rows at which ramps end, and those at which they begin."""
    early = ramp.before > 0.0
    start = _before(before.target_mm, rows.target_mm)

    def at(where: Index, share: Array) -> _Inserted:
        assert rows.play is not None
        target = start[where] + share[:, None] * (rows.target_mm[where] - start[where])
        play = rows.play[where]
        command = invert(model, target + held[where], tool if tool.ndim == 1 else tool[where], play)
        first = np.where(_same(rows, where), rows.reach[where - 1], 0.0)
        reach = first + share * (rows.reach[where] - first)
        return _Inserted(where, rows.move[where], target, command, reach, np.zeros(len(where), bool), play)

    return at(ramp.row, ramp.behind), at(ramp.row[early] - 1, 1.0 - ramp.before[early])


def _across(model: ErrorModel, rows: Plan, tool: Array, held: Array, ramp: Ramps) -> Plan:
    """The plan with drives amid their backlash where a ramp passes a turn."""
    assert rows.play is not None
    passes = ramp.done > 0.0
    row, done = ramp.row[passes], ramp.done[passes]
    at = row - 1
    play, command = rows.play.copy(), rows.command_mm.copy()
    play[at] += done[:, None] * (rows.play[row] - rows.play[at])
    command[at] = invert(model, rows.target_mm[at] + held[at], tool if tool.ndim == 1 else tool[at], play[at])
    return replace(rows, play=play, command_mm=command)
