"""Expansion of scales and workpiece against the calibration's state: one affine error per axis.

E_jj += a_s (T_s - T_cal)(q - q_fix) - a_w (T_w - 20)(p - p_clamp); the axis position serves as q and p.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.units import AXES
from olp.errormodel.boxed import Boxed, as_points
from olp.errormodel.calibration import Thermal

#: ISO 1: geometrical product specifications hold at this temperature.
REFERENCE_DEGC = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class ThermalExpansion(Boxed):
    """Error along each axis: slope * (q - zero), for the scales and for the workpiece; all (3,)."""

    scale_slope: Array
    scale_zero_mm: Array
    workpiece_slope: Array
    workpiece_zero_mm: Array

    @classmethod
    def of(cls, thermal: Thermal, box_mm: Array, hold: bool) -> ThermalExpansion:
        scale = np.array(thermal.scale_per_K) * (np.array(thermal.scale_degC) - thermal.calibrated_at_degC)
        workpiece = np.full(3, -thermal.workpiece_per_K * (thermal.workpiece_degC - REFERENCE_DEGC))
        return cls(
            box_mm, hold, scale, np.array(thermal.fixed_at_mm), workpiece, np.array(thermal.clamped_at_mm)
        )

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        return sum((value for _, value in self._parts(axis_mm)), np.zeros(np.shape(axis_mm)))

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        return np.zeros(as_points(axis_mm).shape)

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        for name, value in self._parts(axis_mm):
            for j in np.flatnonzero(np.any(value != 0.0, axis=0)):
                one = np.zeros_like(value)
                one[:, j] = value[:, j]
                yield f"{name} {AXES[j]}", one

    def _parts(self, axis_mm: Array) -> Iterator[tuple[str, Array]]:
        q = self.clamped(as_points(axis_mm))
        for name, slope, zero in (
            ("scale expansion", self.scale_slope, self.scale_zero_mm),
            ("workpiece expansion", self.workpiece_slope, self.workpiece_zero_mm),
        ):
            # An axis without expansion must not turn an unknown position into an unknown error.
            yield name, np.where(slope != 0.0, slope * (q - zero), 0.0)

    @property
    def depends_on(self) -> Mask:
        return np.diag((self.scale_slope != 0.0) | (self.workpiece_slope != 0.0))

    def lost_motion_mm(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        return np.zeros(len(as_points(delta_mm)))
