"""Loads machine, job and calibration files into the values that the rest of `olp` works on.

Paths inside a file are relative to that file. Every loader raises InputError where a file cannot be read and
ConfigError with all problems of the file where it is wrong; both end the command line with exit code 3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as FilePath

from olp.core.errors import ProgramError, UsageError
from olp.core.machine import (
    Axis,
    ControlTimes,
    HolderPart,
    Job,
    Machine,
    Mesh,
    Sanity,
    Setup,
    Tool,
    Vector,
    WorkOffset,
)  # fmt: skip
from olp.core.schema import stated_values
from olp.core.units import AXES, MM_PER_UM, shifted
from olp.files.calibration.reader import load_calibration
from olp.files.problems import Problem, config_error, validate
from olp.files.schemas import JobFile, MachineFile, Tools, WorkOffsets
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes

#: Keys of a machine file that only a machine of any joints has, and keys of its axes.
_OF_JOINTS = {"kinematics", "platforms", "gauge"}
_OF_A_JOINT = {"kind", "direction", "point_mm", "travel_deg"}
#: Says whether a file is there, as `Sources.exists` does.
Exists = Callable[[PathLike], bool]

__all__ = ["load_calibration", "load_job", "load_machine", "load_setup"]


def _is_file(path: PathLike) -> bool:
    return FilePath(path).is_file()


def load_machine(path: PathLike) -> Machine:
    """The machine of an olp-machine-1 file. `calibration` becomes a path that can be opened."""
    return _read_machine(path, read_bytes)[0]


def load_job(path: PathLike, read: Reader = read_bytes) -> Job:
    """The job of an olp-job-1 file. `program`, `machine` and meshes become paths that can be opened."""
    return _read_job(path, read)[0]


def load_setup(machine_path: PathLike | None = None, job_path: PathLike | None = None) -> Setup:
    """Machine and job together. Without `machine_path` the key `machine` of the job names the machine file.

    Refuses names that neither file defines: the tool at the start, touch tools, frames of meshes. Raises
    UsageError where neither the call nor the job names a machine file.
    """
    return read_setup(machine_path, job_path, read_bytes)


def read_setup(
    machine_path: PathLike | None, job_path: PathLike | None, read: Reader, exists: Exists = _is_file
) -> Setup:
    """As `load_setup`, from the bytes that `read` gives for a path; `exists` says whether a file is there."""
    job, job_lines = _read_job(job_path, read, exists) if job_path is not None else (Job(), {})
    machine_path = machine_path if machine_path is not None else job.machine
    if machine_path is None:
        what = f"{job_path} names no machine" if job_path is not None else "no machine file is given"
        raise UsageError(
            f"{what}; name the machine file with -m, or with the key machine of the job file. "
            "olp init writes one; olp correct --skew, --scale or --backlash needs none"
        )
    machine, machine_lines = _read_machine(machine_path, read)
    setup = Setup(machine, job)
    problems = _undefined_tools(setup, machine.work_offsets, machine_lines)
    if machine.default_tool is not None and setup.tool(machine.default_tool) is None:
        problems.append(_no_tool(("job_defaults", "tool"), machine.default_tool, machine_lines))
    if problems:
        raise config_error(problems, str(machine_path))
    problems = _undefined_tools(setup, job.work_offsets, job_lines)
    if any(job.payload_centre_mm):
        key: Path = ("payload_centre_mm",)
        sentence = "payload_centre_mm goes with machines that have rotary joints; leave it out"
        problems.append((line_of(key, job_lines), sentence))
    if job.start_deg:
        key = ("start_deg",)
        sentence = "start_deg goes with machines that have rotary joints; leave it out"
        problems.append((line_of(key, job_lines), sentence))
    if job.joint_targets:
        key = ("joint_targets",)
        sentence = "joint_targets goes with machines that have rotary joints; leave it out"
        problems.append((line_of(key, job_lines), sentence))
    for index, mesh in enumerate(job.meshes):
        if mesh.frame != "machine" and setup.work_offset(mesh.frame) is None:
            key = ("meshes", index, "frame")
            sentence = (
                f'{dotted(key)} = "{mesh.frame}" is not a work offset of machine or job; expected "machine" '
                "or the name of a table [work_offsets.NAME]"
            )
            problems.append((line_of(key, job_lines), sentence))
    if problems:
        raise config_error(problems, str(job_path))
    return setup


def _read_machine(path: PathLike, read: Reader) -> tuple[Machine, Mapping[Path, int]]:
    values, lines = read_toml(read(path), str(path))
    if of_joints(values):
        raise ProgramError(
            f"the machine has the chain {values.get('chain')}, and not three linear axes alone, which is not "
            "built here; use the same verb of the command line, or in Python a function for joints, such as "
            "olp.correct_joints",
            file=str(path),
            line=line_of(("chain",), lines),
            code="OLP563",
        )
    file = validate(MachineFile, values, lines, str(path))
    axes = {
        axis: Axis(
            travel_mm=table.travel_mm,
            least_increment_mm=table.least_increment_mm,
            velocity_mm_s=table.velocity_mm_s,
            acceleration_mm_s2=table.acceleration_mm_s2,
            jerk_mm_s3=table.jerk_mm_s3,
            compliance_um_per_m_s2=_compliance(table.compliance_um_per_m_s2, index),
        )
        for index, (axis, table) in enumerate((axis, getattr(file.axes, axis)) for axis in AXES)
    }
    machine = Machine(
        name=file.name,
        file=str(path),
        chain=file.chain,
        controller=file.controller,
        decimal_point=file.decimal_point,
        tool_change_moves=moved_by_change(file.tool_change_moves),
        home_mm=file.home_mm.values,
        second_home_mm=file.second_home_mm.values,
        tool_change_mm=file.tool_change_mm.values,
        scaling_unit=file.scaling_unit,
        arc_centres=file.arc_centres,
        cycle_return=file.cycle_return,
        scaling_axes=file.scaling_axes,
        lengths_along_z=file.lengths_along_z,
        bracket_comments=file.bracket_comments,
        still_m_codes=frozenset(file.still_m_codes),
        still_g_codes=in_tenths(file.still_g_codes),
        still_macros=frozenset(name.upper() for name in file.still_macros),
        axes=axes,
        calibration=beside(path, file.calibration),
        compensated_by_controller=file.compensated_by_controller,
        real_time=file.real_time,
        work_offsets=work_offsets_of(file.work_offsets),
        tools=tools_of(file.tools),
        styli={name: table.offset_mm for name, table in file.styli.items()},
        default_tool=file.job_defaults.tool,
        default_work_offset=file.job_defaults.work_offset,
        length_active=file.job_defaults.length_active,
        default_motion=file.job_defaults.motion,
        path_mode=file.path.mode,
        blend_mm=file.path.blend_mm,
        times=ControlTimes(
            tool_change_s=file.times.tool_change_s,
            spindle_start_s=file.times.spindle_start_s,
            m_codes_s={int(name[1:]): seconds for name, seconds in file.times.m_codes_s.items()},
        ),
        sanity=Sanity(
            largest_correction_mm=None
            if file.check.largest_correction_um is None
            else file.check.largest_correction_um * MM_PER_UM,
            tool_within_mm=file.check.tool_within_mm,
            temperature_within_K=file.check.temperature_within_K,
            calibration_days=file.check.calibration_days,
            clearance_mm=file.check.clearance_mm,
        ),
    )
    return machine, lines


def of_joints(values: Mapping[str, object]) -> bool:
    """Whether a machine file states joints, not only the limits of three linear axes."""
    axes = values.get("axes")
    tables = axes.values() if isinstance(axes, Mapping) else ()
    stated = {key for table in tables if isinstance(table, Mapping) for key in table}
    return bool(_OF_JOINTS & values.keys() or _OF_A_JOINT & stated)


def have_joints(machine: PathLike | None, job: PathLike | None, read: Reader = read_bytes) -> bool:
    """Whether the machine of a call states joints other than three linear axes. The job names it where the
    call does not. Raises InputError, ConfigError."""
    if machine is None and job is not None:
        machine = load_job(job, read).machine
    return machine is not None and of_joints(read_toml(read(machine), str(machine))[0])


def moved_by_change(stated: bool | Sequence[str]) -> frozenset[str]:
    """The axes that M6 may move, from the key `tool_change_moves`."""
    return frozenset(AXES if stated else ()) if isinstance(stated, bool) else frozenset(stated)


def in_tenths(codes: Sequence[float]) -> frozenset[int]:
    """Ten times the numbers of G codes, as dialects have them."""
    return frozenset(round(10 * code) for code in codes)


def _compliance(stated: float | Vector, axis: int) -> Vector:
    """Deviation of the tool per acceleration, actual minus commanded. A single number is the lag along the
    axis."""
    if isinstance(stated, tuple):
        return stated
    own = [0.0, 0.0, 0.0]
    own[axis] = 0.0 - stated
    return (own[0], own[1], own[2])


def _read_job(path: PathLike, read: Reader, exists: Exists = _is_file) -> tuple[Job, Mapping[Path, int]]:
    values, lines = read_toml(read(path), str(path))
    file = validate(JobFile, values, lines, str(path))
    missing: list[Problem] = []
    meshes = []
    for index, mesh in enumerate(file.meshes):
        where = str(beside(path, mesh.file))
        meshes.append(Mesh(where, mesh.role, mesh.frame, mesh.unit_mm))
        if not exists(where):
            key: Path = ("meshes", index, "file")
            sentence = (
                f'{dotted(key)} = "{mesh.file}" does not exist; expected a path relative to the job file'
            )
            missing.append((line_of(key, lines), sentence))
    if missing:
        raise config_error(missing, str(path))
    stated = file.dialect
    own = None
    if stated is not None:
        from olp.files.described import described

        own = described(stated, beside(path, stated), read)
    job = Job(
        program=beside(path, file.program),
        machine=beside(path, file.machine),
        dialect=None if own is not None else stated,
        described=own,
        part_tolerance_um=file.part_tolerance_um,
        start_mm=file.start_mm.values,
        start_deg=file.start_deg,
        joint_targets=file.joint_targets,
        payload_kg=file.payload_kg,
        payload_centre_mm=file.payload_centre_mm,
        payloads={entry.line: entry.payload_kg for entry in file.payloads},
        parameters=file.parameters,
        block_delete=file.block_delete,
        temperatures_degC={
            name: value
            for name, value in stated_values(file.temperatures_degC).items()
            if name not in ("sensors", "sensor_log", "sensor_log_at_s")
        },
        sensors_degC=file.temperatures_degC.sensors,
        sensor_log=beside(path, file.temperatures_degC.sensor_log),
        sensor_log_at_s=file.temperatures_degC.sensor_log_at_s,
        work_offsets=work_offsets_of(file.work_offsets),
        tools=tools_of(file.tools),
        styli={name: table.offset_mm for name, table in file.styli.items()},
        meshes=tuple(meshes),
    )
    return job, lines


def work_offsets_of(tables: WorkOffsets) -> dict[str, WorkOffset]:
    """The work offsets of tables [work_offsets.NAME], by name."""
    return {
        name: WorkOffset(
            name=name,
            offset_mm=(table.X_mm, table.Y_mm, table.Z_mm),
            rotation_deg=(table.A_deg, table.B_deg, table.C_deg),
            set_by=table.set_by,
            touched_at_mm=table.touched_at_mm.values,
            touch_tool=table.touch_tool,
            touched_payload_kg=table.touched_payload_kg,
        )
        for name, table in tables.items()
    }


def tools_of(tables: Tools) -> dict[int, Tool]:
    """The tools of tables [tools.NUMBER], by number."""
    return {
        int(number): Tool(
            number=int(number),
            name=table.name or "",
            length_mm=(table.X_mm, table.Y_mm, table.Z_mm),
            radius_mm=table.radius_mm,
            wear_mm=table.wear_mm,
            gauge_to_tip_mm=table.gauge_to_tip_mm,
            gauge_to_tip_deg=table.gauge_to_tip_deg,
            set_by=table.set_by,
            touched_at_mm=table.touched_at_mm.complete if table.touched_at_mm else None,
            setter=table.setter,
            constant_mm=None if table.k_um is None else shifted(table.k_um, -3),
            cutting_length_mm=table.cutting_length_mm,
            holder=tuple(
                HolderPart(
                    part.length_mm,
                    part.radius_mm,
                    part.radius_mm if part.top_radius_mm is None else part.top_radius_mm,
                )
                for part in table.holder
            ),
        )
        for number, table in tables.items()
    }


def _undefined_tools(
    setup: Setup, offsets: Mapping[str, WorkOffset], lines: Mapping[Path, int]
) -> list[Problem]:
    return [
        _no_tool(("work_offsets", name, "touch_tool"), offset.touch_tool, lines)
        for name, offset in offsets.items()
        if offset.touch_tool is not None and setup.tool(offset.touch_tool) is None
    ]


def _no_tool(key: Path, number: int, lines: Mapping[Path, int]) -> Problem:
    sentence = f"{dotted(key)} = {number} is not defined; expected the number of a table [tools.N]"
    return line_of(key, lines), sentence


def beside(naming: PathLike, named: str | None) -> str | None:
    """A path that a file names, relative to the folder of that file. An absolute path is unchanged."""
    return None if named is None else str(FilePath(naming).parent / named)
