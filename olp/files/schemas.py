"""The keys of machine, calibration and job files, as tables.

One class per TOML table. A key that no class names is refused. Every description completes the sentence
"expected ...", states the unit, and is part of the exported JSON Schema.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from olp.core.patterns import PARAMETER_NAMES, pattern
from olp.core.schema import Interval, NotNegative, Position, Positive, Six, Table, Text, Triple
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.files.calibration.schema import CalibrationFile
from olp.files.fields import (
    CONTROLLERS,
    Chain,
    Compliance,
    Controller,
    IsoNames,
    OffsetName,
    ProgramDialect,
    StillG,
    StillM,
    ToolNumber,
)


class AxisTable(Table):
    travel_mm: Interval = Field(description="the lowest and highest axis position, [min, max] in mm")
    least_increment_mm: Positive = Field(description="the smallest step that the control takes, in mm")
    velocity_mm_s: Positive | None = Field(
        default=None, description="the largest velocity of the axis, in mm/s; only a motion in time needs it"
    )
    acceleration_mm_s2: Positive | None = Field(
        default=None,
        description="the largest acceleration of the axis, in mm/s2; only a motion in time needs it",
    )
    jerk_mm_s3: Positive | None = Field(
        default=None, description="the largest jerk of the axis, in mm/s3; only a motion in time needs it"
    )
    compliance_um_per_m_s2: Compliance = Field(
        default=0.0,
        description="the lag of the tool while the axis is accelerated, in um per m/s2; or [X, Y, Z], actual "
        "minus commanded, where it gives way in other directions too",
    )


class AxesTable(Table):
    X: AxisTable = Field(description="the limits of axis X, a table [axes.X]")
    Y: AxisTable = Field(description="the limits of axis Y, a table [axes.Y]")
    Z: AxisTable = Field(description="the limits of axis Z, a table [axes.Z]")


class WorkOffsetTable(Table):
    X_mm: float = Field(
        default=0.0, description="the axis position X of the program's origin, in mm; 0 if left out"
    )
    Y_mm: float = Field(
        default=0.0, description="the axis position Y of the program's origin, in mm; 0 if left out"
    )
    Z_mm: float = Field(
        default=0.0, description="the axis position Z of the program's origin, in mm; 0 if left out"
    )
    A_deg: float = Field(
        default=0.0, description="the rotation of the frame about X, in degrees; 0 if left out"
    )
    B_deg: float = Field(
        default=0.0, description="the rotation of the frame about Y, in degrees; 0 if left out"
    )
    C_deg: float = Field(
        default=0.0, description="the rotation of the frame about Z, in degrees; 0 if left out"
    )
    set_by: Literal["touch", "true"] = Field(
        default="touch",
        description='"touch" (touched off on the uncompensated machine) or "true" (located by other means)',
    )
    touched_at_mm: Position = Field(
        default_factory=Position,
        description="the axis positions in mm at the touch, { X = .., Y = .., Z = .. }; the default of each "
        "is the offset plus the length of touch_tool",
    )
    touch_tool: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="the number of the tool that touched, one of [tools]"
    )

    touched_payload_kg: NotNegative | None = Field(
        default=None, description="the payload at the touch, in kg; payload_kg of the job if left out"
    )

    @rule("touched_at_mm", "touch_tool", "touched_payload_kg")
    @staticmethod
    def _only_if_touched(value: object, known: Known) -> object:
        if known.get("set_by") == "true" and value is not None:
            raise refusal('contradicts set_by = "true"; expected set_by = "touch", or this key left out')
        return value


class HolderTable(Table):
    length_mm: Positive = Field(description="the length of this part along the tool's axis, in mm")
    radius_mm: Positive = Field(description="the radius of this part at its lower end, in mm")
    top_radius_mm: Positive | None = Field(
        default=None, description="the radius at its upper end, in mm; radius_mm if left out"
    )


class ToolTable(Table):
    name: Text | None = Field(
        default=None, description='the name by which programs call the tool, as in T="MILL 10", where they do'
    )
    X_mm: float = Field(default=0.0, description="the tool offset in X as in the control's tool table, in mm")
    Y_mm: float = Field(default=0.0, description="the tool offset in Y as in the control's tool table, in mm")
    Z_mm: float = Field(default=0.0, description="the tool length as in the control's tool table, in mm")
    radius_mm: NotNegative | None = Field(
        default=None, description="the tool radius, in mm; cutter compensation (G41, G42) needs it"
    )
    wear_mm: float = Field(
        default=0.0,
        description="what the control adds to radius_mm in cutter compensation, in mm; below 0 for wear",
    )
    gauge_to_tip_mm: Triple | None = Field(
        default=None,
        description="the vector from gauge point to tip, [X, Y, Z] in mm; [-X, -Y, -Z] if left out",
    )
    gauge_to_tip_deg: Triple | None = Field(
        default=None,
        description="on an arm how the frame of the tip is turned against the flange, [A, B, C] in degrees. "
        "It turns about Z by C, then about the new Y by B, then about the new X by A",
    )
    set_by: Literal["touch", "true"] = Field(
        default="true",
        description='"touch" (length set on the uncompensated machine) or "true" (measured by other means)',
    )
    touched_at_mm: Position | None = Field(
        default=None,
        check_default=True,
        description="the axis positions in mm where the length was set, { X = .., Y = .., Z = .. }",
    )
    setter: Text | None = Field(
        default=None,
        description="the name of the device on which the length was set; all lengths of one setter are too "
        'long by one constant. With set_by = "touch" all tools that name none have one setter',
    )
    k_um: float | None = Field(
        default=None,
        description="how much too long the lengths of this setter are, in um, from a master of known length",
    )

    cutting_length_mm: Positive | None = Field(
        default=None,
        description="the length of the cutting part from the tip up, in mm; up to the holder if left out",
    )
    holder: list[HolderTable] = Field(
        default=[],
        description="tables [[tools.NUMBER.holder]], the parts of the holder from its lower "
        "end up to the gauge point",
    )

    @rule("holder")
    @staticmethod
    def _shorter_than_tool(value: list[HolderTable], known: Known) -> list[HolderTable]:
        tool_vector = known.get("gauge_to_tip_mm")
        reach = abs(tool_vector[2]) if tool_vector is not None else abs(known.get("Z_mm", 0.0))
        total = sum(part.length_mm for part in value)
        if value and total >= reach:
            raise refusal(
                f"is {total:g} mm long, and the tip is {reach:g} mm below the gauge point; expected a holder "
                "that ends above the tip"
            )
        return value

    @rule("k_um")
    @staticmethod
    def _of_a_setter(value: float | None, known: Known) -> float | None:
        if value is not None and known.get("set_by") == "true" and known.get("setter") is None:
            raise refusal(
                'is that of a setter; expected setter = "..", set_by = "touch", or this key left out'
            )
        return value

    @rule("touched_at_mm")
    @staticmethod
    def _with_touch(value: Position | None, known: Known) -> Position | None:
        set_by = known.get("set_by")
        if set_by == "true" and value is not None:
            raise refusal('is given, but set_by is "true"; expected set_by = "touch", or this key left out')
        if set_by == "touch" and (value is None or value.complete is None):
            raise refusal(
                'is incomplete; expected { X = .., Y = .., Z = .. } in mm, because set_by = "touch"'
            )
        return value


#: The name of an M code.
_M_CODE = pattern(r"M\d{1,4}")
#: Spindle starts and tool changes.
_NOT_M_CODES = (3, 4, 6)


class PathTable(Table):
    mode: Literal["blend", "exact-stop"] = Field(
        default="blend",
        description='"blend" (rounds corners within blend_mm) or "exact-stop" (rests at the end of each '
        "block), until the program says otherwise",
    )
    blend_mm: Positive | None = Field(
        default=None,
        description="the path tolerance at corners where the program states none, in mm; 0.01 if left out",
    )


class TimesTable(Table):
    tool_change_s: NotNegative | None = Field(
        default=None, description="the time of a tool change with its moves, in s; not counted if left out"
    )
    spindle_start_s: NotNegative | None = Field(
        default=None,
        description="the time in which the spindle starts, or changes its speed or direction, in s; not "
        "counted if left out",
    )
    m_codes_s: dict[Text, NotNegative] = Field(
        default={}, description="the times of other M codes, in s, by their names, such as { M8 = 0.5 }"
    )

    @rule("m_codes_s")
    @staticmethod
    def _codes(value: dict[str, float], _: Known) -> dict[str, float]:
        for name in value:
            if not _M_CODE.fullmatch(name):
                raise refusal(f'names "{name}"; expected names of M codes, such as M8')
            if int(name[1:]) in _NOT_M_CODES:
                raise refusal(
                    f"names {name}; expected tool_change_s for M6 and spindle_start_s for M3 and M4, keys of "
                    "their own"
                )
        return value


class CheckTable(Table):
    largest_correction_um: Positive | None = Field(
        default=None,
        description="the largest plausible error of this machine, in um; 1000 per metre of the diagonal of "
        "its travel, and at least 500, if left out",
    )
    tool_within_mm: Positive = Field(
        default=100.0,
        description="the largest difference, along any axis, between the tool vector and those of the "
        "measurement, in mm; 100 if left out",
    )
    temperature_within_K: Positive = Field(
        default=5.0,
        description="the largest difference between a temperature and the calibration's, in K; 5 if left out",
    )
    calibration_days: Annotated[int, Field(ge=1)] = Field(
        default=365,
        description="the largest age of a calibration without valid_until, in days; 365 if left out",
    )
    clearance_mm: NotNegative = Field(
        default=1.0, description="the least clearance of tool and holder to meshes, in mm; 1 if left out"
    )


class JobDefaultsTable(Table):
    tool: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="the number of the tool in the spindle at the start, one of [tools]"
    )
    work_offset: Text = Field(
        default="G54", description='the work offset that is active at the start, such as "G54"'
    )
    length_active: bool = Field(default=False, description="whether the tool length is active at the start")
    motion: Literal["G0", "G1"] | None = Field(
        default=None,
        description="the motion code in force at the start, G0 or G1, where a setting of the control or the "
        "program before decides",
    )


class StylusTable(Table):
    offset_mm: Triple = Field(
        description="from the end of the ram to the centre of the tip, in mm; the lever arm of angular errors"
    )


Styli = dict[Text, StylusTable]
WorkOffsets = dict[OffsetName, WorkOffsetTable]
Tools = dict[ToolNumber, ToolTable]


class MachineFile(Table):
    """olp-machine-1: one machine, its limits, work offsets and tools."""

    schema_: Literal["olp-machine-1"] = Field(alias="schema", description='the format, "olp-machine-1"')
    name: Text = Field(description="the name of the machine, which its calibration repeats")
    chain: Chain = Field(
        description='the order of axes from workpiece to tool with F for the frame, such as "FXYZ"'
    )
    decimal_point: Literal["increment", "calculator"] | None = Field(
        default=None,
        description="what a length without a decimal point means to a Fanuc or Haas control: X100 is 100 "
        "least increments, or 100 units as on a pocket calculator; increments, with a doubt, if left out",
    )
    tool_change_moves: bool | list[Literal["X", "Y", "Z"]] = Field(
        default=True,
        description="whether M6 may move the axes, or a list of those that it may move; the positions of "
        "others are known after it",
    )
    home_mm: Position = Field(
        default_factory=Position,
        description="the axis positions in mm where G28 leaves the axes that it moves, { X = .., Y = .., "
        "Z = .. }; not known if left out",
    )
    second_home_mm: Position = Field(
        default_factory=Position,
        description="the same in mm for G30 and G30 P2",
    )
    tool_change_mm: Position = Field(
        default_factory=Position,
        description="the same in mm for M6",
    )
    scaling_unit: Positive | None = Field(
        default=None,
        description="what 1 of a factor of G51 is to a Fanuc control, whose parameter "
        "sets it: 0.001 or 0.00001",
    )
    arc_centres: Literal["incremental", "absolute"] | None = Field(
        default=None,
        description="what I, J and K of arcs are before any G90.1 or G91.1, by a setting of Mach3 and Mach4: "
        "distances from the start of the arc, or positions",
    )
    cycle_return: Literal["initial", "r"] | None = Field(
        default=None,
        description="where canned cycles return before any G98 or G99, by a setting of Mach3 and Mach4: to "
        "the level before them, or to R",
    )
    scaling_axes: Literal["plane", "all"] | None = Field(
        default=None,
        description="which axes CYCL DEF 11 of Heidenhain programs scales, by a machine parameter: X and Y, "
        "or Z too",
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
    bracket_comments: bool = Field(
        default=False,
        description="whether (text) is a comment to Marlin, by an option of its firmware (PAREN_COMMENTS)",
    )
    lengths_along_z: bool = Field(
        default=False,
        description="whether lengths of tools count along Z in G18 and G19 too, by a setting of Sinumerik "
        "controls (SD42940)",
    )
    still_macros: list[Text] = Field(
        default=[],
        description="the macros of a Klipper printer that move no axis and change no mode, by their names",
    )
    controller: Controller = Field(description="the dialect of the programs: " + ", ".join(CONTROLLERS))
    calibration: Text | None = Field(
        default=None, description="the path of the calibration file, relative to this file"
    )
    compensated_by_controller: IsoNames = Field(
        default=frozenset(),
        description="the errors that the control corrects now and did not correct while measuring: a list of "
        'ISO 230-1 names, or "all"',
    )
    real_time: Text | None = Field(
        default=None,
        description="the hash of the calibration that the control corrects by in real time, as "
        "`olp calibrate export` prints it for code; left out where the control does not",
    )
    axes: AxesTable = Field(description="the tables [axes.X], [axes.Y] and [axes.Z]")
    path: PathTable = Field(
        default_factory=PathTable, description="the table [path]: how the control moves from block to block"
    )
    times: TimesTable = Field(
        default_factory=TimesTable,
        description="the table [times]: what the control takes beside motion",
    )
    check: CheckTable = Field(
        default_factory=CheckTable, description="the table [check]: the limits of plausible inputs"
    )
    work_offsets: WorkOffsets = Field(default={}, description="tables [work_offsets.NAME]")
    tools: Tools = Field(default={}, description="tables [tools.NUMBER]")
    styli: Styli = Field(default={}, description="tables [styli.LABEL], for the sensors of DMIS programs")
    job_defaults: JobDefaultsTable = Field(
        default_factory=JobDefaultsTable, description="the state at the start of a program"
    )


class TemperaturesTable(Table):
    X_scale: float | None = Field(default=None, description="the temperature of the scale of X, in degC")
    Y_scale: float | None = Field(default=None, description="the temperature of the scale of Y, in degC")
    Z_scale: float | None = Field(default=None, description="the temperature of the scale of Z, in degC")
    workpiece: float | None = Field(default=None, description="the temperature of the workpiece, in degC")
    sensors: dict[str, float] | None = Field(
        default=None,
        description="the table [temperatures_degC.sensors]: the temperature of each sensor of the thermal "
        "structure, in degC, in steady state",
    )
    sensor_log: Text | None = Field(
        default=None,
        description="the path of a log of the sensors (t_s, NAME_degC ...), relative "
        "to this file; instead of sensors",
    )
    sensor_log_at_s: float | None = Field(
        default=None,
        check_default=True,
        description="the time in that log, in s; its last time if left out",
    )

    @rule("sensor_log_at_s")
    @staticmethod
    def _one_way(value: float | None, known: Known) -> float | None:
        if known.get("sensors") is not None and known.get("sensor_log") is not None:
            raise refusal("or sensors: both sensors and sensor_log are given; expected one of the two")
        if value is not None and known.get("sensor_log") is None:
            raise refusal("is given without sensor_log; expected the path of the log, or this key left out")
        return value


class MeshTable(Table):
    file: Text = Field(description="the path of a mesh such as an STL file, relative to this file")
    role: Literal["workpiece", "fixture", "machine"] = Field(
        description='"workpiece", "fixture" or "machine"'
    )
    frame: Text = Field(
        default="machine", description='the work offset that places the mesh, such as "G54", or "machine"'
    )
    unit_mm: Positive = Field(
        default=1.0,
        description="the length of the unit of the mesh, in mm: 25.4 for inches, 1000.0 for metres",
    )


class PayloadTable(Table):
    line: Annotated[int, Field(ge=1)] = Field(
        description="the first line of the program with this payload, counted from 1"
    )
    payload_kg: NotNegative = Field(description="the payload from that line on, in kg")


class JobFile(Table):
    """olp-job-1: what changes from job to job."""

    schema_: Literal["olp-job-1"] = Field(alias="schema", description='the format, "olp-job-1"')
    program: Text | None = Field(default=None, description="the path of the program, relative to this file")
    machine: Text | None = Field(
        default=None, description="the path of the machine file, relative to this file"
    )
    dialect: ProgramDialect | None = Field(
        default=None,
        description="the dialect of the program, where its text and its file ending do not show it. One of "
        + ", ".join(CONTROLLERS),
    )
    start_mm: Position = Field(
        default_factory=Position,
        description="the axis positions in mm at the start, { X = .., Y = .., Z = .. }",
    )
    start_deg: dict[Text, float] = Field(
        default={},
        description="the positions of rotary axes at the start, in degrees, such as { A "
        "= 0.0, C = 0.0 }; only "
        "for machines with rotary joints",
    )
    joint_targets: dict[Text, Six] = Field(
        default={},
        description="the table [joint_targets]: where an arm is at positions that its control knows by a "
        "name, such as XHOME = [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]; its axes in their order, in degrees",
    )
    part_tolerance_um: Positive | None = Field(
        default=None,
        description="the tolerance of the part, in um, where --part-tolerance-um is not given",
    )
    payload_kg: NotNegative = Field(
        default=0.0, description="the payload on the machine at the start of the program, in kg"
    )
    payload_centre_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the centre of the payload from the gauge point, in the gauge frame, [X, Y, Z] in mm; "
        "only for machines with rotary joints",
    )
    payloads: list[PayloadTable] = Field(
        default=[],
        description="tables [[payloads]], the payload from a line of the program on; or the program holds "
        "comments such as (OLP PAYLOAD 30 kg)",
    )
    parameters: dict[Text, float] = Field(
        default={},
        description="the table [parameters]: values that the program does not set, such as "
        '"#100" = 5.0, "#<depth>" = 2.5, Q13 = 1.0, R1 = 3.0, _DEPTH = 2.0 or VC1 = 4.0',
    )
    block_delete: Literal["on", "off"] | None = Field(
        default=None,
        description='the position of that switch for programs that are unrolled: "on" leaves `/` blocks out, '
        '"off" takes their `/` away. If left out, both positions have to give the same program',
    )
    temperatures_degC: TemperaturesTable = Field(
        default_factory=TemperaturesTable, description="the table [temperatures_degC], in degC"
    )
    work_offsets: WorkOffsets = Field(
        default={}, description="tables [work_offsets.NAME], which override the machine's"
    )
    tools: Tools = Field(default={}, description="tables [tools.NUMBER], which override the machine's")
    styli: Styli = Field(default={}, description="tables [styli.LABEL], which override the machine's")
    meshes: list[MeshTable] = Field(default=[], description="tables [[meshes]]")

    @rule("parameters")
    @staticmethod
    def _named(value: dict[str, float], _: Known) -> dict[str, float]:
        for name in value:
            if not PARAMETER_NAMES.fullmatch(name):
                raise refusal(f'has the key "{name}"; expected one such as "#100", "#<depth>" or "R1"')
        return value

    @rule("payloads")
    @staticmethod
    def _ascending_lines(value: list[PayloadTable], _: Known) -> list[PayloadTable]:
        for before, after in pairwise(value):
            if after.line <= before.line:
                raise refusal(
                    f"name line {after.line} after line {before.line}; expected ascending lines, each once"
                )
        return value


#: The model of each kind of file, in the order in which you write them.
FILES: dict[str, type[Table]] = {"machine": MachineFile, "calibration": CalibrationFile, "job": JobFile}
