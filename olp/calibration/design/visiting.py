"""The order in which to visit positions, and the time that a machine takes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.units import AXES

#: Exchanges of two legs are tried at most so often over all positions.
_ROUNDS = 6


def move_s(distance_mm: Array, limits: Mapping[str, Vector]) -> Array:
    """(n,) seconds of straight moves by (n, 3) from rest to rest: the slowest axis, jerk, acceleration and
    velocity limited. `limits` are those of `Machine.motion_limits`."""
    times = [_rest_to_rest(np.abs(distance_mm[:, k]), limits[a]) for k, a in enumerate(AXES)]
    return np.asarray(np.max(times, axis=0))


def _rest_to_rest(distance: Array, limits: Vector) -> Array:
    v, a, j = limits
    # ramps of constant jerk that reach neither a nor v; that reach a; that reach v
    corner = min(a * a / j, v)
    ramp = v / a + a / j if v > a * a / j else 2.0 * np.sqrt(v / j)
    short = 4.0 * np.cbrt(distance / (2.0 * j))
    # 2 (v^2 / a + v a / j) / 2 = distance, for the velocity that is reached
    peak = 0.5 * (-a * a / j + np.sqrt((a * a / j) ** 2 + 4.0 * a * distance))
    middle = 2.0 * (peak / a + a / j)
    to_corner = corner * 2.0 * np.sqrt(corner / j)
    time = np.where(distance <= to_corner, short, middle)
    return np.asarray(np.where(distance >= v * ramp, distance / v + ramp, time))


def order(places_mm: Array, limits: Mapping[str, Vector]) -> npt.NDArray[np.intp]:
    """(n,) an order of visiting positions (n, 3) that takes little time, and no more than theirs: nearest
    first, then legs exchanged where that is shorter (2-opt)."""
    n = len(places_mm)
    if n < 3:
        return np.arange(n)
    first, second = np.divmod(np.arange(n * n), n)
    cost = move_s(places_mm[first] - places_mm[second], limits).reshape(n, n)
    tour = [int(np.argmin(places_mm[:, 0]))]
    waiting = np.ones(n, bool)
    waiting[tour[0]] = False
    for _ in range(n - 1):
        nearest = int(np.argmin(np.where(waiting, cost[tour[-1]], np.inf)))
        tour.append(nearest)
        waiting[nearest] = False
    best = np.array(tour)
    for _ in range(_ROUNDS):
        better = False
        for i in range(n - 2):
            a, b = best[i], best[i + 1]
            c, d = best[i + 2 : -1], best[i + 3 :]
            gain = cost[a, b] + cost[c, d] - cost[a, c] - cost[b, d]
            if len(gain) and gain.max() > 1e-9:
                k = i + 2 + int(np.argmax(gain))
                best[i + 1 : k + 1] = best[i + 1 : k + 1][::-1]
                better = True
        if not better:
            break
    return min((best, np.arange(n)), key=lambda tour: float(cost[tour[:-1], tour[1:]].sum()))
