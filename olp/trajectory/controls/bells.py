"""The time of pieces along which jerk is limited, too: ramps with bells of acceleration.

The speed along all pieces between two stops is that of critical points (`olp.trajectory.critical`): each
joint that binds is driven at its own speed, with no acceleration there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory.controls.planner import Pieces
from olp.trajectory.critical import Timeline, profile_within

#: mm; a joint with a speed of its own is a piece so long
_POINT_MM = 1e-7
#: share of the speeds beside it below which a joint has a speed of its own
_SLOWER = 1.0 - 1e-6
#: of the acceleration
SHARES = (1.0, 0.85, 0.7, 0.55, 0.4)


def bell_seconds(pieces: Pieces, ahead: int) -> Array:
    """(k,) the time of each piece, from rest to rest. The control looks `ahead` over so many pieces.

    A control may use less acceleration than it has. So the time is the least one of several shares of it, and
    more acceleration does not make it longer."""
    best = np.full(len(pieces), np.inf)
    for share in SHARES:
        own = _seconds(replace(pieces, acceleration_mm_s2=share * pieces.acceleration_mm_s2), ahead)
        best = own if own.sum() < best.sum() else best
    return best


def _seconds(pieces: Pieces, ahead: int) -> Array:
    x, owner, clock = timeline(pieces, ahead)
    phase = np.clip(np.searchsorted(clock.arc_mm, x, side="right") - 1, 0, len(clock.arc_mm) - 1)
    at_s = clock.start_s[phase] + clock.when(phase, x)
    at_s[-1] = clock.start_s[-1]
    return np.bincount(owner, weights=np.diff(at_s), minlength=len(pieces)).astype(np.float64)


def timeline(pieces: Pieces, ahead: int) -> tuple[Array, Index, Timeline]:
    """(p + 1,) breaks along all pieces in mm, (p,) the piece that each part counts for, and the phases."""
    assert pieces.jerk_mm_s3 is not None
    count = len(pieces)
    top, a, j = pieces.velocity_mm_s, pieces.acceleration_mm_s2, pieces.jerk_mm_s3
    joint = np.minimum(pieces.joint_mm_s, _stoppable(pieces, ahead))
    slow = np.flatnonzero((joint > 0.0) & (joint < _SLOWER * np.minimum(top[:-1], top[1:])))

    def with_points(column: Array, at: Array) -> Array:
        return np.insert(column, slow + 1, at)

    length = with_points(pieces.length_mm, np.full(len(slow), _POINT_MM))
    x = np.concatenate(([0.0], np.cumsum(length)))
    place = np.arange(count) + np.searchsorted(slow, np.arange(count))
    profile = profile_within(
        x, place[1:][joint <= 0.0], with_points(top, joint[slow]),
        with_points(a, np.minimum(a[slow], a[slow + 1])), with_points(j, np.minimum(j[slow], j[slow + 1])),
    )  # fmt: skip
    owner = np.searchsorted(place, np.arange(len(length)), side="right") - 1
    return x, owner, Timeline.of(x, profile)


def _stoppable(pieces: Pieces, ahead: int) -> Array:
    """(k - 1,) the speed at each joint from which the control could rest within the pieces that it sees."""
    count = len(pieces)
    total = np.concatenate(([0.0], np.cumsum(2.0 * pieces.acceleration_mm_s2 * pieces.length_mm)))
    at = np.arange(1, count)
    last = np.minimum(at + ahead, count)
    return np.asarray(np.where(last < count, np.sqrt(total[last] - total[at]), np.inf))
