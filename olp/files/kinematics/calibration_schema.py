"""The keys of the calibration of a machine of any joints, as tables."""

from __future__ import annotations

import datetime
from typing import ClassVar, Literal

from olp.core.schema import Interval, NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.files.fields import Sign
from olp.files.kinematics.schema import none_named

#: What the format of machines with three linear axes has, and such machines not yet.
_NOT_BUILT = {
    "maps": "maps of residual errors",
    "compliance": "load tables",
    "beams": "bending of beams",
    "thermal": "expansion",
    "structure": "thermal structures",
    "quality": "the quality of a fit",
    "prior": "priors of a fit",
}


class JointCurveTable(Table):
    file: Text = Field(description="the path of a CSV file with columns such as C_deg, EXC_um, ECC_urad")
    interpolation: Literal["linear", "pchip"] = Field(default="pchip", description='"linear" or "pchip"')
    point_mm: Triple | None = Field(
        default=None,
        description="the functional point where the errors were measured, with all axes at zero, [X, Y, Z] "
        "in mm; the point_mm of a rotary axis if left out",
    )
    line_mm: dict[Text, float] | None = Field(
        default=None,
        description="positions of the other linear axes while a linear axis was measured, such as "
        "{ Y = 0.0, Z = 0.0 } in mm; the datum if left out",
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the tool vector while a linear axis was measured, [X, Y, Z] in mm",
    )
    reference: Literal["functional-point", "table"] = Field(
        default="functional-point",
        description='"functional-point" (measured at the tip on its line) or "table" (the reflector was '
        "fixed on a moving table)",
    )
    periodic: bool = Field(
        default=False, description="whether the curve of a rotary axis repeats after 360 degrees"
    )


class LocationTable(Table):
    X_um: float | None = Field(default=None, description="the shift of the axis line in X, in um")
    Y_um: float | None = Field(default=None, description="the shift of the axis line in Y, in um")
    Z_um: float | None = Field(default=None, description="the shift of the axis line in Z, in um")
    A_urad: float | None = Field(default=None, description="the tilt of the axis line about X, in urad")
    B_urad: float | None = Field(default=None, description="the tilt of the axis line about Y, in urad")
    C_urad: float | None = Field(default=None, description="the tilt of the axis line about Z, in urad")
    zero_um: float | None = Field(default=None, description="the zero error of a linear axis, in um")
    zero_urad: float | None = Field(default=None, description="the zero error of a rotary axis, in urad")


class HarmonicTable(Table):
    component: Text = Field(description='the error that repeats, such as "ECC", "EJ2J2" or "EXX"')
    period_mm: Positive | None = Field(default=None, description="the period of a linear axis, in mm")
    period_deg: Positive | None = Field(
        default=None, description="the period of a rotary axis, in degrees: 360 over the ratio of the gear"
    )
    amplitude_um: float | None = Field(default=None, description="the amplitude (peak) of a shift, in um")
    amplitude_urad: float | None = Field(
        default=None, description="the amplitude (peak) of an angle, in urad"
    )
    phase_rad: float = Field(default=0.0, description="the phase at axis value 0, in rad")


class ElasticityTable(Table):
    own_urad_Nm: float = Field(
        default=0.0, description="the own turn of a rotary axis under torque about it, in urad per Nm"
    )
    own_um_kN: float = Field(
        default=0.0, description="the own shift of a linear axis under force along it, in um per kN"
    )
    A_urad_Nm: float = Field(default=0.0, description="the tilt about X under torque about X, in urad per Nm")
    B_urad_Nm: float = Field(default=0.0, description="the tilt about Y under torque about Y, in urad per Nm")
    C_urad_Nm: float = Field(default=0.0, description="the tilt about Z under torque about Z, in urad per Nm")
    X_um_kN: float = Field(default=0.0, description="the shift in X under force in X, in um per kN")
    Y_um_kN: float = Field(default=0.0, description="the shift in Y under force in Y, in um per kN")
    Z_um_kN: float = Field(default=0.0, description="the shift in Z under force in Z, in um per kN")


class GravityTable(Table):
    component: Text = Field(description='the own turn of a rotary axis, such as "EJ2J2"')
    angles: list[Text] = Field(
        description='the axes whose values are summed, such as ["J2", "J3"], each with the sign of its turn '
        "about the direction of the axis of component"
    )
    sin_urad: float = Field(default=0.0, description="the turn by the sine of that sum, in urad")
    cos_urad: float = Field(default=0.0, description="the turn by the cosine of that sum, in urad")


class MassTable(Table):
    on: Text = Field(description="the axis that moves the body with this weight")
    kg: Positive = Field(description="the weight, in kg")
    centre_mm: Triple = Field(description="its centre with all axes at zero, [X, Y, Z] in mm")


class LegErrorTable(Table):
    platform: Text = Field(description="the name of the platform")
    leg: int = Field(description="the number of the leg, counted from 1", ge=1)
    base_um: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the error of the joint at the base, [X, Y, Z] in um"
    )
    platform_um: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the error of the joint at the platform, [X, Y, Z] in um"
    )
    length_um: float = Field(default=0.0, description="the error of the length, in um")


class JointSquarenessTable(Table):
    C0Y_urad: float | None = Field(default=None, description="the tilt of Y about Z, in urad")
    B0Z_urad: float | None = Field(default=None, description="the tilt of Z about Y, in urad")
    A0Z_urad: float | None = Field(default=None, description="the tilt of Z about X, in urad")


class JointCovarianceTable(Table):
    file: Text | None = Field(
        default=None,
        description="the path of the covariance of all numbers, as olp calibrate fit writes it, relative to "
        "this file",
    )
    growth_per_year: NotNegative = Field(
        default=0.0,
        description="the growth of standard uncertainties per year after measured, as a share: 0.5 makes "
        "them half as large again",
    )
    misfit_um: NotNegative = Field(
        default=0.0,
        description="the standard deviation of each coordinate of the tip by what the numbers do not "
        "explain, such as curves, cyclic errors and play, as olp calibrate fit found it in its readings",
    )


class JointCalibrationFile(Table):
    """olp-calibration-1 of any joints: the measured errors of one machine, actual minus commanded."""

    not_built: ClassVar[dict[str, str]] = _NOT_BUILT

    schema_: Literal["olp-calibration-1"] = Field(
        alias="schema", description='the format, "olp-calibration-1"'
    )
    machine: Text = Field(description="the name in the machine file that this calibration belongs to")
    measured: datetime.date = Field(description="the date of measuring, such as 2026-05-14, without quotes")
    valid_until: datetime.date | None = Field(
        default=None, description="the last date of validity, such as 2027-05-14, without quotes"
    )
    temperature_degC: float = Field(description="the temperature of the scales while measuring, in degC")
    sign: Sign = Field(description='the sign of all values, "actual-minus-commanded"')
    model: Literal["rigid-body"] = Field(description='"rigid-body"')
    datum_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the axis positions from which lever arms of linear axes count, [X, Y, Z] in mm",
    )
    box: dict[Text, Interval] = Field(
        description="the calibrated axis positions, { X_mm = [min, max], C_deg = [min, max] }"
    )
    payload_kg: NotNegative = Field(
        default=0.0,
        description="the payload while measuring, in kg, where no [elasticity] says what it bends; 0 if left "
        "out",
    )
    payload_centre_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the centre of this payload from the gauge point, in the gauge frame, [X, Y, Z] in mm",
    )
    active_during_measurement: list[Text] = Field(
        default=[], description="the errors that the control corrected then; none can be named here yet"
    )
    curves: list[JointCurveTable] = Field(default=[], description="tables [[curves]]: error motions")
    location: dict[Text, LocationTable] = Field(
        default={},
        description="tables [location.NAME]: where the line of an axis really is, or [location.gauge]",
    )
    squareness: JointSquarenessTable = Field(
        default_factory=JointSquarenessTable, description="the table [squareness] of X, Y and Z"
    )
    backlash: dict[Text, float] = Field(
        default={}, description="the table [backlash]: X_um, C_urad and so on, the whole play of an axis"
    )
    cyclic: list[HarmonicTable] = Field(
        default=[], description="tables [[cyclic]]: errors that repeat with the turn of a screw or a gear"
    )
    elasticity: dict[Text, ElasticityTable] = Field(
        default={}, description="tables [elasticity.NAME]: how an axis gives way under weight"
    )
    masses: list[MassTable] = Field(default=[], description="tables [[masses]]: weights on the bodies")
    gravity: list[GravityTable] = Field(
        default=[],
        description="tables [[gravity]]: how a rotary axis gives way under weights that are not known",
    )
    legs: list[LegErrorTable] = Field(default=[], description="tables [[legs]]: errors of legs of platforms")
    covariance: JointCovarianceTable = Field(
        default_factory=JointCovarianceTable,
        description="the table [covariance]: how well the numbers are known; olp calibrate doctor and refine "
        "use it",
    )

    @rule("active_during_measurement")
    @staticmethod
    def _none_yet(value: list[str], _: Known) -> list[str]:
        return none_named(value)

    @rule("valid_until")
    @staticmethod
    def _not_before_measured(value: datetime.date | None, known: Known) -> datetime.date | None:
        measured = known.get("measured")
        if value is not None and measured is not None and value < measured:
            raise refusal(f"= {value} is before measured = {measured}; expected a later date")
        return value
