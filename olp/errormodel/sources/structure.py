"""The indirect thermal model: sensor temperatures to structure temperatures to distortion.

Each sensor stands for a part of the structure that follows it with a first-order lag: theta' = (T - theta) /
lag. A component error grows with each structure temperature in three shapes along its axis: an offset, linear
growth, and a bow. (Indirect compensation: see J. Mayr et al., Thermal issues in machine tools, CIRP Annals
61, 2012.) Its coefficients are identified from logs of sensors and drift (`olp.calibration.thermal.drift`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.schema import Interval, Position, Table, Text, Triple
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM, in_unit, shifted
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.gridded import COVER_MM, ComponentTable, refuse
from olp.errormodel.sources.base import ErrorSource, Example, Frame, Reading, Writing, floats, vector
from olp.errormodel.sources.expansion import Thermal, write_table


@dataclass(frozen=True, slots=True)
class Sensor:
    """A temperature sensor. At `reference_degC` its part causes no distortion; `range_degC` are the structure
    temperatures that were identified. `lag_s` is the time by which the structure lags the sensor, below 0 by
    which it leads it."""

    name: str
    reference_degC: float
    range_degC: tuple[float, float]
    lag_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Distortion:
    """What one K of one sensor's part adds to a component over `span_mm` of its axis, in mm or rad per K.

    It is offset + growth * (q - middle) + bow * (1 - ((q - middle) / half)^2), the growth per mm.
    `line_mm` and `tool_mm` as of a curve: positions of the other axes and tool vector while measuring."""

    component: str
    sensor: str
    span_mm: tuple[float, float]
    offset: float = 0.0
    growth: float = 0.0
    bow: float = 0.0
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Sensors and what their parts do. `temperatures_degC` are structure temperatures by sensor, None where
    none are stated: then the model adds nothing. Raises ConfigError."""

    sensors: tuple[Sensor, ...]
    distortions: tuple[Distortion, ...]
    temperatures_degC: Mapping[str, float] | None = field(default=None)

    def __post_init__(self) -> None:
        if self.temperatures_degC is not None:
            stated = MappingProxyType(dict(self.temperatures_degC))
            object.__setattr__(self, "temperatures_degC", stated)
        refuse(self._problems())

    def _problems(self) -> list[str]:
        names = [sensor.name for sensor in self.sensors]
        problems = [
            f"sensor {n} is defined twice; expected each sensor once"
            for n in sorted(set(names))
            if names.count(n) > 1
        ]
        for sensor in self.sensors:
            numbers = (sensor.reference_degC, *sensor.range_degC, sensor.lag_s)
            if not np.all(np.isfinite(numbers)) or sensor.range_degC[1] < sensor.range_degC[0]:
                problems.append(
                    f"sensor {sensor.name}: expected finite temperatures, an ascending range and a finite lag"
                )
        for d in self.distortions:
            if d.component not in COMPONENTS or d.sensor not in names or not d.span_mm[0] < d.span_mm[1]:
                problems.append(
                    f"distortion of {d.component} by {d.sensor}: expected an ISO 230-1 name, one of the "
                    "sensors and an ascending span"
                )
        return problems

    def at(self, temperatures_degC: Mapping[str, float]) -> Structure:
        """This structure at temperatures of all its sensors' parts. Raises ConfigError."""
        names = [sensor.name for sensor in self.sensors]
        missing = [name for name in names if name not in temperatures_degC]
        unknown = sorted(set(temperatures_degC) - set(names))
        if missing or unknown:
            what = f"no temperature of sensor {missing[0]}" if missing else f"{unknown[0]} is not a sensor"
            raise ConfigError(f"{what}; expected a temperature of each of {', '.join(names)}")
        return replace(self, temperatures_degC=temperatures_degC)

    def settled(self, time_s: Array, sensors_degC: Mapping[str, Array], at_s: float | None) -> Structure:
        """This structure at the temperatures that a log leads to, at a time in it or at its end. The log
        starts settled. Raises ConfigError."""
        upto = len(time_s) if at_s is None else int(np.searchsorted(time_s, at_s, side="right"))
        if at_s is not None and not time_s[0] <= at_s <= time_s[-1]:
            raise ConfigError(
                f"the time {at_s:g} s is not in the log of temperatures, {time_s[0]:g} to {time_s[-1]:g} s"
            )
        from olp.errormodel.distortion import lagged

        lags = {sensor.name: sensor.lag_s for sensor in self.sensors}
        structure_degC = {
            name: float(lagged(time_s[:upto], values[:upto], lags[name])[-1])
            for name, values in sensors_degC.items()
            if name in lags
        }
        return self.at(structure_degC)

    def outside(self) -> dict[str, float]:
        """The sensors whose structure temperature is outside the identified range."""
        stated = self.temperatures_degC or {}
        return {
            s.name: stated[s.name]
            for s in self.sensors
            if s.name in stated and not s.range_degC[0] <= stated[s.name] <= s.range_degC[1]
        }

    def rises(self, *, hold: bool) -> dict[str, float]:
        """Temperatures above the reference; with `hold` at the end of the range where they are outside.
        Raises ConfigError for one outside otherwise."""
        stated = self.temperatures_degC
        if stated is None:
            return {}
        ranges = {s.name: s.range_degC for s in self.sensors}
        wrong = self.outside()
        if wrong and not hold:
            name, value = next(iter(wrong.items()))
            low, high = ranges[name]
            raise ConfigError(
                f"sensor {name}: the structure is at {value:.2f} degC; expected {low:.2f} to {high:.2f} "
                "degC, the range that was identified. Log the drift there too, or take the end of the range "
                "with --outside-box hold (of olp correct, check, view and results)"
            )
        return {
            s.name: float(np.clip(stated[s.name], *s.range_degC)) - s.reference_degC for s in self.sensors
        }

    def tables(self, *, hold: bool) -> tuple[ComponentTable, ...]:
        """The component errors at these temperatures, one table per measuring line and span; a parabola over
        three nodes is exact."""
        from olp.errormodel.distortion import shapes

        rises = self.rises(hold=hold)
        sums: dict[tuple[str, tuple[float, float], Vector | None, Vector], dict[str, Array]] = {}
        for d in self.distortions:
            rise = rises.get(d.sensor, 0.0)
            q = np.array([d.span_mm[0], 0.5 * (d.span_mm[0] + d.span_mm[1]), d.span_mm[1]])
            value = rise * (shapes(d.span_mm, q) @ np.array([d.offset, d.growth, d.bow]))
            columns = sums.setdefault((d.component[2], d.span_mm, d.line_mm, d.tool_mm), {})
            columns[d.component] = columns.get(d.component, np.zeros(3)) + value
        return tuple(
            ComponentTable(
                axis, (axis,), (np.linspace(*span, 3),), columns, line, tool, name="thermal distortion"
            )
            for (axis, span, line, tool), columns in sums.items()
            if any(np.any(v) for v in columns.values())
        )

    def cover_problems(self, box_mm: Array) -> list[str]:
        problems = {}
        for d in self.distortions:
            low, high = box_mm[AXES.index(d.component[2])]
            if d.span_mm[0] > low + COVER_MM or d.span_mm[1] < high - COVER_MM:
                problems[d.component] = (
                    f"the distortion of {d.component} is known from {d.span_mm[0]:g} to {d.span_mm[1]:g} mm; "
                    f"expected all of the box, {low:g} to {high:g} mm"
                )
        return list(problems.values())

    def components(self) -> Sequence[str]:
        """The components that it holds."""
        return sorted({d.component for d in self.distortions})


Range = tuple[float, float]


class SensorTable(Table):
    name: Text = Field(description="the name of the sensor, as in logs and job files")
    reference_degC: float = Field(description="its reading where its part distorts nothing, in degC")
    range_degC: Range = Field(
        description="the structure temperatures that were identified, [min, max] in degC"
    )
    lag_s: float = Field(
        default=0.0,
        description="the time by which the structure lags the sensor, in s; below 0 the sensor lags",
    )


class DistortionTable(Table):
    component: Literal[COMPONENTS] = Field(  # type: ignore[valid-type]
        description='the ISO 230-1 name of a component error, such as "EXX"'
    )
    sensor: Text = Field(description="the sensor of the part that causes it")
    span_mm: Interval = Field(description="the axis positions that the shapes span, [min, max] in mm")
    offset_um_K: float | None = Field(default=None, description="the same all along the axis, in um per K")
    growth_um_m_K: float | None = Field(
        default=None, description="growth from the middle of the span, in um per m and K"
    )
    bow_um_K: float | None = Field(
        default=None, description="a parabola, 0 at both ends of the span, its middle in um per K"
    )
    offset_urad_K: float | None = Field(
        default=None, description="the same all along the axis, in urad per K"
    )
    growth_urad_m_K: float | None = Field(
        default=None, description="growth from the middle of the span, in urad per m and K"
    )
    bow_urad_K: float | None = Field(
        default=None,
        check_default=True,
        description="a parabola, 0 at both ends of the span, its middle in urad per K",
    )
    line_mm: Position | None = Field(
        default=None, description="positions of the other axes while measuring; the datum if left out"
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the tool vector while measuring, [X, Y, Z] in mm"
    )

    @rule("bow_urad_K")
    @staticmethod
    def _unit_fits(value: float | None, known: Known) -> float | None:
        component = known.get("component")
        if component is None:
            return value
        angular = component[1] in "ABC"
        stated = {**known, "bow_urad_K": value}
        wrong = [
            key
            for key, number in stated.items()
            if number is not None and key.endswith("_K") and ("_urad" in key) != angular
        ]
        if wrong:
            raise refusal(
                f"or another key ({wrong[0]}) is of the wrong unit for {component}; expected keys in "
                f"{'urad' if angular else 'um'}"
            )
        return value


class ThermalFile(Table):
    """olp-thermal-1: sensors, the structure behind them, and how it distorts."""

    schema_: Literal["olp-thermal-1"] = Field(alias="schema", description='the format, "olp-thermal-1"')
    machine: Text = Field(description="the name in the machine file that this belongs to")
    sensors: list[SensorTable] = Field(description="tables [[sensors]]")
    distortions: list[DistortionTable] = Field(default=[], description="tables [[distortions]]")


class ThermalStructure(ErrorSource[str | None, Structure | None]):
    """An olp-thermal-1 file, which the key `structure` of the table [thermal] names."""

    key = "structure"
    field = "structure"
    covered = False

    def example(self, by: float) -> Example:
        file = 'schema = "olp-thermal-1"\nmachine = "example"\n[[sensors]]\nname = "beam"\n'
        file += "reference_degC = 20.0\nrange_degC = [15.0, 30.0]\nlag_s = 600.0\n"
        file += '[[distortions]]\ncomponent = "EYY"\nsensor = "beam"\nspan_mm = [0.0, 300.0]\n'
        file += f"offset_um_K = {1.5 * by}\ngrowth_um_m_K = {8.0 * by}\n"
        file += '[[distortions]]\ncomponent = "EBX"\nsensor = "beam"\nspan_mm = [0.0, 400.0]\n'
        file += f"offset_urad_K = {0.5 * by}\nbow_urad_K = {4.0 * by}\n"
        name = "calibration-thermal.toml"
        return Example(f'[thermal]\nstructure = "{name}"\n', {name: file}, {"beam": 24.0})

    def stated(self, file: Any) -> str | None:
        name: str | None = None if file.thermal is None else file.thermal.structure
        return name

    def named(self, values: Mapping[str, Any]) -> list[str]:
        name = values.get("thermal", {}).get("structure")
        return [name] if name else []

    def read(self, stated: str | None, reading: Reading) -> Structure | None:
        if stated is None:
            return None
        make = lambda file: structure_of(reading.document(file, ThermalFile))  # noqa: E731
        return reading.one(("thermal", "structure"), stated, make)

    def write(self, values: Structure | None, writing: Writing) -> None:
        if values is None:
            return
        if writing.find("[thermal]") is None:
            write_table(Thermal(), writing)
        table = writing.find("[thermal]")
        assert table is not None
        table["structure"] = writing.document("thermal", structure_tables(values, writing.machine))

    def models(self, values: Structure | None, frame: Frame) -> list[ErrorModel]:
        tables = () if values is None else values.tables(hold=frame.hold)
        if not tables:
            return []
        from olp.errormodel.grid_errors import GridErrors

        return [
            GridErrors.of(
                "thermal", tables, frame.chain, frame.datum_mm, frame.box_mm, hold=frame.hold,
                tool_terms=frame.tool_terms,
            )
        ]  # fmt: skip

    def inspect(self, values: Structure | None, frame: Frame) -> dict[str, Any]:
        if values is None:
            return {}
        sensors = [
            {
                "name": s.name,
                "reference_degC": s.reference_degC,
                "lowest_degC": s.range_degC[0],
                "highest_degC": s.range_degC[1],
                "lag_s": s.lag_s,
            }
            for s in values.sensors
        ]
        distortions = []
        for d in values.distortions:
            unit, scale = ("urad", 1.0 / RAD_PER_URAD) if d.component[1] in "ABC" else ("um", UM_PER_MM)
            distortions.append(
                {
                    "name": f"{d.component} by {d.sensor}",
                    f"offset_{unit}_K": d.offset * scale,
                    f"growth_{unit}_m_K": d.growth * scale * 1e3,
                    f"bow_{unit}_K": d.bow * scale,
                }
            )
        return {"sensors": sensors, "distortions": distortions}


def structure_of(file: ThermalFile) -> Structure:
    """The values of an olp-thermal-1 file. Raises ConfigError."""
    return Structure(
        tuple(Sensor(s.name, s.reference_degC, s.range_degC, s.lag_s) for s in file.sensors),
        tuple(_distortion(d) for d in file.distortions),
    )


def _distortion(table: DistortionTable) -> Distortion:
    unit, power = ("urad", -6) if table.component[1] in "ABC" else ("um", -3)

    def of(shape: str, more: int = 0) -> float:
        value = getattr(table, shape.format(unit))
        return 0.0 if value is None else shifted(value, power + more)

    return Distortion(
        component=table.component,
        sensor=table.sensor,
        span_mm=table.span_mm,
        offset=of("offset_{}_K"),
        growth=of("growth_{}_m_K", -3),
        bow=of("bow_{}_K"),
        line_mm=None if table.line_mm is None else _line(table.line_mm, table.component),
        tool_mm=table.tool_mm,
    )


def _line(stated: Position, component: str) -> Vector:
    """The positions of the other axes; that of the component's own axis does not matter."""
    positions = zip(AXES, stated.values, strict=True)
    missing = [a for a, position in positions if position is None and a != component[2]]
    if missing:
        raise ConfigError(
            f"line_mm of {component} names no {missing[0]}; expected the position of each other axis"
        )
    return vector([0.0 if position is None else position for position in stated.values])


def structure_tables(structure: Structure, machine: str) -> Iterator[tuple[str, dict[str, object]]]:
    """Header and keys of each table of an olp-thermal-1 file that reads back the same; the first has no
    header."""
    yield "", {"schema": "olp-thermal-1", "machine": machine}
    for sensor in structure.sensors:
        yield (
            "[[sensors]]",
            {
                "name": sensor.name,
                "reference_degC": sensor.reference_degC,
                "range_degC": list(sensor.range_degC),
                "lag_s": sensor.lag_s,
            },
        )
    for d in structure.distortions:
        unit, power = ("urad", -6) if d.component[1] in "ABC" else ("um", -3)
        yield (
            "[[distortions]]",
            {
                "component": d.component,
                "sensor": d.sensor,
                "span_mm": floats(d.span_mm),
                f"offset_{unit}_K": in_unit(d.offset, power),
                f"growth_{unit}_m_K": in_unit(d.growth, power - 3),
                f"bow_{unit}_K": in_unit(d.bow, power),
                "line_mm": None if d.line_mm is None else dict(zip(AXES, map(float, d.line_mm), strict=True)),
                "tool_mm": None if d.tool_mm == ZERO else floats(d.tool_mm),
            },
        )
