"""Machine, job, calibration and programs of a run on a machine with rotary joints, each opened once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.compensation.joints.arm_path import ArmPath, arm_path
from olp.compensation.joints.branch_ways import follow
from olp.compensation.joints.path import JointPath
from olp.core.errors import ConfigError, ProgramError, UsageError
from olp.core.machine import ZERO, Job, Setup, WorkOffset
from olp.core.spool import Text, whole
from olp.core.values import dataclass
from olp.files.config import load_job
from olp.files.kinematics.load import load_joint_errors
from olp.files.kinematics.machine import load_joint_machine
from olp.files.sources import Source, Sources
from olp.kinematics.coordinates import Coordinates, states_poses, turns_of
from olp.kinematics.errors import MachineErrors, Payload
from olp.kinematics.machine import JointCalibration, JointMachine
from olp.program.dialect import Dialect
from olp.program.pointlist.axis_list import read_axis_list
from olp.program.pointlist.base import PointList
from olp.program.pointlist.dialect import DIALECT as AXIS_LIST
from olp.program.program import Program
from olp.program.registry import Options, dialect_of, find, read
from olp.program.robots.dialect import RobotDialect
from olp.program.rs274.profiles.base import Profile
from olp.program.text.delimited import first_lines
from olp.workflows import refusals
from olp.workflows.flatten import UnrollOptions, as_asked
from olp.workflows.session import PathLike

#: What is read beside lists on an arm.
_OF_ROBOTS = ", and programs of robots"
#: The axes that turn a work offset about, in the order of its table.
_TURNS = "ABC"


@dataclass(frozen=True, slots=True, eq=False)
class JointRun:
    """What a run on a machine with rotary joints needs. `setup` is what the reader of G-code sees, None where
    the machine has other axes than X, Y, Z with rotary ones: then lists of axis values are read. `turned` are
    the rotary values of work offsets by name and axis, `digest` is the hash of the calibration."""

    machine: JointMachine
    calibration: JointCalibration | None
    job: Job
    setup: Setup | None
    turned: Mapping[str, Mapping[str, float]]
    digest: str
    sources: Sources
    program: Source
    files: tuple[str, ...] = field(default_factory=tuple)

    @property
    def errors(self) -> MachineErrors:
        return MachineErrors() if self.calibration is None else self.calibration.errors

    @staticmethod
    def of(
        program: PathLike | bytes | Source | None, machine: PathLike | None, job: PathLike | None = None,
        dialect: str | None = None, sources: Sources | None = None, calibration: str | None = None,
    ) -> JointRun:  # fmt: skip
        """From the files; program and machine of the job where they are not given. `calibration` names
        another file than the machine does, where one is tried. Raises UsageError, InputError, ConfigError,
        ProgramError."""
        sources = sources or Sources()
        stated = Job() if job is None else load_job(job, sources.read)
        machine = stated.machine if machine is None else machine
        program = stated.program if program is None else program
        if machine is None:
            raise UsageError(
                "no machine file is given; name it with -m, or with the key machine of the job file"
            )
        if program is None:
            raise UsageError("no program is given; name it, or set the key program of the job file (-j)")
        described = load_joint_machine(machine, sources.read)
        if calibration is not None:
            described = replace(described, calibration=calibration)
        payload = Payload(stated.payload_kg, stated.payload_centre_mm)
        loaded, digest = load_joint_errors(described, payload, sources.read)
        stated = replace(stated, dialect=dialect or stated.dialect)
        control, setup, turned = described.control, None, {}
        if control is not None:
            offsets = {**control.work_offsets, **stated.work_offsets}
            setup = Setup(
                replace(control, work_offsets=_unturned(control.work_offsets)),
                replace(stated, work_offsets=_unturned(stated.work_offsets)),
            )
            _refuse_undefined(setup, described, str(machine))
            turned = {
                name: dict(zip(_TURNS, offset.rotation_deg, strict=True)) for name, offset in offsets.items()
            }
        source = sources.source(program)
        named = [str(machine), job, described.calibration, source.name]
        files = tuple(dict.fromkeys(str(Path(name).absolute()) for name in named if name))
        return JointRun(
            described, loaded, stated, setup, turned, digest, sources, source, (*sources.files, *files)
        )

    def part_tolerance_um(self, given: float | None) -> float | None:
        """The tolerance of the part: as given, else the job's."""
        return self.job.part_tolerance_um if given is None else given

    def dialect(self, source: Source) -> Dialect:
        """The dialect of a program on this machine. Raises ProgramError where it is not one that is read."""
        if self.machine.arm is not None and not _names_axes(source.data, self.machine):
            own = dialect_of(self.job.dialect, AXIS_LIST, source.data, source.name)
            if isinstance(own, RobotDialect) and own.for_arms:
                return own
        if self.setup is None:
            how = ""
            if turns_of(self.machine.structure) is not None:
                how = ', or program_words = "pose" in [kinematics] where X, Y and Z of programs are the tip'
            if self.job.dialect not in (None, AXIS_LIST.name) or not _names_axes(source.data, self.machine):
                raise ProgramError(
                    f"on a machine with the chain {' '.join(self.machine.structure.chain)} lists of axis "
                    f"values are read{_OF_ROBOTS if self.machine.arm else ''}; expected a table with the "
                    f"columns {', '.join(_columns(self.machine))}{how}; the axis values of poses come from "
                    "olp.kinematics.inverse",
                    code="OLP563",
                )
            return AXIS_LIST
        control = find(self.machine.controller)
        if control is None:
            raise ConfigError(
                f"controller {self.machine.controller!r} has no dialect that is read for such a machine"
            )
        if self.job.dialect is None and _names_axes(source.data, self.machine):
            return AXIS_LIST
        dialect = dialect_of(self.job.dialect, control, source.data, source.name)
        if isinstance(dialect, PointList):
            return dialect
        if not dialect.leads or (isinstance(dialect, Profile) and dialect.commands is not None):
            raise ProgramError(
                f"{dialect.title} programs are not read for machines with "
                "rotary joints; expected G-code such as that of LinuxCNC, Fanuc or Haas, a Sinumerik or "
                "Heidenhain program, or a list of axis values",
                code="OLP563",
            )
        if states_poses(self.machine.structure):
            return dialect
        return dialect.with_tips(self.machine.leads or dialect.leads)

    def read(
        self, source: Source, unrolling: UnrollOptions, *, block_delete: bool = False
    ) -> tuple[Source, JointPath]:
        """A program and its path; `block_delete` leaves `/` blocks out. Raises ProgramError with all that is
        refused."""
        dialect, options = self.dialect(source), Options(block_delete=block_delete)
        switch = block_delete or None
        if isinstance(dialect, RobotDialect):
            setup = self._arm_setup()
            text, program = refusals.read(
                self.sources, source, setup, dialect, options, unrolling, block_delete=switch
            )
            with program.errors():
                return text, self._of_arm(program)
        if isinstance(dialect, PointList) or self.setup is None:
            return source, self._listed(whole(source.data))
        text, program = refusals.read(
            self.sources, source, self.setup, dialect, options, unrolling, block_delete=switch
        )
        with program.errors():
            return text, self._path(program, self.setup)

    def unrolled(self, source: Source, options: UnrollOptions) -> bytes:
        """The text of a program, unrolled. Raises as `olp.workflows.flatten.run`."""
        dialect = self.dialect(source)
        setup = self._arm_setup() if isinstance(dialect, RobotDialect) else self.setup
        if setup is None:
            raise UsageError(f"{dialect.title} cannot be unrolled: each of its rows states all that it moves")
        with source.errors():
            return bytes(as_asked(self.sources, source, setup, dialect, options).data)

    def again(self, data: bytes, dialect: Dialect, *, block_delete: bool = False) -> JointPath:
        """The path of a text that was written."""
        options = Options(block_delete=block_delete)
        if isinstance(dialect, RobotDialect):
            return self._of_arm(read(data, self._arm_setup(), dialect, options))
        if isinstance(dialect, PointList) or self.setup is None:
            return self._listed(data)
        return self._path(read(data, self.setup, dialect, options), self.setup)

    def _path(self, program: Program, setup: Setup) -> JointPath:
        """The path of a program that was read with its words."""
        from_zero = self.machine.tips_from_zero
        path = JointPath.of(
            program, self.machine.structure, self.errors, setup.machine,
            rotated=self.turned, start_deg=self.job.start_deg,
            tips_from_zero=program.dialect.tips_from_zero if from_zero is None else from_zero,
            swivel_axis=self.machine.swivel_axis,
        )  # fmt: skip
        follow(path)
        return path

    def _arm_setup(self) -> Setup:
        """What a reader of robot programs sees."""
        assert self.machine.arm is not None
        return Setup(self.machine.arm, self.job)

    def _of_arm(self, program: Program) -> ArmPath:
        """The path of a robot program."""
        structure = self.machine.structure
        start = np.array([self.job.start_deg.get(name, np.nan) for name in structure.order])
        assert self.machine.arm is not None
        level = self.machine.arm.third_level is True
        return arm_path(program, structure, self.errors, start, from_level=level)

    def _listed(self, data: bytes) -> JointPath:
        """The path of a list of axis values."""
        structure = self.machine.structure
        rows = read_axis_list(data, structure.order, structure.units)
        tools = {
            number: vector
            for number, tool in {**self.machine.tools, **self.job.tools}.items()
            if (vector := tool.tool_vector_mm) is not None
        }
        default = self.machine.default_tool
        if default is None:
            tools[-1] = ZERO
        elif default in tools:
            tools[-1] = tools[default]
        return JointPath.of_list(rows, structure, self.errors, tools)

    def heads(self) -> dict[str, Any]:
        """The parts of a report on the machine and its calibration."""
        structure, calibration = self.machine.structure, self.calibration
        heads: dict[str, Any] = {
            "machine": {
                "name": structure.name,
                "chain": " ".join(structure.chain),
                "controller": self.machine.controller,
            }
        }
        if calibration is not None:
            heads["calibration"] = {
                "measured": calibration.measured,
                "valid_until": calibration.valid_until,
                "temperature_degC": calibration.temperature_degC,
                "sha256": self.digest,
            }
        return heads


def _columns(machine: JointMachine) -> list[str]:
    structure = machine.structure
    return [f"{name}_{unit}" for name, unit in zip(structure.order, structure.units, strict=True)]


def _names_axes(data: Text, machine: JointMachine) -> bool:
    """Whether the first line that is no comment names an axis of the machine with its unit, as the header of
    a list does."""
    rows = [line for line in first_lines(data) if line.strip() and not line.lstrip().startswith("#")]
    head = rows[0] if rows else ""
    return any(re.search(rf"(?<!\w){re.escape(name)}(?!\w)", head) for name in _columns(machine))


def _unturned(offsets: Mapping[str, WorkOffset]) -> dict[str, WorkOffset]:
    """Work offsets whose rotary values are none of a frame that is turned."""
    return {name: replace(offset, rotation_deg=(0.0, 0.0, 0.0)) for name, offset in offsets.items()}


def _refuse_undefined(setup: Setup, machine: JointMachine, file: str) -> None:
    """Raise ConfigError for names that neither file defines, and positions of axes that do not exist."""
    default, order = setup.machine.default_tool, Coordinates.of_words(machine.structure).names
    if default is not None and setup.tool(default) is None:
        raise ConfigError(
            f"job_defaults.tool = {default} is not defined; expected a table [tools.N]", file=file
        )
    unknown = sorted(setup.job.start_deg.keys() - set(order))
    if unknown:
        raise ConfigError(
            f"start_deg names {', '.join(unknown)}; expected rotary axes of {', '.join(order)}", file=file
        )
