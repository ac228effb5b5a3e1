"""Signs, units and columns of the curves of a calibration, checked with independent points."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from olp.calibration.diagnosis.deciding import Advice, advise
from olp.calibration.diagnosis.doctor import Diagnosis, Verdict, diagnose
from olp.calibration.estimator.covariance import sigmas_at
from olp.calibration.observations.points import Points
from olp.core.errors import ConfigError
from olp.core.machine import Setup, Vector
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.measurements.checkpoints import load_checkpoints
from olp.files.measurements.reader import files_of_measurements
from olp.files.sources import Sources
from olp.findings.catalogue import Finding
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Filed

#: Most rows of points that a finding names.
_LISTED = 10


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationDiagnosis(Filed):
    """The check of a calibration by points: the report ("olp-doctor-1") as a mapping, and findings.

    `diagnosis` holds verdicts and estimates, `corrected` the calibration with all decided mistakes corrected,
    `advice` the points that would decide the rest (None where nothing is undecided). `uncertainty` is that of
    the corrected calibration: None where the old one states none, or where curves were swapped.
    `inputs` are the files that were read, which `write` never overwrites.
    """

    diagnosis: Diagnosis
    advice: Advice | None
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    uncertainty: Uncertainty | None = None
    inputs: tuple[str, ...] = ()

    @property
    def corrected(self) -> Calibration:
        return self.diagnosis.corrected

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the corrected calibration file `target` and of its curves beside it."""
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        known = self.uncertainty
        return calibration_files(
            self.corrected,
            Path(target),
            sigma=None if known is None else sigmas_at(self.corrected, known),
            covariance=known,
            notes=notes,
        )


def diagnose_calibration(
    calibration: PathLike | Calibration,
    points: PathLike | Points,
    machine: PathLike | Setup,
    *,
    frame_known: bool = False,
    sigma_um: float | None = None,
    tool_mm: Vector | None = None,
) -> CalibrationDiagnosis:
    """Check sign, unit and column of every curve of a calibration with points that were not used for it.

    `points` are a file (see `olp.files.measurements.checkpoints`), a plan with points, or Points; with
    `frame_known` these are in the machine's frame. `sigma_um` and `tool_mm` are used where the file states
    none.
    Raises InputError, ConfigError and CannotCompute.
    """
    session = Session.start(machine)
    described = session.setup.machine
    if isinstance(calibration, Calibration):
        stated = calibration
    else:
        stated = load_calibration(calibration, described, read=session.sources.read)
    if isinstance(points, Points):
        observations, known = points, frame_known
    else:
        observations, known = load_checkpoints(points, sigma_um=sigma_um, tool_mm=tool_mm)
        known = known or frame_known
    skip = frozenset(described.compensated_by_controller - stated.active_during_measurement)
    diagnosis = diagnose(stated, described.chain, observations, frame_known=known, skip=skip)
    tool_vectors = [tool.tool_vector_mm for tool in described.tools.values()]
    tools = list(dict.fromkeys(tool_vector for tool_vector in tool_vectors if tool_vector is not None))
    advice = advise(diagnosis, tools) if diagnosis.undecided else None
    corrected_uncertainty, note = None, "none is stated"
    if not isinstance(calibration, Calibration):
        corrected_uncertainty, note = _uncertainty(diagnosis, calibration, stated, session.sources)
    report = _report(diagnosis, advice) | {"uncertainty": note}
    findings = tuple(_findings(diagnosis, advice))
    measured = () if isinstance(points, Points) else files_of_measurements([points])
    inputs = (*session.sources.files, *measured)
    return CalibrationDiagnosis(diagnosis, advice, report, findings, corrected_uncertainty, inputs)


def _uncertainty(
    diagnosis: Diagnosis, path: PathLike, stated: Calibration, sources: Sources
) -> tuple[Uncertainty | None, str]:
    """The uncertainty of the corrected calibration, and a note on the stated one."""
    try:
        old = load_uncertainty(path, stated, sources.read)
    except ConfigError:
        # curves edited by hand have the covariance of other curves; their signs can be checked all the same
        return None, "not carried over: the covariance is that of another calibration"
    if old is None or not old.entries:
        return None, "none is stated"
    uncertainty = diagnosis.uncertainty_of(old)
    return uncertainty, "carried over" if uncertainty is not None else "not carried over: curves were swapped"


def _report(diagnosis: Diagnosis, advice: Advice | None) -> dict[str, Any]:
    points = diagnosis.seen.points
    predicted = (
        []
        if advice is None
        else [
            {"name": name, "standard_deviations": z, "does_at_most_um": advice.effect_mm[name] * UM_PER_MM}
            for name, z in advice.z.items()
        ]
    )
    return {
        "schema": "olp-doctor-1",
        "machine": diagnosis.calibration.machine,
        "chain": diagnosis.chain,
        "points": len(points.axis_mm),
        "frame": "machine" if diagnosis.seen.frame_known else "unknown",
        "sigma_um": points.sigma * UM_PER_MM,
        "scatter_over_stated": diagnosis.factors.inflation,
        "rms_as_stated_um": diagnosis.before_mm * UM_PER_MM,
        "rms_put_right_um": diagnosis.after_mm * UM_PER_MM,
        "decided": len(diagnosis.verdicts) - len(diagnosis.undecided),
        "undecided": len(diagnosis.undecided),
        "sense_of_tables": dict(diagnosis.senses),
        "arrangements": [change.words for change in diagnosis.arrangements],
        "not_told_apart": list(diagnosis.doubts),
        "curves": [_row(v) for v in diagnosis.verdicts],
        "would_decide": [] if advice is None else _points(advice),
        "after_these_points": predicted,
    }


def _row(verdict: Verdict) -> dict[str, Any]:
    return {
        "name": verdict.name,
        "sense": verdict.sign,
        "unit": verdict.unit,
        "factor": verdict.factor,
        "sigma": verdict.sigma,
        "standard_deviations": verdict.z,
        "effect_rms_um": verdict.effect_mm * UM_PER_MM,
        "excluded": ", ".join(verdict.excluded),
    }


def _points(advice: Advice) -> list[dict[str, Any]]:
    return [
        {"name": f"point {k}", "axes_mm": axis, "tool_mm": tool}
        for k, (axis, tool) in enumerate(
            zip(advice.axis_mm.tolist(), advice.tool_mm.tolist(), strict=True), start=1
        )
    ]


def _findings(diagnosis: Diagnosis, advice: Advice | None) -> Iterator[Finding]:
    for verdict in diagnosis.verdicts:
        spread = f"factor {verdict.factor:.3g} with a standard uncertainty of {verdict.sigma:.2g}"
        if verdict.sign == "absent":
            yield Finding("OLP836", f"{verdict.name}: {spread}")
        elif verdict.sign == "flipped" or (verdict.sign == "right" and verdict.applied != 1.0):
            words = [] if verdict.sign == "right" else ["of the other sign"]
            words += [] if verdict.unit in ("right", "undecided") else [verdict.unit]
            yield Finding("OLP831", f"{verdict.name} {', '.join(words)}: {spread}")
        elif verdict.unit == "no factor explains":
            yield Finding("OLP831", f"{verdict.name} in no known unit: {spread}")
    for verdict in diagnosis.not_as_stated:
        off = abs(verdict.factor - 1.0) / verdict.sigma
        yield Finding(
            "OLP831",
            f"{verdict.name} is not as stated, its mistake undecided: factor {verdict.factor:.3g} with "
            f"a standard uncertainty of {verdict.sigma:.2g}, {off:.1f} of them from 1; excluded: "
            + ", ".join(verdict.excluded),
        )
    for change in diagnosis.arrangements:
        yield Finding("OLP832", change.words)
    doubtful = [v for v in diagnosis.undecided if v not in diagnosis.not_as_stated]
    if doubtful:
        names = ", ".join(v.name for v in doubtful)
        doubts = f"; not excluded: {'; '.join(diagnosis.doubts)}" if diagnosis.doubts else ""
        hint = ""
        if advice is not None and len(advice.axis_mm):
            hint = f"; {len(advice.axis_mm)} points that would decide more are proposed"
        yield Finding("OLP833", f"{names}{doubts}{hint}", count=len(doubtful))
    if not diagnosis.explained:
        yield Finding(
            "OLP834",
            f"points scatter {diagnosis.factors.inflation:.1f} times as much as their stated uncertainty",
        )
    if diagnosis.outliers:
        rows = ", ".join(f"row {row} ({off:.0f})" for row, off in diagnosis.outliers[:_LISTED])
        yield Finding("OLP835", f"standard deviations off: {rows}", count=len(diagnosis.outliers))


__all__ = ["CalibrationDiagnosis", "diagnose_calibration"]
