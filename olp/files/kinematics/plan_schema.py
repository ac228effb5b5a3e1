"""The keys of a plan of measurements (olp-measurements-1) of a machine of any joints, as tables."""

from __future__ import annotations

import datetime
from typing import Literal

from olp.core.schema import NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field, Known, rule
from olp.files.kinematics.calibration_schema import MassTable
from olp.files.kinematics.schema import none_named


class ReadingTable(Table):
    """What the tables of all instruments state."""

    file: Text = Field(
        description="the path of a CSV file: a column of commanded values for each axis, such as C_deg, and "
        "those of the instrument; columns such as read_back_C_deg may hold what the control showed"
    )
    sigma_um: Positive = Field(description="the standard uncertainty of a reading (a coordinate), in um")
    tool_mm: Triple = Field(
        description="the vector from the gauge point to what is read, in the gauge frame, [X, Y, Z] in mm"
    )
    tool_sigma_um: NotNegative = Field(
        default=0.0, description="the standard uncertainty of each coordinate of tool_mm, in um"
    )
    payload_kg: NotNegative = Field(default=0.0, description="the payload while measuring, in kg")
    payload_centre_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="its centre from the gauge point, [X, Y, Z] in mm"
    )


class TrackerPointsTable(ReadingTable):
    nests_mm: dict[Text, Triple] = Field(
        default={},
        description="the vectors of the nests from tool_mm by the names in the column nest, [X, Y, Z] in mm",
    )
    nest_sigma_um: NotNegative = Field(
        default=0.0, description="the standard uncertainty of each coordinate of a nest, in um"
    )


class TrackerPosesTable(ReadingTable):
    sigma_urad: Positive = Field(description="the standard uncertainty of a rotation, in urad")
    target_deg: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="how the target is turned in the gauge frame: A, B, C of Rz Ry Rx, in degrees",
    )
    target_sigma_urad: NotNegative = Field(
        default=0.0, description="the standard uncertainty of that turn, in urad"
    )


class BallTable(ReadingTable):
    reads: Literal["tip", "ball"] = Field(
        description='what dX_um, dY_um, dZ_um say: "tip" (the tip minus the ball) or "ball" (where the ball '
        "was found minus the nominal tip)"
    )
    axes: Literal["workpiece", "machine"] = Field(
        description='the directions of dX_um, dY_um, dZ_um: "workpiece" (they turn with a table) or "machine"'
    )


class BarTable(ReadingTable):
    centres_mm: dict[Text, Triple] = Field(
        description="where the centres are, about, by the names in the column centre, [X, Y, Z] in "
        "workpiece coordinates in mm"
    )
    length_sigma_um: NotNegative = Field(
        default=0.0, description="the standard uncertainty of an offset of all lengths, in um"
    )


class JointPriorTable(Table):
    shift_um: Positive | None = Field(
        default=None, description="the standard deviation of shifts and lengths before measuring, in um"
    )
    tilt_urad: Positive | None = Field(
        default=None, description="the standard deviation of tilts before measuring, in urad"
    )
    zero_urad: Positive | None = Field(
        default=None, description="the standard deviation of zeros before measuring, in urad"
    )
    yield_urad_Nm: Positive | None = Field(
        default=None, description="the standard deviation of yields before measuring, in urad per Nm"
    )
    gravity_urad: Positive | None = Field(
        default=None,
        description="the standard deviation of the turn of an axis in gravity before measuring, in urad",
    )


class JointPlanFile(Table):
    """olp-measurements-1 of any joints: the readings of one calibration, and how each was taken."""

    schema_: Literal["olp-measurements-1"] = Field(
        alias="schema", description='the format, "olp-measurements-1"'
    )
    machine: Text = Field(description="the name in the machine file")
    measured: datetime.date = Field(description="the date of measuring, such as 2026-05-14, without quotes")
    temperature_degC: float = Field(description="the temperature of the scales while measuring, in degC")
    active_during_measurement: list[Text] = Field(
        default=[], description="the errors that the control corrected then; none can be named here yet"
    )
    prior: JointPriorTable = Field(
        default_factory=JointPriorTable, description="the table [prior]: what is usual before measuring"
    )
    elasticity: list[Text] = Field(
        default=[], description="the rotary axes whose own turn under torque is fitted; needs weights"
    )
    gravity: list[Text] = Field(
        default=[],
        description="the rotary axes whose own turn under weights that are not known is fitted, by sines and "
        "cosines of sums of angles",
    )
    masses: list[MassTable] = Field(default=[], description="tables [[masses]]: weights on the bodies")
    points: list[TrackerPointsTable] = Field(
        default=[],
        description="tables [[points]]: reflectors read by a tracker, in columns measured_X_mm, "
        "measured_Y_mm, measured_Z_mm",
    )
    poses: list[TrackerPosesTable] = Field(
        default=[],
        description="tables [[poses]]: targets of six degrees, in the columns of points and measured_A_deg, "
        "measured_B_deg, measured_C_deg (Rz Ry Rx)",
    )
    ball: list[BallTable] = Field(
        default=[],
        description="tables [[ball]]: an R-test or a probe on balls, in columns dX_um, dY_um, dZ_um",
    )
    lengths: list[BarTable] = Field(
        default=[], description="tables [[lengths]]: distances of the tip from centres, in a column length_mm"
    )
    planes: list[ReadingTable] = Field(
        default=[], description="tables [[planes]]: axis values at which the tip touched planes"
    )
    postures: list[ReadingTable] = Field(
        default=[], description="tables [[postures]]: axis values at which the tip was brought to one point"
    )

    @rule("active_during_measurement")
    @staticmethod
    def _none_yet(value: list[str], _: Known) -> list[str]:
        return none_named(value)
