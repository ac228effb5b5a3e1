"""Loading: from the files or values that a caller gives to all that a run needs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from olp.core.errors import ConfigError, UsageError
from olp.core.machine import Job, Setup
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import files_beside, load_calibration
from olp.files.calibration.structure import read_drift_log, sensors_of
from olp.files.config import load_setup
from olp.files.described import described
from olp.files.write import read_bytes
from olp.program.dialect import Dialect
from olp.program.registry import DIALECTS, dialect_of, find
from olp.uncertainty.components import unsure

PathLike = str | Path


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Everything loaded that a run needs. `dialect` is that of the control until a program is there
    (`reading`). `skip` are components that the control corrects, `left_out` those that are not corrected
    because they are within their own uncertainty; `model` has neither."""

    setup: Setup
    dialect: Dialect
    calibration: Calibration
    model: ErrorModel
    digest: str
    uncertainty: Uncertainty | None
    skip: frozenset[str]
    left_out: frozenset[str] = frozenset()

    @property
    def full(self) -> ErrorModel:
        """The model with the components that were left out for being within their own uncertainty."""
        if not self.left_out:
            return self.model
        return build(self.calibration, self.setup.machine.chain, outside="hold", skip_components=self.skip)

    def reading(self, data: bytes, name: str) -> Loaded:
        """The same for a program: its dialect is settled here, also for what is made of it later. Raises
        ProgramError where it cannot be told."""
        setup, dialect = reading(self.setup, data, name)
        return replace(self, setup=setup, dialect=dialect)


def load(
    machine: PathLike | Setup,
    job: PathLike | None,
    outside: Literal["refuse", "hold"],
    *,
    only_sure: bool = False,
) -> Loaded:
    """Machine, calibration and job of a run, and the error model that they make; `only_sure` leaves out
    components within their own uncertainty. Raises InputError, ConfigError."""
    setup = setup_of(machine, job)
    described = setup.machine
    if described.calibration is None:
        raise ConfigError(
            f"machine {described.name!r} names no calibration; give the key calibration in its file"
        )
    if "all" in described.compensated_by_controller:
        raise ConfigError(
            'compensated_by_controller = "all": the control corrects everything already, a corrected program '
            "would be corrected twice; list the components that it corrects, or switch its tables off"
        )
    calibration = load_calibration(described.calibration, described, dict(setup.job.temperatures_degC))
    calibration = at_temperatures(calibration, setup.job)
    skip = frozenset(described.compensated_by_controller - calibration.active_during_measurement)
    uncertainty = load_uncertainty(described.calibration, calibration)
    left_out: frozenset[str] = frozenset()
    if only_sure:
        if uncertainty is None:
            raise ConfigError(
                "the calibration states no uncertainty, so nobody knows which components are sure; give the "
                "file of [covariance] or sigma columns, or correct without --only-sure-components",
                file=described.calibration,
            )
        left_out = unsure(calibration, uncertainty) - skip
    model = build(calibration, described.chain, outside=outside, skip_components=skip | left_out)
    digest = _digest(described.calibration, described, left_out)
    return Loaded(setup, control_of(setup), calibration, model, digest, uncertainty, skip, left_out)


def at_temperatures(calibration: Calibration, job: Job) -> Calibration:
    """The calibration with its thermal structure at the temperatures of the job. Raises ConfigError where the
    job names sensors that it does not have, or leaves some out."""
    structure = calibration.structure
    if structure is None:
        if job.sensors_degC or job.sensor_log:
            raise ConfigError(
                "the job states temperatures of sensors, and the calibration has no thermal structure; give "
                "[thermal] structure in the calibration file, or leave the sensors out"
            )
        return calibration
    if job.sensors_degC is not None:
        structure = structure.at(job.sensors_degC)
    elif job.sensor_log is not None:
        log = read_drift_log(job.sensor_log)
        sensors = sensors_of(log, dict.fromkeys(s.name for s in structure.sensors))
        structure = structure.settled(log.time_s, sensors, job.sensor_log_at_s)
    return replace(calibration, structure=structure)


def setup_of(machine: PathLike | Setup | None, job: PathLike | None) -> Setup:
    """The setup that a caller gave, or that of a machine file and a job file."""
    return machine if isinstance(machine, Setup) else load_setup(machine, job)


def control_of(setup: Setup) -> Dialect:
    """What the control of a machine reads and writes."""
    dialect = find(setup.machine.controller) or described(setup.machine.controller)
    if dialect is None:
        raise ConfigError(
            f"controller {setup.machine.controller!r} has no dialect; expected one of {', '.join(DIALECTS)}"
        )
    return dialect


def reading(setup: Setup, data: bytes, name: str) -> tuple[Setup, Dialect]:
    """The dialect of a program, and the setup with it named, so that what is made of the program later is
    read alike. Raises ProgramError where it cannot be told, UsageError for a name that there is not."""
    own = setup.job.described
    if isinstance(own, Dialect):
        return setup, own
    dialect = dialect_of(setup.job.dialect, control_of(setup), data, name)
    own = None if find(dialect.name) is not None else dialect
    return replace(setup, job=replace(setup.job, dialect=dialect.name, described=own)), dialect


def _digest(calibration: str, machine: object, left_out: frozenset[str]) -> str:
    """Hash of the calibration file, the files that it names and the machine values that decide the model."""
    digest = hashlib.sha256(read_bytes(calibration))
    for file in files_beside(calibration):
        digest.update(read_bytes(file))
    digest.update(repr(getattr(machine, "chain", "")).encode())
    if left_out:
        digest.update(repr(sorted(left_out)).encode())
    return digest.hexdigest()


def source_of(program: PathLike | bytes) -> tuple[bytes, str]:
    """Bytes and name of a program; bytes that a caller gave have no name."""
    if isinstance(program, bytes):
        return program, ""
    return read_bytes(program), str(program)


def unrolled(
    data: bytes, name: str, setup: Setup, dialect: Dialect, expand: bool, clearance: float | None = None
) -> bytes:
    """The text with loops, subprograms and expressions unrolled; subprograms are looked for beside it.
    Payloads that the job gives by line become comments first, as lines are others afterwards. Raises
    UsageError for a dialect that has none of them."""
    from olp.program.directives import with_payloads

    if dialect.unroller is None:
        raise UsageError(f"{dialect.title} is not unrolled; leave --flatten and --expand-cycles out")
    data = with_payloads(data, setup.job.payloads, dialect.comment)
    folder = Path(name).parent if name else None

    def beside(wanted: str) -> bytes | None:
        if folder is None:
            return None
        for suffix in ("", ".ngc", ".nc"):
            candidate = folder / f"{wanted}{suffix}"
            if candidate.is_file():
                return read_bytes(candidate)
        return None

    return dialect.unroller(data, dialect, subprograms=beside, expand_cycles=expand, peck_clearance=clearance)


def lever_of(setup: Setup, tool: int | tuple[float, float, float] | None) -> tuple[float, float, float]:
    """Gauge point to tip of a tool number, of a vector, or of the tool in the spindle at the start."""
    if isinstance(tool, tuple):
        return tool
    number = setup.machine.default_tool if tool is None else tool
    if not number:
        return (0.0, 0.0, 0.0)
    found = setup.tool(number)
    if found is None or found.lever_mm is None:
        raise ConfigError(
            f"tool {number} has no lever; give tools.{number}.Z_mm or gauge_to_tip_mm in the machine file"
        )
    return found.lever_mm
