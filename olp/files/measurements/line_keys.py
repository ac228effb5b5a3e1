"""The keys of one line: in a plan, in its [defaults], or in the file of readings itself."""

from __future__ import annotations

import datetime
from typing import Annotated, Literal

from olp.core.machine import COMPONENTS
from olp.core.schema import NotNegative, Position, Positive, Table, Text, Triple
from olp.core.schema_keys import Before, Field, refusal
from olp.files.fields import IsoNames, shown
from olp.files.measurements.readings import SENSES


def _sense(value: object) -> object:
    if value not in SENSES:
        raise refusal(
            f"= {shown(value)} is not a sign convention; expected one of "
            + ", ".join(f'"{sense}"' for sense in SENSES)
        )
    return value


Sense = Annotated[str, Field(shown={"enum": list(SENSES)}), Before(_sense)]
Instrument = Literal["laser", "level", "autocollimator", "straightedge", "other"]


class AirTable(Table):
    air_degC: float = Field(description="the temperature of the air, in degC")
    pressure_hPa: Positive = Field(description="the pressure of the air, in hPa")
    humidity_percent: NotNegative = Field(description="the relative humidity of the air, in percent")


class LineKeys(Table):
    """The keys of one line, in a plan, in its [defaults], or in the file itself."""

    line_mm: Position = Field(
        default_factory=Position,
        description="the positions of the other two axes, such as { Y = 700.0, Z = -600.0 } in mm",
    )
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the reflector, [X, Y, Z] in mm"
    )
    reference: Literal["functional-point", "table"] | None = Field(
        default=None,
        description='"functional-point" (reflector at the tool) or "table" (reflector on a moving table)',
    )
    square: Text | None = Field(
        default=None, description="the name of the square whose leg the straightness was read against"
    )
    straightedge: Text | None = Field(
        default=None, description="the name of the straightedge that the straightness was read against"
    )
    turned_over: bool | None = Field(
        default=None,
        description="whether the square was turned over about one leg, or the straightedge about its length",
    )
    sense: Sense | None = Field(
        default=None,
        description='"actual-minus-commanded" or "commanded-minus-actual" of the tool relative to the '
        'workpiece; the prefix "table-motion" for readings of the table itself',
    )
    sigma_um: NotNegative | None = Field(
        default=None,
        description="the standard uncertainty of one reading in um; from the spread of the runs if left out",
    )
    sigma_urad: NotNegative | None = Field(
        default=None, description="the standard uncertainty of one reading of an angle, in urad"
    )
    sigma_scale_um_m: NotNegative | None = Field(
        default=None,
        description="the standard uncertainty of the scale of a positioning line (wavelength), in um/m",
    )
    laser_assumes: AirTable | None = Field(
        default=None,
        description="the air that the laser took for its readings, where columns air_degC, pressure_hPa and "
        "humidity_percent state what it was",
    )
    laser_zero_mm: float | None = Field(
        default=None, description="the axis position where the laser was zeroed, for these columns"
    )
    expansion_um_m_K: NotNegative | None = Field(
        default=None,
        description="the expansion of the scale or screw, whose temperature a column material_degC states",
    )
    material_reference_degC: float | None = Field(
        default=None,
        description="the temperature to which these readings are reduced: temperature_degC of the plan",
    )
    instrument: Instrument | None = Field(
        default=None, description='"laser", "level", "autocollimator", "straightedge" or "other"'
    )
    reflector: Text | None = Field(default=None, description="a description of the optics, for the report")
    profile: Text | None = Field(
        default=None, description="the path of the profile of the file's layout, relative to the plan"
    )


class LineTable(LineKeys):
    file: Text = Field(description="the path of the file of readings, relative to this file")
    component: Literal[COMPONENTS] | None = Field(  # type: ignore[valid-type]
        default=None,
        description='the ISO 230-1 name of what was read, such as "EXX"; the file may state it instead',
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
        default=None, description="the deviation of the square's angle, + above 90 degrees, in urad"
    )
    square_sigma_urad: NotNegative | None = Field(
        default=None, description="the standard uncertainty of the square's angle, in urad"
    )
