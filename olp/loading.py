"""Loading: from the files or values that a caller gives to all that a run needs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from olp.confidence.components import unsure
from olp.errormodel import Calibration, ErrorModel, build
from olp.errormodel.uncertainty import Uncertainty
from olp.exceptions import ConfigError
from olp.files.calibration import load_calibration
from olp.files.config import load_setup
from olp.files.covariance import load_uncertainty
from olp.files.write import read_bytes
from olp.machine import Setup
from olp.program.profiles import PROFILES, Profile

PathLike = str | Path


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Everything loaded that a run needs. `skip` are components that the control corrects, `left_out` those
    that are not corrected because they are within their own uncertainty; `model` has neither."""

    setup: Setup
    profile: Profile
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
    return Loaded(setup, profile_of(setup), calibration, model, digest, uncertainty, skip, left_out)


def setup_of(machine: PathLike | Setup | None, job: PathLike | None) -> Setup:
    """The setup that a caller gave, or that of a machine file and a job file."""
    return machine if isinstance(machine, Setup) else load_setup(machine, job)


def profile_of(setup: Setup) -> Profile:
    """What the control of a machine reads and writes."""
    profile = PROFILES.get(setup.machine.controller)
    if profile is None:
        raise ConfigError(
            f"controller {setup.machine.controller!r} has no profile; expected one of {', '.join(PROFILES)}"
        )
    return profile


def _digest(calibration: str, machine: object, left_out: frozenset[str]) -> str:
    """Hash of the calibration file, its curve files and the machine values that decide the model."""
    import tomllib

    raw = read_bytes(calibration)
    digest = hashlib.sha256(raw)
    for curve in tomllib.loads(raw.decode()).get("curves", []):
        digest.update(read_bytes(Path(calibration).parent / curve["file"]))
    digest.update(repr(getattr(machine, "chain", "")).encode())
    if left_out:
        digest.update(repr(sorted(left_out)).encode())
    return digest.hexdigest()


def source_of(program: PathLike | bytes) -> tuple[bytes, str]:
    """Bytes and name of a program; bytes that a caller gave have no name."""
    if isinstance(program, bytes):
        return program, ""
    return read_bytes(program), str(program)


def unrolled(data: bytes, name: str, profile: Profile, expand: bool, clearance: float | None = None) -> bytes:
    """The text with loops, subprograms and expressions unrolled; subprograms are looked for beside it."""
    from olp.program.flatten import flatten as unroll

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
        data, profile=profile.name, subprograms=beside, expand_cycles=expand, peck_clearance=clearance
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
