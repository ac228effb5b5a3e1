"""The keys of a plan of measurements (olp-measurements-1): its own, and one list of tables per instrument."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any, Literal

from olp.core.schema import Positive, Table, Text, fields_of, with_keys
from olp.core.schema_keys import Field
from olp.files.fields import Chain, IsoNames
from olp.files.measurements.instruments.registry import INSTRUMENTS
from olp.files.measurements.line_keys import LineKeys


class SquareTable(Table):
    name: Text = Field(description="the name that lines use")
    error_urad: float = Field(
        default=0.0,
        description="the deviation of the angle between its legs, both along + of their axes, in urad; + "
        "above 90 degrees",
    )
    sigma_urad: Positive = Field(description="the standard uncertainty of that angle, in urad")


class StraightedgeTable(Table):
    name: Text = Field(description="the name that lines use")
    sigma_um: Positive | None = Field(
        default=None,
        description="how straight it is, a standard uncertainty in um; if left out, lines read with it "
        "turned over find its form",
    )


class MapKeys(Table):
    noise: Literal["learnt", "stated"] = Field(
        default="learnt",
        description='"learnt" (the readings scale the stated uncertainties) or "stated" (used as stated)',
    )
    within_um: Positive = Field(
        default=0.2, description="the largest error of interpolation between the nodes of the map, in um"
    )


class PeriodsTable(Table):
    X: list[Positive] = Field(default=[], description="the periods of screw and scale of X, [..] in mm")
    Y: list[Positive] = Field(default=[], description="the periods of screw and scale of Y, [..] in mm")
    Z: list[Positive] = Field(default=[], description="the periods of screw and scale of Z, [..] in mm")


class PlanFile(Table):
    """The keys of a plan beside the tables of instruments."""

    schema_: Literal["olp-measurements-1"] = Field(
        alias="schema", description='the format, "olp-measurements-1"'
    )
    machine: Text = Field(description="the name in the machine file")
    chain: Chain | None = Field(
        default=None,
        description='the order of axes from workpiece to tool, such as "FXYZ"; as in the machine file',
    )
    measured: datetime.date = Field(description="the date of measuring, such as 2026-05-14, without quotes")
    temperature_degC: float = Field(description="the temperature of the scales while measuring, in degC")
    vertical: Literal["X", "Y", "Z"] = Field(
        default="Z",
        description='the axis along gravity, "Z" if left out; a level does not read rotations about it',
    )
    active_during_measurement: IsoNames = Field(
        default=frozenset(),
        description="the errors that the control corrected while measuring, a list of ISO 230-1 names",
    )
    defaults: LineKeys = Field(
        default_factory=LineKeys,
        description="the table [defaults]: the keys of lines that do not state them",
    )
    periods_mm: PeriodsTable = Field(
        default_factory=PeriodsTable,
        description="the table [periods_mm]: the periods of cyclic errors to be fitted",
    )
    squares: list[SquareTable] = Field(default=[], description="tables [[squares]]")
    straightedges: list[StraightedgeTable] = Field(default=[], description="tables [[straightedges]]")


def _tables() -> dict[str, Any]:
    """The lists of tables, those of instruments without a file of readings first."""
    ordered = sorted(INSTRUMENTS, key=lambda instrument: "file" in fields_of(instrument.table))
    return {
        instrument.key: (list[instrument.table], Field(default=[], description=instrument.words))  # type: ignore[name-defined]
        for instrument in ordered
    }


if TYPE_CHECKING:

    class _Tables(PlanFile): ...

else:
    _Tables = with_keys("_Tables", PlanFile, _tables(), words=PlanFile.__doc__ or "", module=__name__)


class MeasurementsFile(_Tables):
    """olp-measurements-1: the readings of one calibration, and how each was taken."""

    map: MapKeys | None = Field(
        default=None, description="the table [map]: asks for a map of errors beyond the rigid-body model"
    )
