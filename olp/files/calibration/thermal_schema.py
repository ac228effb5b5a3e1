"""The keys of a file with the thermal structure of a machine, which `olp calibrate thermal` writes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from olp.core.machine import COMPONENTS
from olp.core.schema import Interval, Position, Table, Text, Triple, refusal

Range = Annotated[tuple[float, float], Field(strict=False)]


class SensorTable(Table):
    name: Text = Field(description="the name of the sensor, as in logs and job files")
    reference_degC: float = Field(description="what it says where its part distorts nothing, in degC")
    range_degC: Range = Field(
        description="the structure temperatures that were identified, [min, max] in degC"
    )
    lag_s: float = Field(
        default=0.0,
        description="how slowly the structure follows the sensor, in s; below 0 the sensor is behind it",
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
        validate_default=True,
        description="a parabola, 0 at both ends of the span, its middle in urad per K",
    )
    line_mm: Position | None = Field(
        default=None, description="where the other axes stood while measuring; the datum if left out"
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the tool vector while measuring, [X, Y, Z] in mm"
    )

    @field_validator("bow_urad_K")
    @classmethod
    def _unit_fits(cls, value: float | None, info: ValidationInfo) -> float | None:
        component = info.data.get("component")
        if component is None:
            return value
        angular = component[1] in "ABC"
        stated = {**info.data, "bow_urad_K": value}
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
