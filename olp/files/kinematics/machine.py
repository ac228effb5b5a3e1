"""Reads the machine file of a machine of any joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.errors import ConfigError
from olp.core.machine import Axis, Machine
from olp.core.units import AXES, MM_PER_UM
from olp.files.config import beside, in_tenths, moved_by_change, tools_of, work_offsets_of
from olp.files.kinematics.schema import (
    OWN_DIRECTIONS,
    ROTARY_NAMES,
    TRACK_NUMBER,
    JointMachineFile,
    JointTable,
    kind_of,
)
from olp.files.problems import config_error, validate
from olp.files.toml_text import read_toml
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.carried import Carried, carried_arm
from olp.kinematics.coordinates import Coordinates
from olp.kinematics.machine import JointMachine
from olp.kinematics.pose_axes import posed
from olp.kinematics.structure import Gauge, Joint, Leg, Platform, Structure


def load_joint_machine(path: PathLike, read: Reader = read_bytes) -> JointMachine:
    """The machine of an olp-machine-1 file of any joints. Raises InputError where it cannot be read, and
    ConfigError with all that is wrong."""
    values, lines = read_toml(read(path), str(path))
    file = validate(JointMachineFile, values, lines, str(path))
    joints = {name: _joint(name, table) for name, table in file.axes.items()}
    platforms = {
        name: Platform(
            name,
            tuple(
                Leg(leg.base_mm, leg.platform_mm, leg.length_mm, leg.axis, leg.carriage) for leg in table.legs
            ),
            table.start_mm,
            table.orientation == "solved",
        )
        for name, table in file.platforms.items()
    }
    chain = tuple(file.chain.split()) if " " in file.chain.strip() else tuple(file.chain.strip())
    gauge = Gauge(file.gauge.point_mm, (file.gauge.A_deg, file.gauge.B_deg, file.gauge.C_deg))
    gravity, symmetry = file.kinematics.gravity, file.kinematics.tool_symmetry
    slides = [name for name in chain if name in joints and joints[name].kind == "linear"]
    symmetric = len(slides) >= len(OWN_DIRECTIONS) if symmetry is None else symmetry == "axis"
    try:
        structure = Structure(file.name, chain, joints, platforms, gauge, gravity, symmetric)
        words = file.kinematics
        structure = posed(structure, words.program_words == "pose", words.posture, words.endless)
    except ConfigError as error:
        raise config_error([(None, problem) for problem in error.problems], str(path)) from None
    default, largest_um = file.job_defaults.tool, file.check.largest_correction_um
    if default is not None and str(default) not in file.tools:
        raise config_error(
            [(None, f"job_defaults.tool = {default} is not defined; expected a table [tools.N]")], str(path)
        )
    return JointMachine(
        structure=structure,
        controller=file.controller,
        calibration=beside(path, file.calibration),
        tools=tools_of(file.tools),
        work_offsets=tuple(file.work_offsets),
        default_tool=default,
        control=_control(file, structure, path),
        arm=_arm(file, structure, path),
        tips_from_zero={"axis-zero": True, "activation": False, None: None}[file.kinematics.tcp_frame_zero],
        leads=file.kinematics.orientation_interpolation or "",
        swivel_axis=_swivel_axis(file.kinematics.swivel_axis, structure, path),
        real_time=file.real_time,
        largest_correction_mm=None if largest_um is None else largest_um * MM_PER_UM,
    )


def _swivel_axis(name: str | None, structure: Structure, path: PathLike) -> str:
    rotary = [axis for axis, joint in structure.joints.items() if joint.kind == "rotary"]
    if name is not None and name not in rotary:
        raise config_error(
            [(None, f"kinematics.swivel_axis = {name!r}; expected one of {', '.join(rotary)}")], str(path)
        )
    return name or ""


def _control(file: JointMachineFile, structure: Structure, path: PathLike) -> Machine | None:
    """What a reader of programs needs to know of a machine. None where its axes are no X, Y, Z with rotary
    axes named A, B or C, and words do not state poses, either."""
    kinds = {name: joint.kind for name, joint in structure.joints.items()}
    linear = {name for name, kind in kinds.items() if kind == "linear"}
    if file.kinematics.program_words == "pose":
        x, y, z = Coordinates.of_words(structure).steps[: len(AXES)]
        axes = {name: Axis((-np.inf, np.inf), step) for name, step in zip(AXES, (x, y, z), strict=True)}
    elif structure.platforms or linear != set(AXES) or not kinds.keys() - linear <= set(ROTARY_NAMES):
        return None
    else:
        axes = {
            name: Axis(structure.joints[name].travel, structure.joints[name].least_increment) for name in AXES
        }
    return Machine(
        name=file.name,
        file=str(path),
        chain=" ".join(structure.chain),
        controller=file.controller,
        axes=axes,
        calibration=beside(path, file.calibration),
        decimal_point=file.decimal_point,
        tool_change_moves=moved_by_change(file.tool_change_moves),
        still_m_codes=frozenset(file.still_m_codes),
        still_g_codes=in_tenths(file.still_g_codes),
        work_offsets=work_offsets_of(file.work_offsets),
        tools=tools_of(file.tools),
        default_tool=file.job_defaults.tool,
        default_work_offset=file.job_defaults.work_offset,
        length_active=file.job_defaults.length_active,
        default_motion=file.job_defaults.motion,
    )


def _arm(file: JointMachineFile, structure: Structure, path: PathLike) -> Machine | None:
    """What a reader of robot programs needs to know of an arm, None where the machine is none."""
    arm = carried_arm(structure)
    if arm is None:
        return None
    _refuse_two_tracks(file, arm, path)
    names = [name for name in structure.chain if structure.joints.get(name, arm.track) != arm.track]
    pulses = tuple(value for name in names if (value := file.axes[name].pulses_per_deg) is not None)
    if pulses and len(pulses) != len(names):
        lacking = ", ".join(name for name in names if file.axes[name].pulses_per_deg is None)
        raise config_error(
            [(None, f"the axes {lacking} state no pulses_per_deg, and others do; expected it of all six")],
            str(path),
        )
    return Machine(
        name=file.name,
        chain=" ".join(structure.chain),
        controller=file.controller,
        axes={name: Axis((-np.inf, np.inf), 0.0) for name in AXES},
        calibration=None,
        work_offsets=work_offsets_of(file.work_offsets),
        tools=tools_of(file.tools),
        default_tool=file.job_defaults.tool,
        default_work_offset=file.job_defaults.work_offset,
        arm=True,
        third_level=file.kinematics.third_joint_level,
        track=file.kinematics.track if arm.track is None else arm.track.direction,
        track_errors=arm.track is not None,
        external={
            int(number): None if isinstance(value, str) else value
            for number, value in file.kinematics.external.items()
        },
        pulses_per_deg=pulses or None,
    )


def _refuse_two_tracks(file: JointMachineFile, arm: Carried, path: PathLike) -> None:
    """Raise ConfigError where the chain has a track, and [kinematics] says something else of it."""
    stated = file.kinematics.track is not None, TRACK_NUMBER in file.kinematics.external
    if arm.track is not None and any(stated):
        key = "track" if stated[0] else f"external.{TRACK_NUMBER}"
        raise config_error(
            [(None, f"kinematics.{key} is stated, and {arm.track.name} of the chain is the first external "
                    "axis, which carries the arm; expected one of both")],
            str(path),
        )  # fmt: skip


def _joint(name: str, table: JointTable) -> Joint:
    kind = kind_of(name, table)
    assert kind is not None, "the schema refuses an axis without a kind"
    own: Mapping[str, tuple[float, float, float]] = {
        "X": (1.0, 0.0, 0.0),
        "Y": (0.0, 1.0, 0.0),
        "Z": (0.0, 0.0, 1.0),
    }
    # the length of a leg has no line of its own: its error counts along a direction of its own
    default = own[name] if name in tuple(OWN_DIRECTIONS) else own["X"]
    rotary = kind == "rotary"
    travel = table.travel_deg if rotary else table.travel_mm
    step = table.least_increment_deg if rotary else table.least_increment_mm
    assert travel is not None, "the schema refuses an axis without travel"
    in_mm = (table.velocity_mm_s, table.acceleration_mm_s2, table.jerk_mm_s3)
    in_deg = (table.velocity_deg_s, table.acceleration_deg_s2, table.jerk_deg_s3)
    return Joint(
        name=name,
        kind=kind,
        direction=table.direction or default,
        point_mm=table.point_mm or (0.0, 0.0, 0.0),
        travel=travel,
        least_increment=step or 0.0,
        correct=table.correct,
        most=in_deg if rotary else in_mm,
    )
