"""Backlash as a play: where each axis lies in its backlash along a sequence of commands.

With backlash b the error of an axis follows e <- clip(e - dc, -b/2, +b/2), dc the change of command. In terms
of play = -2 e / b this is play <- clip(play * b_before / b + 2 dc / b, -1, +1). For b <= 0 (a control that
over-compensates, or an axis without backlash) play is the sign of the last motion.

Such maps p -> clip(m p + s, low, high) are closed under composition; a move longer than b maps all states to
one. So a doubling scan over the few moves that do not is enough: the number of its passes grows with the
logarithm of the longest run of short moves.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import UsageError
from olp.errormodel.base import ErrorModel
from olp.errormodel.boxed import as_points

#: A move longer than the backlash by this factor ends on one side of it, whatever is rounded.
_LONGER = 1.0 + 1e-9


def plays(model: ErrorModel, axis_mm: Array) -> Array | None:
    """(n, 3) play at successive commands (n, 3) from an unknown start; None where no axis has backlash."""
    width = model.backlash_at(axis_mm)
    return None if width is None else play_states(axis_mm, width)


def play_after(play: Array, moved_mm: Array, backlash_mm: Array | None) -> Array:
    """(n, 3) play after motions in one direction each, from `play` before them; all are (n, 3)."""
    width = np.zeros(play.shape) if backlash_mm is None else np.nan_to_num(backlash_mm)
    slack = width > 0.0
    gain = 2.0 * moved_mm / np.where(slack, width, 1.0)
    turned = np.where(moved_mm != 0.0, np.sign(moved_mm), play)
    return np.where(slack, np.clip(play + gain, -1.0, 1.0), turned)


def taken_up(old: Array, new: Array, moved_mm: Array, backlash_mm: Array) -> tuple[Index, Index, Array]:
    """Where axes that turned round have taken up all of their backlash inside of motions: (k,) the motion and
    the axis, and the share of the motion. `old` and `new` are the play before and after motions in one
    direction each; all are (n, 3)."""
    needed = np.abs(new - old) / 2 * np.maximum(np.nan_to_num(backlash_mm), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = needed / np.abs(moved_mm)
    motion, axis = np.nonzero((new != old) & (share < 1.0))
    return motion, axis, share[motion, axis]


def play_states(axis_mm: Array, backlash_mm: Array, start: Array | None = None) -> Array:
    """(n, 3) play in [-1, 1] at each of successive commands axis_mm (n, 3) with backlash (n, 3) or (3,).

    `start` (3,) is the play at the first command; None or NaN there: unknown. The middle of what is possible
    is returned: 0 until a motion narrows it. Raises UsageError for a wrong shape.
    """
    low, high = play_interval(axis_mm, backlash_mm, start)
    low += high
    low *= 0.5
    return low


def play_interval(axis_mm: Array, backlash_mm: Array, start: Array | None = None) -> tuple[Array, Array]:
    """Least and greatest possible play, both (n, 3); equal once the backlash has been taken up.

    `start` is as in `play_states`, or (2, 3): the least and the greatest play at the first command. A NaN
    command (an axis whose position is not known) makes the state unknown there and at the next one; a NaN
    backlash counts as none.
    """
    commands = as_points(axis_mm)
    width = np.asarray(backlash_mm, dtype=np.float64)
    if width.shape not in ((3,), commands.shape):
        raise UsageError(f"backlash_mm has shape {width.shape}; expected (3,) or {commands.shape}")
    state = np.full(3, np.nan) if start is None else np.asarray(start, dtype=np.float64)
    if state.shape not in ((3,), (2, 3)):
        raise UsageError(f"start has shape {state.shape}; expected (3,) or (2, 3)")
    state = np.broadcast_to(state, (2, 3))
    low, high = np.zeros(commands.shape), np.zeros(commands.shape)
    if len(commands):
        for j in range(3):
            one_width = np.full(len(commands), width[j]) if width.ndim == 1 else width[:, j].copy()
            command = np.ascontiguousarray(commands[:, j])
            one_width[np.isnan(one_width)] = 0.0
            low[:, j], high[:, j] = _interval(command, one_width, float(state[0, j]), float(state[1, j]))
    return low, high


def _interval(command: Array, width: Array, least: float, greatest: float) -> tuple[Array, Array]:
    """Least and greatest play (n,) of one axis, from these two at its first command."""
    motion = np.diff(command)
    lost = np.isnan(motion)
    same = (motion == 0.0) & ((width[1:] == width[:-1]) | (width[1:] <= 0.0))
    # Commands that leave the axis alone repeat the state before them.
    kept = np.concatenate([[0], np.flatnonzero(~same) + 1])
    moved = kept[1:] - 1
    whole = len(kept) == len(command)
    rows = slice(None) if whole else moved
    step, before, now = motion[rows], width[:-1][rows], width[1:][rows]
    low, gain, shift = np.empty(len(kept)), np.ones(len(kept)), np.zeros(len(kept))
    low[1:] = np.sign(step)
    high = low.copy()
    # a move longer than the backlash, or without any, leads to one state from all
    both = np.where(now > 0.0, now + np.where(before > 0.0, before, now), 0.0)
    short = np.flatnonzero(~(2.0 * np.abs(step) > _LONGER * both)) + 1
    if len(short):
        maps = _maps(step[short - 1], before[short - 1], now[short - 1])
        gain[short], shift[short], low[short], high[short] = maps
    sources = np.concatenate([[True], lost[moved]])
    low[sources], high[sources] = -1.0, 1.0
    _scan(gain, shift, low, high, sources)
    if not np.isnan(least) and not np.isnan(command[0]):
        # Until the first loss of position the maps run from the given state.
        known = slice(0, int(np.flatnonzero(sources)[1]) if sources.sum() > 1 else len(kept))
        own_gain, own_shift, own = gain[known], shift[known], (low[known].copy(), high[known].copy())
        low[known] = np.clip(own_gain * least + own_shift, *own)
        high[known] = np.clip(own_gain * greatest + own_shift, *own)
    if whole:
        return low, high
    repeats = np.diff(np.concatenate([kept, [len(command)]]))
    return np.repeat(low, repeats), np.repeat(high, repeats)


def _maps(motion: Array, before: Array, width: Array) -> tuple[Array, Array, Array, Array]:
    """The map of each motion: gain, shift, and the image of [-1, 1]."""
    slack = width > 0.0
    safe = np.where(slack, width, 1.0)
    gain = np.where(slack & (before > 0.0), before / safe, 1.0)
    end = np.where(motion > 0.0, np.inf, np.where(motion < 0.0, -np.inf, 0.0))
    shift = np.where(slack, 2.0 * motion / safe, end)
    return gain, shift, np.clip(shift - gain, -1.0, 1.0), np.clip(shift + gain, -1.0, 1.0)


def _scan(gain: Array, shift: Array, low: Array, high: Array, sources: npt.NDArray[np.bool_]) -> None:
    """Compose each map with all before it, back to the last source, in place."""
    first = np.maximum.accumulate(np.where(sources, np.arange(len(gain)), 0))
    active = np.flatnonzero(low != high)
    reach = 1
    while True:
        active = active[(active - reach >= first[active]) & (low[active] != high[active])]
        if not len(active):
            return
        before = active - reach
        g, s, a, b = gain[active], shift[active], low[active], high[active]
        new_gain, new_shift = g * gain[before], g * shift[before] + s
        new_low = np.clip(g * low[before] + s, a, b)
        new_high = np.clip(g * high[before] + s, a, b)
        gain[active], shift[active], low[active], high[active] = new_gain, new_shift, new_low, new_high
        reach *= 2
