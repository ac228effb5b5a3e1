"""Jerk-limited moves of one axis in closed form: speed rises to one peak, holds, and falls.

It judges the results of Ruckig, and replaces those that fail. Between two speeds with an acceleration at the
start the fastest change has at most three phases (jerk +J, 0, -J). The peak speed follows by bisection, as
the distance grows with it; the rest of the length is driven at the peak. All arrays are (m,), in any one unit
of length and time.
Source: Biagiotti, Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 3.4.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass

#: columns of a move: 2 to reach an allowed state, 3 up, the cruise, 3 down, 1 to leave with acceleration
PHASES = 10
#: the column of the cruise
CRUISE = 5
#: bisections of the peak speed: all digits of a float
_HALVINGS = 64
#: against division by zero
_TINY = float(np.finfo(np.float64).tiny)


def rest_to_rest_s(length: Array, velocity: Array, acceleration: Array, jerk: Array) -> Array:
    """(m,) least time from rest to rest over `length` >= 0."""
    peak = np.minimum(acceleration, np.sqrt(jerk * velocity))
    cruise = length / velocity + velocity / peak + peak / jerk
    ramp = acceleration / jerk
    full = ramp + np.sqrt(ramp * ramp + 4.0 * length / acceleration)
    short = 4.0 * np.cbrt(length / (2.0 * jerk))
    unlimited = np.where(length >= 2.0 * acceleration * ramp * ramp, full, short)
    result: Array = np.where(length >= velocity * (velocity / peak + peak / jerk), cruise, unlimited)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """States at the start of phases (m, 10): position from 0, velocity, acceleration.

    `missing` (3, m) is the absolute gap of each at the cruise, between the phases before it, integrated from
    the start, and those after it, integrated from the end."""

    position: Array
    velocity: Array
    acceleration: Array
    missing: Array


def states(
    durations: Array, jerks: Array, length: Array, v0: Array, a0: Array, v1: Array, a1: Array
) -> States:
    """States of phases (m, 10), integrated from both ends, so that rounding does not add up over the cruise.

    Start and target are met exactly; the cruise has the speed that joins both halves."""
    count = len(durations)
    p, v, a = (np.zeros((count, PHASES)) for _ in range(3))
    x, w, b = np.zeros(count), v0, a0
    for i in range(CRUISE):
        p[:, i], v[:, i], a[:, i] = x, w, b
        x, w, b = _after(durations[:, i], jerks[:, i], x, w, b)
    y, z, c = length, v1, a1
    for i in range(PHASES - 1, CRUISE, -1):
        y, z, c = _after(-durations[:, i], jerks[:, i], y, z, c)
        p[:, i], v[:, i], a[:, i] = y, z, c
    time = durations[:, CRUISE]
    gap = y - x - time * w
    joins = np.abs(gap) <= 1e-10 * time * w
    held = np.where(joins, w + gap / np.maximum(time, _TINY), w)
    missing = np.stack([np.where(joins, 0.0, gap), z - w, c - b])
    p[:, CRUISE], v[:, CRUISE] = x, held
    # without a cruise the acceleration continues; the column of the cruise is not driven then
    a[:, CRUISE] = 0.0
    missing[2] = np.where(time > 0.0, np.maximum(np.abs(b), np.abs(c)), missing[2])
    return States(p, v, a, np.abs(missing))


def _after(t: Array, j: Array, p: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    return p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j


def through_peak(
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array,
    velocity: Array, acceleration: Array, jerk: Array,
) -> tuple[Array, Array, Mask]:  # fmt: skip
    """Durations and jerks (m, 10) of moves over `length` from speed `v0`, acceleration `a0` to `v1`, `a1`,
    and whether such a move exists with speeds >= 0.

    Where a0 >= 0 >= a1 it is the fastest of all. The acceleration of a braking start, or of a rising end, is
    first taken to zero."""
    head, tail = np.minimum(a0, 0.0), np.maximum(a1, 0.0)
    ramp_in, ramp_out = -head / jerk, tail / jerk
    low0 = v0 + head * ramp_in / 2.0
    low1 = v1 - tail * ramp_out / 2.0
    # positions gained while the acceleration returns to zero at +J, or leaves zero at +J
    ends = ramp_in * (v0 + ramp_in * (head / 2.0 + ramp_in * jerk / 6.0)) + ramp_out * (
        low1 + jerk * ramp_out * ramp_out / 6.0
    )
    rise, fall = np.maximum(a0, 0.0), np.maximum(-a1, 0.0)
    inner = length - ends

    def phases(peak: Array) -> tuple[Array, Array]:
        up = _change(low0, rise, peak, acceleration, jerk)
        down = _change(low1, fall, peak, acceleration, jerk)
        return np.stack(up[:3]), np.stack(down[:3])

    def distance(peak: Array) -> Array:
        up = _change(low0, rise, peak, acceleration, jerk)[3]
        down: Array = _change(low1, fall, peak, acceleration, jerk)[3]
        return up + down

    low = np.maximum(low0 + rise * rise / (2.0 * jerk), low1 + fall * fall / (2.0 * jerk))
    # the least peak can be the exact answer: a distance beyond the length by rounding is no failure
    short = inner - distance(low)
    exists = (low0 >= -1e-12 * velocity) & (low1 >= -1e-12 * velocity) & (low <= velocity * (1.0 + 1e-9))
    exists &= short >= -1e-13 * length
    high = np.maximum(velocity, low)
    fits = distance(high) <= inner
    low = np.where(fits, high, low)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        fits = distance(middle) <= inner
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    up, down = phases(low)
    cruise = np.maximum(inner - distance(low), 0.0) / np.maximum(low, _TINY)
    zero = np.zeros(len(jerk))
    times = np.stack([ramp_in, zero, *up, cruise, *down[::-1], ramp_out], axis=1)
    signs = np.stack([jerk, zero, jerk, zero, -jerk, zero, -jerk, zero, jerk, jerk], axis=1)
    exists &= np.isfinite(times).all(axis=1)
    return times, signs, exists


def _change(
    v0: Array, a0: Array, v1: Array, acceleration: Array, jerk: Array
) -> tuple[Array, Array, Array, Array]:
    """Times of the three phases, and the distance, from speed v0 with acceleration a0 >= 0 up to v1 without
    acceleration."""
    free = np.sqrt(np.maximum(jerk * (v1 - v0) + a0 * a0 / 2.0, 0.0))
    top = np.maximum(np.minimum(free, acceleration), a0)
    t1, t3 = (top - a0) / jerk, top / jerk
    gained = (top * top - a0 * a0 / 2.0) / jerk
    t2 = np.where(free > top, np.maximum(v1 - v0 - gained, 0.0) / np.maximum(top, _TINY), 0.0)
    d = t1 * (v0 + t1 * (a0 / 2.0 + t1 * jerk / 6.0))
    w = v0 + t1 * (a0 + t1 * jerk / 2.0)
    d += t2 * (w + t2 * top / 2.0)
    # the last phase seen from its end, where the speed is v1
    d += t3 * (v1 - t3 * t3 * jerk / 6.0)
    return t1, t2, t3, d
