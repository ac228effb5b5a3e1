"""Values of squareness that an instrument gave as such: tables [[squareness]]."""

from __future__ import annotations

from typing import Literal

from olp.calibration.observations.squareness import SquarenessReading
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.schema import Interval, Position, Positive, Table, Triple
from olp.core.schema_keys import Field
from olp.core.units import AXES, RAD_PER_URAD
from olp.files.measurements.instruments.base import Instrument, Plan
from olp.files.measurements.line_merging import together

_PLANES = {"C0Y": "XY", "B0Z": "XZ", "A0Z": "YZ"}


class SpanTable(Table):
    X: Interval | None = Field(default=None, description="the length measured along X, [min, max] in mm")
    Y: Interval | None = Field(default=None, description="the length measured along Y, [min, max] in mm")
    Z: Interval | None = Field(default=None, description="the length measured along Z, [min, max] in mm")


class SquarenessReadingTable(Table):
    component: Literal["C0Y", "B0Z", "A0Z"] = Field(description='"C0Y", "B0Z" or "A0Z"')
    value_urad: float = Field(
        description="the squareness of the mean lines in urad, right-handed about the third axis: Y leans to "
        "-X for C0Y > 0, Z to +X for B0Z > 0, Z to -Y for A0Z > 0"
    )
    sigma_urad: Positive = Field(description="its standard uncertainty, in urad")
    line_mm: Position = Field(
        default_factory=Position,
        description="the positions of the axes while the others moved, { X = .., Y = .., Z = .. } in mm",
    )
    span_mm: SpanTable = Field(description="the lengths measured, { X = [0, 1000], Y = [0, 800] } in mm")
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the probe, [X, Y, Z] in mm"
    )


class SquarenessTables(Instrument[SquarenessReadingTable, SquarenessReading]):
    key = "squareness"
    table = SquarenessReadingTable
    words = "tables [[squareness]]"
    gives = SquarenessReading

    def read(self, table: SquarenessReadingTable, plan: Plan) -> SquarenessReading:
        plane = _PLANES[table.component]
        line = together([table.line_mm, plan.defaults.line_mm])
        tool = table.tool_mm or plan.defaults.tool_mm
        first, second = (getattr(table.span_mm, axis) for axis in plane)
        missing = [axis for axis in AXES if getattr(line, axis) is None]
        problems = []
        if missing:
            names = ", line_mm.".join(missing)
            problems.append(f"line_mm.{names} is missing; expected the axis position in mm")
        if tool is None:
            problems.append("tool_mm is missing; expected [X, Y, Z] from the gauge point to the probe, in mm")
        if first is None or second is None:
            problems.append(
                f"span_mm is incomplete; expected the lengths measured along {plane[0]} and {plane[1]}"
            )
        if problems or tool is None:
            raise ConfigError("; ".join(problems), problems=tuple(problems))
        line_mm: Vector = (line.X, line.Y, line.Z)
        value, sigma = table.value_urad * RAD_PER_URAD, table.sigma_urad * RAD_PER_URAD
        return SquarenessReading(
            table.component, value, line_mm, (first, second), tool, sigma, str(plan.path)
        )
