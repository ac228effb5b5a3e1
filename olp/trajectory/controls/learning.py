"""What a logged run tells of a control: velocity and acceleration of each axis, and its corners.

What the log holds for a while is a limit, or what the program asks for; a single sample may be a corner or
noise. Velocities and accelerations are each those of the log, or those of the machine file where the log is
below them: what gives the time of the log best. Where a parameter of corners is learned, they are those of
the log, and the parameter is the one that gives its time. No control with a profile limits jerk, so none is
looked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.trajectory.controls.base import AxisSpeeds, Control, move_seconds
from olp.trajectory.controls.moves import Moves

#: s; differences are taken over this time, so that the last digit of a log does not count
STEP_S = 4e-3
#: steps for which a limit has to be held
HELD = 3
#: mm; an axis that moves less stands still
STILL_MM = 1e-3
#: how far a parameter of corners may be from its default, as a factor
RANGE = 1e4
_HALVINGS = 40
#: by this share a choice of limits has to be nearer to the time of the log than one before
BETTER = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """`limits` of the run, (3,) the axes that `moved`, `seconds` of the motion, and `values` of the
    parameters."""

    limits: AxisSpeeds
    moved: Array
    seconds: float
    values: dict[str, float]


def learned(
    control: Control, parts: Sequence[Moves], stated: AxisSpeeds, values: Mapping[str, float],
    time_s: Array, point_mm: Array,
) -> Learned:  # fmt: skip
    """From a log (n,), (n, 3) of a whole run, sampled evenly. Raises UsageError for a log without motion, or
    one that is not even in time."""
    step_s = _step(time_s)
    moving = np.flatnonzero((np.abs(np.diff(point_mm, axis=0)) > 0.0).any(axis=1))
    if not moving.size:
        raise UsageError("nothing moves in the log; expected the positions of a whole run")
    first, last = int(moving[0]), int(moving[-1]) + 1
    count = max(round(STEP_S / step_s), 1)
    width = count * step_s
    around = np.pad(point_mm[first : last + 1], ((4 * count, 4 * count), (0, 0)), mode="edge")
    speed = _difference(around, count) / width
    change = _difference(speed, count) / width
    moved = np.ptp(point_mm, axis=0) > STILL_MM
    velocity, acceleration = (_held(rows, HELD * count) for rows in (speed, change))
    seconds = (last - first) * step_s
    # where corners are learned too, the time alone does not say which limits are meant
    speeds = (velocity,) if control.corners else (np.maximum(velocity, stated.velocity), velocity)
    changes = (
        (acceleration,) if control.corners else (np.maximum(acceleration, stated.acceleration), acceleration)
    )
    choices = (
        AxisSpeeds(np.where(moved, v, stated.velocity), np.where(moved, a, stated.acceleration))
        for v, a in product(speeds, changes)
    )
    best: tuple[float, AxisSpeeds, dict[str, float]] | None = None
    for limits in choices:
        fitted, off = _corners(control, parts, limits, values, seconds)
        if best is None or abs(off) < (1.0 - BETTER) * best[0]:
            best = abs(off), limits, fitted
    assert best is not None
    return Learned(best[1], moved, seconds, best[2])


def _step(time_s: Array) -> float:
    steps = np.diff(time_s)
    if len(steps) < 10 * HELD or not steps.min() > 0.0 or np.ptp(steps) > 0.2 * steps.mean():
        raise UsageError(
            "the log is not sampled evenly in time; expected a column of times in s with equal steps, and "
            f"more than {10 * HELD} rows"
        )
    return float(steps.mean())


def _difference(rows: Array, count: int) -> Array:
    return np.asarray(rows[count:] - rows[:-count])


def _held(rows: Array, count: int) -> Array:
    """(3,) the largest size that `count` rows in sequence have."""
    if len(rows) < count:
        return np.zeros(3)
    windows = np.lib.stride_tricks.sliding_window_view(np.abs(rows), count, axis=0)
    return np.asarray(windows.min(axis=-1).max(axis=0))


def _corners(
    control: Control, parts: Sequence[Moves], limits: AxisSpeeds, values: Mapping[str, float], seconds: float
) -> tuple[dict[str, float], float]:
    """The values with the parameter of corners that gives the time of the log, as near as it can, and how
    much longer the time is with them."""

    def excess(given: Mapping[str, float]) -> float:
        time = sum(float(move_seconds(control, part, limits, given).sum()) + part.dwell_s for part in parts)
        return time - seconds

    best = dict(values)
    if control.corners:
        low, high = values[control.corners] / RANGE, values[control.corners] * RANGE
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(low * high))
            # a larger one is never slower
            low, high = (middle, high) if excess({**values, control.corners: middle}) > 0.0 else (low, middle)
        best[control.corners] = high
    return best, excess(best)
