"""The indirect thermal model: sensor temperatures to structure temperatures to distortion.

Each sensor stands for a part of the structure that follows it with a first-order lag: theta' = (T - theta) /
lag. A component error grows with each structure temperature in three shapes along its axis: an offset, linear
growth, and a bow. (Indirect compensation: see J. Mayr et al., Thermal issues in machine tools, CIRP Annals
61, 2012.) Its coefficients are identified from logs of sensors and drift (`olp.calibration.thermal.drift`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.units import AXES
from olp.errormodel.gridded import COVER_MM, ComponentTable, refuse

SHAPES = ("offset", "growth", "bow")


@dataclass(frozen=True, slots=True)
class Sensor:
    """A temperature sensor: at `reference_degC` its part causes no distortion; `range_degC` are the structure
    temperatures that were identified, `lag_s` how slowly the structure follows; below 0 it leads the
    sensor."""

    name: str
    reference_degC: float
    range_degC: tuple[float, float]
    lag_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Distortion:
    """What one K of one sensor's part adds to a component over `span_mm` of its axis, in mm or rad per K:
    offset + growth * (q - middle) + bow * (1 - ((q - middle) / half)^2), the growth per mm.

    `line_mm` and `tool_mm` as of a curve: where the other axes stood and the tool vector while measuring."""

    component: str
    sensor: str
    span_mm: tuple[float, float]
    offset: float = 0.0
    growth: float = 0.0
    bow: float = 0.0
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO


def shapes(span_mm: tuple[float, float], q: Array) -> Array:
    """(n, 3) offset, growth and bow at axis positions q (n,)."""
    middle, half = 0.5 * (span_mm[0] + span_mm[1]), 0.5 * (span_mm[1] - span_mm[0])
    u = q - middle
    return np.stack([np.ones_like(u), u, 1.0 - (u / half) ** 2], axis=1)


def lagged(time_s: Array, temperature_degC: Array, lag_s: float) -> Array:
    """(n,) structure temperature behind a sensor (n,), exact for a sensor that changes linearly between its
    readings; it starts settled. A negative lag is a lead: the sensor is behind its part by so much, and the
    rise of the sensor over its own lag is added to it."""
    if lag_s == 0.0:
        return temperature_degC
    if lag_s < 0.0:
        return 2.0 * temperature_degC - lagged(time_s, temperature_degC, -lag_s)
    step = np.diff(time_s)
    keep = np.exp(-step / lag_s)
    rate = np.diff(temperature_degC) / step
    # theta - T + lag * rate decays; so theta(end) = T(end) - lag rate + keep (theta - T(start) + lag rate)
    drive = temperature_degC[1:] - lag_s * rate - keep * (temperature_degC[:-1] - lag_s * rate)
    out = [float(temperature_degC[0])]
    for k, d in zip(keep.tolist(), drive.tolist(), strict=True):
        out.append(k * out[-1] + d)
    return np.array(out)


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Sensors and what their parts do. `temperatures_degC` are structure temperatures by sensor, None where
    nobody has stated them: then the model adds nothing. Raises ConfigError."""

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
        problems = [f"sensor {n} stands twice" for n in sorted(set(names)) if names.count(n) > 1]
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
                    f"sensors "
                    "and an ascending span"
                )
        return problems

    def at(self, temperatures_degC: Mapping[str, float]) -> Structure:
        """The same at structure temperatures: all of them. Raises ConfigError."""
        names = [sensor.name for sensor in self.sensors]
        missing = [name for name in names if name not in temperatures_degC]
        unknown = sorted(set(temperatures_degC) - set(names))
        if missing or unknown:
            what = f"no temperature of sensor {missing[0]}" if missing else f"{unknown[0]} is no sensor"
            raise ConfigError(f"{what}; expected a temperature of each of {', '.join(names)}")
        return replace(self, temperatures_degC=temperatures_degC)

    def settled(self, time_s: Array, sensors_degC: Mapping[str, Array], at_s: float | None) -> Structure:
        """The same at the structure temperatures that a log leads to, at a time in it or at its end; the log
        starts settled. Raises ConfigError."""
        upto = len(time_s) if at_s is None else int(np.searchsorted(time_s, at_s, side="right"))
        if at_s is not None and not time_s[0] <= at_s <= time_s[-1]:
            raise ConfigError(
                f"the time {at_s:g} s is not in the log of temperatures, {time_s[0]:g} to {time_s[-1]:g} s"
            )
        lags = {sensor.name: sensor.lag_s for sensor in self.sensors}
        found = {
            name: float(lagged(time_s[:upto], values[:upto], lags[name])[-1])
            for name, values in sensors_degC.items()
            if name in lags
        }
        return self.at(found)

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
                f"sensor {name}: the structure is at {value:.2f} degC, and was identified from {low:.2f} to "
                f"{high:.2f} degC; log the drift there too, or take the end of the range with "
                f"--outside-box hold"
            )
        return {
            s.name: float(np.clip(stated[s.name], *s.range_degC)) - s.reference_degC for s in self.sensors
        }

    def tables(self, *, hold: bool) -> tuple[ComponentTable, ...]:
        """The component errors at these temperatures, one table per measuring line and span; a parabola over
        three nodes is exact."""
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
        out = {}
        for d in self.distortions:
            low, high = box_mm[AXES.index(d.component[2])]
            if d.span_mm[0] > low + COVER_MM or d.span_mm[1] < high - COVER_MM:
                out[d.component] = (
                    f"the distortion of {d.component} is known from {d.span_mm[0]:g} to {d.span_mm[1]:g} mm; "
                    f"expected all of the box, {low:g} to {high:g} mm"
                )
        return list(out.values())

    def components(self) -> Sequence[str]:
        """The components that it holds."""
        return sorted({d.component for d in self.distortions})
