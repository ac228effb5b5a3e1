"""Loading: from the files or values that a caller gives to all that a run needs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from olp.errormodel import Calibration, ErrorModel, build
from olp.exceptions import ConfigError, UsageError
from olp.files.calibration import load_calibration
from olp.files.config import load_setup
from olp.files.write import read_bytes
from olp.machine import Setup
from olp.program.dialect import Dialect
from olp.program.dialects import DIALECTS, dialect_of

PathLike = str | Path


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Everything loaded that a run needs. `dialect` is that of the control until a program is there
    (`reading`)."""

    setup: Setup
    dialect: Dialect
    calibration: Calibration
    model: ErrorModel
    digest: str

    def reading(self, data: bytes, name: str) -> Loaded:
        """The same for a program: its dialect is settled here, also for what is made of it later. Raises
        ProgramError where it cannot be told."""
        setup, dialect = reading(self.setup, data, name)
        return replace(self, setup=setup, dialect=dialect)


def load(machine: PathLike | Setup, job: PathLike | None, outside: Literal["refuse", "hold"]) -> Loaded:
    """Machine, calibration and job of a run, and the error model that they make."""
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
    skip = described.compensated_by_controller - calibration.active_during_measurement
    model = build(calibration, described.chain, outside=outside, skip_components=frozenset(skip))
    return Loaded(setup, control_of(setup), calibration, model, _digest(described.calibration, described))


def setup_of(machine: PathLike | Setup | None, job: PathLike | None) -> Setup:
    """The setup that a caller gave, or that of a machine file and a job file."""
    return machine if isinstance(machine, Setup) else load_setup(machine, job)


def control_of(setup: Setup) -> Dialect:
    """What the control of a machine reads and writes."""
    dialect = DIALECTS.get(setup.machine.controller)
    if dialect is None:
        raise ConfigError(
            f"controller {setup.machine.controller!r} has no dialect; expected one of {', '.join(DIALECTS)}"
        )
    return dialect


def reading(setup: Setup, data: bytes, name: str) -> tuple[Setup, Dialect]:
    """The dialect of a program, and the setup with it named, so that what is made of the program later is
    read alike. Raises ProgramError where it cannot be told, UsageError for a name that there is not."""
    dialect = dialect_of(setup.job.dialect, control_of(setup), data, name)
    return replace(setup, job=replace(setup.job, dialect=dialect.name)), dialect


def _digest(calibration: str, machine: object) -> str:
    """Hash of the calibration file, its curve files and the machine values that decide the model."""
    import tomllib

    raw = read_bytes(calibration)
    digest = hashlib.sha256(raw)
    for curve in tomllib.loads(raw.decode()).get("curves", []):
        digest.update(read_bytes(Path(calibration).parent / curve["file"]))
    digest.update(repr(getattr(machine, "chain", "")).encode())
    return digest.hexdigest()


def source_of(program: PathLike | bytes) -> tuple[bytes, str]:
    """Bytes and name of a program; bytes that a caller gave have no name."""
    if isinstance(program, bytes):
        return program, ""
    return read_bytes(program), str(program)


def unrolled(data: bytes, name: str, dialect: Dialect, expand: bool, clearance: float | None = None) -> bytes:
    """The text with loops, subprograms and expressions unrolled; subprograms are looked for beside it.
    Raises UsageError for a dialect that has none of them."""
    from olp.program.flatten import flatten as unroll

    if dialect.family != "rs274":
        raise UsageError(f"{dialect.title} is not unrolled; leave --flatten and --expand-cycles out")

    folder = Path(name).parent if name else None

    def beside(wanted: str) -> bytes | None:
        if folder is None:
            return None
        for suffix in ("", ".ngc", ".nc"):
            candidate = folder / f"{wanted}{suffix}"
            if candidate.is_file():
                return read_bytes(candidate)
        return None

    return unroll(
        data, profile=dialect.name, subprograms=beside, expand_cycles=expand, peck_clearance=clearance
    )


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
