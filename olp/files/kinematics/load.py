"""A machine of any joints from its files: machine, calibration and job."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from olp.core.errors import ConfigError
from olp.core.values import dataclass
from olp.files.calibration.reader import files_beside
from olp.files.config import have_joints, load_job
from olp.files.kinematics.calibration import load_joint_calibration
from olp.files.kinematics.machine import load_joint_machine
from olp.files.real_time import refuse_other
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import MachineErrors, Payload
from olp.kinematics.machine import JointCalibration, JointMachine


@dataclass(frozen=True, slots=True, eq=False)
class JointSetup:
    """What the files of a machine hold, and the machine with its tool that they make. The calibration is None
    where the machine file names none; then the machine has no errors. `digest` is the hash of both."""

    machine: JointMachine
    calibration: JointCalibration | None
    kinematics: Kinematics
    digest: str


def is_of_joints(machine: PathLike) -> bool:
    """Whether a machine file states joints other than three linear axes. Raises InputError, ConfigError."""
    return have_joints(machine, None)


def load_joint_errors(
    machine: JointMachine, payload: Payload, read: Reader = read_bytes
) -> tuple[JointCalibration | None, str]:
    """The calibration that a machine file names, and its hash with that of the machine that it is relative
    to. What the control corrects in real time is left out. Raises InputError, ConfigError."""
    digest = hashlib.sha256()
    calibration = None
    if machine.calibration is not None:
        calibration = load_joint_calibration(machine.calibration, machine.structure, payload, read)
        digest.update(read(machine.calibration))
        for file in files_beside(machine.calibration, read):
            digest.update(read(file))
    digest.update(repr(machine.structure).encode())
    if machine.real_time is not None:
        refuse_other(machine.real_time, digest.hexdigest(), machine.calibration)
        if calibration is not None:
            calibration = replace(calibration, errors=MachineErrors())
    return calibration, digest.hexdigest()


def load_joint_setup(
    machine: PathLike, job: PathLike | None = None, tool: int | None = None, *, by_itself: bool = False
) -> JointSetup:
    """The machine of a machine file, with its calibration, the payload and tools of a job file, and a tool by
    its number (default: that of `job_defaults`). `by_itself`: as if the control corrected nothing. Raises
    InputError, ConfigError."""
    described = load_joint_machine(machine)
    if by_itself:
        described = replace(described, real_time=None)
    stated = None if job is None else load_job(job)
    payload = Payload() if stated is None else Payload(stated.payload_kg, stated.payload_centre_mm)
    tools = {**described.tools, **({} if stated is None else stated.tools)}
    number = described.default_tool if tool is None else tool
    if number is not None and number not in tools:
        raise ConfigError(
            f"tool {number} is not defined; expected the number of a table [tools.N]", file=str(machine)
        )
    vector = None if number is None else tools[number].tool_vector_mm
    if number is not None and vector is None:
        raise ConfigError(
            f"tools.{number} states no gauge_to_tip_mm, and its length is a touch-off value; give the vector",
            file=str(machine),
        )
    calibration, digest = load_joint_errors(described, payload)
    errors = MachineErrors() if calibration is None else calibration.errors
    kinematics = Kinematics(described.structure, errors, vector or (0.0, 0.0, 0.0))
    return JointSetup(described, calibration, kinematics, digest)


def load_kinematics(machine: PathLike, job: PathLike | None = None, tool: int | None = None) -> Kinematics:
    """A machine of any joints with the errors of its calibration: poses of the tool from axis values.

    `job` states the payload and tools, `tool` the number of the tool; the default is that of `job_defaults`.
    A machine file with three linear axes alone is refused. Raises InputError where a file cannot be read, and
    ConfigError with all that is wrong in it.
    """
    if not is_of_joints(machine):
        raise ConfigError(
            "has three linear axes alone; expected tables [axes.NAME] with kind and direction, or use "
            "olp.error_at for it",
            file=str(machine),
        )
    return load_joint_setup(machine, job, tool).kinematics
