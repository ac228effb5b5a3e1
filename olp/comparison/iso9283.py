"""Accuracy and repeatability of poses and paths after ISO 9283:1998: positions, and orientations of poses.

All figures come from equal cycles; the standard requires 30 cycles for poses and 10 for paths.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass

#: cycles that the standard requires for poses
POSE_CYCLES = 30
#: cycles that the standard requires for paths
PATH_CYCLES = 10


@dataclass(frozen=True, slots=True, eq=False)
class Repeated:
    """Per pose or station (m,), in mm: `accuracy`, distance of the command from the barycentre of the
    attained positions; `repeatability`, mean distance from that barycentre plus three of its standard
    deviations, NaN with one cycle. `bias` (m, 3): barycentre minus command."""

    accuracy: Array
    repeatability: Array
    bias: Array


def repeated(command_mm: Array, attained_mm: Array) -> Repeated:
    """Figures of each pose or station from commands (m, 3) and attained positions (n, m, 3) of n cycles.

    ISO 9283, 7.2: AP_P = |mean - command| and RP_l = l + 3 S_l, l_j = |attained_j - mean|, S_l with n - 1.
    8.2 and 8.3 define the same for stations of a path in its normal planes. Cycles that did not reach a
    station (NaN) are left out there.
    """
    there = np.asarray(np.isfinite(attained_mm).all(axis=2), bool)
    count = there.sum(axis=0)
    weight = there[:, :, None]
    value = np.where(weight, attained_mm, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = value.sum(axis=0) / count[:, None]
        distance = np.sqrt(((attained_mm - mean) ** 2).sum(axis=2))
        average = np.where(there, distance, 0.0).sum(axis=0) / count
        square = np.where(there, (distance - average) ** 2, 0.0).sum(axis=0)
        repeatability = np.where(count > 1, average + 3.0 * np.sqrt(square / (count - 1)), np.nan)
    bias = mean - command_mm
    return Repeated(np.sqrt((bias * bias).sum(axis=1)), repeatability, bias)


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """Per pose (m, 3), in rad, about X, Y and Z: `accuracy`, the mean turn from the commanded orientation,
    with its sign; `repeatability`, three standard deviations of it, NaN with one cycle."""

    accuracy: Array
    repeatability: Array


def turned(turns_rad: Array) -> Turned:
    """Figures of the orientations of n cycles, from rotation vectors (n, m, 3) from the commanded ones.

    ISO 9283, 7.2.1 and 7.2.2: AP_a = mean - command and RP_a = 3 S_a, S_a with n - 1, and so for b and c.
    Cycles that did not reach a pose (NaN) are left out there.
    """
    there = np.isfinite(turns_rad).all(axis=2, keepdims=True)
    count = there.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(there, turns_rad, 0.0).sum(axis=0) / count
        square = np.where(there, (turns_rad - mean) ** 2, 0.0).sum(axis=0)
        spread = np.where(count > 1, 3.0 * np.sqrt(square / (count - 1)), np.nan)
    return Turned(np.asarray(mean), np.asarray(spread))


@dataclass(frozen=True, slots=True)
class Figure:
    """The largest value in mm and the index of its pose or station; NaN and -1 where there is none."""

    value_mm: float
    place: int


def largest(values: Array) -> Figure:
    """AT, RT (and the largest AP, RP): the standard takes the worst station of the path."""
    if not np.isfinite(values).any():
        return Figure(float("nan"), -1)
    place = int(np.nanargmax(values))
    return Figure(float(values[place]), place)
