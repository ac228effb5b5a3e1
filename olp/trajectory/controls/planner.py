"""The time of pieces that a control drives with trapezoids of speed, and looks ahead over."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """What a control makes of the moves of a stretch: k pieces, driven one after the other.

    (k,) `length_mm`, `velocity_mm_s` and `acceleration_mm_s2` are the largest along each piece, `move` is the
    move that it counts for. `even` pieces go evenly from the speed at one end to that at the other, and not
    faster in between. (k - 1,) `joint_mm_s` is the largest speed from each piece to the next one, 0 for a
    stop. (k - 1,) `overlap_mm_s` is the speed of the one before at which the next one begins, where two
    moves overlap: one slows down to rest while the other one starts. (k,) `jerk_mm_s3` is the largest along
    each piece, None for a control that does not limit it.
    """

    length_mm: Array
    velocity_mm_s: Array
    acceleration_mm_s2: Array
    move: Index
    even: Mask
    joint_mm_s: Array
    overlap_mm_s: Array
    jerk_mm_s3: Array | None = None

    def __len__(self) -> int:
        return len(self.length_mm)


def speeds(pieces: Pieces, ahead: int) -> Array:
    """(k + 1,) the speed at the ends of all pieces, from rest to rest. The control looks `ahead` over so many
    pieces, and could rest behind the last of them."""
    count = len(pieces)
    gain = 2.0 * pieces.acceleration_mm_s2 * pieces.length_mm
    square = np.zeros(count + 1)
    most = np.minimum(pieces.velocity_mm_s[:-1], pieces.velocity_mm_s[1:])
    square[1:-1] = np.minimum(pieces.joint_mm_s, most) ** 2
    total = np.concatenate(([0.0], np.cumsum(gain)))
    last = np.minimum(np.arange(count + 1) + ahead, count)
    square = np.minimum(square, total[last] - total)
    # the largest profile below all of them that rises and falls no faster than the accelerations allow
    back = np.minimum.accumulate((square + total)[::-1])[::-1] - total
    both = np.minimum.accumulate(back - total) + total
    result: Array = np.sqrt(np.maximum(both, 0.0))
    return result


def seconds(pieces: Pieces, speed: Array, cycle_s: float, stop_cycles: float) -> Array:
    """(k,) the time of each piece with `speed` (k + 1,) at the ends. Each stop, and the end, adds
    `stop_cycles` cycles of the control."""
    begin, end = speed[:-1], speed[1:]
    length, acceleration = pieces.length_mm, pieces.acceleration_mm_s2
    highest = np.sqrt(acceleration * length + 0.5 * (begin * begin + end * end))
    even = pieces.even & (begin + end > 0.0)
    top = np.minimum(highest, np.where(even, np.maximum(begin, end), pieces.velocity_mm_s))
    top = np.maximum(top, np.maximum(begin, end))
    ramps = (2.0 * top * top - begin * begin - end * end) / (2.0 * acceleration)
    cruise = np.maximum(length - ramps, 0.0)
    time = (2.0 * top - begin - end) / acceleration + cruise / np.maximum(top, 1e-300)
    time = np.where(even, 2.0 * length / np.maximum(begin + end, 1e-300), time)
    peak = np.minimum(pieces.velocity_mm_s, highest)
    fits = np.minimum(peak[:-1], peak[1:])
    overlap = np.minimum(pieces.overlap_mm_s, fits) / acceleration[:-1]
    time[:-1] -= overlap
    rests = np.append(end[:-1] <= 0.0, True)
    rests[:-1] &= pieces.overlap_mm_s <= 0.0
    return np.asarray(time + rests * stop_cycles * cycle_s)
