"""Expansion of scales and workpiece against the calibration's state: one affine error per axis.

E_jj += a_s (T_s - T_cal)(q - q_fix) - a_w (T_w - 20)(p - p_clamp). A scale grows with its axis position q.
The workpiece grows with the place p of the part that the tip is at: axis position + tool vector, so that
tools of all lengths find one place of the part where it is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.schema import Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import AXES, in_unit, shifted
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.boxed import Boxed, as_points, as_tool
from olp.errormodel.sources.base import ErrorSource, Example, Frame, Reading, Schema, Writing, floats, vector

#: degC; geometrical product specifications hold at this temperature (ISO 1).
REFERENCE_DEGC = 20.0


@dataclass(frozen=True, slots=True)
class Thermal:
    """Expansion of the scales (X, Y, Z) and of the workpiece, against the calibration's state.

    E_jj += scale * (T_scale - T_cal) * (q - fixed) - workpiece * (T_workpiece - 20) * (p - clamped), q the
    axis position and p the position of the tip.
    """

    scale_per_K: Vector = ZERO
    fixed_at_mm: Vector = ZERO
    workpiece_per_K: float = 0.0
    clamped_at_mm: Vector = ZERO
    calibrated_at_degC: float = 20.0
    scale_degC: Vector = (20.0, 20.0, 20.0)
    workpiece_degC: float = 20.0

    def __post_init__(self) -> None:
        expansions = (*self.scale_per_K, self.workpiece_per_K)
        temperatures = (self.calibrated_at_degC, *self.scale_degC, self.workpiece_degC)
        if not np.all(np.isfinite((*expansions, *self.fixed_at_mm, *self.clamped_at_mm, *temperatures))):
            raise ConfigError("thermal: a value is not finite; expected expansions per K, mm and degC")


@dataclass(frozen=True, slots=True, eq=False)
class ThermalExpansion(Boxed):
    """Error along each axis: slope * (position - zero), of the axis for the scales and of the tip for the
    workpiece; all (3,)."""

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
        return sum((value for _, value in self._parts(axis_mm, tool_mm)), np.zeros(np.shape(axis_mm)))

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        return np.zeros(as_points(axis_mm).shape)

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        for name, value in self._parts(axis_mm, tool_mm):
            for j in np.flatnonzero(np.any(value != 0.0, axis=0)):
                one = np.zeros_like(value)
                one[:, j] = value[:, j]
                yield f"{name} {AXES[j]}", one

    def _parts(self, axis_mm: Array, tool_mm: Array) -> Iterator[tuple[str, Array]]:
        q = self.clamped(as_points(axis_mm))
        tip = q + as_tool(tool_mm, len(q))
        for name, position, slope, zero in (
            ("scale expansion", q, self.scale_slope, self.scale_zero_mm),
            ("workpiece expansion", tip, self.workpiece_slope, self.workpiece_zero_mm),
        ):
            # An axis without expansion must not turn an unknown position into an unknown error.
            yield name, np.where(slope != 0.0, slope * (position - zero), 0.0)

    @property
    def depends_on(self) -> Mask:
        return np.diag((self.scale_slope != 0.0) | (self.workpiece_slope != 0.0))

    def backlash_at(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        return np.zeros(len(as_points(delta_mm)))


class ThermalTable(Table):
    X_scale_um_m_K: float = Field(default=0.0, description="the expansion of the scale of X, in um/(m K)")
    Y_scale_um_m_K: float = Field(default=0.0, description="the expansion of the scale of Y, in um/(m K)")
    Z_scale_um_m_K: float = Field(default=0.0, description="the expansion of the scale of Z, in um/(m K)")
    workpiece_um_m_K: float = Field(default=0.0, description="the expansion of the workpiece, in um/(m K)")
    structure: Text | None = Field(
        default=None,
        description="the path of an olp-thermal-1 file, which `olp calibrate thermal` writes: how the "
        "structure distorts with the temperatures of sensors",
    )
    fixed_at_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the axis positions where the scales are fixed, [X, Y, Z] in mm"
    )
    clamped_at_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the place where the workpiece is clamped: axis positions without tool length, [X, Y, Z] "
        "in mm",
    )


class ScaleExpansion(ErrorSource[ThermalTable | None, Thermal | None]):
    """The table [thermal]; its key `structure` belongs to `olp.errormodel.sources.structure`."""

    key = "thermal"
    field = "thermal"
    schema: Schema = (ThermalTable | None, Field(default=None, description="the table [thermal]"))
    covered = False

    def example(self, by: float) -> Example:
        scales = f"X_scale_um_m_K = {11.0 * by}\nZ_scale_um_m_K = {8.0 * by}\n"
        part = f"workpiece_um_m_K = {23.0 * by}\nclamped_at_mm = [0.0, 10.0, -50.0]\n"
        return Example(f"[thermal]\n{scales}{part}")

    def read(self, stated: ThermalTable | None, reading: Reading) -> Thermal | None:
        if stated is None:
            return None
        calibrated_degC, now = reading.temperature_degC, reading.temperatures_degC
        return Thermal(
            scale_per_K=vector([shifted(getattr(stated, f"{axis}_scale_um_m_K"), -6) for axis in AXES]),
            fixed_at_mm=stated.fixed_at_mm,
            workpiece_per_K=shifted(stated.workpiece_um_m_K, -6),
            clamped_at_mm=stated.clamped_at_mm,
            calibrated_at_degC=calibrated_degC,
            scale_degC=vector([now.get(f"{axis}_scale", calibrated_degC) for axis in AXES]),
            workpiece_degC=now.get("workpiece", REFERENCE_DEGC),
        )

    def write(self, values: Thermal | None, writing: Writing) -> None:
        if values is not None:
            write_table(values, writing)

    def models(self, values: Thermal | None, frame: Frame) -> list[ErrorModel]:
        return [] if values is None else [ThermalExpansion.of(values, frame.box_mm, frame.hold)]


def write_table(thermal: Thermal, writing: Writing) -> None:
    """The table [thermal], with room for the key `structure`."""
    scales = zip(AXES, thermal.scale_per_K, strict=True)
    fixed, clamped = thermal.fixed_at_mm, thermal.clamped_at_mm
    writing.table(
        "[thermal]",
        {
            **{f"{axis}_scale_um_m_K": in_unit(scale, -6) for axis, scale in scales},
            "structure": None,
            "workpiece_um_m_K": in_unit(thermal.workpiece_per_K, -6),
            "fixed_at_mm": None if fixed == ZERO else floats(fixed),
            "clamped_at_mm": None if clamped == ZERO else floats(clamped),
        },
    )
