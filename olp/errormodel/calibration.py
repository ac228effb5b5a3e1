"""A calibration as values: what was measured, where, and with which sign. Base units: mm, rad, degC.

error = actual - commanded, tool relative to workpiece, right-handed, ISO 230-1 names. A file reader
fills these types; relations between the parts are checked here and raise ConfigError.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.gridded import COVER_MM, ComponentTable, cover_problems, frozen, refuse
from olp.errormodel.quality import Quality
from olp.errormodel.sources.base import ErrorSource, Frame
from olp.errormodel.sources.beams import Beam
from olp.errormodel.sources.curves import Curve, Reference
from olp.errormodel.sources.cyclic import Cyclic
from olp.errormodel.sources.expansion import Thermal
from olp.errormodel.sources.maps import DeviationMap
from olp.errormodel.sources.registry import SOURCES
from olp.errormodel.sources.structure import Structure

__all__ = ["Calibration", "Curve", "Cyclic", "Model", "Reference", "Thermal"]

Model = Literal["rigid-body", "huddersfield"]
#: The date of measuring in files that are still to be filled in; no calibration has it.
PLACEHOLDER_DATE = datetime.date(2000, 1, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """All that a calibration states. `box_mm` (3, 2) holds calibrated axis positions, `squareness` C0Y,
    B0Z, A0Z in rad, `backlash_mm` the constant backlash per axis. Several curves of one axis hold
    different components. `repeatability_mm` is the standard deviation of each axis at one position, None
    where it is not stated. `compliance` tables and `beams` act per kg of payload beyond `payload_kg`,
    which was on the machine while measuring. `quality` is that of the adjustment, None where it is not
    stated. `more` holds key and values of each source that has no field here. Raises ConfigError with
    every problem."""

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
    quality: Quality | None = None
    more: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "box_mm", frozen(self.box_mm))
        object.__setattr__(self, "squareness", MappingProxyType(dict(self.squareness)))
        problems = self._own_problems()
        if not problems:
            problems = self._curve_problems() + self._grid_problems()
            for source, values in self.sources():
                problems += source.problems(values, self.box_mm)
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
                    f"axis {curve.axis} has a backlash and a curve with a direction column; expected one of "
                    "the two, or its backlash counts twice"
                )
            for name in sorted(seen & set(curve.names)):
                problems.append(f"{name} is in two curves; expected each component once; merge the files")
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
                f'{totals[1].name} is a second map of kind "total"; expected one, as it is all that was '
                'measured; give the others as kind = "residual"'
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
                'none of them beside it, or kind = "residual" if the map is the residual beside them'
            )
        seen: dict[str, str] = {}
        for table in self.compliance:
            for name in sorted(set(table.names) & set(seen)):
                problems.append(
                    f"{name} is in {seen[name]} and in {table.name}; expected each component once, or the "
                    "load counts twice"
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
                f"expected one of the two, as the drift of {name} holds the expansion of the scale"
                for name in self.structure.components()
                if name in scales
            ]
        for beam in self.beams:
            bent = f"E{beam.direction[1]}{beam.axis}"
            if bent in seen:
                problems.append(
                    f"{bent} is in {seen[bent]}, and a beam of axis {beam.axis} bends it too; expected one "
                    "of the two, as what was measured holds the beam"
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

    def sources(self) -> Iterator[tuple[ErrorSource[Any, Any], Any]]:
        """Every source with its values; one without a field is left out where nothing is stated for it."""
        more = dict(self.more)
        for source in SOURCES:
            if source.field:
                yield source, getattr(self, source.field)
            elif source.key in more:
                yield source, more[source.key]

    def frame(self, chain: str, *, hold: bool = False) -> Frame:
        """What the models of the sources need, on a chain such as "FXYZ"."""
        frame = Frame(
            chain, self.datum_mm, self.box_mm, hold, self.payload_kg, tool_terms=self.model != "huddersfield"
        )
        loads = [table for source, values in self.sources() for table in source.loads(values, frame)]
        return replace(frame, loads=tuple(loads))
