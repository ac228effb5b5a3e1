"""Values that describe one machine and one job on it. Lengths in mm, row order X, Y, Z everywhere.

A tool vector runs from the gauge point to the tip; a work offset is the axis position of the
program's origin, with no tool length active.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import field
from typing import Literal

from olp.core.errors import ConfigError
from olp.core.values import dataclass

Vector = tuple[float, float, float]
#: Positions of which some may not be known.
Place = tuple[float | None, float | None, float | None]
#: No tool, no offset: mm.
ZERO: Vector = (0.0, 0.0, 0.0)
#: No position is known.
UNKNOWN: Place = (None, None, None)

#: All 24 serial chains of three linear axes, workpiece to tool, with `F` the machine frame.
CHAINS = frozenset("".join(p) for p in itertools.permutations("FXYZ"))

#: ISO 230-1 names of the 18 component errors.
COMPONENTS = tuple(f"E{direction}{axis}" for axis in "XYZ" for direction in "XYZABC")
#: ISO 230-1 names of the 3 squareness errors.
SQUARENESS = ("C0Y", "B0Z", "A0Z")


@dataclass(frozen=True, slots=True)
class Axis:
    """Limits of one linear axis: travel (min, max) in mm; mm/s, mm/s2, mm/s3, None where they are not stated.

    `compliance_um_per_m_s2` is the displacement (X, Y, Z) of the tool relative to the workpiece, actual minus
    commanded, while the axis is accelerated by 1 m/s2.
    """

    travel_mm: tuple[float, float]
    least_increment_mm: float
    velocity_mm_s: float | None = None
    acceleration_mm_s2: float | None = None
    jerk_mm_s3: float | None = None
    compliance_um_per_m_s2: Vector = ZERO


@dataclass(frozen=True, slots=True)
class WorkOffset:
    """A work offset such as G54.

    `set_by` is "touch" (touched off on the uncompensated machine, so the touched point keeps its position)
    or "true" (located by other means). `touched_at_mm` is the axis position at the touch. An axis that is
    None there takes its default, the offset plus the length of `touch_tool`. `touched_payload_kg` None means
    the job's payload.
    """

    name: str
    offset_mm: Vector = ZERO
    rotation_deg: Vector = ZERO
    set_by: Literal["touch", "true"] = "touch"
    touched_at_mm: Place = UNKNOWN
    touch_tool: int | None = None
    touched_payload_kg: float | None = None


@dataclass(frozen=True, slots=True)
class HolderPart:
    """A part of a tool holder, round about the tool's axis: `radius_mm` at its lower end, `top_radius_mm`
    at its upper one."""

    length_mm: float
    radius_mm: float
    top_radius_mm: float


@dataclass(frozen=True, slots=True)
class Sanity:
    """Limits of plausible inputs: the largest correction (None: from the travel), how far a tool may differ
    from those measured with and temperatures from that of the calibration. Also the age of a calibration that
    states no end of its validity, and the clearance of tool and holder."""

    largest_correction_mm: float | None = None
    tool_within_mm: float = 100.0
    temperature_within_K: float = 5.0
    calibration_days: int = 365
    clearance_mm: float = 1.0


@dataclass(frozen=True, slots=True)
class Tool:
    """A row of the control's tool table, and the tool vector on which angular errors act.

    The control offsets contours by `radius_mm`, None where it is not known, and `wear_mm`.

    `length_mm` enters axis positions where the program activates it. `gauge_to_tip_mm` defaults to minus the
    length; a negative Z length is a touch-off value and gives no tool vector. `name` is that of programs
    which call tools by name. `set_by` "touch" means that the
    length was set on the uncompensated machine at axis position `touched_at_mm`. Lengths of one `setter` are
    too long by one constant, `constant_mm` where it is known. `gauge_to_tip_deg` are A, B, C by which the
    frame of the tip is turned against the flange of an arm (Rz Ry Rx), None where this is not stated.
    `cutting_length_mm` counts from the tip up,
    None: all that the holder leaves free. `holder` is stacked upwards and ends at the gauge
    point.
    """

    number: int
    length_mm: Vector = ZERO
    radius_mm: float | None = None
    wear_mm: float = 0.0
    gauge_to_tip_mm: Vector | None = None
    set_by: Literal["touch", "true"] = "true"
    touched_at_mm: Vector | None = None
    setter: str | None = None
    constant_mm: float | None = None
    cutting_length_mm: float | None = None
    holder: tuple[HolderPart, ...] = ()
    name: str = ""
    gauge_to_tip_deg: Vector | None = None

    @property
    def tool_vector_mm(self) -> Vector | None:
        """Gauge point to tip; None where only a touch-off value is known."""
        if self.gauge_to_tip_mm is not None:
            return self.gauge_to_tip_mm
        x, y, z = self.length_mm
        if z < 0:
            return None
        return (0.0 - x, 0.0 - y, 0.0 - z)


@dataclass(frozen=True, slots=True)
class ControlTimes:
    """Seconds that the control takes beside motion, None where they are not stated. A tool change counts with
    its moves. A change of the spindle's speed or direction counts as a start. M codes are by number."""

    tool_change_s: float | None = None
    spindle_start_s: float | None = None
    m_codes_s: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine file: chain, limits, offsets, tools and what its control already corrects.

    `decimal_point` says what a length without a decimal point means to a control that makes a difference
    (Fanuc, Haas): so many least increments, or whole units as on a pocket calculator. None is not stated, and
    read as increments.
    `arc_centres` says what I, J and K are at the start, and `cycle_return` where canned cycles return, to a
    control that has a setting for it. `scaling_axes` are those that CYCL DEF 11 of a Heidenhain control
    scales. `lengths_along_z`: on a Sinumerik, lengths of tools count along Z in every plane.
    `default_motion` is the motion code in force at the start of a program, where its control does not fix it.
    `still_macros` are the macros of a printer that move no axis and change no mode. `bracket_comments`:
    to its firmware (a) is a comment.
    `still_m_codes` are M codes of the machine's builder that move no axis, `still_g_codes` such G codes that
    its dialect does not know, ten times their numbers.
    `real_time` is the beginning of the hash of the calibration that the control itself corrects by in every
    servo cycle, None where it does not.
    `styli` are end of the ram to centre of the tip of sensors by label.
    `path_mode` is the mode at the start of a program, `blend_mm` the tolerance where the program names none
    (None: not stated). `times` is what the control takes beside motion. `tool_change_moves` are the axes that
    M6 may move. `home_mm`, `second_home_mm` and `tool_change_mm` are the axis positions where G28, G30 and M6
    leave the axes that they move, None where it is not known. `scaling_unit` is what 1 of a factor of G51 is,
    None where it is not stated. `located` says whether positions in machine coordinates are known; where they
    are not, only distances are. `assumed`: nothing names the controller. `arm`: it is an arm, whose programs
    may state its joints. `track` is the way in mm by which one unit of the first external axis carries it,
    None where it stands still; with `track_errors` it is a joint with errors of its own. `external` are
    other external axes by their numbers, with the value at which one stays, None where it moves neither arm
    nor workpiece. `third_level` is whether programs count the third joint from the horizontal, None where
    that is not stated. `file` is the machine file, None where there is none.
    """

    name: str
    chain: str
    controller: str
    axes: Mapping[str, Axis]
    calibration: str | None = None
    compensated_by_controller: frozenset[str] = frozenset()
    real_time: str | None = None
    work_offsets: Mapping[str, WorkOffset] = field(default_factory=dict)
    tools: Mapping[int, Tool] = field(default_factory=dict)
    styli: Mapping[str, Vector] = field(default_factory=dict)
    default_tool: int | None = None
    default_work_offset: str = "G54"
    length_active: bool = False
    default_motion: Literal["G0", "G1"] | None = None
    decimal_point: Literal["increment", "calculator"] | None = None
    arc_centres: Literal["incremental", "absolute"] | None = None
    cycle_return: Literal["initial", "r"] | None = None
    scaling_axes: Literal["plane", "all"] | None = None
    lengths_along_z: bool = False
    still_macros: frozenset[str] = frozenset()
    bracket_comments: bool = False
    still_m_codes: frozenset[int] = frozenset()
    still_g_codes: frozenset[int] = frozenset()
    path_mode: Literal["blend", "exact-stop"] = "blend"
    blend_mm: float | None = None
    tool_change_moves: frozenset[str] = frozenset("XYZ")
    home_mm: Place = UNKNOWN
    second_home_mm: Place = UNKNOWN
    tool_change_mm: Place = UNKNOWN
    scaling_unit: float | None = None
    times: ControlTimes = field(default_factory=ControlTimes)
    sanity: Sanity = Sanity()
    located: bool = True
    assumed: bool = False
    arm: bool = False
    third_level: bool | None = None
    track: Vector | None = None
    track_errors: bool = False
    external: Mapping[int, float | None] = field(default_factory=dict)
    pulses_per_deg: tuple[float, ...] | None = None
    file: str | None = None

    @property
    def least_increment_mm(self) -> Vector:
        x, y, z = (self.axes[a].least_increment_mm for a in "XYZ")
        return (x, y, z)

    @property
    def missing_limits(self) -> tuple[str, ...]:
        """The keys of the limits of motion that the machine file leaves out, such as "axes.X.jerk_mm_s3"."""
        keys = ("velocity_mm_s", "acceleration_mm_s2", "jerk_mm_s3")
        return tuple(f"axes.{a}.{k}" for a in "XYZ" for k in keys if getattr(self.axes[a], k) is None)

    def motion_limits(self) -> dict[str, Vector]:
        """Velocity, acceleration and jerk of each axis: mm/s, mm/s2, mm/s3. Raises ConfigError that names the
        keys which the machine file leaves out."""
        limits = {}
        for name, axis in self.axes.items():
            v, a, j = axis.velocity_mm_s, axis.acceleration_mm_s2, axis.jerk_mm_s3
            if v is not None and a is not None and j is not None:
                limits[name] = (v, a, j)
        missing = self.missing_limits
        if missing:
            raise ConfigError(
                f"machine {self.name!r} does not state {', '.join(missing)}, which a motion in time needs; "
                "give these keys in the machine file"
            )
        return limits


@dataclass(frozen=True, slots=True)
class Mesh:
    """A mesh that a review shows: a file, what it stands for, the work offset that places it or "machine",
    and the length of its unit."""

    file: str
    role: Literal["workpiece", "fixture", "machine"]
    frame: str = "machine"
    unit_mm: float = 1.0


@dataclass(frozen=True, slots=True)
class Job:
    """What changes per job. `part_tolerance_um` holds where a call gives none. `work_offsets` and `tools`
    override the machine's, one by one. `start_deg` are positions of rotary axes, of machines that have any.
    `joint_targets` are axis values (6,) in degrees of positions that the control of an arm knows by a name.
    `payload_centre_mm` counts from the gauge point. `payloads` leads from
    a line of the program, counted from 1, to the payload from there on. `parameters` are values of parameters
    of the program, by names such as "#100". `block_delete` is the position of that switch for programs that
    are unrolled, None where both have to be right. Temperatures of the structure's sensors come from
    `sensors_degC`, settled, or from `sensor_log` at a time in it. `dialect` is that of the program; None: it
    is detected from the text and the ending of the file. `described` is a dialect that a file describes
    (`olp.program.dialect.Dialect`)."""

    program: str | None = None
    machine: str | None = None
    part_tolerance_um: float | None = None
    start_mm: Place = UNKNOWN
    start_deg: Mapping[str, float] = field(default_factory=dict)
    joint_targets: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    payload_kg: float = 0.0
    payload_centre_mm: Vector = ZERO
    payloads: Mapping[int, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    block_delete: Literal["on", "off"] | None = None
    temperatures_degC: Mapping[str, float] = field(default_factory=dict)
    sensors_degC: Mapping[str, float] | None = None
    sensor_log: str | None = None
    sensor_log_at_s: float | None = None
    work_offsets: Mapping[str, WorkOffset] = field(default_factory=dict)
    tools: Mapping[int, Tool] = field(default_factory=dict)
    styli: Mapping[str, Vector] = field(default_factory=dict)
    dialect: str | None = None
    described: object | None = None
    meshes: tuple[Mesh, ...] = ()


@dataclass(frozen=True, slots=True)
class Setup:
    """Machine and job together: all that an interpreter of programs needs to know."""

    machine: Machine
    job: Job = field(default_factory=Job)

    def work_offset(self, name: str) -> WorkOffset | None:
        return self.job.work_offsets.get(name) or self.machine.work_offsets.get(name)

    def stylus(self, name: str) -> Vector | None:
        """End of the ram to centre of the tip, for the label of a sensor in any case of letters."""
        styli = {key.upper(): offset for key, offset in {**self.machine.styli, **self.job.styli}.items()}
        return styli.get(name.upper())

    def tool(self, number: int) -> Tool | None:
        return self.job.tools.get(number) or self.machine.tools.get(number)

    def tool_named(self, name: str) -> int | None:
        """The number of the tool of this name, in any case of letters; None where there is none."""
        tools = {**self.machine.tools, **self.job.tools}.values()
        wanted = name.casefold()
        return next((t.number for t in tools if t.name and t.name.casefold() == wanted), None)
