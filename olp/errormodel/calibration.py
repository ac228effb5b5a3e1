"""A calibration as values: what was measured, where, and in which sense. Base units: mm, rad, degC.

error = actual - commanded, tool relative to workpiece, right-handed, ISO 230-1 names. A file reader
fills these types; relations between the parts are checked here and raise ConfigError.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO, Vector
from olp.core.units import AXES
from olp.errormodel.beams import Beam
from olp.errormodel.gridded import COVER_MM, ComponentTable, DeviationMap, cover_problems, frozen, refuse
from olp.errormodel.structure import Structure

Model = Literal["rigid-body", "huddersfield"]
Reference = Literal["functional-point", "table"]
Interpolation = Literal["linear", "pchip"]


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Component errors of one axis along one measuring line.

    `position_mm` (n,) strictly increasing; either `columns` (mean of both directions) or `forward` and
    `backward` with the same names, each (n,) in mm or rad. `line_mm` says where the other axes stood
    (the entry of the own axis is ignored), None means the datum; `tool_mm` is the tool vector then.
    A value is what was measured at the functional point on that line; with `reference` "table" the
    reflector stayed fixed on a moving table. Raises ConfigError.
    """

    axis: str
    position_mm: Array
    columns: Mapping[str, Array] = field(default_factory=dict)
    forward: Mapping[str, Array] = field(default_factory=dict)
    backward: Mapping[str, Array] = field(default_factory=dict)
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO
    reference: Reference = "functional-point"
    interpolation: Interpolation = "pchip"

    def __post_init__(self) -> None:
        if self.axis not in AXES or len(self.axis) != 1:
            raise ConfigError(f"curve of axis '{self.axis}'; expected X, Y or Z")
        object.__setattr__(self, "position_mm", frozen(self.position_mm))
        for name in ("columns", "forward", "backward"):
            columns = {key: frozen(value) for key, value in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(columns))
        refuse(self._problems())

    def _problems(self) -> list[str]:
        label, x = f"curve of axis {self.axis}", self.position_mm
        problems = []
        if x.ndim != 1 or len(x) < 2:
            return [f"{label}: {x.size} positions; expected at least 2"]
        if not np.all(np.isfinite(x)) or np.any(np.diff(x) <= 0.0):
            problems.append(
                f"{label}: positions do not strictly increase; sort them and average repeated ones"
            )
        if bool(self.columns) == bool(self.forward) or set(self.forward) != set(self.backward):
            problems.append(f"{label}: expected columns of the mean, or the same columns in both directions")
        for name, values in (*self.columns.items(), *self.forward.items(), *self.backward.items()):
            if name not in COMPONENTS or name[2] != self.axis:
                expected = ", ".join(f"E{d}{self.axis}" for d in "XYZABC")
                problems.append(f"{label}: column '{name}'; expected one of {expected}")
            elif values.shape != x.shape or not np.all(np.isfinite(values)):
                problems.append(
                    f"{label}: column {name} is not a finite number at each of {len(x)} positions"
                )
        if self.interpolation not in ("linear", "pchip"):
            problems.append(f"{label}: interpolation '{self.interpolation}'; expected linear or pchip")
        if self.reference not in ("functional-point", "table"):
            problems.append(f"{label}: reference '{self.reference}'; expected functional-point or table")
        for key, vector in (("line_mm", self.line_mm), ("tool_mm", self.tool_mm)):
            if vector is not None and (len(vector) != 3 or not np.all(np.isfinite(vector))):
                problems.append(f"{label}: {key} = {vector}; expected three finite lengths")
        return problems

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns) or tuple(self.forward)

    def mean(self, name: str) -> Array:
        """(n,) mean of both directions."""
        return self.columns[name] if self.columns else 0.5 * (self.forward[name] + self.backward[name])

    def half_difference(self, name: str) -> Array | None:
        """(n,) half of forward minus backward; None for a curve of the mean."""
        return None if self.columns else 0.5 * (self.forward[name] - self.backward[name])


@dataclass(frozen=True, slots=True)
class Cyclic:
    """amplitude * sin(2 pi q / period + phase) on a component, q the position of its axis; mm or rad."""

    component: str
    period_mm: float
    amplitude: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        problems = []
        if self.component not in COMPONENTS:
            problems.append(f"cyclic component '{self.component}'; expected a name such as EXX or EAX")
        if not (np.isfinite(self.period_mm) and self.period_mm > 0.0):
            problems.append(f"cyclic {self.component}: period {self.period_mm} mm; expected more than 0")
        if not (np.isfinite(self.amplitude) and np.isfinite(self.phase_rad)):
            problems.append(f"cyclic {self.component}: amplitude and phase must be finite")
        refuse(problems)


@dataclass(frozen=True, slots=True)
class Thermal:
    """Expansion of the scales (X, Y, Z) and of the workpiece, against the calibration's state.

    E_jj += scale * (T_scale - T_cal) * (q - fixed) - workpiece * (T_workpiece - 20) * (q - clamped)
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
class Calibration:
    """All that a calibration states. `box_mm` (3, 2) holds calibrated axis positions, `squareness` C0Y, B0Z,
    A0Z in rad, `backlash_mm` the constant lost motion per axis. Several curves of one axis hold different
    components. `repeatability_mm` is the
    standard deviation of each axis at one place, None where nobody stated it. `compliance` tables and
    `beams` act per kg of payload beyond `payload_kg`, which was on the machine while measuring. Raises
    ConfigError with every problem found."""

    machine: str
    box_mm: Array
    model: Model = "rigid-body"
    datum_mm: Vector = ZERO
    curves: tuple[Curve, ...] = ()
    squareness: Mapping[str, float] = field(default_factory=dict)
    backlash_mm: Vector = ZERO
    repeatability_mm: Vector | None = None
    cyclic: tuple[Cyclic, ...] = ()
    thermal: Thermal | None = None
    structure: Structure | None = None
    maps: tuple[DeviationMap, ...] = ()
    compliance: tuple[ComponentTable, ...] = ()
    beams: tuple[Beam, ...] = ()
    payload_kg: float = 0.0
    temperature_degC: float = 20.0
    measured: datetime.date | None = None
    valid_until: datetime.date | None = None
    active_during_measurement: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "box_mm", frozen(self.box_mm))
        object.__setattr__(self, "squareness", MappingProxyType(dict(self.squareness)))
        problems = self._own_problems()
        if not problems:
            problems = self._curve_problems() + self._grid_problems()
        refuse(problems)

    def _own_problems(self) -> list[str]:
        problems = []
        box = self.box_mm
        if box.shape != (3, 2) or not np.all(np.isfinite(box)) or np.any(box[:, 0] >= box[:, 1]):
            problems.append("box_mm: expected a lower and a higher axis position for each of X, Y, Z")
        if self.model not in ("rigid-body", "huddersfield"):
            problems.append(f"model '{self.model}'; expected rigid-body or huddersfield")
        for name, angle in self.squareness.items():
            if name not in SQUARENESS or not np.isfinite(angle):
                problems.append(f"squareness {name} = {angle}; expected finite angles C0Y, B0Z, A0Z")
        for key, vector in (("datum_mm", self.datum_mm), ("backlash_mm", self.backlash_mm)):
            if len(vector) != 3 or not np.all(np.isfinite(vector)):
                problems.append(f"{key} = {vector}; expected three finite lengths")
        return problems

    def _curve_problems(self) -> list[str]:
        problems = []
        seen: set[str] = set()
        for curve in self.curves:
            j = AXES.index(curve.axis)
            (low, high), x = self.box_mm[j], curve.position_mm
            if x[0] > low + COVER_MM or x[-1] < high - COVER_MM:
                problems.append(
                    f"curve of axis {curve.axis} runs from {x[0]:g} to {x[-1]:g} mm; expected all of the "
                    f"box, {low:g} to {high:g} mm; measure the rest or make box_mm smaller"
                )
            if curve.forward and self.backlash_mm[j] != 0.0:
                problems.append(
                    f"backlash of axis {curve.axis} and a curve with a direction column; expected one of "
                    "the two, or the lost motion counts twice"
                )
            for name in sorted(seen & set(curve.names)):
                problems.append(f"{name} stands in two curves; expected each component once; merge the files")
            seen |= set(curve.names)
        return problems

    def _grid_problems(self) -> list[str]:
        problems = []
        for described in self.maps:
            problems += cover_problems(
                described.name, AXES, described.knots_mm, self.box_mm, described.holds_along
            )
        totals = [m for m in self.maps if m.kind == "total"]
        if len(totals) > 1:
            problems.append(
                f'{totals[1].name} is a second map of kind "total"; expected one, which is all that was '
                f"measured; "
                'give the others as kind = "residual"'
            )
        counted = [
            name
            for name, present in (
                ("curves", bool(self.curves)),
                ("squareness", any(self.squareness.values())),
                ("cyclic", bool(self.cyclic)),
            )
            if present
        ]
        if totals and counted:
            problems.append(
                f'{totals[0].name} is of kind "total", so it holds {", ".join(counted)} already; expected '
                f"none of "
                'them beside it, or kind = "residual" where the map is what they leave'
            )
        seen: dict[str, str] = {}
        for table in self.compliance:
            for name in sorted(set(table.names) & set(seen)):
                problems.append(
                    f"{name} stands in {seen[name]} and in {table.name}; expected each component once, or "
                    f"the load "
                    "counts twice"
                )
            seen |= dict.fromkeys(table.names, table.name)
            problems += cover_problems(table.name, table.arguments, table.knots_mm, self.box_mm)
        if self.structure is not None:
            problems += self.structure.cover_problems(self.box_mm)
            scales = [
                f"E{a}{a}"
                for a, scale in zip(AXES, self.thermal.scale_per_K if self.thermal else ZERO, strict=True)
                if scale != 0.0
            ]
            problems += [
                f"the thermal structure holds {name}, and {name[2]}_scale_um_m_K expands the scale again; "
                f"expected one "
                f"of the two: the drift of {name} was read with the scale as it is"
                for name in self.structure.components()
                if name in scales
            ]
        for beam in self.beams:
            bent = f"E{beam.direction[1]}{beam.axis}"
            if bent in seen:
                problems.append(
                    f"{bent} stands in {seen[bent]}, and a beam of axis {beam.axis} bends it too; "
                    f"expected one of the "
                    "two: what was measured holds the beam"
                )
            problems += beam.problems(self.box_mm)
        if self.repeatability_mm is not None and not (
            np.all(np.isfinite(self.repeatability_mm)) and min(self.repeatability_mm) >= 0.0
        ):
            problems.append(
                f"repeatability_mm = {self.repeatability_mm}; expected three lengths of 0 or above"
            )
        if not (np.isfinite(self.payload_kg) and self.payload_kg >= 0.0):
            problems.append(f"payload_kg = {self.payload_kg}; expected the mass while measuring, 0 or above")
        return problems

    def curves_of(self, axis: str) -> tuple[Curve, ...]:
        return tuple(curve for curve in self.curves if curve.axis == axis)
