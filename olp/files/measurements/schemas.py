"""The keys of a plan of measurements (olp-measurements-1), and of files of readings themselves."""

from __future__ import annotations

import datetime
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from olp.core.machine import COMPONENTS
from olp.core.schema import Interval, NotNegative, Position, Positive, Table, Text, Triple, refusal
from olp.files.fields import Chain, IsoNames, shown
from olp.files.measurements.readings import SENSES


def _sense(value: object) -> object:
    if value not in SENSES:
        raise refusal(
            f"= {shown(value)} is no sense; expected one of " + ", ".join(f'"{sense}"' for sense in SENSES)
        )
    return value


Sense = Annotated[str, Field(json_schema_extra={"enum": list(SENSES)}), BeforeValidator(_sense)]
Instrument = Literal["laser", "level", "autocollimator", "straightedge", "other"]


class LineKeys(Table):
    """What may be said of one line, in a plan, in its [defaults], or in the file itself."""

    line_mm: Position = Field(
        default_factory=Position,
        description="where the other two axes stood, such as { Y = 700.0, Z = -600.0 } in mm",
    )
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the reflector, [X, Y, Z] in mm"
    )
    reference: Literal["functional-point", "table"] | None = Field(
        default=None,
        description='"functional-point" (reflector at the tool) or "table" (it stayed on a moving table)',
    )
    square: Text | None = Field(
        default=None, description="the name of the square whose leg the straightness was read against"
    )
    sense: Sense | None = Field(
        default=None,
        description='"actual-minus-commanded" or "commanded-minus-actual" of the tool relative to the '
        'workpiece; "table-motion ..." in front: of the table itself',
    )
    sigma_um: NotNegative | None = Field(
        default=None,
        description="the standard uncertainty of one reading in um; from the spread of the runs if left out",
    )
    sigma_urad: NotNegative | None = Field(
        default=None, description="the same of a reading of an angle, in urad"
    )
    sigma_scale_um_m: NotNegative | None = Field(
        default=None,
        description="the standard uncertainty of the scale of a positioning line (wavelength), in um/m",
    )
    instrument: Instrument | None = Field(
        default=None, description='"laser", "level", "autocollimator", "straightedge" or "other"'
    )
    reflector: Text | None = Field(default=None, description="words on the optics, kept for the report")
    profile: Text | None = Field(
        default=None, description="the profile that says how the file is laid out, relative to the plan"
    )


class LineTable(LineKeys):
    file: Text = Field(description="the path of the file of readings, relative to this file")
    component: Literal[COMPONENTS] | None = Field(  # type: ignore[valid-type]
        default=None,
        description='the ISO 230-1 name of what was read, such as "EXX"; the file may say it instead',
    )


class Stated(LineKeys):
    """Keys that a file of readings states about itself in comments."""

    component: Literal[COMPONENTS] | None = Field(  # type: ignore[valid-type]
        default=None, description='the ISO 230-1 name of what was read, such as "EXX"'
    )
    machine: Text | None = Field(default=None, description="the name of the machine")
    measured: datetime.date | None = Field(
        default=None, description="the date of measuring, such as 2026-05-14"
    )
    temperature_degC: float | None = Field(
        default=None, description="the temperature of the scales while measuring, in degC"
    )
    active_during_measurement: IsoNames | None = Field(
        default=None, description="the errors that the control corrected while measuring"
    )
    period_mm: list[Positive] = Field(
        default=[], description="the periods of screw and scale of this axis, [..] in mm"
    )
    square_error_urad: float | None = Field(
        default=None, description="by how much the square's angle is more than 90 degrees, in urad"
    )
    square_sigma_urad: NotNegative | None = Field(
        default=None, description="the standard uncertainty of the square's angle, in urad"
    )


class SquareTable(Table):
    name: Text = Field(description="the name that lines use")
    error_urad: float = Field(
        default=0.0,
        description="by how much the angle between its legs, both along + of their axes, is more than 90 "
        "degrees, in urad",
    )
    sigma_urad: Positive = Field(description="the standard uncertainty of that angle, in urad")


class SpanTable(Table):
    X: Interval | None = Field(default=None, description="the length measured along X, [min, max] in mm")
    Y: Interval | None = Field(default=None, description="the length measured along Y, [min, max] in mm")
    Z: Interval | None = Field(default=None, description="the length measured along Z, [min, max] in mm")


class SquarenessReadingTable(Table):
    component: Literal["C0Y", "B0Z", "A0Z"] = Field(description='"C0Y", "B0Z" or "A0Z"')
    value_urad: float = Field(
        description="the squareness of the mean lines in urad, right-handed about the third axis: C0Y > 0: Y "
        "leans to -X; B0Z > 0: Z leans to +X; A0Z > 0: Z leans to -Y"
    )
    sigma_urad: Positive = Field(description="its standard uncertainty, in urad")
    line_mm: Position = Field(
        default_factory=Position,
        description="where the axes stood while the others moved, { X = .., Y = .., Z = .. } in mm",
    )
    span_mm: SpanTable = Field(description="the lengths measured, { X = [0, 1000], Y = [0, 800] } in mm")
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the probe, [X, Y, Z] in mm"
    )


class PointsTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and "
        "measured_X_mm, measured_Y_mm, measured_Z_mm (in the instrument's frame), relative to this file"
    )
    sigma_um: Positive = Field(description="the standard uncertainty of a coordinate, in um")
    frame: Literal["unknown", "known"] = Field(
        default="unknown",
        description='"unknown" (the instrument\'s own), or "known": measured_ columns are in the frame of '
        "the machine, as TCP points are against a simulation model",
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the instrument's scale, in um/m"
    )


class PolarTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and distance_mm, "
        "azimuth_deg, elevation_deg, relative to this file"
    )
    sigma_distance_um: Positive = Field(description="the standard uncertainty of a distance, in um")
    sigma_um_m: NotNegative = Field(default=0.0, description="what it grows by with the distance, in um/m")
    sigma_angle_urad: Positive = Field(description="the standard uncertainty of an angle, in urad")
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the scale of all distances, in um/m"
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )


class StationTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and length_mm, "
        "relative to this file"
    )
    sigma_um: Positive = Field(description="the standard uncertainty of a length, in um")
    sigma_um_m: NotNegative = Field(default=0.0, description="what it grows by with the length, in um/m")
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the scale of all lengths, in um/m"
    )


class BaselineTable(Table):
    between: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] = Field(
        strict=False, description="the numbers of two pods, such as [1, 2]"
    )
    length_mm: Positive = Field(description="the distance between their centres, in mm")
    sigma_um: Positive = Field(description="its standard uncertainty, in um")


class PodsTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and "
        "azimuth_1_deg, elevation_1_deg, azimuth_2_deg ..., relative to this file"
    )
    pods: Annotated[int, Field(ge=1)] = Field(default=2, description="how many pods; 2 if left out")
    sigma_urad: Positive = Field(description="the standard uncertainty of an angle, in urad")
    baselines: list[BaselineTable] = Field(
        default=[],
        description="tables [[pods.baselines]]: known distances; without one nothing tells the scale",
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )


class InstrumentTable(Table):
    file: Text = Field(
        description="the path of a CSV file that says in comments how it was taken, as "
        "`olp calibrate diagonals` and `olp calibrate ballbar` read it, relative to this file"
    )


class MapKeys(Table):
    noise: Literal["learnt", "stated"] = Field(
        default="learnt",
        description='"learnt" (the readings scale the stated uncertainties) or "stated" (they are as stated)',
    )
    within_um: Positive = Field(
        default=0.2, description="what interpolation between the nodes of the map may lose at most, in um"
    )


class PeriodsTable(Table):
    X: list[Positive] = Field(default=[], description="the periods of screw and scale of X, [..] in mm")
    Y: list[Positive] = Field(default=[], description="the periods of screw and scale of Y, [..] in mm")
    Z: list[Positive] = Field(default=[], description="the periods of screw and scale of Z, [..] in mm")


class MeasurementsFile(Table):
    """olp-measurements-1: the readings of one calibration, and how each was taken."""

    schema_: Literal["olp-measurements-1"] = Field(
        alias="schema", description='the format, "olp-measurements-1"'
    )
    machine: Text = Field(description="the name in the machine file")
    chain: Chain | None = Field(
        default=None,
        description='the order of axes from workpiece to tool, such as "FXYZ"; the machine file says it too',
    )
    measured: datetime.date = Field(description="the date of measuring, such as 2026-05-14, without quotes")
    temperature_degC: float = Field(description="the temperature of the scales while measuring, in degC")
    vertical: Literal["X", "Y", "Z"] = Field(
        default="Z", description='the axis along gravity, "Z" if left out: a level sees no turn about it'
    )
    active_during_measurement: IsoNames = Field(
        default=frozenset(),
        description="the errors that the control corrected while measuring, a list of ISO 230-1 names",
    )
    defaults: LineKeys = Field(
        default_factory=LineKeys,
        description="the table [defaults]: what holds for lines that do not say it",
    )
    periods_mm: PeriodsTable = Field(
        default_factory=PeriodsTable, description="the table [periods_mm]: where cyclic errors are looked for"
    )
    squares: list[SquareTable] = Field(default=[], description="tables [[squares]]")
    squareness: list[SquarenessReadingTable] = Field(default=[], description="tables [[squareness]]")
    lines: list[LineTable] = Field(default=[], description="tables [[lines]]")
    points: list[PointsTable] = Field(
        default=[], description="tables [[points]]: each one set-up of a tracker"
    )
    polar: list[PolarTable] = Field(
        default=[],
        description="tables [[polar]]: distances and two angles from one place that nobody knows",
    )
    stations: list[StationTable] = Field(
        default=[],
        description="tables [[stations]]: lengths from places that nobody knows (multilateration)",
    )
    pods: list[PodsTable] = Field(
        default=[], description="tables [[pods]]: directions from places that nobody knows"
    )
    diagonals: list[InstrumentTable] = Field(
        default=[], description="tables [[diagonals]]: each a laser along a face or body diagonal"
    )
    ballbars: list[InstrumentTable] = Field(
        default=[], description="tables [[ballbars]]: each the circles of a ball-bar about one centre"
    )
    map: MapKeys | None = Field(
        default=None, description="the table [map]: errors that no rigid bodies make are to be mapped"
    )
