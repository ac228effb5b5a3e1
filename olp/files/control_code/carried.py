"""What of a calibration the C code holds, as the model itself has it; the rest is refused by name.

Nothing is sampled: curves keep their knots and their interpolation, grids their nodes. What depends on the
payload or on a temperature is taken apart, so that the control can say both at run time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from olp.core.errors import ConfigError
from olp.core.grid_interpolation import Grid
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.bodies import Body
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.chain import RigidBody
from olp.errormodel.components import AxisColumns
from olp.errormodel.grid_errors import GridBody, GridErrors
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.lever_arms import LeverArms
from olp.errormodel.sources.expansion import REFERENCE_DEGC, ThermalExpansion
from olp.errormodel.sources.maps import MapErrors
from olp.errormodel.sources.structure import Structure
from olp.errormodel.total import Total

#: The name of the temperature of the workpiece in job files.
WORKPIECE = "workpiece"


@dataclass(frozen=True, slots=True)
class Sensor:
    """A temperature that the control states, by its name in the job file, and what it is until then."""

    name: str
    start_degC: float


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A body over a grid: it acts with the payload (`sensor` None) or the temperature of a sensor, less
    `zero`; a temperature is held between `low` and `high`."""

    body: GridBody
    lever_arms: LeverArms
    sensor: int | None
    zero: float
    low: float = 0.0
    high: float = 0.0


@dataclass(frozen=True, slots=True)
class Expansion:
    """Along axis `axis`, per K of a sensor beyond `zero_degC`, counted from `fixed_mm`."""

    axis: int
    sensor: int
    of_tip: bool
    per_K: float
    zero_degC: float
    fixed_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """All that the C code holds. `model` is the same for the job's payload and temperatures."""

    calibration: Calibration
    chain: str
    model: ErrorModel
    rigid: RigidBody
    columns: tuple[AxisColumns, ...]
    sensors: tuple[Sensor, ...]
    tables: tuple[Table, ...]
    maps: tuple[Grid, ...]
    expansions: tuple[Expansion, ...]

    @property
    def bodies(self) -> tuple[Body, ...]:
        return self.rigid.bodies

    def backlash_mm(self) -> float:
        """The largest backlash of an axis."""
        return max((float(b.max()) for b in _backlash(self.model, self.calibration)), default=0.0)

    def at(self, temperatures_degC: Sequence[float]) -> ErrorModel:
        """The model at temperatures of the sensors."""
        now = dict(zip((s.name for s in self.sensors), temperatures_degC, strict=True))
        calibration = self.calibration
        if (thermal := calibration.thermal) is not None:
            x, y, z = (now.get(f"{a}_scale", thermal.calibrated_at_degC) for a in AXES)
            part = now.get(WORKPIECE, REFERENCE_DEGC)
            calibration = replace(
                calibration, thermal=replace(thermal, scale_degC=(x, y, z), workpiece_degC=part)
            )
        if (structure := calibration.structure) is not None:
            own = {s.name: now[s.name] for s in structure.sensors}
            calibration = replace(calibration, structure=structure.at(own))
        return build(calibration, self.chain, outside="hold")


def carried(calibration: Calibration, chain: str) -> Carried:
    """What C code holds of a calibration on a chain. Raises ConfigError for what it cannot hold."""
    settled = calibration
    if (structure := calibration.structure) is not None and structure.temperatures_degC is None:
        reference = {s.name: s.reference_degC for s in structure.sensors}
        settled = replace(calibration, structure=structure.at(reference))
    model = build(settled, chain, outside="hold")
    parts = model.models if isinstance(model, Total) else (model,)
    known = (RigidBody, GridErrors, MapErrors, ThermalExpansion)
    strange = [type(part).__name__ for part in parts if not isinstance(part, known)]
    if strange:
        raise ConfigError(f"{strange[0]} of the calibration has no C code; export it without that error")
    if any(float(b.min()) < 0.0 for b in _backlash(model, settled)):
        raise ConfigError(
            "a backlash below 0 (a control that compensates too much) cannot be followed in real time; "
            "measure with the compensation of the control switched off"
        )
    rigid = next(part for part in parts if isinstance(part, RigidBody))
    sensors = tuple(_sensors(settled))
    number = {sensor.name: k for k, sensor in enumerate(sensors)}
    loads = next((part for part in parts if isinstance(part, GridErrors) and part.name == "load"), None)
    tables = [
        Table(body, body.lever_arms, None, body.mass_kg or 0.0) for body in (loads.bodies if loads else ())
    ]
    if settled.structure is not None:
        tables += _distortions(settled, settled.structure, chain, number)
    return Carried(
        calibration=settled,
        chain=chain,
        model=model,
        rigid=rigid,
        columns=tuple(AxisColumns(settled, AXES[b.axis], frozenset()) for b in rigid.bodies),
        sensors=sensors,
        tables=tuple(tables),
        maps=tuple(part.grid for part in parts if isinstance(part, MapErrors)),
        expansions=tuple(_expansions(settled, number)),
    )


def _backlash(model: ErrorModel, calibration: Calibration) -> Iterator[np.ndarray]:
    """The backlash of each axis all along it: at its knots, as it is linear or monotone in between."""
    for j, axis in enumerate(AXES):
        knots = [c.position_mm for c in calibration.curves_of(axis)]
        q = np.unique(np.concatenate([calibration.box_mm[j], *knots]))
        points = np.repeat(calibration.box_mm[None, :, 0], len(q), axis=0)
        points[:, j] = q
        backlash = model.backlash_at(points)
        if backlash is not None:
            yield backlash[:, j]


def _sensors(calibration: Calibration) -> Iterator[Sensor]:
    if (thermal := calibration.thermal) is not None:
        for axis, scale, now in zip(AXES, thermal.scale_per_K, thermal.scale_degC, strict=True):
            if scale:
                yield Sensor(f"{axis}_scale", now)
        if thermal.workpiece_per_K:
            yield Sensor(WORKPIECE, thermal.workpiece_degC)
    if (structure := calibration.structure) is not None:
        stated = structure.temperatures_degC or {}
        for sensor in structure.sensors:
            yield Sensor(sensor.name, stated[sensor.name])


def _expansions(calibration: Calibration, number: dict[str, int]) -> Iterator[Expansion]:
    thermal = calibration.thermal
    if thermal is None:
        return
    for j, axis in enumerate(AXES):
        if thermal.scale_per_K[j]:
            at = number[f"{axis}_scale"]
            zero, fixed = thermal.calibrated_at_degC, thermal.fixed_at_mm[j]
            yield Expansion(j, at, of_tip=False, per_K=thermal.scale_per_K[j], zero_degC=zero, fixed_mm=fixed)
        if thermal.workpiece_per_K:
            per_K, clamped = -thermal.workpiece_per_K, thermal.clamped_at_mm[j]
            at = number[WORKPIECE]
            yield Expansion(j, at, of_tip=True, per_K=per_K, zero_degC=REFERENCE_DEGC, fixed_mm=clamped)


def _distortions(
    calibration: Calibration, structure: Structure, chain: str, number: dict[str, int]
) -> Iterator[Table]:
    """One table per sensor and span: the structure with that sensor alone, by what it does per K."""
    for axis in AXES:
        lines = {(d.line_mm, d.tool_mm) for d in structure.distortions if d.component[2] == axis}
        if len(lines) > 1:
            raise ConfigError(
                f"the thermal structure states distortions of axis {axis} on {len(lines)} measuring lines, "
                "and C code holds one line per axis; fit it on one line"
            )
    far = {s.name: max((abs(t - s.reference_degC), t) for t in s.range_degC)[1] for s in structure.sensors}
    frame = calibration.frame(chain, hold=True)

    def errors(tables: Sequence[ComponentTable]) -> GridErrors:
        return GridErrors.of(
            "thermal", tables, chain, frame.datum_mm, frame.box_mm, hold=True, tool_terms=frame.tool_terms
        )

    arms = {body.axis: body.lever_arms for body in errors(structure.at(far).tables(hold=True)).bodies}
    for sensor in structure.sensors:
        rise = far[sensor.name] - sensor.reference_degC
        own = tuple(d for d in structure.distortions if d.sensor == sensor.name)
        if not rise or not own:
            continue
        tables = replace(structure, distortions=own).at(far).tables(hold=True)
        tables = tuple(
            replace(table, columns={n: v / rise for n, v in table.columns.items()}) for table in tables
        )
        low, high = sensor.range_degC
        for body in errors(tables).bodies:
            own_arms = arms[body.axis]
            yield Table(body, own_arms, number[sensor.name], sensor.reference_degC, low, high)
