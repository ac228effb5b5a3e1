"""Inertial deviation: how far the tool is off its position because the axes accelerate.

The machine is a spring: acceleration a_k of axis k shifts the tool relative to the workpiece by C_k a_k, and
the shifts of the axes add. This is static compliance only; vibration is not included.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.machine import Machine
from olp.core.values import dataclass
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits

#: um per m/s^2 in mm per mm/s^2
_UNIT = 1e-6
#: points per piece where the acceleration is not linear in time; odd, for Simpson's rule
_POINTS = 17
#: pieces per block
_BLOCK = 1 << 12
#: mm/s; where the tool is slower, the deviation is not split into along and across the path
_SLOWEST = 1e-6


@dataclass(frozen=True, slots=True)
class Inertial:
    """Of a motion: the largest deviation `most_mm`, at `time_s` on `line`, its `rms_mm` over time, and the
    largest one across the path, `across_mm`. The part along the path is lag and does not change the path."""

    most_mm: float
    rms_mm: float
    across_mm: float
    time_s: float
    line: int

    @staticmethod
    def of(motion: Motion, compliance: Array) -> Inertial:
        """`compliance` (3, 3) in mm per mm/s^2, column k for axis k.

        Exact where axes are cubics of time, as their acceleration is linear there; elsewhere from 17 points
        per piece.
        """
        most, square, across, where, line = 0.0, 0.0, 0.0, 0.0, int(motion.line[0]) if len(motion) else 0
        for piece, time, velocity, acceleration in _states(motion):
            deviation = acceleration @ compliance.T
            size = (deviation * deviation).sum(axis=2)
            width = motion.start_s[piece + 1] - motion.start_s[piece]
            square += float(width @ (size @ _simpson(size.shape[1])))
            speed = np.sqrt((velocity * velocity).sum(axis=2))
            unit = velocity / np.maximum(speed, _SLOWEST)[:, :, None]
            beside = deviation - (deviation * unit).sum(axis=2)[:, :, None] * unit
            beside[speed < _SLOWEST] = 0.0
            across = max(across, float(np.sqrt((beside * beside).sum(axis=2).max())))
            k = int(size.max(axis=1).argmax())
            if size[k].max() > most * most:
                most = float(np.sqrt(size[k].max()))
                where, line = float(time[k, int(size[k].argmax())]), int(motion.line[piece[k]])
        duration = max(motion.duration_s, 1e-300)
        return Inertial(most, float(np.sqrt(square / duration)), across, where, line)


def compliance_of(machine: Machine) -> Array:
    """(3, 3) deviation of the tool in mm per mm/s^2, one column per axis."""
    return np.array([machine.axes[name].compliance_um_per_m_s2 for name in "XYZ"]).T * _UNIT


def worst(limits: AxisLimits, compliance: Array) -> float:
    """The largest deviation in mm that accelerations within the limits can cause."""
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3) * limits.acceleration
    return float(np.sqrt(((corners @ compliance.T) ** 2).sum(axis=1)).max())


def capped(limits: AxisLimits, compliance: Array, most_mm: float) -> AxisLimits:
    """Limits under which no axis alone shifts the tool by more than `most_mm`."""
    size = np.sqrt((compliance * compliance).sum(axis=0))
    with np.errstate(divide="ignore"):
        return replace(limits, acceleration=np.minimum(limits.acceleration, most_mm / size))


def guaranteed_cap(limits: AxisLimits, compliance: Array, most_mm: float) -> float:
    """The largest cap per axis in mm with which no motion of all axes deviates by more than `most_mm`."""
    low, high = 0.0, most_mm
    if worst(capped(limits, compliance, high), compliance) <= most_mm:
        return high
    for _ in range(60):
        middle = 0.5 * (low + high)
        fits = worst(capped(limits, compliance, middle), compliance) <= most_mm
        low, high = (middle, high) if fits else (low, middle)
    return low


def _states(motion: Motion) -> Iterator[tuple[Index, Array, Array, Array]]:
    """Blocks of pieces (n,), and at k points each times (n, k), velocities and accelerations (n, k, 3)."""
    for a in range(0, len(motion), _BLOCK):
        piece = np.arange(a, min(a + _BLOCK, len(motion)))
        simple = _even(motion, piece)
        for rows, places in ((piece[simple], 3), (piece[~simple], _POINTS)):
            if not len(rows):
                continue
            width = motion.start_s[rows + 1] - motion.start_s[rows]
            u = width[:, None] * np.linspace(0.0, 1.0, places)
            _, velocity, acceleration, _ = motion.of(np.repeat(rows, places), u.ravel())
            shape = (len(rows), places, 3)
            yield (
                rows, motion.start_s[rows, None] + u, velocity.reshape(shape), acceleration.reshape(shape)
            )  # fmt: skip


def _even(motion: Motion, piece: Index) -> Mask:
    """Which pieces have axes that are cubics of time: straight ones driven by a cubic, and all that are
    driven at a steady rate."""
    time, path = motion.time[piece], motion.path[motion.shape[piece]]
    straight = ~path[:, 2:].any(axis=(1, 2)) & ~time[:, 4:].any(axis=1)
    return np.asarray(straight | ~time[:, 2:].any(axis=1))


def _simpson(places: int) -> Array:
    """Weights of Simpson's rule over a unit of time."""
    weight = np.full(places, 2.0)
    weight[1::2] = 4.0
    weight[[0, -1]] = 1.0
    return weight / (3.0 * (places - 1))
