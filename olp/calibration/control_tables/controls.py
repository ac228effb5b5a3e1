"""What a control does with its compensation tables: how far it moves the axes from what was commanded.

Each class holds the content of a table, as a Calibration in the sign convention of this package (actual
minus commanded, mm and rad), and works as its control does. So one model serves the predicted residual and
the tests.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from olp.compensation.invert import invert
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.calibration import Calibration


class Control(Protocol):
    """A control with tables."""

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        """(n, 3) mm that the control adds to commanded axis positions (n, 3), with tool vectors (3,) or
        (n, 3) and the directions of the last motion (n, 3), +1, -1 or 0 for unknown."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class AxisTables:
    """Sums of tables of one axis each: linear between rows, the end value outside, no lever arms.

    LinuxCNC's screw compensation, sag tables of Sinumerik, and axis-error tables of Heidenhain controls work
    like this. A table of both directions is taken by the direction of its own axis, the mean of both where
    that is unknown; a constant backlash by half to either side.
    """

    calibration: Calibration

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        shift = np.zeros(axis_mm.shape)
        for curve in self.calibration.curves:
            j = AXES.index(curve.axis)
            for name in curve.names:
                if name[1] not in AXES:
                    continue
                error = np.interp(axis_mm[:, j], curve.position_mm, curve.mean(name))
                half = curve.half_difference(name)
                if half is not None:
                    error = error + direction[:, j] * np.interp(axis_mm[:, j], curve.position_mm, half)
                shift[:, AXES.index(name[1])] -= error
        return np.asarray(shift + 0.5 * direction * np.array(self.calibration.backlash_mm))


@dataclass(frozen=True, slots=True, eq=False)
class Shear:
    """Squareness alone, as Klipper takes it out: the exact inverse of the shear, about axis position 0."""

    calibration: Calibration

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        xy, xz, yz = factors(self.calibration)
        shift = np.zeros(axis_mm.shape)
        y, z = axis_mm[:, 1], axis_mm[:, 2]
        shift[:, 0] = -y * xy - z * (xz - xy * yz)
        shift[:, 1] = -z * yz
        return shift


def factors(calibration: Calibration) -> tuple[float, float, float]:
    """xy, xz, yz: how far Y leans to +X, Z to +X and Z to +Y, per unit of length (+ is an acute angle)."""
    square = calibration.squareness
    return -square.get("C0Y", 0.0), square.get("B0Z", 0.0), -square.get("A0Z", 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Volumetric:
    """All components of a rigid-body chain with the tool: the control subtracts the error at the commanded
    position from the command, in one step. Tables of such controls have no directions."""

    model: ErrorModel

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        return np.asarray(-self.model.error(axis_mm, tool_mm))


@dataclass(frozen=True, slots=True, eq=False)
class RealTime:
    """The model itself in the control, which inverts it in every cycle, on the right side of the backlash."""

    model: ErrorModel

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        return np.asarray(invert(self.model, axis_mm, tool_mm, direction) - axis_mm)


@dataclass(frozen=True, slots=True)
class Uncompensated:
    """A control without tables."""

    def offset(self, axis_mm: Array, tool_mm: Array, direction: Array) -> Array:
        return np.zeros(axis_mm.shape)
