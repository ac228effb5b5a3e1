"""Signs, units and places of the curves of a calibration, judged by independent points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from olp.calibration.diagnosis.deciding import Advice, advise
from olp.calibration.diagnosis.doctor import Diagnosis, Verdict, diagnose
from olp.calibration.estimator.covariance import sigmas_at
from olp.calibration.observations.points import Points
from olp.core.errors import ConfigError
from olp.core.machine import Setup, Vector
from olp.core.units import UM_PER_MM
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.measurements.checkpoints import load_checkpoints
from olp.files.sources import Sources
from olp.findings.catalogue import Finding
from olp.workflows.session import PathLike, Session

#: Rows of points that are named in a finding.
_LISTED = 10


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationDiagnosis:
    """What points say of a calibration: the report ("olp-doctor-1") as a mapping, and findings.

    `diagnosis` holds verdicts and estimates, `corrected` the calibration with all that is decided put right,
    `advice` the points that would decide the rest (None where nothing is open), `uncertainty` what is known
    of the corrected one (None where the old one states nothing, or its curves have changed places).
    """

    diagnosis: Diagnosis
    advice: Advice | None
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    uncertainty: Uncertainty | None = None

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
    """Judge the sense, unit and place of every curve of a calibration by points that had no part in it.

    `points` are a file (see `olp.files.measurements.checkpoints`), a plan with points, or Points, which count
    in the machine's frame with `frame_known`. `sigma_um` and `tool_mm` fill in what the file does not say.
    Raises InputError, ConfigError and CannotCompute.
    """
    session = Session.start(machine)
    described = session.setup.machine
    if isinstance(calibration, Calibration):
        stated = calibration
    else:
        stated = load_calibration(calibration, described, read=session.sources.read)
    if isinstance(points, Points):
        taken, known = points, frame_known
    else:
        taken, known = load_checkpoints(points, sigma_um=sigma_um, tool_mm=tool_mm)
        known = known or frame_known
    skip = frozenset(described.compensated_by_controller - stated.active_during_measurement)
    found = diagnose(stated, described.chain, taken, frame_known=known, skip=skip)
    tool_vectors = [tool.tool_vector_mm for tool in described.tools.values()]
    tools = list(dict.fromkeys(tool_vector for tool_vector in tool_vectors if tool_vector is not None))
    advice = advise(found, tools) if found.undecided else None
    left, words = None, "none is stated"
    if not isinstance(calibration, Calibration):
        left, words = _carried(found, calibration, stated, session.sources)
    report = _report(found, advice) | {"uncertainty": words}
    return CalibrationDiagnosis(found, advice, report, tuple(_findings(found, advice)), left)


def _carried(
    found: Diagnosis, path: PathLike, stated: Calibration, sources: Sources
) -> tuple[Uncertainty | None, str]:
    """The uncertainty of the corrected calibration, and words on what becomes of the stated one."""
    try:
        old = load_uncertainty(path, stated, sources.read)
    except ConfigError:
        # curves that were edited by hand have a covariance of others; their signs can be judged all the same
        return None, "not carried over: the covariance is that of another calibration"
    if old is None or not old.entries:
        return None, "none is stated"
    left = found.uncertainty_of(old)
    return left, "carried over" if left is not None else "not carried over: curves have changed places"


def _report(found: Diagnosis, advice: Advice | None) -> dict[str, Any]:
    points = found.seen.points
    after = (
        []
        if advice is None
        else [
            {"name": name, "standard_deviations": z, "does_at_most_um": advice.effect_mm[name] * UM_PER_MM}
            for name, z in advice.z.items()
        ]
    )
    return {
        "schema": "olp-doctor-1",
        "machine": found.calibration.machine,
        "chain": found.chain,
        "points": len(points.axis_mm),
        "frame": "machine" if found.seen.frame_known else "unknown",
        "sigma_um": points.sigma * UM_PER_MM,
        "scatter_over_stated": found.factors.inflation,
        "rms_as_stated_um": found.before_mm * UM_PER_MM,
        "rms_put_right_um": found.after_mm * UM_PER_MM,
        "decided": len(found.verdicts) - len(found.undecided),
        "undecided": len(found.undecided),
        "sense_of_tables": dict(found.senses),
        "arrangements": [change.words for change in found.arrangements],
        "not_told_apart": list(found.doubts),
        "curves": [_row(v) for v in found.verdicts],
        "would_decide": [] if advice is None else _places(advice),
        "after_these_points": after,
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
    }


def _places(advice: Advice) -> list[dict[str, Any]]:
    return [
        {"name": f"point {k}", "axes_mm": axis, "tool_mm": tool}
        for k, (axis, tool) in enumerate(
            zip(advice.axis_mm.tolist(), advice.tool_mm.tolist(), strict=True), start=1
        )
    ]


def _findings(found: Diagnosis, advice: Advice | None) -> Iterator[Finding]:
    for verdict in found.verdicts:
        spread = f"factor {verdict.factor:.3g} with a standard uncertainty of {verdict.sigma:.2g}"
        if verdict.sign == "absent":
            yield Finding("OLP836", f"{verdict.name}: {spread}")
        elif verdict.sign == "flipped" or (verdict.sign == "right" and verdict.applied != 1.0):
            words = [] if verdict.sign == "right" else ["in the other sense"]
            words += [] if verdict.unit in ("right", "undecided") else [verdict.unit]
            yield Finding("OLP831", f"{verdict.name} {', '.join(words)}: {spread}")
        elif verdict.unit == "no factor explains":
            yield Finding("OLP831", f"{verdict.name} in no known unit: {spread}")
    for change in found.arrangements:
        yield Finding("OLP832", change.words)
    if found.undecided:
        names = ", ".join(v.name for v in found.undecided)
        doubts = f"; not excluded: {'; '.join(found.doubts)}" if found.doubts else ""
        hint = ""
        if advice is not None and len(advice.axis_mm):
            hint = f"; {len(advice.axis_mm)} points that would tell more are proposed"
        yield Finding("OLP833", f"{names}{doubts}{hint}", count=len(found.undecided))
    if not found.explained:
        yield Finding(
            "OLP834",
            f"points scatter {found.factors.inflation:.1f} times as much as their stated uncertainty",
        )
    if found.outliers:
        rows = ", ".join(f"row {row} ({off:.0f})" for row, off in found.outliers[:_LISTED])
        yield Finding("OLP835", f"standard deviations off: {rows}", count=len(found.outliers))


__all__ = ["CalibrationDiagnosis", "diagnose_calibration"]
