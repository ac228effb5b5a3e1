"""The inverse of an error model: the command c with c + e(c) = target."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import NotInvertible
from olp.errormodel.base import ErrorModel

#: mm; a command is good when the error there differs by less from the error with which it was computed.
TOLERANCE_MM = 1e-9
#: Steps of the iteration, at most.
_ITERATIONS = 30
#: mm; smaller errors change by less than a thousandth of themselves over their own length.
_SMALL_MM = 0.15
#: mm per mm; rate of growth of the error that is assumed at the least: that of steep cyclic errors, of which
#: two steps near a turning point show less.
_LEAST_RATE = 0.1
#: Points at a time: the columns of one block fit in the second-level cache.
BLOCK = 1 << 14


def invert(model: ErrorModel, target_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
    """Commands (n, 3) that bring the tip to the targets, by fixed-point iteration c <- target - e(c).

    Converges while the error grows slower than the position (its Lipschitz constant is about 1e-3 on a bad
    machine). A component whose error is not finite, because an axis that it depends on is unknown, keeps its
    target. Raises NotInvertible where 1e-9 mm is not reached.
    """
    command = np.zeros_like(target_mm)
    for a in range(0, len(target_mm), BLOCK):
        part = slice(a, a + BLOCK)
        tool = tool_mm if tool_mm.ndim == 1 else tool_mm[part]
        state = None if play is None else play[part]
        target = target_mm[part]
        row, guess = np.arange(a, a + len(target)), target
        previous, step = np.zeros((1, 3)), np.zeros(len(target))
        for i in range(_ITERATIONS):
            e = model.error(guess, tool, state)
            unknown = np.isnan(e)
            if unknown.any():
                e[unknown] = 0.0
            change = _largest(e - previous)
            # each point ends with its own last step, whatever the points beside it are
            good = change < TOLERANCE_MM if i else np.zeros(len(row), bool)
            guess = np.where(good[:, None], guess, target - e) if good.any() else target - e
            if i:
                # the next change will be this one times the rate at which the error grows
                good |= change * np.maximum(_LEAST_RATE * step, 10.0 * change) < TOLERANCE_MM * step
            previous, step = e, change
            if good.any():
                command[row] = guess
                some = np.flatnonzero(~good)
                row, target, guess, previous, step = (
                    row[some], target[some], guess[some], previous[some], step[some]
                )  # fmt: skip
                tool = tool if tool.ndim == 1 else tool[some]
                state = None if state is None else state[some]
            if not len(row):
                break
        else:
            raise NotInvertible(
                f"the error model cannot be inverted to {TOLERANCE_MM:g} mm: its errors grow as fast as the "
                f"position (the last step was {change.max():.3g} mm); check the values of the calibration"
            )
    return command


def _largest(vectors: Array) -> Array:
    """(n,) the largest size of a component of each vector (n, 3)."""
    size = np.abs(vectors)
    return np.asarray(np.maximum(np.maximum(size[:, 0], size[:, 1]), size[:, 2]))


def bent(model: ErrorModel, target_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
    """Commands for samples between waypoints, as they lie: targets less `lag`."""
    return np.asarray(target_mm - lag(model, target_mm, tool_mm, play), float)


def lag(model: ErrorModel, target_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
    """(n, 3) how far commands for samples between waypoints lie behind the targets, whatever the samples
    beside them are. It is one step of the iteration where the error is small, which is right to a few
    nanometres, and two elsewhere."""
    error = model.error(target_mm, tool_mm, play)
    # mostly all are small, and NaN is not
    if np.max(error, initial=0.0) <= _SMALL_MM and np.min(error, initial=0.0) >= -_SMALL_MM:
        return error
    some = np.flatnonzero(_largest(error) > _SMALL_MM)
    if some.size:
        tool = tool_mm if tool_mm.ndim == 1 else tool_mm[some]
        error[some] = model.error((target_mm - error)[some], tool, None if play is None else play[some])
    return error
