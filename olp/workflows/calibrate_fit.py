"""A calibration from the files of measurements: read, fit, and the files to write."""

from __future__ import annotations

import dataclasses
import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from olp.calibration.diagnosis.agreement import compared
from olp.calibration.diagnosis.agreement_report import agreement_findings, agreement_rows
from olp.calibration.diagnosis.apart import targets_apart
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.covariance import covariance_of
from olp.calibration.estimator.curves import calibration_of, sigmas_of
from olp.calibration.estimator.findings import findings_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.nonrigid import NonRigid, nonrigid
from olp.calibration.estimator.residual_map import map_findings, map_summary, residual_map
from olp.calibration.estimator.summary import summary
from olp.calibration.observations.alternating import alternating_findings
from olp.calibration.observations.base import ScatteredState, State
from olp.calibration.observations.copies import repeated_findings
from olp.calibration.observations.measurements import MapWish, Measurements
from olp.core.errors import ConfigError
from olp.core.machine import Setup, Vector
from olp.core.progress import Progress
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.files.calibration.writer import calibration_files
from olp.files.measurements.reader import files_left_out, files_of_measurements, load_measurements
from olp.findings.catalogue import Finding
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Filed

#: Reduced chi-square above which nothing that may be wrong with one source explains the readings.
ABSURD = 1e3
#: Findings that say what is wrong with the readings.
_CAUSES = ("OLP810", "OLP811")


@dataclass(frozen=True, slots=True, eq=False)
class FittedCalibration(Filed):
    """A calibration with what it was made from.

    `fit` holds all parameters with their covariance (`fit.sigma(axis_mm, tool_mm)` is the uncertainty of the
    error of the curves anywhere), `report` the results as a mapping ("olp-fit-1"), `findings` what to know
    about them. `nonrigid` is the error beyond rigid bodies, where a map was asked for;
    `nonrigid.sigma(axis_mm, tool_mm)` is the uncertainty with the map. `inputs` are the files that were
    read, which `write` never overwrites.
    """

    calibration: Calibration
    fit: Fit
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    nonrigid: NonRigid | None = None
    inputs: tuple[str, ...] = ()

    def to_text(self) -> str:
        """The report as `olp calibrate fit` prints it."""
        from olp.reports.outline import by_file, outline

        return outline(by_file(self.full_report()))

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the calibration file `target` and of its curves beside it."""
        sigma = sigmas_of(self.fit, self.calibration)
        covariance = covariance_of(self.fit, self.calibration)
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        return calibration_files(
            self.calibration, Path(target), sigma=sigma, covariance=covariance, notes=notes
        )


def fit_calibration(
    data: PathLike | Sequence[PathLike] | Measurements,
    machine: PathLike | Setup | None = None,
    *,
    datum_mm: Vector | None = None,
    valid_until: datetime.date | None = None,
    map: bool | MapWish | None = None,
    progress: Progress | None = None,
) -> FittedCalibration:
    """The calibration of a machine from its measurements.

    `data` are plans (olp-measurements-1), folders or files of readings that describe themselves, or
    Measurements. Chain, travel and tools come from the machine file; without one the plan states the chain.
    `datum_mm` is where the curves are zero, by default the position in the calibrated box nearest to zero.
    `map` asks for a map of errors that rigid bodies cannot make, or forbids it; without it the plan decides.
    Raises InputError, ConfigError with every problem of the files, and CannotCompute.
    """
    described = None if machine is None else Session.start(machine).setup.machine
    inputs: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    if isinstance(data, Measurements):
        measurements = data
    else:
        sources = [data] if isinstance(data, str | Path) else list(data)
        inputs = files_of_measurements(sources)
        left = files_left_out(sources)
        measurements = load_measurements(sources, None if described is None else described.chain)
    chain = described.chain if described is not None else measurements.chain
    if chain is None:
        raise ConfigError("no chain is stated; give the machine file (-m), or the key chain of the plan")
    if described is not None and described.name != measurements.machine:
        raise ConfigError(
            f'the measurements are of machine "{measurements.machine}", and the machine file is of '
            f'"{described.name}"; expected one machine'
        )
    if described is not None:
        both = sorted(described.compensated_by_controller & measurements.active_during_measurement)
        if both:
            raise ConfigError(
                f"active_during_measurement names {', '.join(both)}, and so does compensated_by_controller "
                "of the machine file; expected each in one of them"
            )
    travel = None if described is None else [described.axes[axis].travel_mm for axis in "XYZ"]
    fitted = fit(measurements, chain, travel_mm=travel, datum_mm=datum_mm, progress=progress)
    wish = measurements.map if map is None else (map or None)
    beyond = None
    if wish is not None:
        wish = measurements.map or MapWish() if wish is True else wish
        beyond = nonrigid(fitted, noise=wish.noise, progress=progress)
        fitted = beyond.fit
    calibration = calibration_of(fitted, valid_until)
    mapped = (
        residual_map(beyond, calibration, wish.within_mm) if beyond and wish and beyond.processes else None
    )
    if mapped is not None:
        calibration = dataclasses.replace(calibration, maps=(mapped,))
    found = compared(fitted, _alone(fitted, beyond))
    tools = [] if described is None else [tool.tool_vector_mm for tool in described.tools.values()]
    tool_vectors = [tool_vector for tool_vector in tools if tool_vector is not None]
    findings = (
        *findings_of(fitted, tool_vectors, travel), *targets_apart(fitted),
        *agreement_findings(found, fitted, tool_vectors),
        *repeated_findings(measurements.observations),
        *alternating_findings(measurements.observations),
        *([Finding("OLP862", f"not read: {', '.join(left)}")] if left else []),
    )  # fmt: skip
    _refuse_absurd(fitted, findings)
    report = summary(fitted, calibration, tool_vectors)
    report["agreement"] = agreement_rows(found, fitted, tool_vectors)
    if beyond is not None:
        report["map"] = map_summary(beyond, mapped)
        findings = (*findings, *map_findings(beyond, mapped))
    return FittedCalibration(calibration, fitted, report, findings, beyond, inputs)


def _alone(fitted: Fit, beyond: NonRigid | None) -> list[State]:
    """The states that are compared: a map describes what curves leave of scattered readings, so these are
    left out."""
    mapped = beyond is not None and beyond.processes
    states = [result.state for result in fitted.results]
    return [state for state in states if not (mapped and isinstance(state, ScatteredState))]


def _refuse_absurd(fitted: Fit, findings: Sequence[Finding]) -> None:
    """Raise ConfigError where the readings are not those of a machine."""
    total = fitted.quality.total
    if not (total.failed and total.reduced > ABSURD):
        return
    causes = tuple(f"{finding.code}: {finding.message}" for finding in findings if finding.code in _CAUSES)
    if not causes:
        evident = ((r.state.label, r.state.observation.evident_mistake()) for r in fitted.results)
        causes = tuple(f"{label}: {words}" for label, words in evident if words)
    worst = max(fitted.quality.sources, key=lambda one: one.reduced, default=total)
    raise ConfigError(
        f"these readings are not those of one machine: reduced chi-square is {total.reduced:.3g}, "
        f"{worst.reduced:.3g} of {worst.source}; expected about 1. "
        + ("; ".join(causes) if causes else "Check units, signs and frames of what is read"),
    )


__all__ = ["FittedCalibration", "fit_calibration"]
