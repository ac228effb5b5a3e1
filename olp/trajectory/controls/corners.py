"""Laws of corners and curves that several controls have in common.

A turn of the direction by du within a width w to both sides leaves the corner by |du| w / 6. At the speed v
it has an acceleration of v^2 du / w and a jerk of v^3 du / w^2. Where points are close, the turns of all
points within the width add up to a curve.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.trajectory.controls.base import AxisSpeeds
from olp.trajectory.controls.moves import Moves

#: of a corner's own width, |du| / 6 of it is how far the path leaves it
PER_WIDTH = 6.0
#: of the shorter one of both moves, at most, that a corner takes
SHARE = 0.5
#: points to both sides whose turns make a curve
_NEAR = 16
#: mm; the first of the tolerances at which a fitted curve is looked at, each twice the one before
_FIRST_MM = 2.5e-4
#: how many there are
_STEPS = 14
_TINY = 1e-300


def turns(part: Moves) -> Array:
    """(m - 1, 3) the change of direction at each joint."""
    return np.asarray(part.begin[1:] - part.leave[:-1])


def half_mm(part: Moves) -> Array:
    """(m - 1,) how far a corner may reach into both moves."""
    return np.asarray(SHARE * np.minimum(part.length_mm[:-1], part.length_mm[1:]))


def rounded_mm_s(part: Moves, limits: AxisSpeeds, width_mm: Array) -> Array:
    """(m - 1,) the speed of corners that are rounded within a width (m - 1,) to both sides; 0 for none."""
    turn = np.abs(turns(part))
    wide = np.maximum(width_mm, 0.0)[:, None]
    with np.errstate(divide="ignore", over="ignore"):
        by_a = np.sqrt((limits.acceleration * wide / np.maximum(turn, _TINY)).min(axis=1))
        by_j = np.cbrt((limits.jerk * wide * wide / np.maximum(turn, _TINY)).min(axis=1))
    straight = (turn <= 1e-12).all(axis=1)
    return np.asarray(np.where(straight, np.inf, np.minimum(by_a, by_j)))


def within(part: Moves, tolerance_mm: Array) -> Array:
    """(m - 1,) the width of corners within a tolerance (m - 1,)."""
    size = np.sqrt((turns(part) ** 2).sum(axis=1))
    return np.asarray(np.minimum(PER_WIDTH * tolerance_mm / np.maximum(size, _TINY), half_mm(part)))


def fitted_mm_s(part: Moves, limits: AxisSpeeds, tolerance_mm: Array) -> Array:
    """(m - 1,) the speed where points are fitted by a curve within a tolerance (m - 1,).

    A curve that stays farther within is fitted, too. So the speed is the largest one of all tolerances up to
    the stated one, and never falls where that rises.
    """
    speed = rounded_mm_s(part, limits, within(part, tolerance_mm))
    most = float(tolerance_mm.max(initial=0.0))
    before = np.zeros(len(tolerance_mm))
    low = 0.0
    for high in _FIRST_MM * 2.0 ** np.arange(_STEPS):
        here = np.maximum(before, _curve_mm_s(part, limits, high))
        share = np.clip((tolerance_mm - low) / (high - low), 0.0, 1.0)
        speed = np.maximum(speed, before + share * (np.minimum(here, 1e9) - before))
        before, low = np.minimum(here, 1e9), high
        if high >= most:
            break
    return speed


def _curve_mm_s(part: Moves, limits: AxisSpeeds, tolerance_mm: float) -> Array:
    """(m - 1,) the speed of the curve of all points within one tolerance."""
    turn = turns(part)
    size = np.maximum(np.sqrt((turn * turn).sum(axis=1)), 1e-12)
    gap = 0.5 * (part.length_mm[:-1] + part.length_mm[1:])
    # a chord of a circle is so far from it; a corner alone is wider than that only where nothing is near
    width = np.minimum(PER_WIDTH * tolerance_mm / size, np.sqrt(2.0 * PER_WIDTH * tolerance_mm * gap / size))
    count = len(size)
    at = np.cumsum(part.length_mm)[:-1]
    # of the whole part, a curve needs room to its ends
    width = np.minimum(width, np.minimum(at, at[-1] + part.length_mm[-1] - at))
    bend = turn / width[:, None]
    whole = bend.copy()
    for step in range(1, min(_NEAR, count - 1) + 1):
        away = at[step:] - at[:-step]
        for to, of in ((slice(step, None), slice(None, -step)), (slice(None, -step), slice(step, None))):
            share = np.maximum(1.0 - away / width[of], 0.0)
            whole[to] += share[:, None] * bend[of]
    change = np.abs(np.diff(whole, axis=0, prepend=0.0, append=0.0))
    reach = np.minimum(part.length_mm, np.minimum(np.append(width, np.inf), np.insert(width, 0, np.inf)))
    slope = change / reach[:, None]
    third = np.maximum(slope[:-1], slope[1:])
    by_a = np.sqrt((limits.acceleration / np.maximum(np.abs(whole), _TINY)).min(axis=1))
    by_j = np.cbrt((limits.jerk / np.maximum(third, _TINY)).min(axis=1))
    return np.asarray(np.minimum(by_a, by_j))


def stepped_mm_s(part: Moves, step_mm_s: Array) -> Array:
    """(m - 1,) the speed at which no axis changes its speed by more than its step (3,) at once."""
    return np.asarray((step_mm_s / np.maximum(np.abs(turns(part)), 1e-12)).min(axis=1))


def in_arcs(part: Moves, limits: AxisSpeeds) -> Array:
    """(m,) the speed along each move: its feed, the axes, and in arcs their acceleration and jerk."""
    moved = part.most > 1e-9
    speed = np.minimum(part.feed_mm_s, part.least(limits.velocity))
    a = np.where(moved, limits.acceleration, np.inf).min(axis=1)
    j = np.where(moved, limits.jerk, np.inf).min(axis=1)
    return np.asarray(
        np.minimum(speed, np.minimum(np.sqrt(a * part.radius_mm), np.cbrt(j * part.radius_mm**2)))
    )
