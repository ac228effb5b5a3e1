"""What a logged run tells of a control: velocity, acceleration and jerk of each axis, and its corners.

What the log holds for a while is a limit, or what the program asks for; a single sample may be a corner or
noise. Velocities and accelerations are each those of the log, or those of the machine file where the log is
below them: what gives the time of the log best. Where a parameter of corners is learned, they are those of
the log, and the parameter is the one that gives its time. Jerk is that of the log for controls that limit
it, where the digits of the log show it; else that of the machine file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from olp.core.arrays import Array, Mask
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
#: the same for jerk, in whose differences a corner is longer
HELD_JERK = 6
#: how far a parameter of corners may be from its default, as a factor
RANGE = 1e4
_HALVINGS = 40
#: of a jerk, at most, that the last digit of the log may be
_BY_DIGIT = 0.1
#: by this share a choice of limits has to be nearer to the time of the log than one before
BETTER = 0.1
#: of the time of a log: by so much the time that is computed may miss it
MISSED = 0.02
#: times the time with the limits of the machine file, at most, that a run takes
_TIMES = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """`limits` of the run, (3,) the axes that `moved` and those whose jerk was `shown`, `seconds` of the
    motion, and `values` of the parameters."""

    limits: AxisSpeeds
    moved: Mask
    shown: Mask
    seconds: float
    values: dict[str, float]


def learned(
    control: Control, parts: Sequence[Moves], stated: AxisSpeeds, values: Mapping[str, float],
    time_s: Array, point_mm: Array,
) -> Learned:  # fmt: skip
    """From a log (n,), (n, 3) of a whole run, sampled evenly. Raises UsageError for a log without motion, one
    that is not even in time, or one whose time nothing gives."""
    if len(time_s) > 2 and 0.0 < time_s[-1] - time_s[-2] < time_s[1] - time_s[0]:
        # the end of the motion between two samples
        time_s, point_mm = time_s[:-1], point_mm[:-1]
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
    jerk, shown = _jerk(control, around, change, count, width)
    jerk = np.where(shown, jerk, stated.jerk)
    seconds = (last - first) * step_s
    _refuse_time(sum(_seconds(control, part, stated, values) for part in parts), seconds)
    # where corners are learned too, the time alone does not say which limits are meant
    speeds = (velocity,) if control.corners else (np.maximum(velocity, stated.velocity), velocity)
    changes = (
        (acceleration,) if control.corners else (np.maximum(acceleration, stated.acceleration), acceleration)
    )
    choices = (
        AxisSpeeds(np.where(moved, v, stated.velocity), np.where(moved, a, stated.acceleration), jerk)
        for v, a in product(speeds, changes)
    )
    best: tuple[float, AxisSpeeds, dict[str, float]] | None = None
    for limits in choices:
        fitted, off = _corners(control, parts, limits, values, seconds)
        if best is None or abs(off) < (1.0 - BETTER) * best[0]:
            best = abs(off), limits, fitted
    assert best is not None
    return Learned(best[1], moved, shown, seconds, best[2])


def _step(time_s: Array) -> float:
    steps = np.diff(time_s)
    if len(steps) < 10 * HELD:
        raise UsageError(f"the log has {len(time_s)} rows of a run; expected more than {10 * HELD}")
    middle = float(np.median(steps))
    off = np.flatnonzero(np.abs(steps - middle) > 0.2 * abs(middle))
    if middle <= 0.0 or off.size:
        row = int(off[0]) if off.size else 0
        raise UsageError(
            f"the log is not sampled evenly in time: its row {row + 2} comes {steps[row]:g} s behind the one "
            f"before, and most others {middle:g} s; expected equal steps"
        )
    return float(steps.mean())


def _refuse_time(expected: float, seconds: float) -> None:
    """Raise UsageError where a log takes quite another time than the limits of the machine file give."""
    if not expected / _TIMES < seconds < expected * _TIMES:
        raise UsageError(
            f"the run in the log takes {seconds:g} s, and with the limits of the machine file it would take "
            f"{expected:g} s; expected a whole run of this program, with times in s"
        )


def _seconds(control: Control, part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> float:
    return float(move_seconds(control, part, limits, values).sum()) + part.dwell_s


def _difference(rows: Array, count: int) -> Array:
    return np.asarray(rows[count:] - rows[:-count])


def _jerk(control: Control, point: Array, change: Array, count: int, width: float) -> tuple[Array, Mask]:
    """(3,) the jerk that is held, and the axes of which the digits of the log show it."""
    jerk = _held(_difference(change, count) / width, HELD_JERK * count)
    # a log of few digits has no third difference that is smaller than its last one
    step = np.abs(np.diff(point, 3, axis=0))
    digit = np.where(step > 0.0, step, np.inf).min(axis=0)
    # a third difference has four times the last digit at most
    noise = 4.0 * np.where(np.isfinite(digit), digit, 0.0) / width**3
    return jerk, np.asarray(control.bells & (jerk > 0.0) & (noise < _BY_DIGIT * jerk))


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
        return sum(_seconds(control, part, limits, given) for part in parts) - seconds

    best = dict(values)
    if control.corners:
        low, high = values[control.corners] / RANGE, values[control.corners] * RANGE
        slow, fast = (excess({**values, control.corners: value}) for value in (low, high))
        if slow < -MISSED * seconds or fast > MISSED * seconds:
            way = "more than the sharpest corners take" if slow < 0.0 else "less than the widest corners take"
            raise UsageError(
                f"the run in the log takes {seconds:g} s, {way}: no {control.corners} gives it; expected a "
                "whole run of this program on this control, at its programmed feeds"
            )
        if slow - fast < MISSED * seconds:
            # its corners say nothing
            return best, excess(best)
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(low * high))
            # a larger one is never slower
            low, high = (middle, high) if excess({**values, control.corners: middle}) > 0.0 else (low, middle)
        best[control.corners] = high
    return best, excess(best)
