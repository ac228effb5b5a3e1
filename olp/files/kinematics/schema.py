"""The keys of a machine file with joints other than three linear axes, as tables."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from olp.core.schema import Interval, Positive, Table, Text, Triple
from olp.core.schema_keys import After, Field, Known, refusal, rule
from olp.files.fields import CONTROLLERS, Controller, StillG, StillM
from olp.files.schemas import JobDefaultsTable, Tools, WorkOffsets

#: Axes that are linear where their table does not say.
LINEAR_NAMES = "XYZUVW"
#: Rotary axes that programs of words have letters for.
ROTARY_NAMES = "ABC"
#: Keys whose unit is not that of the axis.
_OF_ANY_UNIT = ("point_mm", "pulses_per_deg")
#: External axes of robot programs, and the one that a track is.
EXTERNAL_NUMBERS = "123456"
TRACK_NUMBER = "1"
#: Axes whose directions are known by name.
OWN_DIRECTIONS = "XYZ"


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    size = math.hypot(*value)
    if not size > 0.0:
        raise refusal("= [0, 0, 0] has no direction; expected the direction of the tool, [X, Y, Z]")
    x, y, z = (part / size if abs(size - 1.0) > 1e-15 else part for part in value)
    return (x, y, z)


Direction = Annotated[Triple, After(_direction)]


class JointTable(Table):
    not_built: ClassVar[dict[str, str]] = {"coupled": "joints that the control's numbers couple"}

    kind: Literal["linear", "rotary", "length"] | None = Field(
        default=None,
        description='"linear", "rotary", or "length" (of a leg of a platform); "linear" for X Y Z '
        "U V W if left out",
    )
    direction: Direction | None = Field(
        default=None,
        description="the direction in which the tool moves, or about which it turns by the right-hand rule, "
        "relative to the workpiece, while the axis value grows: [X, Y, Z] in machine coordinates. X, Y and Z "
        "have their own",
    )
    point_mm: Triple | None = Field(
        default=None,
        description="a point on the line of the axis, with all axes at zero, [X, Y, Z] in mm; its errors "
        "count there; required of rotary axes",
    )
    travel_mm: Interval | None = Field(
        default=None, description="the lowest and highest position of a linear axis, [min, max] in mm"
    )
    travel_deg: Interval | None = Field(
        default=None, description="the lowest and highest position of a rotary axis, [min, max] in degrees"
    )
    least_increment_mm: Positive | None = Field(
        default=None, description="the smallest step that the control takes with a linear axis, in mm"
    )
    least_increment_deg: Positive | None = Field(
        default=None, description="the smallest step that the control takes with a rotary axis, in degrees"
    )
    velocity_mm_s: Positive | None = Field(default=None, description="the largest velocity, in mm/s")
    velocity_deg_s: Positive | None = Field(default=None, description="the largest velocity, in deg/s")
    acceleration_mm_s2: Positive | None = Field(
        default=None, description="the largest acceleration, in mm/s2"
    )
    acceleration_deg_s2: Positive | None = Field(
        default=None, description="the largest acceleration, in deg/s2"
    )
    jerk_mm_s3: Positive | None = Field(default=None, description="the largest jerk, in mm/s3")
    jerk_deg_s3: Positive | None = Field(default=None, description="the largest jerk, in deg/s3")
    pulses_per_deg: Positive | None = Field(
        default=None,
        description="the pulses by which INFORM programs of Yaskawa robots count the axis, in one degree; "
        "all six axes of an arm state it, or none",
    )
    correct: bool = Field(
        default=True, description="whether a correction may change the axis, false for a clamped one"
    )


class LegTable(Table):
    base_mm: Triple = Field(
        description="the joint at the base, [X, Y, Z] in mm; with a carriage, where it is at zero of it"
    )
    platform_mm: Triple = Field(
        description="the joint at the platform, [X, Y, Z] in mm, while the platform is not shifted nor turned"
    )
    length_mm: float = Field(
        default=0.0, description="the length of the rod, in mm; the value of its axis is added to it"
    )
    axis: Text | None = Field(default=None, description='the axis of kind "length" that drives the leg')
    carriage: Text | None = Field(default=None, description="the axis on which the base rides")


class PlatformTable(Table):
    start_mm: Triple = Field(
        description="a shift of the platform [X, Y, Z] in mm near which it works: of the poses that fit the "
        "legs the one on its branch is taken"
    )
    orientation: Literal["solved", "fixed"] = Field(
        default="solved",
        description='"solved" (six legs hold position and orientation) or "fixed" (three '
        "legs, and it does not turn)",
    )
    legs: list[LegTable] = Field(description="tables [[platforms.NAME.legs]], six or three")


class GaugeTable(Table):
    point_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the gauge point with all axes at zero, [X, Y, Z] in mm"
    )
    A_deg: float = Field(default=0.0, description="the rotation of the gauge frame about X, in degrees")
    B_deg: float = Field(default=0.0, description="the rotation of the gauge frame about Y, in degrees")
    C_deg: float = Field(default=0.0, description="the rotation of the gauge frame about Z, in degrees")


class KinematicsTable(Table):
    gravity: Direction = Field(
        default=(0.0, 0.0, -1.0), description="the direction of gravity, [X, Y, Z] in machine coordinates"
    )
    track: Direction | None = Field(
        default=None,
        description="the direction in which the first external axis of robot programs (E1, eax_a) carries "
        "the arm, in mm, [X, Y, Z] in machine coordinates; the errors are those of the arm on its carriage. "
        "A track with errors of its own is a linear axis of the chain instead, before the six of the arm",
    )
    external: dict[Text, float | Literal["apart"]] = Field(
        default={},
        description="the other external axes of robot programs by their numbers, 1 (E1, eax_a) to 6. "
        '"apart" moves neither the arm nor the workpiece, such as the servo of a gripper. A number is the '
        "value, in the unit of the program, at which the axis stays and the work frames hold, such as that "
        "of a positioner. An axis that is not named has to be at zero",
    )
    third_joint_level: bool | None = Field(
        default=None,
        description="whether robot programs count the third joint from the horizontal, as FANUC controls do, "
        "and not from the second link as the values of this file; travel is that of this file",
    )
    tool_symmetry: Literal["axis", "none"] | None = Field(
        default=None,
        description='"axis" (the turn about the tool\'s Z is free) or "none"; if left out, "axis" with '
        "three or more linear axes in the chain, as machine tools have",
    )
    tcp_frame_zero: Literal["axis-zero", "activation"] | None = Field(
        default=None,
        description="where the frame of tool centre point control equals the work offset: with all "
        'rotary axes at zero ("axis-zero"), or where they are when it is switched on ("activation"). If left '
        "out, it is axis-zero for Sinumerik and Heidenhain controls, and not known for others",
    )
    orientation_interpolation: Literal["axes", "vector"] | None = Field(
        default=None,
        description="what tool centre point control leads evenly along a move where the program does not say "
        'it: each rotary axis ("axes"), or the direction of the tool, along a great circle ("vector"). If '
        'left out, it is "vector" for Sinumerik controls (ORIWKS), "axes" for others',
    )
    program_words: Literal["pose"] | None = Field(
        default=None,
        description='"pose" where the control computes the axes of a platform on legs, or of a SCARA, polar '
        "or six-axis arm: X, Y and Z of programs are the tip in machine coordinates. A, B and C are Rz Ry Rx "
        "of fixed axes: on a platform that turns from the gauge as it is stated, on an arm of the frame of "
        "the gauge. A SCARA has one of them, from all axes at zero. If left out, axis values are read alone",
    )
    posture: dict[Text, float] | None = Field(
        default=None,
        description='with program_words = "pose" on serial axes: the values of all axes, in mm and deg, in '
        "one posture of the branch that the control takes. Such as { J1 = 0.0, J2 = 90.0, J3 = 0.0 }; rotary "
        "axes stay within half a turn of it",
    )
    endless: list[Text] = Field(
        default=[],
        description="rotary axes of posture that the control leads on over whole turns, as `rosekins` of "
        "LinuxCNC does: their values count within half a turn of posture. Their errors have to repeat with "
        "every turn, without backlash",
    )
    swivel_axis: Text | None = Field(
        default=None,
        description="the rotary axis that the swivel data of a Sinumerik control have as reference of the "
        "direction. Of two positions for CYCLE800, _DIR 1 takes the one with the larger value of this axis, "
        "-1 the smaller. If left out, a plane with two positions is refused",
    )

    @rule("external")
    @staticmethod
    def _numbered(value: dict[str, float | str], known: Known) -> dict[str, float | str]:
        for number in value:
            if number not in tuple(EXTERNAL_NUMBERS):
                raise refusal(f"names an axis {number!r}; expected 1 to 6, such as {{ 2 = 90.0 }}")
            if number == TRACK_NUMBER and known.get("track") is not None:
                raise refusal("names axis 1, which carries the arm by track; expected one of both")
        return value


def none_named(value: list[str]) -> list[str]:
    """Errors that the control corrects: none. Raises where some are named."""
    if value:
        raise refusal(
            "names errors that the control corrects, which is not built for such a machine; expected []"
        )
    return value


class JointCheckTable(Table):
    largest_correction_um: Positive | None = Field(
        default=None,
        description="the largest plausible error of the tip, in um; per metre of the diagonal of its space "
        "1000 with three linear axes in the chain, else 10,000, and at least 500, if left out",
    )


class JointMachineFile(Table):
    """olp-machine-1 of any joints: its chain, its axes, platforms and tools."""

    schema_: Literal["olp-machine-1"] = Field(alias="schema", description='the format, "olp-machine-1"')
    name: Text = Field(description="the name of the machine, which its calibration repeats")
    chain: Text = Field(
        description="the axes and platforms from workpiece to tool with F for the frame, parted by blanks, "
        'such as "C A Y F X Z"; blanks may be left out between single letters'
    )
    controller: Controller = Field(description="the dialect of the programs: " + ", ".join(CONTROLLERS))
    decimal_point: Literal["increment", "calculator"] | None = Field(
        default=None,
        description="what a number without a decimal point means to a Fanuc or Haas control: X100 is 100 "
        "least increments, or 100 units as on a pocket calculator",
    )
    tool_change_moves: bool = Field(
        default=True,
        description="whether M6 may move the axes; if not, their positions are known after it",
    )
    still_m_codes: list[StillM] = Field(
        default=[],
        description="the M codes of the machine's builder that move no axis, by their numbers, such as "
        "[65, 81]; behind other codes that are not known no position is known",
    )
    still_g_codes: list[StillG] = Field(
        default=[],
        description="the G codes that the dialect does not know, and that move no axis and change no mode, "
        "by their numbers, such as [187, 64.1]",
    )
    calibration: Text | None = Field(
        default=None, description="the path of the calibration file, relative to this file"
    )
    compensated_by_controller: list[Text] = Field(
        default=[], description="the errors that the control corrects now; none can be named here yet"
    )
    real_time: Text | None = Field(
        default=None,
        description="the hash of the calibration that the control corrects by in real time, as "
        "`olp calibrate export` prints it for code; left out where the control does not",
    )
    kinematics: KinematicsTable = Field(default_factory=KinematicsTable, description="the table [kinematics]")
    axes: dict[Text, JointTable] = Field(description="tables [axes.NAME], one for each axis")
    platforms: dict[Text, PlatformTable] = Field(default={}, description="tables [platforms.NAME]")
    gauge: GaugeTable = Field(
        default_factory=GaugeTable, description="the table [gauge]: the frame that holds the tool"
    )
    work_offsets: WorkOffsets = Field(default={}, description="tables [work_offsets.NAME]")
    tools: Tools = Field(default={}, description="tables [tools.NUMBER]")
    check: JointCheckTable = Field(
        default_factory=JointCheckTable, description="the table [check]: what is plausible on this machine"
    )
    job_defaults: JobDefaultsTable = Field(
        default_factory=JobDefaultsTable, description="the state at the start of a program"
    )

    @rule("compensated_by_controller")
    @staticmethod
    def _none_yet(value: list[str], _: Known) -> list[str]:
        return none_named(value)

    @rule("axes")
    @staticmethod
    def _whole(value: dict[str, JointTable], _: Known) -> dict[str, JointTable]:
        for name, joint in value.items():
            wrong = _joint_wrong(name, joint)
            if wrong:
                raise refusal(f"has a table {name} that {wrong}")
        return value


def kind_of(name: str, joint: JointTable) -> Literal["linear", "rotary", "length"] | None:
    """The kind of an axis, None where it is not known."""
    return joint.kind or ("linear" if name in tuple(LINEAR_NAMES) else None)


def _joint_wrong(name: str, joint: JointTable) -> str:
    """What is wrong with one axis table, empty where nothing is."""
    kind = kind_of(name, joint)
    if kind is None:
        return 'states no kind; expected kind = "linear", "rotary" or "length"'
    unit, other = ("deg", "mm") if kind == "rotary" else ("mm", "deg")
    values: dict[str, Any] = vars(joint)
    for key, value in values.items():
        stem = {"velocity": "_s", "acceleration": "_s2", "jerk": "_s3"}.get(key.split("_")[0], "")
        if value is not None and key == "pulses_per_deg" and kind != "rotary":
            return f"states {key}, but it is {kind}; expected it of rotary axes alone"
        if value is not None and key.endswith(f"_{other}{stem}") and key not in _OF_ANY_UNIT:
            return f"states {key}, but it is {kind}; expected {key.replace(f'_{other}', f'_{unit}')}"
    missing = [key for key in (f"travel_{unit}", f"least_increment_{unit}") if values[key] is None]
    if kind != "length" and joint.direction is None and name not in tuple(OWN_DIRECTIONS):
        missing.append("direction")
    if kind == "rotary" and joint.point_mm is None:
        missing.append("point_mm")
    return f"states no {', '.join(missing)}; expected these keys of a {kind} axis" if missing else ""
