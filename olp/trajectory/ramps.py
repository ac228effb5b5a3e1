"""Closed forms of one ramp: from one speed to another in least time, without acceleration at both ends.

A ramp from v0 to v1 keeps |jerk| <= J and |acceleration| <= A: jerk up, perhaps a stretch at A, jerk down.
With D = |v1 - v0| it takes 2 sqrt(D/J) where A is not reached (D J <= A^2), else D/A + A/J. As it is
point-symmetric, its length is (v0 + v1)/2 times that. All functions take and return arrays (n,), mm and s.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array

#: share of the speed below which a change of speed is rounding, and is not made
_NO_CHANGE = 1e-10
#: half the Newton steps at most
_FEW = 24
#: ramps at a time: columns of so many stay in the cache
_BLOCK = 1 << 13


def phases(v0: Array, v1: Array, acceleration: Array, jerk: Array) -> tuple[Array, Array]:
    """Seconds of each of the two jerk phases, and of the stretch at `acceleration` between them."""
    change = np.abs(v1 - v0)
    full = acceleration / jerk
    steep = change > acceleration * full
    return np.where(steep, full, np.sqrt(change / jerk)), np.where(steep, change / acceleration - full, 0.0)


def seconds(v0: Array, v1: Array, acceleration: Array, jerk: Array) -> Array:
    """Duration of the ramp."""
    bend, flat = phases(v0, v1, acceleration, jerk)
    return 2.0 * bend + flat


def distance(v0: Array, v1: Array, acceleration: Array, jerk: Array) -> Array:
    """Length of the ramp, mm."""
    return 0.5 * (v0 + v1) * seconds(v0, v1, acceleration, jerk)


def reach(v0: Array, length: Array, acceleration: Array, jerk: Array) -> Array:
    """The largest speed that a ramp from `v0` reaches in `length` mm.

    With A: v1^2 + v1 A^2/J + v0 A^2/J - v0^2 - 2 A length = 0. Without: y = sqrt(v1 - v0) solves
    y^3 + 2 v0 y = length sqrt(J), which has one root, in closed form by the hyperbolic sine.
    """
    full = acceleration * acceleration / jerk
    steep = length >= (v0 + 0.5 * full) * 2.0 * acceleration / jerk
    v1 = np.empty_like(v0)
    v, f, d = v0[steep], full[steep], length[steep]
    c = 2.0 * acceleration[steep] * d + v * v - v * f
    v1[steep] = 2.0 * c / (f + np.sqrt(f * f + 4.0 * c))
    rest = ~steep
    v, d = v0[rest], length[rest] * np.sqrt(jerk[rest])
    k = np.sqrt(v / 1.5)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        z = 1.5 * d / (2.0 * v * k)
        y = np.where(z < 1e100, 2.0 * k * np.sinh(np.arcsinh(z) / 3.0), np.cbrt(d))
    v1[rest] = v + y * y
    # a change near the rounding of the speed has no digits to compute its time from
    return np.where(v1 - v0 < _NO_CHANGE * v0, v0, v0 + (v1 - v0) * (1.0 - 1e-12))


def reach_one(v0: float, length: float, acceleration: float, jerk: float) -> float:
    """`reach` of one ramp, without the cost of arrays."""
    full = acceleration * acceleration / jerk
    if length >= (v0 + 0.5 * full) * 2.0 * acceleration / jerk:
        c = 2.0 * acceleration * length + v0 * v0 - v0 * full
        v1 = 2.0 * c / (full + math.sqrt(full * full + 4.0 * c))
    else:
        d = length * math.sqrt(jerk)
        k = math.sqrt(v0 / 1.5)
        z = 1.5 * d / (2.0 * v0 * k) if v0 > 0.0 and v0 * k > 0.0 else math.inf
        y = 2.0 * k * math.sinh(math.asinh(z) / 3.0) if z < 1e100 else math.cbrt(d)
        v1 = v0 + y * y
    return v0 if v1 - v0 < _NO_CHANGE * v0 else v0 + (v1 - v0) * (1.0 - 1e-12)


def peak(v0: Array, v1: Array, length: Array, top: Array, acceleration: Array, jerk: Array) -> Array:
    """The largest speed <= `top` at which both ramps, from v0 and to v1, fit into `length`."""
    result = np.empty_like(v0)
    for a in range(0, len(v0), _BLOCK):
        some = slice(a, a + _BLOCK)
        result[some] = _peak(v0[some], v1[some], length[some], top[some], acceleration[some], jerk[some])
    return result


def _peak(v0: Array, v1: Array, length: Array, top: Array, acceleration: Array, jerk: Array) -> Array:
    """Bracketed Newton; the lower bracket is returned, so the ramps always fit.

    It looks for y, the root of what the peak is above the larger speed. Over the speed itself a length has an
    infinite slope where its ramp begins. Over y both lengths are smooth and bend upwards, so that a few steps
    from above do."""
    low, other = np.maximum(v0, v1), np.minimum(v0, v1)
    high = np.maximum(top, low)
    gap = distance(low, high, acceleration, jerk) + distance(other, high, acceleration, jerk) - length
    todo = np.flatnonzero(gap > 0.0)
    result = high.copy()
    result[todo] = low[todo]
    trial = np.sqrt(high[todo] - low[todo])
    lo, hi = np.zeros(todo.size), trial
    for step in range(_FEW * 2):
        if not todo.size:
            break
        b, c, a, j = low[todo], other[todo], acceleration[todo], jerk[todo]
        peak = b + trial * trial
        t0, t1 = seconds(b, peak, a, j), seconds(c, peak, a, j)
        f = 0.5 * ((b + peak) * t0 + (c + peak) * t1) - length[todo]
        fits = f <= 0.0
        lo, hi = np.where(fits, trial, lo), np.where(fits, hi, trial)
        result[todo] = np.where(fits, peak, result[todo])
        # d/dy of both lengths, with dp/dy = 2 y
        with np.errstate(divide="ignore", invalid="ignore"):
            s0 = np.where(trial * trial * j <= a * a, 2.0 / np.sqrt(j), 2.0 * trial / a)
            s1 = np.where((peak - c) * j <= a * a, 2.0 * trial / np.sqrt((peak - c) * j), 2.0 * trial / a)
            s1 = np.where(peak > c, s1, s0)
            slope = trial * (t0 + t1) + 0.5 * ((b + peak) * s0 + (c + peak) * s1)
            # slightly below the root, so that the bracket closes from the side that fits
            newton = (trial - f / slope) * (1.0 - 1e-12)
        good = (newton > lo) & (newton < hi) & (step % 8 != 7)
        trial = np.where(good, newton, 0.5 * (lo + hi))
        on = (hi * hi - lo * lo > 1e-11 * (b + lo * lo)) & ~(fits & (f > -1e-10 * length[todo]))
        todo, lo, hi, trial = todo[on], lo[on], hi[on], trial[on]
    return result


def passing(speed: Array, v0: Array, v1: Array, acceleration: Array, jerk: Array) -> Array:
    """Length from the start of a rising ramp to where it reaches `speed` (v0 <= speed <= v1)."""
    bend, flat = phases(v0, v1, acceleration, jerk)
    gain = 0.5 * jerk * bend * bend
    done = speed - v0
    first = np.minimum(np.sqrt(2.0 * done / jerk), bend)
    length = first * (v0 + jerk * first * first / 6.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(flat > 0.0, np.clip((done - gain) / (jerk * bend), 0.0, flat), 0.0)
    length += second * (v0 + gain + 0.5 * jerk * bend * second)
    rest_s = np.sqrt(2.0 * np.maximum(v1 - speed, 0.0) / jerk)
    back = 0.5 * (v0 + v1) * (2.0 * bend + flat) - rest_s * (v1 - jerk * rest_s * rest_s / 6.0)
    return np.where(done <= np.maximum(gain, (v1 - v0) - gain), length, back)


def when(length: Array, speed: Array, acceleration: Array, jerk: Array, most: Array) -> Array:
    """Seconds, 0 to `most`, after which speed t + acceleration t^2/2 + jerk t^3/6 equals `length`; the cubic
    rises over that time. Bracketed Newton to rounding."""
    half, sixth = 0.5 * acceleration, jerk / 6.0
    whole = most * (speed + most * (half + most * sixth))
    with np.errstate(divide="ignore", invalid="ignore"):
        result = np.clip(np.where(whole > 0.0, most * (length / whole), 0.0), 0.0, most)
    todo = np.arange(len(length))
    lo, hi, t = np.zeros_like(length), most.copy(), result.copy()
    for step in range(80):
        if not todo.size:
            break
        v, h, s = speed[todo], half[todo], sixth[todo]
        f = t * (v + t * (h + t * s)) - length[todo]
        slope = v + t * (2.0 * h + 3.0 * t * s)
        lo = np.where(f <= 0.0, t, lo)
        hi = np.where(f >= 0.0, t, hi)
        with np.errstate(divide="ignore", invalid="ignore"):
            move = f / slope
        new = t - move
        good = (new >= lo) & (new <= hi) & (step % 6 != 5)
        new = np.where(good, new, 0.5 * (lo + hi))
        result[todo] = new
        on = np.abs(new - t) > 1e-15 * most[todo]
        todo, lo, hi, t = todo[on], lo[on], hi[on], new[on]
    return result
