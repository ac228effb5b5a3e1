"""The keys of a calibration file: its head, the tables of every error source, and its uncertainty."""

from __future__ import annotations

import datetime
from typing import Any, Literal

from olp.core.schema import Interval, NotNegative, Table, Text, Triple, with_keys
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.errormodel.quality import Fitted, Quality
from olp.errormodel.sources.registry import SOURCES
from olp.files.fields import SIGN, IsoNames, Sign


class CovarianceTable(Table):
    file: Text | None = Field(
        default=None,
        description="the path of the covariance of all numbers, as olp calibrate fit writes it, relative to "
        "this file; sigma columns and keys are used if left out",
    )
    growth_per_year: NotNegative = Field(
        default=0.0,
        description="the growth of standard uncertainties per year after measured, as a share: 0.5 makes "
        "them half as large again",
    )
    temperature_K: NotNegative = Field(
        default=0.0,
        description="the standard uncertainty of the temperatures of scales and workpiece, in K",
    )


class FittedTable(Table):
    source: Text = Field(description="the name of the file of readings, or of the instrument")
    chi_square: NotNegative = Field(description="the sum of squares of its standardised residuals")
    degrees_of_freedom: NotNegative = Field(
        description="the number of its readings less what the unknowns used up"
    )


class QualityTable(Table):
    chi_square: NotNegative = Field(description="the sum of squares of all standardised residuals")
    degrees_of_freedom: NotNegative = Field(
        description="the number of all readings less what the unknowns used up"
    )
    sources: list[FittedTable] = Field(
        default=[], description="tables [[quality.sources]], the same by source of readings"
    )


class CalibrationHead(Table):
    """What a calibration states of itself."""

    schema_: Literal["olp-calibration-1"] = Field(
        alias="schema", description='the format, "olp-calibration-1"'
    )
    machine: Text = Field(description="the name in the machine file that this calibration belongs to")
    measured: datetime.date = Field(description="the date of measuring, such as 2026-05-14, without quotes")
    valid_until: datetime.date | None = Field(
        default=None, description="the last date of validity, such as 2027-05-14, without quotes"
    )
    temperature_degC: float = Field(description="the temperature of the scales while measuring, in degC")
    sign: Sign = Field(description=f'the sign of all values, "{SIGN}"')
    model: Literal["rigid-body", "huddersfield"] = Field(description='"rigid-body" or "huddersfield"')
    datum_mm: Triple = Field(description="the axis positions from which lever arms count, [X, Y, Z] in mm")
    box_mm: tuple[Interval, Interval, Interval] = Field(
        description="the calibrated axis positions, [[min, max], [min, max], [min, max]] of X, Y, Z in mm"
    )
    active_during_measurement: IsoNames = Field(
        default=frozenset(),
        description="the errors that the control corrected while measuring, a list of ISO 230-1 names",
    )
    payload_kg: NotNegative = Field(
        default=0.0, description="the payload on the machine while measuring, in kg; 0 if left out"
    )

    @rule("valid_until")
    @staticmethod
    def _not_before_measured(value: datetime.date | None, known: Known) -> datetime.date | None:
        measured = known.get("measured")
        if value is not None and measured is not None and value < measured:
            raise refusal(f"= {value} is before measured = {measured}; expected a later date")
        return value


_TABLES: dict[str, Any] = {source.key: source.schema for source in SOURCES if source.schema is not None}
_TABLES["covariance"] = (
    CovarianceTable | None,
    Field(default=None, description="the table [covariance]: the uncertainty of the calibration"),
)
_TABLES["quality"] = (
    QualityTable | None,
    Field(
        default=None,
        description="the table [quality]: how well the readings fit, as olp calibrate fit writes it",
    ),
)

#: A calibration file: its head, and a key of every registered source.
CalibrationFile: type[CalibrationHead] = with_keys(
    "CalibrationFile",
    CalibrationHead,
    _TABLES,
    words="olp-calibration-1: the measured errors of one machine, actual minus commanded.",
    module=__name__,
)


def covariance_of(file: CalibrationHead) -> CovarianceTable:
    """The table [covariance], with its defaults where the file has none."""
    stated: CovarianceTable | None = vars(file)["covariance"]
    return stated or CovarianceTable()


def quality_of(file: CalibrationHead) -> Quality | None:
    """The table [quality] as a value, None where the file has none."""
    stated: QualityTable | None = vars(file)["quality"]
    if stated is None:
        return None
    sources = (Fitted(one.source, one.chi_square, one.degrees_of_freedom) for one in stated.sources)
    return Quality(Fitted("all readings", stated.chi_square, stated.degrees_of_freedom), tuple(sources))
